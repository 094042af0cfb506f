"""A record as a level and a rate that wander: against a dense Gaussian process, and the claim against scatter."""

import time
from itertools import pairwise

import numpy as np
import pytest

from catseye.estimation.series.trend import TrendStrength, _Record, trend_of, trend_strength

USUAL = TrendStrength(0.05, 0.005, 1e-6)
STRENGTH = TrendStrength(0.05, 0.01, 3e-5)
NEVER = 1e-9  # of a reading's noise at least: no rounding


def kernel(a, b, strength):
    """Covariance (m, n) of the wander since time zero at times a (m,) and b (n,) after it: Wiener, and its integral."""
    low, high = np.minimum(a[:, None], b), np.maximum(a[:, None], b)
    return strength.level**2 * low + strength.rate**2 * (low**2 * high / 2.0 - low**3 / 6.0)


class DenseProcess:
    """The level by kriging with an unknown line: flat in level and rate at the first reading, no cancellation."""

    def __init__(self, seconds, values, strength):
        self.t, self.y, self.s = seconds - seconds.min(), values, strength
        self.start = seconds.min()
        self.h = self.basis(self.t)
        self.c = kernel(self.t, self.t, strength) + strength.noise**2 * np.eye(len(values))
        self.inverse = np.linalg.inv(self.c)
        self.normal = self.h.T @ self.inverse @ self.h

    @staticmethod
    def basis(t):
        return np.stack([np.ones(len(t)), t / 1000.0], axis=1)

    def at(self, seconds):
        """Mean (k,) and covariance (k, k) of the level."""
        t = seconds - self.start
        cross = kernel(t, self.t, self.s) @ self.inverse
        beta = np.linalg.solve(self.normal, self.h.T @ self.inverse @ self.y)
        left = self.basis(t) - cross @ self.h
        mean = self.basis(t) @ beta + cross @ (self.y - self.h @ beta)
        known = kernel(t, t, self.s) - cross @ kernel(self.t, t, self.s)
        return mean, known + left @ np.linalg.solve(self.normal, left.T)

    def likelihood(self):
        """Minus twice the logarithm of the restricted likelihood, but for a constant of the times alone."""
        weight = self.inverse - self.inverse @ self.h @ np.linalg.solve(self.normal, self.h.T @ self.inverse)
        return np.linalg.slogdet(self.c)[1] + np.linalg.slogdet(self.normal)[1] + self.y @ weight @ self.y


def uneven(rng, n=40, span=4000.0):
    return np.sort(np.round(rng.uniform(0.0, span, n), 1))


@pytest.mark.parametrize("strength", [STRENGTH, TrendStrength(0.05, 1e-3, 1e-4), TrendStrength(0.2, 0.02, 1e-7)])
def test_level_and_covariance_are_those_of_a_dense_gaussian_process(strength):
    rng = np.random.default_rng(1)
    seconds = np.unique(uneven(rng))
    values = 10.0 + np.sin(seconds / 700.0) + 0.05 * rng.standard_normal(len(seconds))
    grid = np.arange(seconds.min() + 31.7, seconds.max(), 211.0)
    found = trend_of(seconds, values, strength, grid=grid)
    own = found.seconds  # readings, and what of the grid is not beside one
    assert len(own) > len(seconds) + 5
    mean, covariance = DenseProcess(seconds, values, strength).at(own)
    # 1e-6: two routes of linear algebra whose matrices have conditions of some 1e8
    np.testing.assert_allclose(found.at(own), mean, rtol=0, atol=1e-6 * np.sqrt(covariance.max()))
    np.testing.assert_allclose(found.covariance(own), covariance, rtol=0, atol=1e-6 * covariance.max())


def test_the_rate_is_the_slope_of_the_level_and_none_beyond_the_readings():
    seconds = np.arange(0.0, 3001.0, 30.0)
    found = trend_of(seconds, 5.0 + 0.002 * seconds, STRENGTH)
    # by hand: of a straight line; 1e-9 of rounding over steps of 30 s
    np.testing.assert_allclose(found.rate_at(np.array([0.0, 15.0, 1234.0, 3000.0])), 0.002, atol=1e-9)
    np.testing.assert_array_equal(found.rate_at(np.array([-1.0, 3001.0])), 0.0)
    np.testing.assert_allclose(found.rate, 0.002, atol=1e-9)


def test_the_likelihood_differs_between_strengths_as_the_dense_restricted_likelihood_does():
    """Compared where each has its best noise, which the module has in closed form: n - 2 degrees of freedom."""
    rng = np.random.default_rng(2)
    seconds = np.unique(uneven(rng, 60))
    values = np.cumsum(0.1 * rng.standard_normal(len(seconds))) + 0.05 * rng.standard_normal(len(seconds))
    record = _Record.of(seconds, values)
    ratios = [(0.01, 1e-7), (0.1, 1e-7), (0.001, 1e-5), (1e-4, 1e-9)]
    ours, dense = [], []
    for level, rate in ratios:
        cost, variance = record.likelihood(level, rate)
        ours.append(cost)
        noise = np.sqrt(variance)
        process = DenseProcess(seconds, values, TrendStrength(noise, noise * np.sqrt(level), noise * np.sqrt(rate)))
        dense.append(process.likelihood())
        # at its best noise the sum of squares is the degrees of freedom; so a noise beside it is less likely
        for beside in (0.9, 1.1):
            other = TrendStrength(*(beside * np.array([noise, noise * np.sqrt(level), noise * np.sqrt(rate)])))
            assert DenseProcess(seconds, values, other).likelihood() > dense[-1]
    # 1e-5: logarithms of determinants of some hundred, of matrices with conditions of 1e8
    np.testing.assert_allclose(np.diff(ours), np.diff(dense), atol=1e-5)


def test_readings_at_one_time_count_as_their_mean_with_less_noise():
    seconds, values = np.arange(0.0, 600.0, 60.0), np.linspace(3.0, 4.0, 10) ** 2
    twice = trend_of(np.repeat(seconds, 2), np.ravel(values[:, None] + [-0.03, 0.03]), STRENGTH)
    rng = np.random.default_rng(0)
    order = rng.permutation(20)
    mixed = trend_of(np.repeat(seconds, 2)[order], np.ravel(values[:, None] + [-0.03, 0.03])[order], STRENGTH)
    once = trend_of(seconds, values, TrendStrength(STRENGTH.noise / np.sqrt(2), STRENGTH.level, STRENGTH.rate))
    for found in (twice, mixed):
        np.testing.assert_allclose(found.level, once.level, atol=1e-11)
        np.testing.assert_allclose(found.covariance(seconds), once.covariance(seconds), rtol=1e-8)


def test_one_reading_gives_a_constant_level_with_growing_uncertainty():
    found = trend_of([100.0], [7.0], USUAL, grid=[0.0, 60.0, 120.0])
    times = np.array([-5000.0, 100.0, 100.0 + 3600.0, 100.0 + 7200.0])
    np.testing.assert_array_equal(found.at(times), 7.0)
    np.testing.assert_array_equal(found.rate_at(times), 0.0)
    variance = np.diag(found.covariance(times))
    assert variance[1] == pytest.approx(USUAL.noise**2)
    # an hour away, by hand: 0.3 °C a root hour of the level, and of the rate 1e-6 sqrt(3600^3 / 3) = 0.125 °C
    assert np.sqrt(variance[2] - variance[1]) == pytest.approx(np.hypot(0.3, 0.125), rel=0.01)
    assert variance[1] < variance[2] < variance[3]


def test_two_readings_are_joined_by_a_line_and_known_as_each_is():
    found = trend_of([0.0, 600.0], [3.0, 5.0], STRENGTH)
    np.testing.assert_allclose(found.at(np.array([-10.0, 0.0, 150.0, 600.0, 700.0])), [3.0, 3.0, 3.5, 5.0, 5.0])
    np.testing.assert_allclose(
        found.covariance(np.array([0.0, 600.0])), STRENGTH.noise**2 * np.eye(2), atol=1e-6 * STRENGTH.noise**2
    )


def test_few_readings_use_the_default_strength():
    seconds = np.arange(0.0, 300.0, 60.0)
    assert trend_strength(seconds, seconds**2, usual=USUAL, least_noise=0.003) is USUAL
    again = np.repeat(seconds, 4)  # twenty rows at five times
    assert trend_strength(again, again**2, usual=USUAL, least_noise=0.003) is USUAL


def test_constant_readings_have_seven_tenths_of_the_usual_noise_and_stay_constant():
    seconds = np.arange(0.0, 3600.0, 30.0)
    strength = trend_strength(seconds, np.full(len(seconds), 11.3), usual=USUAL, least_noise=0.003)
    assert strength.noise == pytest.approx(0.7 * USUAL.noise)
    found = trend_of(seconds, np.full(len(seconds), 11.3), strength)
    np.testing.assert_allclose(found.at(seconds + 7.0), 11.3, rtol=0, atol=1e-12)
    assert np.all(np.diag(found.covariance(seconds)) <= strength.noise**2 * (1 + 1e-6))


def drawn(rng, seconds, strength):
    """A true level and its readings."""
    steps = np.diff(seconds)
    rate = np.concatenate([[0.0], np.cumsum(strength.rate * np.sqrt(steps) * rng.standard_normal(len(steps)))])
    moved = strength.level * np.sqrt(steps) * rng.standard_normal(len(steps)) + steps * 0.5 * (rate[1:] + rate[:-1])
    # the rest of an integrated Wiener process given its ends: variance rate^2 d^3 / 12
    moved = moved + strength.rate * np.sqrt(steps**3 / 12.0) * rng.standard_normal(len(steps))
    level = 10.0 + np.concatenate([[0.0], np.cumsum(moved)])
    return level, level + strength.noise * rng.standard_normal(len(seconds))


@pytest.mark.parametrize("step", [10.0, 60.0, 600.0])
def test_of_known_strength_the_claimed_covariance_is_that_of_the_errors(step):
    rng = np.random.default_rng(int(step))
    seconds = np.arange(0.0, 120.5 * step, step)
    strength = TrendStrength(0.05, 0.05 / np.sqrt(10.0 * step), 0.05 / np.sqrt(30.0 * step) / (10.0 * step))
    chi2, runs, own = [], 60, seconds[::4]
    for _ in range(runs):
        level, values = drawn(rng, seconds, strength)
        found = trend_of(seconds, values, strength)
        e = found.at(own) - level[::4]
        chi2.append(e @ np.linalg.solve(found.covariance(own), e) / len(e))
    # four sigmas of the mean of 60 x 31 squares
    assert np.mean(chi2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (runs * len(own))))


@pytest.mark.parametrize("step", [10.0, 60.0, 300.0, 600.0])
def test_of_a_random_walk_whose_strength_is_unknown_the_claim_covers_the_errors(step):
    """White noise 0.05 and a walk of 0.3 in a root hour, as the air of an ordinary night."""
    rng = np.random.default_rng(int(step) + 1)
    truth = TrendStrength(0.05, 0.3 / 60.0, 0.0)
    seconds = np.arange(0.0, 150.5 * step, step)
    own = seconds[::5]
    ratio, noises, levels, runs = [], [], [], 25
    for _ in range(runs):
        level, values = drawn(rng, seconds, truth)
        strength = trend_strength(seconds, values, usual=USUAL, least_noise=0.003)
        found = trend_of(seconds, values, strength)
        e = found.at(own) - level[::5]
        ratio.append(e @ np.linalg.solve(found.covariance(own), e) / len(e))
        noises.append(strength.noise)
        levels.append(strength.level)
    # 25 x 31 squares scatter by 0.05 of their mean; an estimated strength of 150 readings is good to a sixth or so
    assert 0.7 < np.mean(ratio) < 1.35
    assert np.median(levels) == pytest.approx(truth.level, rel=0.3)
    if step <= 60.0:  # of slower readings the walk hides the noise
        assert np.median(noises) == pytest.approx(truth.noise, rel=0.1)


@pytest.mark.parametrize("period", [1200.0, 3600.0])
def test_of_a_smooth_wave_the_claim_is_not_too_small_and_at_most_twice_too_large(period):
    """A wave is no wandering rate: it is smoother, so what is claimed is too large rather than too small."""
    rng = np.random.default_rng(7)
    seconds = np.arange(0.0, 7201.0, 30.0)
    squares, claimed = 0.0, 0.0
    for phase in np.linspace(0.0, 2 * np.pi, 15, endpoint=False):
        wave = 0.3 * np.sin(2 * np.pi * seconds / period + phase)
        values = wave + 0.05 * rng.standard_normal(len(seconds))
        strength = trend_strength(seconds, values, usual=USUAL, least_noise=0.003)
        found = trend_of(seconds, values, strength)
        squares += np.mean((found.at(seconds) - wave) ** 2)
        claimed += np.mean(np.diag(found.covariance(seconds)))
    # 0.9: errors of a smoother hang together over some minutes; 15 records of 240 readings know their rms to 5 %
    assert 0.9 < np.sqrt(claimed / squares) < 2.0
    # and the wave is kept: a smoother of 300 s kept two thirds of one of 1200 s and erred by 0.07
    assert np.sqrt(squares / 15) < 0.03


def test_claim_grows_in_a_gap_with_possible_wander():
    rng = np.random.default_rng(11)
    seconds = np.concatenate([np.arange(0.0, 3001.0, 60.0), np.arange(9000.0, 12001.0, 60.0)])
    grid = np.arange(0.0, 12000.0, 60.0)
    inside = np.arange(3600.0, 8500.0, 600.0)
    strength = TrendStrength(0.05, 0.3 / 60.0, 1e-7)
    every = np.union1d(seconds, inside)
    squares, claimed, near = [], [], []
    for _ in range(60):
        level, values = drawn(rng, every, strength)
        read = np.isin(every, seconds)
        found = trend_of(every[read], values[read], strength, grid=grid)
        squares.append((found.at(inside) - level[np.isin(every, inside)]) ** 2)
        claimed.append(np.diag(found.covariance(inside)))
        near.append(float(found.covariance(np.array([1500.0]))[0, 0]))
    # a walk between two known ends 6000 s apart: in the middle 0.005 sqrt(1500) = 0.19
    assert np.sqrt(claimed[0].max()) == pytest.approx(0.005 * np.sqrt(1500.0), rel=0.1)
    assert np.sqrt(near[0]) < 0.05
    # 60 bridges, of which each is some three independent values
    assert np.mean(squares) / np.mean(claimed) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 180.0))


def test_beyond_the_ends_the_level_is_constant_and_its_claim_grows():
    rng = np.random.default_rng(3)
    seconds = np.arange(1000.0, 4001.0, 60.0)
    calm = TrendStrength(0.05, 0.003, 1e-7)  # whose wander alone is 0.07 in ten minutes
    found = trend_of(seconds, 10.0 - seconds / 1800.0 + 0.05 * rng.standard_normal(51), calm)
    for end, far in ((1000.0, -1.0), (4000.0, 1.0)):
        times = end + far * np.array([0.0, 60.0, 600.0, 3600.0])
        np.testing.assert_array_equal(found.at(times), found.at(times[:1])[0])
        variance = np.diag(found.covariance(times))
        assert np.all(np.diff(variance) > 0.0)
        # a level that goes on as it did, 1 °C in 1800 s, is covered: it stays constant by decree, not by nature
        assert np.sqrt(variance[2]) == pytest.approx(600.0 / 1800.0, rel=0.15)
    ends = found.covariance(np.array([900.0, 800.0, 4100.0]))
    assert np.all(np.linalg.eigvalsh(ends) > 0.0)
    # what the air does after the last reading and before the first has nothing in common
    inside = found.covariance(np.array([1000.0, 1000.0, 4000.0]))
    np.testing.assert_allclose(ends[:2, 2], inside[:2, 2], atol=1e-12)
    assert ends[0, 1] > inside[0, 1]


@pytest.mark.parametrize("ahead", [300.0, 1800.0])
def test_beyond_the_last_reading_the_claim_covers_a_walk(ahead):
    rng = np.random.default_rng(int(ahead))
    truth = TrendStrength(0.05, 0.3 / 60.0, 1e-8)
    seconds = np.append(np.arange(0.0, 3001.0, 60.0), 3000.0 + ahead)
    squares, claimed = [], []
    for _ in range(150):
        level, values = drawn(rng, seconds, truth)
        found = trend_of(seconds[:-1], values[:-1], truth)
        squares.append((found.at(seconds[-1:])[0] - level[-1]) ** 2)
        claimed.append(found.covariance(seconds[-1:])[0, 0])
    # 150 squares: their mean is good to 12 %; the claim adds the record's usual rate to what its wander explains
    assert 0.6 < np.mean(squares) / np.mean(claimed) < 1.4


def test_twenty_thousand_readings_cost_twenty_times_a_thousand():
    rng = np.random.default_rng(5)
    taken = []
    for n in (1000, 20_000):
        seconds = 10.0 * np.arange(n)
        level = np.cumsum(0.01 * rng.standard_normal(n))
        values = level + 0.05 * rng.standard_normal(n)
        begin = time.process_time()
        found = trend_of(seconds, values, TrendStrength(0.05, 0.01 / np.sqrt(10.0), 1e-8))
        claimed = np.diag(found.covariance(seconds[:: n // 20]))
        _Record.of(seconds, values).likelihood(1e-3, 1e-8)
        taken.append(time.process_time() - begin)
    # a matrix of 40 000 would take 13 GB and four hundred times the time of one of 2000; 100: of a busy machine
    assert taken[1] < 100.0 * max(taken[0], 2e-3)
    # and it is right: errors hang together over some ten readings, so 2000 of them know their rms to 2 %
    assert np.sqrt(np.mean((found.level - level) ** 2)) == pytest.approx(np.sqrt(np.median(claimed)), rel=0.08)


def test_strengths_scale_with_the_unit_of_the_values_and_of_time():
    rng = np.random.default_rng(9)
    seconds = np.arange(0.0, 6000.0, 30.0)
    values = np.cumsum(0.02 * rng.standard_normal(200)) + 0.05 * rng.standard_normal(200)
    one = trend_strength(seconds, values, usual=USUAL, least_noise=NEVER)
    big = trend_strength(seconds, 1000.0 * values + 5.0, usual=USUAL, least_noise=NEVER)
    slow = trend_strength(10.0 * seconds, values, usual=USUAL, least_noise=NEVER)
    np.testing.assert_allclose([big.noise, big.level, big.rate], 1000.0 * np.array([one.noise, one.level, one.rate]))
    assert slow.noise == pytest.approx(one.noise)
    assert slow.level == pytest.approx(one.level / np.sqrt(10.0))
    assert slow.rate == pytest.approx(one.rate / 10.0**1.5)


def test_readings_closer_than_a_tenth_of_a_second_are_merged():
    close = np.array([0.0, 0.02, 60.0, 60.1, 120.0])
    found = trend_of(close, np.array([1.0, 3.0, 2.0, 2.0, 2.0]), STRENGTH)
    assert len(found.seconds) == 4
    assert all(b - a >= 0.0999 for a, b in pairwise(found.seconds))
    assert found.at(np.array([0.0]))[0] == pytest.approx(2.0, abs=0.02)
