"""Causes of contradictory observations, each tested on a copy of the network.

A cause is named only if the network with its correction adjusts within the limits of its variance factor, and no other
correction with as few changes does. The network itself is not changed.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, cast

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.status import CONVERGED
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork, label, points_of
from catseye.estimation.observations.kinds import Distances, ObservationGroup
from catseye.estimation.quality.reliability import TOO_LARGE, global_test
from catseye.estimation.quality.robustness import MOST_INFLATION, SnoopingOptions, estimate_robustly, snoop

# Adjusts a copy: the network, and an inflation of its sigmas (none if None).
Adjust = Callable[[ObservationNetwork, Sequence[np.ndarray] | None], NetworkSolution]

LEVEL = 0.05  # of the limits of the variance factor, as printed in reports
EXCHANGE_FROM, EXCHANGE_GAIN = 1e3, 1e-2  # variance factor from which exchanges are tried, and its required reduction
EXCHANGE_ALL = 300  # points up to which all pairs and single observations are tried
EXCHANGEABLE = 20  # points with the most observations that are tried: 190 pairs
SEARCHED = 60  # points up to which several wrong observations are searched for: some hundred adjustments
SINGLES = 60  # observations with the largest residuals that are left out one at a time
MANY = 0.1  # of the observations: if more must be rejected, wrong weights are as likely
NAMED = 3  # observations in a sentence
NEARER = 10.0  # ratio of squares: of several exchanges that fit, the one closest to the given coordinates
HALF_TURN = 0.01  # rad from pi, within which an angle's error counts as half a turn
TURNING = ("direction", "angle", "azimuth")  # kinds with a sense of rotation
MIRRORED = "the sense of the horizontal angles is mirrored: reversed,"
EXCHANGED = "with {first} and {second} exchanged"
WITHOUT = "without {names}"
SCALED = "the distances are {ratio:.4g} times those between the given coordinates, as in {unit}: in metres"
UNITS = {"millimetres": 1e3, "centimetres": 1e2, "feet": 1.0 / 0.3048, "kilometres": 1e-3}  # of a metre
FEWEST_RATIOS = 3  # distances between points with given coordinates
NEAR_UNIT, SAME_RATIO = 0.02, 0.02  # of a ratio: to a unit's, and between its quartiles
OPPOSITE = "{names} is half a turn off: without it"


@dataclass(frozen=True)
class Cure:
    """Cause in words, number of changes, and variance factor after the correction."""

    text: str
    changes: int
    factor: float


@dataclass(frozen=True)
class NetworkReason:
    """End of a status, "" for none.

    `named` is True for a cause, False for a place.
    """

    text: str
    named: bool


def reason(solution: NetworkSolution, adjust: Adjust | None) -> NetworkReason:
    """Unique cause whose correction fits, or else the place of the largest contradiction.

    solution   with contradictory observations, or not converged
    adjust     adjusts copies of the network, without tests; None: no trials
    """
    if adjust is None:
        return NetworkReason(_where(solution), named=False)
    for scaled in _scaled(solution, adjust):  # no search among single observations, which would take long
        return NetworkReason(f"; {scaled.text} the variance factor is {scaled.factor:.3g}", named=True)
    cures = [*_mirrored(solution, adjust), *_exchanged(solution, adjust)]
    if not cures or solution.status != CONVERGED or _one_explains(solution):
        cures += _without_one(solution, adjust)
    cures = cures or list(_without_several(solution, adjust))
    if cures:
        least = min(cure.changes for cure in cures)
        best = [cure for cure in cures if cure.changes == least]
        if len(best) == 1:
            return NetworkReason(f"; {best[0].text} the variance factor is {best[0].factor:.3g}", named=True)
    return NetworkReason(_where(solution), named=False)


def fits(solution: NetworkSolution) -> bool:
    """True if the solution converged within the limits of its variance factor."""
    degrees = solution.degrees_of_freedom
    if solution.status != CONVERGED or not degrees > 0.5:
        return False
    return global_test(solution.variance_factor * degrees, degrees, LEVEL).outcome != TOO_LARGE


def turned_round(network: ObservationNetwork) -> ObservationNetwork | None:
    """Network with reversed horizontal angles, or None if it has none."""
    groups, any_turned = [], False
    for group in network.groups:
        turning = np.isin(np.asarray(getattr(group, "kinds", np.zeros(len(group.observed)))), TURNING)
        any_turned |= bool(turning.any())
        groups.append(_signed(group, np.where(turning, -1.0, 1.0)) if turning.any() else group)
    return replace(network, groups=tuple(groups)) if any_turned else None


def _signed(group: ObservationGroup, sign: np.ndarray) -> ObservationGroup:
    covariance = group.covariance
    if covariance.ndim == 2:
        covariance = covariance * np.outer(sign, sign)
    return cast(ObservationGroup, replace(cast(Any, group), observed=sign * group.observed, covariance=covariance))


def _scaled(solution: NetworkSolution, adjust: Adjust) -> Iterator[Cure]:
    """All distances in another unit than metres, by their ratio to the given coordinates."""
    network, ratios = solution.network, [np.zeros(0)]
    for group in network.groups:
        if isinstance(group, Distances):
            origin, target = points_of(group)[:2]
            given = np.linalg.norm(network.points.xyz[target] - network.points.xyz[origin], axis=1)
            ratios.append((group.observed / np.where(given > 0.0, given, np.nan))[np.isfinite(given) & (given > 0.0)])
    every = np.concatenate(ratios)
    if len(every) < FEWEST_RATIOS:
        return
    low, ratio, high = np.quantile(every, (0.25, 0.5, 0.75))
    for unit, size in UNITS.items():
        if abs(ratio / size - 1.0) < NEAR_UNIT and high - low < SAME_RATIO * ratio:
            groups = tuple(
                replace(group, observed=group.observed / size) if isinstance(group, Distances) else group
                for group in network.groups
            )
            trial = adjust(replace(network, groups=groups), None)
            if fits(trial):
                yield Cure(SCALED.format(ratio=ratio, unit=unit), 1, trial.variance_factor)


def _mirrored(solution: NetworkSolution, adjust: Adjust) -> Iterator[Cure]:
    turned = turned_round(solution.network)
    if turned is not None:
        trial = adjust(turned, None)
        if fits(trial):
            yield Cure(MIRRORED, 1, trial.variance_factor)


def _exchanged(solution: NetworkSolution, adjust: Adjust) -> Iterator[Cure]:
    """Exchange of two points with fixed or datum coordinates."""
    network, names = solution.network, solution.network.points.names
    if not solution.variance_factor > EXCHANGE_FROM or _one_explains(solution):
        return
    total, number = _by_point(solution)
    likely = np.argsort(-number, kind="stable")[:EXCHANGEABLE]
    if len(names) > EXCHANGE_ALL:  # only the worst fitting ones, as trials take long
        likely = likely[np.argsort(-total[likely] / np.maximum(number[likely], 1.0))][:6]
    marked = (network.points.fixed | network.points.datum).any(axis=1)
    trials = []
    for i, j in combinations(sorted(int(k) for k in likely), 2):
        if not (marked[i] or marked[j]) or np.any(network.points.absent[i] != network.points.absent[j]):
            continue
        xyz, order = network.points.xyz.copy(), [j, i]
        xyz[[i, j]] = xyz[order]
        trial = adjust(replace(network, points=replace(network.points, xyz=xyz)), None)
        if trial.variance_factor < EXCHANGE_GAIN * solution.variance_factor and fits(trial):
            trials.append((float(np.nansum((trial.x - xyz) ** 2)), i, j, trial.variance_factor))
    trials.sort()  # a symmetric network fits after other exchanges too, but far from the given coordinates
    if trials and (len(trials) == 1 or trials[1][0] > NEARER * trials[0][0]):
        _, i, j, factor = trials[0]
        yield Cure(EXCHANGED.replace("{first}", names[i]).replace("{second}", names[j]), 1, factor)


def _without_one(solution: NetworkSolution, adjust: Adjust) -> Iterator[Cure]:
    """Single observations whose removal reconciles the others, largest residual first."""
    network = solution.network
    if len(network.points.names) > EXCHANGE_ALL:
        return
    size = [np.where(f.active, np.abs(f.residual) / f.sigma, 0.0) for f in solution.fits]
    place = [(g, r) for g, part in enumerate(size) for r in range(len(part))]
    for k in np.argsort(-np.concatenate([[], *size]), kind="stable")[:SINGLES]:
        g, r = place[k]
        inflation = [np.ones(len(part)) for part in size]
        inflation[g][r] = np.inf
        trial = _tried(network, inflation, adjust)
        if trial is not None and fits(trial):
            error, unit = abs(trial.fits[g].residual[r]), np.asarray(getattr(network.groups[g], "units", [""]))
            opposite = unit[r % len(unit)] == "rad" and abs(error - np.pi) < HALF_TURN
            text = (OPPOSITE if opposite else WITHOUT).replace("{names}", label(network, g, r))
            yield Cure(text, 1, trial.variance_factor)


def _without_several(solution: NetworkSolution, adjust: Adjust) -> Iterator[Cure]:
    """Observations rejected by data snooping with a robust start, for small networks."""
    network = solution.network
    if len(network.points.names) > SEARCHED:
        return
    sizes = [len(g.observed) for g in network.groups]

    def solve(inflation: Sequence[np.ndarray]) -> Any:
        return adjust(network, inflation).fits

    try:
        start = estimate_robustly(solve, sizes, places=targets_of_ranges(network))
        options = SnoopingOptions(level=LEVEL)
        snooped = snoop(solve, sizes, options=options, start=start.rejected, doubtful=start.undecided)
    except EstimationError:  # the remainder does not determine the network
        return
    out = [(g, int(r)) for g, part in enumerate(snooped.rejected) for r in np.flatnonzero(part)]
    if not out or any(part.any() for part in snooped.undecided) or len(out) > max(2, MANY * sum(sizes)):
        return
    trial = _tried(network, [np.where(part, np.inf, 1.0) for part in snooped.rejected], adjust)
    if trial is not None and fits(trial):
        more = f" and {len(out) - NAMED} more" if len(out) > NAMED else ""
        named = ", ".join(label(network, g, r) for g, r in out[:NAMED]) + more
        yield Cure(WITHOUT.replace("{names}", named), len(out), trial.variance_factor)


def _tried(network: ObservationNetwork, inflation: list[np.ndarray], adjust: Adjust) -> NetworkSolution | None:
    """Trial adjustment; None if the remainder does not determine the network."""
    try:
        return adjust(network, inflation)
    except EstimationError:
        return None


def targets_of_ranges(network: ObservationNetwork) -> list[np.ndarray]:
    """Target of each range, -1 for other observations, for the search at single points."""
    return [points_of(g)[1] if isinstance(g, Distances) else np.full(len(g.observed), -1) for g in network.groups]


def inflation_of(rejected: Sequence[np.ndarray], undecided: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Factors on sigmas, one (m,) per group: infinite for rejected, large for undecided."""
    return [np.where(r, np.inf, np.where(u, MOST_INFLATION, 1.0)) for r, u in zip(rejected, undecided, strict=True)]


def _one_explains(solution: NetworkSolution) -> bool:
    """True if one observation causes 99 % of [pvv], which falls by its w^2 without it."""
    largest = max(float(np.max(np.where(f.active, f.standardised**2, 0.0), initial=0.0)) for f in solution.fits)
    squares = solution.variance_factor * solution.degrees_of_freedom
    return solution.status == CONVERGED and squares - largest < EXCHANGE_GAIN * squares


def _by_point(solution: NetworkSolution) -> tuple[np.ndarray, np.ndarray]:
    """Sum of squared residuals in sigmas, and number of observations, at each point (n,)."""
    count = len(solution.network.points.names)
    total, number = np.zeros(count), np.zeros(count)
    for group, fit in zip(solution.network.groups, solution.fits, strict=True):
        for end in points_of(group):
            used = (end >= 0) & fit.active
            total += np.bincount(end[used], (fit.residual[used] / fit.sigma[used]) ** 2, count)
            number += np.bincount(end[used], minlength=count)
    return total, number


def _where(solution: NetworkSolution) -> str:
    """Text naming the two points with the largest contradiction, if they stand out."""
    total, number = _by_point(solution)
    share = total / np.maximum(number, 1.0)
    usual = np.median(share[number > 0]) if np.any(number > 0) else np.inf
    names = [solution.network.points.names[i] for i in np.argsort(-share)[:2] if share[i] > 4.0 * usual]
    return f"; most of it at {' and '.join(names)}" if names else ""
