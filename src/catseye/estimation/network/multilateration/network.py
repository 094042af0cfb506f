"""Input of a ranging network: stations, targets, ranges, fixed coordinates and priors; validation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.errors import InputError
from catseye.estimation.network.multilateration.blocks import IterationState, Problem
from catseye.estimation.network.multilateration.datum import ENOUGH, Datum, free_motions
from catseye.estimation.network.multilateration.status import Names
from catseye.estimation.network.multilateration.terms import Gauges, PointPriors, PriorTerms, StationRanges


@dataclass(frozen=True, eq=False)
class RangingNetwork:
    """Ranging network before its adjustment; S stations, T targets, m ranges.

    None: not present, or none held.

    stations        (S, 3) m, start values, and reference of held and datum coordinates
    targets         (T, 3) m, the same
    station         (m,) index of the station of each range; any pair may be missing or repeated
    target          (m,) index of its target
    distance        (m,) m, observed
    sigma           (m,) m, its standard uncertainty
    held_stations   (S, 3) bool, coordinates held at their given values
    held_targets    (T, 3) bool
    datum_stations  (S, 3) bool, coordinates in the inner constraints, if a motion is free
    datum_targets   (T, 3) bool
    zero_start      (S,) m, start and prior value of each station's zero (default 0)
    zero_sigma      (S,) m, 0: held, infinite: free, else its prior's standard uncertainty (default held)
    scale_start     (S,) 1, the same for its scale
    scale_sigma     (S,) 1
    station_priors  stations with prior coordinates and covariance
    target_priors   targets likewise
    between         distances between stations
    station_names   for the status; default indices
    target_names    the same
    """

    stations: np.ndarray
    targets: np.ndarray
    station: np.ndarray
    target: np.ndarray
    distance: np.ndarray
    sigma: np.ndarray
    held_stations: np.ndarray | None = None
    held_targets: np.ndarray | None = None
    datum_stations: np.ndarray | None = None
    datum_targets: np.ndarray | None = None
    zero_start: np.ndarray | None = None
    zero_sigma: np.ndarray | None = None
    scale_start: np.ndarray | None = None
    scale_sigma: np.ndarray | None = None
    station_priors: PointPriors | None = None
    target_priors: PointPriors | None = None
    between: StationRanges | None = None
    station_names: Sequence[str] = ()
    target_names: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class Setup:
    """Validated network, relative to its centre.

    problem      for the elimination
    start        initial state
    datum        inner constraints
    terms        observations beside the ranges
    names        for the status
    origin       (3,) m, what was subtracted from all coordinates: the mean of the stations
    size         m, of the network about its origin
    dilation     True if a change of scale can be free
    still        points (k, 3) bool: stations, then targets, with coordinates fixed against free motions
    """

    problem: Problem
    start: IterationState
    datum: Datum
    terms: PriorTerms
    names: Names
    origin: np.ndarray
    size: float
    dilation: bool
    still: np.ndarray

    def motions(self, state: IterationState) -> np.ndarray:
        """Free motions (7, f) at a state, see `free_motions`."""
        at, s = self.points, len(state.stations)
        for some in (at[:ENOUGH], at):  # a few held points usually fix all motions
            stations, targets = some[some < s], some[some >= s] - s
            points = np.concatenate([state.stations[stations], state.targets[targets]])
            free = free_motions(points, self.still[some], dilation=self.dilation, size=self.size)
            if not free.shape[1] or len(some) == len(at):
                break
        return free

    @cached_property
    def points(self) -> np.ndarray:
        """Indices, stations then targets, of points fixed against free motions."""
        return np.flatnonzero(self.still.any(axis=1))


def set_up(network: RangingNetwork, inflation: np.ndarray | None) -> Setup:
    """Validate a network; raises InputError with problem and place."""
    names = Names(network.station_names, network.target_names)
    stations, targets = _points(network.stations, names.station), _points(network.targets, names.target)
    s, t = len(stations), len(targets)
    if not s or not t or not len(network.distance):
        raise InputError(f"a ranging network needs stations, targets and ranges: {s}, {t} and {len(network.distance)}")
    for called, count, labels in (("station", s, network.station_names), ("target", t, network.target_names)):
        if len(labels) not in (0, count):
            raise InputError(f"{called}_names has {len(labels)} names for {count} {called}s")
    held_stations, held_targets = _marks(network.held_stations, s, "held"), _marks(network.held_targets, t, "held")
    origin = stations.mean(axis=0)
    gauges = _gauges(network, s, names)
    terms = _terms(network, (s, t), names, gauges, origin)
    free = np.concatenate([~held_stations] + [(sigma > 0.0)[:, None] for _, sigma in gauges], axis=1)
    width = 5 if np.any(free[:, 3:]) else 3
    weight, value = _target_weights(terms.targets, t)
    problem = Problem(
        **_ranges(network, s, t, names, inflation),
        width=width,
        free_stations=np.ascontiguousarray(free[:, :width]),
        free_targets=~held_targets,
        target_weight=weight,
        target_value=value,
    )
    state = IterationState(stations - origin, targets - origin, gauges[0][0], gauges[1][0])
    datum = Datum(
        state.stations,
        state.targets,
        _marks(network.datum_stations, s, "datum"),
        _marks(network.datum_targets, t, "datum"),
    )
    still = np.concatenate([held_stations, held_targets])
    for prior, first in ((terms.stations, 0), (terms.targets, s)):
        if prior is not None:
            still[first + prior.index] = True
    size = float(max(np.abs(state.stations).max(), np.abs(state.targets).max()))
    dilation = width == 5 and terms.between is None and bool(np.all(np.isinf(gauges[1][1])))
    return Setup(
        problem=problem,
        start=state,
        datum=datum,
        terms=terms,
        names=names,
        origin=origin,
        size=size or 1.0,
        dilation=dilation,
        still=still,
    )


def _points(xyz, called) -> np.ndarray:
    x = np.ascontiguousarray(xyz, dtype=float)
    if x.ndim != 2 or x.shape[1] != 3:
        raise InputError(f"coordinates of points are (n, 3), these are {x.shape}")
    if not np.isfinite(x).all():
        i = int(np.flatnonzero(~np.isfinite(x).all(axis=1))[0])
        raise InputError(f"{called(i)} starts at {x[i].tolist()}; every point needs approximate coordinates")
    return x


def _marks(marks, count: int, called: str) -> np.ndarray:
    if marks is None:
        return np.zeros((count, 3), dtype=bool)
    marks = np.asarray(marks)
    if marks.shape != (count, 3) or marks.dtype != bool:
        raise InputError(f"{called} marks are bool ({count}, 3), these are {marks.dtype} {marks.shape}")
    return marks


def _gauges(network: RangingNetwork, s: int, names: Names) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Start values and sigmas of all zeros, and of all scales."""
    out = []
    for called, start, sigma in (
        ("zero", network.zero_start, network.zero_sigma),
        ("scale", network.scale_start, network.scale_sigma),
    ):
        start = np.zeros(s) if start is None else np.array(start, dtype=float)
        sigma = np.zeros(s) if sigma is None else np.array(sigma, dtype=float)
        if start.shape != (s,) or sigma.shape != (s,):
            raise InputError(f"{called}_start and {called}_sigma need {s} values, one a station")
        bad = np.flatnonzero(~(sigma >= 0.0) | ~np.isfinite(start))
        if len(bad):
            i = int(bad[0])
            raise InputError(
                f"{called} of {names.station(i)}: start {start[i]}, sigma {sigma[i]}; "
                "expected sigma 0 (held), infinite (free), or that of its prior"
            )
        out.append((start, sigma))
    return tuple(out)


def _ranges(network: RangingNetwork, s: int, t: int, names: Names, inflation: np.ndarray | None) -> dict:
    """Ranges part of a Problem, validated."""
    # fixed memory layout, so that the kernels are compiled once
    station, target = (np.require(i, np.int64, ["C", "W"]) for i in (network.station, network.target))
    distance, sigma = (np.require(d, float, ["C", "W"]) for d in (network.distance, network.sigma))
    shapes = {a.shape for a in (station, target, distance, sigma)}
    if shapes != {(len(distance),)}:
        raise InputError(f"station, target, distance and sigma differ in shape: {sorted(shapes)}")
    for called, index, count in (("station", station, s), ("target", target, t)):
        if index.min() < 0 or index.max() >= count:
            i = int(np.flatnonzero((index < 0) | (index >= count))[0])
            raise InputError(f"range {i} names {called} {index[i]}, but there are {count}")
    if inflation is not None:
        inflation = np.asarray(inflation, dtype=float)
        if inflation.shape != sigma.shape or not np.all(inflation > 0.0):
            raise InputError(f"inflation needs {len(sigma)} positive factors, infinite to leave a range out")
        inflation = np.require(inflation, float, ["C", "W"])
    if not (np.isfinite(distance.sum()) and sigma.min() > 0.0 and np.isfinite(sigma.sum())):
        bad = np.flatnonzero(~(np.isfinite(distance) & np.isfinite(sigma) & (sigma > 0.0)))
        i = int(bad[0]) if len(bad) else 0
        raise InputError(
            f"range {i}, {names.station(int(station[i]))} to {names.target(int(target[i]))}: distance {distance[i]} m, "
            f"sigma {sigma[i]} m; both must be finite and sigma positive"
        )
    return {
        "station": station,
        "target": target,
        "distance": distance,
        "sigma": sigma,
        "inflation": inflation,
    }


def _terms(
    network: RangingNetwork,
    counts: tuple[int, int],
    names: Names,
    gauges: tuple[tuple[np.ndarray, np.ndarray], ...],
    origin: np.ndarray,
) -> PriorTerms:
    priors = []
    for count, called, prior in (
        (counts[0], names.station, network.station_priors),
        (counts[1], names.target, network.target_priors),
    ):
        priors.append(None if prior is None or not len(prior.index) else _prior(prior, count, called, origin))
    gauge_priors = []
    for i, (start, sigma) in enumerate(gauges):
        index = np.flatnonzero((sigma > 0.0) & np.isfinite(sigma))
        if len(index):
            gauge_priors.append(Gauges(("zero priors", "scale priors")[i], 3 + i, index, start[index], sigma[index]))
    return PriorTerms(priors[0], priors[1], _between(network.between, counts[0]), tuple(gauge_priors))


def _prior(prior: PointPriors, count: int, called, origin: np.ndarray) -> PointPriors:
    index = np.asarray(prior.index, dtype=np.int64)
    observed, covariance = np.asarray(prior.observed, dtype=float), np.asarray(prior.covariance, dtype=float)
    if observed.shape != (len(index), 3) or covariance.shape != (len(index), 3, 3):
        raise InputError(f"priors of {len(index)} points have values {observed.shape}, covariances {covariance.shape}")
    distinct, times = np.unique(index, return_counts=True)
    bad = distinct[(distinct < 0) | (distinct >= count) | (times > 1)]
    if len(bad):
        raise InputError(f"priors name point {bad[0]} (expected below {count}, one prior per point)")
    fine = np.isfinite(observed).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    matrices = np.where(fine[:, None, None], covariance, 0.0)
    skew = np.abs(matrices - matrices.transpose(0, 2, 1)).max(axis=(1, 2))
    fine &= (skew <= 1e-9 * np.abs(matrices).max(axis=(1, 2))) & (np.linalg.eigvalsh(matrices)[:, 0] > 0.0)
    if not fine.all():
        raise InputError(
            f"the prior of {called(int(index[~fine][0]))} needs finite values and a positive definite covariance; "
            "hold a coordinate that is known exactly"
        )
    return PointPriors(index, observed - origin, covariance)


def _between(between: StationRanges | None, s: int) -> StationRanges | None:
    if between is None or not len(between.distance):
        return None
    first, second = (np.asarray(i, dtype=np.int64) for i in (between.first, between.second))
    distance, sigma = (np.asarray(d, dtype=float) for d in (between.distance, between.sigma))
    if {a.shape for a in (first, second, distance, sigma)} != {(len(distance),)}:
        raise InputError("ranges between stations: first, second, distance and sigma differ in shape")
    bad = (first < 0) | (first >= s) | (second < 0) | (second >= s) | (first == second)
    bad |= ~(np.isfinite(distance) & np.isfinite(sigma) & (sigma > 0.0))
    if np.any(bad):
        i = int(np.flatnonzero(bad)[0])
        raise InputError(
            f"range {i} between stations {first[i]} and {second[i]}: distance {distance[i]} m, sigma {sigma[i]} m; "
            f"it needs two different stations of {s}, finite values and a positive sigma"
        )
    return StationRanges(first, second, distance, sigma)


def _target_weights(priors: PointPriors | None, t: int) -> tuple[np.ndarray | None, np.ndarray | None]:
    if priors is None:
        return None, None
    weight, value = np.zeros((t, 3, 3)), np.zeros((t, 3))
    weight[priors.index], value[priors.index] = np.linalg.inv(priors.covariance), priors.observed
    return weight, value
