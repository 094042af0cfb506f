"""Positions from three ranges to known stations: closed form, covariance, and the notes' iteration.

More ranges than three: `positions`. Thresholds are pure numbers, relative to the size of the stations' figure.
"""

from dataclasses import dataclass

import numpy as np

from catseye.errors import InputError
from catseye.estimation.network.positions.status import PositionStatus

FLAT = 1e-13  # squared extent over largest squared extent: flatness limit in double precision


@dataclass(frozen=True, eq=False)
class Trilateration:
    """Intersections of three spheres.

    x            (..., 2, 3) m: first the point above the stations' plane, from where stations 1, 2, 3 run
                 anticlockwise (the side of (s2 - s1) x (s3 - s1)), then its mirror image below; nan without solution
    height       (...) m of the first above that plane; nan without solution
    misclosure   (..., 3) m by which each range is too short to reach the foot, the radical centre in the plane; zero
                 if they meet, nan for collinear stations
    status       (...) int8 of `PositionStatus`: FOUND, COLLINEAR, DISJOINT or REFUSED
    """

    x: np.ndarray
    height: np.ndarray
    misclosure: np.ndarray
    status: np.ndarray


def trilaterate(stations: np.ndarray, distances: np.ndarray) -> Trilateration:
    """Both points at three distances from three stations, in closed form.

    stations    (..., 3, 3) m, one station per row
    distances   (..., 3) m, not negative

    With origin at the station of the shortest range, a and b to the others and n = a x b, the foot in the plane obeys
    f.a = (d0^2 - d1^2 + a^2) / 2 and likewise b; the height is the root of d0^2 - f^2. A square that is negative
    within rounding counts as zero. Never raises for a value: see the status.

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
    status = np.select(
        [~usable, ~apart, ~meet],
        [PositionStatus.REFUSED, PositionStatus.COLLINEAR, PositionStatus.DISJOINT],
        PositionStatus.FOUND,
    )
    return Trilateration(np.stack([base + up, base - up], axis=-2), height, misclosure, status.astype(np.int8))


def trilateration_covariance(
    stations: np.ndarray,
    x: np.ndarray,
    *,
    u_distances: np.ndarray,
    station_covariance: np.ndarray | None = None,
) -> np.ndarray:
    """Covariance (..., 3, 3) in m^2 of a point from three ranges, to first order.

    stations             (..., 3, 3) m
    x                    (..., 3) m, either of the two points
    u_distances          (..., 3) m, standard uncertainties of the ranges, independent
    station_covariance   (..., 3, 3, 3) m^2, one block per station, or (..., 9, 9) of all three jointly; None if exact

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
    """Result of `trilaterate_by_averaging`.

    x            (..., 3) m, the last average; nan if singular
    difference   (...) m between the last old and new values
    iterations   (...) solutions of eq. 3.7 taken
    status       (...) int8 of `PositionStatus`: FOUND, NOT_CONVERGED (at the limit; x is then invalid), or NOT_HELD
                 (singular)
    averages     (k, ..., 3) m, x after each of the k steps; of a target that has ended, its last
    differences  (k, ...) m, between old and new values of each step
    """

    x: np.ndarray
    difference: np.ndarray
    iterations: np.ndarray
    status: np.ndarray
    averages: np.ndarray
    differences: np.ndarray


def trilaterate_by_averaging(
    stations: np.ndarray,
    distances: np.ndarray,
    start: np.ndarray,
    *,
    epsilon: float = 1e-9,
    iterations: int = 50,
) -> AveragedIteration:
    """Point at three distances from three stations, by the iteration of the notes.

    stations     (..., 3, 3) m
    distances    (..., 3) m
    start        (..., 3) m, off the stations' plane, on the side of the solution
    epsilon      m, agreement of old and new values
    iterations   limit; status NOT_CONVERGED there, as always if the ranges do not meet

    Eq. 3.3 is (r - r_i).(r~ - r_i) = R_i^2: eq. 3.1 at r~ = r. Its own solutions r~ = r, 3.7 unaveraged, flip the error
    e = r - answer to -e + O(e^2) and never converge. Since r~ - r solves (r - r_i).(r~ - r) = R_i^2 - |r - r_i|^2, half
    of it is Newton's step for 3.1: the average *is* Newton's method, of second order. Precisely, the next error is
    |e|^2 / (2 h) along the normal of the stations' plane, h the present height over it: after one step the point is
    exact in the plane, and the height obeys Heron's h' = (h + H^2 / h) / 2. So it converges from anywhere off the
    plane, to the image on the start's side; without a real H it never converges.

    Source: [PARKER04] eqs. 3.3-3.7 and the text above them.
    """
    s, d = _three(stations, distances)
    start = np.asarray(start, dtype=float)
    shape = np.broadcast_shapes(d.shape[:-1], start.shape[:-1])
    origin = s[..., :1, :]  # coordinates relative to a station: the products of 3.7 then keep their digits
    s, origin = np.broadcast_to(s - origin, (*shape, 3, 3)), np.broadcast_to(origin[..., 0, :], (*shape, 3))
    right = np.broadcast_to(d**2 - np.sum((s * s), axis=-1), (*shape, 3))
    r = start - origin
    status = np.full(shape, PositionStatus.NOT_CONVERGED, dtype=np.int8)
    difference, steps = np.full(shape, np.nan), np.zeros(shape, dtype=int)
    averages, differences = [], []
    for _ in range(iterations):
        open_ = status == PositionStatus.NOT_CONVERGED
        if not open_.any():
            break
        columns, determinant = _cofactors(r[..., None, :] - s)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            new = np.sum(columns * (right + np.sum(s * r[..., None, :], axis=-1))[..., None, :], axis=-1)
            new = new / determinant[..., 0]
            step = np.linalg.norm(new - r, axis=-1)
        singular = open_ & ~np.isfinite(step)
        r = np.where(singular[..., None], np.nan, np.where(open_[..., None], (r + new) / 2, r))
        difference, steps = np.where(open_, step, difference), steps + open_
        averages.append(r + origin)
        differences.append(difference)
        status[singular], status[open_ & (step <= epsilon)] = PositionStatus.NOT_HELD, PositionStatus.FOUND
    return AveragedIteration(
        x=r + origin,
        difference=difference,
        iterations=steps,
        status=status,
        averages=np.array(averages).reshape(-1, *shape, 3),
        differences=np.array(differences).reshape(-1, *shape),
    )


def _three(stations: np.ndarray, distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stations and distances of equal batch shape, as floats."""
    s, d = np.asarray(stations, dtype=float), np.asarray(distances, dtype=float)
    if s.shape[-2:] != (3, 3) or d.shape[-1:] != (3,):
        raise InputError(f"stations {s.shape} and distances {d.shape}: (..., 3, 3) and (..., 3) are expected")
    shape = np.broadcast_shapes(s.shape[:-2], d.shape[:-1])
    return np.broadcast_to(s, (*shape, 3, 3)), np.broadcast_to(d, (*shape, 3))


def _cofactors(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Transposed cofactors (..., 3, 3) and determinant (..., 1, 1) of matrices given by rows."""
    p, q, r = rows[..., 0, :], rows[..., 1, :], rows[..., 2, :]
    columns = np.stack([np.cross(q, r), np.cross(r, p), np.cross(p, q)], axis=-1)
    return columns, np.sum(p * columns[..., 0], axis=-1)[..., None, None]
