"""`catseye night`: a campaign from a seed that reduces to its truth."""

import json
import tomllib

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


def test_a_lie_changes_the_record_and_not_the_truth(run, tmp_path):
    small = {"dish_prisms": 20, "interval_s": 14.0, "again": 0.5, "seed": 5}
    lies = ("monument ZY105 1 0 0", "mmhg WX1")
    status, _, complained = run("night", tmp_path / "one", *SMALL, "--lie", lies[0], "--lie", lies[1])
    assert status == 0, complained
    catseye.night(tmp_path / "two", **small, lies=lies)
    catseye.night(tmp_path / "honest", **small)
    for name in ("truth.json", "weather.csv", "monuments/ZY105.toml", "frames.npy"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    one, honest = (json.loads((tmp_path / k / "truth.json").read_text()) for k in ("one", "honest"))
    assert (one.pop("lies"), honest.pop("lies")) == (["monument ZY105 1 0 0", "mmhg WX1"], [])
    assert one == honest
    x = [tomllib.loads((tmp_path / k / "monuments" / "ZY105.toml").read_text())["x_mm"] for k in ("one", "honest")]
    assert x[0] - x[1] == pytest.approx(1.0, abs=1e-6)


def test_an_unknown_lie_is_refused_in_one_line_and_nothing_is_written(run, tmp_path):
    status, _, complained = run("night", tmp_path / "one", *SMALL, "--lie", "rumour ZY105")
    assert status == 1
    assert "'rumour ZY105': unknown kind (expected one of target, monument" in complained
    assert not list(tmp_path.iterdir())


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


def gaps_of(campaign):
    """Times between two shots of one ranger, s."""
    rangers, mjd = np.array(campaign.shots.ranger), campaign.shots.mjd_utc
    return np.concatenate([np.diff(mjd[rangers == name]) for name in set(campaign.shots.ranger)]) * 86_400.0


@pytest.mark.parametrize("seed", range(6))
def test_whatever_is_allowed_is_a_campaign_in_which_no_ranger_shoots_twice_at_once(tmp_path, seed):
    """Drawn from the whole of each range, the ends of the interval among them; a buffer is 128 cycles of 1 kHz."""
    rng = np.random.default_rng((39, seed))
    options = {
        "interval_s": [0.1281, 0.2, 1.0, 30.0, 1000.0, float(rng.uniform(0.129, 20.0))][seed],
        "dish_prisms": int(rng.integers(0, 12)),
        "elevation_deg": float(rng.choice([5.0, 90.0, rng.uniform(5.0, 90.0)])),
        "azimuth_deg": float(rng.uniform(-270.0, 450.0)),
        "again": float(rng.choice([0.0, rng.uniform(0.0, 1.5)])),
        "nature": float(rng.choice([0.0, 1.0, 10.0])),
    }
    catseye.night(tmp_path / "night", seed=seed, **options)
    campaign = read_campaign(tmp_path / "night")
    assert gaps_of(campaign).min() >= 0.128 - 2e-4  # shots.csv has steps of 86 us
    assert np.median(gaps_of(campaign)) == pytest.approx(options["interval_s"], rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("interval_s", [0.2, 0.5, 30.0, 600.0])
def test_any_rhythm_is_reduced_to_its_truth(tmp_path, interval_s):
    catseye.night(tmp_path / "night", dish_prisms=20, again=0.5, seed=7, nature=0.0, interval_s=interval_s)
    truth = json.loads((tmp_path / "night" / "truth.json").read_text())
    coordinates = reduce_epoch(read_campaign(tmp_path / "night")).coordinates
    names = [n for n in coordinates.points if n.startswith(("DP", "ZY11")) and n in truth["points"]]
    rows = coordinates.rows(names)
    error = coordinates.x[rows] - np.array([[truth["points"][n][a] for a in "xyz"] for n in names])
    assert np.median(np.abs(error) / coordinates.u[rows]) < 2.0


def test_more_shots_than_a_day_holds_are_refused_with_the_interval_that_fits(run, tmp_path):
    few = ("--dish-prisms", "100", "--again", "2", "--seed", "3")
    status, _, complained = run("night", tmp_path / "night", *few, "--interval-s", "600")
    assert status == 1
    fits = float(complained.partition("expected at most ")[2].partition(" s,")[0])
    assert "a campaign holds 24 h" in complained
    with pytest.raises(ValidityError):
        catseye.night(tmp_path / "night", dish_prisms=100, again=2, seed=3, interval_s=fits + 0.01)
    catseye.night(tmp_path / "night", dish_prisms=100, again=2, seed=3, nature=0.0, interval_s=fits)
    mjd = read_campaign(tmp_path / "night").shots.mjd_utc
    assert 0.9 < np.ptp(mjd) < 1.0


TINY = ("--dish-prisms", "1", "--again", "0", "--nature", "0", "--seed", "3")


@pytest.mark.parametrize("file", ["site.toml", "weather.csv", "shots.csv", "frames.npy", "truth.json"])
def test_a_disk_that_is_full_is_named_by_its_file_and_nothing_is_left(run, tmp_path, file):
    """A byte less than the file needs, by the largest size that any may have (ulimit -f)."""
    import resource

    assert run("night", tmp_path / "whole", *TINY)[0] == 0
    size = {path.name: path.stat().st_size for path in (tmp_path / "whole").rglob("*.*") if path.is_file()}
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size[file] - 1, before[1]))
        status, _, complained = run("night", tmp_path / "night", *TINY)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert status == 1
    named, _, why = complained.partition(": cannot be written: ")
    assert why == "File too large\n"
    assert size[named.removeprefix(f"catseye: {tmp_path / 'night'}/").rpartition("/")[2]] >= size[file]
    assert [path.name for path in tmp_path.iterdir()] == ["whole"]
