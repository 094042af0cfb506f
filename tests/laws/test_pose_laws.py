"""Laws of poses: frame and pivot are words about a motion, and change nothing of what it does."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.estimation.shapes.pose import PlaceCovariances, fit_pose
from catseye.geometry.frames.frame import Transform

coordinate = st.floats(-100.0, 100.0)
triple = st.lists(coordinate, min_size=3, max_size=3).map(np.array)
angle = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).map(np.array)


def pose(seed, size=1e-4):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-40, 40, (7, 3))
    turn = Rotation.from_rotvec(rng.normal(size=3) * size).as_matrix()
    y = x @ turn.T + rng.normal(size=3) * 1e-3 + rng.normal(size=x.shape) * 1e-4
    root = rng.normal(size=(21, 42)) * 1e-4 / 6
    names = [f"P{k}" for k in range(7)]
    return fit_pose(names, x, y, frame="ground", covariance=PlaceCovariances(second=root @ root.T)), x


@given(st.integers(0, 10**6), triple, triple, st.sampled_from([1e-5, 1e-2, 1.0]))
def test_another_pivot_leaves_every_point_and_its_uncertainty_where_they_were(seed, pivot, anywhere, size):
    found, x = pose(seed, size)
    told = found.about(pivot)
    places = np.vstack([x, anywhere])
    np.testing.assert_allclose(told.motion.apply(places), found.motion.apply(places), rtol=0, atol=1e-11)
    (a, qa), (b, qb) = found.displacement(places), told.displacement(places)
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-11)
    np.testing.assert_allclose(qa, qb, rtol=0, atol=1e-9 * np.abs(qa).max())
    np.testing.assert_array_equal(told.rotation, found.rotation)
    np.testing.assert_array_equal(told.motion.residual, found.motion.residual)
    home = told.about(found.pivot)
    np.testing.assert_allclose(home.translation, found.translation, rtol=0, atol=1e-11)
    np.testing.assert_allclose(home.covariance, found.covariance, rtol=0, atol=1e-9 * np.abs(qa).max())


@given(st.integers(0, 10**6), angle, triple)
def test_another_frame_leaves_every_point_where_it_was(seed, turn, shift):
    found, x = pose(seed)
    to = Transform("reflector", "ground", Rotation.from_rotvec(turn).as_matrix(), shift)
    told = found.in_frame(to)
    np.testing.assert_allclose(told.motion.apply(to.points(x)), to.points(found.motion.apply(x)), rtol=0, atol=1e-11)
    home = told.in_frame(to.inverse())
    np.testing.assert_allclose(home.translation, found.translation, rtol=0, atol=1e-13)
    np.testing.assert_allclose(home.pivot, found.pivot, rtol=0, atol=1e-11)
    np.testing.assert_allclose(home.covariance, found.covariance, rtol=0, atol=1e-12 * np.abs(found.covariance).max())


@given(st.integers(0, 10**6), angle, triple, triple)
def test_pivot_and_frame_may_change_in_either_order(seed, turn, shift, pivot):
    found, _ = pose(seed)
    to = Transform("reflector", "ground", Rotation.from_rotvec(turn).as_matrix(), shift)
    a, b = found.about(pivot).in_frame(to), found.in_frame(to).about(to.points(pivot))
    np.testing.assert_allclose(a.translation, b.translation, rtol=0, atol=1e-12)
    np.testing.assert_allclose(a.covariance, b.covariance, rtol=0, atol=1e-9 * np.abs(a.covariance).max())
