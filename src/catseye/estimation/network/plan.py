"""Network planning: predicted uncertainties, weak points and best next ranges.

Based on geometry and claimed standard uncertainties only; no observed value is used.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.covariance import LARGEST_MATRIX
from catseye.estimation.least_squares.rows import variances
from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.network.datum import with_datum
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork, points_of
from catseye.estimation.observations.kinds import Distances, ObservationGroup

MOST_RANGES = 1000  # of a schedule
BATCH = 200  # ranges per batch


@dataclass(frozen=True, eq=False)
class Plan:
    """Predicted quality of a network.

    solution      the network solved with its predicted observations: covariance, redundancy, detectable errors
    interest      (n,) bool: points whose mean variance is evaluated below
    mean_u        m, root of the mean variance of a coordinate of those points
    weakest       (n,) m, largest semi-axis of each point's standard ellipsoid
    direction     (n, 3) unit vector along it, upwards
    worth         one (m,) array a group: increase of mean_u without the observation, m; infinite if the network would
                  then be undetermined
    candidates    further ranges that could be measured, best first
    """

    solution: NetworkSolution
    interest: np.ndarray
    mean_u: float
    weakest: np.ndarray
    direction: np.ndarray
    worth: tuple[np.ndarray, ...]
    candidates: tuple["Candidate", ...]


@dataclass(frozen=True)
class Candidate:
    """Possible further range between two points.

    from_, to   names
    u           m, predicted standard uncertainty
    mean_u      m, of the points of interest with it; for a schedule, with it and all before it
    gain        m, reduction of mean_u
    at_s        s, time of completion; nan outside a schedule
    """

    from_: str
    to: str
    u: float
    mean_u: float
    gain: float
    at_s: float = float("nan")


def predicted(network: ObservationNetwork) -> ObservationNetwork:
    """Network with observations predicted from its points and parameters, and their sigmas.

    Observed values may be nan: not measured yet.
    Raises EstimationError if a point has no coordinates.
    """
    points = network.points
    unplaced = [points.names[i] for i in np.flatnonzero(points.unplaced.any(axis=1))]
    if unplaced:
        more = f" and {len(unplaced) - 4} more" if len(unplaced) > 4 else ""
        raise EstimationError(
            f"{', '.join(unplaced[:4])}{more}: no coordinates (expected approximate ones of every point, to plan with)"
        )
    x = np.concatenate([np.where(points.absent, 0.0, points.xyz).ravel(), [p.start for p in network.parameters]])
    groups = []
    for group, claim in zip(network.groups, network.claims or (None,) * len(network.groups), strict=True):
        near = replace(group, observed=np.nan_to_num(group.observed))  # type: ignore[type-var]
        values = near.predict(x)[0]
        if not np.isfinite(values).all():
            raise EstimationError(f"{group.name}: not defined at the planned coordinates; two points may coincide")
        covariance = _claimed(group, claim, np.abs(values))
        groups.append(replace(near, observed=values, covariance=covariance))  # type: ignore[type-var]
    return replace(network, groups=tuple(groups))


def _claimed(group: ObservationGroup, claim: np.ndarray | None, length: np.ndarray) -> np.ndarray:
    """Covariance of a group whose uncertainties depend on its lengths (m,), at the planned ones."""
    if claim is None or not claim[:, 1].any():
        return group.covariance
    a, b, c = claim.T
    larger = np.where(b > 0.0, (a + b * length**c) / np.sqrt(variances(group)), 1.0)
    if group.covariance.ndim == 1:
        return group.covariance * larger**2
    size = group.covariance.shape[-1]
    pairs = larger.reshape(-1, size)
    return group.covariance * (pairs[:, :, None] * pairs[:, None, :]).reshape(group.covariance.shape)


def plan(
    network: ObservationNetwork, *, datum: str | None = None, interest: Sequence[str] | None = None, most: int = 20
) -> Plan:
    """Predicted quality of a network, and the further ranges that improve it most.

    network    coordinates of all points; observed values are not used
    datum      as for `adjust_network`
    interest   names of the points of interest; all that are not held if None
    most       candidates to list

    Raises EstimationError if a point has no coordinates, or the planned network is undetermined, with its status.
    """
    problem = predicted(with_datum(network, datum))
    solution = adjust_network(problem)
    if not solution.answered:
        raise EstimationError(solution.status)
    chosen, existing = _interest(solution, interest), solution.network.points.existing
    blocks = np.where(existing[:, :, None] & existing[:, None, :], solution.covariance, 0.0)
    values, vectors = np.linalg.eigh(blocks)
    direction = vectors[:, :, 2] * np.where(vectors[:, 2:, 2] < 0.0, -1.0, 1.0)
    full = _full(solution)
    coordinates = _coordinates(solution, chosen)
    total = float(np.trace(full[np.ix_(coordinates, coordinates)]))
    return Plan(
        solution=solution,
        interest=chosen,
        mean_u=(total / len(coordinates)) ** 0.5,
        weakest=np.sqrt(np.maximum(values[:, 2], 0.0)),
        direction=direction,
        worth=_worth(solution, full, coordinates, total),
        candidates=_best(solution, full, coordinates, total, most),
    )


def schedule(
    chosen: Plan, *, budget_s: float, shot_s: float, most: int = MOST_RANGES, repeats: bool = True
) -> tuple[Candidate, ...]:
    """Ranges to add, in order, each the best after those before it, within the time of every ranger.

    budget_s   s, of every ranger; rangers work in parallel
    shot_s     s, of one range with slewing
    most       limit of ranges
    repeats    True: a measured or chosen pair may be measured again

    Greedy: each range is the one that lowers the mean variance most, given those before ([FEDOROV72] calls such
    steps sequential design). Source: rank-one update of the inverse, Sherman and Morrison 1950.
    """
    if not (budget_s > 0.0 and shot_s > 0.0):
        raise EstimationError(f"budget {budget_s:g} s, shot {shot_s:g} s (expected both above 0)")
    solution, names = chosen.solution, chosen.solution.network.points.names
    full = _full(solution).copy()
    coordinates = _coordinates(solution, chosen.interest)
    total = float(np.trace(full[np.ix_(coordinates, coordinates)]))
    pairs, sigma = _pairs(solution, repeats)
    spent, inside = np.zeros(len(names)), np.isin(np.arange(len(full)), coordinates)
    effect, variance = _effects(solution.x, full, coordinates, pairs)
    unit = _unit(solution.x, pairs) if len(pairs) else np.zeros((0, 3))
    open_ = np.full(len(pairs), shot_s <= budget_s)
    picked: list[Candidate] = []
    while len(picked) < most and open_.any():
        gains = np.where(open_, effect / (sigma**2 + variance), -1.0)
        best = int(np.argmax(gains))
        if gains[best] <= 1e-9 * total:
            break
        i, j = pairs[best]
        q, innovation_variance = _across(solution.x, full, pairs[best : best + 1])[0], sigma[best] ** 2 + variance[best]
        # Q becomes Q - q q' / innovation_variance; its effect on another pair follows from two numbers
        felt, common = (
            _onto_ranges(q, pairs, unit) / innovation_variance,
            _onto_ranges(full[:, inside] @ q[inside], pairs, unit),
        )
        effect = np.maximum(effect - 2.0 * felt * common + felt**2 * float(q[inside] @ q[inside]), 0.0)
        variance = np.maximum(variance - felt**2 * innovation_variance, 0.0)
        full -= np.outer(q, q / innovation_variance)
        before, total = total, total - float(gains[best])
        spent[i] += shot_s
        count = len(coordinates)
        after = (max(total, 0.0) / count) ** 0.5
        gain = (before / count) ** 0.5 - after
        picked.append(
            Candidate(from_=names[i], to=names[j], u=float(sigma[best]), mean_u=after, gain=gain, at_s=float(spent[i]))
        )
        open_ &= spent[pairs[:, 0]] + shot_s <= budget_s * (1.0 + 1e-12)
        open_[best] &= repeats
    return tuple(picked)


def _interest(solution: NetworkSolution, names: Sequence[str] | None) -> np.ndarray:
    points = solution.network.points
    if names is None:
        return np.asarray(points.free.any(axis=1))
    unknown = [name for name in names if name not in solution.index]
    if unknown:
        raise EstimationError(f"point {unknown[0]!r} is not in the network (expected one of its names)")
    chosen = np.zeros(len(points.names), dtype=bool)
    chosen[[solution.index[name] for name in names]] = True
    return chosen


def _coordinates(solution: NetworkSolution, chosen: np.ndarray) -> np.ndarray:
    """Columns of the free coordinates of some points (n,) bool."""
    free = solution.network.points.free & chosen[:, None]
    if not free.any():
        names = [solution.network.points.names[i] for i in np.flatnonzero(chosen)]
        raise EstimationError(f"{', '.join(names[:4]) or 'no point'}: every coordinate is held; nothing to plan")
    return np.flatnonzero(free)


def _full(solution: NetworkSolution) -> np.ndarray:
    """Full covariance matrix of all coordinates."""
    count = 3 * len(solution.network.points.names)
    if count > LARGEST_MATRIX:
        raise EstimationError(
            f"{count // 3} points are too many to evaluate every further range (limit {LARGEST_MATRIX // 3}); "
            "plan with the points of interest and the stations alone"
        )
    return solution.q.within(np.arange(count))


def _pairs(solution: NetworkSolution, repeats: bool) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (k, 2) of points that could be ranged, and predicted standard uncertainties (k,).

    Every point that ranges may range to every target. The uncertainty follows sigma^2 = a^2 + (b D)^2, fitted to the
    claims of the existing ranges.
    """
    network = solution.network
    ranges = [g for g in network.groups if isinstance(g, Distances)]
    if not ranges:
        return np.zeros((0, 2), dtype=int), np.zeros(0)
    origin, target = (np.concatenate([points_of(g)[k] for g in ranges]) for k in (0, 1))
    variance = np.concatenate([variances(g) for g in ranges])
    square = np.sum((solution.x[target] - solution.x[origin]) ** 2, axis=1)
    from scipy.optimize import nnls

    weight = 1.0 / variance
    model, _ = nnls(np.stack([weight, square * weight], axis=1), np.ones(len(weight)))
    pairs = np.stack(np.meshgrid(np.unique(origin), np.unique(target), indexing="ij"), axis=-1).reshape(-1, 2)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    if not repeats:
        count = len(network.points.names)
        pairs = pairs[~np.isin(pairs @ (count, 1), np.stack([origin, target], axis=1) @ (count, 1))]
    far = np.sum((solution.x[pairs[:, 1]] - solution.x[pairs[:, 0]]) ** 2, axis=1)
    return pairs, np.sqrt(model[0] + model[1] * far)


def _unit(x: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    along = x[pairs[:, 1]] - x[pairs[:, 0]]
    return along / np.linalg.norm(along, axis=1, keepdims=True)


def _across(x: np.ndarray, full: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Products Q a (k, n) of ranges between pairs."""
    unit = _unit(x, pairs)
    result = np.zeros((len(pairs), len(full)))
    for axis in range(3):
        result += (full[3 * pairs[:, 1] + axis] - full[3 * pairs[:, 0] + axis]) * unit[:, axis, None]
    return result


def _onto_ranges(vector: np.ndarray, pairs: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Products a'v (k,) of ranges between pairs, v over all coordinates."""
    v = vector.reshape(-1, 3)
    return np.sum(unit * (v[pairs[:, 1]] - v[pairs[:, 0]]), axis=1)


def _effects(
    x: np.ndarray, full: np.ndarray, coordinates: np.ndarray, pairs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """|(Q a)_I|^2 over some coordinates, and a'Qa, of each range between pairs.

    The quotient effect / (sigma^2 + variance) is the reduction of the sum of variances of these coordinates by that
    range.
    """
    effect, variance = np.empty(len(pairs)), np.empty(len(pairs))
    inside = np.zeros(len(full), dtype=bool)
    inside[coordinates] = True
    for low in range(0, len(pairs), BATCH):
        part = slice(low, low + BATCH)
        across, unit = _across(x, full, pairs[part]), _unit(x, pairs[part])
        moved, k = across.reshape(len(across), -1, 3), np.arange(len(across))
        variance[part] = np.sum(unit * (moved[k, pairs[part, 1]] - moved[k, pairs[part, 0]]), axis=1)
        effect[part] = np.sum(across[:, inside] ** 2, axis=1)
    return effect, variance


def _best(
    solution: NetworkSolution, full: np.ndarray, coordinates: np.ndarray, total: float, most: int
) -> tuple[Candidate, ...]:
    pairs, sigma = _pairs(solution, repeats=True)
    effect, variance = _effects(solution.x, full, coordinates, pairs)
    gains = effect / (sigma**2 + variance)
    names, count = solution.network.points.names, len(coordinates)
    current = (total / count) ** 0.5
    after = np.sqrt(np.maximum(total - gains, 0.0) / count)
    return tuple(
        Candidate(names[i], names[j], float(sigma[k]), float(after[k]), float(current - after[k]))
        for k in np.argsort(-gains, kind="stable")[:most]
        for i, j in [pairs[k]]
    )


def _worth(
    solution: NetworkSolution, full: np.ndarray, coordinates: np.ndarray, total: float
) -> tuple[np.ndarray, ...]:
    """Increase of the mean standard uncertainty without an observation, m: |(Q a)_I|^2 / (s^2 r)."""
    x = solution.state
    count, chosen = len(coordinates), np.ascontiguousarray(full[:, coordinates])
    if len(x) > len(full):  # parameters beside the points
        other_columns = solution.q.across(np.arange(len(full), len(x)))[coordinates]
        chosen = np.concatenate([chosen, other_columns.T])
    current = (total / count) ** 0.5
    result = []
    for group, fit in zip(solution.network.groups, solution.fits, strict=True):
        slopes = group.predict(x)[1]
        columns = np.broadcast_to(group.columns, slopes.shape)
        slopes, columns = np.where(columns < 0, 0.0, slopes), np.maximum(columns, 0)
        gained = np.empty(len(slopes))
        for low in range(0, len(slopes), BATCH):
            part = slice(low, low + BATCH)
            across = np.zeros((len(slopes[part]), count))
            for slope, at in zip(slopes[part].T, columns[part].T, strict=True):
                across += chosen[at] * slope[:, None]
            gained[part] = np.einsum("mc,mc->m", across, across)
        residual_variance = fit.sigma**2 * np.where(fit.redundancy > 1e-9, fit.redundancy, 0.0)
        with np.errstate(divide="ignore"):
            result.append(np.sqrt((total + gained / residual_variance) / count) - current)
    return tuple(result)
