"""Closed-form start of a position, in the principal plane of the stations that see the target.

Differences of squared ranges give the foot in that plane, their mean the height over it, up to its sign.
"""

from dataclasses import dataclass

import numpy as np

from catseye.estimation.network.positions.trilateration import FLAT

SIGNIFICANT = 5.0  # sigmas by which ranges must separate the mirror images


@dataclass(frozen=True, eq=False)
class Planes:
    """Principal planes of the stations of p visibility patterns.

    centre, axes   (p, 3), (p, 3, 3) of their figure: centroid, and directions by falling extent; the last is the normal
    rows           (p, 3, s): their products with `half_square - d^2 / 2` are the target's coordinates along the axes
    half_square    (p, s) half the squared distance of each station from the centre; 0 if not visible
    inverse        (p, 3) reciprocals of the sums of squares along the axes; infinite if the figure is flat
    count          (p,) visible stations
    collinear      (p,) bool: they lie on one line
    """

    centre: np.ndarray
    axes: np.ndarray
    rows: np.ndarray
    half_square: np.ndarray
    inverse: np.ndarray
    count: np.ndarray
    collinear: np.ndarray


def planes_of(s: np.ndarray, patterns: np.ndarray) -> Planes:
    """Principal planes of visibility patterns (p, s) of stations (s, 3).

    With q_i = s_i - centre, z from the centre: q_i.z = (z^2 + q_i^2 - d_i^2) / 2, and sum q_i = 0 eliminates z^2.
    """
    count = patterns.sum(axis=1)
    centre = patterns @ s / np.maximum(count, 1)[:, None]
    q = (s - centre[:, None]) * patterns[..., None]
    extent, vectors = np.linalg.eigh(np.swapaxes(q, 1, 2) @ q)
    extent, axes = extent[:, ::-1], np.swapaxes(vectors, 1, 2)[:, ::-1]
    extended = extent > FLAT * extent[:, :1]
    inverse = np.where(extended, 1.0 / np.where(extended, extent, 1.0), np.inf)
    rows = axes @ np.swapaxes(q, 1, 2) * np.where(extended, inverse, 0.0)[..., None]
    return Planes(
        centre=centre,
        axes=axes,
        rows=rows,
        half_square=np.sum(q * q, axis=2) / 2,
        inverse=inverse,
        count=count,
        collinear=~extended[:, 1],
    )


def patterns_of(table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct rows (p, s) of a bool table, and the index of each row among them."""
    bits = np.packbits(table, axis=1)
    keys = np.zeros((len(bits), -(-bits.shape[1] // 8) * 8), dtype=np.uint8)
    keys[:, : bits.shape[1]] = bits
    words = keys.view(np.uint64)
    words = words[:, 0] if words.shape[1] == 1 else np.ascontiguousarray(words).view(f"V{8 * words.shape[1]}")[:, 0]
    _, index, which = np.unique(words, return_index=True, return_inverse=True)
    return table[index], which


@dataclass(frozen=True, eq=False)
class Starts:
    """Start positions: foot in the stations' plane (k, 3), height over it (k,), normal (k, 3).

    The sign (k,) of the height is from the ranges, else from the known side, else 0; side (k,) is that side.
    """

    foot: np.ndarray
    height: np.ndarray
    normal: np.ndarray
    sign: np.ndarray
    side: np.ndarray

    def of(self, lanes: np.ndarray) -> "Starts":
        """Starts of selected targets."""
        return Starts(self.foot[lanes], self.height[lanes], self.normal[lanes], self.sign[lanes], self.side[lanes])


def starts(planes: Planes, which: np.ndarray, d: np.ndarray, *, u: np.ndarray, near: np.ndarray | None) -> Starts:
    """Closed-form starts for targets of patterns `which` (k,), near (1 or k, 3).

    d and u as in `descent.Ranges`. The height is from the mean square of the ranges, or from the stations' extent along
    the normal, which also gives the sign: whichever is more accurate, with u^2 of 1 / n + z1^2 / E1 + z2^2 / E2 against
    z3^2 / E3, E the sums of squares of the stations along their axes.
    """
    single = len(planes.count) == 1  # shared arrays are not copied
    y = (planes.half_square[0] if single else planes.half_square[which]) - d * d / 2
    z = y @ planes.rows[0].T if single else np.einsum("ks,kcs->kc", y, planes.rows[which])
    lever = planes.rows[0, 2] if single else planes.rows[which, 2]
    variance = np.sum((lever * d * np.where(u < np.inf, u, 0.0)) ** 2, axis=1)
    square = -2.0 * y.sum(axis=1) / planes.count[which] - z[:, 0] ** 2 - z[:, 1] ** 2
    sided = z[:, 2] ** 2 > SIGNIFICANT**2 * variance
    bound = np.minimum(planes.inverse[which], 1e200)  # finite, so that zero times it is zero
    level = 1.0 / planes.count[which] + np.sum(z[:, :2] ** 2 * bound[:, :2], axis=1)
    spread = sided & ((square < 0.25 * z[:, 2] ** 2) | (z[:, 2] ** 2 * bound[:, 2] < level))
    height = np.where(spread, np.abs(z[:, 2]), np.sqrt(np.maximum(square, 0.0)))
    foot = planes.centre[which] + np.einsum("kc,kca->ka", z[:, :2], planes.axes[which, :2])
    normal, side = planes.axes[which, 2], np.zeros(len(d))
    if near is not None:
        side = np.nan_to_num(np.sign(np.sum((near - planes.centre[which]) * normal, axis=1)))
    return Starts(foot, height, normal, np.where(sided, np.sign(z[:, 2]), side), side)
