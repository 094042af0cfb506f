"""What is wrong with a network, in one line that names it: pieces, points that float, observations that contradict."""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.special import chdtrc

from catseye.estimation.least_squares.adjustment import CONVERGED, LeastSquaresSolution
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork, points_of
from catseye.estimation.shapes.rigid_body import closed_form

PIECES = "rank deficient: the network is in {count} pieces that no observation joins: {pieces}; observe between them, \
or hold each"
FLOATS = "rank deficient: {points} floats; {advice}"
CONTRADICTS = "converged, but the observations contradict each other: variance factor {factor:.3g} with \
{degrees:.0f} degrees of freedom, worst {worst}{guess}"
TIED_BY_PARAMETERS = ("rigid_body", "frame_point", "tilt", "joint")  # kinds whose points hang together by a pose
DATUM_EXCHANGED = "converged, but {first} and {second} lie at each other's given places: the datum's coordinates fit \
the measured shape to {now:.3g} m, with the two exchanged to {best:.3g} m; exchange them, or take them out of the datum"
DISPLACED = 0.01  # of the network's size: a worse fit of the datum's given coordinates is looked into
EXCHANGED_BACK = 0.1  # of the misfit, below which it falls when the right two are exchanged
LIKELY = 1e-6  # probability of [pvv] below which, with the next two, observations contradict
GROSS_FACTOR, GROSS_TEST = 9.0, 10.0  # variance factor, |w|: what wrong weights or a single blunder would not explain
EXCHANGE_FROM, EXCHANGE_GAIN = 1e3, 1e-2  # variance factor from which exchanged points are tried, and its fall if true
EXCHANGE_ALL = 300  # points up to which all pairs are tried
EXCHANGEABLE = 20  # points with the most observations, that are tried: 190 pairs


def unconnected(network: ObservationNetwork) -> str | None:
    """The status of a network in pieces; None where it is in one, or each piece is held by itself."""
    count = len(network.points.names)
    size = 3 * count + len(network.parameters)
    pairs = [np.stack([np.arange(3 * count) // 3 * 3, np.arange(3 * count)])]
    for group in network.groups:
        columns = np.broadcast_to(group.columns, (len(group.observed), group.columns.shape[-1]))
        alone = getattr(group, "kind", "") not in TIED_BY_PARAMETERS
        used = (columns >= 0) & ((columns < 3 * count) | (not alone))
        first = columns[np.arange(len(columns)), np.argmax(used, axis=1)][:, None]
        pairs.append(np.stack([np.broadcast_to(first, columns.shape)[used], columns[used]]))
    joined = np.concatenate(pairs, axis=1)
    graph = coo_array((np.ones(joined.shape[1]), (joined[0], joined[1])), shape=(size, size))
    label = connected_components(graph, directed=False)[1][: 3 * count : 3]
    _, label = np.unique(label, return_inverse=True)
    number = int(label.max(initial=-1)) + 1
    if number < 2:
        return None
    members = [[network.points.names[i] for i in np.flatnonzero(label == k)] for k in range(number)]
    members.sort(key=len)
    words = [", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "") for names in members]
    text = " | ".join(words[:4]) + (" | ..." if number > 4 else "")
    return PIECES.format(count=number, pieces=text)


def floating_text(network: ObservationNetwork, solution: LeastSquaresSolution) -> str:
    """The status of a solution in which something floats: which points, why, and what would hold them."""
    names, count = network.points.names, len(network.points.names)
    directions = solution.floating
    part = np.sum(directions**2, axis=0)
    own = part[: 3 * count].reshape(-1, 3).sum(axis=1)
    worst = [int(i) for i in np.argsort(-own, kind="stable") if own[i] > 1e-2 * max(part.max(), 1e-300)]
    others = [p.name for k, p in enumerate(network.parameters) if part[3 * count + k] > 1e-2 * part.max()]
    if not worst:
        return FLOATS.format(points=", ".join(others[:4]), advice="observe it, hold it, or give it a prior")
    observations = _observations_at(network, worst[:4])
    words = [
        f"{names[i]} ({number} observations)" if number != 1 else f"{names[i]} (1 observation)"
        for i, number in zip(worst[:4], observations, strict=True)
    ]
    text = ", ".join(words) + (f" and {len(worst) - 4} more" if len(worst) > 4 else "")
    if others:
        text += f", with {', '.join(others[:3])},"
    return FLOATS.format(points=text, advice=_advice(network, solution, worst[0]))


def _observations_at(network: ObservationNetwork, points: list[int]) -> list[int]:
    return [
        sum(int(np.any([end == i for end in points_of(g)], axis=0).sum()) for g in network.groups if points_of(g))
        for i in points
    ]


def _advice(network: ObservationNetwork, solution: LeastSquaresSolution, point: int) -> str:
    """The range to another point, or the coordinate, that would hold a floating point best."""
    count = len(network.points.names)
    x = solution.x[: 3 * count].reshape(-1, 3)
    raw = solution.floating[:, : 3 * count].reshape(-1, count, 3)
    direction = raw[np.argmax(np.sum(raw[:, point] ** 2, axis=1))]
    size = float(np.linalg.norm(direction[point])) or 1.0
    line = x - x[point]
    distance = np.linalg.norm(line, axis=1)
    with np.errstate(invalid="ignore"):
        gain = np.abs(np.sum(line * (direction - direction[point]), axis=1)) / distance / size
    gain = np.where(np.isfinite(gain), gain, 0.0)
    best = int(np.argmax(gain))
    axis = int(np.argmax(np.abs(direction[point])))
    towards = direction[point] / size
    text = f"it can move along ({towards[0]:+.2f}, {towards[1]:+.2f}, {towards[2]:+.2f})"
    if gain[best] > 0.1:
        return f"{text}: a range to {network.points.names[best]} would hold it, or its {network.axis_names[axis]}"
    return f"{text}: no range within the network would hold it, its {network.axis_names[axis]} or a height would"


def diagnosed(solution: NetworkSolution, solve: Callable[[ObservationNetwork], NetworkSolution]) -> str:
    """The status of a solution, which says more where it did not converge or its observations contradict grossly.

    solution   with an answer, converged or not
    solve      how to try the network with two points exchanged

    Grossly: the a-priori chi-square test fails at one in a million and either the variance factor exceeds 9, which
    wrong weights hardly explain, or a test statistic exceeds 10. Smaller contradictions are the suspects' business.
    """
    factor, degrees = solution.variance_factor, solution.degrees_of_freedom
    if not degrees > 0.5:
        return solution.status
    if solution.status != CONVERGED:
        return solution.status + _guess(solution, solve)
    tests = [np.where(f.active & (f.redundancy > 1e-6), np.abs(f.standardised), 0.0) for f in solution.fits]
    largest = [float(t.max(initial=0.0)) for t in tests]
    if not (chdtrc(degrees, factor * degrees) < LIKELY and (factor > GROSS_FACTOR or max(largest) > GROSS_TEST)):
        return _datum_exchanged(solution) or CONVERGED
    group = int(np.argmax(largest))
    row = int(np.argmax(tests[group]))
    fit, network = solution.fits[group], solution.network
    unit = getattr(network.groups[group], "unit", "m")
    shown = f"{fit.residual[row]:+.4g} {unit}, {tests[group][row]:.3g} standard deviations"
    worst = f"{label(network, group, row)} (residual {shown})"
    return CONTRADICTS.format(factor=factor, degrees=degrees, worst=worst, guess=_guess(solution, solve))


def label(network: ObservationNetwork, group: int, row: int) -> str:
    """What an observation is called: its kind, its points, and its place in the file."""
    kind = getattr(network.groups[group], "kind", network.groups[group].name).replace("_", " ")
    ends = [network.points.names[int(end[row])] for end in points_of(network.groups[group]) if end[row] >= 0]
    where = network.places[group][row] if network.places and network.places[group] else ""
    return f"{kind} {' - '.join(ends)}" + (f", {where}" if where else "")


def _datum_exchanged(solution: NetworkSolution) -> str | None:
    """The status where the shape that was measured fits the datum's given coordinates only with two of them exchanged.

    No observation shows that: the network is right in itself, and turned and shifted by the wrong coordinates.
    """
    points = solution.network.points
    on = np.flatnonzero(points.datum.all(axis=1) & np.isfinite(points.xyz).all(axis=1))
    if not 4 <= len(on) <= EXCHANGE_ALL:
        return None
    x, given = solution.x[on], points.xyz[on]
    size = float(np.linalg.norm(np.ptp(given, axis=0)))
    now = _misfit(x, given)
    if now < DISPLACED * size:
        return None
    best, i, j = np.inf, 0, 0
    for a, b in combinations(range(len(on)), 2):
        order = np.arange(len(on))
        order[[a, b]] = b, a
        misfit = _misfit(x, given[order])
        if misfit < best:
            best, i, j = misfit, a, b
    if best > EXCHANGED_BACK * now:
        return None
    first, second = points.names[on[i]], points.names[on[j]]
    return DATUM_EXCHANGED.format(first=first, second=second, now=now, best=best)


def _misfit(x: np.ndarray, given: np.ndarray) -> float:
    """Root mean square departure, m, of points (n, 3) from given ones after the best rigid motion."""
    rotation, _ = closed_form(x, given)
    off = (x - x.mean(axis=0)) @ rotation.T - (given - given.mean(axis=0))
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))


def _one_explains(solution: NetworkSolution) -> bool:
    """Whether all but a hundredth of [pvv] is due to a single observation: without it [pvv] would fall by its w^2."""
    largest = max(float(np.max(np.where(f.active, f.standardised**2, 0.0), initial=0.0)) for f in solution.fits)
    squares = solution.variance_factor * solution.degrees_of_freedom
    return solution.status == CONVERGED and squares - largest < EXCHANGE_GAIN * squares


def _guess(solution: NetworkSolution, solve: Callable[[ObservationNetwork], NetworkSolution]) -> str:
    """A guess, in words, at the cause: two points exchanged, or where most of the contradiction is."""
    network, names = solution.network, solution.network.points.names
    total, number = np.zeros(len(names)), np.zeros(len(names))
    for group, fit in zip(network.groups, solution.fits, strict=True):
        for end in points_of(group):
            used = (end >= 0) & fit.active
            total += np.bincount(end[used], (fit.residual[used] / fit.sigma[used]) ** 2, len(names))
            number += np.bincount(end[used], minlength=len(names))
    if solution.variance_factor > EXCHANGE_FROM and not _one_explains(solution):
        few = len(names) <= EXCHANGE_ALL
        likely = np.argsort(-number, kind="stable")[:EXCHANGEABLE]
        if not few:  # only the worst fitting of them, for the trials take long
            likely = likely[np.argsort(-total[likely] / number[likely])][:6]
        trials = []
        for i, j in combinations(sorted(int(k) for k in likely), 2):
            xyz, order = network.points.xyz.copy(), [j, i]
            xyz[[i, j]] = xyz[order]
            trial = solve(replace(network, points=replace(network.points, xyz=xyz)))
            if trial.variance_factor < EXCHANGE_GAIN * solution.variance_factor:
                trials.append((float(np.nansum((trial.x - xyz) ** 2)), i, j, trial.variance_factor))
        if trials:  # a symmetric network fits after other exchanges too, but far from the given coordinates
            _, i, j, factor = min(trials)
            return f"; with {names[i]} and {names[j]} exchanged the variance factor is {factor:.3g}"
    share = total / np.maximum(number, 1.0)
    stands = [names[i] for i in np.argsort(-share)[:2] if share[i] > 4.0 * np.median(share[number > 0])]
    return f"; most of it at {' and '.join(stands)}" if stands else ""
