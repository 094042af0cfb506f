"""Adapter of pure ranging networks to the block elimination of `multilateration`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import GroupFit, SolverSettings
from catseye.estimation.least_squares.status import CONVERGED, AdjustmentOutcome
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork
from catseye.estimation.network.multilateration.gauss_newton import adjust_ranges
from catseye.estimation.network.multilateration.network import RangingNetwork
from catseye.estimation.network.multilateration.solution import RangingSolution
from catseye.estimation.network.multilateration.terms import PointPriors, StationRanges
from catseye.estimation.network.ranging_covariance import RangingCovariance
from catseye.estimation.observations.kinds import Distances, ObservedCoordinates

FEWEST_POINTS = 200  # below it the dense form is as fast, with a better diagnosis
MOST_STATIONS = 600  # their parameters form a dense system


def adjusted_as_ranges(
    network: ObservationNetwork,
    *,
    active: Sequence[np.ndarray] | None,
    inflation: Sequence[np.ndarray] | None,
    start: NetworkSolution | None,
    solver: SolverSettings,
    forced: bool,
) -> NetworkSolution | None:
    """Solution of a ranging network.

    None if unsuitable, small, or without a solution.

    network      every group of ranges or of whole coordinates, each parameter one station's zero or scale
    active       as for `adjust_network`
    inflation    likewise
    start        an earlier solution
    solver       as for `adjust_network`
    forced       raise EstimationError for an unsuitable network instead of None, and keep a failed solution

    Without a solution the general engine is used, which gives the reason.
    """
    if not forced and len(network.points.names) < FEWEST_POINTS:
        return None
    absent = ("some of its coordinates do not exist", None)
    reason, split = absent if network.points.absent.any() else _split(network)
    if split is None:
        if forced:
            raise EstimationError(f"not a network for the ranging engine: {reason}; use another engine")
        return None
    problem = _problem(network, split, start)
    if isinstance(problem, str):
        if forced:
            raise EstimationError(problem)
        return None
    factors = _inflation(network, active, inflation, split)
    if factors is None:
        if forced:
            raise EstimationError("the ranging engine does not weigh coordinates robustly; use another engine")
        return None
    solution = adjust_ranges(problem[0], solver=solver, inflation=factors)
    if solution.status.outcome is AdjustmentOutcome.CONTRADICTORY:  # still a solution; `diagnosis` adds what and where
        solution = replace(solution, status=CONVERGED)
    if solution.status != CONVERGED and not forced:
        return None
    return _answer(network, split, solution, problem[1], factors)


@dataclass(frozen=True, eq=False)
class _Split:
    """Roles of the points (station or target) and rows of the ranges.

    station, target     (n,) index among stations, or targets; -1
    ranges              (group, rows) of the ranges from stations to targets
    between             likewise between stations
    priors              groups of coordinates
    zero, scale         (stations,) parameter or -1
    """

    station: np.ndarray
    target: np.ndarray
    ranges: list[tuple[int, np.ndarray]]
    between: list[tuple[int, np.ndarray]]
    priors: list[int]
    zero: np.ndarray
    scale: np.ndarray


def _split(network: ObservationNetwork) -> tuple[str, _Split | None]:
    """Roles of the points, or the reason why the network is unsuitable."""
    count = len(network.points.names)
    from_ = np.zeros(count, dtype=bool)
    gauge = {"zero": np.full(count, -1), "scale": np.full(count, -1)}
    plain, priors = [], []
    for k, group in enumerate(network.groups):
        if isinstance(group, ObservedCoordinates) and len(group.observed) % 3 == 0:
            shape = group.covariance.shape
            complete = np.array_equal(group.axis, np.tile(np.arange(3), len(group.axis) // 3))
            if complete and (len(shape) == 1 or shape[1:] == (3, 3) or shape == (3, 3)):
                priors.append(k)
                continue
        if not isinstance(group, Distances) or group.covariance.ndim != 1:
            return f"group {group.name!r} is not of independent ranges", None
        high = group.shift is not None and np.any(group.shift)
        if high or np.any(group.scale != 1.0) or np.any(group.offset != 0.0):
            return f"group {group.name!r} has heights, known scales or offsets", None
        for what, columns, factor in (
            ("zero", group.nuisance, group.coefficient),
            ("scale", group.scaling, group.scaling_coefficient),
        ):
            if columns is None or not columns.size:
                continue
            if columns.shape[1] > 1 or np.any(factor != 1.0):
                return f"group {group.name!r} has more than a zero and a scale", None
            parameter, origin = np.where(columns[:, 0] < 0, -1, columns[:, 0] - 3 * count), group.origin // 3
            gauge[what][origin] = parameter
            if np.any(gauge[what][origin] != parameter):
                return f"group {group.name!r}: a station has several {what}s", None
        from_[group.origin // 3] = True
        plain.append(k)
    used = np.concatenate([g[g >= 0] for g in gauge.values()])
    if len(np.unique(used)) != len(used) or len(used) != len(network.parameters):
        return "its parameters are not each one station's", None
    stations = int(from_.sum())
    if not plain or not stations or stations == count or stations > MOST_STATIONS:
        return f"{stations} of its {count} points range", None
    ranges, between = [], []
    for k in plain:
        inner = from_[network.groups[k].target // 3]  # type: ignore[attr-defined]
        at = network.groups[k].origin // 3  # type: ignore[attr-defined]
        if np.any(inner & ((gauge["zero"][at] >= 0) | (gauge["scale"][at] >= 0))):
            return "stations with a zero or a scale range to each other", None
        ranges.append((k, np.flatnonzero(~inner)))
        if inner.any():
            between.append((k, np.flatnonzero(inner)))
    return "", _Split(
        station=np.where(from_, np.cumsum(from_) - 1, -1),
        target=np.where(from_, -1, np.cumsum(~from_) - 1),
        ranges=ranges,
        between=between,
        priors=priors,
        zero=gauge["zero"][from_],
        scale=gauge["scale"][from_],
    )


def _problem(
    network: ObservationNetwork, split: _Split, start: NetworkSolution | None
) -> tuple[RangingNetwork, tuple[tuple[str, ...], tuple[str, ...]]] | str:
    """Ranging network with names of computed and of assumed points, or the reason why it cannot start."""
    points, groups = network.points, network.groups
    placed_by: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    if start is not None:
        placed_by = start.approximate, start.assumed
    xyz = points.xyz
    if not np.isfinite(xyz).all() or start is not None:
        if start is None:
            from catseye.estimation.network.approximate.start import approximate

            approximation = approximate(network)
            if approximation.missing:
                return f"no approximate coordinates of {next(iter(approximation.missing))}"
            placed, placed_by = approximation.xyz, (approximation.found, approximation.assumed)
        else:
            placed = start.x
        has_xyz = np.isfinite(xyz)
        if np.any(points.datum & ~has_xyz):
            return "a datum point has no coordinates"
        # fixed and datum coordinates stay as given, all others start from the computed ones
        xyz = np.where(points.fixed | points.datum, xyz, placed)
    on_station, on_target = np.flatnonzero(split.station >= 0), np.flatnonzero(split.target >= 0)

    def joined(name: str, parts: list[tuple[int, np.ndarray]]) -> np.ndarray:
        return np.concatenate([getattr(groups[k], name)[rows] for k, rows in parts] or [np.zeros(0)])

    between = None
    if split.between:
        ends = [split.station[joined(n, split.between).astype(int) // 3] for n in ("origin", "target")]
        sigma_between = np.sqrt(joined("covariance", split.between))
        between = StationRanges(ends[0], ends[1], joined("observed", split.between), sigma_between)
    sigma = np.array([p.sigma for p in network.parameters])
    begin_at = np.array([p.start for p in network.parameters])

    def by_station(columns: np.ndarray, values: np.ndarray) -> np.ndarray | None:
        return np.where(columns >= 0, np.append(values, 0.0)[columns], 0.0) if np.any(columns >= 0) else None

    return RangingNetwork(
        stations=xyz[on_station],
        targets=xyz[on_target],
        station=split.station[joined("origin", split.ranges).astype(int) // 3],
        target=split.target[joined("target", split.ranges).astype(int) // 3],
        distance=joined("observed", split.ranges),
        sigma=np.sqrt(joined("covariance", split.ranges)),
        held_stations=points.fixed[on_station],
        held_targets=points.fixed[on_target],
        datum_stations=points.datum[on_station] & ~points.fixed[on_station],
        datum_targets=points.datum[on_target] & ~points.fixed[on_target],
        zero_start=by_station(split.zero, begin_at),
        zero_sigma=by_station(split.zero, sigma),
        scale_start=by_station(split.scale, begin_at),
        scale_sigma=by_station(split.scale, sigma),
        station_priors=_priors(network, split, split.station),
        target_priors=_priors(network, split, split.target),
        between=between,
        station_names=[points.names[i] for i in on_station],
        target_names=[points.names[i] for i in on_target],
    ), placed_by


def _priors(network: ObservationNetwork, split: _Split, role: np.ndarray) -> PointPriors | None:
    """Observed coordinates of the points of one role."""
    index, observed, covariance = [], [], []
    for k in split.priors:
        group = network.groups[k]
        point = group.point.reshape(-1, 3)[:, 0] // 3  # type: ignore[attr-defined]
        in_role = role[point] >= 0
        c = group.covariance
        blocks = c.reshape(-1, 3)[:, :, None] * np.eye(3) if c.ndim == 1 else c.reshape(-1, 3, 3)
        index.append(role[point][in_role])
        observed.append(group.observed.reshape(-1, 3)[in_role])
        covariance.append(blocks[in_role])
    if not index or not sum(len(i) for i in index):
        return None
    return PointPriors(np.concatenate(index), np.concatenate(observed), np.concatenate(covariance))


def _inflation(
    network: ObservationNetwork,
    active: Sequence[np.ndarray] | None,
    inflation: Sequence[np.ndarray] | None,
    split: _Split,
) -> np.ndarray | None:
    """Factor on each range's sigma, infinite if left out.

    None if other observations are changed.
    """
    factor = [np.ones(len(g.observed)) for g in network.groups]
    if inflation is not None:
        factor = [f * i for f, i in zip(factor, inflation, strict=True)]
    if active is not None:
        factor = [np.where(a, f, np.inf) for f, a in zip(factor, active, strict=True)]
    other_rows = [(k, rows) for k, rows in split.between] + [(k, np.arange(len(factor[k]))) for k in split.priors]
    if any(np.any(factor[k][rows] != 1.0) for k, rows in other_rows):
        return None
    return np.concatenate([factor[k][rows] for k, rows in split.ranges])


def _answer(
    network: ObservationNetwork,
    split: _Split,
    solution: RangingSolution,
    placed_by: tuple[tuple[str, ...], tuple[str, ...]],
    inflation: np.ndarray,
) -> NetworkSolution:
    count = len(network.points.names)
    s, t = split.station >= 0, split.target >= 0
    x, covariance = np.empty((count, 3)), np.empty((count, 3, 3))
    x[s], x[t] = solution.stations, solution.targets
    covariance[s], covariance[t] = solution.covariance_stations, solution.covariance_targets
    values, u = np.zeros(len(network.parameters)), np.zeros(len(network.parameters))
    for columns, value, u_value in (
        (split.zero, solution.zero, solution.u_zero),
        (split.scale, solution.scale, solution.u_scale),
    ):
        values[columns[columns >= 0]], u[columns[columns >= 0]] = value[columns >= 0], u_value[columns >= 0]
    on_datum = int((network.points.datum & ~network.points.fixed).any(axis=1).sum())
    fixed_count = int(network.points.fixed.sum())
    words = [f"{fixed_count} coordinates held"] if fixed_count else []
    words += [f"inner constraints on {on_datum} points"] if on_datum else []
    return NetworkSolution(
        network=network,
        x=x,
        covariance=covariance,
        parameters=values,
        u_parameters=u,
        status=solution.status,
        iterations=solution.iterations,
        fits=_fits(network, split, solution, inflation),
        variance_factor=solution.variance_factor,
        degrees_of_freedom=float(solution.degrees_of_freedom),
        datum="; ".join(words) or "held by observations and priors",
        approximate=placed_by[0],
        assumed=placed_by[1],
        q=RangingCovariance(solution, split.station, split.target, split.zero, split.scale),
    )


def _fits(
    network: ObservationNetwork, split: _Split, solution: RangingSolution, inflation: np.ndarray
) -> tuple[GroupFit, ...]:
    """Fits in the groups and the order of the network."""
    by_name = {f.name: f for f in solution.fits}
    fields = ("active", "residual", "sigma", "redundancy", "standardised", "estimated_error", "detectable_error")
    columns = [
        {f: np.zeros(len(g.observed), dtype=bool if f == "active" else float) for f in fields} for g in network.groups
    ]

    def place(fit: GroupFit, parts: list[tuple[int, np.ndarray]]) -> None:
        low = 0
        for k, rows in parts:
            for f in fields:
                columns[k][f][rows] = getattr(fit, f)[low : low + len(rows)]
            low += len(rows)

    place(by_name["ranges"], split.ranges)
    if split.between:
        place(by_name["between stations"], split.between)
    for name, role in (("station priors", split.station), ("target priors", split.target)):
        if name in by_name:
            parts = []
            for k in split.priors:
                point = network.groups[k].point // 3  # type: ignore[attr-defined]
                parts.append((k, np.flatnonzero(role[point] >= 0)))
            place(by_name[name], parts)
    factor, low = [np.ones(len(g.observed)) for g in network.groups], 0
    for k, rows in split.ranges:
        factor[k][rows] = inflation[low : low + len(rows)]
        low += len(rows)
    result = []
    for group, column, larger in zip(network.groups, columns, factor, strict=True):
        on, v = column["active"], column["residual"]
        if group.covariance.ndim == 1:
            pvv = float(np.sum((v[on] / (column["sigma"] * larger)[on]) ** 2))
        else:
            blocks = group.covariance.reshape(-1, 3, 3)
            pvv = float(np.einsum("bi,bi->", v.reshape(-1, 3), np.linalg.solve(blocks, v.reshape(-1, 3, 1))[:, :, 0]))
        result.append(GroupFit(group.name, **column, pvv=pvv))
    return tuple(result)
