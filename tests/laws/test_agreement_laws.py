"""What is computed two ways agrees: value and slope, verdict and limit, uncertainty and comparison."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from catseye.atmosphere.index import air as index
from catseye.atmosphere.sound import speed as sounds
from catseye.gateways.optics.glass_objects import glass_object
from catseye.optics.glass import GLASSES, absolute_index, phase_index, reference_air, temperature_slopes
from catseye.optics.retroreflector.warm_prism import warm_prism, warm_prism_slopes
from catseye.optics.safety.hazard import LaserBeam, classify, exceeds, hazard_zone
from catseye.optics.safety.limits import CLASSES, eye_limits
from catseye.reduction.optics.glass import glass_state

glasses = st.sampled_from(sorted(GLASSES))
AIR = {"air_phase": 1.00024848, "air_group": 1.00025325}
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)  # exact to the fifteenth power


def integral(slope, low, high):
    """Gauss and Legendre's of a function between two limits."""
    at = 0.5 * (high - low) * NODES + 0.5 * (high + low)
    return 0.5 * (high - low) * sum(w * slope(x) for w, x in zip(WEIGHTS, at, strict=True))


@given(glasses, st.floats(0.005, 0.1), st.floats(0.42, 1.0), st.floats(-98.0, 138.0), st.floats(-98.0, 138.0))
def test_a_prism_changes_by_the_integral_of_its_slopes(glass, height, um, cold, warm):
    ends = [warm_prism(height, glass, um, t, **AIR) for t in (cold, warm)]
    for name in ends[0]._fields:

        def slope(t, name=name):
            return float(getattr(warm_prism_slopes(height, glass, um, t, **AIR), name))

        moved = float(getattr(ends[1], name) - getattr(ends[0], name))
        # 1e-9 m or of an index: the difference over half a degree either side misses a third derivative, 1e-12 a kelvin
        assert moved == pytest.approx(integral(slope, cold, warm), abs=1e-9)


@given(glasses, st.floats(0.42, 1.0), st.floats(-99.0, 139.0), st.floats(-99.0, 139.0))
def test_an_index_of_glass_changes_by_the_integral_of_its_slopes(glass, um, cold, warm):
    for kind in ("phase", "group"):

        def slope(t, kind=kind):
            return float(getattr(temperature_slopes(um, glass, t), kind))

        moved = float(getattr(absolute_index(um, glass, warm), kind) - getattr(absolute_index(um, glass, cold), kind))
        assert moved == pytest.approx(integral(slope, cold, warm), abs=1e-9)


@given(glasses, st.floats(0.42, 1.0), st.floats(-100.0, 140.0), st.floats(5.0, 100.0))
def test_the_command_is_consistent_about_a_glass(glass, um, temperature_c, height_mm):
    found = glass_object(glass_state(glass, um, temperature_c, height_mm=height_mm))
    own, h = found["prism"], height_mm * 1e-3 * (1.0 + found["expansion_per_c"] * (temperature_c - 20.0))
    n = own["group_index_over_air"]
    assert own["range_constant"] == pytest.approx(-(n - 1.0 / n) * h, rel=1e-12)
    assert own["reference_depth"] == pytest.approx(h / n, rel=1e-12)
    makers = float(reference_air(um, found["reference_c"]).phase)
    assert found["wavelength_in_air_um"] == pytest.approx(um / makers, rel=1e-15)
    assert found["phase_index"] == pytest.approx(float(phase_index(um / makers, glass)), rel=1e-14)
    cold = float(absolute_index(um, glass).phase)
    assert found["phase_index"] * makers == pytest.approx(cold, rel=1e-14)


def beam_of(power, um):
    """A pointer 1 mm wide: 7 mm catch all of it."""
    return LaserBeam(power, um, 1e-3, 2e-3)


@given(st.floats(0.4, 1.39), st.sampled_from(["iec2014", "ansi2014"]), st.sampled_from([-1, 0, 1]))
def test_a_power_that_is_a_class_s_limit_keeps_it_and_one_beyond_does_not(um, edition, ulps):
    limits = classify(beam_of(1e-4, um), edition=edition).limits
    for name, limit in limits.items():
        at = limit
        for _ in range(abs(ulps)):
            at = math.nextafter(at, math.inf * ulps)
        for power in (at, at * 1e3 * 1e-3):
            assert CLASSES.index(classify(beam_of(power, um), edition=edition).laser_class) <= CLASSES.index(name)
        above = classify(beam_of(limit * (1.0 + 1e-9), um), edition=edition)
        higher = [each for each in limits.values() if each > limit * (1.0 + 1e-9)]
        assert (CLASSES.index(above.laser_class) > CLASSES.index(name)) or (name != "3B" and not higher)


@given(st.floats(0.4, 1.39), st.floats(-9.0, -1.0), st.sampled_from([-1.0, 1.0]), st.sampled_from(["1", "3R", "3B"]))
def test_a_reason_never_says_that_a_number_does_not_keep_the_same_number(um, power_of_ten, side, name):
    limit = classify(beam_of(1e-4, um)).limits[name]
    for reason in classify(beam_of(limit * (1.0 + side * 10.0**power_of_ten), um)).reasons:
        if "does not keep the limit of " in reason:
            limit_text = reason.split("the limit of ")[1]
            values = [part.split(" mW")[0].split()[-1] + " mW" for part in reason.split(": ")[1].split(", ")]
            assert limit_text not in values[:1] or " through 50 mm" in reason


@given(st.floats(0.4, 1.39), st.sampled_from([0.25, 10.0, 100.0, 3e4]), st.sampled_from([-1, 0, 1]))
def test_a_beam_of_the_limit_of_exposure_is_a_hazard_nowhere(um, duration, ulps):
    limits = eye_limits(um, duration)
    power = min(limit.power for limit in limits)
    for _ in range(abs(ulps)):
        power = math.nextafter(power, math.inf * ulps)
    assert hazard_zone(beam_of(power, um), limits) == (0.0, 0.0)
    near, far = hazard_zone(beam_of(power * (1.0 + 1e-3), um), limits)
    assert far >= near >= 0.0
    for z in (near, far):
        if z > 0.0:
            inside = max(beam_of(power * (1.0 + 1e-3), um).power_within(m.aperture, z) / m.power for m in limits)
            assert inside == pytest.approx(1.0, rel=1e-9)
    assert not exceeds(power, power)


STANDARD = {"index": "ciddor_hill1999", "sound": "real_gas"}
weathers = st.tuples(st.floats(-40.0, 50.0), st.floats(500.0, 1100.0), st.floats(0.0, 100.0))


@given(weathers, st.floats(0.36, 1.69), st.floats(0.0, 2000.0), st.sampled_from(sorted(index.MODELS)))
def test_an_index_is_off_by_no_more_than_its_uncertainty_claims(weather, um, co2_ppm, model):
    """Over all that a model accepts: 1.2 times both models' u, the vapour's formulas apart by a tenth."""
    light = {"wavelength_um": um, "co2_ppm": co2_ppm}
    found = index.air(*weather, model=model, **light)
    standard = index.air(*weather, model=STANDARD["index"], **light)
    u = math.hypot(found.standard_uncertainty, standard.standard_uncertainty)
    assert abs(found.group_refractivity - standard.group_refractivity) < 1.2 * u
    assert found.standard_uncertainty < 3e-6  # and is no excuse: 1.8e-6 at the worst


@given(weathers, st.sampled_from(sorted(index.MODELS)))
def test_an_index_changes_by_the_integral_of_its_sensitivities(weather, model):
    t, p, h = weather
    start = (20.0, 900.0, 50.0)

    def state(share):
        return index.air(*(a + share * (b - a) for a, b in zip(start, (t, p, h), strict=True)), model=model)

    def slope(share):
        along = state(share).sensitivity
        steps = (t - start[0], p - start[1], h - start[2])
        return sum(float(s) * d for s, d in zip(along[:3], steps, strict=True))

    moved = float(state(1.0).group_refractivity - state(0.0).group_refractivity)
    assert moved == pytest.approx(integral(slope, 0.0, 1.0), abs=1e-12)  # 1e-6 ppm


@given(weathers, st.floats(0.0, 2000.0), st.sampled_from(sorted(sounds.MODELS)))
def test_a_speed_of_sound_is_off_by_no_more_than_its_uncertainty_claims(weather, co2_ppm, model):
    t, p, h = weather
    if model == "cramer1993":
        t, p = 0.0 + (t + 40.0) / 3.0, 750.0 + (p - 500.0) * 0.45
    e = float(sounds.humidity.vapour_pressure_hpa(t, p, h, "buck"))
    assume(e < 0.05 * p if model == "cramer1993" else e < 0.19 * p)
    found, standard = (sounds.sound(t, p, h, model=m, co2_ppm=co2_ppm) for m in (model, STANDARD["sound"]))
    u = math.hypot(found.standard_uncertainty, standard.standard_uncertainty)
    assert abs(found.speed - standard.speed) < 1.2 * u
    assert found.standard_uncertainty < 10.0


@pytest.mark.parametrize(("model", "um", "off"), [("iag1999_closed", 0.633, 0.426), ("barrell_sears1963", 0.5, 0.623)])
def test_the_closed_formulas_claim_what_they_are_off_at_50_degrees_and_500_hpa(model, um, off):
    """ppm, by a table of differences; was 0.1 everywhere."""
    state = index.air(50.0, 500.0, 100.0, model=model, wavelength_um=um)
    assert float(state.standard_uncertainty) * 1e6 == pytest.approx(math.hypot(off, 0.05), abs=2e-3)
    assert float(index.air(20.0, 933.0, 50.0, model=model).standard_uncertainty) == 1e-7


def test_the_notes_speed_of_sound_claims_what_it_is_off_where_hot_moist_and_high():
    """By the notes' own erratum: gamma of water is 1.33, not 1.004; x = 0.198 of vapour cost 0.5 (0.326/1.402) x."""
    state = sounds.sound(50.0, 500.0, 80.0)
    x = float(state.vapour_pressure_hpa) / 500.0
    by_hand = 0.5 * float(state.speed) * (1.330 - 1.004) / 1.402 * x
    assert float(state.standard_uncertainty) == pytest.approx(by_hand, rel=0.1)
    assert by_hand == pytest.approx(8.3, abs=0.2)
    assert float(sounds.sound(20.0, 933.0, 50.0).standard_uncertainty) == 1.0
