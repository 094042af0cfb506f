"""Tables from columns: cells, columns that a file lacks, rows in batches, values for a table in Python."""

import csv
import io

import numpy as np
import pytest

from catseye.gateways.writers.columns import PIECE, Column, Table, each, texts

NAMES = ("A", 'B "b", b', "")
LENGTHS = np.array([1.25, np.nan, -0.0004])
POINTS = Table[dict](
    "points.csv",
    "points.md",
    (
        Column("point", "", "name", lambda p: p["names"]),
        Column("x_mm", "mm", "place", lambda p: p["x"], "+.2f"),
        Column("exact", "", "the same, exactly", lambda p: p["x"]),
        Column("shots", "", "number of shots", lambda p: p.get("shots"), "d"),
    ),
)


def rows(text):
    return list(csv.reader(io.StringIO(text)))


def test_cells_are_read_back_and_what_is_missing_is_empty():
    text = POINTS.csv({"names": NAMES, "x": LENGTHS, "shots": [3, None, 0]})
    head, *cells = rows(text)
    assert ",".join(head) == POINTS.header
    assert cells == [["A", "+1.25", "1.25", "3"], ['B "b", b', "", "", ""], ["", "-0.00", "-0.0004", "0"]]


def test_a_column_without_values_is_left_out():
    assert rows(POINTS.csv({"names": NAMES[:1], "x": LENGTHS[:1]})) == [
        ["point", "x_mm", "exact"],
        ["A", "+1.25", "1.25"],
    ]


def test_no_source_is_a_header_alone():
    assert POINTS.csv(None) == "point,x_mm,exact,shots\n"


def test_columns_of_different_lengths_are_refused_by_name():
    with pytest.raises(ValueError, match=r"points\.csv: columns of different lengths .*'shots': 1"):
        POINTS.csv({"names": NAMES, "x": LENGTHS, "shots": [1]})


def test_pieces_and_batches_are_the_same_text():
    count = 2 * PIECE + 1
    many = {"names": [f"P{k}" for k in range(count)], "x": np.arange(count) / 7.0, "shots": np.arange(count)}
    batches = [{key: values[k : k + 99] for key, values in many.items()} for k in range(0, count, 99)]
    pieces = list(POINTS.pieces(many))
    assert len(pieces) == 4
    assert "".join(pieces) == POINTS.csv(many) == "".join(POINTS.stream(batches))


@pytest.mark.parametrize(
    ("values", "form", "cells"),
    [
        (np.array([np.inf, -np.inf, np.nan]), ".1f", ["", "", ""]),
        (np.array([np.inf, np.nan]), "", ["inf", ""]),
        (np.array([2.0, 1e16]), ".0f", ["2", "10000000000000000"]),
        ([np.float64(0.1), None, np.int64(3)], "", ["0.1", "", "3"]),
        (np.array(["a", ""]), "", ["a", ""]),
    ],
)
def test_texts(values, form, cells):
    assert texts(values, form) == cells


def test_values_for_a_table_have_units_in_place_of_suffixes():
    source = {"names": NAMES, "x": LENGTHS}
    found = POINTS.quantities(source, ("point", "x_mm", "shots"), rows=np.array([2, 0]))
    assert list(found) == ["point", "x"]
    assert found["point"] == (["", "A"], "")
    np.testing.assert_array_equal(found["x"][0], LENGTHS[[2, 0]])
    assert [unit for _, unit in found.values()] == ["", "mm"]


@pytest.mark.parametrize(
    ("name", "unit", "label"),
    [
        ("temperature_c", "deg_C", "temperature"),
        ("density_m2_per_hz", "m2 / Hz", "density"),
        ("mjd_utc", "d", "mjd"),
        ("w", "", "w"),
    ],
)
def test_the_label_of_a_column_is_its_name_without_the_unit(name, unit, label):
    assert Column(name, unit, "", each(len)).label == label
