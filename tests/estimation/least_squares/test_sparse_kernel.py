"""The sparse factor's short cuts give what the long ways give, to the last bit."""

import numpy as np
import pytest

from catseye.estimation.least_squares.adjustment import SolverSettings, adjust
from catseye.estimation.observations.kinds import Linear

SIZE = 240
SPARSE = SolverSettings(sparse=True)


def groups(seed):
    """Priors, and groups of neighbouring parameters: with columns in common, and with columns of their own."""
    random = np.random.default_rng(seed)
    made = [
        Linear("prior", random.standard_normal(SIZE), np.full(SIZE, 4.0), np.arange(SIZE)[:, None], np.ones((SIZE, 1)))
    ]
    for k in range(30):
        rows, low = int(random.integers(5, 20)), int(random.integers(0, SIZE - 30))
        if k % 2:
            columns, width = np.sort(random.choice(np.arange(low, low + 30), 6, replace=False)), 6
        else:
            columns, width = (
                np.array([random.choice(np.arange(low, low + 9), 3, replace=False) for _ in range(rows)]),
                3,
            )
        matrix = random.standard_normal((rows, width))
        made.append(Linear(f"group {k}", random.standard_normal(rows), np.full(rows, 0.2), columns, matrix))
    return made


@pytest.mark.parametrize("seed", range(3))
def test_a_block_is_that_of_the_whole_columns_to_the_last_bit(seed):
    free = np.ones(SIZE, dtype=bool)
    free[[3, 77]] = False
    q = adjust(np.zeros(SIZE), groups(seed), free=free, solver=SPARSE).q
    columns = np.random.default_rng(seed).permutation(SIZE)[:25]
    columns = np.append(columns, [3, 77, columns[0]])
    np.testing.assert_array_equal(q.within(columns), q.across(columns)[columns])
    assert np.all(q.within(columns)[[25, 26]] == 0.0)
    assert np.all(np.diagonal(q.within(columns))[:25] >= 0.0)


@pytest.mark.parametrize("seed", range(3))
def test_sparse_agrees_with_dense(seed):
    """To some hundred roundings of a system of condition 1e3."""
    sparse, dense = (adjust(np.zeros(SIZE), groups(seed), solver=SolverSettings(sparse=s)) for s in (True, False))
    np.testing.assert_allclose(sparse.x, dense.x, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(sparse.q.matrix(), dense.q.matrix(), rtol=0.0, atol=1e-12)
    for one, other in zip(sparse.fits, dense.fits, strict=True):
        np.testing.assert_allclose(one.standardised, other.standardised, rtol=0.0, atol=1e-10)
