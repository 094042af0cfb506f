"""Positions from ranges to known stations: three of them in closed form, many by weighted least squares.

The stations are known here; where they are not, the network is adjusted as one (`adjustment`, `network`).
Every threshold is a pure number: in standard uncertainties, or relative to the size of the stations' figure.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from catseye.errors import EstimationError, InputError


class Status(IntEnum):
    """What became of one target; only FOUND and CONTRADICTING come with coordinates."""

    FOUND = 0
    CONTRADICTING = 1
    TOO_FEW = 2
    COLLINEAR = 3
    NOT_HELD = 4
    DISJOINT = 5
    AMBIGUOUS = 6
    AT_STATION = 7
    NOT_CONVERGED = 8
    REFUSED = 9


TEXTS = {
    Status.FOUND: "found",
    Status.CONTRADICTING: "its {ranges} ranges contradict each other: residuals are {ratio:.3g} times their sigma "
    "(limit 10); one of them or a station is grossly wrong",
    Status.TOO_FEW: "seen by {ranges} ranges only: three are needed; measure from another station",
    Status.COLLINEAR: "the stations that see it stand on one line: it may be anywhere on a circle about that line; "
    "measure from a station off the line",
    Status.NOT_HELD: "its ranges do not hold it in one direction: it lies in one plane with the stations that see it, "
    "or too far from them for their spread; measure from a station off that plane",
    Status.DISJOINT: "its {ranges} ranges do not meet in a point: they miss each other by {ratio:.3g} times their "
    "sigma (limit 5) or, in closed form, by `misclosure`; a range is too short, or a station or target is confused",
    Status.AMBIGUOUS: "the stations that see it stand in one plane and its two mirror images fit alike; "
    "give a point on its side of the plane (`near`), or a range from off the plane",
    Status.AT_STATION: "it stands within four sigma of a station, where a range has no direction; leave that range out",
    Status.NOT_CONVERGED: "not converged after {iterations} steps, residuals {ratio:.3g} times their sigma; "
    "check its ranges and the stations",
    Status.REFUSED: "a range of it is negative or infinite, or the sigma of a range is not positive and finite",
}

FLAT = 1e-13  # squared extent over largest squared extent: below it a figure of points is flat to double precision
SIGNIFICANT = 5.0  # sigmas by which ranges must tell one mirror image from the other
ENOUGH = 1e-4  # sigmas: the next step foreseen is smaller, so the answer stands; 1 nm where 10 um are claimed
SINGULAR = 1e-15  # determinant over cubed trace of a normal matrix that holds no digit
BENT = 0.25  # sigmas that the ranges' curvature moves them over one sigma of the position: above, no ellipsoid
CONTRADICTION = 10.0  # root mean square residual in sigmas, per degree of freedom, that no honest noise makes
MISSED = 5.0  # the same, per range, where the target's height is not held
ROUNDING, NOTHING = 1.0 + 1e-12, 1e-6  # of a sum of squares: a growth below these is no step uphill
CAP = 100  # evaluations of the plain form; from the closed form one or two are usual
LANES = 2**15  # ranges a chunk of the plain form, so that its arrays stay in the cache
LANES_COMPILED = 2**18
COMPILED_FROM = 2_000_000  # ranges: loading numba takes as long as the plain form for these


# --- three ranges -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Trilateration:
    """Where three spheres meet.

    x            (..., 2, 3) m: first the point above the stations' plane, from where stations 1, 2, 3 run
                 anticlockwise (the side of (s2 - s1) x (s3 - s1)), then its mirror image below; nan without answer
    height       (...) m of the first above that plane; nan without answer
    misclosure   (..., 3) m by which each range is too short to reach the foot, the point of the plane where the three
                 miss by the same power; zero where they meet, nan where the stations stand on one line
    status       (...) int8 of `Status`: FOUND, COLLINEAR, DISJOINT or REFUSED
    """

    x: np.ndarray
    height: np.ndarray
    misclosure: np.ndarray
    status: np.ndarray


def trilaterate(stations: np.ndarray, distances: np.ndarray) -> Trilateration:
    """The two points at three distances from three stations, in closed form.

    stations    (..., 3, 3) m, a station a row
    distances   (..., 3) m, not negative

    With origin at the station of the shortest range, a and b to the others and n = a x b, the foot in the plane obeys
    f.a = (d0^2 - d1^2 + a^2) / 2 and likewise b; the height is the root of d0^2 - f^2. A square that is negative by
    less than rounding counts as zero. Never raises for a value: see the status.

    Source: [PARKER04] eq. 3.1, solved; its "unique set of coordinates" are two, mirror images in the stations' plane.

    >>> both = trilaterate(np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]), np.array([3.0, 3, 3]))
    >>> both.x.tolist(), float(both.height)
    ([[2.0, 2.0, 1.0], [2.0, 2.0, -1.0]], 1.0)
    """
    s, d = _three(stations, distances)
    usable = np.isfinite(s).all(axis=(-1, -2)) & (np.isfinite(d) & (d >= 0.0)).all(axis=-1)
    turn = (np.argmin(d, axis=-1)[..., None] + np.arange(3)) % 3  # cyclic: the normal keeps its sense
    corner = np.take_along_axis(s, turn[..., None], axis=-2)
    near, one, two = np.moveaxis(np.take_along_axis(d, turn, axis=-1), -1, 0)
    a, b = corner[..., 1, :] - corner[..., 0, :], corner[..., 2, :] - corner[..., 0, :]
    n = np.cross(a, b)
    area = np.sum(n * n, axis=-1)
    longest = np.max([np.sum(v * v, axis=-1) for v in (a, b, b - a)], axis=0)
    apart = area > FLAT * longest**2  # in squares, as the patterns of `positions`
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        along = ((near - one) * (near + one) + np.sum(a * a, axis=-1)) / 2
        across = ((near - two) * (near + two) + np.sum(b * b, axis=-1)) / 2
        foot = (along[..., None] * np.cross(b, n) + across[..., None] * np.cross(n, a)) / area[..., None]
        square = near**2 - np.sum(foot * foot, axis=-1)
        size = np.maximum(longest, np.max(d, axis=-1) ** 2)
        rounding = 64 * np.finfo(float).eps * size * np.sqrt(longest**2 / area)
        meet = square >= -rounding
        height = np.where(usable & apart & meet, np.sqrt(np.maximum(square, 0.0)), np.nan)
        up = (height / np.sqrt(area))[..., None] * n
        lack = np.where(meet, 0.0, -square)[..., None]
        short = np.where(lack > 0.0, lack / (np.sqrt(d**2 + lack) + d), 0.0 * lack)
        misclosure = np.where((usable & apart)[..., None], short, np.nan)
    base = corner[..., 0, :] + foot
    status = np.select([~usable, ~apart, ~meet], [Status.REFUSED, Status.COLLINEAR, Status.DISJOINT], Status.FOUND)
    return Trilateration(np.stack([base + up, base - up], axis=-2), height, misclosure, status.astype(np.int8))


def trilateration_covariance(
    stations: np.ndarray,
    x: np.ndarray,
    *,
    u_distances: np.ndarray,
    station_covariance: np.ndarray | None = None,
) -> np.ndarray:
    """Covariance (..., 3, 3) in m^2 of a point found from three ranges, to first order.

    stations             (..., 3, 3) m
    x                    (..., 3) m, either of the two points
    u_distances          (..., 3) m, standard uncertainties of the ranges, independent
    station_covariance   (..., 3, 3, 3) m^2, one block a station, or (..., 9, 9) of all three jointly; None if known

    With unit vectors e_i from station to point, e_i.dx = dd_i + e_i.ds_i. It holds while the uncertainty of the height
    over the stations' plane is small beside the height; in the plane itself it is nan.

    Source: [JCGM100] section 5.2 (correlated input quantities), on [PARKER04] eq. 3.1.
    """
    stations, x = np.asarray(stations, dtype=float), np.asarray(x, dtype=float)
    e = x[..., None, :] - stations
    with np.errstate(divide="ignore", invalid="ignore"):
        e = e / np.linalg.norm(e, axis=-1, keepdims=True)
        inner = np.eye(3) * np.asarray(u_distances, dtype=float)[..., None] ** 2
        if station_covariance is not None:
            c = np.asarray(station_covariance, dtype=float)
            if c.shape[-2:] == (9, 9):
                joint = c.reshape((*c.shape[:-2], 3, 3, 3, 3))
                inner = inner + np.einsum("...ia,...iajb,...jb->...ij", e, joint, e)
            elif c.shape[-3:] == (3, 3, 3):
                inner = inner + np.eye(3) * np.einsum("...ia,...iab,...ib->...i", e, c, e)[..., None]
            else:
                raise InputError(f"station_covariance has shape {c.shape}: (..., 3, 3, 3) or (..., 9, 9) is expected")
        columns, determinant = _cofactors(e)
        gain = np.where(determinant != 0.0, columns / determinant, np.nan)
        return gain @ inner @ np.swapaxes(gain, -1, -2)


@dataclass(frozen=True, eq=False)
class AveragedIteration:
    """The answer of `trilaterate_by_averaging`.

    x            (..., 3) m, the last average; nan where singular
    difference   (...) m between the last old and new values
    iterations   (...) solutions of eq. 3.7 taken
    status       (...) int8 of `Status`: FOUND, NOT_CONVERGED (at the cap; x is then no answer), NOT_HELD (singular)
    """

    x: np.ndarray
    difference: np.ndarray
    iterations: np.ndarray
    status: np.ndarray


def trilaterate_by_averaging(
    stations: np.ndarray,
    distances: np.ndarray,
    start: np.ndarray,
    *,
    epsilon: float = 1e-9,
    iterations: int = 50,
) -> AveragedIteration:
    """The point at three distances from three stations, by the iteration of the notes.

    stations     (..., 3, 3) m
    distances    (..., 3) m
    start        (..., 3) m, off the stations' plane, on the side of the answer
    epsilon      m, old and new values agree to this
    iterations   cap; at the cap the status says NOT_CONVERGED, as it always ends where the ranges do not meet

    Eq. 3.3 is (r - r_i).(r~ - r_i) = R_i^2: eq. 3.1 at r~ = r. Its own solutions r~ = r, 3.7 unaveraged, flip the error
    e = r - answer to -e + O(e^2) and never settle. Since r~ - r solves (r - r_i).(r~ - r) = R_i^2 - |r - r_i|^2, half
    of it is Newton's step for 3.1: the average *is* Newton's method, of second order. Precisely, the next error is
    |e|^2 / (2 h) along the normal of the stations' plane, h the present height over it: after one step the point is
    exact in the plane, and the height obeys Heron's h' = (h + H^2 / h) / 2. So it converges from anywhere off the
    plane, to the image on the start's side; without a real H it wanders for ever.

    Source: [PARKER04] eqs. 3.3-3.7 and the text above them.
    """
    s, d = _three(stations, distances)
    start = np.asarray(start, dtype=float)
    shape = np.broadcast_shapes(d.shape[:-1], start.shape[:-1])
    origin = s[..., :1, :]  # coordinates relative to a station: the products of 3.7 then keep their digits
    s, origin = np.broadcast_to(s - origin, (*shape, 3, 3)), np.broadcast_to(origin[..., 0, :], (*shape, 3))
    right = np.broadcast_to(d**2 - np.sum((s * s), axis=-1), (*shape, 3))
    r = start - origin
    status = np.full(shape, Status.NOT_CONVERGED, dtype=np.int8)
    difference, taken = np.full(shape, np.nan), np.zeros(shape, dtype=int)
    for _ in range(iterations):
        open_ = status == Status.NOT_CONVERGED
        if not open_.any():
            break
        columns, determinant = _cofactors(r[..., None, :] - s)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            new = np.sum(columns * (right + np.sum(s * r[..., None, :], axis=-1))[..., None, :], axis=-1)
            new = new / determinant[..., 0]
            step = np.linalg.norm(new - r, axis=-1)
        singular = open_ & ~np.isfinite(step)
        r = np.where(singular[..., None], np.nan, np.where(open_[..., None], (r + new) / 2, r))
        difference, taken = np.where(open_, step, difference), taken + open_
        status[singular], status[open_ & (step <= epsilon)] = Status.NOT_HELD, Status.FOUND
    return AveragedIteration(r + origin, difference, taken, status)


def _three(stations: np.ndarray, distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stations and distances of equal batch, as floats."""
    s, d = np.asarray(stations, dtype=float), np.asarray(distances, dtype=float)
    if s.shape[-2:] != (3, 3) or d.shape[-1:] != (3,):
        raise InputError(f"stations {s.shape} and distances {d.shape}: (..., 3, 3) and (..., 3) are expected")
    shape = np.broadcast_shapes(s.shape[:-2], d.shape[:-1])
    return np.broadcast_to(s, (*shape, 3, 3)), np.broadcast_to(d, (*shape, 3))


def _cofactors(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Transposed cofactors (..., 3, 3) and determinant (..., 1, 1) of matrices given by rows: inverse = one / other."""
    p, q, r = rows[..., 0, :], rows[..., 1, :], rows[..., 2, :]
    columns = np.stack([np.cross(q, r), np.cross(r, p), np.cross(p, q)], axis=-1)
    return columns, np.sum(p * columns[..., 0], axis=-1)[..., None, None]


# --- many ranges --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Positions:
    """Positions of t targets.

    x            (t, 3) m; nan unless the status is FOUND or CONTRADICTING
    covariance   (t, 3, 3) m^2, a priori (variance factor 1), of stations without uncertainty; nan likewise
    status       (t,) int8 of `Status`; `text` says it in words
    ranges       (t,) used for each
    iterations   (t,) Gauss-Newton steps; 0 where none was tried
    pvv          (t,) sum of squared residuals in sigmas; nan where none was tried
    """

    x: np.ndarray
    covariance: np.ndarray
    status: np.ndarray
    ranges: np.ndarray
    iterations: np.ndarray
    pvv: np.ndarray

    @property
    def degrees_of_freedom(self) -> np.ndarray:
        """(t,) ranges less three; negative where there are too few."""
        return self.ranges - 3

    def text(self, target: int) -> str:
        """The status of one target in words: what is wrong and what to do."""
        status, ranges = Status(self.status[target]), int(self.ranges[target])
        freedom = ranges - 3 if status == Status.CONTRADICTING else ranges
        ratio = float(np.sqrt(self.pvv[target] / max(freedom, 1)))
        return TEXTS[status].format(ranges=ranges, ratio=ratio, iterations=int(self.iterations[target]))

    def require_found(self) -> "Positions":
        """These positions, or EstimationError that names the first target without one, why, and how many there are."""
        bad = np.flatnonzero(self.status != Status.FOUND)
        if len(bad):
            raise EstimationError(f"target {bad[0]} ({len(bad)} of {len(self.status)} likewise): {self.text(bad[0])}")
        return self


def positions(
    stations: np.ndarray,
    distances: np.ndarray,
    sigma: np.ndarray,
    *,
    near: np.ndarray | None = None,
    compiled: bool | None = None,
    threads: int = 1,
) -> Positions:
    """Least-squares positions of many targets, each from its ranges to known stations, with covariance and status.

    stations    (s, 3) m, known: their uncertainty is not in the covariance, for that adjust the network
    distances   (t, s) m, nan where missing; any subset serves
    sigma       (s,) or (t, s) m, standard uncertainties of the ranges, independent
    near        (3,) or (t, 3) m, nan where unknown: a point on the target's side of the stations' plane; used only
                where the ranges do not tell the two mirror images apart by 5 sigma: the image on that side is taken,
                without it none is
    compiled    whether to use the compiled form (None: from two million ranges on); both give the same to rounding
    threads     that share the work of the compiled form; one is best below a megabyte of ranges

    The start is closed: differences of squared ranges give the place in the principal plane of the stations that see
    the target, their mean the height, up to its sign. Gauss-Newton goes on from there, damped if it must be, until the
    curvature of the ranges foresees a next step below 1e-4 sigma. The rank is judged by that curvature too: where one
    sigma of the position bends the ranges by 0.25 sigma, its height over the plane of the stations is not held.
    Working memory is bounded; it is a small part of the answer's. Raises InputError for shapes or stations.

    Source: [FOERSTNER16] chapter 4 (Gauss-Markov model); [PARKER04] section 3.1.2 wants it, without equations.

    >>> s = np.array([[0.0, 0, 0], [50, 0, 1], [0, 50, 2], [50, 50, 9]])
    >>> d = np.linalg.norm(np.array([20.0, 10, 30]) - s, axis=1)
    >>> found = positions(s, [d, [30.0, 40, np.nan, np.nan]], np.full(4, 1e-4))
    >>> np.round(found.x[0], 6).tolist(), found.text(1)
    ([20.0, 10.0, 30.0], 'seen by 2 ranges only: three are needed; measure from another station')
    """
    s, d, u, point = _checked(stations, distances, sigma, near)
    t, m = d.shape
    if compiled is None:
        compiled = d.size >= COMPILED_FROM
    out = Positions(
        np.empty((t, 3)),
        np.empty((t, 3, 3)),
        np.empty(t, dtype=np.int8),
        np.empty(t, dtype=np.int32),
        np.empty(t, dtype=np.int32),
        np.empty(t),
    )
    locate: Callable | None = None
    if compiled:
        from catseye.estimation import trilateration_kernel

        locate = trilateration_kernel.locate
    origin = s.mean(axis=0)
    s = s - origin
    whole = _planes(s, np.ones((1, m), dtype=bool))
    size = max((LANES_COMPILED if compiled else LANES) // m, 1)

    def work(first: int) -> None:
        rows = slice(first, first + size)
        part = Positions(*(getattr(out, name)[rows] for name in Positions.__dataclass_fields__))
        towards = None if point is None else (point[rows] if len(point) == t else point) - origin
        chunk = np.ascontiguousarray(d[rows]), u[rows] if len(u) == t else u
        _solve(s, *chunk, near=towards, whole=whole, origin=origin, part=part, locate=locate)

    with ThreadPoolExecutor(threads) as pool:  # the compiled form lets go of the interpreter
        for _ in pool.map(work, range(0, t, size)) if threads > 1 else map(work, range(0, t, size)):
            pass
    return out


def _checked(
    stations: np.ndarray, distances: np.ndarray, sigma: np.ndarray, near: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]:
    """The arguments of `positions` as float arrays, sigma as (1, s) or (t, s), or InputError."""
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
    return s, d, np.ascontiguousarray(np.atleast_2d(u)), None if side is None else np.atleast_2d(side)


@dataclass(frozen=True, eq=False)
class _Planes:
    """The principal plane of the stations of each of p patterns of visibility.

    centre, axes   (p, 3), (p, 3, 3) of their figure: centroid, and directions by falling extent; the last is the normal
    rows           (p, 3, s): their products with `half_square - d^2 / 2` are the target's coordinates along the axes
    half_square    (p, s) half the squared distance of each station from the centre; 0 where it does not see
    inverse        (p, 3) reciprocals of the sums of squares along the axes; infinite where the figure is flat
    count          (p,) stations that see
    collinear      (p,) they stand on one line
    """

    centre: np.ndarray
    axes: np.ndarray
    rows: np.ndarray
    half_square: np.ndarray
    inverse: np.ndarray
    count: np.ndarray
    collinear: np.ndarray


def _planes(s: np.ndarray, patterns: np.ndarray) -> _Planes:
    """With q_i = s_i - centre, z from the centre: q_i.z = (z^2 + q_i^2 - d_i^2) / 2, and sum q_i = 0 rids it of z^2."""
    count = patterns.sum(axis=1)
    centre = patterns @ s / np.maximum(count, 1)[:, None]
    q = (s - centre[:, None]) * patterns[..., None]
    extent, vectors = np.linalg.eigh(np.swapaxes(q, 1, 2) @ q)
    extent, axes = extent[:, ::-1], np.swapaxes(vectors, 1, 2)[:, ::-1]
    held = extent > FLAT * extent[:, :1]
    inverse = np.where(held, 1.0 / np.where(held, extent, 1.0), np.inf)
    rows = axes @ np.swapaxes(q, 1, 2) * np.where(held, inverse, 0.0)[..., None]
    return _Planes(centre, axes, rows, np.sum(q * q, axis=2) / 2, inverse, count, ~held[:, 1])


def _patterns(seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distinct rows (p, s) of a table of bools, and which of them each row is."""
    bits = np.packbits(seen, axis=1)
    keys = np.zeros((len(bits), -(-bits.shape[1] // 8) * 8), dtype=np.uint8)
    keys[:, : bits.shape[1]] = bits
    words = keys.view(np.uint64)
    words = words[:, 0] if words.shape[1] == 1 else np.ascontiguousarray(words).view(f"V{8 * words.shape[1]}")[:, 0]
    _, index, which = np.unique(words, return_index=True, return_inverse=True)
    return seen[index], which


def _starts(
    planes: _Planes, which: np.ndarray, d: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Foot in the stations' plane (k, 3), height over it (k,) up to its sign, and the sign that the ranges tell, or 0.

    The height comes from the mean square of the ranges, or from the stations' own spread along the normal, which also
    tells the sign: whichever is better known, with u^2 of 1 / n + z1^2 / E1 + z2^2 / E2 against z3^2 / E3, E the sums
    of squares of the stations along their axes.
    """
    one = len(planes.count) == 1  # what all share is not copied for each
    y = (planes.half_square[0] if one else planes.half_square[which]) - d * d / 2
    z = y @ planes.rows[0].T if one else np.einsum("ks,kcs->kc", y, planes.rows[which])
    lever = planes.rows[0, 2] if one else planes.rows[which, 2]
    variance = np.sum((lever * d * np.where(u < np.inf, u, 0.0)) ** 2, axis=1)
    square = -2.0 * y.sum(axis=1) / planes.count[which] - z[:, 0] ** 2 - z[:, 1] ** 2
    told = z[:, 2] ** 2 > SIGNIFICANT**2 * variance
    bound = np.minimum(planes.inverse[which], 1e200)  # finite, so that nothing times it is nothing
    level = 1.0 / planes.count[which] + np.sum(z[:, :2] ** 2 * bound[:, :2], axis=1)
    spread = told & ((square < 0.25 * z[:, 2] ** 2) | (z[:, 2] ** 2 * bound[:, 2] < level))
    height = np.where(spread, np.abs(z[:, 2]), np.sqrt(np.maximum(square, 0.0)))
    foot = planes.centre[which] + np.einsum("kc,kca->ka", z[:, :2], planes.axes[which, :2])
    return foot, height, np.where(told, np.sign(z[:, 2]), 0.0)


def _solve(
    s: np.ndarray,
    d: np.ndarray,
    u: np.ndarray,
    *,
    near: np.ndarray | None,
    whole: _Planes,
    origin: np.ndarray,
    part: Positions,
    locate: Callable | None,
) -> None:
    """Positions of one chunk, written into `part`; what does not go smoothly from one start is left to `_judge`."""
    lanes = np.arange(len(d))
    low, high = u.min(), u.max()
    if np.isnan(low):  # beside missing ranges sigma may be nan too
        low, high = np.fmin.reduce(u, axis=None), np.fmax.reduce(u, axis=None)
    weighed = bool(low > 0.0 and high < np.inf)
    if locate is not None and weighed and whole.count[0] >= 3 and not whole.collinear[0]:
        part.status[:], part.ranges[:] = Status.FOUND, len(s)
        side = np.zeros(len(d)) if near is None else np.nan_to_num(np.sign((near - whole.centre[0]) @ whole.axes[0, 2]))
        good = _compiled(locate, s, d, u, planes=whole, side=side, origin=origin, part=part, closed=True)
        lanes = np.flatnonzero(~good)
        if not len(lanes):
            return
        d, u = d[lanes], _rows(u, lanes)
    complete = bool(d.min() >= 0.0 and d.max() < np.inf and u.min() > 0.0 and u.max() < np.inf)
    planes, which, refused, given, d, u = (_all_seen if complete else _sorted_out)(s, d, u, whole)
    part.ranges[lanes], part.iterations[lanes], part.pvv[lanes] = given, 0, np.nan
    status = np.select(
        [refused, planes.count[which] < 3, planes.collinear[which]],
        [Status.REFUSED, Status.TOO_FEW, Status.COLLINEAR],
        Status.FOUND,
    )
    part.status[lanes], part.x[lanes], part.covariance[lanes] = status, np.nan, np.nan
    possible = status == Status.FOUND
    lanes, d, u, which = lanes[possible], d[possible], _rows(u, possible), which[possible]
    if not len(lanes):
        return
    side = np.zeros(len(d))
    if near is not None:
        towards = near[lanes] if len(near) > 1 else near
        side = np.nan_to_num(np.sign(np.sum((towards - planes.centre[which]) * planes.axes[which, 2], axis=1)))
    _images(s, d, u, planes=planes, which=which, side=side, origin=origin, part=part, lanes=lanes, locate=locate)


def _compiled(
    locate: Callable,
    s: np.ndarray,
    d: np.ndarray,
    u: np.ndarray,
    *,
    planes: _Planes,
    side: np.ndarray,
    origin: np.ndarray,
    part: Positions,
    closed: bool,
) -> np.ndarray:
    """Runs the compiled form into `part`, from the closed form or from what stands in part.x; True where it vouches."""
    good = np.empty(len(d), dtype=bool)
    frame = np.concatenate([planes.centre[:1], planes.axes[0], planes.inverse[:1]])
    limits = (SIGNIFICANT, ENOUGH, SINGULAR, BENT)
    most = np.full(len(d), _most(np.array(len(s)))) if closed else _most(part.ranges)
    answer = (part.x, part.covariance, part.pvv, part.iterations, good)
    locate(d, u, s, closed, planes.half_square[0], planes.rows[0], frame, side, limits, most, origin, *answer)
    return good


def _most(ranges: np.ndarray) -> np.ndarray:
    """The pvv above which ranges contradict each other."""
    return np.where(ranges > 3, CONTRADICTION**2 * (ranges - 3.0), 1.0)


def _all_seen(s: np.ndarray, d: np.ndarray, u: np.ndarray, whole: _Planes) -> tuple:
    k = len(d)
    return whole, np.zeros(k, dtype=int), np.zeros(k, dtype=bool), np.full(k, len(s)), d, u


def _sorted_out(s: np.ndarray, d: np.ndarray, u: np.ndarray, whole: _Planes) -> tuple:
    """Planes and patterns of what is seen, targets to refuse, ranges given; d, u with missing ones made harmless."""
    given = ~np.isnan(d)
    refused = (given & ~((d >= 0.0) & (d < np.inf) & (u > 0.0) & (u < np.inf))).any(axis=1)
    seen = given & ~refused[:, None]
    patterns, which = _patterns(seen)
    return _planes(s, patterns), which, refused, given.sum(axis=1), np.where(seen, d, 0.0), np.where(seen, u, np.inf)


def _images(
    s: np.ndarray,
    d: np.ndarray,
    u: np.ndarray,
    *,
    planes: _Planes,
    which: np.ndarray,
    side: np.ndarray,
    origin: np.ndarray,
    part: Positions,
    lanes: np.ndarray,
    locate: Callable | None,
) -> None:
    """Answers of targets that three ranges or more may hold; both mirror images are tried where one does not do."""
    foot, height, sign = _starts(planes, which, d, u)
    sign = np.where(sign == 0.0, side, sign)
    normal = planes.axes[which, 2]
    start = foot + (sign * height)[:, None] * normal
    count = planes.count[which]
    if locate is not None and len(lanes) * len(s) >= LANES:
        made = Positions(
            start, np.empty((len(d), 3, 3)), np.empty(0), count, np.empty(len(d), np.int32), np.empty(len(d))
        )
        good = _compiled(locate, s, d, u, planes=planes, side=side, origin=0 * origin, part=made, closed=False)
        found = _Descent(start, made.covariance, made.pvv, made.iterations, np.zeros(len(d)), good)
    else:
        found = _descend(s, d, u, start)
        good = found.ended & (found.bend < BENT) & (found.pvv <= _most(count))
    good &= sign * height != 0.0
    _write(part, lanes, found, origin)
    rest = np.flatnonzero(~good)
    if not len(rest):
        return
    d, u, count, side = d[rest], _rows(u, rest), count[rest], side[rest]
    height = np.maximum(height[rest], 1e-3 * np.sqrt(np.sum(d * d, axis=1) / count))  # the plane itself is singular
    up = height[:, None] * normal[rest]
    best, status = _judge(s, d, u, _descend(s, d, u, foot[rest] + up), _descend(s, d, u, foot[rest] - up), side, count)
    _write(part, lanes[rest], best, origin)
    part.status[lanes[rest]] = status
    without = lanes[rest[status > Status.CONTRADICTING]]
    part.x[without], part.covariance[without] = np.nan, np.nan


def _judge(
    s: np.ndarray, d: np.ndarray, u: np.ndarray, one: "_Descent", two: "_Descent", side: np.ndarray, count: np.ndarray
) -> tuple["_Descent", np.ndarray]:
    """The better of two images, one on the side of the normal, and its status."""
    gap = two.pvv - one.pvv
    decided = np.abs(gap) > SIGNIFICANT**2  # a difference of pvv is the square of sigmas
    spread = np.sqrt(np.maximum(np.trace(one.covariance, axis1=1, axis2=2), 0.0))
    same = np.linalg.norm(one.x - two.x, axis=1) <= 1e-3 * spread
    first = np.where(decided, gap > 0.0, side >= 0.0)
    best, other = one.where(first, two), two.where(first, one)
    status, second = _verdict(s, d, u, best, count), _verdict(s, d, u, other, count)
    open_ = ~decided & ~same & (side == 0.0) & (status <= Status.CONTRADICTING)
    status = np.where(open_, np.where(second <= Status.CONTRADICTING, Status.AMBIGUOUS, second), status)
    return best, status


@dataclass(frozen=True, eq=False)
class _Descent:
    """Ends of descents; `bend` is what BENT limits, `ended` False at the cap or where only damping held it."""

    x: np.ndarray
    covariance: np.ndarray
    pvv: np.ndarray
    iterations: np.ndarray
    bend: np.ndarray
    ended: np.ndarray

    def where(self, first: np.ndarray, other: "_Descent") -> "_Descent":
        """This one's lanes where `first`, else the other's."""
        return _Descent(
            *(
                np.where(first.reshape(-1, *[1] * (a.ndim - 1)), a, b)
                for a, b in ((getattr(self, n), getattr(other, n)) for n in _Descent.__dataclass_fields__)
            )
        )


def _rows(u: np.ndarray, lanes: np.ndarray) -> np.ndarray:
    return u[lanes] if len(u) > 1 else u


def _write(part: Positions, lanes: np.ndarray, found: _Descent, origin: np.ndarray) -> None:
    part.x[lanes], part.covariance[lanes] = found.x + origin, found.covariance
    part.pvv[lanes], part.iterations[lanes] = found.pvv, found.iterations


def _verdict(s: np.ndarray, d: np.ndarray, u: np.ndarray, found: _Descent, count: np.ndarray) -> np.ndarray:
    """Status of each descent's end, as if it had been the only one."""
    apart = np.linalg.norm(found.x[:, None, :] - s, axis=2)
    at_station = (apart < 4.0 * np.where(u < np.inf, u, 0.0)).any(axis=1)
    flat = ~(found.bend < BENT)
    freedom = count - 3
    return np.select(
        [
            flat & at_station,
            flat & (found.pvv > MISSED**2 * count),
            flat,
            ~found.ended,
            (freedom > 0) & (found.pvv > CONTRADICTION**2 * freedom),
        ],
        [Status.AT_STATION, Status.DISJOINT, Status.NOT_HELD, Status.NOT_CONVERGED, Status.CONTRADICTING],
        Status.FOUND,
    )


def _normal(s: np.ndarray, d: np.ndarray, root: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Normal matrix (0:6, upper rows), right side (6:9), cost (9), squared curvature (10) of lanes: (11, k).

    s (m, 3); d (m, k); root (m, k) or (m, 1), reciprocal sigmas; x (3, k)
    """
    delta = [x[c] - s[:, c : c + 1] for c in range(3)]
    f = delta[0] ** 2 + delta[1] ** 2 + delta[2] ** 2
    np.sqrt(f, out=f)
    np.maximum(f, 1e-150, out=f)  # on a station: a direction of zero length, an endless curvature
    v = (d - f) * root
    np.divide(root, f, out=f)
    a = [v_ * f for v_ in delta]
    pairs = [(a[0], a[0]), (a[0], a[1]), (a[0], a[2]), (a[1], a[1]), (a[1], a[2]), (a[2], a[2])]
    pairs += [(a[0], v), (a[1], v), (a[2], v), (v, v), (f, f)]
    return np.stack([np.einsum("mk,mk->k", p, q) for p, q in pairs])


def _inverse(n: np.ndarray, damping: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Inverses (6, k) of normal matrices (upper rows) with damping on the diagonal, and whether they are regular."""
    n0, n3, n5 = n[0] + damping, n[3] + damping, n[5] + damping
    n1, n2, n4 = n[1], n[2], n[4]
    q = np.stack(
        [n3 * n5 - n4**2, n2 * n4 - n1 * n5, n1 * n4 - n2 * n3, n0 * n5 - n2**2, n1 * n2 - n0 * n4, n0 * n3 - n1**2]
    )
    determinant = n0 * q[0] + n1 * q[1] + n2 * q[2]
    regular = determinant > SINGULAR * (n0 + n3 + n5) ** 3
    return q / np.where(regular, determinant, np.nan), regular


SQUARE = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # where the six upper entries go


def _descend(s: np.ndarray, d: np.ndarray, u: np.ndarray, start: np.ndarray) -> _Descent:
    """Gauss-Newton from start (k, 3), damped after Levenberg and Marquardt where a step would go uphill."""
    k = len(d)
    out = _Descent(
        start.copy(),
        np.full((k, 3, 3), np.nan),
        np.full(k, np.nan),
        np.zeros(k, int),
        np.full(k, np.inf),
        np.zeros(k, bool),
    )
    lanes, x, damping = np.arange(k), np.ascontiguousarray(start.T), np.zeros(k)
    d, root = np.ascontiguousarray(d.T), np.ascontiguousarray(1.0 / u.T)
    a = _normal(s, d, root, x)
    for taken in range(1, CAP + 1):
        q, regular = _inverse(a, damping)
        step = np.stack([np.sum(q[row] * a[6:9], axis=0) for row in SQUARE])
        square = np.sum(step * step, axis=0)
        gain = np.sum(step * a[6:9], axis=0)
        foreseen = a[10] * square * (square / 2 + 2.0 * a[9] * (q[0] + q[3] + q[5]))  # (p + q)^2 <= 2 p^2 + 2 q^2
        free = damping == 0.0
        done = regular & np.where(free, foreseen < ENOUGH**2, gain < NOTHING**2)
        trial = np.where(regular, x + step, x)
        leaving = done | (taken == CAP)
        if leaving.any():
            _leave(out, lanes[leaving], a[:, leaving], trial[:, leaving], gain[leaving], taken)
            out.ended[lanes[done & free]] = True
            stay = ~leaving
            lanes, damping, regular = lanes[stay], damping[stay], regular[stay]
            x, trial, a, d = x[:, stay], trial[:, stay], a[:, stay], d[:, stay]
            root = root[:, stay] if root.shape[1] > 1 else root
            if not len(lanes):
                break
        b = _normal(s, d, root, trial)
        better = regular & (b[9] <= a[9] * ROUNDING + NOTHING)
        trace = a[0] + a[3] + a[5]
        damping = np.where(better, np.where(damping > 1e-8 * trace, damping / 10, 0.0), damping * 10)
        damping = np.where(better, damping, np.maximum(damping, 1e-4 * trace))
        x, a = np.where(better, trial, x), np.where(better, b, a)
    return out


def _leave(out: _Descent, lanes: np.ndarray, a: np.ndarray, x: np.ndarray, gain: np.ndarray, taken: int) -> None:
    """What is known of lanes at the end of their descent."""
    q, regular = _inverse(a)
    out.x[lanes], out.covariance[lanes] = x.T, q[SQUARE].transpose(2, 0, 1)
    out.pvv[lanes], out.iterations[lanes] = np.maximum(a[9] - np.where(regular, gain, 0.0), 0.0), taken
    out.bend[lanes] = np.where(regular, np.sqrt(a[10]) * (q[0] + q[3] + q[5]) / 2, np.inf)
