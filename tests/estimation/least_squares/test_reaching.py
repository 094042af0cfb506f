"""Rows that reach a border: products are those of the dense matrices, whichever part is dense."""

import numpy as np
import pytest
from scipy.sparse import csr_array

import catseye.estimation.least_squares.reaching as module
from catseye.estimation.least_squares.reaching import Reaching


def rows(k, g, seed):
    """Some parameters in every row, some in a few, one in none; and a row without any."""
    rng = np.random.default_rng(seed)
    dense = rng.normal(size=(k, g)) * (rng.uniform(size=(k, g)) < rng.uniform(size=g) ** 3)
    dense[:, g // 2], dense[k // 2] = 0.0, 0.0
    return csr_array(dense), dense


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("at_once", "columns"), [(1200, 300), (7, 5)])
def test_products_are_dense_ones(seed, at_once, columns, monkeypatch):
    monkeypatch.setattr(module, "ROWS", at_once)
    monkeypatch.setattr(module, "COLUMNS", columns)
    rng = np.random.default_rng(50 + seed)
    g = 20 + seed
    (one, a), (other, b) = rows(17 + seed, g, seed), rows(5 + 3 * seed, g, 30 + seed)
    root = rng.normal(size=(g, g))
    z = root @ root.T
    first, second = Reaching.of(one), Reaching.of(other)
    assert 0 < len(first.shared) < g
    np.testing.assert_allclose(first.times(z), a @ z, rtol=0, atol=1e-11)
    found = first.carried(z)
    np.testing.assert_allclose(found, a @ z @ a.T, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found, found.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(first.carried(z, second), a @ z @ b.T, rtol=0, atol=1e-10)
