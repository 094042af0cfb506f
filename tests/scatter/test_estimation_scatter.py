"""Claimed covariances, variance factors and tests of a ranging network against seeded Monte Carlo."""

import numpy as np
import pytest
from scipy.stats import norm, poisson
from threadpoolctl import threadpool_limits

from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.least_squares.robust import OutlierSearch, adjust_robustly
from catseye.estimation.observations.kinds import Distances
from draws import draws, same_sigmas

SIGMA = 25e-6  # m
STATIONS = np.array([[90, 0, 0], [45, 78, 2], [-45, 78, -1], [-90, 0, 1], [-45, -78, 0], [45, -78, 3]], dtype=float)
TARGETS = np.array([[10, 5, 50], [-15, 8, 44], [3, -20, 60], [20, 20, 40]], dtype=float)
TRUE = np.concatenate([STATIONS, TARGETS])
FREE = np.arange(30) >= 18
COMMON = np.eye(4) + 0.7 * np.ones((4, 4))  # a station's shots share a drift


def ranges(s, observed, covariance):
    none = np.zeros((4, 0))
    at, to = np.full(4, 3 * s), 18 + 3 * np.arange(4)
    return Distances(f"S{s}", observed, covariance, at, to, np.ones(4), np.zeros(4), none.astype(int), none)


def draw(rng, correlated):
    covariance = SIGMA**2 * COMMON if correlated else np.full(4, SIGMA**2)
    root = np.linalg.cholesky(COMMON) if correlated else np.eye(4)
    return [
        ranges(s, np.linalg.norm(TARGETS - STATIONS[s], axis=1) + SIGMA * root @ rng.normal(size=4), covariance)
        for s in range(6)
    ]


def scatter(trials, correlated):
    rng = np.random.default_rng(20260)
    with threadpool_limits(limits=1, user_api="blas"):
        solutions = [adjust(TRUE.ravel(), draw(rng, correlated), free=FREE) for _ in range(trials)]
    errors = np.array([s.x[FREE] - TRUE.ravel()[FREE] for s in solutions])
    claimed = solutions[0].covariance[np.ix_(FREE, FREE)]
    normalised = np.einsum("ti,ij,tj->t", errors, np.linalg.inv(claimed), errors).mean() / 12
    factors = np.array([s.variance_factor()[0] for s in solutions])
    tests = np.array([np.concatenate([f.standardised for f in s.fits]) for s in solutions])
    return normalised, factors, tests


@draws(600, name="trials")
@pytest.mark.parametrize("correlated", [False, True])
def test_covariance_variance_factor_and_tests_match_their_claims(correlated, trials):
    normalised, factors, tests = scatter(trials, correlated)
    off, spread, small = (same_sigmas(bound, 600, trials) for bound in (0.07, 0.3, 0.05))
    assert normalised == pytest.approx(1.0, abs=off)  # 12 parameters, 600 trials: 1.7 %
    assert factors.mean() == pytest.approx(1.0, abs=off)  # 12 degrees of freedom: 1.7 %
    assert factors.var() == pytest.approx(2 / 12, rel=spread)
    assert np.var(tests) == pytest.approx(1.0, abs=small)


@pytest.mark.slow
@pytest.mark.parametrize("correlated", [False, True])
def test_the_same_to_a_percent_and_in_the_tails(correlated):
    normalised, factors, tests = scatter(10_000, correlated)
    assert normalised == pytest.approx(1.0, abs=0.016)
    assert factors.mean() == pytest.approx(1.0, abs=0.016)
    expected = 2 * norm.sf(3.0) * tests.size
    assert np.count_nonzero(np.abs(tests) > 3.0) == pytest.approx(expected, rel=0.2)  # some 650, not independent


def false_rejections(trials):
    rng = np.random.default_rng(3500)
    points = [18 + 3 * t + np.arange(3) for t in range(4)]
    removable = [np.ones(4, dtype=bool)] * 6
    start = TRUE.ravel() + FREE * 0.02
    out = 0
    with threadpool_limits(limits=1, user_api="blas"):
        for _ in range(trials):
            solution = adjust_robustly(
                start, draw(rng, True), removable, outliers=OutlierSearch(points=points), free=FREE
            ).require_converged()
            out += sum(int(np.count_nonzero(~f.active)) for f in solution.fits)
    return out, 24 * trials


@draws(150, name="trials")
def test_hardly_a_good_range_is_left_out(trials):
    out, of = false_rejections(trials)
    # 1.7 expected of 3600 at 3.5 sigma; 8 would come once in 5000
    assert out <= poisson.isf(1 / 5000, of * 2 * norm.sf(3.5)), f"{out} of {of}"


@pytest.mark.slow
def test_one_good_range_in_two_thousand_is_left_out():
    out, of = false_rejections(3000)
    # 33 expected of 72 000, each rejection may take an undecided neighbour along
    assert 0.4 < out / (of * 2 * norm.sf(3.5)) < 2.0, f"{out} of {of}"
