"""Answers as tables, sentences, figures, JSON and files."""

import csv
import io
import json

import numpy as np
import pytest

import catseye
from archive_scene import YearTruth, written_year
from catseye.gateways.query.answer import FORMS, answer_lines
from catseye.gateways.query.summary import date_of
from catseye.records.archive.reading import read_table
from catseye.reduction.query.span import ArchiveSpan
from catseye.reduction.query.surface import surface_series
from query_scene import APERTURE, dish_archive

TRUTH = YearTruth(zero_drift={"ZY110": 1e-3})


@pytest.fixture(scope="module")
def year(tmp_path_factory):
    return written_year(tmp_path_factory.mktemp("year") / "archive", nights=40, points=20, truth=TRUTH)


@pytest.fixture(scope="module")
def surface(tmp_path_factory):
    return surface_series(ArchiveSpan(dish_archive(tmp_path_factory.mktemp("dish") / "archive", nights=5)), APERTURE)


QUESTIONS = {
    "nights": {},
    "point": {"point": "ZP00004"},
    "ranger": {"ranger": "ZY110"},
    "pose": {"pose": "dish"},
    "certificates": {"certificates": "year-003"},
    "sql": {"sql": "SELECT night, temperature_c, points FROM nights ORDER BY mjd"},
}


@pytest.mark.parametrize("question", QUESTIONS)
def test_every_form_of_an_answer_has_the_same_rows(year, question, tmp_path):
    result = catseye.query(year.directory, **QUESTIONS[question])
    assert result.question == question
    found = json.loads(result.to_json())
    assert found["verdict"]["word"] == "good"
    for passage in result.passages():
        assert passage.text.endswith(".")
    catseye.save(result, tmp_path / "out")
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    for name, table in result.tables().items():
        rows = list(csv.DictReader(io.StringIO((tmp_path / "out" / f"{name}.csv").read_text())))
        assert len(rows) == len(table) == len(found[name]) == len(written[name]) > 0
    assert {path.stem for path in (tmp_path / "out").glob("*.svg")} == set(result.figures())
    assert len(result.lines()) <= 26


def test_a_point_in_units(year):
    rows = read_table(year, "points", ("x", "xx", "mjd"), where={"point": "ZP00004"})
    result = catseye.query(year.directory, point="ZP00004")
    table = result.to_table()
    assert np.array_equal(table["x"].to_value("m"), rows["x"])
    assert table["u_x"].to_value("m") == pytest.approx(np.sqrt(rows["xx"]))
    assert table["mjd"].unit == "d"
    assert table["elevation"].unit == "deg"
    found = json.loads(result.to_json())
    assert [row["x_m"] for row in found["point"]] == rows["x"].tolist()
    assert found["name"] == "ZP00004"
    assert found["archived_nights"] == 40


def test_a_ranger_in_words(year):
    result = catseye.query(year.directory, ranger="ZY110")
    [zero] = [passage.text for passage in result.passages() if passage.title == "The zero"]
    assert "a clear drift, by 40 nights" in zero
    [row] = json.loads(result.to_json())["drift"]
    assert row["rate"] == pytest.approx(1e-3, abs=4 * row["u_rate"])


def test_units_of_sql_and_its_empty_answer(year):
    table = catseye.query(year.directory, sql=QUESTIONS["sql"]["sql"]).to_table()
    assert table["temperature_c"].unit == "deg_C"
    assert table["points"].tolist() == [20] * 40
    empty = catseye.query(year.directory, sql="SELECT night FROM nights WHERE points < 0")
    assert (len(empty.to_table()), empty.lines()) == (0, ["night"])


def test_figures_show_every_night(year):
    figures = catseye.query(year.directory, point="ZP00004").figures()
    assert list(figures) == ["date", "elevation", "temperature"]
    for figure in figures.values():
        for panel in figure.axes:
            drawn = max(len(line.get_xdata()) for line in panel.lines)
            assert drawn == 40


def test_a_surface_in_every_form(surface):
    form = FORMS["surface"]
    texts = [passage.text for passage in form.passages(surface)]
    assert texts[0].startswith("220 prisms; focal length 59.9")
    assert "astigmatism 0°" in texts[1]
    lengths = {table.file: len(table.csv(surface).splitlines()) - 1 for table in form.tables}
    assert lengths == {"surface.csv": 5, "terms.csv": 5 * 11, "prisms.csv": 220}
    assert len(answer_lines("surface", surface)) == 6


def test_long_tables_are_cut_in_the_middle(year):
    lines = catseye.query(year.directory).lines()
    assert lines[13] == "... 16 more rows"
    assert len(lines) == 26


def test_dates():
    assert (date_of(61041.999), date_of(61042.0)) == ("2026-01-01", "2026-01-02")
