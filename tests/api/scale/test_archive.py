"""`catseye.archive` and `catseye.restore`: what they answer, and what they refuse."""

import json
import sys

import numpy as np
import pytest
from astropy import units

import catseye
from archive_scene import flip, written_year
from catseye.gateways.archive.files import create_archive
from catseye.service.archive.campaigns import archive_campaign
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"


@pytest.fixture
def year(tmp_path):
    return written_year(tmp_path / "years", 6, 8, seed=1).directory


def test_an_archive_is_a_result_with_tables_and_units(year):
    found = catseye.archive(year, check=True)
    assert (found.verdict.word, len(found.nights), found.intact) == ("good", 6, True)
    nights = found.to_table()
    assert len(nights) == 6
    assert nights["elevation"].unit == units.rad
    assert nights["temperature_c"].unit == units.deg_C
    series = found.table("points", ["mjd", "x", "xx"], where={"point": "ZP00002"})
    assert (len(series), series["x"].unit, series["xx"].unit) == (6, units.m, units.m**2)
    assert "6 nights of 2026" in repr(found)
    answer = json.loads(found.to_json())
    assert answer["check"] == {
        "files": 6 * 7,
        "bytes": sum(answer["bytes"].values()),
        "problems": [],
        "not_in_index": [],
    }
    assert answer["raw_bytes"] == 6 * 5 * 8 * 16384


def test_a_night_goes_in_and_comes_out(tmp_path):
    found = catseye.archive(tmp_path / "years", "night-01")
    [night] = found.nights
    assert [(o.state, o.value["added"]) for o in found.outcomes] == [("done", True)]
    assert np.array_equal(found.samples(night, [3, 1]), np.load(NIGHT / "frames.npy")[[3, 1]])
    again = catseye.restore(tmp_path / "years", night, tmp_path / "again")
    assert (again.night, again.files, again.verdict.word) == (night, 48, "good")
    assert catseye.reduce(tmp_path / "again").verdict == catseye.reduce("night-01").verdict
    with pytest.raises(catseye.InputError, match="exists and is not an empty directory"):
        catseye.restore(tmp_path / "years", night, tmp_path / "again")


def test_nights_are_joined_and_removed(year):
    first, second = catseye.archive(year).nights[:2]
    found = catseye.archive(year, compact=True, remove=[first], check=True)
    assert found.change.joined == (2026,)
    assert found.change.removed == (first,)
    assert (found.nights[0], len(found.nights), found.verdict.word) == (second, 5, "good")
    titles = [passage.title for passage in found.passages()]
    assert titles == ["The archive", "Size", "Removed", "Joined", "Checked"]


def test_damage_is_named_by_a_check_and_by_every_use(year):
    path = next((year / "points/year=2026").iterdir())
    flip(path, 200)
    found = catseye.archive(year, check=True)
    assert (found.verdict.word, found.intact) == ("failed", False)
    assert str(path) in found.verdict.why
    assert [p.text for p in found.passages() if p.title == "Damaged"] == [found.check.problems[0] + "."]
    with pytest.raises(catseye.InputError, match=path.name):
        found.table("points")
    entry = next((year / "index").iterdir())
    flip(entry, 300)
    with pytest.raises(catseye.InputError, match=entry.name):
        catseye.archive(year)
    assert len(catseye.archive(year, check=True).check.problems) == 2


def test_files_that_no_entry_names_are_listed(year):
    (year / "points/year=2026/leftover.parquet").write_bytes(b"PAR1")
    found = catseye.archive(year, check=True)
    assert found.check.strangers == ("points/year=2026/leftover.parquet",)
    assert found.verdict.word == "good"


def test_what_is_no_archive_is_refused(tmp_path):
    with pytest.raises(catseye.InputError, match=r"none: is not a directory \(expected an archive"):
        catseye.archive(tmp_path / "none")
    with pytest.raises(catseye.InputError, match=r"holds no archive\.toml"):
        catseye.archive(tmp_path, compact=True)
    with pytest.raises(catseye.ArgumentError, match=r"remove = 'night' \(expected a list"):
        catseye.archive(tmp_path, remove="night")


def test_a_failed_source_and_a_night_without_a_result_show_in_the_verdict(tmp_path):
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad/shots.csv").write_text("nonsense\n")
    found = catseye.archive(tmp_path / "a", [tmp_path / "bad"])
    assert found.verdict.word == "failed"
    assert found.verdict.why.startswith("1 of 1 sources failed: bad: ")
    assert catseye.archive(tmp_path / "a").verdict.text == "Doubtful: there is no night in it."


def test_archives_made_apart_are_equal(tmp_path):
    """Byte for byte, but for the time of archiving: what one machine wrote can be held against another's."""
    for name in ("a", "b"):
        create_archive(tmp_path / name)
        archive_campaign(str(tmp_path / name), str(NIGHT))
    files = {path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*") if path.is_file()}
    differ = {f.parts[0] for f in files if (tmp_path / "a" / f).read_bytes() != (tmp_path / "b" / f).read_bytes()}
    assert differ <= {"nights", "index"}


@pytest.mark.parametrize("package", ["pyarrow", "blosc2"])
def test_a_missing_package_is_one_line_before_anything_is_written(tmp_path, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    expected = r"\(expected catseye installed with its extra: pip install 'catseye\[scale\]'\)"
    with pytest.raises(catseye.InputError, match=rf"^archive needs {package} {expected}$"):
        catseye.archive(tmp_path / "a", "night-01")
    assert not (tmp_path / "a").exists()
