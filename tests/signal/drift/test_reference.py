"""Drift between reference shots against a Kalman smoother and against dense conditioning with a wide prior."""

import numpy as np
import pytest

from catseye.signal.drift.reference import drift_along, drift_at, reference_prediction_error

WALK = 3e-4  # rad per square root of a second, some ten times what ZY rangers show


def references(seed, r=6):
    rng = np.random.default_rng(seed)
    return np.sort(rng.uniform(0, 600, r)), rng.normal(size=r) * 0.02, rng.uniform(0.2, 2.0, r) * 1e-6


def smoothed(reference_time, phase, variance, time, walk):
    """Forward Kalman filter and backward Rauch-Tung-Striebel pass over all times, one state; means and variances."""
    times = np.unique(np.concatenate([reference_time, time]))
    mean, spread = [0.0], [1e6]  # rad^2: nothing known
    predicted = []
    for k, t in enumerate(times):
        m, p = (0.0, 1e6) if k == 0 else (mean[-1], spread[-1] + walk**2 * (t - times[k - 1]))
        predicted.append((m, p))
        for j in np.flatnonzero(reference_time == t):
            gain = p / (p + variance[j])
            m, p = m + gain * (phase[j] - m), variance[j] * p / (p + variance[j])
        if k == 0:
            mean, spread = [m], [p]
        else:
            mean.append(m)
            spread.append(p)
    for k in range(len(times) - 2, -1, -1):
        m, p = predicted[k + 1]
        back = spread[k] / p
        mean[k] += back * (mean[k + 1] - m)
        spread[k] += back**2 * (spread[k + 1] - p)
    at = np.searchsorted(times, time)
    return np.array(mean)[at], np.array(spread)[at]


@pytest.mark.parametrize("seed", range(5))
def test_it_agrees_with_a_kalman_smoother(seed):
    t, phase, variance = references(seed)
    time = np.random.default_rng(seed + 100).uniform(-100, 800, 20)  # before, between and after
    mean, covariance = drift_at(t, phase, variance, time=time, random_walk=WALK)
    expected, spread = smoothed(t, phase, variance, time, WALK)
    # the smoother's prior of 1e6 rad^2 leaves rounding of 1e-10 in its first steps
    np.testing.assert_allclose(mean, expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(np.diag(covariance), spread, rtol=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_it_agrees_with_dense_conditioning_correlations_included(seed):
    t, phase, variance = references(seed)
    time = np.random.default_rng(seed + 200).uniform(-100, 800, 12)
    mean, covariance = drift_at(t, phase, variance, time=time, random_walk=WALK)
    everything = np.concatenate([t, time])
    prior = 1.0 + WALK**2 * np.minimum(everything[:, None] + 200, everything + 200)  # a level known to 1 rad
    seen = prior[:6, :6] + np.diag(variance)
    gain = np.linalg.solve(seen, prior[:6, 6:]).T
    expected = prior[6:, 6:] - gain @ prior[:6, 6:]
    # 1 rad instead of nothing known: a part of variance / 1 rad^2, 1e-4 at most
    np.testing.assert_allclose(mean, gain @ phase, rtol=0, atol=1e-6)
    np.testing.assert_allclose(covariance, expected, rtol=1e-3, atol=1e-10)


def test_between_exact_references_the_mean_is_a_line_and_the_variance_a_parabola():
    time = np.linspace(10.0, 110.0, 21)
    mean, covariance = drift_at(np.array([10.0, 110.0]), np.array([0.1, 0.3]), np.zeros(2), time=time, random_walk=WALK)
    np.testing.assert_allclose(mean, 0.1 + 0.002 * (time - 10), atol=1e-12)
    bridge = WALK**2 * (np.minimum(time[:, None], time) - 10) * (110 - np.maximum(time[:, None], time)) / 100
    # references are kept apart by a part in 1e12
    np.testing.assert_allclose(covariance, bridge, rtol=0, atol=1e-10 * bridge.max())


def test_exact_references_cut_the_correlation_of_the_gaps():
    t = np.array([0.0, 100.0, 200.0])
    _, covariance = drift_at(t, np.zeros(3), np.zeros(3), time=np.array([40.0, 60.0, 140.0]), random_walk=WALK)
    sigma = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sigma, sigma)
    assert correlation[0, 1] == pytest.approx(40 * 40 / np.sqrt(40 * 60 * 60 * 40))  # of a Brownian bridge
    assert abs(correlation[0, 2]) < 1e-9
    _, noisy = drift_at(t, np.zeros(3), np.full(3, 1e-5), time=np.array([40.0, 60.0, 140.0]), random_walk=WALK)
    assert noisy[0, 2] > 0.0  # what they share is the noise of the reference between them


def test_one_reference_gives_a_level_whose_variance_grows_both_ways():
    time = np.array([-50.0, 100.0, 250.0])
    mean, covariance = drift_at(np.array([100.0]), np.array([0.4]), np.array([1e-6]), time=time, random_walk=WALK)
    np.testing.assert_allclose(mean, 0.4, rtol=1e-12)
    np.testing.assert_allclose(np.diag(covariance), 1e-6 + WALK**2 * np.array([150, 0, 150]), rtol=1e-9)
    assert covariance[0, 2] == pytest.approx(1e-6, rel=1e-6)  # before and after share the reference only


def test_references_at_one_time_average_by_their_weights():
    mean, covariance = drift_at(
        np.array([5.0, 5.0]), np.array([0.0, 0.3]), np.array([1e-6, 2e-6]), time=np.array([5.0]), random_walk=WALK
    )
    assert mean[0] == pytest.approx(0.1, rel=1e-9)
    assert covariance[0, 0] == pytest.approx(2e-6 / 3, rel=1e-6)


def test_exact_references_at_one_time_do_not_break_it():
    mean, covariance = drift_at(
        np.array([5.0, 5.0, 9.0]), np.array([0.1, 0.1, 0.5]), np.zeros(3), time=np.array([5.0, 7.0]), random_walk=WALK
    )
    np.testing.assert_allclose(mean, [0.1, 0.3], atol=1e-6)
    np.testing.assert_allclose(np.diag(covariance), [0.0, WALK**2], rtol=1e-4, atol=1e-9 * WALK**2)


def test_without_a_walk_it_is_the_weighted_mean_at_all_times():
    t, phase, variance = references(3)
    mean, covariance = drift_at(t, phase, variance, time=np.array([-1e4, 300.0, 1e4]), random_walk=0.0)
    weight = 1 / variance
    np.testing.assert_allclose(mean, weight @ phase / weight.sum(), rtol=1e-9)
    np.testing.assert_allclose(covariance, 1 / weight.sum(), rtol=1e-9)


def test_a_night_later_it_still_has_digits():
    t, phase, variance = references(4)
    here = drift_at(t, phase, variance, time=t[:3] + 1.0, random_walk=WALK)
    away = drift_at(t, phase, variance, time=np.append(t[:3] + 1.0, [-3e4, 3e4]), random_walk=WALK)
    np.testing.assert_allclose(away[0][:3], here[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(away[1][:3, :3], here[1], rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("seed", range(3))
def test_the_order_of_references_and_of_times_is_irrelevant(seed):
    rng = np.random.default_rng(seed)
    t, phase, variance = references(seed)
    time = rng.uniform(0, 600, 5)
    a, b = rng.permutation(6), rng.permutation(5)
    mean, covariance = drift_at(t, phase, variance, time=time, random_walk=WALK)
    other, its = drift_at(t[a], phase[a], variance[a], time=time[b], random_walk=WALK)
    np.testing.assert_allclose(other, mean[b], rtol=0, atol=1e-11)
    np.testing.assert_allclose(its, covariance[np.ix_(b, b)], rtol=1e-7, atol=1e-16)


def test_no_times_give_empty_results():
    mean, covariance = drift_at(np.zeros(1), np.zeros(1), np.ones(1), time=np.zeros(0), random_walk=WALK)
    assert mean.shape == (0,)
    assert covariance.shape == (0, 0)


def test_the_claimed_covariance_is_the_scatter():
    rng = np.random.default_rng(2024)
    t, _, variance = references(7)
    time = np.sort(rng.uniform(-50, 700, 8))
    everything = np.concatenate([t, time])
    order = np.argsort(everything)
    trials = 4000
    steps = rng.normal(size=(trials, 14)) * np.sqrt(np.diff(everything[order], prepend=-100.0)) * WALK
    walk = np.empty((trials, 14))
    walk[:, order] = np.cumsum(steps, axis=1) + rng.normal(size=(trials, 1)) * 10
    phase = walk[:, :6] + rng.normal(size=(trials, 6)) * np.sqrt(variance)
    covariance = drift_at(t, phase[0], variance, time=time, random_walk=WALK)[1]
    error = np.array([drift_at(t, p, variance, time=time, random_walk=WALK)[0] for p in phase]) - walk[:, 6:]
    normalised = np.einsum("ti,ij,tj->t", error, np.linalg.inv(covariance), error).mean() / 8
    # 4000 trials of 8 scatter by 0.8 %
    assert normalised == pytest.approx(1.0, abs=0.03)
    np.testing.assert_allclose(np.var(error, axis=0) / np.diag(covariance), 1.0, atol=0.12)


@pytest.mark.parametrize("seed", range(3))
def test_the_surprise_of_a_reference_is_its_distance_from_the_smoother_without_it(seed):
    t, phase, variance = references(seed)
    difference, uncertainty = reference_prediction_error(t, phase, variance, random_walk=WALK)
    for k in range(6):
        rest = np.arange(6) != k
        mean, spread = smoothed(t[rest], phase[rest], variance[rest], t[[k]], WALK)
        assert difference[k] == pytest.approx(phase[k] - mean[0], abs=1e-8)
        assert uncertainty[k] == pytest.approx(np.sqrt(spread[0] + variance[k]), rel=1e-4)


def test_a_single_reference_has_no_prediction_error():
    difference, uncertainty = reference_prediction_error(np.zeros(1), np.zeros(1), np.ones(1), random_walk=WALK)
    assert np.isnan(difference).all()
    assert np.isnan(uncertainty).all()


@pytest.mark.parametrize("seed", range(4))
def test_drift_along_is_the_diagonal_of_drift_at(seed):
    t, phase, variance = references(seed)
    variance[seed] = 0.0  # one exact reference
    shuffled = np.random.default_rng(seed).permutation(6)
    time = np.concatenate([np.random.default_rng(seed + 300).uniform(-200, 900, 40), t, [t[0] - 1e-9]])
    mean, covariance = drift_at(t, phase, variance, time=time, random_walk=WALK)
    short, u = drift_along(t[shuffled], phase[shuffled], variance[shuffled], time=time, random_walk=WALK)
    np.testing.assert_allclose(short, mean, rtol=0, atol=1e-11)
    # the long way keeps exact references apart by a part in 1e12, and loses digits by it
    np.testing.assert_allclose(u**2, np.diag(covariance), rtol=1e-6, atol=1e-6 * WALK**2)


def test_drift_along_handles_half_a_million_shots_and_thousands_of_references():
    rng = np.random.default_rng(5)
    t = np.sort(rng.uniform(0, 1e5, 3000))
    phase = np.cumsum(rng.standard_normal(3000)) * WALK * 5
    time = rng.uniform(0, 1e5, 500_000)
    mean, u = drift_along(t, phase, np.full(3000, 1e-8), time=time, random_walk=WALK)
    some = np.arange(0, 500_000, 100_000)
    near = np.abs(t - time[some][:, None]).min(axis=0) < 3000  # far references no longer count
    expected, covariance = drift_at(t[near], phase[near], np.full(near.sum(), 1e-8), time=time[some], random_walk=WALK)
    np.testing.assert_allclose(mean[some], expected, rtol=0, atol=1e-9)
    # the floor that keeps exact references apart is 1e-12 of the walk's variance over the whole time, 5e-7 of the noise
    np.testing.assert_allclose(u[some] ** 2, np.diag(covariance), rtol=5e-6)


def test_without_a_walk_drift_along_is_the_weighted_mean():
    t, phase, variance = references(3)
    mean, u = drift_along(t, phase, variance, time=np.array([-1e4, t[2], 1e4]), random_walk=0.0)
    np.testing.assert_allclose(mean, (phase / variance).sum() / (1 / variance).sum(), rtol=1e-9)
    np.testing.assert_allclose(u**-2, (1 / variance).sum(), rtol=1e-9)
