"""The adjustment behind all calibrations: against numpy, against closed forms, its false alarms, its scatter."""

import numpy as np
import pytest
from scipy import optimize, stats

from calibration_scene import RUNS
from catseye.errors import EstimationError
from catseye.reduction.calibrations.fit import Effect, FitOptions, ObservedScatter, fit_readings
from catseye.reduction.calibrations.scatter import effective_degrees, restricted_likelihood


def line(m=12, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, m)
    return np.column_stack([np.ones(m), x]), rng


def test_effects_with_priors_are_a_larger_covariance():
    design, rng = line()
    y = rng.standard_normal(12)
    effects = [Effect("a", design[:, 1] ** 2, 0.7), Effect("b", np.ones(12), 0.4), Effect("none", np.ones(12), 0.0)]
    fit = fit_readings(y, design, ObservedScatter(0.25 * np.eye(12)), names=["p", "q"], effects=effects)
    c = 0.25 * np.eye(12) + sum(e.u**2 * np.outer(e.column, e.column) for e in effects)
    w = np.linalg.inv(c)
    q = np.linalg.inv(design.T @ w @ design)
    np.testing.assert_allclose(fit.x, q @ design.T @ w @ y, rtol=1e-10)
    np.testing.assert_allclose(fit.covariance, q, rtol=1e-9)
    assert set(fit.effects) == {"a", "b"}
    assert fit.effects["b"] == pytest.approx((0.0, 0.4), abs=1e-9)  # inseparable from the constant: its prior remains


def test_an_unknown_scatter_is_that_of_least_squares():
    design, rng = line(30)
    y = design @ [1.0, 2.0] + 0.3 * rng.standard_normal(30)
    fit = fit_readings(y, design, ObservedScatter(np.zeros((30, 30)), {"s": np.eye(30)}), names=["p", "q"])
    found = stats.linregress(design[:, 1], y)
    assert fit.x == pytest.approx([found.intercept, found.slope], rel=1e-10)
    assert np.sqrt(np.diag(fit.covariance)) == pytest.approx([found.intercept_stderr, found.stderr], rel=1e-6)
    assert fit.effective == pytest.approx([28.0, 28.0])
    assert (fit.test, np.isnan(fit.variance_factor)) == ("tau", True)


def test_an_unknown_scatter_beside_effects_is_the_top_of_the_restricted_likelihood():
    design, rng = line(15, 9)
    column, u = design[:, 1] ** 2 * 3.0, 0.2
    y = 0.1 * rng.standard_normal(15) + column * 0.3

    def cost(log_variance):
        c = np.exp(log_variance) * np.eye(15) + u**2 * np.outer(column, column)
        w = np.linalg.inv(c)
        normal = design.T @ w @ design
        p = w - w @ design @ np.linalg.solve(normal, design.T @ w)
        return 0.5 * (np.linalg.slogdet(c)[1] + np.linalg.slogdet(normal)[1] + y @ p @ y)

    top = optimize.minimize_scalar(cost, bounds=(-12.0, 2.0), method="bounded", options={"xatol": 1e-8})
    unknown = ObservedScatter(np.zeros((15, 15)), {"s": np.eye(15)})
    fit = fit_readings(y, design, unknown, names=["p", "q"], effects=[Effect("e", column, u)])
    assert fit.components["s"] == pytest.approx(np.exp(0.5 * top.x), rel=1e-5)


def test_two_components_of_a_balanced_table_are_those_of_the_analysis_of_variance():
    rng = np.random.default_rng(3)
    groups, each = 9, 5
    y = (0.8 * rng.standard_normal((groups, 1)) + 0.3 * rng.standard_normal((groups, each))).ravel()
    label = np.repeat(np.arange(groups), each)
    same = (label[:, None] == label).astype(float)
    m = groups * each
    means = y.reshape(groups, each).mean(axis=1)
    within = np.sum((y.reshape(groups, each) - means[:, None]) ** 2) / (groups * (each - 1))
    between = np.var(means, ddof=1) - within / each
    theta = restricted_likelihood(y, np.ones((m, 1)), [np.eye(m), same], claimed=np.zeros((m, m)))
    assert theta == pytest.approx([within, between], rel=1e-6)
    c = theta[0] * np.eye(m) + theta[1] * same
    assert effective_degrees(np.ones((m, 1)), [np.eye(m), same], c) == pytest.approx([groups - 1.0], rel=1e-6)


def test_a_component_below_zero_is_zero():
    y = np.tile([1.0, -1.0], 6) + 1e-3 * np.arange(12)  # groups of two that agree better than single readings
    label = np.repeat(np.arange(6), 2)
    same = (label[:, None] == label).astype(float)
    theta = restricted_likelihood(y, np.ones((12, 1)), [np.eye(12), same], claimed=np.zeros((12, 12)))
    assert theta[1] == 0.0
    assert theta[0] == pytest.approx(np.var(y, ddof=1), rel=1e-6)


@pytest.mark.parametrize("runs", RUNS)
def test_false_alarms_are_as_frequent_as_the_level(runs):
    design, rng = line(20, 5)
    alarms = {"w": 0, "tau": 0}
    for _ in range(runs):
        y = rng.standard_normal(20)
        for scatter in (ObservedScatter(np.eye(20)), ObservedScatter(np.zeros((20, 20)), {"s": np.eye(20)})):
            fit = fit_readings(y, design, scatter, names=["p", "q"], options=FitOptions(level=0.05))
            alarms[fit.test] += bool(fit.suspects.any())
    # Šidák's level is slightly safe with correlations: less than the slack of the count.
    for count in alarms.values():
        assert count / runs == pytest.approx(0.05, abs=3.5 * np.sqrt(0.05 * 0.95 / runs))


def test_the_test_of_the_scatter_fails_where_the_claim_is_wrong():
    design, rng = line(40, 6)
    y = rng.standard_normal(40)
    outcomes = {}
    for claim in (0.5, 1.0, 2.0):
        fit = fit_readings(y, design, ObservedScatter(claim**2 * np.eye(40)), names=["p", "q"])
        outcomes[claim] = fit.decisions()[0].passed
    assert outcomes == {0.5: False, 1.0: True, 2.0: False}


def test_readings_that_are_all_the_same_show_no_scatter():
    same = np.full(3, 38.4)  # whose mean is not 38.4 but for rounding
    unknown = ObservedScatter(np.zeros((3, 3)), {"s": np.eye(3)})
    with pytest.raises(EstimationError, match="do not scatter at all; state the scatter's standard uncertainty"):
        fit_readings(same, np.ones((3, 1)), unknown, names=["p"], effects=[Effect("e", np.ones(3), 0.1)])


def test_readings_that_cannot_be_rejected_are_refused():
    design, rng = line(12, 7)
    y = 50.0 * rng.standard_normal(12)
    with pytest.raises(EstimationError, match="more than 33% of the readings would have to be rejected"):
        fit_readings(y, design, ObservedScatter(np.eye(12)), names=["p", "q"], options=FitOptions(reject=True))
    with pytest.raises(EstimationError, match="rank deficient: p, twice p not determined"):
        fit_readings(y, design[:, [0, 0]], ObservedScatter(np.eye(12)), names=["p", "twice p"])


def test_an_alternative_value_leaves_with_its_partner():
    design, _ = line(12, 8)
    y = np.zeros(12)
    y[3] = 9.0
    fit = fit_readings(
        y,
        design,
        ObservedScatter(np.eye(12)),
        names=["p", "q"],
        options=FitOptions(reject=True, together=np.tile(np.arange(6), 2)),
    )
    assert np.flatnonzero(~fit.active).tolist() == [3, 9]
    assert fit.state(("",) * 12)[9] == "rejected"


def test_groups_that_agree_to_the_last_digit_report_the_missing_u():
    same = np.kron(np.eye(3), np.ones((4, 4)))
    scatter = ObservedScatter(np.zeros((12, 12)), {"one": np.eye(12), "group": same})
    with pytest.raises(EstimationError, match="of one group agree to the last digit"):
        fit_readings(np.repeat([1.0, 1.1, 0.9], 4), np.ones((12, 1)), scatter, names=["mean"])


def test_the_rounding_of_differences_is_no_scatter():
    rounding = np.array([1.0, -2.0, 1.0, 3.0]) * 1e-16
    scatter = ObservedScatter(np.zeros((4, 4)), {"s": np.eye(4)}, size=3.0)
    with pytest.raises(EstimationError, match="do not scatter at all"):
        fit_readings(rounding, np.ones((4, 1)), scatter, names=["mean"])
