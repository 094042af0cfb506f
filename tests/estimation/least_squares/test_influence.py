"""What leaving out does to all other tests, against an adjustment without."""

import numpy as np
import pytest

from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.least_squares.influence import Influence
from catseye.estimation.observations.kinds import Linear


def groups(seed):
    """Straight lines through points: independent, correlated and blockwise correlated ones, and a prior."""
    rng = np.random.default_rng(seed)

    def matrix(m):
        return np.stack([np.ones(m), rng.uniform(-1, 1, m), rng.uniform(-1, 1, m)], axis=1)

    root = rng.standard_normal((9, 9)) * 0.3 + np.eye(9)
    blocks = rng.standard_normal((4, 2, 2)) * 0.3 + np.eye(2)
    columns = np.array([0, 1, 2])
    own = np.stack([rng.integers(0, 3, 8), rng.integers(0, 3, 8), np.full(8, -1)], axis=1)
    return [
        Linear("free", rng.standard_normal(8), rng.uniform(0.5, 2, 8), columns, matrix(8)),
        Linear("tied", rng.standard_normal(9), root @ root.T, columns, matrix(9)),
        Linear("pairs", rng.standard_normal(8), blocks @ blocks.transpose(0, 2, 1), columns, matrix(8)),
        Linear("own", rng.standard_normal(8), rng.uniform(0.5, 2, 8), own, rng.uniform(-1, 1, (8, 3))),
        Linear("prior", np.zeros(3), np.full(3, 4.0), columns, np.eye(3)),
    ]


@pytest.mark.parametrize("seed", range(6))
def test_tests_without_some_are_those_of_an_adjustment_without_them(seed):
    every = groups(seed)
    solution = adjust(np.zeros(3), every)
    tests = Influence(every, solution)
    total = len(tests.active)
    out = np.random.default_rng(seed).permutation(total - 3)[:7]
    for k in out:
        tests.leave_out(int(k), np.array([k, (k + 5) % (total - 3)]))
    active = [np.array(a) for a in np.split(tests.active, tests.first[1:-1])]
    assert sum((~a).sum() for a in active) == tests.left_out == 7
    plain = adjust(np.zeros(3), every, active=active)
    on = tests.active
    np.testing.assert_allclose(
        tests.standardised[on], np.concatenate([f.standardised for f in plain.fits])[on], rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(
        tests.detectable[on], np.concatenate([f.detectable_error for f in plain.fits])[on], rtol=1e-9
    )


def test_what_hangs_on_the_one_that_left_is_no_longer_checked():
    """Two observations of one parameter: without the one nothing says that the other is wrong."""
    pair = [Linear("pair", np.array([0.0, 1.0]), np.ones(2), np.array([0]), np.ones((2, 1)))]
    tests = Influence(pair, adjust(np.zeros(1), pair))
    assert abs(tests.standardised[1]) == pytest.approx(1 / np.sqrt(2))
    tests.leave_out(0, np.array([0]))
    assert tests.detectable[1] > 1e4
