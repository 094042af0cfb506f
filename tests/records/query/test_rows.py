"""A few rows by DuckDB are those of `read_table`, and a damaged file is named."""

from dataclasses import replace

import numpy as np
import pytest

from archive_scene import U_ZERO, YearTruth, flip, written_year, year_contents
from catseye.errors import InputError
from catseye.gateways.archive.files import create_archive, sole_writer
from catseye.gateways.archive.writer import write_night
from catseye.records.archive.layout import TABLES
from catseye.records.archive.reading import open_archive, read_table
from catseye.records.query.rows import select_rows


@pytest.fixture(scope="module")
def year(tmp_path_factory):
    return written_year(tmp_path_factory.mktemp("year") / "archive", nights=9, points=30)


@pytest.mark.parametrize(
    ("kind", "column", "value"),
    [("points", "point", "ZP00007"), ("zeros", "ranger", "ZY103"), ("poses", "body", "dish"),
     ("weather", "station", "WX2"), ("certificates", "instrument", "ZY101"), ("nights", "source", "campaign"),
     ("points", "point", "no such point")],
)  # fmt: skip
def test_rows_are_those_of_read_table(year, kind, column, value):
    names = TABLES[kind].names
    found, expected = (
        select_rows(year, kind, names, {column: value}),
        read_table(year, kind, names, where={column: value}),
    )
    assert list(found) == list(names)
    for name in names:
        assert found[name].dtype.kind == expected[name].dtype.kind, name
        numbers = expected[name].dtype.kind == "f"
        assert np.array_equal(found[name], expected[name], equal_nan=numbers), name
    assert value == "no such point" or len(found[column])


def test_a_span_and_a_night(year):
    middle = float(read_table(year, "nights", ("mjd",))["mjd"][4])
    rows = select_rows(year, "points", ("mjd",), {"point": "ZP00007"}, since=middle, until=middle + 2.0)
    assert rows["mjd"].tolist() == [middle, middle + 1.0]
    night = year.nights[3]
    assert set(select_rows(year, "points", ("night",), {"night": night})["night"]) == {night}
    assert len(select_rows(year, "points", ("night",), {}, since=middle + 500.0)["night"]) == 0


def test_an_unknown_column_is_refused(year):
    with pytest.raises(InputError, match="'y2' is unknown"):
        select_rows(year, "points", ("y2",), {})


def test_files_without_a_column_of_today_are_read(tmp_path, monkeypatch):
    """As an earlier catseye wrote them: the first of two nights, both, none."""
    fields = TABLES["zeros"].fields
    earlier = replace(TABLES["zeros"], fields=tuple(field for field in fields if field.name != "u_adjusted"))
    today = TABLES["zeros"]
    for name, layouts in {"mixed": (earlier, today), "old": (earlier, earlier), "turned": (today, earlier)}.items():
        create_archive(tmp_path / name)
        with sole_writer(tmp_path / name):
            for content, layout in zip(year_contents(2, 5, 1, YearTruth()), layouts, strict=True):
                zeros = {column: values for column, values in content.tables["zeros"].items() if column in layout.names}
                with monkeypatch.context() as patched:
                    patched.setitem(TABLES, "zeros", layout)
                    write_night(tmp_path / name, replace(content, tables={**content.tables, "zeros": zeros}))
        found = select_rows(open_archive(tmp_path / name), "zeros", ("u", "u_adjusted"), {"ranger": "ZY104"})
        assert np.isfinite(found["u_adjusted"]).tolist() == [layout is today for layout in layouts]
        assert found["u"].tolist() == [U_ZERO, U_ZERO]


@pytest.mark.parametrize("where", [40, -20, 3000])
def test_a_damaged_file_is_named(tmp_path, where):
    year = written_year(tmp_path / "archive", nights=3, points=30)
    path = tmp_path / "archive" / year.files("points")[1].path
    flip(path, where)
    with pytest.raises(InputError, match=path.name):
        select_rows(year, "points", ("x",), {"point": "ZP00007"})
