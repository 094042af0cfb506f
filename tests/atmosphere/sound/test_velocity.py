"""Velocity corrections against a ray integrated through layers of air, and what they must do at their limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from catseye.atmosphere.sound.velocity import (
    EARTH_RADIUS,
    arc_to_chord_correction,
    first_velocity_correction,
    second_velocity_correction,
)
from catseye.errors import ValidityError

N0 = 1.00028


def ray(chord, k):
    """Geometric and optical length of the ray between two level points, by the ray equation in n(r), nothing expanded.

    d/ds (n dr/ds) = grad n, n = N0 (1 - k (|r| - R)/R), plane x along the chord, y up; from the middle by symmetry.
    """
    slope = -N0 * k / EARTH_RADIUS
    top = np.sqrt(EARTH_RADIUS**2 - 0.25 * chord**2)

    def rates(s, state):
        x, y, px, py, _ = state
        r = np.hypot(x, y)
        n = N0 + slope * (r - EARTH_RADIUS)
        return [px / n, py / n, slope * x / r, slope * y / r, n]

    def shot(rise):
        """From the middle, `rise` above the chord's middle, to where x is at the end."""
        n = N0 + slope * (top + rise - EARTH_RADIUS)

        def end(s, state):
            return state[0] - 0.5 * chord

        end.terminal = True
        found = solve_ivp(rates, (0, chord), [0, top + rise, n, 0, 0], events=end, rtol=1e-13, atol=1e-10)
        return found.t[-1], found.y[1, -1] - top, found.y[4, -1]

    guess = k * chord**2 / 8 / EARTH_RADIUS
    rise = brentq(lambda h: shot(h)[1], guess - 1.0, guess + 1.0, xtol=1e-9)
    half, _, optical = shot(rise)
    return 2 * half, 2 * optical


@pytest.mark.parametrize("k", [0.13, 0.5, -1.0])
def test_a_ray_through_a_real_gradient_is_reduced_to_its_chord(k):
    """60 km, where the corrections are centimetres to decimetres; 1 % of them is the next term of the series."""
    chord = 60_000.0
    length, optical = ray(chord, k)
    shown = optical / 1.0003  # an instrument of reference index 1.0003
    along = shown + first_velocity_correction(shown, 1.0003, N0)
    second = second_velocity_correction(along, refraction=k)
    assert along + second == pytest.approx(length, abs=0.01 * abs(second))
    bow = arc_to_chord_correction(length, refraction=k)
    assert length + bow == pytest.approx(chord, abs=0.01 * abs(bow) + 1e-6)


def test_thinner_air_than_the_reference_makes_lengths_longer():
    assert first_velocity_correction(500.0, 1.000286338, 1.000280) > 0.0
    assert first_velocity_correction(500.0, 1.000286338, 1.000290) < 0.0


@given(st.floats(1.0, 1e5), st.floats(1.0001, 1.0004), st.floats(1.0001, 1.0004))
def test_correcting_in_both_directions_cancels(length, first, second):
    there = length + first_velocity_correction(length, first, second)
    assert there + first_velocity_correction(there, second, first) == pytest.approx(length, rel=1e-14)


def test_at_baseline_lengths_ray_bending_is_negligible():
    assert abs(second_velocity_correction(510.0)) < 1e-7
    assert abs(arc_to_chord_correction(510.0)) < 1e-8


@pytest.mark.parametrize("index", [0.9997, 286.338, np.nan])
def test_an_index_that_is_not_airs_is_refused(index):
    with pytest.raises(ValidityError, match="index of air"):
        first_velocity_correction(100.0, index, 1.00028)
    with pytest.raises(ValidityError, match="radius"):
        second_velocity_correction(100.0, radius=6371.0)
