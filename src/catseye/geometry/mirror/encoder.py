"""Beam angles and encoder counts of a mirror.

100 000 counts a turn; the elevation axis turns the beam twice as far.

Theta is the beam's turn about the azimuth axis, Phi its angle from that axis; in mirror axes it leaves along
u = (sin Phi cos Theta, sin Phi sin Theta, cos Phi).
A count of azimuth is 12.96 arc seconds of Theta, one of elevation 25.92 of Phi.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import TWO_PI
from catseye.errors import ValidityError

COUNTS_PER_TURN = 100_000.0
HALF_TURN = 0.5 * COUNTS_PER_TURN
COUNTS_PER_RADIAN = COUNTS_PER_TURN / TWO_PI  # counts a turn of an axis; half for the beam's Phi
BEAM_PER_COUNT = np.array([1.0, 2.0]) / COUNTS_PER_RADIAN  # rad of Theta and of Phi
BEAM_PER_COUNT.flags.writeable = False


class Choice(NamedTuple):
    """Counts (..., 2), azimuth and elevation, within the stops, with flags.

    NaN where none are allowed; `prime`, `allowed` (...) bool.
    """

    counts: NDArray[np.float64]
    prime: NDArray[np.bool_]
    allowed: NDArray[np.bool_]


def azimuth_counts(theta: ArrayLike, na0: ArrayLike) -> NDArray[np.float64]:
    """Azimuth counts (...) for a beam at Theta.

    theta    (...), rad
    na0      (...), counts where Theta = 0

    Source: [PARKER04] eq. 2.21. Exact.

    >>> azimuth_counts(np.pi / 2, -4195.0).tolist()
    20805.0
    """
    return np.asarray(theta, dtype=float) * COUNTS_PER_RADIAN + np.asarray(na0, dtype=float)


def elevation_counts(phi: ArrayLike, ne0: ArrayLike) -> NDArray[np.float64]:
    """Elevation counts (...) for a beam at Phi.

    phi    (...), rad; below zero in the prime pointing
    ne0    (...), counts where Phi = 0

    Source: [PARKER04] eq. 2.22: the mirror turns half as far as the beam. Exact.

    >>> elevation_counts(np.pi / 2, -4935.0).tolist()
    7565.0
    """
    return np.asarray(phi, dtype=float) * (0.5 * COUNTS_PER_RADIAN) + np.asarray(ne0, dtype=float)


def autocollimation_counts(phi: ArrayLike, ne0: ArrayLike) -> NDArray[np.float64]:
    """Elevation counts (...) for the mirror's face to look at Phi.

    phi, ne0    as for `elevation_counts`

    Source: [PARKER04] eq. 2.23. Exact.

    >>> autocollimation_counts(np.pi / 2, -4935.0).tolist()
    20065.0
    """
    return np.asarray(phi, dtype=float) * COUNTS_PER_RADIAN + np.asarray(ne0, dtype=float)


def back_retro_counts(phi: ArrayLike, ne0: ArrayLike) -> NDArray[np.float64]:
    """Elevation counts (...) for the back retroreflector to look at Phi.

    phi, ne0    as for `elevation_counts`

    Source: [PARKER04] eq. 2.24. Exact.

    >>> back_retro_counts(np.pi / 2, -4935.0).tolist()
    70065.0
    """
    return autocollimation_counts(phi, ne0) + HALF_TURN


def azimuth_angle(na: ArrayLike, na0: ArrayLike) -> NDArray[np.float64]:
    """Mount angle Theta' (...), rad, at azimuth counts, not wrapped.

    The inverse of `azimuth_counts`.

    >>> round(float(azimuth_angle(20805.0, -4195.0)), 6)
    1.570796
    """
    return np.subtract(na, na0, dtype=float) / COUNTS_PER_RADIAN


def elevation_angle(ne: ArrayLike, ne0: ArrayLike) -> NDArray[np.float64]:
    """Beam angle Phi' (...), rad, at elevation counts; below zero in prime.

    The inverse of `elevation_counts`.

    >>> round(float(elevation_angle(7565.0, -4935.0)), 6)
    1.570796
    """
    return np.subtract(ne, ne0, dtype=float) / (0.5 * COUNTS_PER_RADIAN)


def prime_counts(na: ArrayLike, ne: ArrayLike, ne0: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Counts (...) of the other setting that points the same.

    Azimuth and elevation.

    na, ne    (...), counts of one setting
    ne0       (...), counts where Phi = 0

    Source: [PARKER04] eq. 2.25 and 2.26. Exact for a mirror without tilts and encoder errors. From a prime setting it
    leads to the direct one, a turn on.

    >>> [float(n) for n in prime_counts(20805.0, 7565.0, -4935.0)]
    [70805.0, -17435.0]
    """
    return np.add(na, HALF_TURN, dtype=float), 2.0 * np.asarray(ne0, dtype=float) - np.asarray(ne, dtype=float)


def within(na: ArrayLike, low: ArrayLike, high: ArrayLike) -> NDArray[np.bool_]:
    """True where azimuth counts (...) lie between the stops, inclusive.

    NaN does not.

    >>> within([-25.0, 0.0, 25.5], -25, 25).tolist()
    [True, True, False]
    """
    na = np.asarray(na, dtype=float)
    return (np.asarray(low) <= na) & (na <= np.asarray(high))


def turned_within(na: ArrayLike, low: ArrayLike, high: ArrayLike) -> NDArray[np.float64]:
    """Azimuth counts (...) moved by whole turns to between the stops.

    Unchanged where no turn brings them there.

    na           (...), counts
    low, high    (...), counts, the stops

    Counts between the stops are unchanged; otherwise the smallest move is taken.

    >>> turned_within([60_000.0, -60_000.0, 0.0], -50_000, 50_000).tolist()
    [-40000.0, 40000.0, 0.0]
    """
    na, low, high = (np.asarray(v, dtype=float) for v in (na, low, high))
    up = na + COUNTS_PER_TURN * np.maximum(np.ceil((low - na) / COUNTS_PER_TURN), 0.0)
    down = up - COUNTS_PER_TURN * np.maximum(np.ceil((up - high) / COUNTS_PER_TURN), 0.0)
    return np.where(within(down, low, high), down, na)


def choice(
    direct: ArrayLike,
    prime: ArrayLike,
    *,
    low: ArrayLike,
    high: ArrayLike,
    current: ArrayLike | None = None,
    speeds: ArrayLike = (1.0, 1.0),
) -> Choice:
    """Choice of pointing allowed by the stops and sooner reached.

    direct, prime   (..., 2), counts, azimuth and elevation; whole turns of azimuth are tried too
    low, high       (...), counts, the azimuth stops
    current         (..., 2), current counts; without it the direct pointing is preferred where allowed
    speeds          (2,), counts/s of the axes, above 0; both move at once, so that the slower one decides

    Where neither is allowed the result is NaN and `allowed` False.

    Source: [PARKER04] section 2.4: "checks must be made to ensure the allowed range of N_a".

    >>> choice([75_000.0, 9000.0], [25_000.0, -9000.0], low=-24_000, high=73_000).prime.tolist()
    True
    """
    speeds = np.asarray(speeds, dtype=float)
    if speeds.shape != (2,) or not np.all(speeds > 0.0):
        raise ValidityError(f"speeds {speeds.tolist()} are not two numbers above 0 counts/s")
    pointings = []
    for counts in np.broadcast_arrays(np.asarray(direct, dtype=float), np.asarray(prime, dtype=float)):
        turns = _turns(counts[..., 0], low, high, None if current is None else np.asarray(current, dtype=float)[..., 0])
        pointings.append(np.stack([turns, counts[..., 1] + 0.0 * turns], axis=-1))
    allowed = [within(p[..., 0], low, high) & np.isfinite(p[..., 1]) for p in pointings]
    if current is None:
        second = ~allowed[0] & allowed[1]
    else:
        need = [np.max(np.abs(p - np.asarray(current, dtype=float)) / speeds, axis=-1) for p in pointings]
        second = allowed[1] & (~allowed[0] | (need[1] < need[0]))
    any_ = allowed[0] | allowed[1]
    chosen = np.where(second[..., None], pointings[1], pointings[0])
    return Choice(np.where(any_[..., None], chosen, np.nan), second, any_)


def _turns(na: NDArray[np.float64], low: ArrayLike, high: ArrayLike, current: NDArray | None) -> NDArray[np.float64]:
    """Azimuth counts on the allowed turn nearest to `current`."""
    first = turned_within(na, low, high)
    if current is None:
        return first
    most = np.floor((np.asarray(high, dtype=float) - first) / COUNTS_PER_TURN)
    least = np.ceil((np.asarray(low, dtype=float) - first) / COUNTS_PER_TURN)
    turns = np.maximum(np.minimum(np.round((current - first) / COUNTS_PER_TURN), most), least)
    near = first + COUNTS_PER_TURN * turns
    return np.where(within(near, low, high), near, first)
