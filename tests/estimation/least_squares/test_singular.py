"""Estimates from a singular covariance are those of elimination, and what floats or contradicts is named."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import catseye.estimation.least_squares.singular as module
from catseye.errors import EstimationError
from catseye.estimation.least_squares.singular import best_linear_estimate


def covariance_of(rng, m, sigma):
    root = rng.normal(size=(m, 2 * m)) * sigma / np.sqrt(2 * m)
    return root @ root.T


@given(st.integers(0, 2**31))
def test_with_a_regular_covariance_it_is_weighted_least_squares(seed):
    rng = np.random.default_rng(seed)
    design, values, q = rng.normal(size=(8, 3)), rng.normal(size=8), covariance_of(rng, 8, 2.0)
    found = best_linear_estimate(design, values, q, parameters=list("abc"), rows=list("12345678"))
    white = np.linalg.inv(np.linalg.cholesky(q))
    expected, squares, _, _ = np.linalg.lstsq(white @ design, white @ values, rcond=None)
    np.testing.assert_allclose(found.estimate, expected, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(found.gain @ values, found.estimate, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found.gain @ design, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(found.gain @ q @ found.gain.T, found.covariance, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.pvv, squares[0], rtol=1e-6)
    assert found.degrees_of_freedom == 5


def test_estimates_with_exactly_known_rows_are_those_of_elimination():
    """Held rows (zero variance) against a least squares where they are solved for beforehand; not our code."""
    rng = np.random.default_rng(5)
    design, values = rng.normal(size=(9, 3)), rng.normal(size=9)
    q = np.zeros((9, 9))
    q[2:, 2:] = covariance_of(rng, 7, 1.0)
    found = best_linear_estimate(design, values, q, parameters=list("abc"), rows=list("123456789"))
    particular = np.linalg.lstsq(design[:2], values[:2], rcond=None)[0]
    null = np.linalg.svd(design[:2])[2][2:].T
    a, w = design[2:] @ null, np.linalg.inv(q[2:, 2:])
    rest = values[2:] - design[2:] @ particular
    expected = particular + null @ np.linalg.solve(a.T @ w @ a, a.T @ w @ rest)
    np.testing.assert_allclose(found.estimate, expected, atol=1e-10)
    np.testing.assert_allclose(found.covariance, null @ np.linalg.inv(a.T @ w @ a) @ null.T, atol=1e-10)
    left = values[2:] - design[2:] @ expected
    np.testing.assert_allclose(found.pvv, left @ w @ left, rtol=1e-9)


def test_floating_or_exactly_known_combinations_are_named():
    names = {"rows": list("123")}
    with pytest.raises(EstimationError, match="not determined by these points: b"):
        best_linear_estimate(np.eye(3)[:, :2] * [1, 0], np.zeros(3), np.eye(3), parameters=["a", "b"], **names)
    with pytest.raises(EstimationError, match=r"not determined by these points: a, b"):
        best_linear_estimate(np.ones((3, 2)), np.zeros(3), np.eye(3), parameters=["a", "b"], **names)
    q = np.array([[1.0, 0, 0], [0, 1, 1], [0, 1, 1]])
    with pytest.raises(EstimationError, match=r"combination of (2, 3|3, 2) has zero variance"):
        best_linear_estimate(np.zeros((3, 0)), np.zeros(3), q, parameters=[], **names)
    q = np.array([[1.0, 0, 0], [0, 1, 2], [0, 2, 1]])
    with pytest.raises(EstimationError, match="invalid covariance"):
        best_linear_estimate(np.zeros((3, 0)), np.zeros(3), q, parameters=[], **names)


@pytest.mark.parametrize("rows", [4, 11, 40])
@pytest.mark.parametrize("null", [0, 2])
def test_diagonal_of_weights_by_panels_is_that_of_the_dense_matrix(rows, null, monkeypatch):
    """Full covariance, and one singular in two of the design's combinations."""
    monkeypatch.setattr(module, "PANEL", 7)
    rng = np.random.default_rng(rows)
    design = rng.normal(size=(rows, 3))
    root = rng.normal(size=(rows, rows + 2))
    if null:  # nothing along two columns of the design
        base = np.linalg.qr(design[:, :null])[0]
        root = root - base @ (base.T @ root)
    found = best_linear_estimate(
        design, rng.normal(size=rows), root @ root.T, parameters=list("abc"), rows=[str(k) for k in range(rows)]
    )
    np.testing.assert_allclose(found.weight_diagonal, np.diag(found.weight), rtol=1e-9, atol=1e-12)
    q = root @ root.T
    np.testing.assert_allclose(found.redundancy, np.diag(q @ found.weight), atol=1e-8)
    rest = np.linalg.svd(design)[0][:, 3:]  # what the design leaves over
    own = rest @ np.linalg.inv(rest.T @ q @ rest) @ rest.T
    np.testing.assert_allclose(found.weight, own, rtol=1e-7, atol=1e-7 * np.abs(own).max())
