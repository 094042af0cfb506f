"""Sun avoidance of a ranger: moves refused, beam driven away.

It works whatever the ranger is commanded. The coordinator's unit vector to the Sun (SUN) is one source, the ranger's
own, from its clock and place, another: each has its cone. A wrong vector can so only add a cone. Cone size is open in
the sources; 5 degrees, as in the site's keep-out record. Axes that are started one by one, or while the other moves,
may pass any pair of counts between their ends; so a move is checked for the whole rectangle of counts, which refuses a
few moves that would be safe.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import DEGREE, SECONDS_PER_DAY
from catseye.geometry.clearance.keep_out import servo_margin
from catseye.geometry.mirror.encoder import COUNTS_PER_TURN
from catseye.geometry.mirror.pointing import MirrorStation, beam
from catseye.geometry.sky.sun import EARLIEST_MJD, altitude_azimuth
from catseye.records.site.site import Location
from catseye.reduction.site.earth_rotation import FramePlace, place_of, rotation_at, sun_at

HALF_ANGLE = 5.0 * DEGREE
MARGIN = servo_margin([20.0, 20.0])  # overshoot
LARGEST_STEP = 400  # counts between two samples: 1.4 deg of azimuth, 2.9 of the beam's elevation
PARKED = 20.0 * DEGREE  # from the Sun, at which a beam is left parked: 80 minutes of its path
SET = -1.5 * DEGREE  # altitude below which its rim has set also for a ranger 100 m up
SunSource = Callable[[float], ArrayLike | None]  # MJD -> vector in the ground frame, None if it is set


class OwnSun:
    """Direction of the Sun at a place, updated once a second.

    Error 7.5" at most.

    place   of the ground frame's origin
    """

    def __init__(self, place: FramePlace):
        self._place = place
        self._second = -1
        self._seen: NDArray[np.float64] | None = None

    def __call__(self, mjd: float) -> NDArray[np.float64] | None:
        """Unit vector (3,), ground frame; None if the Sun is set."""
        second = int(mjd * SECONDS_PER_DAY)
        if second != self._second:
            towards = sun_at((second + 0.5) / SECONDS_PER_DAY, self._place).direction
            altitude, _ = altitude_azimuth(towards)
            self._second, self._seen = second, None if altitude < SET else towards
        return self._seen


def sun_of_site(site: Location) -> OwnSun:
    """Sun of a site record's table [site], for its ground rangers.

    The Earth rotation table is read now.
    """
    rotation_at(EARLIEST_MJD)  # takes a second or two, which no loop of a ranger should wait for
    return OwnSun(place_of(site))


def nearest_sun(
    station: MirrorStation, start: ArrayLike, end: ArrayLike, *, suns: Sequence[ArrayLike], exact: bool = False
) -> float:
    """Least angle of the beam to any Sun during a move, rad.

    Both axes move between counts; inf without a Sun.

    station      the ranger
    start, end   (2,) counts, azimuth and elevation
    suns         vectors (3,), ground frame, any length
    exact        at `end` only

    The rectangle of counts is sampled on a grid, and half a cell's diagonal is subtracted, so it is never too large.
    Directions only: the Sun is turned by gamma then lambda. Source: [PARKER04] section 2.7, eq. 2.47.
    """
    if not suns:
        return float("inf")
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    number = np.ones(2, dtype=int) if exact else np.ceil(np.abs(b - a) / LARGEST_STEP).astype(int) + 1
    grid = [np.linspace(a[k], b[k], number[k]) if number[k] > 1 else b[k : k + 1] for k in (0, 1)]
    half = [0.5 * np.ptp(g) / max(len(g) - 1, 1) for g in grid]
    looks = beam(station, np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 2))
    return float(np.min(_angles(station, looks, suns))) - servo_margin(half)


def refusal(station: MirrorStation, start: ArrayLike, end: ArrayLike, *, suns: Sequence[ArrayLike]) -> str | None:
    """Reason why a move is not allowed, in words; None if it is.

    station, start, end, suns   as for `nearest_sun`

    A move that begins inside a Sun's cone is allowed if it ends outside and nowhere comes nearer than at its start, as
    far as the grid can tell: 1.6 deg.
    """
    allowed, all_least = HALF_ANGLE + MARGIN, nearest_sun(station, start, end, suns=suns)
    if all_least >= allowed:
        return None
    blocked = []
    for sun in suns:
        least = nearest_sun(station, start, end, suns=[sun])
        begin, final = (nearest_sun(station, start, at, suns=[sun], exact=True) for at in (start, end))
        leaves = begin < allowed <= final and least >= begin - servo_margin([0.5 * LARGEST_STEP] * 2)
        if least < allowed and not leaves:
            blocked.append(least)
    if not blocked:
        return None
    least = min(blocked)
    return (
        f"the beam could come within {max(least, 0.0) / DEGREE:.1f} deg of the Sun (expected at least "
        f"{allowed / DEGREE:.1f}): choose another path or wait"
    )


def way_out(
    station: MirrorStation, position: ArrayLike, suns: Sequence[ArrayLike], *, limits: tuple[float, float]
) -> tuple[int, int] | None:
    """Counts of the shortest safe move out of a cone, or None.

    A move of one axis that ends 20 deg from every Sun.

    station, suns   as for `nearest_sun`
    position        (2,) counts of the mirror
    limits          counts, lowest and highest azimuth

    None if no such move of a quarter turn of azimuth or of the beam's elevation is safe.
    """
    at = np.asarray(position, dtype=float)
    steps = LARGEST_STEP * np.arange(1, round(COUNTS_PER_TURN / 4 / LARGEST_STEP) + 1)
    signed_steps = np.stack([steps, -steps], axis=1).ravel()  # near ones first
    azimuth = at + np.stack([signed_steps, np.zeros(len(signed_steps))], axis=1)
    elevation = (
        at + np.stack([np.zeros(len(signed_steps)), signed_steps], axis=1)[: len(signed_steps) // 2]
    )  # the beam turns twice as far
    elevation = elevation[np.abs(elevation[:, 1] - station.zeros[1]) <= COUNTS_PER_TURN / 4]  # Phi of half a turn
    ends = np.concatenate([elevation, azimuth[(azimuth[:, 0] >= limits[0]) & (azimuth[:, 0] <= limits[1])]])
    for end in ends[np.min(_angles(station, beam(station, ends), suns), axis=1) >= PARKED]:
        if refusal(station, at, end, suns=suns) is None:
            return round(float(end[0])), round(float(end[1]))
    return None


def sun_departure_mjd(station: MirrorStation, position: ArrayLike, sun: SunSource, mjd: float) -> float | None:
    """MJD, to a minute, at which the Sun leaves a parked beam.

    None if that takes over a day.

    station, position  as for `way_out`
    sun             its direction, as a ranger knows it
    """
    for minute in range(24 * 60 + 1):
        at = mjd + minute / (24 * 60)
        direction = sun(at)
        if direction is None or nearest_sun(station, position, position, suns=[direction], exact=True) >= HALF_ANGLE:
            return at
    return None


def _angles(station: MirrorStation, looks: NDArray[np.float64], suns: Sequence[ArrayLike]) -> NDArray[np.float64]:
    """Angles (n, suns), rad, between beams (n, 3) and Suns."""
    inside: NDArray[np.float64] = np.stack([np.asarray(s, dtype=float) for s in suns])
    turned = inside / np.linalg.norm(inside, axis=-1, keepdims=True) @ station.mirror_from_ground.T
    return np.arccos(np.clip(looks @ turned.T, -1.0, 1.0))
