"""Least angle between a beam and directions during a move, in closed form.

Axes may start one after the other, be slow, stop half-way and go on: whatever they do, their counts stay within the
rectangle between start and end. A direction s, (Theta_s, Phi_s) in the mirror's axes, has from the beam at (Theta, Phi)

    cos = cos Phi_s cos Phi + sin Phi_s cos(Theta - Theta_s) sin Phi

which is linear in c = cos(Theta - Theta_s): over the rectangle it is largest at the largest or the smallest c, and for
each of these along Phi at atan2(sin Phi_s c, cos Phi_s) or at an end. No grid, so nothing is missed between samples.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.geometry.mirror.encoder import BEAM_PER_COUNT
from catseye.geometry.mirror.pointing import MirrorStation

TWO_PI = 2.0 * np.pi


def nearest(station: MirrorStation, low: ArrayLike, high: ArrayLike, *, directions: ArrayLike) -> Array:
    """Least angle (..., k), rad, between the beam and directions.

    The counts stay within rectangles.

    station       one ranger, in the frame of the directions
    low, high     (..., 2), counts: corners of the rectangles, in order
    directions    (k, 3), unit

    Source: above. Good to 3e-8 rad (the arc cosine near 1).

    >>> flat = MirrorStation([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0], [0.0, 0.0])
    >>> up = [[0.0, 0.0, 1.0]]  # is y of this mirror: Theta = Phi = a quarter turn
    >>> nearest(flat, [0.0, 12_500.0], [20_000.0, 13_000.0], directions=up).round(6).tolist()  # 5000 counts short
    [0.314159]
    """
    s = np.asarray(directions, dtype=float).reshape(-1, 3) @ station.mirror_from_ground.T
    theta_s, cosine_s, sine_s = np.arctan2(s[:, 1], s[:, 0]), s[:, 2], np.hypot(s[:, 0], s[:, 1])
    a, b = ((np.asarray(n, dtype=float) - station.zeros) * BEAM_PER_COUNT for n in (low, high))
    theta, phi = (a[..., :1] - theta_s, b[..., :1] - theta_s), (a[..., 1:], b[..., 1:])
    ends = np.cos(theta[0]), np.cos(theta[1])
    most = np.where(_holds(0.0, *theta), 1.0, np.maximum(*ends))
    least = np.where(_holds(np.pi, *theta), -1.0, np.minimum(*ends))
    cosine = np.full(most.shape, -1.0)
    for c in (most, least):
        across = sine_s * c
        best = np.arctan2(across, cosine_s + 0.0 * across)
        peak = np.where(_holds(best, *phi), np.hypot(across, cosine_s), -1.0)
        for end in phi:
            peak = np.maximum(peak, cosine_s * np.cos(end) + across * np.sin(end))
        cosine = np.maximum(cosine, peak)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def chords(directions: Array) -> float:
    """Half the largest angle, rad, between neighbours of directions (k, 3)."""
    if len(directions) < 2:
        return 0.0
    apart = np.linalg.norm(np.diff(directions, axis=0), axis=-1)
    return float(np.max(np.arcsin(np.minimum(0.5 * apart, 1.0))))


def _holds(angle: float | Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """True if angles, any turn, lie between low and high."""
    return np.asarray(np.floor((high - angle) / TWO_PI) >= np.ceil((low - angle) / TWO_PI))
