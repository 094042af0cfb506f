"""Motion and strain of a group are those of joint adjustments, with true covariance."""

import numpy as np
import pytest
from scipy import stats

from catseye.errors import EstimationError
from catseye.estimation.deformation.congruence import Epochs
from catseye.estimation.deformation.group_motion import group_motion
from catseye.estimation.shapes.rigid_body import motion_columns
from draws import draws
from epoch_scene import FIELD, SIGMA

GROUP = tuple(f"P{i}" for i in range(5))
STABLE = tuple(f"P{i}" for i in range(5, 9))


def group_movement(translation, rotation, strain):
    arms = FIELD.points[:5] - FIELD.points[:5].mean(axis=0)
    vector = np.zeros((9, 3))
    vector[:5] = translation + np.cross(rotation, arms) + arms @ strain
    return vector


def test_the_motion_and_strain_of_a_group_are_recovered():
    strain = 1e-6 * np.array([[5.0, 1.0, -2.0], [1.0, -3.0, 0.5], [-2.0, 0.5, 4.0]])
    true = group_movement([1e-3, -2e-3, 5e-4], [2e-5, -1e-5, 3e-5], strain)
    ranges = (np.zeros(len(FIELD.design)), FIELD.design @ true.ravel())
    found = group_motion(FIELD.epochs(ranges), GROUP, stable=STABLE, strain_axes=np.eye(3))
    np.testing.assert_allclose(found.translation, [1e-3, -2e-3, 5e-4], rtol=0, atol=2e-7)  # curvature: 2 mm in 40 m
    np.testing.assert_allclose(found.rotation, [2e-5, -1e-5, 3e-5], rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.strain, strain, rtol=0, atol=1e-8)
    assert found.components == ("xx", "yy", "zz", "xy", "xz", "yz")
    assert found.motion.p < 1e-12
    assert found.fit.p > 0.99
    assert found.fit.degrees_of_freedom == 27 - 6 - 12
    assert found.curvature == pytest.approx(0.5 * 14e-10 * np.linalg.norm(
        FIELD.points[:5] - FIELD.points[:5].mean(axis=0), axis=1).max())  # fmt: skip


def test_the_tests_of_a_group_are_sums_of_squares_of_joint_adjustments():
    """Nested least squares of both epochs in plain numpy: unmoved, moved as a body, strained."""
    ranges = FIELD.ranges(np.random.default_rng(15), group_movement([1e-4, 0, 0], [0, 2e-6, 0], np.diag([0, 0, 3e-6])))
    arms = FIELD.points[:5] - FIELD.points[:5].mean(axis=0)
    body = np.zeros((27, 6))
    body[:15] = motion_columns(arms, np.zeros(3))[:, :6]
    tensors = np.zeros((27, 9))
    tensors[:15] = np.einsum("ia,nb->niab", np.eye(3), arms).reshape(15, 9)
    stretch = tensors[:, [0, 4, 8, 1, 2, 5]] + tensors[:, [0, 4, 8, 3, 6, 7]]

    def squares(columns):
        a = np.concatenate([FIELD.design] * 2)
        second = np.concatenate([np.zeros((len(FIELD.design), columns.shape[1])), FIELD.design @ columns])
        a, b = np.concatenate([a, second], axis=1), np.concatenate(ranges)
        left = b - a @ np.linalg.pinv(a) @ b
        return left @ left / SIGMA**2

    still, moving, full = (squares(c) for c in (np.zeros((27, 0)), body, np.concatenate([body, stretch], axis=1)))
    found = group_motion(FIELD.epochs(ranges), GROUP, stable=STABLE, strain_axes=np.eye(3))
    np.testing.assert_allclose(found.motion.pvv, still - moving, rtol=1e-5)
    np.testing.assert_allclose(found.rigid.pvv, moving - full, rtol=1e-5)
    assert (found.motion.degrees_of_freedom, found.rigid.degrees_of_freedom) == (6, 6)
    np.testing.assert_allclose(found.motion.p, stats.chi2.sf(found.motion.pvv, 6))


@draws(400, 200)
def test_the_covariance_of_group_motion_holds_and_its_strain_test_keeps_its_level(runs):
    rng = np.random.default_rng(13)
    true = group_movement([1e-4, 0, 0], [0, 0, 1e-6], np.zeros((3, 3)))
    errors, p_rigid, p_fit = [], [], []
    for _ in range(runs):
        found = group_motion(FIELD.epochs(FIELD.ranges(rng, true)), GROUP, stable=STABLE, strain_axes=np.eye(3))
        values = np.concatenate(
            [found.translation, found.rotation, found.strain[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]]
        )
        errors.append(values - [1e-4, 0, 0, 0, 0, 1e-6, 0, 0, 0, 0, 0, 0])
        p_rigid.append(found.rigid.p)
        p_fit.append(found.fit.p)
    white = np.linalg.solve(np.linalg.cholesky(found.covariance), np.array(errors).T)
    np.testing.assert_allclose(white @ white.T / runs, np.eye(12), atol=5.0 * np.sqrt(2.0 / runs))
    for p in (p_rigid, p_fit):
        assert abs(np.mean(np.array(p) < 0.05) - 0.05) < 3.5 * np.sqrt(0.05 * 0.95 / runs)


def test_strain_within_a_plane_needs_no_thickness():
    rng = np.random.default_rng(14)
    first = np.concatenate([rng.uniform(-2, 2, (6, 3)) * [1, 1, 0], rng.uniform(-9, 9, (4, 3))])
    names = tuple("ABCDEFGHIJ")
    second = first.copy()
    second[:6, :2] += first[:6, :2] @ np.array([[2e-5, 1e-5], [1e-5, 0.0]])
    q = np.eye(30) * 1e-12
    epochs = Epochs(names, first, second, q, q)
    found = group_motion(epochs, "ABCDEF", stable="GHIJ", strain_axes=np.eye(3)[:, :2], pivot=np.zeros(3))
    np.testing.assert_allclose(found.strain[:2, :2], [[2e-5, 1e-5], [1e-5, 0.0]], rtol=0, atol=1e-12)
    assert found.rigid.degrees_of_freedom == 3
    assert found.rigid.p < 1e-12
    with pytest.raises(EstimationError, match=r"not determined by these points: .*strain zz"):
        group_motion(epochs, "ABCDEF", stable="GHIJ", strain_axes=np.eye(3))
    with pytest.raises(EstimationError, match="turn about x of the group"):
        group_motion(epochs, "AB", stable="GHIJ")
    with pytest.raises(EstimationError, match="X: not common"):
        group_motion(epochs, "ABX", stable="GHIJ")
    with pytest.raises(EstimationError, match="A: both in group and stable"):
        group_motion(epochs, "ABC", stable="AGH")
    with pytest.raises(EstimationError, match="not orthonormal"):
        group_motion(epochs, "ABCD", stable="GHIJ", strain_axes=2 * np.eye(3))
    rigid = group_motion(epochs, "ABCDEF", stable="GHIJ")
    assert rigid.rigid is None
    assert not rigid.strain.any()
