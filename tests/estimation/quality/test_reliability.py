"""Tests of observations: printed critical values, scipy's distributions, and what seeded Monte Carlo says of them."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import NONCENTRALITY, GroupFit
from catseye.estimation.quality import reliability as r
from draws import examples

quick = examples(60)
levels = st.floats(1e-4, 0.2)


class Linear:
    """A fixed linear network: m observations of unit sigma, residuals and tests of many draws at once."""

    def __init__(self, seed=0, m=24, n=9):
        self.a = np.random.default_rng(seed).normal(size=(m, n))
        self.q = np.linalg.inv(self.a.T @ self.a)
        self.p_v = np.eye(m) - self.a @ self.q @ self.a.T
        self.redundancy, self.degrees = np.diag(self.p_v), m - n

    def tests(self, errors):
        """w (runs, m) and [pvv] (runs,) of errors (runs, m)."""
        v = errors @ self.p_v
        return v / np.sqrt(self.redundancy), np.sum(v * v, axis=1)

    def fit(self, errors, active=None):
        w, pvv = self.tests(errors[None])
        on = np.ones(len(errors), dtype=bool) if active is None else active
        u = 1.0 / np.sqrt(self.redundancy)
        v = w[0] / u
        return GroupFit(
            "shots", on, v, np.ones(len(v)), self.redundancy, w[0], w[0] * u, NONCENTRALITY * u, float(pvv[0])
        )


NETWORK = Linear()


# --- critical values


@pytest.mark.parametrize(
    ("size", "printed"),  # two-sided 5 % values of Grubbs' largest residual of one sample, ISO 5725-2 table 5
    # the table's last digit is uncertain by one; Sidak's level instead of Bonferroni's would be 0.003 off
    [(3, 1.155), (5, 1.715), (8, 2.126), (10, 2.290), (15, 2.549), (20, 2.709), (30, 2.908)],
)
def test_the_tau_test_of_one_repeated_quantity_is_the_printed_grubbs_table(size, printed):
    tau = r.tau_critical(r.single_level(0.05, size, "bonferroni"), size - 1)
    assert tau * np.sqrt((size - 1) / size) == pytest.approx(printed, abs=1.1e-3)


def test_baarda_s_printed_values():
    assert r.w_critical(0.001) == pytest.approx(3.29, abs=5e-3)
    assert r.noncentrality(0.001, 0.80) == pytest.approx(4.13, abs=5e-3)
    assert r.noncentrality(0.001, 0.80) == pytest.approx(NONCENTRALITY, abs=5e-3)
    assert r.noncentrality(0.05, 0.80) == pytest.approx(2.80, abs=5e-3)
    assert r.noncentrality(0.001, 0.80) ** 2 == pytest.approx(17.07, abs=0.01)  # lambda_0


@quick
@given(levels, st.floats(2.0, 300.0))
def test_tau_is_a_transformed_student_t(level, f):
    tau = r.tau_critical(level, f)
    assert 0.0 < tau <= np.sqrt(f)
    assert float(r.tau_probability(tau, f)) == pytest.approx(level, rel=1e-6)
    assert tau == pytest.approx(np.sqrt(f) * stats.beta.isf(level, 0.5, (f - 1) / 2) ** 0.5, rel=1e-6)  # tau^2/f: beta


def test_tau_approaches_w_with_many_degrees_of_freedom():
    assert r.tau_critical(0.001, 1e7) == pytest.approx(r.w_critical(0.001), rel=1e-5)


def test_a_tau_test_without_a_second_degree_of_freedom_is_refused():
    for call in (lambda: r.tau_critical(0.05, 1.0), lambda: r.tau_probability(np.ones(1), 0.5)):
        with pytest.raises(EstimationError, match="needs more than 1 degree of freedom"):
            call()
    with pytest.raises(EstimationError, match="tau of 4 is beyond the root of 9"):
        r.tau_probability(np.array([1.0, -4.0]), 9.0)
    assert r.tau_probability(np.array([3.0]), 9.0)[0] == 0.0


@pytest.mark.parametrize("level", [0.0, 1.0, 5.0])
def test_invalid_levels_are_refused(level):
    for call in (r.w_critical, lambda x: r.single_level(x, 3), lambda x: r.global_test(3.0, 3.0, x)):
        with pytest.raises(EstimationError, match="is not a probability"):
            call(level)


# --- many tests


def test_sidak_is_exact_for_independent_tests_and_bonferroni_just_below():
    alpha = r.single_level(0.05, 100)
    assert 1 - (1 - alpha) ** 100 == pytest.approx(0.05, rel=1e-12)
    assert r.single_level(0.05, 100, "bonferroni") == pytest.approx(0.0005)
    assert r.single_level(0.05, 100, "bonferroni") < alpha
    assert r.single_level(0.05, 100, "none") == 0.05


@quick
@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=40), levels)
def test_corrected_p_values_reject_exactly_what_the_corrected_level_does(p, level):
    p = np.array(p)
    for correction in ("sidak", "bonferroni", "none"):
        alpha = r.single_level(level, len(p), correction)
        clear = np.abs(p - alpha) > 1e-12
        rejected = r.adjusted_probability(p, correction) < level
        assert (rejected == (p < alpha))[clear].all()


@quick
@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=40))
def test_the_false_discovery_rate_is_scipy_s(p):
    expected = stats.false_discovery_control(np.array(p), method="bh")
    np.testing.assert_allclose(r.adjusted_probability(np.array(p), "benjamini-hochberg"), expected, rtol=1e-12)


def test_unknown_corrections_are_refused():
    with pytest.raises(EstimationError, match="unknown correction 'holm'"):
        r.adjusted_probability(np.array([0.1]), "holm")
    with pytest.raises(EstimationError, match="has no single-test level"):
        r.single_level(0.05, 3, "benjamini-hochberg")
    with pytest.raises(EstimationError, match="none can be tested"):
        r.single_level(0.05, 0)


# --- power and reliability


@quick
@given(levels, st.floats(0.3, 0.99))
def test_the_noncentrality_has_the_power_asked_for_by_the_noncentral_chi_square(level, power):
    delta = r.noncentrality(level, power)
    assert stats.ncx2.sf(stats.norm.isf(level / 2) ** 2, 1, delta**2) == pytest.approx(power, rel=1e-9)


def test_the_noncentrality_counts_both_tails():
    # by mpmath; 4.13 and the like leave out the far tail, which matters where level and power are near
    for level, power in ((0.001, 0.8), (0.2, 0.3), (0.05, 0.06)):
        k = mpmath.sqrt(2) * mpmath.erfinv(1 - mpmath.mpf(level))

        def missing(d, k=k, power=power):
            return mpmath.ncdf(d - k) + mpmath.ncdf(-d - k) - power

        delta = r.noncentrality(level, power)  # the power grows with delta: there is one positive root
        assert delta == pytest.approx(float(mpmath.findroot(missing, (0.9 * delta, 1.1 * delta))), rel=1e-9)


def test_the_power_of_tau_is_that_of_the_noncentral_t_test():
    t = stats.t.isf(0.0005, 14)
    for delta in (0.0, 2.0, 5.0):
        assert r.power(delta, 0.001, 15.0) == pytest.approx(
            stats.nct.sf(t, 14, delta) + stats.nct.cdf(-t, 14, delta), rel=1e-6, abs=1e-9
        )
    assert r.power(0.0, 0.001, 15.0) == pytest.approx(0.001, rel=1e-6)
    assert r.noncentrality(0.001, 0.8, 15.0) > r.noncentrality(0.001, 0.8)
    assert r.noncentrality(0.001, 0.8, 1e5) == pytest.approx(r.noncentrality(0.001, 0.8), abs=1e-3)


def test_a_power_below_the_level_is_refused():
    with pytest.raises(EstimationError, match=r"a power of 0.04 is not above the level 0.05"):
        r.noncentrality(0.05, 0.04)


def test_undetected_error_moves_parameters_by_the_bias_to_noise_ratio():
    """Exactly: adjusted once with the error and once without, each observation in turn."""
    delta0 = r.noncentrality(0.001, 0.8)
    bias = np.diag(delta0 / np.sqrt(NETWORK.redundancy))
    effects = np.linalg.lstsq(NETWORK.a, bias, rcond=None)[0].T
    length = np.sqrt(np.sum(effects @ np.linalg.inv(NETWORK.q) * effects, axis=1))
    np.testing.assert_allclose(length, r.bias_to_noise(NETWORK.redundancy, delta0), rtol=1e-9)


# --- the whole


def test_the_global_test_has_the_printed_chi_square_interval():
    test = r.global_test(10.0, 10.0)
    assert test.lower * 10 == pytest.approx(3.247, abs=6e-4)  # chi-square table, 10 degrees, 2.5 and 97.5 %
    assert test.upper * 10 == pytest.approx(20.483, abs=6e-4)
    assert test.outcome == r.ACCEPTED


def test_the_global_test_can_fail_on_either_side():
    assert r.global_test(21.0, 10.0).outcome == r.TOO_LARGE
    assert r.global_test(3.0, 10.0).outcome == r.TOO_SMALL
    assert r.global_test(3.0, 10.0).p == pytest.approx(2 * stats.chi2.cdf(3.0, 10))
    assert r.global_test(21.0, 10.0).p == pytest.approx(2 * stats.chi2.sf(21.0, 10))
    assert r.global_test(0.0, 0.0).outcome == r.NO_REDUNDANCY
    assert np.isnan(r.global_test(0.0, 0.0).p)


@quick
@given(st.floats(0.0, 1e4), st.floats(0.5, 1e3), levels)
def test_the_interval_the_p_value_and_the_verdict_of_the_global_test_agree(pvv, f, level):
    test = r.global_test(pvv, f, level)
    if min(abs(test.factor / test.lower - 1), abs(test.factor / test.upper - 1), abs(test.p / level - 1)) > 1e-6:
        assert (test.lower < test.factor < test.upper) == (test.p > level) == (test.outcome == r.ACCEPTED)


# --- what is claimed of the tests, by Monte Carlo


def alarms(trials, seed=1):
    rng = np.random.default_rng(seed)
    w, pvv = NETWORK.tests(rng.normal(size=(trials, 24)))
    tau = w / np.sqrt(pvv / NETWORK.degrees)[:, None]
    return r.w_probability(w), r.tau_probability(tau, NETWORK.degrees), pvv


def check_alarms(trials):
    p_w, p_tau, pvv = alarms(trials)
    scatter = 4.0 * np.sqrt(1.0 / trials)
    for p in (p_w, p_tau):
        assert np.abs(np.mean(p < 0.05, axis=0) - 0.05).max() < scatter * np.sqrt(0.05 * 0.95)
        assert stats.kstest(p[:, 3], "uniform").pvalue > 1e-4
    for p, correction in ((p_w, "sidak"), (p_w, "bonferroni"), (p_tau, "bonferroni"), (p_tau, "sidak")):
        alpha = r.single_level(0.05, 24, correction)
        family = np.mean((p < alpha).any(axis=1))
        # safe, and not much below: tests of one adjustment are correlated
        assert 0.03 - scatter * 0.2 < family < 0.05 + scatter * 0.22, correction
    verdicts = np.array([r.global_test(value, NETWORK.degrees).outcome for value in pvv[:2000]])
    scatter = 4.0 * np.sqrt(0.025 * 0.975 / len(verdicts))
    assert np.mean(verdicts == r.TOO_LARGE) == pytest.approx(0.025, abs=scatter)
    assert np.mean(verdicts == r.TOO_SMALL) == pytest.approx(0.025, abs=scatter)


def test_false_alarms_are_as_frequent_as_the_levels_say():
    check_alarms(2000)


@pytest.mark.slow
def test_false_alarms_are_as_frequent_as_the_levels_say_in_many_runs():
    check_alarms(200_000)


@pytest.mark.parametrize("row", [0, 11, 17])
def test_an_error_of_the_detectable_size_is_found_with_the_power_claimed(row):
    rng = np.random.default_rng(row)
    for level, power in ((0.001, 0.8), (0.01, 0.5)):
        errors = rng.normal(size=(4000, 24))
        errors[:, row] += r.noncentrality(level, power) / np.sqrt(NETWORK.redundancy[row])
        w, _ = NETWORK.tests(errors)
        assert np.mean(r.w_probability(w[:, row]) < level) == pytest.approx(power, abs=0.03)
        errors = rng.normal(size=(4000, 24))
        delta = r.noncentrality(level, power, NETWORK.degrees)
        errors[:, row] += delta / np.sqrt(NETWORK.redundancy[row])
        w, pvv = NETWORK.tests(7.0 * errors)  # the tau test does not know sigma
        tau = w[:, row] / np.sqrt(pvv / NETWORK.degrees)
        assert np.mean(r.tau_probability(tau, NETWORK.degrees) < level) == pytest.approx(power, abs=0.03)


def test_the_share_of_false_alarms_among_alarms_stays_below_the_level():
    z = np.random.default_rng(4).normal(size=(3000, 60))
    z[:, :6] += 4.0
    found = np.array([r.adjusted_probability(p, "benjamini-hochberg") < 0.1 for p in r.w_probability(z)])
    shares = np.sum(found[:, 6:], axis=1) / np.maximum(np.sum(found, axis=1), 1)
    assert np.mean(shares) == pytest.approx(0.1 * 54 / 60, abs=0.01)  # exact for independent tests


# --- the observations of an adjustment


def rejected(tests):
    return [np.flatnonzero(outcome == r.SUSPECT).tolist() for outcome in tests.outcome]


def test_a_suspect_has_its_statistic_and_a_p_value_for_all_tests_together():
    errors = np.random.default_rng(3).normal(size=24) * 0.3
    errors[[4, 19]] += [30.0, -12.0]
    fit = NETWORK.fit(errors)
    tests = r.observation_tests([NETWORK.fit(np.random.default_rng(5).normal(size=24) * 0.3), fit])
    assert rejected(tests)[0] == []
    assert 4 in rejected(tests)[1]
    assert np.nanargmin(tests.p[1]) == 4
    assert tests.statistic[1][4] == fit.standardised[4]
    assert tests.p[1][4] == pytest.approx(2 * stats.norm.sf(abs(fit.standardised[4])))
    assert tests.adjusted[1][4] == pytest.approx(1 - (1 - tests.p[1][4]) ** 48, rel=1e-6, abs=1e-15)


def test_tau_finds_the_suspect_where_all_sigmas_are_claimed_a_hundred_times_too_small():
    errors = 100.0 * np.random.default_rng(3).normal(size=24)
    errors[4] += 1500.0
    fit = NETWORK.fit(errors)
    assert len(rejected(r.observation_tests([fit]))[0]) > 15  # w trusts the claim
    tests = r.observation_tests([fit], known_sigma=False)
    assert rejected(tests) == [[4]]
    assert tests.statistic[0][4] == pytest.approx(fit.standardised[4] / np.sqrt(fit.pvv / NETWORK.degrees))


def test_the_unchecked_and_those_left_out_are_named_never_accepted():
    m = 8
    redundancy = np.array([0.5] * 6 + [1e-13, 0.5])
    u = 1.0 / np.sqrt(np.maximum(redundancy, 1e-12))
    w = np.array([0.1, -0.4, 1.0, 0.2, 0.0, -9.0, 40.0, 12.0])
    active = np.arange(m) != 7
    fit = GroupFit("g", active, w / u, np.ones(m), redundancy, w, w * u, NONCENTRALITY * u, 80.0)
    tests = r.observation_tests([fit])
    assert tests.tests == 6
    assert tests.outcome[0][6] == r.NOT_CHECKED
    assert tests.outcome[0][7] == r.LEFT_OUT
    assert tests.outcome[0][5] == r.SUSPECT
    assert (tests.outcome[0][:5] == r.ACCEPTED).all()
    assert np.isnan(tests.statistic[0][6:]).all()
    assert np.isnan(tests.adjusted[0][6:]).all()
    assert r.checked(fit).tolist() == [True] * 6 + [False, True]


def test_an_adjustment_without_any_check_has_no_suspects_and_nothing_accepted():
    u = np.full(3, 1e6)
    fit = GroupFit(
        "g", np.ones(3, bool), np.zeros(3), np.ones(3), np.zeros(3), np.zeros(3), np.zeros(3), NONCENTRALITY * u, 0.0
    )
    tests = r.observation_tests([fit])
    assert tests.tests == 0
    assert (tests.outcome[0] == r.NOT_CHECKED).all()
