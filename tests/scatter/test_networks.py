"""Free ranging networks measured many times: covariance, variance factor, tests and their power, outliers removed too.

`make test-all` runs 2000 seeded draws, `make test` a tenth; bounds follow from their number.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, norm

from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.quality.reliability import single_level, w_critical
from catseye.estimation.quality.robustness import MOST_INFLATION, snoop

SIGMA = 5e-5  # m
RUNS = [pytest.param(200, id="quick"), pytest.param(2000, id="full", marks=pytest.mark.slow)]


@pytest.fixture(scope="module")
def network(ranging_network):
    """Eight stations, twelve targets; its given coordinates are the truth."""
    made, true = ranging_network(77, stations=8, sigma=SIGMA)
    made = replace(made, points=replace(made.points, xyz=true))
    length = made.groups[0].predict(true.ravel())[0]
    return replace(made, groups=(replace(made.groups[0], observed=length),))


@pytest.fixture(scope="module")
def strong(ranging_network):
    """Twelve stations: seven or eight ranges check every target, so that two wrong ones at a target can be told."""
    made, true = ranging_network(78, stations=12, targets=15, sigma=SIGMA)
    made = replace(made, points=replace(made.points, xyz=true))
    length = made.groups[0].predict(true.ravel())[0]
    return replace(made, groups=(replace(made.groups[0], observed=length),))


def drawn(network, rng, wrong=0.0, size=0.0):
    """The network measured once, and which ranges (m,) are wrong by `size` standard uncertainties."""
    ranges = network.groups[0]
    m = len(ranges.observed)
    bad = rng.random(m) < wrong
    noise = SIGMA * (rng.standard_normal(m) + bad * size * rng.choice([-1.0, 1.0], m))
    return replace(network, groups=(replace(ranges, observed=ranges.observed + noise),)), bad


def normalised(solution, network):
    """Departure over claimed standard uncertainty of every coordinate."""
    return (solution.x - network.points.xyz) / np.sqrt(np.einsum("nii->ni", solution.covariance))


@pytest.mark.parametrize("runs", RUNS)
def test_coordinates_scatter_as_claimed_with_the_stated_false_alarm_rate(network, runs):
    rng = np.random.default_rng(1)
    squares, cost, alarms, family = [], [], [], []
    departures = []
    for _ in range(runs):
        solution = adjust_network(drawn(network, rng)[0])
        z = normalised(solution, network)
        squares.append(np.mean(z**2))
        departures.append((solution.x - network.points.xyz).ravel())
        cost.append(solution.variance_factor * solution.degrees_of_freedom)
        w = np.abs(solution.fits[0].standardised)
        alarms.append(np.mean(w > w_critical(0.01)))
        family.append(w.max() > w_critical(single_level(0.05, len(w))))
    own = np.std(squares) / np.sqrt(runs)
    assert np.mean(squares) == pytest.approx(1.0, abs=4 * own)
    degrees = solution.degrees_of_freedom
    assert degrees == pytest.approx(8 * 12 - 60 + 6, abs=1e-6)
    assert np.mean(cost) == pytest.approx(degrees, abs=4 * np.sqrt(2 * degrees / runs))
    quantiles = np.quantile(cost, [0.1, 0.5, 0.9])
    density = chi2.pdf(chi2.ppf([0.1, 0.5, 0.9], degrees), degrees)
    spread = np.sqrt(np.array([0.09, 0.25, 0.09]) / runs) / density
    assert np.all(np.abs(quantiles - chi2.ppf([0.1, 0.5, 0.9], degrees)) < 4 * spread)
    assert np.mean(alarms) == pytest.approx(0.01, abs=4 * np.std(alarms) / np.sqrt(runs))
    # w of one network are correlated: the family's level is a bound, and close to it
    assert 0.02 < np.mean(family) < 0.05 + 4 * np.sqrt(0.05 * 0.95 / runs)
    # the whole covariance, not only its diagonal: variances of sums over points and axes
    directions = np.random.default_rng(2).standard_normal((60, 5))
    claimed = np.einsum("ik,ij,jk->k", directions, solution.block(network.points.names), directions)
    found = np.var(np.array(departures) @ directions, axis=0, ddof=1)
    np.testing.assert_allclose(found / claimed, 1.0, atol=4.5 * np.sqrt(2 / runs))


@pytest.mark.parametrize("runs", RUNS)
def test_an_error_of_the_detectable_size_is_found_as_often_as_promised(network, runs):
    rng = np.random.default_rng(3)
    ranges = network.groups[0]
    plain = adjust_network(network)
    found = []
    for run in range(runs):
        row = run % len(ranges.observed)
        once = drawn(network, rng)[0]
        observed = once.groups[0].observed.copy()
        observed[row] += plain.fits[0].detectable_error[row]
        solution = adjust_network(replace(once, groups=(replace(ranges, observed=observed),)))
        found.append(abs(solution.fits[0].standardised[row]) > norm.isf(0.0005))
    assert np.mean(found) == pytest.approx(0.80, abs=4 * np.sqrt(0.8 * 0.2 / runs))


@pytest.mark.parametrize("runs", [pytest.param(20, id="quick"), pytest.param(2000, id="full", marks=pytest.mark.slow)])
def test_the_claim_holds_after_outliers_are_removed(strong, runs):
    network = strong
    rng = np.random.default_rng(4)
    squares, hit, wrong, lost, good = [], 0, 0, 0, 0
    for _ in range(runs):
        once, bad = drawn(network, rng, wrong=0.03, size=40.0)

        def solve(inflation, once=once):
            return adjust_network(once, inflation=inflation).fits

        estimate = snoop(solve, [len(bad)])
        rejected, undecided = estimate.rejected[0], estimate.undecided[0]
        inflation = np.where(rejected, np.inf, np.where(undecided, MOST_INFLATION, 1.0))
        solution = adjust_network(once, inflation=[inflation])
        squares.append(np.mean(normalised(solution, network) ** 2))
        rejected = rejected | undecided
        hit, wrong = hit + int(np.sum(bad & rejected)), wrong + int(bad.sum())
        lost, good = lost + int(np.sum(~bad & rejected)), good + int(np.sum(~bad))
    assert hit > 0.97 * wrong
    assert lost < 0.01 * good
    assert np.mean(squares) == pytest.approx(1.0, abs=0.05 + 4 * np.std(squares) / np.sqrt(runs))
