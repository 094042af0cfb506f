"""Motions of frames: their functions of posture against numpy and scipy, rotations against scipy, slopes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RectBivariateSpline
from scipy.spatial.transform import Rotation

from catseye.errors import ValidityError
from catseye.geometry.antenna.deformation import (
    KnotTable,
    PostureMotion,
    PostureTerms,
    TelescopePosture,
    Validity,
    carried,
    left_jacobian,
    motion_jacobian,
)

SMALL = st.floats(-0.3, 0.3)
SIX = st.tuples(*[SMALL] * 6)


def test_terms_are_the_functions_that_their_names_say():
    a, e, t = 1.1, 0.6, -3.0
    rows = PostureTerms(("1", "sinE", "cos2E", "E^2*t", "sinA", "cos3A*t^2", "t"), 15.0).rows(TelescopePosture(a, e, t))
    warm = t - 15.0
    expected = [1.0, np.sin(e), np.cos(2 * e), e**2 * warm, np.sin(a), np.cos(3 * a) * warm**2, warm]
    np.testing.assert_allclose(rows, expected, rtol=1e-15)


def test_terms_of_many_postures_have_the_postures_shape():
    rows = PostureTerms(("1", "cosE", "t"), 15.0).rows(
        TelescopePosture(0.0, np.linspace(0, 1, 5)[:, None], np.array([10.0, 20.0]))
    )
    assert rows.shape == (5, 2, 3)


@pytest.mark.parametrize("term", ["sin", "sinE+1", "E^5", "T", "sinB", "", "cos1E"])
def test_a_term_that_is_not_known_is_refused_by_name(term):
    with pytest.raises(ValidityError, match="is not known"):
        PostureTerms((term,), 15.0)


def test_a_table_is_the_spline_that_scipy_has():
    rng = np.random.default_rng(5)
    e, t = np.radians([0.0, 10.0, 25.0, 45.0, 70.0, 95.0]), np.array([-20.0, 0.0, 15.0, 40.0])
    values = rng.normal(size=(6, 4))
    spline = RectBivariateSpline(e, t, values, s=0)
    at_e, at_t = np.radians(rng.uniform(0, 95, 50)), rng.uniform(-20, 40, 50)
    found = KnotTable(e, t).rows(TelescopePosture(0.0, at_e, at_t)) @ values.ravel()
    np.testing.assert_allclose(found, spline(at_e, at_t, grid=False), rtol=0, atol=1e-12)


def test_a_table_gives_its_knots_and_a_cubic_between_them():
    e, t = np.radians(np.linspace(0, 95, 8)), np.array([-10.0, 10.0, 30.0])
    table = KnotTable(e, t)

    def truth(e, t):
        return 1.0 - 0.4 * e + 0.3 * e**3 + 0.01 * t * e + 1e-4 * t**2

    values = truth(e[:, None], t).ravel()
    grid = TelescopePosture(0.0, e[:, None], t)
    np.testing.assert_allclose(table.rows(grid) @ values, truth(e[:, None], t), rtol=0, atol=1e-13)
    between = TelescopePosture(0.0, np.radians(33.3), 22.2)
    # a cubic in elevation and a parabola in temperature are in the spline's space
    np.testing.assert_allclose(table.rows(between) @ values, truth(np.radians(33.3), 22.2), rtol=0, atol=1e-12)


def test_a_table_of_one_temperature_does_not_depend_on_it():
    table = KnotTable(np.radians([0.0, 45.0, 90.0]), np.array([15.0]))
    np.testing.assert_array_equal(
        table.rows(TelescopePosture(0.0, 0.5, -30.0)), table.rows(TelescopePosture(0.0, 0.5, 30.0))
    )


@pytest.mark.parametrize(
    ("elevation", "temperature", "what"),
    [(96.0, 0.0, "elevation 96"), (-1.0, 0.0, "elevation"), (50.0, 41.0, "temperature 41 C"), (np.nan, 0.0, "nan")],
)
def test_outside_its_range_nothing_is_extrapolated(elevation, temperature, what):
    table = KnotTable(np.radians([0.0, 50.0, 95.0]), np.array([-20.0, 40.0]))
    with pytest.raises(ValidityError, match=what):
        table.rows(TelescopePosture(0.0, np.radians(elevation), temperature))
    with pytest.raises(ValidityError, match=what):
        Validity((0.0, np.radians(95.0)), (-20.0, 40.0)).refuse_outside(
            TelescopePosture(0.0, [0.5, np.radians(elevation)], temperature)
        )


def test_the_ends_of_the_range_belong_to_it():
    limits = Validity((np.radians(5.0), np.radians(95.0)), (-20.0, 40.0))
    limits.refuse_outside(TelescopePosture(0.0, 95.0 * np.pi / 180.0, 40.0))
    table = KnotTable(np.radians([5.0, 95.0]), np.array([-20.0, 40.0]))
    np.testing.assert_allclose(
        table.rows(TelescopePosture(0.0, np.deg2rad(95.0), 40.0)), [0, 0, 0, 1], rtol=0, atol=1e-12
    )


def test_knots_that_do_not_rise_are_refused():
    with pytest.raises(ValidityError, match="do not increase"):
        KnotTable(np.array([0.0, 0.5, 0.4]), np.array([15.0]))


@given(SIX, st.tuples(SMALL, SMALL, SMALL))
def test_a_frame_turns_about_its_pivot_by_the_right_hand(six, pivot):
    rotation, translation = carried(six, pivot)
    np.testing.assert_allclose(rotation, Rotation.from_rotvec(six[3:]).as_matrix(), rtol=0, atol=1e-15)
    np.testing.assert_allclose(rotation @ pivot + translation, np.add(pivot, six[:3]), rtol=0, atol=1e-15)


@given(SIX, st.tuples(SMALL, SMALL, SMALL))
def test_derivatives_are_the_slopes_of_what_is_carried(six, pivot):
    x = np.array([2.0, -1.0, 3.0])

    def point(values):
        rotation, translation = carried(values, pivot)
        return rotation @ x + translation

    slopes = np.stack([(point(six + h) - point(six - h)) / 2e-6 for h in 1e-6 * np.eye(6)], axis=-1)
    np.testing.assert_allclose(motion_jacobian(six, pivot, x), slopes, rtol=0, atol=2e-9)  # rounding over the step


@given(st.tuples(*[st.floats(-1.5, 1.5)] * 3))
def test_the_left_jacobian_joins_a_change_of_the_vector_to_a_small_turn(turn):
    w, change = np.array(turn), 1e-6 * np.array([0.3, -0.5, 0.8])
    small = Rotation.from_rotvec(w + change) * Rotation.from_rotvec(w - change).inv()
    np.testing.assert_allclose(left_jacobian(w) @ (2.0 * change), small.as_rotvec(), rtol=0, atol=1e-15)
    # as a series near zero: J(w) = 1 + [w]/2 + ..., so that its product with w is w
    np.testing.assert_allclose(left_jacobian(w) @ w, w, rtol=0, atol=1e-14)


def test_a_motions_covariance_is_the_scatter_of_its_coefficients_and_what_is_left():
    rng = np.random.default_rng(3)
    basis = PostureTerms(("1", "sinE", "t"), 15.0)
    root = rng.normal(size=(18, 18)) * 1e-4
    motion = PostureMotion(basis, np.zeros((6, 3)), np.zeros(3), np.full(6, 2e-4), root @ root.T)
    posture = TelescopePosture(0.0, 0.7, 18.0)
    draws = (root @ rng.standard_normal((18, 20_000))).T.reshape(-1, 6, 3)
    six = draws @ basis.rows(posture) + 2e-4 * rng.standard_normal((20_000, 6))
    claimed = motion.six_covariance(posture)
    # 20 000 draws show a variance to 1 %, and 4 % is four of these
    sigma = np.sqrt(np.diag(claimed))
    np.testing.assert_allclose(
        np.cov(six.T) / np.outer(sigma, sigma), claimed / np.outer(sigma, sigma), rtol=0, atol=0.04
    )


def test_a_motion_of_wrong_shape_is_refused():
    with pytest.raises(ValidityError, match="motion of 2 functions"):
        PostureMotion(PostureTerms(("1", "t"), 15.0), np.zeros((6, 3)), np.zeros(3), np.ones(6))
