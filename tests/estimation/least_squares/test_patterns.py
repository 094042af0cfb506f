"""Explanations of a misfit by patterns: their gains are what an adjustment with these parameters gains."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.least_squares.influence import Influence
from catseye.estimation.least_squares.patterns import LEVEL, Patterns, PatternTests, price, record_price
from catseye.estimation.observations.kinds import Linear

ROWS, COUNT = 30, 6


def scene(seed, error=0.0):
    """Correlated observations, a prior of all parameters, and patterns of one, two and three errors."""
    rng = np.random.default_rng(seed)
    design, spread = rng.normal(size=(ROWS, COUNT)), 0.1 * rng.normal(size=(ROWS, ROWS))
    covariance = np.eye(ROWS) + spread @ spread.T
    vectors = [rng.normal(size=(ROWS + COUNT, k)) for k in (1, 2, 3)]
    observed = rng.multivariate_normal(np.zeros(ROWS), covariance) + error * vectors[0][:ROWS, 0]
    prior = rng.normal(0.0, 2.0, COUNT) + error * vectors[0][ROWS:, 0]
    every = np.arange(COUNT)
    return [
        Linear("ranges", observed, covariance, every, design),
        Linear("prior", prior, np.full(COUNT, 4.0), every, np.eye(COUNT)),
    ], vectors


def with_errors(groups, vectors):
    """The same observations with the errors of patterns as parameters."""
    vector = np.concatenate(vectors, axis=1)
    k, first = vector.shape[1], 0
    made = []
    for g in groups:
        part = vector[first : first + len(g.observed)]
        first += len(g.observed)
        made.append(replace(g, columns=np.arange(COUNT + k), matrix=np.hstack([g.matrix, part])))
    return made


def stacked(groups, vectors):
    solution = adjust(np.zeros(COUNT), groups)
    influence = Influence(groups, solution)
    return solution, influence, PatternTests(influence, Patterns.of(vectors, ROWS + COUNT))


def cost(solution):
    return sum(f.pvv for f in solution.fits)


@pytest.mark.parametrize("h", [0, 1, 2])
def test_a_gain_is_what_an_adjustment_with_these_errors_gains(h):
    groups, vectors = scene(1)
    solution, _, tests = stacked(groups, vectors)
    k = vectors[h].shape[1]
    full = adjust(np.zeros(COUNT + k), with_errors(groups, [vectors[h]]))
    fit = tests.fit(h)
    assert fit.gain == pytest.approx(cost(solution) - cost(full), rel=1e-9)
    assert fit.degrees == k
    np.testing.assert_allclose(fit.errors, full.x[COUNT:], rtol=1e-9)
    np.testing.assert_allclose(fit.covariance, full.covariance[COUNT:, COUNT:], rtol=1e-9)


def test_an_accepted_explanation_is_part_of_the_model():
    groups, vectors = scene(2, error=3.0)
    _, _, tests = stacked(groups, vectors)
    tests.accept(0)
    first = adjust(np.zeros(COUNT + 1), with_errors(groups, vectors[:1]))
    both = adjust(np.zeros(COUNT + 3), with_errors(groups, vectors[:2]))
    fit = tests.fit(1)
    assert fit.gain == pytest.approx(cost(first) - cost(both), rel=1e-9)
    np.testing.assert_allclose(fit.errors, both.x[COUNT + 1 :], rtol=1e-9)
    assert tests.fit(0).degrees == 0


def test_a_row_left_out_counts_no_more():
    groups, vectors = scene(3)
    _, influence, tests = stacked(groups, vectors)
    tests.add(*influence.leave_out(4, np.array([4])))
    active = [np.arange(ROWS) != 4, np.ones(COUNT, dtype=bool)]
    without, full = (
        adjust(np.zeros(COUNT + k), g, active=active) for k, g in ((0, groups), (2, with_errors(groups, [vectors[1]])))
    )
    assert tests.fit(1).gain == pytest.approx(cost(without) - cost(full), rel=1e-9)


def test_the_price_of_more_errors_is_that_of_chance():
    """By the quantiles: three errors that gain as much as one must is nothing."""
    assert record_price(1) == pytest.approx(chi2.isf(LEVEL, 1))
    assert price(3) == pytest.approx(chi2.isf(LEVEL, 3) - chi2.isf(LEVEL, 1))
    assert price(1) == 0.0


def test_a_wrong_length_is_significant_and_right_ones_are_not():
    groups, vectors = scene(4, error=8.0)
    _, _, tests = stacked(groups, vectors)
    fit = tests.fit(0)
    assert fit.significant
    assert abs(fit.errors[0] - 8.0) < 4.0 * fit.u[0]
    _, _, right = stacked(*scene(4))
    assert right.best[1] == 0.0


def test_an_allowed_error_is_judged_without_what_it_is_allowed():
    """A prior of sigma s on the error itself: the estimate stays, its variance is larger by s squared."""
    groups, vectors = scene(5, error=2.0)
    _, _, tests = stacked(groups, vectors)
    s = 40.0
    pattern = vectors[0]
    row = Linear("error", np.zeros(1), np.full(1, s**2), np.array([COUNT]), np.eye(1))
    allowed = [*with_errors(groups, [pattern]), row]
    solution = adjust(np.zeros(COUNT + 1), allowed)
    again = PatternTests(Influence(allowed, solution), Patterns.of([np.vstack([pattern, [[0.0]]])], ROWS + COUNT + 1))
    plain, beside = tests.fit(0), again.fit(0).beside(np.array([s]))
    assert again.fit(0).errors[0] == pytest.approx(plain.errors[0], rel=1e-6)
    assert beside.gain == pytest.approx(plain.gain, rel=1e-5)


def test_a_pattern_that_the_parameters_absorb_is_not_determined():
    groups, _ = scene(6)
    free = [groups[0]]
    pattern = groups[0].matrix[:, :1]
    solution = adjust(np.zeros(COUNT), free)
    fit = PatternTests(Influence(free, solution), Patterns.of([pattern], ROWS)).fit(0)
    assert fit.degrees == 0
    assert np.isnan(fit.errors[0])
    assert fit.u[0] == np.inf
    assert not fit.significant
