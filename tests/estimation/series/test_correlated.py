"""Functions fitted to series with noise that lasts: the same as dense algebra, and as claimed against scatter."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.estimation.series.change import scan_steps
from catseye.estimation.series.correlated import SeriesGroup, SeriesNoise, fit_series

ROUNDING = 1e-8  # relative, of inverses of matrices of condition 1e4


def dense(group, functions, noise, series):
    """Readings, design, covariance and times of one series, as one dense system."""
    at = np.flatnonzero(group.present[:, series])
    d = group.values.shape[2]
    lags = np.abs(group.days[at][:, None] - group.days[at])
    covariance = np.einsum("abi,ij->aibj", noise.wander**2 * np.exp(-lags[:, :, None] / noise.days), np.eye(d))
    for k, t in enumerate(at):
        covariance[k, :, k] += group.covariance[t, series] + np.diag(noise.white**2)
    design = np.einsum("ta,ij->tiaj", functions[at], np.eye(d)).reshape(len(at) * d, -1)
    return group.values[at, series].ravel(), design, covariance.reshape(len(at) * d, -1), at


def scene(d, seed=1):
    """Three series of twelve readings, one missing, with lasting noise that differs by component."""
    rng = np.random.default_rng(seed)
    days = np.cumsum(rng.uniform(0.5, 2.0, 14))
    functions = np.column_stack([np.ones(14), days / 10.0])
    root = rng.normal(size=(14, 3, d, d))
    values = rng.normal(size=(14, 3, d))
    values[3, 1] = np.nan
    noise = SeriesNoise(rng.uniform(0.1, 0.5, d), rng.uniform(0.5, 2.0, d), rng.uniform(1.0, 6.0, d))
    return SeriesGroup(days, values, 0.3 * root @ np.swapaxes(root, 2, 3) + np.eye(d)), functions, noise


@pytest.mark.parametrize("d", [1, 3, 6])
@pytest.mark.parametrize("lasting", [True, False])
def test_a_filter_gives_the_dense_least_squares(d, lasting):
    group, functions, noise = scene(d)
    if not lasting:
        noise = SeriesNoise(noise.white, np.zeros(d), noise.days)
    fit = fit_series(group, functions, noise)
    for series in range(3):
        y, design, covariance, _ = dense(group, functions, noise, series)
        weight = np.linalg.inv(covariance)
        normal = design.T @ weight @ design
        theta = np.linalg.solve(normal, design.T @ weight @ y)
        left = y - design @ theta
        assert fit.coefficients[series].ravel() == pytest.approx(theta, rel=ROUNDING)
        assert fit.covariance[series] == pytest.approx(np.linalg.inv(normal), rel=ROUNDING, abs=1e-12)
        assert fit.pvv[series] == pytest.approx(left @ weight @ left, rel=ROUNDING)
        assert fit.degrees_of_freedom[series] == len(y) - len(theta)
        determinants = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(normal)[1]
        assert fit.logarithm[series] == pytest.approx(-0.5 * (determinants + left @ weight @ left), rel=ROUNDING)


@pytest.mark.parametrize("d", [1, 3])
@pytest.mark.parametrize("lasting", [True, False])
def test_the_statistic_of_each_step_is_that_of_a_fit_with_it(d, lasting):
    group, functions, noise = scene(d, seed=4)
    if not lasting:
        noise = SeriesNoise(noise.white, np.zeros(d), noise.days)
    plain, scan = scan_steps(group, functions, noise)
    looked = 0
    for series in range(3):
        for t in np.flatnonzero(scan.profile[:, series] > 0.0):
            step = (np.arange(14) >= t).astype(float)[:, None]
            fit = fit_series(group.part(np.array([series])), np.hstack([functions, step]), noise)
            explained = plain.pvv[series] - fit.pvv[0]
            expected = (explained / d) / (fit.pvv[0] / fit.degrees_of_freedom[0])
            assert scan.profile[t, series] == pytest.approx(expected, rel=1e-6)
            if t == scan.at[series]:
                assert scan.step[series] == pytest.approx(fit.coefficients[0, -1], rel=1e-6)
                assert scan.covariance[series] == pytest.approx(fit.covariance[0, -d:, -d:], rel=1e-6, abs=1e-12)
            looked += 1
    assert looked > 10


def test_an_undetermined_coefficient_is_not_a_number():
    days = np.arange(6.0)
    group = SeriesGroup(days, np.ones((6, 1, 1)), np.ones((6, 1, 1, 1)))
    fit = fit_series(group, np.column_stack([np.ones(6), days, 2.0 * days]), SeriesNoise.of(1))
    assert np.isfinite(fit.coefficients[0, 0, 0])
    assert np.isnan(fit.coefficients[0, 1:, 0]).all()


def test_times_that_do_not_rise_are_refused():
    with pytest.raises(ValidityError, match="do not increase"):
        SeriesGroup(np.array([1.0, 1.0]), np.zeros((2, 1, 1)), np.ones((2, 1, 1, 1)))


def test_claimed_rates_are_those_that_scatter():
    """A thousand years of nights with lasting noise: rates scatter as claimed, within 4 standard deviations of that."""
    rng = np.random.default_rng(7)
    days, count = np.sort(rng.choice(400, 120, replace=False)).astype(float), 1000
    wander = np.zeros((120, count))
    wander[0] = rng.normal(size=count)
    for t in range(1, 120):
        phi = np.exp(-(days[t] - days[t - 1]) / 15.0)
        wander[t] = phi * wander[t - 1] + np.sqrt(1.0 - phi**2) * rng.normal(size=count)
    u = rng.uniform(0.5, 2.0, (120, count))
    values = wander + u * rng.normal(size=(120, count))
    functions = np.column_stack([np.ones(120), days / 365.25, np.cos(2.0 * np.pi * days / 365.25)])
    group = SeriesGroup(days, values[..., None], u[..., None, None] ** 2)
    fit = fit_series(group, functions, SeriesNoise.of(1, 0.0, 1.0, 15.0))
    ratio = (fit.coefficients / fit.u)[..., 0].std(axis=0)
    assert ratio == pytest.approx(np.ones(3), abs=4.0 / np.sqrt(2.0 * count))
    blind = fit_series(group, functions, SeriesNoise.of(1))
    assert (blind.coefficients / blind.u)[..., 0].std(axis=0)[1] > 1.5  # noise that lasts is no white noise
