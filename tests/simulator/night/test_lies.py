"""Each lie changes what it says, by its sign and size, in the files or in nature; the truth of the records stays."""

import re

import numpy as np
import pytest

from catseye.errors import InputError, ValidityError
from catseye.records.night.campaign import read_campaign
from catseye.simulator.night.lies.lie import LIES, Lie, lying_night
from catseye.simulator.night.movements import BODIES, BodySway
from catseye.simulator.night.sheets import write_night
from catseye.simulator.night.simulate import SimulatedTelescope
from nature_scene import natural_setting
from repository import ROOT

SEED, PRISMS = 6001, 12
NAMES = {
    "monument": "ZY105", "offset": "ZY105", "dz-sign": "ZY105", "monument-metres": "ZY105", "d0": "ZY113",
    "d0-metres": "ZY113", "oscillator": "ZY105", "clipped": "ZY105", "clock": "ZY105", "certificate": "ZBM02",
    "certificate-metres": "ZBM02", "target": "ZEG41040L", "target-metres": "ZEG41040L", "h-corr": "TR03",
    "sway": "arm", "drift": "dish",
}  # fmt: skip
STATION = "WX1"


def setting():
    return natural_setting(SEED, PRISMS)


@pytest.fixture(scope="module")
def honest():
    return lying_night(SEED, (), **setting())


@pytest.fixture(scope="module")
def records(honest, tmp_path_factory):
    return read_campaign(write_night(honest, tmp_path_factory.mktemp("honest") / "night"))


def typed(kind, size=None):
    rule = LIES[kind]
    name = NAMES.get(kind, STATION) if rule.of else ""
    number = f"{rule.usual[-1] if size is None else size:g}" if rule.usual else ""
    return " ".join(word for word in (kind, name, number) if word)


def lying(*lies):
    return lying_night(SEED, lies, **setting())


def campaign_of(tmp_path, *lies):
    return read_campaign(write_night(lying(*lies), tmp_path / "night"))


def same(one, other):
    """True for two truths that agree in all points, shots, zeros and thermometers."""
    parts = ("points", "shot_status", "shot_ranges", "d0", "leakage", "fixed_points", "mirror_offsets", "normals")
    return all(
        a.keys() == b.keys() and all(np.array_equal(a[k], b[k]) for k in a)
        for part in parts
        for a, b in [(getattr(one, part), getattr(other, part))]
    )


@pytest.mark.parametrize("kind", [k for k, rule in LIES.items() if rule.nature is None and k != "clock"])
def test_a_lie_of_records_leaves_truth_and_samples(honest, kind):
    night = lying(typed(kind))
    assert same(night.truth, honest.truth)
    assert (kind == "clipped") == (not np.array_equal(night.frames, honest.frames))
    assert night.lies == (typed(kind),)


@pytest.mark.parametrize(
    ("lie", "part", "name", "key", "more"),
    [
        ("d0 ZY113 0.3", "mirrors", "ZP113", "d0_mm", 0.3),
        ("h-corr TR03 -0.1", "triplets", "TR03", "h_corr_mm", -0.1),
        ("monument ZY105 1 -2 0.5", "monuments", "ZY105", ("x_mm", "y_mm", "z_mm"), (1.0, -2.0, 0.5)),
        ("offset ZY105 0.1 0.2 -0.3", "mirrors", "ZP105", ("dx_mm", "dy_mm", "dz_mm"), (0.1, 0.2, -0.3)),
    ],
)
def test_a_sheet_states_so_much_more(records, tmp_path, lie, part, name, key, more):
    sheet = getattr(campaign_of(tmp_path, lie), part)[name]
    before = getattr(records, part)[name]
    for one, by in zip(np.atleast_1d(key), np.atleast_1d(more), strict=True):
        assert getattr(sheet, one) - getattr(before, one) == pytest.approx(by, abs=1.1e-3)  # three decimals
        before, sheet = before.model_copy(update={one: 0.0}), sheet.model_copy(update={one: 0.0})
    derived = {"hrp_mm", "pc_mm"}
    assert before.model_dump(exclude=derived) == sheet.model_dump(exclude=derived)


def test_a_size_alone_has_a_direction_of_the_seed_and_keeps_what_is_zero_by_definition(honest):
    for name, able in (("ZY105", 3), ("ZY103", 2)):
        night = lying(f"monument {name} 2")
        by = night.monuments[name].fixed_point_mm - honest.monuments[name].fixed_point_mm
        assert np.linalg.norm(by) == pytest.approx(2.0)
        assert np.count_nonzero(by) == able  # ZY103 defines z = 0
        twice = lying(f"monument {name} 4").monuments[name].fixed_point_mm - night.monuments[name].fixed_point_mm
        np.testing.assert_allclose(twice, by, atol=1e-9)


def test_targets_and_certificates_state_so_much_more(records, tmp_path):
    other = campaign_of(tmp_path, "target ZEG41040L 0 100 0", "certificate ZBM02 -0.6")
    by = np.subtract(other.targets["ZEG41040L"].position_mm, records.targets["ZEG41040L"].position_mm)
    np.testing.assert_allclose(by, (0.0, 100.0, 0.0), atol=1e-9)
    marks = {b.target: b.certified_distance_mm for b in records.benchmarks}
    more = {b.target: round(b.certified_distance_mm - marks[b.target], 6) for b in other.benchmarks}
    assert more == {name: (-0.6 if name == "ZBM02" else 0.0) for name in marks}


def test_the_sign_of_dz_alone_turns(records, tmp_path):
    sheet, before = campaign_of(tmp_path, "dz-sign ZY105").mirrors["ZP105"], records.mirrors["ZP105"]
    assert (sheet.dx_mm, sheet.dy_mm, sheet.dz_mm) == (before.dx_mm, before.dy_mm, -before.dz_mm)


@pytest.mark.parametrize("kind", ["monument-metres", "d0-metres", "certificate-metres", "target-metres"])
def test_metres_are_a_thousandth_in_the_file(honest, tmp_path, kind):
    texts = [write_night(night, tmp_path / str(k)) for k, night in enumerate((honest, lying(typed(kind))))]
    file, pattern = {
        "monument-metres": ("monuments/ZY105.toml", r"^[xyz]_mm = (\S+)"),
        "d0-metres": ("mirrors/ZP113.toml", r"^d0_mm = (\S+)"),
        "certificate-metres": ("benchmarks.csv", r"^ZBM02,ZY\d+,([^,]+)"),
        "target-metres": ("targets.toml", r'ZEG41040L"\ntype.*\nframe.*\nposition_mm = \[(\S+), (\S+), (\S+)\]'),
    }[kind]
    before, after = ((folder / file).read_text() for folder in texts)
    numbers = [np.array(re.findall(pattern, text, re.MULTILINE), dtype=float).ravel() for text in (before, after)]
    assert len(numbers[0]) > 0
    np.testing.assert_allclose(numbers[1], numbers[0] / 1000.0, atol=0.06 if kind == "target-metres" else 6e-4)
    assert sum(a != b for a, b in zip(before.splitlines(), after.splitlines(), strict=True)) == {
        "monument-metres": 3,
    }.get(kind, 1)  # latitude and height of a monument stay


WEATHER = {  # lie -> reading of WX1 from temperature, pressure, humidity
    "thermometer WX1 2": lambda t, p, h: (t + 2.0, p, h),
    "fahrenheit WX1": lambda t, p, h: (32.0 + 9.0 / 5.0 * t, p, h),
    "pressure WX1 -3": lambda t, p, h: (t, p - 3.0, h),
    "mmhg WX1": lambda t, p, h: (t, p * 760.0 / 1013.25, h),
    "inhg WX1": lambda t, p, h: (t, p * 29.9213 / 1013.25, h),
    "humidity WX1 -10": lambda t, p, h: (t, p, h - 10.0),
    "humidity WX1 -100": lambda t, p, h: (t, p, 0.0 * h),
    "humidity-fraction WX1": lambda t, p, h: (t, p, h / 100.0),
}


@pytest.mark.parametrize("lie", WEATHER)
def test_one_station_reads_otherwise(honest, lie):
    for was, now in zip(honest.weather, lying(lie).weather, strict=True):
        expected = (was.temperature_c, was.pressure_hpa, was.humidity_percent)
        expected = WEATHER[lie](*expected) if was.station == STATION else expected
        assert (now.temperature_c, now.pressure_hpa, now.humidity_percent) == pytest.approx(expected, rel=1e-5)
        assert (now.seconds, now.station) == (was.seconds, was.station)


def test_sea_level_is_what_standard_air_weighs_below_the_station(honest):
    """A column of 803.8 m of air: p0 = p exp(g h / (R T)) with the mean temperature between station and sea."""
    night = lying("sea-level both")
    for was, now in zip(honest.weather, night.weather, strict=True):
        height = {"WX1": 803.8, "WX2": 850.15}[was.station]
        mean_k = 288.15 - 0.0065 * height / 2.0
        assert now.pressure_hpa == pytest.approx(
            was.pressure_hpa * np.exp(9.80665 * height / (287.053 * mean_k)), rel=1e-4
        )


def test_a_spike_is_one_reading_and_a_stuck_thermometer_repeats_one_for_an_hour_while_the_air_cools(honest):
    changed = [(a, b) for a, b in zip(honest.weather, lying("spike WX1 30").weather, strict=True) if a != b]
    assert [(a.station, round(b.temperature_c - a.temperature_c, 9)) for a, b in changed] == [(STATION, 30.0)]
    assert abs(changed[0][0].seconds - honest.truth.reference_s) < 601.0
    night = lying("stuck WX1 4")
    assert night.truth.air.conditions.drift_c_per_h == -4.0
    own = [w for w in night.weather if w.station == STATION]
    stuck = {w.temperature_c for w in own if 300.0 <= w.seconds < 3900.0}
    assert stuck == {max((w for w in own if w.seconds < 300.0), key=lambda w: w.seconds).temperature_c}
    other = [w.temperature_c for w in night.weather if w.station == "WX2" and 300.0 <= w.seconds < 3900.0]
    assert max(other) - min(other) > 2.0


def test_posture_and_modulation_are_typed_otherwise(records, tmp_path):
    was = records.site
    for k, (lie, azimuth, elevation, hz) in enumerate(
        (
            ("elevation -0.1", 0.0, -0.1, 0.0),
            ("azimuth 0.1", 0.1, 0.0, 0.0),
            ("modulation 5", 0.0, 0.0, 7500.0),  # 5 ppm of 1.5 GHz
        )
    ):
        site = read_campaign(write_night(lying(lie), tmp_path / str(k))).site
        assert site.campaign.azimuth_deg - was.campaign.azimuth_deg == pytest.approx(azimuth)
        assert site.campaign.elevation_deg - was.campaign.elevation_deg == pytest.approx(elevation)
        assert site.ranging.modulation_hz - was.ranging.modulation_hz == pytest.approx(hz)
    night = lying("posture-radians")
    assert np.degrees(night.elevation_deg) == pytest.approx(was.campaign.elevation_deg)
    swapped = lying("posture-swapped")
    assert (swapped.azimuth_deg, swapped.elevation_deg) == (was.campaign.elevation_deg, was.campaign.azimuth_deg)


def test_a_late_clock_reorders_shots_and_renumbers_their_truth(honest):
    night = lying("clock ZY105 -600")
    seconds = [s.seconds for s in night.shots]
    assert seconds == sorted(seconds)
    before = {(s.ranger, s.target, round(s.seconds, 6)): i for i, s in enumerate(honest.shots)}
    for row, shot in enumerate(night.shots):
        late = 600.0 if shot.ranger == "ZY105" else 0.0
        was = before.pop((shot.ranger, shot.target, round(shot.seconds + late, 6)))
        np.testing.assert_array_equal(night.frames[row], honest.frames[was])
        for part in ("shot_status", "shot_ranges", "shot_phase_errors"):
            assert getattr(night.truth, part)[str(row + 1)] == getattr(honest.truth, part)[str(was + 1)]
    assert not before
    assert night.truth.points.keys() == honest.truth.points.keys()


def test_clipping_ends_every_buffer_of_a_ranger_at_full_scale():
    night = lying("clipped ZY105 6")
    mine = np.array([s.ranger == "ZY105" for s in night.shots])
    lit = np.abs(night.frames[mine].astype(int)).max(axis=1) >= 32767
    assert lit.mean() > 0.9  # a blocked return does not clip
    assert not (np.abs(night.frames[~mine].astype(int)).max(axis=1) >= 32767).any()


def test_a_ranger_whose_modulation_the_site_states_too_high_turns_its_phase_less(honest):
    """Lower frequency, longer wave: the phase of a path of some 130 m falls 10 ppm less, 2 pi 2 f D 1e-5 / c."""
    night = lying("oscillator ZY105 10")
    changed = ~(night.frames == honest.frames).all(axis=1)
    assert {s.ranger for s, on in zip(night.shots, changed, strict=True) if on} == {"ZY105"}
    assert same(night.truth, honest.truth)
    turn = np.exp(1j * 2.0 * np.pi * np.arange(8192) / 64.0)
    for row in np.flatnonzero(changed):
        if honest.shots[row].target == "ZRG" or honest.truth.shot_status[str(row + 1)] != "good":
            continue
        now, was = (np.angle(n.frames[row].astype(float) @ turn) for n in (night, honest))
        expected = 2.0 * np.pi * 2.0 * 1.5e9 / 299792458.0 * 1e-5 * honest.truth.shot_ranges[str(row + 1)]
        assert np.angle(np.exp(1j * (now - was))) == pytest.approx(
            expected, rel=0.02, abs=0.003
        )  # glass, noise, crosstalk


def test_a_gradient_warms_the_air_along_it(honest):
    night = lying("gradient 0.02 -0.01")
    here, there = np.zeros(3), np.array([100.0, 100.0, 0.0])
    warmer = [
        n.truth.air.weather_at(there, 1000.0)[0] - n.truth.air.weather_at(here, 1000.0)[0] for n in (night, honest)
    ]
    assert warmer[0] - warmer[1] == pytest.approx(1.0)
    before = honest.nature.horizontal.constant_c_per_m if honest.nature.horizontal else (0.0, 0.0)
    east, north = np.subtract(lying("gradient 0.02").nature.horizontal.constant_c_per_m, before)
    assert np.hypot(east, north) == pytest.approx(0.02)


def test_a_body_drifts_through_its_place_in_the_middle_of_the_night(honest):
    night = lying("drift dish 0 0 3")
    truth, middle = night.truth, honest.truth.reference_s
    for name, rises in (("DP001", 3e-3), ("TR01-B", 3e-3), ("ZY113", 0.0), ("ZY105", 0.0), ("ZEG41040L", 0.0)):
        later, was = (t.moving.at([name], np.array([middle + 3600.0]))[0] for t in (truth, honest.truth))
        np.testing.assert_allclose(later - was, (0.0, 0.0, rises), atol=1e-12)
        np.testing.assert_array_equal(truth.points[name], honest.truth.points[name])
    telescope = lying("drift telescope 1").truth.moving
    for name, moves in (("DP001", 1e-3), ("ZY113", 1e-3), ("ZAG731P", 1e-3), ("ZY105", 0.0), ("ZBM01", 0.0)):
        step = telescope.at([name], np.array([middle + 3600.0])) - honest.truth.moving.at(
            [name], np.array([middle + 3600.0])
        )
        assert np.linalg.norm(step) == pytest.approx(moves, abs=1e-12)


def test_a_monument_may_drift_alone(honest):
    moving = lying("drift ZY105 1 0 0").truth.moving
    step = moving.at(["ZY105", "ZY106"], np.full(2, honest.truth.reference_s + 1800.0)) - [
        honest.truth.points[n] for n in ("ZY105", "ZY106")
    ]
    np.testing.assert_allclose(step, [(0.5e-3, 0.0, 0.0), (0.0, 0.0, 0.0)], atol=1e-12)


def test_a_sway_has_its_size_in_each_coordinate_and_is_another_at_the_next_shot():
    sway = BodySway("arm", 0.3, 7)
    at = sway.displacement(14.0 * np.arange(4000), 0.0) / 1e-3
    np.testing.assert_allclose(at.std(axis=0), 0.3, rtol=0.08)
    following = np.array([np.corrcoef(at[:-1, k], at[1:, k])[0, 1] for k in range(3)])
    assert np.abs(following).max() < 0.25
    assert np.abs(np.corrcoef(at.T) - np.eye(3)).max() < 0.15
    moving = lying("sway arm 0.3").truth.moving
    two = moving.at(["ZY113", "ZY114"], np.full(2, 1000.0)) - moving.at(["ZY113", "ZY114"], np.full(2, 1003.0))
    np.testing.assert_allclose(two[0], two[1], atol=1e-6)  # rigid but for expansion
    assert np.linalg.norm(two[0]) > 1e-5


def test_blocked_and_reflected_shots_are_as_many_as_said():
    truth = lying_night(SEED, ("blocked 15", "reflected 5"), **natural_setting(SEED, 60)).truth
    status = [
        s
        for s, index in zip(truth.shot_status.values(), truth.shot_ranges, strict=True)
        if index in truth.path_refractivity_ppm
    ]
    for word, share in (("blocked", 0.15), ("reflected", 0.05)):
        spread = np.sqrt(share * (1.0 - share) / len(status))
        assert abs(status.count(word) / len(status) - share) < 4.0 * spread


@pytest.mark.parametrize(
    ("lie", "says"),
    [
        ("rumour", "unknown kind"),
        ("monument", "expected monument a ranger on a monument"),
        ("monument ZY103", "and a number"),
        ("monument ZY103 1 2", "or 3 components"),
        ("monument ZY103 nan", "number"),
        ("mmhg WX1 3", "expected mmhg"),
        ("monument ZY113 1", "'ZY113': not a monument"),
        ("thermometer WX3 1", "'WX3': not a station"),
        ("certificate ZBM09 1", "not a benchmark"),
        ("h-corr TR99 1", "not a triplet"),
        ("target ZZ 1", "not a single target"),
        ("drift moon 1", "movement of 'moon'"),
        ("oscillator ZY199 1", "'ZY199': expected a ranger"),
        ("clock ZY199 1", "not a ranger"),
    ],
)
def test_what_cannot_lie_is_refused(lie, says):
    with pytest.raises((InputError, ValidityError), match=re.escape(says)):
        lying_night(1, (lie,), telescope=SimulatedTelescope(dish_prisms=6, triplets=2))


def test_lies_read_as_they_are_typed():
    for kind in LIES:
        assert str(Lie.of_text(typed(kind))) == typed(kind)
        assert Lie.of_text(f"  {typed(kind)} ") == Lie.of_text(typed(kind))


def test_the_page_has_every_kind_with_its_unit():
    text = (ROOT / "docs" / "howto" / "lying-nights.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `([a-z0-9-]+)([^`]*)` \|", text, re.MULTILINE))
    assert rows.keys() == LIES.keys()
    for kind, rule in LIES.items():
        assert ("NAME" in rows[kind]) == bool(rule.of), kind
        assert ("SIZE" in rows[kind]) == bool(rule.usual), kind
        line = next(line for line in text.splitlines() if line.startswith(f"| `{kind}"))
        assert not rule.unit or rule.unit in line, kind
    assert all(body in text for body in BODIES)
