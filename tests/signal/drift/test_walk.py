"""The walk of the electronics estimated from references, its test, and how often references are needed."""

import numpy as np
import pytest

from catseye.errors import EstimationError, ValidityError
from catseye.signal.drift.reference import drift_along, drift_at
from catseye.signal.drift.walk import estimate_walk, longest_gap, midpoint_uncertainty, walk_test
from draws import draws, same_sigmas

WALK = 3e-4  # rad per square root of a second, some ten times what ZY rangers show


def references(seed, r=6):
    rng = np.random.default_rng(seed)
    return np.sort(rng.uniform(0, 600, r)), rng.normal(size=r) * 0.02, rng.uniform(0.2, 2.0, r) * 1e-6


def series_of(rng, walk, variance, *, rangers=18, references=5, white=0.0):
    """A night: each ranger's reference shots at its own times, with levels that have nothing to do with each other."""
    time = np.sort(rng.uniform(0, 3000, (rangers, references)), axis=1)
    drift = np.cumsum(
        np.sqrt(np.diff(time, axis=1, prepend=time[:, :1])) * walk * rng.standard_normal(time.shape), axis=1
    )
    noise = np.sqrt(variance + white**2) * rng.standard_normal(time.shape)
    phase = drift + noise + rng.normal(0, 10, (rangers, 1))
    name = np.repeat(np.arange(rangers), references)
    order = rng.permutation(rangers * references)
    return time.ravel()[order], phase.ravel()[order], np.full(rangers * references, variance), name[order]


def test_without_noise_the_walk_is_the_mean_square_of_differences_over_gaps():
    t, phase, _ = references(1, r=9)
    found = estimate_walk(t, phase, np.zeros(9))
    assert found.random_walk**2 == pytest.approx(np.mean(np.diff(phase) ** 2 / np.diff(t)), rel=1e-9)
    assert found.degrees == pytest.approx(8.0, rel=1e-9)
    assert found.u_random_walk == pytest.approx(found.random_walk / np.sqrt(16), rel=1e-9)  # q has variance 2 q^2/8
    assert (found.white, found.u_white) == (0.0, 0.0)


def test_the_estimate_is_where_the_likelihood_of_scipy_is_highest():
    from scipy.optimize import minimize
    from scipy.stats import multivariate_normal

    rng = np.random.default_rng(21)
    t, phase, variance, name = series_of(rng, WALK, (2e-3) ** 2, rangers=4, references=7, white=3e-3)

    def cost(log):
        total = 0.0
        for k in range(4):
            mine = np.flatnonzero(name == k)[np.argsort(t[name == k])]
            step = np.diff(np.eye(7), axis=0)
            walk = np.exp(log[0]) * np.minimum(t[mine, None], t[mine])
            covariance = step @ (walk + np.diag(variance[mine] + np.exp(log[1]))) @ step.T
            total -= multivariate_normal.logpdf(step @ phase[mine], cov=covariance)
        return total

    start = np.log([WALK**2, 9e-6])
    theirs = minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-11, "maxiter": 4000})
    found = estimate_walk(t, phase, variance, series=name, white=True)
    assert found.random_walk**2 == pytest.approx(np.exp(theirs.x[0]), rel=1e-4)
    assert found.white**2 == pytest.approx(np.exp(theirs.x[1]), rel=1e-4)


@draws(300)
def test_the_estimates_uncertainty_is_the_scatter_and_its_interval_holds_the_truth(runs):
    rng = np.random.default_rng(22)
    nights = [series_of(rng, WALK, (1e-3) ** 2) for _ in range(runs)]
    found = [estimate_walk(t, phase, variance, series=name) for t, phase, variance, name in nights]
    squares = np.array([w.random_walk**2 for w in found])
    # 300 nights scatter by 1 % in the mean, 4 % in the standard deviation
    assert squares.mean() == pytest.approx(WALK**2, rel=same_sigmas(0.03, 300, runs))
    claimed = np.mean([np.sqrt(w.covariance[0, 0]) for w in found])
    assert np.std(squares) == pytest.approx(claimed, rel=same_sigmas(0.12, 300, runs))
    held = np.mean([low <= WALK <= high for low, high in (w.interval() for w in found)])
    assert held == pytest.approx(0.95, abs=same_sigmas(0.038, 300, runs))  # three standard deviations of 300


@draws(150)
def test_walk_and_white_noise_are_separated_with_their_covariance(runs):
    rng = np.random.default_rng(23)
    nights = [series_of(rng, WALK, (1e-3) ** 2, rangers=6, references=12, white=4e-3) for _ in range(runs)]
    found = [estimate_walk(t, phase, variance, series=name, white=True) for t, phase, variance, name in nights]
    error = np.array([[w.random_walk**2 - WALK**2, w.white**2 - 1.6e-5] for w in found])
    claimed = np.mean([w.covariance for w in found], axis=0)
    # three standard deviations of 150 nights
    np.testing.assert_allclose(np.var(error, axis=0) / np.diag(claimed), 1.0, atol=same_sigmas(0.35, 150, runs))
    correlation = claimed[0, 1] / np.sqrt(claimed[0, 0] * claimed[1, 1])
    assert correlation < -0.2  # one takes what the other leaves
    assert np.corrcoef(error.T)[0, 1] == pytest.approx(correlation, abs=same_sigmas(0.24, 150, runs))


def test_noise_enough_to_explain_everything_leaves_no_walk():
    found = estimate_walk(np.arange(4.0), np.array([0.0, 1e-3, 0.0, 1e-3]), np.full(4, 1e-4))
    assert found.random_walk == 0.0
    assert found.u_random_walk == np.inf
    assert found.interval() == (0.0, np.inf)


def test_the_test_of_a_walk_has_its_false_alarm_rate_on_either_side():
    rng = np.random.default_rng(24)
    fates = {1.0: [], 1.4: [], 0.7: []}
    for _ in range(600):
        t, phase, variance, name = series_of(rng, WALK, (1e-3) ** 2)
        for factor, fate in fates.items():
            fate.append(walk_test(t, phase, variance, random_walk=factor * WALK, series=name))
    assert np.mean([not f.passed for f in fates[1.0]]) == pytest.approx(0.05, abs=0.027)
    assert np.mean([f.statistic for f in fates[1.0]]) == pytest.approx(72.0, rel=0.02)
    assert np.mean([f.statistic < f.low for f in fates[1.4]]) > 0.8
    assert np.mean([f.statistic > f.high for f in fates[0.7]]) > 0.8


@pytest.mark.parametrize("u_reference", [0.0, 1e-3, 5e-3])
def test_the_middle_of_a_gap_agrees_with_the_covariance(u_reference):
    alone = drift_at(
        np.array([0.0, 100.0]), np.zeros(2), np.full(2, u_reference**2), time=np.array([50.0]), random_walk=WALK
    )
    assert float(midpoint_uncertainty(100.0, WALK, u_reference)) == pytest.approx(np.sqrt(alone[1][0, 0]), rel=1e-9)
    row = 100.0 * np.arange(80)
    _, u = drift_along(row, np.zeros(80), np.full(80, u_reference**2), time=np.array([3950.0]), random_walk=WALK)
    assert float(midpoint_uncertainty(100.0, WALK, u_reference, endless=True)) == pytest.approx(u[0], rel=1e-6)


def test_the_longest_gap_is_the_inverse_and_by_hand():
    # 10 mrad per root hour, 5 um at 1500 MHz: 4 x (0.3145 mrad)^2 / ((10 mrad)^2/3600 s) = 14.2 s
    walk = 0.01 / 60
    u = 5e-6 * 4 * np.pi / 0.199811
    assert float(longest_gap(u, walk, 0.0)) == pytest.approx(14.24, abs=0.01)
    for endless in (False, True):
        gap = longest_gap(3e-4, walk, 2e-4, endless=endless)
        assert float(midpoint_uncertainty(gap, walk, 2e-4, endless=endless)) == pytest.approx(3e-4, rel=1e-12)
    assert longest_gap(3e-4, walk, 2e-4, endless=True) > longest_gap(3e-4, walk, 2e-4)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: estimate_walk(np.arange(2.0), np.zeros(2), np.ones(2)), EstimationError, "1 differences of reference"),
        (lambda: estimate_walk(np.zeros(5), np.zeros(5), np.ones(5)), EstimationError, "at different times"),
        (
            lambda: estimate_walk(np.arange(5.0), np.ones(5), np.zeros(5)),
            EstimationError,
            "all reference phases are equal",
        ),
        (
            lambda: walk_test(np.arange(2.0), np.zeros(2), np.ones(2), random_walk=1.0, series=["a", "b"]),
            EstimationError,
            "no series has two reference shots",
        ),
        (lambda: longest_gap(1e-4, WALK, 1e-3), ValidityError, "what two references give at best"),
        (lambda: longest_gap(1e-4, 0.0, 1e-3), ValidityError, "sets no gap"),
    ],
)
def test_bad_input_is_refused_in_one_line(call, error, message):
    with pytest.raises(error, match=message):
        call()
