"""Linear tracks in counts between two instants, and the beam's error.

The ranger receives the target's places at t0 and t1, computes the counts of both and runs both axes at a constant
rate in between. The exact counts are curved functions of time; with curvature N'' their chord is off by N'' h^2/8 in
the middle of an interval h, at most by max|N''| h^2/8 anywhere (the remainder of linear interpolation).

In mirror axes, with rho the distance from the azimuth axis and v_R, v_Phi, v_Theta, a_... the components of the
target's velocity and acceleration along the beam, along increasing Phi and along increasing Theta:

    Theta'' = a_Theta/rho - 2 v_Theta v_rho/rho^2
    Phi''   = a_Phi/R - 2 v_R v_Phi/R^2 + v_Theta^2 cot(Phi)/R^2

Of |v| <= V, |a| <= A it follows that |Theta''| <= A/rho + V^2/rho^2 and |Phi''| <= A/R + V^2 max(1, |cot Phi|)/R^2.
Both grow without limit towards the azimuth axis, which for a ground ranger looks at the pintle: there the interval must
shrink, and the interval chosen here does.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.geometry.mirror.encoder import BEAM_PER_COUNT
from catseye.geometry.mirror.imperfect import Imperfections, imperfect_ray
from catseye.geometry.mirror.pointing import MirrorStation, ray

HALVINGS = 60  # of an interval: its last bit


@dataclass(frozen=True, eq=False)
class CountLine:
    """Counts at constant rates, (...) lines.

    start, end    (..., 2) counts (Na, Ne) at t0 and t1, azimuth on the same turn
    interval      (...) s, t1 - t0, above 0

    Source: [PARKER04] eqs. 2.45, 2.46.
    """

    start: Array
    end: Array
    interval: Array

    @property
    def rate(self) -> Array:
        """Speed of both axes, (..., 2) counts/s."""
        return (self.end - self.start) / self.interval[..., None]

    def at(self, since: ArrayLike) -> Array:
        """Counts (..., 2), real numbers, at seconds after t0; broadcasts against the lines.

        >>> CountLine(np.array([0.0, 100.0]), np.array([32.0, 90.0]), np.array(0.128)).at(0.064).tolist()
        [16.0, 95.0]
        """
        share = np.asarray(since, dtype=float) / self.interval
        return self.start + (self.end - self.start) * share[..., None]


def miss(
    station: MirrorStation, counts: ArrayLike, points: ArrayLike, imperfections: Imperfections | None = None
) -> Array:
    """Distance (...), m, of the beam from a point.

    From a point behind the mirror, to the beam's start.

    station         ranger(s), broadcast against the others
    counts          (..., 2) Na, Ne, direct or prime
    points          (..., 3), m, ground frame
    imperfections   of the mirror(s): the beam starts on the face, where the offsets put it; None: an ideal mirror

    Source: [PARKER04] eqs. 2.12-2.22 turned round (`pointing.ray`, `imperfect.imperfect_ray`), and the distance of a
    point from a ray. Exact.
    """
    n = np.asarray(counts, dtype=float)
    origin, direction = ray(station, n) if imperfections is None else imperfect_ray(station, imperfections, n)
    away = np.asarray(points, dtype=float) - origin
    opposite = np.sum(away * direction, axis=-1) < 0.0
    passed = np.linalg.norm(np.cross(away, direction), axis=-1)
    return np.where(opposite, np.linalg.norm(away, axis=-1), passed)


def apparent_motion(
    mirror_from_ground: ArrayLike,
    relative: ArrayLike,
    velocity: ArrayLike,
    *,
    acceleration: ArrayLike,
    spin: ArrayLike = (0.0, 0.0, 0.0),
    spin_rate: ArrayLike = (0.0, 0.0, 0.0),
) -> tuple[Array, Array, Array]:
    """Place, velocity and acceleration (..., 3) of a target in ranger axes.

    The ranger may itself move and turn.

    mirror_from_ground    (..., 3, 3), `MirrorStation.mirror_from_ground`
    relative              (..., 3), m, ground axes: target less scan point
    velocity              (..., 3), m/s, ground axes: of that vector
    acceleration          (..., 3), m/s^2, ground axes
    spin, spin_rate       (..., 3), rad/s and rad/s^2, ground axes: the ranger's rotation; zero on the ground

    Source: kinematics of turning axes: v - w x r, and a - 2 w x v - w' x r + w x (w x r). Exact.
    """
    m = np.asarray(mirror_from_ground, dtype=float)
    r, v, a, w, dw = (np.asarray(x, dtype=float) for x in (relative, velocity, acceleration, spin, spin_rate))
    seen_v = v - np.cross(w, r)
    seen_a = a - 2.0 * np.cross(w, v) - np.cross(dw, r) + np.cross(w, np.cross(w, r))

    def turned(x: Array) -> Array:
        return np.asarray(np.einsum("...ij,...j->...i", m, x))

    return turned(r), turned(seen_v), turned(seen_a)


def line_bound(
    vector: ArrayLike, speed: ArrayLike, acceleration: ArrayLike, *, interval: ArrayLike
) -> tuple[Array, Array, Array]:
    """Bounds of the line's error over an interval: counts, angle, distance.

    Counts (..., 2), an angle (...) rad, a distance (...) m.

    vector          (..., 3), m, mirror axes: the target at t0
    speed           (...), m/s: its apparent speed at t0
    acceleration    (...), m/s^2: bound of its apparent acceleration during the interval
    interval        (...), s

    However the target moves within these, it stays within reach = speed h + acceleration h^2/2 of its place at t0; the
    formulas at the top, taken at the worst place within reach, times h^2/8. Infinite where it could reach the azimuth
    axis. Raises ValidityError for a speed, acceleration or interval below 0 (a rate has a sign, a speed none) or NaN.

    Source: derived at the top of this file. A strict bound, larger than the actual error by a factor of some 2 to 5.

    >>> counts, angle, way = line_bound([0.0, 120.0, 0.0], 1.0, 0.0, interval=0.128)
    >>> counts.round(5).tolist(), round(float(way), 7)
    ([0.00227, 0.00113], 2.42e-05)
    """
    p = _shaped(vector, 3, "vector")
    v0, a, h = (np.asarray(value, dtype=float) for value in (speed, acceleration, interval))
    for name, value in (("speed", v0), ("acceleration", a), ("interval", h)):
        if not np.all(value >= 0.0):
            raise ValidityError(f"{name} {value[~(value >= 0.0)].flat[0]} is not 0 or more (a magnitude is expected)")
    reach, fastest = v0 * h + 0.5 * a * h**2, v0 + a * h
    axis, far = np.hypot(p[..., 0], p[..., 1]), np.linalg.norm(p, axis=-1)
    rho, r = axis - reach, far - reach
    with np.errstate(divide="ignore", invalid="ignore"):
        cotangent = (np.abs(p[..., 2]) + reach) / rho
        theta = (a / rho + (fastest / rho) ** 2) * h**2 / 8.0
        phi = (a / r + np.maximum(1.0, cotangent) * (fastest / r) ** 2) * h**2 / 8.0
        sine = np.minimum(1.0, (axis + reach) / r + phi)  # along any path between beam and target
        angle = np.hypot(phi, sine * theta)
    clear = rho > 0.0
    counts = np.stack([theta, phi], axis=-1) / BEAM_PER_COUNT
    return (
        np.where(clear[..., None], counts, np.inf),
        np.where(clear, angle, np.inf),
        np.where(clear, angle * (far + reach), np.inf),
    )


def longest_interval(
    vector: ArrayLike,
    speed: ArrayLike,
    acceleration: ArrayLike,
    *,
    limit_counts: float = 0.25,
    limit_angle: float | None = None,
    longest: float = 3600.0,
) -> Array:
    """Longest interval (...), s, that keeps the line's error within a limit.

    vector          (..., 3), m, mirror axes: the target at t0
    speed           (...), m/s: its apparent speed at t0
    acceleration    (...), m/s^2: bound of its apparent acceleration meanwhile
    limit_counts    above 0: of either axis; a quarter by default
    limit_angle     rad, above 0: of the beam on the sky, instead of counts
    longest         s, above 0: upper limit of the result

    It uses the bound, so that no motion within the given speeds and accelerations exceeds the limit; 0 on the
    azimuth axis itself. Raises ValidityError for limits that are not above 0.

    Source: `line_bound`, solved by halving from below.

    >>> round(float(longest_interval([0.0, 120.0, 0.0], 1.0, 0.02)), 3)
    0.724
    """
    limit = limit_counts if limit_angle is None else limit_angle
    for name, value in (("limit", limit), ("longest", longest)):
        if not 0.0 < value < np.inf:
            raise ValidityError(f"{name} = {value} is not above 0 and finite")

    def within_limit(h: Array) -> NDArray[np.bool_]:
        counts, angle, _ = line_bound(vector, speed, acceleration, interval=h)
        off = np.max(counts, axis=-1) if limit_angle is None else angle
        return np.asarray(off <= limit)

    shape = np.broadcast_shapes(np.shape(vector)[:-1], np.shape(speed), np.shape(acceleration))
    low, high = np.zeros(shape), np.full(shape, float(longest))
    low = np.where(within_limit(high), high, low)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        good = within_limit(middle)
        low, high = np.where(good, middle, low), np.where(good, high, middle)
    return low


def _shaped(values: ArrayLike, last: int, what: str) -> Array:
    array = np.asarray(values, dtype=float)
    if array.shape[-1:] != (last,):
        raise ValidityError(f"{what} has shape {array.shape}, expected (..., {last})")
    return array
