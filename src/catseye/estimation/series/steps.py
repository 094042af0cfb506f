"""All steps of many series: accepted one after another, noise estimated anew, each judged beside the others."""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.estimation.series.change import StepScan, scan_steps
from catseye.estimation.series.correlated import SeriesFit, SeriesGroup, SeriesNoise
from catseye.estimation.series.noise import noise_beside_steps, noise_of

PASSES = 6  # of scan and noise
MOST = 8  # steps of one series
ALIKE = 0.1  # of the noise: two estimates that differ by less are one


@dataclass(frozen=True, eq=False)
class SeriesStep:
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
    steps: tuple[SeriesStep, ...]
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

    Steps and noise that lasts explain the same readings: the search starts once from all as noise, once from the
    likeliest step of each series, and the better end by an information criterion is taken.

    >>> days = np.arange(60.0)
    >>> values = np.where(days < 30, 0.0, 1.0)[:, None, None] + 0.01 * np.sin(7.0 * days**2)[:, None, None]
    >>> group = SeriesGroup(days, values, np.full((60, 1, 1, 1), 1e-4))
    >>> found = fit_with_steps(group, np.ones((60, 1)), probability=1e-3)
    >>> [(step.at, round(float(step.size[0]), 1)) for step in found.steps]
    [(30, 1.0)]
    """
    if noise is not None:
        return _searched(group, functions, noise, probability, by_component=None)
    quiet = _noise(group, functions, by_component=by_component)
    found = _searched(group, functions, quiet, probability, by_component=by_component)
    sharp = _noise(group, functions, by_component=by_component, beside=True)
    if _alike(quiet, sharp):
        return found
    other = _searched(group, functions, sharp, probability, by_component=by_component)
    return min((found, other), key=lambda one: _criterion(one, group, probability))


def _searched(
    group: SeriesGroup, functions: Array, noise: SeriesNoise, probability: float, *, by_component: bool | None
) -> SteppedFit:
    """Fit whose steps are found from a noise at first, which is then estimated anew; None: it stays."""
    using = noise
    times: list[tuple[int, ...]] = [()] * group.values.shape[1]
    for _ in range(PASSES):
        _, scan = _scan(group, functions, times, using, probability)
        new = {int(i) for i in np.flatnonzero(scan.probability < probability) if len(times[i]) < MOST}
        extended = [
            tuple(sorted({*accepted, int(scan.at[i])})) if i in new else accepted for i, accepted in enumerate(times)
        ]
        if by_component is not None and extended != times:
            using = _noise(group, _rows(group, functions, extended), by_component=by_component)
        checked = _confirmed(group, functions, extended, using, probability)
        if checked == times:
            break
        times = checked
    fit, scan = _scan(group, functions, times, using, probability)
    return SteppedFit(fit, using, _steps(group, functions, times, using, probability), scan)


def _alike(one: SeriesNoise, other: SeriesNoise) -> bool:
    """True if two noises differ by too little to matter for steps."""
    total = np.hypot(np.hypot(one.white, one.wander), np.hypot(other.white, other.wander))
    near = np.abs(one.wander - other.wander) <= ALIKE * total
    return bool(np.all(near & (np.abs(one.white - other.white) <= ALIKE * total)))


def _criterion(found: SteppedFit, group: SeriesGroup, probability: float) -> float:
    """Bayesian information criterion: steps against a noise that lasts.

    A step costs its components, its time, and the odds against one in a series.

    Source: [SCHWARZ78].
    """
    t, _, d = group.values.shape
    logarithm = np.log(max(d * int(group.present.sum()), 2))
    steps = len(found.steps) * (d * logarithm + 2.0 * np.log(t) - 2.0 * np.log(probability))
    strengths = 2 * int(np.count_nonzero(found.noise.wander)) + int(np.count_nonzero(found.noise.white))
    return float(steps + strengths * logarithm - 2.0 * found.fit.likelihood.sum())


def _noise(group: SeriesGroup, functions: Array, *, by_component: bool, beside: bool = False) -> SeriesNoise:
    estimate = noise_beside_steps if beside else noise_of
    if not by_component:
        return estimate(group, functions)
    parts = [
        estimate(
            SeriesGroup(group.days, group.values[..., i : i + 1], group.covariance[..., i : i + 1, i : i + 1]),
            functions,
        )
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
    for i, accepted in enumerate(times):
        for column, at in enumerate(accepted):
            steps[at:, i, column] = 1.0
    return np.concatenate([np.broadcast_to(functions[:, None], (t, s, functions.shape[1])), steps], axis=2)


def _scan(
    group: SeriesGroup, functions: Array, times: list[tuple[int, ...]], noise: SeriesNoise, probability: float
) -> tuple[SeriesFit, StepScan]:
    """Scan of all series, each beside its own steps; the fit has the functions' coefficients alone."""
    k, d = functions.shape[1], group.values.shape[2]
    found: list[tuple[np.ndarray, SeriesFit, StepScan]] = []
    for count in sorted({len(accepted) for accepted in times}):
        at = np.array([i for i, accepted in enumerate(times) if len(accepted) == count])
        part = group.part(at)
        rows = _rows(part, functions, [times[i] for i in at])
        fit, scan = scan_steps(part, rows, noise, limit=probability)
        sizes = {"coefficients": fit.coefficients[:, :k], "covariance": fit.covariance[:, : k * d, : k * d]}
        found.append((at, SeriesFit(**{**vars(fit), **sizes}), scan))
    order = np.argsort(np.concatenate([at for at, _, _ in found]))

    def joined(values: list[SeriesFit] | list[StepScan]) -> dict[str, Array]:
        axes = {"residual": 1, "profile": 1}
        return {
            name: np.take(
                np.concatenate([vars(v)[name] for v in values], axis=(axis := axes.get(name, 0))), order, axis
            )
            for name in vars(values[0])
        }

    return SeriesFit(**joined([fit for _, fit, _ in found])), StepScan(**joined([scan for _, _, scan in found]))


def _confirmed(
    group: SeriesGroup, functions: Array, times: list[tuple[int, ...]], noise: SeriesNoise, probability: float
) -> list[tuple[int, ...]]:
    """Times of the steps that are significant, each beside the others of its series."""
    confirmed: list[tuple[int, ...]] = [()] * len(times)
    for i, accepted in enumerate(times):
        if accepted:
            part = group.part(np.array([i]))
            waiting = accepted
            while waiting:
                worst, at = max((_alone(part, functions, waiting, one, noise, probability)[0], one) for one in waiting)
                if worst < probability:
                    break
                waiting = tuple(one for one in waiting if one != at)
            confirmed[i] = waiting
    return confirmed


def _alone(
    part: SeriesGroup, functions: Array, accepted: tuple[int, ...], one: int, noise: SeriesNoise, probability: float
) -> tuple[float, StepScan]:
    """Probability of the best step beside all but one, and its scan."""
    others = tuple(at for at in accepted if at != one)
    _, scan = scan_steps(part, _rows(part, functions, [others]), noise, limit=probability)
    return float(scan.probability[0]), scan


def _steps(
    group: SeriesGroup, functions: Array, times: list[tuple[int, ...]], noise: SeriesNoise, probability: float
) -> tuple[SeriesStep, ...]:
    """Sizes of the accepted steps, fitted together."""
    k, d = functions.shape[1], group.values.shape[2]
    steps = []
    for i, accepted in enumerate(times):
        if not accepted:
            continue
        part = group.part(np.array([i]))
        fit, _ = scan_steps(part, _rows(part, functions, [accepted]), noise, limit=0.0)
        for column, at in enumerate(accepted):
            block = slice((k + column) * d, (k + column + 1) * d)
            steps.append(
                SeriesStep(
                    series=i,
                    at=at,
                    size=fit.coefficients[0, k + column],
                    covariance=fit.covariance[0, block, block],
                    probability=_alone(part, functions, accepted, at, noise, probability)[0],
                )
            )
    return tuple(steps)
