"""A ranger refuses by itself to look into the Sun, whatever it is told.

The coordinator's unit vector to the Sun (SUN) is one source, the ranger's own, from its clock and place, another: each
has its cone. A vector that lies can so only add a cone. Cone size is open in the sources; 5 degrees, as in the site's
keep-out record. Axes that are started one by one, or while the other moves, may cross any pair of counts between their
ends; so a move is asked for the whole rectangle of counts, which refuses a few moves that would be free.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import DEGREE
from catseye.geometry.keep_out import servo_margin
from catseye.geometry.pointing import Station, beam

HALF_ANGLE = 5.0 * DEGREE
MARGIN = servo_margin([20.0, 20.0])  # overshoot
LARGEST_STEP = 400  # counts between two looks: 1.4 deg of azimuth, 2.9 of the beam's elevation
SunSource = Callable[[float], ArrayLike | None]  # MJD -> vector in the ground frame, None where it is set


def nearest_sun(
    station: Station, start: ArrayLike, end: ArrayLike, suns: Sequence[ArrayLike], *, exact: bool = False
) -> float:
    """Least angle, rad, that the beam can come to any of the Suns while both axes move between counts; inf without one.

    station      the ranger
    start, end   (2,) counts, azimuth and elevation
    suns         vectors (3,), ground frame, any length
    exact        at `end` only

    The rectangle of counts is looked at on a grid, and half a cell's diagonal is taken off, so it is never too large.
    Directions only: the Sun is turned by gamma then lambda. Source: [PARKER04] section 2.7, eq. 2.47.
    """
    if not suns:
        return float("inf")
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    number = np.ones(2, dtype=int) if exact else np.ceil(np.abs(b - a) / LARGEST_STEP).astype(int) + 1
    grid = [np.linspace(a[k], b[k], number[k]) if number[k] > 1 else b[k : k + 1] for k in (0, 1)]
    half = [0.5 * np.ptp(g) / max(len(g) - 1, 1) for g in grid]
    looks = beam(station, np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 2))
    inside: NDArray[np.float64] = np.stack([np.asarray(s, dtype=float) for s in suns])
    turned = inside / np.linalg.norm(inside, axis=-1, keepdims=True) @ station.mirror_from_ground.T
    cosine = np.clip(looks @ turned.T, -1.0, 1.0)
    return float(np.arccos(np.max(cosine))) - servo_margin(half)


def refusal(station: Station, start: ArrayLike, end: ArrayLike, suns: Sequence[ArrayLike]) -> str | None:
    """Why a move must not be made, in words; None where it may.

    station, start, end, suns   as for `nearest_sun`

    A move that begins inside a cone may be made if it ends outside and nowhere comes nearer than it began, as far as
    the grid can tell: 1.6 deg.
    """
    allowed = HALF_ANGLE + MARGIN
    least = nearest_sun(station, start, end, suns)
    if least >= allowed:
        return None
    begin, final = (nearest_sun(station, start, at, suns, exact=True) for at in (start, end))
    if begin < allowed <= final and least >= begin - servo_margin([0.5 * LARGEST_STEP] * 2):
        return None
    return (
        f"the beam could come within {max(least, 0.0) / DEGREE:.1f} deg of the Sun (expected at least "
        f"{allowed / DEGREE:.1f}): choose another way or wait"
    )
