"""Panels of a paraboloid against roots found by scipy, sagittas, crossings of outlines and the site's own facts."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from catseye.geometry.antenna.panel_surface import axes, cosine_of_slope, panels_under, shares, warps
from catseye.geometry.antenna.panel_tool import turned
from catseye.simulator.laboratory.panels import panel_at
from panel_scene import dish

F = 60.0


@pytest.mark.parametrize("radius", [4.0, 54.0, 104.0])
@pytest.mark.parametrize("place", [(0.075, 0.075), (-0.106, 0.0), (0.0, 0.106)])
def test_the_rise_is_where_the_normal_meets_the_paraboloid(radius, place):
    at = axes(np.array([0.6 * radius, 0.8 * radius]), F)
    point, rise = at.places(*map(np.array, place), F)
    start = at.origin + place[0] * at.x + place[1] * at.y

    def above(w):
        x, y, z = start + w * at.z
        return z - (x * x + y * y) / (4.0 * F)

    assert rise == pytest.approx(brentq(above, -1e-3, 1e-3, xtol=1e-15), abs=1e-12)
    assert point[2] == pytest.approx((point[0] ** 2 + point[1] ** 2) / (4.0 * F), abs=1e-13)


def test_the_rise_is_the_sagitta_of_the_normal_sections():
    """Radii of curvature of a paraboloid: 2f (1 + u²)^(3/2) outwards, 2f (1 + u²)^(1/2) round; third order < 20 nm."""
    for radius in (4.0, 54.0, 104.0):
        at = axes(np.array([0.0, radius]), F)
        slope = radius / (2.0 * F)
        out, round_ = 2.0 * F * (1.0 + slope**2) ** 1.5, 2.0 * F * (1.0 + slope**2) ** 0.5
        for place, r in (((0.106, 0.0), out), ((0.0, 0.106), round_)):
            rise = at.places(*map(np.array, place), F)[1]
            assert rise == pytest.approx(0.106**2 / (2.0 * r), abs=2e-8)
            assert 18e-6 < rise < 48e-6  # tens of micrometres: beside a goal of 25 it must be known


def test_axes_are_right_handed_and_the_normal_looks_at_the_focus_side():
    at = axes(np.array([[3.0, 40.0], [-20.0, 70.0]]), F)
    assert np.cross(at.x, at.y) == pytest.approx(at.z, abs=1e-15)
    assert np.all(at.z[:, 2] > 0.0)
    to_focus = np.array([0.0, 0.0, F]) - at.origin
    to_focus /= np.linalg.norm(to_focus, axis=1)[:, None]
    mirrored = 2.0 * at.z * at.z[:, 2:] - np.array([0.0, 0.0, 1.0])  # the law of reflection: the focus is where it is
    assert mirrored == pytest.approx(to_focus, abs=1e-14)


def test_shares_give_back_linear_functions_and_know_what_is_inside():
    rng = np.random.default_rng(3)
    quad = np.array([[0.0, 0.0], [2.5, 0.1], [2.6, 1.9], [-0.1, 1.6]])
    place = quad.mean(axis=0) + rng.uniform(-3.0, 3.0, (400, 2))
    weight, inside = shares(place, np.broadcast_to(quad, (400, 4, 2)))
    assert weight[inside] @ quad == pytest.approx(place[inside], abs=1e-12)
    assert weight.sum(axis=1) == pytest.approx(np.ones(400))
    side, after = np.roll(quad, -1, axis=0) - quad, place[:, None] - quad
    known = np.all(side[:, 0] * after[..., 1] - side[:, 1] * after[..., 0] > 0.0, axis=1)
    assert np.array_equal(inside, known)
    assert 20 < inside.sum() < 380


def test_the_panel_under_a_place_is_the_one_whose_outline_goes_round_it():
    layout = dish()
    rng = np.random.default_rng(5)
    near = layout.xy[rng.integers(0, len(layout.corners), 300)] + rng.uniform(-0.2, 0.2, (300, 2))
    found, weight = panels_under(near, layout.xy[layout.quad])
    assert found.tolist() == [panel_at(layout, p) for p in near]
    assert np.any(found < 0)
    assert np.all(weight[found < 0] == 0.0)


def test_a_warp_is_what_no_plane_makes():
    quad = np.random.default_rng(7).uniform(-0.2, 0.2, (50, 4, 2)) + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    null = warps(quad)
    for plane in (np.ones((50, 4)), quad[..., 0], quad[..., 1]):
        assert np.sum(null * plane, axis=1) == pytest.approx(np.zeros(50), abs=1e-13)
    assert np.sum(np.abs(null), axis=1) == pytest.approx(np.ones(50))


def test_the_plumb_line_in_the_reflector_frame_is_that_of_the_notes():
    """Check values of 2.44, site facts: vertex and focus at elevation 45, azimuth 90; y is what is left, downwards."""
    vertex, focus = np.array([-35241.578, 0.0, 90572.632]), np.array([7184.829, 0.0, 132999.039])
    axis = (focus - vertex) / np.linalg.norm(focus - vertex)
    below = np.array([axis[2], 0.0, -axis[0]])  # across the axis in the vertical plane, from the vertex to the dish
    for part in (axis, below):
        own = np.array([0.0, part @ below, part @ axis])
        assert cosine_of_slope(own, np.radians(45.0)) == pytest.approx(part[2], abs=1e-6)
    assert cosine_of_slope(np.array([0.0, 0.0, 1.0]), np.radians(90.0)) == pytest.approx(1.0)


def test_quarter_turns_carry_gauges_round_and_come_back():
    gauge = np.array([0.075, 0.03])
    there = [turned(gauge, np.array(t)) for t in range(5)]
    assert np.array_equal(there[4], there[0])
    assert np.array_equal(there[2], -there[0])
    assert all(np.cross([*a, 0], [*b, 0])[2] > 0.0 for a, b in pairwise(there))
