"""A simulated campaign is told in night-01's own words: files, keys, columns, decimals."""

import csv
import re
import tomllib

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.simulator.night.sheets import write_night
from catseye.simulator.night.simulate import simulate_night
from repository import ROOT

NIGHT_01 = ROOT / "examples" / "night-01"


@pytest.fixture(scope="module")
def directory(night, tmp_path_factory):
    return write_night(night, tmp_path_factory.mktemp("campaigns") / "simulated")


def files(directory):
    return sorted(str(p.relative_to(directory)) for p in directory.rglob("*") if p.is_file())


def shape_of(line):
    """A line with every number replaced by its number of decimals, and runs of spaces by one."""
    counted = re.sub(r"(?<![A-Za-z0-9])-?\d+(?:\.(\d+))?", lambda m: f"<{len(m[1] or '')}>", line)
    return re.sub(r"\s+", " ", counted)


def test_the_files_are_those_of_night_01(directory):
    assert files(directory) == files(NIGHT_01)


@pytest.mark.parametrize("name", [f for f in files(NIGHT_01) if f.endswith(".toml") and f != "targets.toml"])
def test_each_sheet_has_the_keys_comments_and_decimals_of_night_01(directory, name):
    ours, theirs = ((d / name).read_text().splitlines() for d in (directory, NIGHT_01))
    ours, theirs = ([shape_of(li) for li in t if not li.startswith("name = ")] for t in (ours, theirs))
    assert ours == theirs


def test_the_targets_have_the_names_keys_and_decimals_of_night_01(directory):
    ours, theirs = (tomllib.loads((d / "targets.toml").read_text())["target"] for d in (directory, NIGHT_01))
    assert [(t["name"], list(t)) for t in ours] == [(t["name"], list(t)) for t in theirs]
    ours, theirs = ({shape_of(x) for x in (d / "targets.toml").read_text().splitlines()} for d in (directory, NIGHT_01))
    assert {s for s in ours if not s.startswith("name")} == {s for s in theirs if not s.startswith("name")}


@pytest.mark.parametrize("name", ["benchmarks.csv", "weather.csv", "shots.csv"])
def test_each_table_has_the_columns_and_decimals_of_night_01(directory, name):
    ours, theirs = ((d / name).read_text().splitlines() for d in (directory, NIGHT_01))
    assert ours[0] == theirs[0]
    assert {re.sub(r"ZEG\d+L|ZAG\d+[PD]|[A-Z]{2,3}\d+(-[LRB])?|ZRG", "X", shape_of(x)) for x in ours[1:]} == {
        re.sub(r"ZEG\d+L|ZAG\d+[PD]|[A-Z]{2,3}\d+(-[LRB])?|ZRG", "X", shape_of(x)) for x in theirs[1:]
    }


def test_the_frames_and_the_shots_belong_together(directory):
    frames = np.load(directory / "frames.npy")
    shots = list(csv.DictReader((directory / "shots.csv").read_text().splitlines()))
    reference = np.load(NIGHT_01 / "frames.npy", mmap_mode="r")
    assert (frames.dtype, frames.shape[1:]) == (reference.dtype, reference.shape[1:])
    assert [int(s["frame"]) for s in shots] == list(range(len(frames)))
    assert [int(s["shot"]) for s in shots] == list(range(1, len(frames) + 1))
    assert [float(s["mjd_utc"]) for s in shots] == sorted(float(s["mjd_utc"]) for s in shots)
    assert abs(len(frames) - len(reference)) < 20


def test_the_truth_is_not_in_the_files(night, directory):
    for name, fixed in night.truth.fixed_points.items():
        sheet = tomllib.loads((directory / "monuments" / f"{name}.toml").read_text())
        apart = fixed * 1e3 - [sheet["x_mm"], sheet["y_mm"], sheet["z_mm"]]
        assert 0.002 < np.abs(apart).max() < 0.5  # u = 0.1 mm
    for entry in tomllib.loads((directory / "targets.toml").read_text())["target"]:
        if entry["frame"] == "ground":
            apart = night.truth.points[entry["name"]] * 1e3 - entry["position_mm"]
            assert 0.5 < np.abs(apart).max() < 60  # 15 mm, and 30 mm in one


def test_writing_over_a_campaign_is_refused_and_leaves_it_alone(directory, night):
    before = files(directory)
    with pytest.raises(InputError, match="not an empty directory"):
        write_night(night, directory)
    assert files(directory) == before
    assert [p.name for p in directory.parent.iterdir()] == [directory.name]


def test_the_same_seed_writes_the_same_bytes(directory, tmp_path):
    again = write_night(simulate_night(11), tmp_path / "again")
    for name in files(directory):
        assert (directory / name).read_bytes() == (again / name).read_bytes(), name


def test_another_seed_makes_another_site(night):
    other = simulate_night(10)
    assert not np.array_equal(other.frames[:5], night.frames[:5])
    assert other.heads["ZY101"].d0_mm != night.heads["ZY101"].d0_mm
