"""`catseye night`: a campaign from a seed that reduces to its truth."""

import json

import numpy as np
import pytest

import catseye
from catseye.errors import InputError, ValidityError
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch
from command_scene import command_line


@pytest.fixture
def run(capsys):
    return command_line(capsys)


SMALL = ("--dish-prisms", "20", "--interval-s", "14", "--again", "0.5", "--seed", "5")


@pytest.mark.parametrize("nature", [0.0, 1.0])
def test_a_small_night_is_a_campaign_whose_points_are_its_truth(run, tmp_path, nature):
    strength = ("--nature", "0") if nature == 0.0 else ()  # 1 is the default
    status, said, complained = run("night", tmp_path / "night", *SMALL, *strength, "--json")
    assert status == 0, complained
    assert (json.loads(said)["seed"], json.loads(said)["nature"]) == (5, nature)
    campaign = read_campaign(tmp_path / "night")
    truth = json.loads((tmp_path / "night" / "truth.json").read_text())
    assert truth["nature"]["strength"] == nature
    assert bool(truth["nature"]["waves"]) == (nature > 0.0)
    again = sum(t.startswith("DP") for t in campaign.shots.target) / 20 / 6
    assert 1.2 < again < 1.7  # the weak ranger shoots two thirds
    coordinates = reduce_epoch(campaign).coordinates
    names = [n for n in coordinates.points if n.startswith(("DP", "ZY11")) and n in truth["points"]]
    rows = coordinates.rows(names)
    error = coordinates.x[rows] - np.array([[truth["points"][n][a] for a in "xyz"] for n in names])
    assert np.median(np.abs(error) / coordinates.u[rows]) < 2.0


def test_the_same_seed_is_the_same_night_and_python_makes_it_too(run, tmp_path):
    run("night", tmp_path / "one", *SMALL)
    catseye.night(tmp_path / "two", dish_prisms=20, interval_s=14.0, again=0.5, seed=5)
    for name in ("shots.csv", "truth.json", "targets.csv", "frames.npy"):
        one, two = ((tmp_path / k / name) for k in ("one", "two"))
        assert one.exists() == two.exists()
        assert not one.exists() or one.read_bytes() == two.read_bytes()


def test_a_place_that_holds_something_and_numbers_beyond_the_limits_are_refused(run, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    status, _, complained = run("night", tmp_path, *SMALL)
    assert status == 1
    assert "exists and is not an empty directory" in complained
    with pytest.raises(InputError):
        catseye.night(tmp_path)
    for wrong in (
        {"interval_s": 0.0},
        {"again": -1.0},
        {"elevation_deg": 2.0},
        {"dish_prisms": 20_000},
        {"nature": -1.0},
    ):
        with pytest.raises(ValidityError):
            catseye.night(tmp_path / "new", **wrong)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine.txt"]
