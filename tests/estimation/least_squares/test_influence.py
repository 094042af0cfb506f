"""Influence of left-out observations on all other tests, against a new adjustment."""

from dataclasses import replace

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


@pytest.mark.parametrize("seed", range(3))
def test_an_error_moves_the_parameters_as_a_new_adjustment_says(seed):
    every = groups(seed)
    solution = adjust(np.zeros(3), every)
    influence = Influence(every, solution)
    errors = np.random.default_rng(seed).standard_normal((len(influence.active), 2))
    moved = influence.moved(errors)
    for k in range(2):
        pieces = np.split(errors[:, k], influence.first[1:-1])
        wrong = [replace(group, observed=group.observed + e) for group, e in zip(every, pieces, strict=True)]
        np.testing.assert_allclose(moved[:, k], adjust(np.zeros(3), wrong).x - solution.x, rtol=1e-9, atol=1e-12)


def test_observations_checked_only_by_the_removed_one_become_unchecked():
    """Two observations of one parameter: without the one nothing says that the other is wrong."""
    pair = [Linear("pair", np.array([0.0, 1.0]), np.ones(2), np.array([0]), np.ones((2, 1)))]
    tests = Influence(pair, adjust(np.zeros(1), pair))
    assert abs(tests.standardised[1]) == pytest.approx(1 / np.sqrt(2))
    tests.leave_out(0, np.array([0]))
    assert tests.detectable[1] > 1e4


def with_parameter(every, pattern):
    """The groups with a further parameter, of which each observation holds its share of a pattern."""
    shares = np.split(pattern, np.cumsum([len(g.observed) for g in every])[:-1])
    more = []
    for group, share in zip(every, shares, strict=True):
        own = group.columns.ndim == 2
        columns = np.full((len(share), 1), 3) if own else np.array([3])
        more.append(
            Linear(
                group.name,
                group.observed,
                group.covariance,
                np.concatenate([group.columns, columns], axis=-1),
                np.concatenate([group.matrix, share[:, None]], axis=1),
            )
        )
    return more


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("out", [0, 5])
def test_error_of_a_pattern_is_the_estimate_of_an_added_parameter(seed, out):
    every = groups(seed)
    rng = np.random.default_rng(seed + 100)
    total = sum(len(g.observed) for g in every)
    on = np.ones(total, dtype=bool)
    on[rng.permutation(total - 3)[:out]] = False
    active = np.split(on, np.cumsum([len(g.observed) for g in every])[:-1])
    patterns = np.where(on[:, None], rng.uniform(-1, 1, (total, 4)), 0.0)
    patterns[8:, 1] = 0.0  # of one group alone
    patterns[:, 2] = 0.0
    patterns[np.flatnonzero(on)[[3, 12, 20]], 2] = [1.0, 2.0, -1.0]  # of a few
    estimate, u = Influence(every, adjust(np.zeros(3), every, active=active)).errors_of(patterns)
    for k, pattern in enumerate(patterns.T):
        plain = adjust(np.zeros(4), with_parameter(every, pattern), active=active)
        assert estimate[k] == pytest.approx(plain.x[3], rel=1e-6, abs=1e-9)
        assert u[k] == pytest.approx(np.sqrt(plain.covariance[3, 3]), rel=1e-6)


def test_pattern_absorbed_by_the_parameters_has_infinite_u():
    every = groups(0)[:1]
    patterns = np.stack([every[0].matrix @ [1.0, -2.0, 0.5], np.arange(8.0)], axis=1)
    estimate, u = Influence(every, adjust(np.zeros(3), every)).errors_of(patterns)
    assert np.isinf(u[0])
    assert estimate[0] == 0.0
    assert np.isfinite(u[1])
