"""Rotations against SciPy's, and at the edges: zero, a half turn, batches."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.errors import ValidityError
from catseye.geometry.frames.rotation import from_vector, rx, ry, rz, skew, to_vector

ROUNDING = 1e-15 * 8  # a few roundings of numbers up to 1


@pytest.mark.parametrize(("matrix", "axis"), [(rx, "x"), (ry, "y"), (rz, "z")])
def test_passive_matrices_are_the_inverse_of_scipys_active_ones(matrix, axis):
    angles = np.linspace(-7.0, 7.0, 29)
    expected = Rotation.from_euler(axis, angles[:, None]).inv().as_matrix()
    np.testing.assert_allclose(matrix(angles), expected, rtol=0, atol=ROUNDING)


def test_vectors_agree_with_scipy_both_ways():
    vectors = np.random.default_rng(5).normal(size=(500, 3)) * np.geomspace(1e-12, 1.0, 500)[:, None]
    matrices = from_vector(vectors)
    np.testing.assert_allclose(matrices, Rotation.from_rotvec(vectors).as_matrix(), rtol=0, atol=ROUNDING)
    within = np.linalg.norm(vectors, axis=1) < np.pi
    np.testing.assert_allclose(to_vector(matrices)[within], vectors[within], rtol=1e-12, atol=1e-16)


def test_zero_gives_the_identity_and_back():
    assert np.array_equal(from_vector(np.zeros((2, 3))), np.broadcast_to(np.eye(3), (2, 3, 3)))
    assert np.array_equal(to_vector(np.eye(3)), np.zeros(3))


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0.0, 0.8), (-0.48, 0.6, -0.64)])
def test_a_half_turn_comes_back_as_itself_or_its_opposite(axis):
    vector = np.pi * np.array(axis, dtype=float)
    back = to_vector(from_vector(vector))
    assert min(np.abs(back - vector).max(), np.abs(back + vector).max()) < 1e-14


def test_a_nearly_half_turn_keeps_its_sense():
    vector = (np.pi - 1e-6) * np.array([0.6, 0.0, 0.8])
    np.testing.assert_allclose(to_vector(from_vector(vector)), vector, rtol=0, atol=1e-14)


def test_batches_keep_their_shape():
    assert rx(np.zeros((4, 5))).shape == (4, 5, 3, 3)
    assert from_vector(np.zeros((4, 5, 3))).shape == (4, 5, 3, 3)
    assert to_vector(np.broadcast_to(np.eye(3), (4, 5, 3, 3))).shape == (4, 5, 3)


def test_wrong_shapes_are_named():
    with pytest.raises(ValidityError, match=r"vector has shape \(2,\), expected \(\.\.\., 3\)"):
        skew([1.0, 2.0])
    with pytest.raises(ValidityError, match=r"rotation matrix has shape \(3,\), expected"):
        to_vector([1.0, 2.0, 3.0])
