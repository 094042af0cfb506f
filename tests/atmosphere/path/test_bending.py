"""Closed forms of bending against the rays themselves, and the gradient of the index against the air's own models."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf

from catseye.atmosphere.index.air import phase_refractivity
from catseye.atmosphere.path import bending
from catseye.atmosphere.path.mean import hydrostatic_pressure_hpa
from catseye.atmosphere.path.ray import bent_ray, layered
from catseye.atmosphere.sound.velocity import EARTH_RADIUS
from catseye.constants import ARCSECOND
from catseye.errors import ValidityError
from draws import examples


@pytest.mark.parametrize("lapse", [-1.0, -0.0098, 0.0, 0.3])
def test_the_gradient_of_the_index_is_that_of_the_model_up_a_column_of_air(lapse):
    step = 0.5

    def model(z):
        middle = 20.0 + lapse * z / 2
        return phase_refractivity(20.0 + lapse * z, hydrostatic_pressure_hpa(933.0, middle, 0.0, z_to=z), 0.0)

    expected = (model(step) - model(-step)) / (2 * step)
    # 1 %: air is no ideal gas, n - 1 falls by 0.2 % more with temperature; near -0.0342 °C/m nothing is left to share
    assert bending.index_gradient(lapse) == pytest.approx(float(expected), rel=0.005, abs=3e-11)


def test_air_that_thins_at_half_a_degree_a_hundred_metres_has_the_surveyors_coefficient():
    # 0.13 to 0.16 by day well above the ground, by every textbook of surveying
    k = EARTH_RADIUS * bending.curvature(bending.index_gradient(-0.0065, 15.0, 1013.25))
    assert 0.13 < float(k) < 0.18
    assert bending.curvature(bending.index_gradient(-1.0)) < 0.0  # hot ground: convex to it


@examples(12)
@given(st.floats(-3e-6, 3e-6).filter(lambda g: abs(g) > 1e-9), st.floats(10.0, 400.0), st.floats(-0.5, 1.0))
def test_closed_forms_are_the_rays_of_even_gradients(g, d, elevation):
    air = layered(lambda z: (2.6e-4 + g * z, g + 0 * z))
    c, s = np.cos(elevation), np.sin(elevation)
    ray = bent_ray(air, np.zeros(3), np.array([d * c, 0.0, d * s]))
    bent = bending.curvature(g, elevation, index=1.00026)
    up = np.array([-s, 0.0, c])
    # the index varies along a slanted path by g d s, at most 1.2e-3 of n; what is left of the series is less
    excess = float(bent) ** 2 * d**3 / 24  # the length above the chord, and the optical path below it
    assert ray.length_excess[0] == pytest.approx(excess, rel=4e-3, abs=2e-13)
    assert ray.optical_excess[0] == pytest.approx(-excess, rel=4e-3, abs=2e-13)
    assert ray.leaving[0] @ up == pytest.approx(float(bending.pointing_offset(bent, d)), rel=4e-3)
    assert ray.arriving[0] @ up == pytest.approx(-float(bending.pointing_offset(bent, d)), rel=4e-3)
    assert ray.sag[0] @ up == pytest.approx(float(bending.sag(bent, d)), rel=4e-3)


@pytest.mark.parametrize(("g", "d"), [(1e-6, 120.0), (1e-4, 150.0), (2.01e-4, 100.0), (-5e-3, 300.0), (0.0, 10.0)])
def test_the_bound_is_the_arcs(g, d):
    with mp.workdps(40):
        size, length = abs(mpf(g)), mpf(d)
        theta = 2 * mp.asin(size * length / 2)
        exact = length - (theta + mp.sin(theta)) / (2 * size) if g else mpf(0)
    assert bending.excess_bound(g, d) == pytest.approx(float(exact), rel=1e-9, abs=1e-18)


def test_one_kelvin_a_metre_over_120_m_does_not_matter_to_a_range_but_turns_the_beam_by_ten_arc_seconds():
    g = bending.index_gradient(-1.0)
    assert float(bending.excess_bound(g, 120.0)) < 0.1e-6
    assert abs(float(bending.pointing_offset(g, 120.0))) / ARCSECOND == pytest.approx(10.2, abs=0.1)
    assert float(bending.excess_bound(bending.steepest_gradient(0.2e-6, 120.0), 120.0)) == pytest.approx(0.2e-6)


def test_gradients_beyond_any_air_are_refused():
    with pytest.raises(ValidityError, match="gradient of the index 1 1/m is outside"):
        bending.excess_bound(1.0, 10.0)
    with pytest.raises(ValidityError, match="the chord is too long"):
        bending.excess_bound(0.01, 300.0)


def test_invalid_lengths_and_excesses_are_refused():
    with pytest.raises(ValidityError, match="excess -1e-06 m is outside"):
        bending.steepest_gradient(-1e-6, 120.0)
    with pytest.raises(ValidityError, match="length -1 m is outside"):
        bending.excess_bound(1e-6, -1.0)
