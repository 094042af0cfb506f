"""Tables of a year joined: the same rows, in fewer files, however the work ended before."""

import numpy as np
import pytest

from archive_scene import YearTruth, flip, written_year, year_contents
from catseye.errors import InputError
from catseye.gateways.archive import joining
from catseye.gateways.archive.files import sole_writer
from catseye.gateways.archive.joining import drop_nights, join_years
from catseye.gateways.archive.writer import write_night
from catseye.records.archive.layout import TABLES
from catseye.records.archive.reading import open_archive, read_table
from catseye.records.archive.verification import verify_archive

TRUTH = YearTruth(start=61041.0 + 360.15)  # five nights of 2026, the others of 2027


@pytest.fixture
def archive(tmp_path):
    return written_year(tmp_path / "a", 9, 6, seed=2, truth=TRUTH, residuals=20)


def rows(archive):
    return {kind: read_table(archive, kind) for kind in TABLES}


def same(one, other):
    return all(
        np.array_equal(one[kind][name], other[kind][name], equal_nan=one[kind][name].dtype.kind == "f")
        for kind in one
        for name in one[kind]
    )


def tables(archive):
    return sorted(path.name for path in archive.directory.rglob("*.parquet"))


def test_joined_tables_hold_the_same_rows_in_one_file_a_kind_and_year(archive):
    before = rows(archive)
    assert join_years(archive.directory) == [2026, 2027]
    after = open_archive(archive.directory)
    assert same(rows(after), before)
    assert after.nights == archive.nights
    assert len(tables(archive)) == 2 * len(TABLES)
    check = verify_archive(archive.directory)
    assert (check.problems, check.strangers) == ((), ())
    assert join_years(archive.directory) == []


def test_a_night_that_comes_later_is_read_beside_the_joined_ones_and_joined_next(archive):
    join_years(archive.directory)
    *_, late = year_contents(10, 6, 2, TRUTH, residuals=20)
    write_night(archive.directory, late)
    both = open_archive(archive.directory)
    assert both.nights == (*archive.nights, late.night)
    assert len(read_table(both, "points", ["x"], where={"point": "ZP00001"})["x"]) == 10
    before = rows(both)
    assert join_years(archive.directory) == [2027]
    assert same(rows(open_archive(archive.directory)), before)


@pytest.mark.parametrize("step", ["write_text", "tidy"])
def test_joining_that_was_killed_loses_nothing_and_doubles_nothing(archive, monkeypatch, step):
    """Before the year's entry is written, and before the nights' own files are removed."""
    before = rows(archive)

    def killed(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(joining, step, killed)
        with pytest.raises(KeyboardInterrupt):
            join_years(archive.directory)
    assert same(rows(open_archive(archive.directory)), before)
    join_years(archive.directory)
    assert same(rows(open_archive(archive.directory)), before)
    assert verify_archive(archive.directory).strangers == ()


def test_a_damaged_table_is_not_joined(archive):
    [path] = (archive.directory / "points/year=2027").glob(f"{archive.nights[-1]}*")
    flip(path, 100)
    with pytest.raises(InputError, match=f"{path.name}: differs from its SHA-256"):
        join_years(archive.directory)
    assert path.exists()


@pytest.mark.parametrize("joined", [False, True], ids=["single", "joined"])
def test_removed_nights_leave_the_others_as_they_were(archive, joined):
    if joined:
        join_years(archive.directory)
    gone = [archive.nights[0], *archive.nights[5:]]  # one of 2026, and all of 2027
    assert drop_nights(archive.directory, gone) == tuple(gone)
    left = open_archive(archive.directory)
    assert left.nights == archive.nights[1:5]
    assert left.years == (2026,)
    assert set(read_table(left, "points", ["night"])["night"].tolist()) == set(left.nights)
    check = verify_archive(archive.directory)
    assert (check.problems, check.strangers) == ((), ())


def test_an_unknown_night_is_not_removed(archive):
    with pytest.raises(InputError, match=r"night 'year-9' is not in the archive \(expected one of year-000"):
        drop_nights(archive.directory, [archive.nights[0], "year-9"])
    with pytest.raises(InputError, match=r"night 'year' is the beginning of several"):
        drop_nights(archive.directory, ["year"])
    assert open_archive(archive.directory).nights == archive.nights


def test_a_second_writer_is_refused(archive):
    second = sole_writer(archive.directory)
    with sole_writer(archive.directory), pytest.raises(InputError, match=r"process [0-9]+ is writing to it"):
        second.__enter__()
    with sole_writer(archive.directory):
        pass


def test_temporary_files_of_a_killed_writer_are_removed_by_the_next(archive):
    (archive.directory / "points/.catseye-0123").write_text("half")
    (archive.directory / ".catseye-4567").mkdir()
    (archive.directory / ".catseye-4567/frames.npy").write_text("half")
    with sole_writer(archive.directory):
        assert not list(archive.directory.rglob(".catseye-*"))
