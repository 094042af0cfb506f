"""Ellipsoids against exact geometry, printed confidence factors and Monte Carlo."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.errors import EstimationError
from catseye.estimation.quality.ellipsoid import (
    confidence_scale,
    contained_probability,
    elevation_view,
    ellipse,
    ellipsoid,
    horizontal_ellipse,
    point_uncertainty,
    projected,
    relative_covariance,
    weakest_direction,
)
from draws import examples

quick = examples(60)
seeds = st.integers(0, 2**32 - 1)


def covariances(seed, *shape):
    a = np.random.default_rng(seed).normal(size=(*shape, 3, 3)) * 1e-4
    return a @ np.swapaxes(a, -1, -2)


@quick
@given(seeds)
def test_an_ellipsoid_rebuilds_its_covariance_and_is_right_handed(seed):
    c = covariances(seed, 2, 5)
    e = ellipsoid(c)
    rebuilt = e.directions @ (e.semi_axes[..., None] ** 2 * np.swapaxes(e.directions, -1, -2))
    np.testing.assert_allclose(rebuilt, c, atol=1e-12 * np.abs(c).max())
    np.testing.assert_allclose(np.linalg.det(e.directions), 1.0, rtol=1e-12)
    assert (np.diff(e.semi_axes, axis=-1) <= 0.0).all()
    for k in (0, 1):
        column = e.directions[..., k]
        assert (np.take_along_axis(column, np.abs(column).argmax(-1)[..., None], -1) > 0.0).all()


@quick
@given(seeds)
def test_an_ellipsoid_turns_with_its_covariance(seed):
    c, r = covariances(seed), Rotation.random(random_state=seed).as_matrix()
    here, there = ellipsoid(c), ellipsoid(r @ c @ r.T)
    np.testing.assert_allclose(there.semi_axes, here.semi_axes, atol=1e-9 * here.semi_axes[0])
    assert abs(there.directions[:, 0] @ r @ here.directions[:, 0]) == pytest.approx(1.0, abs=1e-5)


def test_a_known_turned_ellipsoid_has_its_axes():
    r = Rotation.from_euler("ZYX", [0.3, -0.2, 0.5]).as_matrix()
    e = ellipsoid(r @ np.diag([1.0, 25.0, 4.0]) @ r.T)
    np.testing.assert_allclose(e.semi_axes, [5.0, 2.0, 1.0])
    np.testing.assert_allclose(np.abs(r.T @ e.directions), [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)


def test_a_held_coordinate_makes_a_flat_ellipsoid_and_no_answer_makes_nan():
    e = ellipsoid(np.array([np.diag([4.0, 0.0, 1.0]), np.full((3, 3), np.nan)]))
    assert e.semi_axes[0].tolist() == [2.0, 1.0, 0.0]
    assert np.isnan(e.semi_axes[1]).all()
    assert np.isnan(e.directions[1]).all()
    assert np.isnan(horizontal_ellipse(np.full((3, 3), np.nan)).bearing)


def test_a_matrix_with_a_negative_eigenvalue_is_refused():
    with pytest.raises(EstimationError, match="covariance 1 is invalid: its smallest eigenvalue is -1"):
        ellipsoid(np.array([np.eye(3), np.diag([1.0, -1.0, 2.0])]))
    with pytest.raises(EstimationError, match="must not be negative"):
        ellipse(np.diag([1.0, -0.1]))


@pytest.mark.parametrize(
    ("probability", "dimensions", "printed"),
    # square roots of the chi-square table: 3.841, 5.991, 7.815 at 95 %; 6.635, 9.210, 11.345 at 99 %
    [(0.95, 1, 3.841), (0.95, 2, 5.991), (0.95, 3, 7.815), (0.99, 1, 6.635), (0.99, 2, 9.210), (0.99, 3, 11.345)],
)
def test_confidence_factors_are_those_of_the_printed_chi_square_table(probability, dimensions, printed):
    assert confidence_scale(probability, dimensions) ** 2 == pytest.approx(printed, abs=6e-4)


def test_confidence_factors_with_few_degrees_of_freedom_are_those_of_the_printed_f_table():
    assert confidence_scale(0.95, 2, 10) ** 2 / 2 == pytest.approx(4.10, abs=6e-3)  # F(2, 10)
    assert confidence_scale(0.95, 3, 20) ** 2 / 3 == pytest.approx(3.10, abs=6e-3)  # F(3, 20)
    assert confidence_scale(0.95, 3, 1e7) == pytest.approx(confidence_scale(0.95, 3), rel=1e-5)


@quick
@given(st.floats(0.01, 0.999), st.integers(1, 3), st.sampled_from([3.0, 40.0, np.inf]))
def test_the_contained_probability_inverts_the_confidence_factor(probability, dimensions, degrees):
    scale = confidence_scale(probability, dimensions, degrees)
    assert contained_probability(scale, dimensions, degrees) == pytest.approx(probability, rel=1e-9)


def test_impossible_probabilities_are_refused():
    with pytest.raises(EstimationError, match="no confidence region of probability 95 in 3 dimensions"):
        confidence_scale(95, 3)


def test_confidence_regions_hold_the_share_of_points_that_they_claim():
    c = covariances(4)
    points = np.random.default_rng(9).multivariate_normal(np.zeros(3), c, size=40_000)
    e = ellipsoid(c)
    inside = np.sum((points @ e.directions / e.semi_axes) ** 2, axis=1) < confidence_scale(0.9, 3) ** 2
    assert inside.mean() == pytest.approx(0.9, abs=0.006)
    h = horizontal_ellipse(c)
    major = np.array([np.sin(h.bearing), np.cos(h.bearing)])  # east, north
    minor = np.array([np.cos(h.bearing), -np.sin(h.bearing)])
    flat = (points[:, :2] @ major / h.major) ** 2 + (points[:, :2] @ minor / h.minor) ** 2
    assert np.mean(flat < confidence_scale(0.9, 2) ** 2) == pytest.approx(0.9, abs=0.006)


@quick
@given(seeds)
def test_the_bearing_is_the_direction_of_greatest_variance_clockwise_from_north(seed):
    c = covariances(seed)
    h = horizontal_ellipse(c)
    turn = np.linspace(0.0, np.pi, 2001)
    along = np.stack([np.sin(turn), np.cos(turn), 0 * turn])
    variance = np.sum(along * (c @ along), axis=0)
    u = np.array([np.sin(h.bearing), np.cos(h.bearing), 0.0])
    assert 0.0 <= h.bearing < np.pi
    assert u @ c @ u == pytest.approx(h.major**2, rel=1e-9)
    assert variance.max() <= h.major**2 * (1 + 1e-9)
    assert variance.min() >= h.minor**2 - 1e-9 * h.major**2


def test_bearings_of_plain_ellipses():
    assert horizontal_ellipse(np.diag([1.0, 4.0, 9.0])).bearing == 0.0  # long to the north
    assert horizontal_ellipse(np.diag([4.0, 1.0, 9.0])).bearing == pytest.approx(np.pi / 2)
    assert horizontal_ellipse(np.eye(3)).bearing == 0.0
    south_east = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    assert horizontal_ellipse(south_east).bearing == pytest.approx(np.radians(135.0))


def test_elevations_show_what_stands_to_the_right_and_up():
    np.testing.assert_allclose(elevation_view(np.pi / 2)[0], [0, -1, 0], atol=1e-15)  # looking east: south to the right
    c = np.diag([9.0, 4.0, 1.0])
    np.testing.assert_allclose(projected(c, elevation_view(0.0)), np.diag([9.0, 1.0]))
    np.testing.assert_allclose(projected(c, elevation_view(np.pi / 2)), np.diag([4.0, 1.0]), atol=1e-14)


def test_relative_covariance_is_that_of_the_difference():
    a = np.random.default_rng(0).normal(size=(4, 6, 6))
    joint = a @ np.swapaxes(a, -1, -2)
    pick = np.hstack([-np.eye(3), np.eye(3)])
    np.testing.assert_allclose(relative_covariance(joint), pick @ joint @ pick.T, rtol=1e-12)
    same = np.tile(covariances(2), (2, 2))  # two points that move as one have no relative uncertainty
    np.testing.assert_allclose(relative_covariance(same), 0.0, atol=1e-24)


def test_point_uncertainty_is_the_root_mean_square_distance_from_the_truth():
    c = covariances(8)
    points = np.random.default_rng(1).multivariate_normal(np.zeros(3), c, size=40_000)
    assert point_uncertainty(c) == pytest.approx(np.sqrt(np.mean(np.sum(points**2, axis=1))), rel=0.02)


def test_the_weakest_direction_of_a_chain_is_its_free_end():
    steps = np.kron(np.tril(np.ones((3, 3))), np.eye(3))  # each point is measured from the one before
    u, motion = weakest_direction(steps @ steps.T)
    assert motion.shape == (9,)
    lengths = np.linalg.norm(motion.reshape(3, 3), axis=1)
    assert lengths[2] > lengths[1] > lengths[0]
    assert u**2 == pytest.approx(1 / (4 * np.sin(np.pi / 14) ** 2), rel=1e-9)  # of a random walk of three steps
    with pytest.raises(EstimationError, match="leave it out"):
        weakest_direction(np.full((3, 3), np.nan))


@pytest.mark.parametrize("gone", [(2,), (0, 1), (1,), (0, 2)])
def test_missing_coordinates_leave_the_ellipsoid_of_the_others(gone):
    rng = np.random.default_rng(4)
    root = rng.normal(size=(5, 3, 3))
    covariance = root @ np.swapaxes(root, 1, 2)
    covariance[1] *= 1e-12  # below a metre squared by far
    there = [k for k in range(3) if k not in gone]
    right = np.sqrt(np.linalg.eigvalsh(covariance[:, there][:, :, there])[:, ::-1])
    covariance[:, gone] = covariance[:, :, gone] = np.nan
    covariance[4] = np.nan  # nothing known at all
    e = ellipsoid(covariance)
    assert e.semi_axes[:4, : len(there)] == pytest.approx(right[:4], rel=1e-9)
    assert np.isnan(e.semi_axes[:, len(there) :]).all()
    assert np.isnan(e.semi_axes[4]).all()
    assert np.abs(e.directions[:4][:, list(gone), : len(there)]).max() < 1e-12
