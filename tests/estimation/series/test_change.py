"""Steps in series: found where they are, and false ones no oftener than claimed."""

import numpy as np
import pytest

from catseye.estimation.series.change import LEAST_EACH_SIDE, largest_probability, scan_steps
from catseye.estimation.series.correlated import SeriesGroup, SeriesNoise
from catseye.estimation.series.noise import noise_of, outliers, running_median
from catseye.estimation.series.steps import fit_with_steps


def functions_of(days, rng):
    """Constant, year, season, and an elevation that differs each night."""
    turn = 2.0 * np.pi * days / 365.25
    return np.column_stack([np.ones(len(days)), days / 365.25, np.sin(turn), np.cos(turn), rng.normal(size=len(days))])


def lasting(days, count, d, strength, time, rng):
    """Wander (T, S, d) with a correlation that falls by 1/e in a time."""
    x = np.zeros((len(days), count, d))
    x[0] = rng.normal(size=(count, d))
    for t in range(1, len(days)):
        phi = np.exp(-(days[t] - days[t - 1]) / time)
        x[t] = phi * x[t - 1] + np.sqrt(1.0 - phi**2) * rng.normal(size=(count, d))
    return strength * x


def nights(count, rng):
    """Nights of a year with gaps."""
    return np.sort(rng.choice(int(1.2 * count), count, replace=False)).astype(float)


@pytest.mark.parametrize("d", [1, 2, 3, 6])
@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9, 0.999])
def test_the_probability_of_two_is_that_of_trials(d, rho):
    from scipy.stats import chi2

    rng, trials = np.random.default_rng(3), 100_000
    first = rng.normal(size=(trials, d))
    second = rho * first + np.sqrt(1.0 - rho**2) * rng.normal(size=(trials, d))
    limit = chi2.isf(0.01, d)
    seen = np.mean((np.sum(first**2, axis=1) > limit) | (np.sum(second**2, axis=1) > limit))
    claimed = largest_probability(0.01, d, np.array([rho]))
    assert claimed == pytest.approx(seen, abs=4.0 * np.sqrt(0.02 / trials) + 0.03 * claimed)  # 3 %: the quadrature


@pytest.mark.parametrize("d", [1, 3])
def test_false_steps_are_no_oftener_than_claimed(d):
    """Of 1500 quiet series, those with a probability below 5 % are 2 to 5 %: the bound is above, and close."""
    rng = np.random.default_rng(5)
    days, count = nights(150, rng), 1500 // d
    group = SeriesGroup(days, rng.normal(size=(150, count, d)), np.broadcast_to(np.eye(d), (150, count, d, d)).copy())
    _, scan = scan_steps(group, functions_of(days, rng), SeriesNoise.of(d), limit=0.05)
    share = np.mean(scan.probability < 0.05)
    noise = 4.0 * np.sqrt(0.05 / count)
    assert 0.02 - noise < share < 0.05 + noise


@pytest.mark.parametrize(("archives", "most"), [(5, 3), pytest.param(60, 13, marks=pytest.mark.slow)])
def test_an_archive_without_a_change_raises_none(archives, most):
    """Noise that lasts and is not known beforehand: archives with a false step are no more than claimed, one in ten."""
    rng, wrong = np.random.default_rng(11), 0
    for _ in range(archives):
        days = nights(150, rng)
        values = rng.normal(size=(150, 18, 1)) + lasting(days, 18, 1, 0.5, 40.0, rng)
        group = SeriesGroup(days, values, np.ones((150, 18, 1, 1)))
        wrong += bool(fit_with_steps(group, functions_of(days, rng), probability=0.1 / 18).steps)
    assert wrong <= most  # binomial of 0.1: more in 0.2 % of trials


def test_steps_are_found_with_their_size_and_night():
    rng = np.random.default_rng(2)
    days = nights(200, rng)
    values = rng.normal(size=(200, 30, 3))
    values[70:, 4] += (0.0, 4.0, 0.0)
    values[140:, 4] -= (3.0, 0.0, 0.0)
    values[100:, 17] += (0.0, 0.0, -2.5)
    group = SeriesGroup(days, values, np.broadcast_to(np.eye(3), (200, 30, 3, 3)).copy())
    found = fit_with_steps(group, functions_of(days, rng), probability=0.01 / 30)
    assert [step.series for step in found.steps] == [4, 4, 17]
    for step, at, size in zip(found.steps, (70, 140, 100), ((0, 4, 0), (-3, 0, 0), (0, 0, -2.5)), strict=True):
        assert abs(step.at - at) <= 2
        away = step.size - size
        assert away @ np.linalg.solve(step.covariance, away) < 16.3  # chi-square of 3, one in a thousand
    assert np.max(np.abs(found.level(200)[-1, 4] - (-3.0, 4.0, 0.0))) < 1.0


def test_claims_of_steps_are_those_that_scatter():
    rng, count = np.random.default_rng(8), 400
    days = nights(100, rng)
    values = rng.normal(size=(100, count, 1))
    values[50:] += 8.0
    group = SeriesGroup(days, values, np.ones((100, count, 1, 1)))
    _, scan = scan_steps(group, functions_of(days, rng), SeriesNoise.of(1), limit=0.0)
    sharp = scan.at == 50
    assert sharp.mean() > 0.95
    ratio = (scan.step[sharp, 0] - 8.0) / np.sqrt(scan.covariance[sharp, 0, 0])
    assert ratio.std() == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * count))


def test_a_step_needs_readings_on_both_sides():
    days = np.arange(2.0 * LEAST_EACH_SIDE - 1.0)
    group = SeriesGroup(days, np.where(days < 4, 0.0, 9.0)[:, None, None], np.full((len(days), 1, 1, 1), 0.01))
    _, scan = scan_steps(group, np.ones((len(days), 1)), SeriesNoise.of(1))
    assert (scan.at[0], scan.probability[0]) == (-1, 1.0)


@pytest.mark.parametrize(("white", "wander"), [(0.0, 0.0), (1.0, 0.0), (0.5, 1.0)])
def test_noise_is_estimated(white, wander):
    rng = np.random.default_rng(6)
    days = nights(250, rng)
    values = np.hypot(1.0, white) * rng.normal(size=(250, 20, 1)) + lasting(days, 20, 1, wander, 10.0, rng)
    noise = noise_of(SeriesGroup(days, values, np.ones((250, 20, 1, 1))), functions_of(days, rng))
    assert noise.white[0] == pytest.approx(white, abs=0.2)
    assert noise.wander[0] == pytest.approx(wander, abs=0.15)
    if wander:
        assert 6.0 < noise.days[0] < 16.0


def test_outliers_are_seen_and_steps_are_none():
    rng = np.random.default_rng(9)
    residual = rng.normal(size=(300, 10, 1))
    residual[150:, 3] += 20.0
    residual[77, 5] = 12.0
    residual[200, 6] = np.nan
    found = outliers(residual, np.ones_like(residual), probability=0.01)
    assert np.argwhere(found).tolist() == [[77, 5]]


def test_a_running_median_passes_over_missing_values():
    values = np.array([1.0, np.nan, 2.0, 100.0, 3.0])[:, None]
    assert running_median(values)[:, 0].tolist() == pytest.approx([2.5, np.nan, 2.5, 2.5, 2.5], nan_ok=True)
