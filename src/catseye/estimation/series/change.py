"""Steps in series: the best time of a step in each, with a probability for all times together.

The statistic of a step at a time is F: squares that it explains per component, over the variance factor of what
remains. Its largest value over the times is judged by the improved Bonferroni inequality along the times,

    P(max > c) <= P(T_1 > c) + sum_t P(T_t <= c, T_(t+1) > c),

which is an upper bound for any dependence, and close, as neighbouring times share nearly all readings.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from catseye.aliases import Array
from catseye.estimation.series.correlated import (
    SeriesFit,
    SeriesGroup,
    SeriesNoise,
    filtered,
    solved,
    step_products,
    weighted_columns,
)

LEAST_EACH_SIDE = 4  # readings before and after a step: fewer are outliers
SEPARATE = 1e-6  # of a step's weight: what the functions leave of it; less is no step
CHUNK = 2**25  # numbers of one part's columns: 256 MB
NODES, ACROSS = 40, 24  # of the quadratures of a joint probability


@dataclass(frozen=True, eq=False)
class StepScan:
    """Best step of each of S series.

    at            (S,) index of the first reading after it; -1 where no time was possible
    step          (S, d)
    covariance    (S, d, d)
    statistic     (S,) F of d and `degrees` degrees of freedom
    degrees       (S,) of the variance left
    probability   (S,) of an equal or larger statistic at any time of the series, without a step; 1 or less
    profile       (T, S) statistic at each time
    """

    at: np.ndarray
    step: Array
    covariance: Array
    statistic: Array
    degrees: Array
    probability: Array
    profile: Array


def scan_steps(
    group: SeriesGroup, functions: Array, noise: SeriesNoise, *, limit: float = 1.0
) -> tuple[SeriesFit, StepScan]:
    """Fit of functions to many series, and the best step of each.

    Arguments as for `fit_series`. Works in parts, so that memory is bounded.

    limit   a probability that is certainly larger is bounded more coarsely, by the number of times

    Source: [WORSLEY83] (largest F of two-phase regressions), with the inequality of [WORSLEY82].
    """
    t, s, d = group.values.shape
    k = functions.shape[-1]
    wide = functions if functions.ndim == 3 else functions[:, None]
    wide = np.broadcast_to(wide, (t, s, k))
    size = max(1, CHUNK // max(1, t * d * (1 + k * d) * 4))
    parts = [np.arange(i, min(i + size, s)) for i in range(0, s, size)] or [np.arange(0)]
    forward = [_scanned(group.part(part), wide[:, part], noise, limit) for part in parts]
    fits, scans = [pair[0] for pair in forward], [pair[1] for pair in forward]
    axes = {"residual": 1, "profile": 1}

    def joined(values: list[SeriesFit] | list[StepScan]) -> dict[str, Array]:
        names = vars(values[0])
        return {name: np.concatenate([vars(v)[name] for v in values], axis=axes.get(name, 0)) for name in names}

    return SeriesFit(**joined(fits)), StepScan(**joined(scans))


def _scanned(group: SeriesGroup, functions: Array, noise: SeriesNoise, limit: float) -> tuple[SeriesFit, StepScan]:
    t, s, d = group.values.shape
    forward = filtered(group, functions, noise)
    fit, inverse = solved(group, functions, forward)
    own, following = step_products(forward)
    columns = weighted_columns(forward)
    suffix = np.cumsum(columns[::-1], axis=0)[::-1]  # of each time and all later ones
    theta = np.nan_to_num(fit.coefficients).reshape(s, -1)
    gradient = suffix[..., 0] - np.einsum("tsdm,sm->tsd", suffix[..., 1:], theta)
    shared = suffix[..., 1:] @ inverse
    information = own - shared @ np.swapaxes(suffix[..., 1:], 2, 3)
    information = 0.5 * (information + np.swapaxes(information, 2, 3))
    possible = _possible(group.present) & _separate(information, own)
    covariance = np.linalg.inv(np.where(possible[:, :, None, None], information, np.eye(d)))
    explained = np.einsum("tsi,tsij,tsj->ts", gradient, covariance, gradient)
    degrees = np.maximum(fit.degrees_of_freedom - d, 0)
    remaining = np.maximum(fit.pvv - explained, 1e-12 * np.maximum(fit.pvv, 1e-300))
    with np.errstate(divide="ignore", invalid="ignore"):
        profile = np.where(possible & (degrees > 0), (explained / d) / (remaining / degrees), 0.0)
    best = np.argmax(profile, axis=0) if t else np.zeros(s, int)
    rows = np.arange(s)
    statistic = profile[best, rows]
    single = _single(statistic, degrees, d)
    probability = np.minimum(1.0, single * np.maximum(possible.sum(axis=0), 1))
    probability[statistic <= 0.0] = 1.0
    for i in np.flatnonzero((probability < 1.0) & (single < limit)):
        cross = following[:-1, i] - shared[:-1, i] @ np.swapaxes(suffix[1:, i, :, 1:], 1, 2)
        probability[i] = largest_probability(
            float(single[i]), d, _correlations(information[:, i], cross, possible[:, i], own[:, i])
        )
    step = np.einsum("sij,sj->si", covariance[best, rows], gradient[best, rows])
    none = statistic <= 0.0
    return fit, StepScan(
        at=np.where(none, -1, best),
        step=np.where(none[:, None], 0.0, step),
        covariance=covariance[best, rows],
        statistic=statistic,
        degrees=degrees.astype(float),
        probability=probability,
        profile=profile,
    )


def _possible(present: np.ndarray) -> np.ndarray:
    """True (T, S) where enough readings lie on both sides, and one at the time itself."""
    before = np.cumsum(present, axis=0) - present
    after = present.sum(axis=0) - before
    return present & (before >= LEAST_EACH_SIDE) & (after >= LEAST_EACH_SIDE)


def _separate(information: Array, own: Array) -> np.ndarray:
    """True (T, S) where the functions leave something of a step in every component."""
    if information.shape[-1] == 1:
        return information[..., 0, 0] > SEPARATE * own[..., 0, 0]
    scale = np.einsum("tsii->ts", own)
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.linalg.eigvalsh(np.where(scale[..., None, None] > 0.0, information / scale[..., None, None], 0.0))
    return least[..., 0] > SEPARATE


def _single(statistic: Array, degrees: Array, d: int) -> Array:
    """Probability (S,) of a larger statistic at one time."""
    from scipy.special import betainc

    n = np.maximum(degrees, 1)
    return betainc(0.5 * n, 0.5 * d, n / (n + d * np.maximum(statistic, 0.0)))


def _correlations(information: Array, cross: Array, possible: np.ndarray, own: Array) -> Array:
    """Least canonical correlations of the statistics at successive possible times.

    information   (T, d, d)
    cross         (T - 1, d, d) of each time with the next
    own           (T, d, d) before the functions took their part

    Where a time between is not possible, its statistics count as independent: an upper bound.
    """
    d = information.shape[-1]
    values: list[float] = []
    for i, j in pairwise(np.flatnonzero(possible).tolist()):
        if j != i + 1:
            values.append(0.0 if _changed(own, i, j) else 1.0)
            continue
        remainder, right = np.linalg.cholesky(information[i]), np.linalg.cholesky(information[j])
        inner = np.linalg.solve(remainder, cross[i])
        inner = np.linalg.solve(right, inner.T)
        values.append(float(np.linalg.svd(inner.reshape(d, d), compute_uv=False)[-1]))
    return np.array(values)


def _changed(own: Array, i: int, j: int) -> bool:
    """True if readings lie between two times, or the weights differ."""
    return not np.allclose(own[i + 1], own[j], rtol=1e-9)


def largest_probability(single: float, d: int, correlations: Array) -> float:
    """Upper bound of the probability that any of n chi-squares exceeds a limit.

    single         probability of one of them
    d              degrees of freedom of each
    correlations   (n - 1,) canonical correlation of each with the next, in all d components

    Source: [WORSLEY82]; the joint probabilities by quadrature over the first of two.

    >>> round(largest_probability(0.001, 1, np.zeros(9)), 5), round(largest_probability(0.001, 1, np.ones(9)), 5)
    (0.00999, 0.001)
    """
    from scipy.special import chdtri, ndtr, roots_genlaguerre
    from scipy.stats import chi2

    if single >= 1.0 or single <= 0.0:
        return min(max(single, 0.0), 1.0)
    limit = float(chdtri(d, single))
    rho = np.clip(np.asarray(correlations, dtype=float), 0.0, 1.0 - 1e-9)
    if not len(rho):
        return single
    spread = np.sqrt(1.0 - rho**2)  # of the second's root given the first's
    root = np.sqrt(limit)
    reach = np.minimum(root, 12.0 * spread + root * (1.0 - rho))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    first = root - 0.5 * reach[:, None] * (nodes + 1.0)
    density = 2.0 * first * chi2.pdf(first**2, d) * 0.5 * reach[:, None] * weights
    # The second is rho times the first along its direction, and noise: one component along, d - 1 across.
    across, share = roots_genlaguerre(ACROSS, 0.5 * (d - 3)) if d > 1 else (np.zeros(1), np.ones(1))
    share = share / share.sum()
    remainder = limit - 2.0 * across * spread[:, None, None] ** 2
    edge = np.sqrt(np.maximum(remainder, 0.0)) / spread[:, None, None]
    along = (rho[:, None] * first / spread[:, None])[..., None]
    over = np.where(remainder > 0.0, ndtr(along - edge) + ndtr(-along - edge), 1.0) @ share
    joint = np.sum(density * over, axis=1)
    return float(min(1.0, single + np.minimum(joint, single).sum()))
