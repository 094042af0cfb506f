"""Diagnosis of a network in one line: pieces, floating points, contradictory observations."""

from collections.abc import Callable
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.special import chdtrc

from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.status import CONVERGED, AdjustmentOutcome, Status
from catseye.estimation.network.cures import EXCHANGE_ALL, Adjust, reason
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork, label, points_of
from catseye.estimation.shapes.rigid_body import closed_form

PIECES = "the network is in {count} pieces that no observation joins: {pieces}; observe between them, \
or hold {loose}"
FLOATS = "{points} floats; {advice}"
CONTRADICTS = "the observations contradict each other: variance factor {factor:.3g} with \
{degrees:.0f} degrees of freedom, worst {worst}{guess}"
TIED_BY_PARAMETERS = ("rigid_body", "frame_point", "tilt", "joint")  # kinds whose points are connected by a pose
DATUM_EXCHANGED = "{first} and {second} appear exchanged: the datum's coordinates fit the measured \
shape to {misfit:.3g} m, with the two exchanged to {best:.3g} m; exchange them, or take them out of the datum"
DISPLACED = 0.01  # of the network's size: a worse fit of the datum coordinates is investigated
EXCHANGED_BACK = 0.1  # of the misfit: below it after the correct exchange
LIKELY = 1e-6  # probability of [pvv] below which, with the next two, observations are contradictory
GROSS_FACTOR, GROSS_TEST = 9.0, 10.0  # variance factor, |w|: above what wrong weights would explain


def pieces_of(network: ObservationNetwork) -> np.ndarray:
    """Index (n,) of the connected piece of each point."""
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
    return np.asarray(np.unique(label, return_inverse=True)[1])


def unconnected(network: ObservationNetwork, afloat: Callable[[np.ndarray], bool]) -> Status | None:
    """Status of a disconnected network.

    None if connected, or if each piece is held by itself.

    afloat   True if a piece of the network, (n,) bool of its points, can move as a whole
    """
    label = pieces_of(network)
    number = int(label.max(initial=-1)) + 1
    if number < 2:
        return None
    pieces = sorted((label == k for k in range(number)), key=np.count_nonzero)
    loose = [piece for piece in pieces if afloat(piece)]
    if not loose:
        return None
    text = " | ".join(_members(network, piece) for piece in pieces[:4]) + (" | ..." if number > 4 else "")
    which = "each" if len(loose) == number else f"that of {_members(network, loose[0])}"
    return Status(AdjustmentOutcome.RANK_DEFICIENT, PIECES.format(count=number, pieces=text, loose=which))


def _members(network: ObservationNetwork, piece: np.ndarray) -> str:
    names = [network.points.names[i] for i in np.flatnonzero(piece)]
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def floating_status(network: ObservationNetwork, solution: LeastSquaresSolution) -> Status:
    """Status of a floating solution: points, reason and remedy."""
    names, count = network.points.names, len(network.points.names)
    directions = solution.floating
    part = np.sum(directions**2, axis=0)
    by_point = part[: 3 * count].reshape(-1, 3).sum(axis=1)
    worst = [int(i) for i in np.argsort(-by_point, kind="stable") if by_point[i] > 1e-2 * max(part.max(), 1e-300)]
    floating_parameters = [p.name for k, p in enumerate(network.parameters) if part[3 * count + k] > 1e-2 * part.max()]
    if not worst:
        floating = ", ".join(floating_parameters[:4])
        return Status(
            AdjustmentOutcome.RANK_DEFICIENT,
            FLOATS.format(points=floating, advice="observe it, hold it, or give it a prior"),
        )
    observations = _observations_at(network, worst[:4])
    words = [
        f"{names[i]} ({number} observations)" if number != 1 else f"{names[i]} (1 observation)"
        for i, number in zip(worst[:4], observations, strict=True)
    ]
    text = ", ".join(words) + (f" and {len(worst) - 4} more" if len(worst) > 4 else "")
    if floating_parameters:
        text += f", with {', '.join(floating_parameters[:3])},"
    return Status(
        AdjustmentOutcome.RANK_DEFICIENT, FLOATS.format(points=text, advice=_advice(network, solution, worst[0]))
    )


def _observations_at(network: ObservationNetwork, points: list[int]) -> list[int]:
    return [
        sum(int(np.any([end == i for end in points_of(g)], axis=0).sum()) for g in network.groups if points_of(g))
        for i in points
    ]


def _advice(network: ObservationNetwork, solution: LeastSquaresSolution, point: int) -> str:
    """Range to another point, or coordinate, that would best hold a floating point."""
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


def contradicted(solution: NetworkSolution) -> bool:
    """True if a solution did not converge, or its observations are grossly contradictory.

    Grossly: the a-priori chi-square test fails at one in a million and either the variance factor exceeds 9, which
    wrong weights hardly explain, or a test statistic exceeds 10. Smaller contradictions are reported as suspects.
    """
    factor, degrees = solution.variance_factor, solution.degrees_of_freedom
    if not degrees > 0.5:
        return False
    largest = max((float(t.max(initial=0.0)) for t in _tests(solution)), default=0.0)
    gross = chdtrc(degrees, factor * degrees) < LIKELY and (factor > GROSS_FACTOR or largest > GROSS_TEST)
    return bool(gross) or solution.status != CONVERGED


def _tests(solution: NetworkSolution) -> list[np.ndarray]:
    return [np.where(f.active & (f.redundancy > 1e-6), np.abs(f.standardised), 0.0) for f in solution.fits]


def diagnosed(solution: NetworkSolution, adjust: Adjust | None) -> Status:
    """Status of a solution, with a diagnosis if not converged or grossly contradictory.

    solution   converged or not
    adjust     adjusts copies of the network, see `cures.reason`; None if weights are already inflated
    """
    if not solution.degrees_of_freedom > 0.5:
        return solution.status
    if not contradicted(solution):
        return _datum_exchanged(solution) or CONVERGED
    if solution.status != CONVERGED:
        cause = reason(solution, adjust)
        return solution.status.advised(cause.text if cause.named else solution.status.advice + cause.text)
    tests, network = _tests(solution), solution.network
    group = int(np.argmax([float(t.max(initial=0.0)) for t in tests]))
    row = int(np.argmax(tests[group]))
    unit = getattr(network.groups[group], "unit", "m")
    residual_text = f"{solution.fits[group].residual[row]:+.4g} {unit}, {tests[group][row]:.3g} standard deviations"
    detail = CONTRADICTS.format(
        factor=solution.variance_factor,
        degrees=solution.degrees_of_freedom,
        worst=f"{label(network, group, row)} (residual {residual_text})",
        guess=reason(solution, adjust).text,
    )
    return Status(AdjustmentOutcome.CONTRADICTED, detail)


def _datum_exchanged(solution: NetworkSolution) -> Status | None:
    """Status if the measured shape fits the datum coordinates only with two of them exchanged.

    No observation shows this: the network is consistent, but rotated and shifted by the wrong coordinates.
    """
    points = solution.network.points
    on = np.flatnonzero(points.datum.all(axis=1) & np.isfinite(points.xyz).all(axis=1))
    if not 4 <= len(on) <= EXCHANGE_ALL:
        return None
    x, reference = solution.x[on], points.xyz[on]
    size = float(np.linalg.norm(np.ptp(reference, axis=0)))
    misfit_given = _misfit(x, reference)
    if misfit_given < DISPLACED * size:
        return None
    best, i, j = np.inf, 0, 0
    for a, b in combinations(range(len(on)), 2):
        order = np.arange(len(on))
        order[[a, b]] = b, a
        misfit = _misfit(x, reference[order])
        if misfit < best:
            best, i, j = misfit, a, b
    if best > EXCHANGED_BACK * misfit_given:
        return None
    first, second = points.names[on[i]], points.names[on[j]]
    detail = DATUM_EXCHANGED.format(first=first, second=second, misfit=misfit_given, best=best)
    return Status(AdjustmentOutcome.CONTRADICTED, detail)


def _misfit(x: np.ndarray, reference: np.ndarray) -> float:
    """RMS departure, m, of points (n, 3) from reference points after the best rigid motion."""
    rotation, _ = closed_form(x, reference)
    off = (x - x.mean(axis=0)) @ rotation.T - (reference - reference.mean(axis=0))
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
