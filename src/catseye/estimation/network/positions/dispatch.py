"""Positions of many targets from ranges to known stations, by weighted least squares.

The stations are known here; otherwise the network is adjusted as a whole (`network.adjustment`,
`network.multilateration`). Every threshold is a pure number: in standard uncertainties, or relative to the size of the
stations' figure.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields

import numpy as np

from catseye.errors import EstimationError, InputError
from catseye.estimation.network.positions import descent
from catseye.estimation.network.positions.start import SIGNIFICANT, Planes, patterns_of, planes_of, starts
from catseye.estimation.network.positions.status import TEXTS, PositionStatus
from catseye.estimation.network.positions.trilateration import FLAT

LANES = 2**15  # ranges per chunk of the plain form, so that its arrays stay in the cache
LANES_COMPILED = 2**18
COMPILED_FROM = 2_000_000  # ranges: loading numba takes as long as the plain form for these


@dataclass(frozen=True, eq=False)
class Positions:
    """Positions of t targets.

    x            (t, 3) m; nan unless the status is FOUND or CONTRADICTING
    covariance   (t, 3, 3) m^2, a priori (variance factor 1), for exactly known stations; nan likewise
    status       (t,) int8 of `PositionStatus`; in words by `text`
    ranges       (t,) number used
    iterations   (t,) Gauss-Newton steps; 0 if not tried
    pvv          (t,) sum of squared residuals in sigmas; nan if not tried
    """

    x: np.ndarray
    covariance: np.ndarray
    status: np.ndarray
    ranges: np.ndarray
    iterations: np.ndarray
    pvv: np.ndarray

    @property
    def degrees_of_freedom(self) -> np.ndarray:
        """Degrees of freedom (t,): ranges less three; negative for too few."""
        return self.ranges - 3

    def text(self, target: int) -> str:
        """Status of one target in words, with the remedy."""
        status, ranges = PositionStatus(self.status[target]), int(self.ranges[target])
        freedom = ranges - 3 if status == PositionStatus.CONTRADICTING else ranges
        ratio = float(np.sqrt(self.pvv[target] / max(freedom, 1)))
        return TEXTS[status].format(ranges=ranges, ratio=ratio, iterations=int(self.iterations[target]))

    def require_found(self) -> "Positions":
        """Return these positions, or raise EstimationError for the first missing target."""
        bad = np.flatnonzero(self.status != PositionStatus.FOUND)
        if len(bad):
            raise EstimationError(f"target {bad[0]} ({len(bad)} of {len(self.status)} likewise): {self.text(bad[0])}")
        return self


@dataclass(frozen=True, eq=False)
class _Chunk:
    """Batch of targets: d (k, s) m, u (1 or k, s) m, near (1 or k, 3) m from the centre, or None."""

    d: np.ndarray
    u: np.ndarray
    near: np.ndarray | None

    def of(self, lanes: np.ndarray | slice) -> "_Chunk":
        """Inputs of selected targets."""
        u, near = (a if a is None or len(a) == 1 else a[lanes] for a in (self.u, self.near))
        assert u is not None
        return _Chunk(np.ascontiguousarray(self.d[lanes]), u, near)


def positions(
    stations: np.ndarray,
    distances: np.ndarray,
    sigma: np.ndarray,
    *,
    near: np.ndarray | None = None,
    compiled: bool | None = None,
    threads: int = 1,
) -> Positions:
    """Least-squares positions of targets from ranges to known stations, with covariance and status.

    stations    (s, 3) m, taken as exact: to include their uncertainty adjust the network
    distances   (t, s) m, nan if missing; any subset
    sigma       (s,) or (t, s) m, standard uncertainties of the ranges, independent
    near        (3,) or (t, 3) m, nan if unknown: a point on the target's side of the stations' plane; used only if the
                ranges do not separate the two mirror images by 5 sigma: the image on that side is taken; without it
                neither is
    compiled    True: use the compiled form (None: from two million ranges on); both agree to rounding
    threads     of the compiled form; one is best below a megabyte of ranges

    The start is in closed form: differences of squared ranges give the position in the principal plane of the stations
    that see the target, their mean the height, up to its sign. Gauss-Newton continues, damped if necessary, until the
    curvature of the ranges predicts a next step below 1e-4 sigma. The rank is determined by that curvature too: if one
    sigma of the position bends the ranges by 0.25 sigma, its height over the stations' plane is undetermined.
    Working memory is bounded, a small part of the result's. Raises InputError for shapes or stations.

    Source: [FOERSTNER16] chapter 4 (Gauss-Markov model); [PARKER04] section 3.1.2 requires it, without equations.

    >>> s = np.array([[0.0, 0, 0], [50, 0, 1], [0, 50, 2], [50, 50, 9]])
    >>> d = np.linalg.norm(np.array([20.0, 10, 30]) - s, axis=1)
    >>> points = positions(s, [d, [30.0, 40, np.nan, np.nan]], np.full(4, 1e-4))
    >>> np.round(points.x[0], 6).tolist(), points.text(1)
    ([20.0, 10.0, 30.0], 'seen by 2 ranges only: three are needed; measure from another station')
    """
    s, targets = _checked(stations, distances, sigma, near)
    t, m = targets.d.shape
    if compiled is None:
        compiled = targets.d.size >= COMPILED_FROM
    status, ranges, iterations = (np.empty(t, dtype=kind) for kind in (np.int8, np.int32, np.int32))
    out = Positions(
        x=np.empty((t, 3)),
        covariance=np.empty((t, 3, 3)),
        status=status,
        ranges=ranges,
        iterations=iterations,
        pvv=np.empty(t),
    )
    origin = s.mean(axis=0)
    s = s - origin
    if targets.near is not None:
        targets = _Chunk(targets.d, targets.u, targets.near - origin)
    all_stations = planes_of(s, np.ones((1, m), dtype=bool))
    fast = (
        _compiled(s, all_stations, origin)
        if compiled and all_stations.count[0] >= 3 and not all_stations.collinear[0]
        else None
    )
    size = max((LANES_COMPILED if compiled else LANES) // m, 1)

    def work(first: int) -> None:
        rows = slice(first, first + size)
        part = Positions(**{f.name: getattr(out, f.name)[rows] for f in fields(Positions)})
        chunk = targets.of(rows)
        lanes = np.arange(len(chunk.d)) if fast is None else np.flatnonzero(~fast(chunk, part))
        if len(lanes):
            _plain(s, chunk if fast is None else chunk.of(lanes), all_stations=all_stations, part=part, lanes=lanes)
            part.x[lanes] += origin

    with ThreadPoolExecutor(threads) as pool:  # the compiled form releases the interpreter lock
        for _ in pool.map(work, range(0, t, size)) if threads > 1 else map(work, range(0, t, size)):
            pass
    return out


def _checked(
    stations: np.ndarray, distances: np.ndarray, sigma: np.ndarray, near: np.ndarray | None
) -> tuple[np.ndarray, _Chunk]:
    """Arguments of `positions` as validated float arrays, or InputError."""
    s, d, u = (np.asarray(a, dtype=float) for a in (stations, distances, sigma))
    if s.ndim != 2 or s.shape[1] != 3 or d.ndim != 2 or d.shape[1] != len(s) or not len(s):
        raise InputError(f"stations {s.shape} and distances {d.shape}: (s, 3) and (t, s) are expected, s at least 1")
    if not np.isfinite(s).all():
        raise InputError(f"station {np.flatnonzero(~np.isfinite(s).all(axis=1))[0]} has no finite coordinates")
    if u.shape not in ((len(s),), d.shape):
        raise InputError(f"sigma has shape {u.shape}: ({len(s)},) or {d.shape} is expected")
    if u.ndim == 1 and not ((u > 0.0) & (u < np.inf)).all():
        i = int(np.flatnonzero(~((u > 0.0) & (u < np.inf)))[0])
        raise InputError(f"sigma of station {i} is {u[i]} m: positive and finite is expected; mark missing ranges nan")
    side = None if near is None else np.asarray(near, dtype=float)
    if side is not None and side.shape not in ((3,), (len(d), 3)):
        raise InputError(f"near has shape {side.shape}: (3,) or ({len(d)}, 3) is expected")
    return s, _Chunk(d, np.ascontiguousarray(np.atleast_2d(u)), None if side is None else np.atleast_2d(side))


def _compiled(s: np.ndarray, all_stations: Planes, origin: np.ndarray) -> Callable[[_Chunk, Positions], np.ndarray]:
    """Compiled solver for these stations: writes a chunk's results, returns mask (k,) of reliable ones."""
    from catseye.estimation.network.positions import kernel

    frame = np.concatenate([all_stations.centre, all_stations.axes[0], all_stations.inverse])
    site = kernel.StationPlane(
        s, all_stations.half_square[0], np.ascontiguousarray(all_stations.rows[0]), frame, origin
    )
    d = descent
    limits = kernel.PositionLimits(
        flat=FLAT,
        significant=SIGNIFICANT,
        enough=d.ENOUGH,
        singular=d.SINGULAR,
        bent=d.BENT,
        contradiction=d.CONTRADICTION,
        cap=d.CAP_UNDAMPED,
    )

    def fast(chunk: _Chunk, part: Positions) -> np.ndarray:
        good = np.empty(len(chunk.d), dtype=bool)
        near = np.full((1, 3), np.nan) if chunk.near is None else np.ascontiguousarray(chunk.near)
        answers = kernel.Answers(
            x=part.x,
            covariance=part.covariance,
            ranges=part.ranges,
            iterations=part.iterations,
            pvv=part.pvv,
            good=good,
        )
        kernel.locate(kernel.MeasuredRanges(chunk.d, chunk.u, near), site, limits, answers)
        part.status[:] = PositionStatus.FOUND
        return good

    return fast


def _plain(s: np.ndarray, chunk: _Chunk, *, all_stations: Planes, part: Positions, lanes: np.ndarray) -> None:
    """Solve a chunk of any kind, written into the lanes of `part`, relative to the stations' centre."""
    ranges, planes, which, refused = _sorted_out(s, chunk, all_stations)
    status = np.select(
        [refused, planes.count[which] < 3, planes.collinear[which]],
        [PositionStatus.REFUSED, PositionStatus.TOO_FEW, PositionStatus.COLLINEAR],
        PositionStatus.FOUND,
    )
    part.status[lanes], part.ranges[lanes], part.iterations[lanes] = status, ranges.count, 0
    part.x[lanes], part.covariance[lanes], part.pvv[lanes] = np.nan, np.nan, np.nan
    possible = np.flatnonzero(status == PositionStatus.FOUND)
    if not len(possible):
        return
    ranges, which, lanes = ranges.of(possible), which[possible], lanes[possible]
    start = starts(planes, which, ranges.d, u=ranges.u, near=chunk.of(possible).near)
    solution, status = descent.least_squares_positions(ranges, start)
    answered = status <= PositionStatus.CONTRADICTING
    part.status[lanes], part.pvv[lanes], part.iterations[lanes] = status, solution.pvv, solution.iterations
    part.x[lanes[answered]], part.covariance[lanes[answered]] = solution.x[answered], solution.covariance[answered]


def _sorted_out(
    s: np.ndarray, chunk: _Chunk, all_stations: Planes
) -> tuple[descent.Ranges, Planes, np.ndarray, np.ndarray]:
    """Ranges without missing ones, planes and patterns of visibility, targets to refuse."""
    d, u = chunk.d, chunk.u
    fit = (d >= 0.0) & (d < np.inf) & (u > 0.0) & (u < np.inf)
    if fit.all():
        which = np.zeros(len(d), dtype=int)
        return descent.Ranges(s, d, u, np.full(len(d), len(s))), all_stations, which, which > 0
    present = ~np.isnan(d)
    refused = (present & ~fit).any(axis=1)
    visible = present & ~refused[:, None]
    patterns, which = patterns_of(visible)
    ranges = descent.Ranges(s, np.where(visible, d, 0.0), np.where(visible, u, np.inf), present.sum(axis=1))
    return ranges, planes_of(s, patterns), which, refused
