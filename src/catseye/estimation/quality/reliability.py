"""Reliability: global test, tests of single observations, and internal and external reliability.

w tests trust the claimed sigmas: w = standardised residual, N(0, 1). tau tests take sigma from the same adjustment:
tau = w / s0, never more than the root of the degrees of freedom. An unchecked observation (no other would reveal
its error) cannot be tested: it is reported as unchecked, never accepted.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtr, chdtrc, chdtri, nctdtr, ndtr, ndtri, stdtr, stdtrit

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import NONCENTRALITY, GroupFit

TOO_GOOD = 1e-4  # probability of a smaller [pvv], below which the claimed sigmas are doubtful, probably by a unit error
UNCHECKED = (
    1e-4  # sigma^2 over the variance of the estimated error, below which w is dominated by rounding and curvature
)

ACCEPTED = "accepted"
SUSPECT = "suspect"
NOT_CHECKED = "unchecked: no other observation would reveal its error"
LEFT_OUT = "left out"
TOO_LARGE = "too large: observations are worse than claimed, some are wrong, or an effect is not modelled"
TOO_SMALL = "too small: observations are better than claimed"
NO_REDUNDANCY = "not tested: no degrees of freedom"


def w_probability(w: np.ndarray) -> np.ndarray:
    """Two-sided p-value of each w, with known sigma.

    Source: [BAARDA68] (the conventional alternative hypothesis, one observation wrong).

    >>> round(float(w_probability(np.array(-3.2905267))), 6)
    0.001
    """
    return 2.0 * ndtr(-np.abs(w))


def tau_probability(tau: np.ndarray, degrees_of_freedom: float) -> np.ndarray:
    """Two-sided p-value of each tau = w / s0.

    s0^2 is [pvv] / degrees of freedom of the same adjustment.

    tau                  (...)
    degrees_of_freedom   f, more than 1: with one, every |tau| is 1

    t = tau sqrt((f - 1) / (f - tau^2)) is Student's with f - 1 degrees of freedom, exactly.
    Raises EstimationError for f <= 1 or |tau| beyond sqrt(f), which is impossible within one adjustment.

    Source: [POPE76] (tau and its relation to Student's t).
    """
    f = _at_least_one(degrees_of_freedom)
    square = np.square(np.asarray(tau, dtype=float))
    if np.any(square > f * (1.0 + 1e-9)):
        raise EstimationError(
            f"tau of {np.sqrt(square.max()):.6g} is beyond the root of {f:g} degrees of freedom; "
            "the variance factor belongs to another adjustment"
        )
    with np.errstate(divide="ignore"):  # at the limit t is infinite and p is zero
        return 2.0 * stdtr(f - 1.0, -np.sqrt(square * (f - 1.0) / np.maximum(f - square, 0.0)))


def w_critical(level: float) -> float:
    """Critical |w| of the two-sided test at `level`.

    Source: [BAARDA68].

    >>> round(w_critical(0.001), 4)
    3.2905
    """
    return float(-ndtri(0.5 * _probability("level", level)))


def tau_critical(level: float, degrees_of_freedom: float) -> float:
    """Critical |tau| of the two-sided test at `level`.

    EstimationError for f <= 1.

    Source: [POPE76] (tau and its relation to Student's t).

    >>> round(tau_critical(0.05, 10.0), 4)
    1.9039
    """
    f = _at_least_one(degrees_of_freedom)
    t = -float(stdtrit(f - 1.0, 0.5 * _probability("level", level)))
    return float(np.sqrt(f) * t / np.sqrt(f - 1.0 + t * t))


def _at_least_one(degrees_of_freedom: float) -> float:
    if not degrees_of_freedom > 1.0:
        raise EstimationError(
            f"a tau test needs more than 1 degree of freedom, there are {degrees_of_freedom:.3g}; use the w test"
        )
    return float(degrees_of_freedom)


def _probability(name: str, value: float) -> float:
    if not 0.0 < value < 1.0:
        raise EstimationError(f"{name} {value:g} is not a probability between 0 and 1")
    return float(value)


def single_level(family_level: float, tests: int, correction: str = "sidak") -> float:
    """Level of each of m tests for a family-wise false-alarm probability `family_level`.

    family_level   0 to 1
    tests          m
    correction     "sidak": 1 - (1 - level)^(1/m), exact for independent w, safe for w with any correlations;
                   "bonferroni": level / m, safe for anything, tau too; "none": family_level itself

    Source: [SIDAK67] theorem 1.

    >>> round(single_level(0.05, 480), 9)
    0.000106855
    """
    level = _probability("family level", family_level)
    if tests < 1:
        raise EstimationError("no observation is checked by others; none can be tested")
    if correction == "sidak":
        return float(-np.expm1(np.log1p(-level) / tests))
    if correction in ("bonferroni", "none"):
        return level / tests if correction == "bonferroni" else level
    raise EstimationError(f"correction {correction!r} has no single-test level (expected sidak, bonferroni or none)")


def adjusted_probability(p: np.ndarray, correction: str = "sidak") -> np.ndarray:
    """p-values (m,) corrected for multiple testing.

    One is below a family level exactly if the corrected test rejects.

    correction   as `single_level`; or "benjamini-hochberg": the level is then the share of false alarms among alarms

    Benjamini and Hochberg's is proven for independent tests and positive dependence; elsewhere it is a guide.

    Source: [SIDAK67] theorem 1; [BENJAMINI95] section 3.

    >>> adjusted_probability(np.array([0.01, 0.04, 0.03]), "benjamini-hochberg")
    array([0.03, 0.04, 0.04])
    """
    p = np.asarray(p, dtype=float)
    m = len(p)
    if correction == "sidak":
        with np.errstate(divide="ignore"):  # a p of 1 stays 1
            return -np.expm1(m * np.log1p(-p))
    if correction == "bonferroni":
        return np.minimum(m * p, 1.0)
    if correction == "benjamini-hochberg":
        order = np.argsort(p)[::-1]
        stepped = np.minimum.accumulate(p[order] * m / np.arange(m, 0, -1))
        return np.minimum(stepped[np.argsort(order)], 1.0)
    if correction == "none":
        return p
    raise EstimationError(f"unknown correction {correction!r} (expected sidak, bonferroni, benjamini-hochberg or none)")


def power(noncentrality: float, level: float, degrees_of_freedom: float = np.inf) -> float:
    """Power of the two-sided test for an error of given noncentrality.

    noncentrality        error of the observation over the standard uncertainty of its estimated error
    level                of the single test
    degrees_of_freedom   finite for the tau test; infinite for the w test

    Source: [BAARDA68]; for tau the equivalent t test with one degree of freedom less, [POPE76].

    >>> round(power(4.1321, 0.001), 4)
    0.8
    """
    if np.isinf(degrees_of_freedom):
        k = w_critical(level)
        return float(ndtr(noncentrality - k) + ndtr(-noncentrality - k))
    f = _at_least_one(degrees_of_freedom) - 1.0
    t = -float(stdtrit(f, 0.5 * _probability("level", level)))
    return float(1.0 - nctdtr(f, noncentrality, t) + nctdtr(f, noncentrality, -t))


def noncentrality(level: float, wanted_power: float, degrees_of_freedom: float = np.inf) -> float:
    """Baarda's delta_0: noncentrality for which the two-sided test of this level has a given power.

    Solved exactly, both tails counted; arguments as `power`. Raises EstimationError for a power not above the level.

    Source: [BAARDA68].

    >>> round(noncentrality(0.001, 0.80), 4)
    4.1321
    """
    if not _probability("level", level) < _probability("power", wanted_power):
        raise EstimationError(f"a power of {wanted_power:g} is not above the level {level:g}")
    low, high = 0.0, 1.0
    while power(high, level, degrees_of_freedom) < wanted_power:
        low, high = high, 2.0 * high
    for _ in range(60):  # bisection to rounding; the power grows with the noncentrality
        middle = 0.5 * (low + high)
        low, high = (middle, high) if power(middle, level, degrees_of_freedom) < wanted_power else (low, middle)
    return 0.5 * (low + high)


def bias_to_noise(redundancy: np.ndarray, delta0: float) -> np.ndarray:
    """Bias-to-noise ratio of the largest undetected error (external reliability).

    It biases any function of the parameters by at most this many of its standard uncertainties; infinite if unchecked.

    redundancy   (...) of independent observations
    delta0       `noncentrality`

    Source: [BAARDA68]; [FOERSTNER16] chapter 4, sensitivity.

    >>> bias_to_noise(np.array([0.5, 0.0]), 4.0)
    array([ 4., inf])
    """
    r = np.asarray(redundancy, dtype=float)
    checked = r >= UNCHECKED
    return np.where(checked, delta0 * np.sqrt(np.maximum(1.0 - r, 0.0) / np.where(checked, r, 1.0)), np.inf)


@dataclass(frozen=True)
class GlobalTest:
    """Two-sided test of the variance factor against its a-priori value 1.

    factor        [pvv] / degrees of freedom
    lower, upper  acceptance interval; it depends on the degrees of freedom and the level only
    p             two-sided p-value; nan without redundancy
    outcome       "accepted", or the reason for rejection
    """

    factor: float
    lower: float
    upper: float
    p: float
    outcome: str


def global_test(pvv: float, degrees_of_freedom: float, level: float = 0.05) -> GlobalTest:
    """Two-sided chi-square test of [pvv] against the claimed sigmas.

    pvv                  v' C^-1 v
    degrees_of_freedom   f, need not be an integer
    level                false-alarm probability

    The interval is about the a-priori value 1. One about [pvv] / f itself (a known bug elsewhere) could never fail.

    Source: [BAARDA68] (overall model test); [FOERSTNER16] chapter 4.

    >>> global_test(20.0, 10.0).outcome, round(global_test(20.0, 10.0).upper, 4)
    ('accepted', 2.0483)
    """
    f, half = float(degrees_of_freedom), 0.5 * _probability("level", level)
    if not f > 1e-9:
        return GlobalTest(np.nan, np.nan, np.nan, np.nan, NO_REDUNDANCY)
    lower, upper = float(chdtri(f, 1.0 - half)) / f, float(chdtri(f, half)) / f
    below, above = float(chdtr(f, pvv)), float(chdtrc(f, pvv))
    outcome = TOO_LARGE if above < half else TOO_SMALL if below < half else ACCEPTED
    return GlobalTest(pvv / f, lower, upper, min(2.0 * min(below, above), 1.0), outcome)


def too_good(pvv: float, degrees_of_freedom: float) -> bool:
    """True if [pvv] is implausibly small, with a probability below one in ten thousand.

    >>> too_good(1e-5, 10.0), too_good(2.0, 10.0)
    (True, False)
    """
    return bool(degrees_of_freedom > 0.5 and chdtr(degrees_of_freedom, pvv) < TOO_GOOD)


@dataclass(frozen=True, eq=False)
class ObservationTests:
    """Tests of all observations; tuples with one (m,) array per group.

    statistic   w, or tau for an estimated sigma; nan for unchecked and left-out observations
    p           its p-value; nan likewise
    adjusted    p corrected for the number of tests
    outcome     (m,) texts: ACCEPTED, SUSPECT, NOT_CHECKED or LEFT_OUT
    tests       number of tests
    """

    statistic: tuple[np.ndarray, ...]
    p: tuple[np.ndarray, ...]
    adjusted: tuple[np.ndarray, ...]
    outcome: tuple[np.ndarray, ...]
    tests: int


def checked(fit: GroupFit) -> np.ndarray:
    """Mask (m,) of observations checked by the others.

    Valid with correlations too.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return fit.sigma**2 > UNCHECKED * (fit.detectable_error / NONCENTRALITY) ** 2


def observation_tests(
    fits: Sequence[GroupFit], *, level: float = 0.05, correction: str = "sidak", known_sigma: bool = True
) -> ObservationTests:
    """Test of every observation of an adjustment, corrected for multiple testing.

    fits          all groups of one adjustment
    level         family-wise false-alarm probability (false discovery rate for "benjamini-hochberg")
    correction    as `adjusted_probability`
    known_sigma   True: w tests; False: tau tests with the variance factor of all groups together

    Source: [BAARDA68]; [POPE76]; [SIDAK67]; [BENJAMINI95].
    """
    tested = [f.active & checked(f) & np.isfinite(f.standardised) for f in fits]
    statistic = [np.where(t, f.standardised, np.nan) for t, f in zip(tested, fits, strict=True)]
    together = np.concatenate([s[t] for s, t in zip(statistic, tested, strict=True)] or [np.zeros(0)])
    if known_sigma:
        p = w_probability(together)
    else:
        degrees = float(sum(np.sum(f.redundancy[f.active]) for f in fits))
        s0 = np.sqrt(sum(f.pvv for f in fits) / _at_least_one(degrees))
        statistic, together = [s / s0 for s in statistic], together / s0
        p = tau_probability(together, degrees)
    cuts = np.cumsum([np.count_nonzero(t) for t in tested])[:-1]
    spread = [(np.split(values, cuts)) for values in (p, adjusted_probability(p, correction))]
    values = [[_filled(t, part) for t, part in zip(tested, parts, strict=True)] for parts in spread]
    outcome = [
        np.where(~f.active, LEFT_OUT, np.where(~t, NOT_CHECKED, np.where(a < level, SUSPECT, ACCEPTED)))
        for f, t, a in zip(fits, tested, values[1], strict=True)
    ]
    return ObservationTests(tuple(statistic), tuple(values[0]), tuple(values[1]), tuple(outcome), len(together))


def _filled(where: np.ndarray, values: np.ndarray) -> np.ndarray:
    full = np.full(len(where), np.nan)
    full[where] = values
    return full
