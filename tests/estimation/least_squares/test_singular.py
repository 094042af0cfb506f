"""Estimates from a singular covariance are those of elimination, and what floats or contradicts is named."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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


def test_what_floats_or_is_known_too_well_is_named():
    names = {"rows": list("123")}
    with pytest.raises(EstimationError, match="not held by these points: b"):
        best_linear_estimate(np.eye(3)[:, :2] * [1, 0], np.zeros(3), np.eye(3), parameters=["a", "b"], **names)
    with pytest.raises(EstimationError, match=r"not held by these points: a, b"):
        best_linear_estimate(np.ones((3, 2)), np.zeros(3), np.eye(3), parameters=["a", "b"], **names)
    q = np.array([[1.0, 0, 0], [0, 1, 1], [0, 1, 1]])
    with pytest.raises(EstimationError, match=r"combination of (2, 3|3, 2) exactly"):
        best_linear_estimate(np.zeros((3, 0)), np.zeros(3), q, parameters=[], **names)
    q = np.array([[1.0, 0, 0], [0, 1, 2], [0, 2, 1]])
    with pytest.raises(EstimationError, match="the covariance is none"):
        best_linear_estimate(np.zeros((3, 0)), np.zeros(3), q, parameters=[], **names)
