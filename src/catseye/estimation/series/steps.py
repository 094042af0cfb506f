"""All steps of many series: accepted one after another, noise estimated anew, each judged beside the others."""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.estimation.series.change import StepScan, scan_steps
from catseye.estimation.series.correlated import SeriesFit, SeriesGroup, SeriesNoise
from catseye.estimation.series.noise import noise_beside_steps, noise_of

PASSES = 6  # of scan and noise
MOST = 8  # steps of one series


@dataclass(frozen=True, eq=False)
class Step:
    """Step of one series.

    series        index of the series
    at            index of the first time after it
    size          (d,)
    covariance    (d, d)
    probability   of an equal or larger step at any time of this series, without a cause
    """

    series: int
    at: int
    size: Array
    covariance: Array
    probability: float


@dataclass(frozen=True, eq=False)
class SteppedFit:
    """Fit of many series with their steps.

    fit     its first k functions are those of the fit
    noise   beyond the claimed covariance
    steps   by series and time
    scan    of what is left: the next step of each series, not accepted
    """

    fit: SeriesFit
    noise: SeriesNoise
    steps: tuple[Step, ...]
    scan: StepScan

    def level(self, days: int) -> Array:
        """Sum (T, S, d) of the steps at each of `days` times."""
        level = np.zeros((days, *self.fit.coefficients.shape[::2]))
        for step in self.steps:
            level[step.at :, step.series] += step.size
        return level


def fit_with_steps(
    group: SeriesGroup,
    functions: Array,
    *,
    probability: float,
    noise: SeriesNoise | None = None,
    by_component: bool = False,
) -> SteppedFit:
    """Fit of functions and of significant steps to many series.

    group          the series
    functions      (T, k)
    probability    of a step without cause, for each series
    noise          known; None: estimated, common to the series
    by_component   estimate the noise of each component of a reading by itself: for motions of a body

    >>> days = np.arange(60.0)
    >>> values = np.where(days < 30, 0.0, 1.0)[:, None, None] + 0.1 * np.sin(7.0 * days**2)[:, None, None]
    >>> group = SeriesGroup(days, values, np.full((60, 1, 1, 1), 0.01))
    >>> found = fit_with_steps(group, np.ones((60, 1)), probability=1e-3)
    >>> [(step.at, round(float(step.size[0]), 1)) for step in found.steps]
    [(30, 1.0)]
    """
    s = group.values.shape[1]
    known = noise is not None
    using = noise if noise is not None else _noise(group, functions, by_component=by_component, first=True)
    times: list[tuple[int, ...]] = [()] * s
    for _ in range(PASSES):
        _, scan = _scan(group, functions, times, using, probability)
        new = [i for i in np.flatnonzero(scan.probability < probability) if len(times[i]) < MOST]
        extended = [tuple(sorted({*times[i], int(scan.at[i])})) if i in set(new) else times[i] for i in range(s)]
        if not known:
            using = _noise(group, _rows(group, functions, extended), by_component=by_component)
        checked = _confirmed(group, functions, extended, using, probability)
        if checked == times:
            break
        times = checked
    fit, scan = _scan(group, functions, times, using, probability)
    return SteppedFit(fit, using, _steps(group, functions, times, using, probability), scan)


def _noise(group: SeriesGroup, functions: Array, *, by_component: bool, first: bool = False) -> SeriesNoise:
    estimate = noise_beside_steps if first else noise_of
    if not by_component:
        return estimate(group, functions)
    parts = [
        estimate(SeriesGroup(group.days, group.values[..., i : i + 1], group.covariance[..., i : i + 1, i : i + 1]), functions)
        for i in range(group.values.shape[2])
    ]
    return SeriesNoise(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("white", "wander", "days")))


def _rows(group: SeriesGroup, functions: Array, times: list[tuple[int, ...]]) -> Array:
    """Functions with steps of each series, (T, S, k + most steps), or (T, k) without any."""
    most = max(map(len, times), default=0)
    if not most:
        return functions
    t, s, _ = group.values.shape
    steps = np.zeros((t, s, most))
    for i, own in enumerate(times):
        for column, at in enumerate(own):
            steps[at:, i, column] = 1.0
    return np.concatenate([np.broadcast_to(functions[:, None], (t, s, functions.shape[1])), steps], axis=2)


def _scan(
    group: SeriesGroup, functions: Array, times: list[tuple[int, ...]], noise: SeriesNoise, probability: float
) -> tuple[SeriesFit, StepScan]:
    """Scan of all series, each beside its own steps; the fit has the functions' coefficients alone."""
    k, d = functions.shape[1], group.values.shape[2]
    found: list[tuple[np.ndarray, SeriesFit, StepScan]] = []
    for count in sorted({len(own) for own in times}):
        at = np.array([i for i, own in enumerate(times) if len(own) == count])
        part = group.part(at)
        rows = _rows(part, functions, [times[i] for i in at])
        fit, scan = scan_steps(part, rows, noise, limit=probability)
        kept = {"coefficients": fit.coefficients[:, :k], "covariance": fit.covariance[:, : k * d, : k * d]}
        found.append((at, SeriesFit(**{**vars(fit), **kept}), scan))
    order = np.argsort(np.concatenate([at for at, _, _ in found]))

    def joined(values: list[SeriesFit] | list[StepScan]) -> dict[str, Array]:
        axes = {"residual": 1, "profile": 1}
        return {
            name: np.take(np.concatenate([vars(v)[name] for v in values], axis=(axis := axes.get(name, 0))), order, axis)
            for name in vars(values[0])
        }

    return SeriesFit(**joined([fit for _, fit, _ in found])), StepScan(**joined([scan for _, _, scan in found]))


def _confirmed(
    group: SeriesGroup, functions: Array, times: list[tuple[int, ...]], noise: SeriesNoise, probability: float
) -> list[tuple[int, ...]]:
    """Times of the steps that are significant, each beside the others of its series."""
    confirmed = [()] * len(times)
    for i, own in enumerate(times):
        if own:
            part = group.part(np.array([i]))
            rest = own
            while rest:
                worst, at = max((_alone(part, functions, rest, one, noise, probability)[0], one) for one in rest)
                if worst < probability:
                    break
                rest = tuple(one for one in rest if one != at)
            confirmed[i] = rest
    return confirmed


def _alone(
    part: SeriesGroup, functions: Array, own: tuple[int, ...], one: int, noise: SeriesNoise, probability: float
) -> tuple[float, StepScan]:
    """Probability of the best step beside all but one, and its scan."""
    others = tuple(at for at in own if at != one)
    _, scan = scan_steps(part, _rows(part, functions, [others]), noise, limit=probability)
    return float(scan.probability[0]), scan


def _steps(
    group: SeriesGroup, functions: Array, times: list[tuple[int, ...]], noise: SeriesNoise, probability: float
) -> tuple[Step, ...]:
    """Sizes of the accepted steps, fitted together."""
    k, d = functions.shape[1], group.values.shape[2]
    steps = []
    for i, own in enumerate(times):
        if not own:
            continue
        part = group.part(np.array([i]))
        fit, _ = scan_steps(part, _rows(part, functions, [own]), noise, limit=0.0)
        for column, at in enumerate(own):
            block = slice((k + column) * d, (k + column + 1) * d)
            steps.append(
                Step(
                    series=i,
                    at=at,
                    size=fit.coefficients[0, k + column],
                    covariance=fit.covariance[0, block, block],
                    probability=_alone(part, functions, own, at, noise, probability)[0],
                )
            )
    return tuple(steps)
