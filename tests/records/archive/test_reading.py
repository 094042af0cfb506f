"""Columns of an archive's tables: what was written comes back, in order, and damage is named."""

import numpy as np
import pytest

from archive_scene import YearTruth, flip, point_names, written_year
from catseye.errors import InputError
from catseye.records.archive.layout import TABLES
from catseye.records.archive.reading import open_archive, read_table

NIGHTS, POINTS = 12, 20


@pytest.fixture(scope="module")
def year(tmp_path_factory):
    truth = YearTruth(steps={"ZP00003": (6, (0.0, 0.0, 0.01))}, missing=(4,))
    return written_year(tmp_path_factory.mktemp("archive") / "a", NIGHTS, POINTS, seed=3, truth=truth, residuals=30)


def test_nights_are_in_order_of_time_and_a_missing_one_is_none(year):
    assert len(year.nights) == NIGHTS - 1
    assert year.years == (2026,)
    mjd = read_table(year, "nights", ["mjd"])["mjd"]
    assert np.all(np.diff(mjd) > 0)
    assert np.max(np.diff(mjd)) == pytest.approx(2.0)


@pytest.mark.parametrize("kind", TABLES)
def test_every_table_has_its_columns_types_and_order(year, kind):
    table = read_table(year, kind)
    layout = TABLES[kind]
    assert tuple(table) == layout.names
    for field in layout.fields:
        assert table[field.name].dtype.kind == {"text": "U", "float": "f", "integer": "i"}[field.kind]
    rows = list(zip(table[layout.fields[0].name].tolist(), table["mjd"].tolist(), strict=True))
    assert rows == sorted(rows)
    assert len(rows) >= NIGHTS - 1


def test_a_series_of_one_point_shows_the_step_that_was_put_in(year):
    series = read_table(year, "points", ["mjd", "z", "temperature_c", "zz"], where={"point": "ZP00003"})
    assert len(series["mjd"]) == NIGHTS - 1
    other = read_table(year, "points", ["z"], where={"point": "ZP00004"})["z"]
    assert not np.allclose(series["z"], other)
    assert np.allclose(series["zz"], 120e-6**2)
    late = series["mjd"] > series["mjd"][0] + 5.5
    assert series["z"][late].mean() - series["z"][~late].mean() == pytest.approx(0.01, abs=5e-3)


def test_rows_are_chosen_by_values_and_by_time(year):
    names, _ = point_names(POINTS)
    pair = read_table(year, "points", ["point"], where={"point": (names[2], names[5])})["point"]
    assert pair.tolist() == [names[2]] * (NIGHTS - 1) + [names[5]] * (NIGHTS - 1)
    one = read_table(year, "points", where={"night": year.nights[1], "point": names[0]})
    assert one["night"].tolist() == [year.nights[1]]
    first, second = read_table(year, "nights", ["mjd"])["mjd"][[0, 2]]
    span = read_table(year, "nights", ["mjd"], since=first, until=second)["mjd"]
    assert len(span) == 2
    assert len(read_table(year, "points", where={"point": "no such"})["x"]) == 0
    assert len(read_table(year, "points", until=10.0)["x"]) == 0


def test_an_unknown_table_or_column_is_refused_with_those_there_are(year):
    with pytest.raises(InputError, match=r"^table 'point' is unknown \(expected one of nights, points"):
        read_table(year, "point")
    with pytest.raises(InputError, match=r"column 'x_m' is unknown \(expected one of point, night"):
        read_table(year, "points", ["x_m"])
    with pytest.raises(InputError, match="column 'name' is unknown"):
        read_table(year, "points", where={"name": "ZP00000"})


def test_a_directory_that_is_no_archive_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"holds no archive.toml \(expected an archive"):
        open_archive(tmp_path)
    with pytest.raises(InputError, match="is not a directory"):
        open_archive(tmp_path / "none")
    (tmp_path / "archive.toml").write_text('format = "catseye-archive-7"\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"format = 'catseye-archive-7' \(expected 'catseye-archive-1'; a newer"):
        open_archive(tmp_path)


def test_any_flipped_bit_of_a_table_is_named_or_changes_nothing(tmp_path):
    """Pages have checksums, the footer has one in the index; what neither covers is the header of a page."""
    archive = written_year(tmp_path / "a", 2, 5, seed=1)
    [path] = (tmp_path / "a/points/year=2026").glob(f"{archive.nights[1]}*")
    good, before = path.read_bytes(), read_table(archive, "points")
    rng = np.random.default_rng(7)
    named = 0
    for _ in range(200):
        flip(path, int(rng.integers(len(good))), int(rng.integers(8)))
        after, problem = answer_or_refusal(archive)
        named += after is None
        assert after is not None or str(path) in problem
        assert after is None or all(np.array_equal(after[n], before[n], equal_nan=n in FLOATS) for n in after)
        path.write_bytes(good)
    assert named > 150


FLOATS = {field.name for field in TABLES["points"].fields if field.kind == "float"}


def answer_or_refusal(archive):
    try:
        return read_table(archive, "points"), ""
    except InputError as problem:
        return None, str(problem)


def test_a_file_cut_off_or_missing_is_named(tmp_path):
    archive = written_year(tmp_path / "a", 2, 5, seed=1)
    [path] = (tmp_path / "a/points/year=2026").glob(f"{archive.nights[1]}*")
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError, match=f"{path.name}: holds [0-9]+ bytes, [0-9]+ in the index: damaged"):
        read_table(archive, "points")
    path.unlink()
    with pytest.raises(InputError, match=f"{path.name}: missing: damaged"):
        read_table(archive, "points")


def test_a_damaged_entry_of_the_index_is_named(tmp_path):
    archive = written_year(tmp_path / "a", 2, 5, seed=1)
    entry = tmp_path / f"a/index/{archive.nights[0]}.json"
    flip(entry, entry.read_bytes().index(b"campaign"))
    with pytest.raises(InputError, match=f"{entry.name}: differs from its SHA-256: damaged"):
        open_archive(tmp_path / "a")
