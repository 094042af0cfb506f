"""Random walk of the electronics' phase, and reference interval needed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import EstimationError, ValidityError

ITERATIONS = 200  # steps of the maximization; it takes some ten
HALVINGS = 40  # of a step that lowers the likelihood
SETTLED = 1e-9  # of a variance: the last step


@dataclass(frozen=True, eq=False)
class Walk:
    """Random walk estimated from reference shots.

    random_walk     rad per square root of a second
    u_random_walk   rad per square root of a second; infinite where the estimate is 0
    white           rad, standard deviation of further noise of the references; 0 where not estimated
    u_white         rad; infinite where the estimate is 0
    covariance      (2, 2) of random_walk^2 and white^2, by the information at the estimate; of the walk alone, the
                    other elements zero, where white was not estimated
    degrees         equivalent degrees of freedom of random_walk^2
    """

    random_walk: float
    u_random_walk: float
    white: float
    u_white: float
    covariance: NDArray[np.float64]
    degrees: float

    def interval(self, probability: float = 0.95) -> tuple[float, float]:
        """Confidence limits of the random walk, chi-square with `degrees`.

        Exact for references without noise, an approximation where their noise outweighs the walk; (0, infinity) where
        the estimate is 0.
        """
        from scipy.stats import chi2

        if self.random_walk == 0.0:
            return 0.0, float("inf")
        tail = 0.5 * (1.0 - probability)
        low, high = chi2.ppf([1.0 - tail, tail], self.degrees)
        return self.random_walk * np.sqrt(self.degrees / low), self.random_walk * np.sqrt(self.degrees / high)


def estimate_walk(
    reference_time: np.ndarray,
    reference_phase: np.ndarray,
    reference_variance: np.ndarray,
    *,
    series: ArrayLike | None = None,
    white: bool = False,
) -> Walk:
    """Random walk, optionally with white noise, from reference shots.

    reference_time, reference_phase, reference_variance   as for `drift_at`: s, rad (unwrapped), rad^2
    series   (r,) label of the ranger of each reference; series share coefficients, not levels; default: one
    white    True to solve for further noise of the references

    Restricted maximum likelihood: that of the differences of neighbours, in which no level is left. Three or four
    references of one ranger are not enough; those of several rangers over a night are.

    Raises EstimationError with no more differences than unknowns, or where all references are of one time.

    Source: [PATTERSON71]; without noise it is the mean of difference^2/gap. Biased upwards a little where the walk is
    near 0, since it cannot be below; otherwise its scatter agrees with its uncertainty.

    >>> w = estimate_walk(np.array([0.0, 4.0, 5.0]), np.array([0.0, 2e-3, 1e-3]), np.zeros(3))
    >>> round(w.random_walk, 9), w.degrees
    (0.001, 2.0)
    """
    blocks = _differences(reference_time, reference_phase, reference_variance, series)
    count = sum(len(d) for d, *_ in blocks)
    unknowns = 2 if white else 1
    if count <= unknowns or not any(np.any(gap > 0.0) for _, gap, *_ in blocks):
        raise EstimationError(
            f"{count} differences of reference shots do not determine {unknowns} kinds of noise "
            f"(expected at least {unknowns + 1}, at different times)"
        )
    theta, information = _most_likely(blocks, white)
    covariance = np.zeros((2, 2))
    k = 2 if white else 1
    if np.linalg.cond(information[:k, :k] / np.sqrt(np.outer(*[np.diag(information)[:k]] * 2))) > 1e10:
        raise EstimationError("reference shots do not separate walk and white noise: vary the gaps, or fix one")
    covariance[:k, :k] = np.linalg.inv(information[:k, :k])
    root = np.sqrt(theta)
    u = np.sqrt(np.diag(covariance))
    half = [float(u[i] / (2.0 * root[i])) if root[i] > 0.0 else float("inf") for i in (0, 1)]
    degrees = float(2.0 * theta[0] ** 2 / covariance[0, 0])
    return Walk(
        random_walk=float(root[0]),
        u_random_walk=half[0],
        white=float(root[1]),
        u_white=half[1] if white else 0.0,
        covariance=covariance,
        degrees=degrees,
    )


@dataclass(frozen=True)
class WalkTest:
    """Chi-square test of given coefficients against reference shots.

    statistic    differences of neighbours over their covariance, squared and summed
    degrees      of freedom: differences
    low, high    limits of the statistic, chi-square
    """

    statistic: float
    degrees: int
    low: float
    high: float

    @property
    def passed(self) -> bool:
        """True if the statistic is within both limits.

        Too small a statistic means an overestimated walk.
        """
        return self.low <= self.statistic <= self.high


def walk_test(
    reference_time: np.ndarray,
    reference_phase: np.ndarray,
    reference_variance: np.ndarray,
    *,
    random_walk: float,
    series: ArrayLike | None = None,
    probability: float = 0.95,
) -> WalkTest:
    """Chi-square test, with both limits, of a given random walk.

    reference_time, reference_phase, reference_variance, series   as for `estimate_walk`
    random_walk   rad per square root of a second
    probability   that the statistic lies within its limits where the walk is the true one

    Raises EstimationError without two references in any series.

    Source: sum of squares of normal variables. Exact.
    """
    from scipy.special import chdtri  # scipy.stats takes a third of a second to load

    blocks = _differences(reference_time, reference_phase, reference_variance, series)
    degrees = sum(len(d) for d, *_ in blocks)
    if not degrees:
        raise EstimationError("no series has two reference shots: a random walk cannot be estimated")
    statistic = 0.0
    for d, gap, noise, _ in blocks:
        statistic += float(d @ np.linalg.solve(random_walk**2 * np.diag(gap) + noise, d))
    tail = 0.5 * (1.0 - probability)
    low, high = chdtri(degrees, [1.0 - tail, tail])
    return WalkTest(statistic, degrees, float(low), float(high))


def midpoint_uncertainty(
    gap: ArrayLike, random_walk: ArrayLike, u_reference: ArrayLike, *, endless: bool = False
) -> NDArray[np.float64]:
    """Standard uncertainty midway between two reference shots, rad.

    The maximum for the electronics' phase.

    gap           s, from reference to reference
    random_walk   rad per square root of a second
    u_reference   rad, of each reference
    endless       True if more references follow on both sides at the same gaps, which improves both

    With q the square of the random walk, u^2 = q gap/4 + u_reference^2/2 between two alone, and
    sqrt((q gap/2)^2 + q gap u_reference^2)/2 in an endless series.

    Source: `drift_at` in the middle; the steady state of two filters. Exact.

    >>> f"{float(midpoint_uncertainty(100.0, 1e-4, 0.0)):.1e}"
    '5.0e-04'
    """
    growth = np.asarray(random_walk, dtype=float) ** 2 * np.asarray(gap, dtype=float)
    v = np.asarray(u_reference, dtype=float) ** 2
    return np.sqrt(0.5 * np.sqrt(0.25 * growth**2 + growth * v) if endless else 0.25 * growth + 0.5 * v)


def longest_gap(
    u_phase: ArrayLike, random_walk: ArrayLike, u_reference: ArrayLike, *, endless: bool = False
) -> NDArray[np.float64]:
    """Longest time between reference shots, s, for a given uncertainty.

    u_phase       rad, limit everywhere between them; a range's u is u_phase wavelength/(4 pi)
    random_walk   rad per square root of a second, above 0
    u_reference   rad, of each reference
    endless       as for `midpoint_uncertainty`, whose inverse this is

    Raises ValidityError where two references do not reach it at any gap: u_phase below u_reference/sqrt(2).

    >>> round(float(longest_gap(5e-4, 1e-4, 0.0)), 6)
    100.0
    """
    u2, v = np.asarray(u_phase, dtype=float) ** 2, np.asarray(u_reference, dtype=float) ** 2
    q = np.asarray(random_walk, dtype=float) ** 2
    if np.any(q <= 0.0):
        raise ValidityError("a random walk of 0 rad per root second sets no gap between reference shots")
    if endless:
        return 2.0 * (np.sqrt(v**2 + 4.0 * u2**2) - v) / q
    if np.any(u2 <= 0.5 * v):
        least = float(np.max(np.sqrt(0.5 * v)))
        raise ValidityError(
            f"u_phase is not above {least:.3g} rad, what two references give at best: take more of each"
        )
    return 4.0 * (u2 - 0.5 * v) / q


def _differences(time: ArrayLike, phase: ArrayLike, variance: ArrayLike, series: ArrayLike | None) -> list[tuple]:
    """Differences (k,), gaps (k,), noise (k, k) and unit white noise, for each series of two or more."""
    t, y, v = (np.asarray(a, dtype=float) for a in (time, phase, variance))
    labels = np.zeros(len(t), dtype=int) if series is None else np.unique(np.asarray(series), return_inverse=True)[1]
    blocks = []
    for label in np.unique(labels):
        members = np.flatnonzero(labels == label)
        members = members[np.argsort(t[members], kind="stable")]
        if len(members) > 1:
            step = np.diff(np.eye(len(members)), axis=0)
            blocks.append((np.diff(y[members]), np.diff(t[members]), (step * v[members]) @ step.T, step @ step.T))
    return blocks


def _most_likely(blocks: list[tuple], white: bool) -> tuple[np.ndarray, np.ndarray]:
    """Variances (walk a second, white) of the highest restricted likelihood, none below 0, with information."""
    total = sum(float(d @ d + np.trace(noise)) for d, _, noise, _ in blocks)
    if total == 0.0:
        raise EstimationError("all reference phases are equal and without noise: a random walk cannot be estimated")
    unit = total / np.array([sum(float(gap.sum()) for _, gap, *_ in blocks), sum(2.0 * len(d) for d, *_ in blocks)])
    # The likelihood of two components may have several maxima: mostly walk, mostly white, both.
    starts = [(1.0, 0.1), (0.01, 1.0), (0.3, 0.5)] if white else [(1.0, 0.0)]
    summits = [_climbed(np.array(start) * unit, blocks, white) for start in starts]
    return min(summits, key=lambda s: s[0])[1:]


def _climbed(theta: np.ndarray, blocks: list[tuple], white: bool) -> tuple[float, np.ndarray, np.ndarray]:
    """Climb by Fisher's scoring: value, variances, information.

    Each component is stopped at 0.
    """
    value, slope, information = _likelihood(theta, blocks)
    for _ in range(ITERATIONS):
        free = (theta > 0.0) | (slope < 0.0)
        free[1] &= white
        if not np.any(free):
            return value, theta, information
        step = np.zeros(2)
        step[free] = -np.linalg.lstsq(information[np.ix_(free, free)], slope[free], rcond=None)[0]
        for _ in range(HALVINGS):
            further = np.maximum(theta + step, 0.0)
            reached = _likelihood(further, blocks)
            if reached[0] <= value:
                break
            step = 0.5 * step
        else:
            return value, theta, information  # no step raises the likelihood: rounding
        moved = np.abs(further - theta)
        theta, (value, slope, information) = further, reached
        if np.all(moved <= SETTLED * theta):
            return value, theta, information
    raise EstimationError(
        f"the random walk did not converge in {ITERATIONS} steps: give fewer unknowns, or more references"
    )


def _likelihood(theta: np.ndarray, blocks: list[tuple]) -> tuple[float, np.ndarray, np.ndarray]:
    """Minus the logarithm of the restricted likelihood, its gradient, and the expected information (2, 2)."""
    value, slope, information = 0.0, np.zeros(2), np.zeros((2, 2))
    for d, gap, noise, unit in blocks:
        covariance = theta[0] * np.diag(gap) + theta[1] * unit + noise
        sign, logarithm = np.linalg.slogdet(covariance)
        if sign <= 0.0:  # nothing is left of a covariance without noise and walk
            return float("inf"), slope, information
        inverse = np.linalg.inv(covariance)
        w = inverse @ d
        value += 0.5 * (float(d @ w) + float(logarithm))
        parts = (inverse * gap, inverse @ unit)
        slope += 0.5 * np.array([np.trace(parts[0]) - w @ (gap * w), np.trace(parts[1]) - w @ unit @ w])
        information += 0.5 * np.array([[np.sum(a * b.T) for b in parts] for a in parts])
    return value, slope, information
