"""Rigid triplets: what moving the ground does to them, and what they add to an adjustment."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.observations.kinds import Linear, ObservedCoordinates, RigidTriplets
from catseye.estimation.observations.unit_direction import across

seeds = st.integers(0, 2**32 - 1)
AT = (np.array([0]), np.array([3]), np.array([6]))
TILT = np.array([[9, 10]])


def body(start, **others):
    return RigidTriplets("t", np.zeros(5), np.eye(5)[None], *AT, TILT, start, **others)


def placed(rng, own):
    """A unit whose ball lies at `own` (along, across, height), spacing 0.635, its line leaning by 2 mrad out of the
    plate: ground points and the normal, by scipy's rotations."""
    turn = Rotation.random(random_state=rng)
    lean = Rotation.from_rotvec([0.0, -2e-3, 0.0])  # turns x towards +z: the right prism stands higher
    points = np.array([[-0.3175, 0.0, 0.0], [0.3175, 0.0, 0.0], own])
    ground = turn.apply(points) + rng.normal(size=3) * 40.0
    return ground.ravel(), turn.apply(lean.inv().apply([0.0, 0.0, 1.0]))


@given(seeds)
def test_unit_geometry_is_independent_of_its_pose(seed):
    rng = np.random.default_rng(seed)
    own = rng.normal(size=3) * 1e-3
    ground, normal = placed(rng, own)
    values = body(normal).predict(np.concatenate([ground, [0.0, 0.0]]))[0]
    np.testing.assert_allclose(values, [*own, 0.635, np.sin(2e-3)], rtol=0, atol=1e-13)  # double precision at 40 m


@given(seeds)
def test_tilts_move_the_normal_along_the_axes_across_its_start(seed):
    rng = np.random.default_rng(seed)
    ground, normal = placed(rng, rng.normal(size=3) * 1e-3)
    start = normal + 0.02 * rng.normal(size=3)
    start /= np.linalg.norm(start)
    tilt = across(start[None])[0] @ normal / (start @ normal)
    there = body(start).predict(np.concatenate([ground, tilt]))[0]
    here = body(normal).predict(np.concatenate([ground, [0.0, 0.0]]))[0]
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-14 * 20)


def test_exchanged_prisms_turn_along_and_across_and_leave_the_height():
    """A unit whose serials are swapped: the axis reverses, and with it y = z x x; H_corr stays."""
    ground, normal = placed(np.random.default_rng(3), np.array([1e-3, 2e-3, 3e-3]))
    swapped = np.concatenate([ground[3:6], ground[:3], ground[6:], [0.0, 0.0]])
    values = body(normal).predict(swapped)[0]
    np.testing.assert_allclose(values, [-1e-3, -2e-3, 3e-3, 0.635, -np.sin(2e-3)], rtol=0, atol=1e-13)


def test_coinciding_prisms_give_nan_only_in_their_unit():
    ground, normal = placed(np.random.default_rng(5), np.zeros(3))
    x = np.concatenate([ground, [0.0, 0.0], ground])
    x[3:6] = x[:3]
    two = RigidTriplets(
        "t", np.zeros(10), np.ones(10), np.array([0, 11]), np.array([3, 14]), np.array([6, 17]),
        np.array([[9, 10], [-1, -1]]), normal,
    )  # fmt: skip
    values, jacobian = two.predict(x)
    assert np.isnan(values[[0, 1, 2, 4]]).all()
    assert np.isnan(jacobian[:5]).any(axis=1).all()
    assert np.isfinite(values[5:]).all()
    assert np.isfinite(jacobian[5:]).all()


def test_a_normal_along_the_prisms_is_not_defined():
    values = body(np.array([1.0, 0.0, 0.0])).predict(np.array([0, 0, 0, 1, 0, 0, 0.5, 0.1, 0.1, 0, 0], dtype=float))[0]
    assert np.isnan(values[1:3]).all()


def test_what_does_not_fit_is_refused():
    with pytest.raises(EstimationError, match="t: 5 observed values for 2 triplets; give 5 per unit"):
        RigidTriplets("t", np.zeros(5), np.ones(5), *(np.array([0, 3]),) * 3, np.zeros((2, 2), int), np.ones(3))
    with pytest.raises(EstimationError, match="t: the plate's normal has zero length"):
        body(np.zeros(3))


def test_squareness_determines_the_tilt_about_the_prism_line():
    """Prisms known to 0.1 mm, u of the right angle 0.25 mrad: a prior of 5 mrad on the tilt along them becomes
    hypot(0.25, sqrt(2) 0.1/635 = 0.22) = 0.335 mrad; the tilt about their line stays where its prior is."""
    x = np.concatenate([[-0.3175, 0, 0, 0.3175, 0, 0, 0, 0, 0], [0.0, 0.0]])
    values = body(np.array([0.0, 0.0, 1.0])).predict(x)[0]
    u = np.array([40e-6, 40e-6, 20e-6, 30e-6, 0.25e-3])
    unit = replace(body(np.array([0.0, 0.0, 1.0])), observed=values, covariance=np.diag(u**2)[None])
    known = ObservedCoordinates.of_points("prisms", x[:6], np.full(6, 1e-8), np.array([0, 3]))
    prior = Linear("tilts", np.zeros(2), np.full(2, 25e-6), np.array([9, 10]), np.eye(2))
    solution = adjust(x, [unit, known, prior]).require_converged()
    u_tilt = np.sqrt(np.diag(solution.covariance)[9:])
    along = across(np.array([[0.0, 0.0, 1.0]]))[0] @ np.array([1.0, 0.0, 0.0])  # which tilt is along the line
    expected = 1.0 / np.sqrt(1.0 / (0.25e-3**2 + 2e-8 / 0.635**2) + 1.0 / 5e-3**2)
    assert along.tolist() == [1.0, 0.0]
    # the ranges hold the spacing too, so the prisms' depths stay at 0.1 mm: 1 % covers the ball's pull
    np.testing.assert_allclose(u_tilt, [expected, 5e-3], rtol=0.01)
