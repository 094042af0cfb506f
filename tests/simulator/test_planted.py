"""A plant changes what it should, and no other draw; any posture and weather makes a night."""

import dataclasses

import numpy as np
import pytest

from catseye.errors import InputError, ValidityError
from catseye.simulator.night.air import SUMMER_DAY, WINTER
from catseye.simulator.night.faults import EFFECTS, Faults, Planted
from catseye.simulator.night.schedule import Schedule
from catseye.simulator.night.sheets import write_night
from catseye.simulator.night.simulate import SimulatedTelescope, simulate_night


def changed_shots(night, other):
    assert [(s.ranger, s.target, s.seconds) for s in night.shots] == [
        (s.ranger, s.target, s.seconds) for s in other.shots
    ]
    return {s for s, same in zip(night.shots, (night.frames == other.frames).all(axis=1), strict=True) if not same}


def files(night, directory):
    written = write_night(night, directory)
    return {p.relative_to(written): p.read_bytes() for p in written.rglob("*") if p.is_file() and p.suffix != ".npy"}


def test_a_shift_moves_one_point_and_changes_only_the_shots_on_it(night, tmp_path):
    other = simulate_night(11, planted=Planted(shifts={"DP010": (0, 0, 0.3e-3)}))
    changed = changed_shots(night, other)
    blocked = {s for i, s in enumerate(night.shots) if night.truth.shot_status[str(i + 1)] == "blocked"}
    assert changed == {s for s in night.shots if s.target == "DP010"} - blocked
    for name, point in night.truth.points.items():
        expected = point + (np.array([0, 0, 0.3e-3]) if name == "DP010" else 0)
        np.testing.assert_array_equal(other.truth.points[name], expected)
    assert files(night, tmp_path / "a") == files(other, tmp_path / "b")
    assert other.truth.paraboloid.deviations["DP010"] != night.truth.paraboloid.deviations["DP010"]


def test_a_wrong_d0_is_in_the_reference_shots_of_that_ranger_alone(night, tmp_path):
    other = simulate_night(11, planted=Planted(d0_error_mm={"ZY113": 0.3}))
    assert changed_shots(night, other) == {s for s in night.shots if (s.ranger, s.target) == ("ZY113", "ZRG")}
    assert other.truth.d0["ZY113"] - night.truth.d0["ZY113"] == pytest.approx(0.3e-3, abs=1e-12)
    assert files(night, tmp_path / "a") == files(other, tmp_path / "b")


def test_the_sign_of_h_corr_turns_the_triplets_inside_out(night, tmp_path):
    other = simulate_night(11, planted=Planted(signs={"h_corr": -1}, ignore=["lateral"]))
    for unit in other.telescope.triplets:
        left, right, ball = (other.truth.points[t.name] for t in unit.targets)
        height = (ball - (left + right) / 2) @ other.truth.normals[unit.targets[0].name] * 1e3
        assert height == pytest.approx(-unit.h_corr_mm, abs=5 * 0.020)  # u_h_corr
    assert all(s.target[-2:] in ("-L", "-R") for s in changed_shots(night, other))
    assert files(night, tmp_path / "a") == files(other, tmp_path / "b")


def test_without_obliquity_only_prisms_change(night):
    other = simulate_night(11, planted=Planted(ignore={"obliquity"}))
    changed = {s.target for s in changed_shots(night, other)}
    assert changed
    assert all(name.startswith("DP") or name[-2:] in ("-L", "-R") for name in changed)


SMALL = SimulatedTelescope(dish_prisms=12, triplets=4)


@pytest.fixture(scope="module")
def small_night():
    """A night of some prisms and triplets: every effect has something to act on."""
    return simulate_night(11, telescope=SMALL)


@pytest.mark.parametrize("effect", EFFECTS)
def test_each_effect_can_be_left_out_and_it_matters(small_night, effect):
    night, other = small_night, simulate_night(11, telescope=SMALL, planted=Planted(ignore=[effect]))
    same_words = [(s.ranger, s.target, s.seconds) for s in night.shots] == [
        (s.ranger, s.target, s.seconds) for s in other.shots
    ]
    assert same_words
    assert other.truth.shot_status == night.truth.shot_status
    typed = [t.position_mm for n in (night, other) for t in n.single_targets]
    told = night.weather == other.weather and np.array_equal(*(np.concatenate(typed).reshape(2, -1)))
    assert not (told and np.array_equal(night.frames, other.frames))


def test_faults_are_where_the_truth_says_and_elsewhere_nothing_moves(night):
    none = simulate_night(11, faults=Faults(0.0, 0.0))
    touched = {s for i, s in enumerate(night.shots) if night.truth.shot_status[str(i + 1)] != "good"}
    assert changed_shots(none, night) == touched
    assert 5 < len(touched) < 40
    assert all(s.target != "ZRG" for s in touched)


def test_a_lying_thermometer_and_a_wrong_position_change_the_words_only(night):
    other = simulate_night(11, faults=Faults(wrong_position_mm=0.0, lying_thermometer_c=1.2, lying_station="WX1"))
    assert not changed_shots(night, other)
    lie = other.truth.thermometer_offsets_c["WX1"] - night.truth.thermometer_offsets_c["WX1"]
    assert lie == pytest.approx(1.2, abs=1e-12)
    assert other.truth.thermometer_offsets_c["WX2"] == night.truth.thermometer_offsets_c["WX2"]
    wrong = night.truth.wrongly_typed
    typed = [{t.name: t.position_mm for t in (*n.single_targets, *n.telescope.triplets)} for n in (night, other)]
    moved = {name: np.linalg.norm(typed[0][name] - p) for name, p in typed[1].items()}
    assert {name for name, by in moved.items() if by > 0} == {wrong}
    assert moved[wrong] == pytest.approx(30.0, abs=0.1)  # rounded to 0.1 mm a coordinate
    assert other.truth.wrongly_typed is None


@pytest.mark.parametrize("elevation", [5.0, 10.0, 45.0, 85.0])
@pytest.mark.parametrize("azimuth", [0.0, 237.0])
def test_any_posture_makes_a_night(azimuth, elevation):
    night = simulate_night(20, telescope=SimulatedTelescope(azimuth, elevation))
    assert 700 < len(night.shots) < 800
    balls = {s.target for s in night.shots if s.target.endswith("-B")}
    assert len(balls) >= 8  # near the horizon the upper rim looks away from the ground
    assert min(p[2] for p in night.truth.points.values()) > -3.0
    every = {t.name: t for t in (*night.telescope.targets.values(), *night.single_targets)}
    pose = night.truth.posture
    for name, t in every.items():
        typed = pose.nominal(t.position_mm / 1e3) if t.frame == "reflector" else t.position_mm / 1e3
        # 15 mm a coordinate typed, 30 mm in one, and the telescope's own some mm and arc seconds
        assert np.linalg.norm(typed - night.truth.points[name]) < 0.080


@pytest.mark.parametrize(("conditions", "refractivity"), [(SUMMER_DAY, 243.7), (WINTER, 279.0)])
def test_any_weather_makes_a_night(conditions, refractivity):
    night = simulate_night(21, conditions=conditions)
    # [PARKER04] eq. 1.26 by hand some 95 m up, at 920 hPa: 79.69 p/T - 12.02 e/T with 26.7 and -10 degrees.
    assert night.truth.refractivity_ppm == pytest.approx(refractivity, abs=1.5)
    assert np.mean([w.temperature_c for w in night.weather]) == pytest.approx(conditions.temperature_c, abs=2.0)


def test_small_and_large_networks_are_made_too():
    small = simulate_night(22, telescope=SimulatedTelescope(dish_prisms=0, triplets=0))
    assert small.truth.paraboloid is None
    assert not any(s.target.startswith(("DP", "TR")) for s in small.shots)
    large = simulate_night(
        22, telescope=SimulatedTelescope(dish_prisms=90, triplets=12), schedule=Schedule(interval_s=10.0)
    )
    assert large.truth.paraboloid is not None
    assert {f"TR{i:02d}" for i in range(1, 13)} == {t.name for t in large.telescope.triplets}


def test_invalid_values_are_refused_in_one_line():
    with pytest.raises(ValidityError, match="elevation 3 deg is outside"):
        SimulatedTelescope(elevation_deg=3)
    with pytest.raises(InputError, match="unknown effect 'gravity'"):
        Planted(ignore={"gravity"})
    with pytest.raises(InputError, match="unknown point"):
        simulate_night(1, planted=Planted(shifts={"DP999": (0, 0, 1)}))
    with pytest.raises(InputError, match="expected a ranger"):
        simulate_night(1, planted=Planted(d0_error_mm={"DP001": 1.0}))
    with pytest.raises(InputError, match="together at most 1"):
        Faults(fraction_blocked=0.7, fraction_reflected=0.6)


def test_records_of_the_night_are_frozen(night):
    for thing in (night, night.truth, night.shots[0], night.heads["ZY101"], night.telescope):
        with pytest.raises(dataclasses.FrozenInstanceError):
            thing.name = "other"
