"""Benchmarks of a campaign as refractometers, and lines whose temperature sound measured."""

import dataclasses

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.night.campaign import read_campaign
from catseye.records.night.path_temperature import PathTemperature, path_temperature_columns
from catseye.reduction.air.group_index import benchmark_refractometers
from catseye.reduction.epoch.contradictions.contradiction import RecordGroup
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.simulator.night.faults import Faults
from catseye.simulator.night.sheets import write_night
from catseye.simulator.night.simulate import LineWarmth, SimulatedTelescope, simulate_night
from nature_scene import tally

CLEAR = {"fraction_blocked": 0.0, "fraction_reflected": 0.0, "weak_ranger": None, "wrong_position_mm": 0.0}
SMALL = SimulatedTelescope(dish_prisms=8, triplets=3)
LIE = 1.5  # °C
POINT = "ZEG41040L"


@pytest.fixture(scope="module")
def lied(tmp_path_factory):
    """A night whose lower station reads 1.5 °C too high, its campaign, and the reduction of both kinds."""
    night = simulate_night(21, faults=Faults(**CLEAR, lying_thermometer_c=LIE, lying_station="WX1"), telescope=SMALL)
    campaign = read_campaign(write_night(night, tmp_path_factory.mktemp("lied") / "night"))
    without = dataclasses.replace(campaign, benchmarks=())
    return night, reduce_epoch(campaign), reduce_epoch(without)


def test_with_benchmarks_a_lying_thermometer_is_found_and_without_them_it_is_believed(lied):
    night, reduction, without = lied
    true = night.truth.thermometer_offsets_c["WX1"]
    found, u = reduction.coordinates.air["WX1"]
    assert abs(true) > 1.0
    assert abs(found - true) < 4.0 * u
    assert u < abs(true)  # the scale or the pressure may be wrong instead: it is as unsure as it is large
    assert any("WX1's thermometer" in note and "another scale or pressure" in note for note in reduction.notes)
    blind, u_blind = without.coordinates.air["WX1"]
    assert u_blind > 0.2  # the prior's 0.3, less what the monuments' net says of the scale
    assert abs(blind - true) > 0.8
    # the benchmarks lie near the ground: they judge WX1, and the index of the paths at its height
    assert low_paths_off(night, reduction) < 1.0e-6  # the other explanations have their share of the scale
    for kind, mean in tally(night.truth, reduction, 21)["mean"].items():
        assert mean < 2.0, kind
    assert low_paths_off(night, without) > 1.0e-6


def low_paths_off(night, reduction):
    """Mean error of the index of the paths that stay within 5 m of the ground."""
    ranges, shots = reduction.coordinates.ranges, reduction.campaign.shots.shot
    marks = [k for k, target in enumerate(ranges.target) if target.startswith("ZBM")]
    true = np.array([night.truth.path_refractivity_ppm[str(shots[ranges.shot[k]])] for k in marks]) * 1e-6
    return abs(float(np.mean(ranges.refractivity[marks] - true)))


def test_each_benchmark_path_reports_its_index_beside_the_weathers(lied):
    night, reduction, _ = lied
    series = benchmark_refractometers(reduction)
    assert [(s.benchmark, s.ranger) for s in series] == [(b.name, b.ranger) for b in night.benchmarks]
    z, lie = [], []
    for s in series:
        row = {m: k for k, m in enumerate(reduction.campaign.shots.mjd_utc)}
        shots = [str(reduction.campaign.shots.shot[row[m]]) for m in s.mjd_utc]
        true = np.array([night.truth.path_refractivity_ppm[shot] for shot in shots]) * 1e-6
        z.extend(((s.path - true) / s.u_path).tolist())
        assert np.all(np.diff(s.mjd_utc) > 0.0)
        np.testing.assert_array_equal(s.difference, s.path - s.weather)
        assert np.all(s.difference > 0.0)  # the air is colder than WX1 reads, and so its index higher
        lie.append((s.too_warm_c, s.u_too_warm_c))
    assert len(z) == 24
    # six certificates and zeros, each shared by four shots: chi-square / 24 has the spread of some eight values
    assert 0.25 < np.mean(np.square(z)) < 2.3
    value, u = np.array(lie).T
    mean = np.sum(value / u**2) / np.sum(1 / u**2)
    # the paths lie at WX1's height: its own offset, the surface layer of 0.4 °C and the paths' 0.15 ppm besides
    assert mean == pytest.approx(night.truth.thermometer_offsets_c["WX1"], abs=0.4)


def test_night_01_has_six_such_paths_and_they_halve_the_uncertainty_of_its_lower_thermometer(few_01, reduced_few_01):
    assert len(benchmark_refractometers(reduced_few_01)) == 6
    without = reduce_epoch(dataclasses.replace(few_01, benchmarks=()))
    assert without.coordinates.air["WX1"][1] > 1.8 * reduced_few_01.coordinates.air["WX1"][1]


@pytest.fixture(scope="module")
def warmed(tmp_path_factory):
    """A night in which all lines to one point are warmer by 4 °C than smooth air, with and without sound."""
    root, made = tmp_path_factory.mktemp("warmed"), {}
    lines = {(f"ZY{k}", POINT): 4.0 for k in range(101, 112, 2)}
    for name, u in (("deaf", None), ("hearing", 0.1)):
        night = simulate_night(7, faults=Faults(**CLEAR), warmth=LineWarmth(lines, u), telescope=SMALL)
        made[name] = night, reduce_epoch(read_campaign(write_night(night, root / name)))
    return made


def misplaced(night, reduction):
    """Error of the point (m), and chi-square of it with 3 degrees of freedom."""
    c = reduction.coordinates
    k = c.index(POINT)
    error = c.x[k] - night.truth.points[POINT]
    return float(np.linalg.norm(error)), error @ np.linalg.solve(c.block([POINT]), error)


def test_sound_along_warm_lines_puts_their_point_right(warmed):
    wrong, surprise = misplaced(*warmed["deaf"])
    assert wrong > 0.4e-3  # 4 ppm of 110 m, its height worst
    assert surprise > 20.0
    right, surprise = misplaced(*warmed["hearing"])
    assert right < 0.25e-3
    assert surprise < 14.0  # 3 in 1000 for three degrees of freedom


def test_the_index_of_a_sounded_line_is_the_true_one(warmed):
    night, reduction = warmed["hearing"]
    ranges, shot = reduction.coordinates.ranges, reduction.campaign.shots.shot
    mine = [k for k, t in enumerate(ranges.target) if t == POINT]
    true = np.array([night.truth.path_refractivity_ppm[str(shot[ranges.shot[k]])] for k in mine])
    error = ranges.refractivity[mine] * 1e6 - true
    # 0.1 °C of sound and 0.15 ppm of eddies on each of six paths; 4 ppm without
    assert np.sqrt(np.mean(error**2)) < 0.4
    assert len(mine) == 12


def test_every_sounded_line_is_a_parameter_with_its_prior_and_a_note(warmed):
    _, reduction = warmed["hearing"]
    sound = reduction.coordinates.sound
    assert sorted(sound) == [f"{POINT} - ZY{k}" for k in range(101, 112, 2)]
    assert all(0.05 < u < 0.1 for _, u in sound.values())  # ranges tell a little beyond the prior of 0.1 °C
    notes = [n for n in reduction.notes if "°C by sound for 2 shots" in n]
    assert len(notes) == 6
    assert list(reduction.coordinates.air) == ["WX1", "WX2", "bend"]
    assert warmed["deaf"][1].coordinates.sound == {}


def sounded(campaign, rows):
    """The campaign with path temperatures (mjd, ranger, target, °C, u)."""
    keys = ("mjd_utc", "ranger", "target", "temperature_c", "u_temperature_c")
    records = [PathTemperature(**dict(zip(keys, row, strict=True))) for row in rows]
    return dataclasses.replace(campaign, path_temperatures=path_temperature_columns(records))


def test_sound_far_from_any_shot_is_noted_as_unused(few_01, reduced_few_01):
    start = float(few_01.shots.mjd_utc[0])
    far = sounded(few_01, [(start - 0.04, "ZY101", "ZEG41040L", 25.0, 0.1)])
    reduction = reduce_epoch(far)
    moved = np.abs(reduction.coordinates.x - reduced_few_01.coordinates.x)
    # what a distance of 100 m is rounded by moves a height that only its typed value holds (10 mm) as much more
    rounding = np.spacing(100.0) * reduced_few_01.coordinates.u / 100e-6
    assert np.all(moved <= np.maximum(1e-12, rounding))
    assert any("they are not used" in note for note in reduction.notes)
    assert reduction.coordinates.sound["ZEG41040L - ZY101"] == pytest.approx((0.0, 0.1))


def test_a_line_whose_sound_is_far_off_is_contradicted_and_its_shots_stay(few_01, reduced_few_01):
    """At 30 °C the index is 17 ppm lower, the range 2.4 mm too long: a wrong certificate would look the same."""
    shots = few_01.shots
    mine = [k for k, pair in enumerate(zip(shots.ranger, shots.target, strict=True)) if pair == ("ZY112", "ZBM06")]
    rows = [(float(shots.mjd_utc[k]), "ZY112", "ZBM06", 30.0, 0.2) for k in mine]
    reduction = reduce_epoch(sounded(few_01, rows))
    (contradiction,) = reduction.coordinates.contradictions
    sound, *others = contradiction.explanations
    assert sound.group is RecordGroup.SOUND
    assert {e.group for e in others} == {RecordGroup.BENCHMARKS, RecordGroup.LINES}
    assert sound.errors[0] == pytest.approx(30.0 - 11.6, abs=1.5)  # the other paths' air is some 11.6 °C
    assert sound.u[0] < 0.5
    certificate = next(e for e in others if e.group is RecordGroup.BENCHMARKS)
    assert certificate.errors[0] == pytest.approx(-2.4, abs=0.3)  # mm
    assert {reduction.status[k] for k in mine} == {"used"}
    assert contradiction.text in reduction.notes
    found, usual = reduction.coordinates, reduced_few_01.coordinates
    mark = found.index("ZBM06")  # any of the three moves it: its claim includes that
    others = [k for k in range(len(found.points)) if k != mark]
    np.testing.assert_allclose(found.x[others], usual.x[others], rtol=0, atol=30e-6)
    assert np.all(np.abs(found.x[mark] - usual.x[mark]) < 2.0 * found.u[mark])


ROW = "52889.14,ZY101,ZEG41040L,11.2,0.15"
HEADER = "mjd_utc,ranger,target,temperature_c,u_temperature_c"


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    """A small campaign's directory, to which files are added."""
    night = simulate_night(22, faults=Faults(**CLEAR), telescope=SimulatedTelescope(dish_prisms=2, triplets=1))
    return write_night(night, tmp_path_factory.mktemp("sounded") / "night")


def write(directory, *rows):
    (directory / "path_temperatures.csv").write_text("\n".join([HEADER, *rows]) + "\n")


def test_the_optional_file_is_read_hashed_and_may_be_absent(directory):
    (directory / "path_temperatures.csv").unlink(missing_ok=True)
    assert read_campaign(directory).path_temperatures is None
    write(directory)
    assert read_campaign(directory).path_temperatures is None
    write(directory, ROW, ROW.replace("52889.14", "52889.15").replace("11.2", "0.0"))
    campaign = read_campaign(directory)
    assert campaign.path_temperatures.temperature_c.tolist() == [11.2, 0.0]
    assert len(campaign.hashes["path_temperatures.csv"]) == 64


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ([ROW.replace("ZY101", "ZY999")], "row 1, ranger = 'ZY999' is not in monuments/ or feedarm.toml"),
        ([ROW, ROW.replace("ZEG41040L", "ZEG1")], "row 2, target = 'ZEG1' is not in targets.toml"),
        ([ROW.replace("ZEG41040L", "ZRG")], "target = 'ZRG' is not in"),
        ([ROW.replace("ZEG41040L", "ZY101")], "is the ranger itself"),
        ([ROW.replace("52889.14", "52889.07")], "is outside the campaign .* expected within 1 h"),
        ([ROW.replace("11.2", "285.2")], r"temperature_c = 285.2 looks like kelvin \(expected -60 to 60\)"),
        ([ROW.replace("0.15", "0")], "u_temperature_c = 0 .*above 0 to 10"),
        ([ROW.replace("11.2", "nan")], "temperature_c = 'nan'"),
        ([ROW, ROW], "row 2, mjd_utc = 52889.14: ZY101 - ZEG41040L has a temperature at that time in row 1"),
    ],
)
def test_a_bad_row_is_refused_in_one_line(directory, rows, says):
    write(directory, *rows)
    with pytest.raises(InputError, match=says) as refused:
        read_campaign(directory)
    assert str(refused.value).startswith("path_temperatures.csv: row")
    assert "\n" not in str(refused.value)
