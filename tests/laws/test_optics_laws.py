"""Laws of the glass and its retroreflectors."""

import mpmath
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from catseye.optics.glass import GLASSES, group_index, phase_index
from catseye.optics.retroreflector import cats_eye, prism

heights = st.floats(0.005, 0.1)
indices = st.floats(1.3, 2.2)
cosines = st.floats(0.0, 1.0)
incidences = st.floats(0.0, np.pi / 2)


def as_printed(h, n, c):
    """[GOLDMAN00] eq. B.1 as it stands, in 60 digits, with sin I from the cosine."""
    h, n, c = mpmath.mpf(h), mpmath.mpf(n), mpmath.mpf(c)
    return n * h * (1 - mpmath.sqrt(1 - (1 - c**2) / n**2)) - (h / n) * (1 - c)


@given(heights, indices, cosines)
def test_the_stable_form_is_the_printed_one(h, n, c):
    with mpmath.workdps(60):
        expected = float(as_printed(h, n, c))
    # twenty roundings, relative: no cancellation is left
    assert abs(float(prism.obliquity_correction(h, n, c)) - expected) <= 5e-15 * abs(expected)


@given(heights, indices, st.floats(0.001, 1.57))
def test_the_slope_is_the_derivative_of_the_correction(h, n, incidence):
    with mpmath.workdps(60):
        angle = mpmath.acos(mpmath.mpf(float(np.cos(incidence))))
        expected = float(mpmath.diff(lambda i: as_printed(h, n, mpmath.cos(i)), angle))
    assert abs(float(prism.obliquity_slope(h, n, np.cos(incidence))) - expected) <= 1e-13 * abs(expected)


@given(heights, indices, cosines)
def test_obliquity_is_never_positive(h, n, c):
    assert prism.obliquity_correction(h, n, c) <= 0.0
    assert prism.obliquity_slope(h, n, c) <= 0.0


@given(heights, indices, incidences)
def test_obliquity_is_even_in_the_incidence(h, n, i):
    assert prism.obliquity_correction(h, n, np.cos(i)) == prism.obliquity_correction(h, n, np.cos(-i))


@given(heights, indices, cosines, cosines)
def test_obliquity_grows_as_the_prism_turns_away(h, n, c, d):
    nearer, further = max(c, d), min(c, d)
    grown = prism.obliquity_correction(h, n, further) - prism.obliquity_correction(h, n, nearer)
    assert grown <= 1e-17  # m, a rounding of the result


@given(heights, indices, st.floats(0.0, 0.05))
def test_obliquity_starts_with_the_fourth_power(h, n, i):
    leading = -h * i**4 / (8 * n) * (1 - n**-2)
    # the next power is i^6 with a factor of order one; 1e-17 m is the rounding of 1 - cos I
    assert abs(float(prism.obliquity_correction(h, n, np.cos(i))) - leading) <= h * i**6 + 1e-17


@given(heights, indices)
def test_height_is_depth_times_index_and_the_constants_are_negative(h, n):
    assert abs(float(prism.reference_depth(h, n)) * n - h) <= 1e-16
    assert prism.range_constant(h, n) < 0.0
    # the glass path to the corner less the air path to the reference point
    assert abs(float(prism.range_constant(h, n)) + n * h - float(prism.reference_depth(h, n))) <= 1e-16


@given(heights, heights, indices)
def test_a_cats_eye_delays_by_its_glass_less_the_air_to_its_centre(r1, r2, n):
    assert abs(float(cats_eye.range_constant(r1, r2, n)) - (r1 - n * r1 - n * r2)) <= 1e-15
    assert cats_eye.range_constant(r1, r2, n) < 0.0


@given(st.sampled_from(sorted(GLASSES)), st.floats(0.37, 1.0))
def test_glass_delays_a_pulse_more_than_a_wave(glass, wavelength_um):
    assert group_index(wavelength_um, glass) > phase_index(wavelength_um, glass) > 1.4
