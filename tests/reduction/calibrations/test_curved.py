"""Fits of curves: against scipy's least squares, joint covariance by hand, priors, what cannot be held."""

import numpy as np
import pytest
from scipy.optimize import curve_fit

from catseye.errors import EstimationError
from catseye.reduction.calibrations.curved import ModelParameter, fit_curved, row_ends
from catseye.reduction.calibrations.fit import FitOptions, ObservedScatter

X = np.linspace(0.0, 3.0, 15)


def decay(values):
    return values[0] * np.exp(-values[1] * X)


def parameters(u0=np.inf, u1=np.inf, start=(4.0, 0.5)):
    return [ModelParameter("height", start[0], 1e-4, u0), ModelParameter("rate", start[1], 1e-4, u1)]


def test_it_finds_what_scipy_finds_with_its_covariance():
    y = decay([5.0, 0.8]) + 0.05 * np.random.default_rng(2).standard_normal(len(X))
    found = fit_curved(y, decay, parameters(), scatter=ObservedScatter(0.05**2 * np.eye(len(X))))
    best, covariance = curve_fit(lambda x, a, b: a * np.exp(-b * x), X, y, (4.0, 0.5), 0.05 * np.ones(len(X)), True)
    np.testing.assert_allclose(found.values, best, rtol=1e-6)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-4)  # scipy's derivatives are one-sided
    np.testing.assert_allclose(found.fit.residual, y - decay(best), atol=1e-6)
    np.testing.assert_allclose(found.fit.predicted, decay(best), atol=1e-6)


def test_a_prior_pulls_like_one_more_reading_of_the_parameter():
    y = decay([5.0, 0.8]) + 0.05 * np.random.default_rng(3).standard_normal(len(X))
    found = fit_curved(
        y, decay, parameters(u1=0.01, start=(4.0, 0.7)), scatter=ObservedScatter(0.05**2 * np.eye(len(X)))
    )

    def both(x, a, b):
        return np.append(a * np.exp(-b * x[:-1]), b)

    best, covariance = curve_fit(
        both, np.append(X, 0.0), np.append(y, 0.7), (4.0, 0.7), np.append(0.05 * np.ones(len(X)), 0.01), True
    )
    np.testing.assert_allclose(found.values, best, rtol=1e-5)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-4)


def test_a_held_parameter_stays_and_has_no_uncertainty():
    found = fit_curved(
        decay([5.0, 0.8]), decay, parameters(u1=0.0, start=(4.0, 0.8)), scatter=ObservedScatter(0.01 * np.eye(len(X)))
    )
    assert found.value("rate") == 0.8
    assert found.u("rate") == 0.0
    assert found.value("height") == pytest.approx(5.0, abs=1e-9)


def test_undetermined_parameters_are_named():
    with pytest.raises(EstimationError, match=r"rank deficient: .*rate"):
        fit_curved(
            decay([5.0, 0.8]) * 0 + 3.0,
            lambda v: np.full(len(X), v[0] + v[1]),
            parameters(),
            scatter=ObservedScatter(np.eye(len(X))),
        )


def test_a_wrong_row_is_rejected_with_all_its_values_and_reported():
    y = decay([5.0, 0.8])
    y[6] += 1.0
    rows = np.arange(len(X)) // 3
    found = fit_curved(
        y,
        decay,
        parameters(),
        scatter=ObservedScatter(0.05**2 * np.eye(len(X))),
        options=FitOptions(together=rows, reject=True),
    )
    assert (~found.fit.active).nonzero()[0].tolist() == [6, 7, 8]
    np.testing.assert_allclose(found.values, [5.0, 0.8], atol=1e-6)
    ends = row_ends(found.fit, [""] * 5, 3)
    assert [state for _, state in ends] == ["used", "used", "rejected", "used", "used"]
    assert abs(ends[2][0]) > 10
