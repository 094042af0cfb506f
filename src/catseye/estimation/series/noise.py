"""Noise of series that their claimed covariance leaves out, and readings that are outliers."""

from collections.abc import Callable

import numpy as np

from catseye.aliases import Array
from catseye.estimation.series.change import scan_steps
from catseye.estimation.series.correlated import SeriesGroup, SeriesNoise, fit_series

MOST_READINGS = 6_000  # whose likelihoods are added up: more change a common strength by a percent or two
BLOCKS = (2, 4, 8, 16, 32, 64)  # readings of a mean: its variance shows noise that lasts
SURE = 1.5  # standard deviations of that variance
LEAST_DEGREES = 8  # readings less coefficients: fewer tell no noise
LEAST_GAIN = 2.0  # of the log likelihood, by two parameters of a wander: the criterion of Akaike
PLENTY = 5000  # readings: of fewer, means of some tell too little whether noise lasts
SHORTEST = 2.0  # usual distances of two readings: a noise that lasts for less is as good as new in each
WORTH = 0.05  # of the readings' scatter: a smaller noise is none
WINDOW = 9  # readings of a running median
MAD = 1.4826  # from a median absolute deviation to a standard deviation of the normal distribution
MEDIAN_EXCESS = 1.10  # scatter about a median of nine, over that about the truth


def noise_of(group: SeriesGroup, functions: Array) -> SeriesNoise:
    """Common noise of all components of many series, by restricted maximum likelihood.

    group       the series; an even selection of them counts
    functions   (T, k) or (T, S, k)

    White alone unless a wander raises the likelihood more than by chance. No noise where readings are few.

    Source: [PATTERSON71]; the likelihoods of the series are added.
    """
    d = group.values.shape[2]
    if d > 1:  # each component as a series: what they share changes a common strength little
        single, wide = _by_component(group, functions)
        noise = noise_of(single, wide)
        return SeriesNoise.of(d, float(noise.white[0]), float(noise.wander[0]), float(noise.days[0]))
    at = _selection(group)
    part, rows = group.part(at), functions if functions.ndim == 2 else functions[:, at]
    fit = fit_series(part, rows, SeriesNoise.of(d))
    enough = fit.degrees_of_freedom >= LEAST_DEGREES
    if not enough.any():
        return SeriesNoise.of(d)
    at = np.flatnonzero(enough)
    part, rows = part.part(at), rows if rows.ndim == 2 else rows[:, at]
    scatter = _scatter(fit.residual[:, at])
    span = float(np.ptp(group.days)) if len(group.days) else 0.0
    step = float(np.median(np.diff(group.days))) if len(group.days) > 1 else 1.0

    def cost(white: float, wander: float, days: float) -> float:
        return -float(fit_series(part, rows, SeriesNoise.of(d, white, wander, days)).logarithm.sum())

    def white_cost(x: Array) -> float:
        return cost(scatter * float(np.exp(x[0])), 0.0, 1.0)

    whitest = _least(white_cost, [np.array([v]) for v in (-3.0, -1.0, 0.0)], size=0.5)
    white = scatter * float(np.exp(whitest[0]))
    best = min(cost(white, 0.0, 1.0), cost(0.0, 0.0, 1.0))
    if cost(0.0, 0.0, 1.0) - best < 0.5:
        white = 0.0
    plain = fit_series(part, rows, SeriesNoise.of(d, white)).residual
    if span < 4.0 * step or (plain.size > PLENTY and not _lasts(plain)):
        return SeriesNoise.of(d, white if white > WORTH * scatter else 0.0)

    def full_cost(x: Array) -> float:
        if not (np.log(SHORTEST * step) <= x[2] <= np.log(span) and max(x[:2]) < 3.0):
            return np.inf
        return cost(scatter * float(np.exp(x[0])), scatter * float(np.exp(x[1])), float(np.exp(x[2])))

    starts = [np.array([-0.7, -0.4, np.log(days)]) for days in (3.0 * step, np.sqrt(3.0 * step * span), 0.5 * span)]
    lasting = _least(full_cost, starts, size=0.7)
    if best - full_cost(lasting) < LEAST_GAIN:
        return SeriesNoise.of(d, white if white > WORTH * scatter else 0.0)
    strengths = scatter * np.exp(lasting[:2])
    return SeriesNoise.of(d, strengths[0] if strengths[0] > WORTH * scatter else 0.0, strengths[1], np.exp(lasting[2]))


def noise_beside_steps(group: SeriesGroup, functions: Array) -> SeriesNoise:
    """Common noise of series, the likeliest step of each taken out, so that steps are not noise that lasts.

    Arguments as for `noise_of`.
    """
    t, at = len(group.days), _selection(group)
    part = group.part(at)
    wide = functions[:, None] if functions.ndim == 2 else functions[:, at]
    rows = np.broadcast_to(wide, (t, len(at), functions.shape[-1]))
    _, scan = scan_steps(part, rows, SeriesNoise.of(group.values.shape[2]), limit=0.0)
    steps = (np.arange(t)[:, None] >= scan.at) & (scan.at >= 0)
    return noise_of(part, np.concatenate([rows, steps[:, :, None]], axis=2))


def _by_component(group: SeriesGroup, functions: Array) -> tuple[SeriesGroup, Array]:
    """Components of some series as series of their own, with their functions."""
    at = _selection(group)
    part, rows = group.part(at), functions if functions.ndim == 2 else functions[:, at]
    t, s, d = part.values.shape
    variance = np.einsum("tsii->tsi", part.covariance).reshape(t, s * d, 1, 1)
    wide = rows if rows.ndim == 2 else np.repeat(rows, d, axis=1)
    return SeriesGroup(part.days, part.values.reshape(t, s * d, 1), variance), wide


def _selection(group: SeriesGroup) -> np.ndarray:
    """Indices of series for the noise, evenly chosen."""
    t, s, d = group.values.shape
    most = min(s, max(1, MOST_READINGS // max(t * d, 1)))
    return np.unique(np.linspace(0, s - 1, most).astype(int)) if s else np.arange(0)


def _lasts(residual: Array) -> bool:
    """True if means of successive residuals scatter more than independent ones would."""
    flat = residual.reshape(len(residual), -1)
    known = np.isfinite(flat)
    unit = np.where(known, flat, 0.0) / _scatter_each(flat)
    for size in BLOCKS:
        count = len(unit) // size
        if count < 2:
            return False
        sums = unit[: count * size].reshape(count, size, -1).sum(axis=1)
        binned = known[: count * size].reshape(count, size, -1).sum(axis=1)
        if not binned.any():
            return False
        ratio = float(np.sum(sums**2) / np.sum(binned))
        if ratio > 1.0 + SURE * np.sqrt(2.0 / sums.size):
            return True
    return False


def _scatter_each(flat: Array) -> Array:
    """Root mean square of each column, above 0."""
    known = np.isfinite(flat)
    square = np.where(known, flat, 0.0) ** 2
    return np.maximum(np.sqrt(square.sum(axis=0) / np.maximum(known.sum(axis=0), 1)), 1e-300)


def outliers(residual: Array, u: Array, *, probability: float) -> np.ndarray:
    """True (T, S) for residuals that depart from the running median of their series.

    residual      (T, S, d); NaN where there is none
    u             (T, S, d) their standard uncertainties; the scatter is at least theirs
    probability   that any of all residuals does without cause

    A step is no outlier: the median follows it. The scatter of each component is by the median of absolute deviations.
    """
    from scipy.special import ndtri

    away = (residual - running_median(residual)) / np.where(u > 0.0, u, np.nan)
    typical = np.nan_to_num(MAD * _median(np.abs(away)) / MEDIAN_EXCESS)
    count = max(int(np.isfinite(residual).sum()), 1)
    limit = -float(ndtri(min(0.5 * probability / count, 0.25)))
    with np.errstate(invalid="ignore"):
        far = np.abs(away) > limit * MEDIAN_EXCESS * np.maximum(typical, 1.0)
    return np.asarray(far.any(axis=2), dtype=bool)


def running_median(values: Array) -> Array:
    """Median (T, ...) of the nine readings about each time, missing ones passed over; fewer at the ends.

    Its window at the ends is the first or last nine.
    """
    t = len(values)
    width = min(WINDOW, t)
    result = np.full(values.shape, np.nan)
    flat, into = values.reshape(t, -1), result.reshape(t, -1)
    missing = ~np.isfinite(flat)
    for column in np.flatnonzero(missing.any(axis=0)):
        at = np.flatnonzero(~missing[:, column])
        if len(at):
            into[at, column] = _running(flat[at, column][:, None], min(width, len(at)))[:, 0]
    complete = np.flatnonzero(~missing.any(axis=0))
    if len(complete):
        into[:, complete] = _running(flat[:, complete], width)
    return result


def _running(values: Array, width: int) -> Array:
    """Running median (t, c) of complete columns."""
    half = width // 2
    windows = np.lib.stride_tricks.sliding_window_view(values, width, axis=0)
    middle = np.median(windows, axis=2)
    at = np.clip(np.arange(len(values)) - half, 0, len(middle) - 1)
    return middle[at]


def _median(values: Array) -> Array:
    """Median over time, missing values passed over; NaN without any."""
    ordered = np.sort(values, axis=0)  # NaN last
    count = np.isfinite(values).sum(axis=0)
    low = np.take_along_axis(ordered, np.maximum((count - 1) // 2, 0)[None], axis=0)[0]
    high = np.take_along_axis(ordered, np.maximum(count // 2, 0)[None].clip(0, len(values) - 1), axis=0)[0]
    return np.where(count > 0, 0.5 * (low + high), np.nan)


def _scatter(residual: Array) -> float:
    """Typical size of residuals, above 0."""
    size = np.abs(residual[np.isfinite(residual)])
    return max(MAD * float(np.median(size)) if len(size) else 0.0, 1e-12)


def _least(cost: Callable[[Array], float], starts: list[Array], *, size: float) -> Array:
    """Place of the least cost, from the best of some starts."""
    from scipy.optimize import minimize

    start = min(starts, key=cost)
    simplex = np.vstack([start, start + size * np.eye(len(start))])
    options = {"initial_simplex": simplex, "xatol": 0.05, "fatol": 0.3, "maxfev": 30 * len(start)}
    return minimize(cost, start, method="Nelder-Mead", options=options).x
