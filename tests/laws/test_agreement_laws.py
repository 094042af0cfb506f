"""What is computed two ways agrees: value and slope, verdict and limit, uncertainty and comparison."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.gateways.optics.glass_objects import glass_object
from catseye.optics.glass import GLASSES, absolute_index, phase_index, reference_air, temperature_slopes
from catseye.optics.retroreflector.warm_prism import warm_prism, warm_prism_slopes
from catseye.optics.safety.hazard import LaserBeam, classify, exceeds, hazard_zone
from catseye.optics.safety.limits import CLASSES, eye_limits

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
def test_what_the_command_says_of_a_glass_agrees_with_itself(glass, um, temperature_c, height_mm):
    found = glass_object(glass, um, temperature_c, height_mm=height_mm)
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
