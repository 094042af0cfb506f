"""Search patterns in whole counts, raster and spiral, without gaps.

They suit a beam of a given width.

On the sky a count of azimuth is 12.96" times sin Phi wide and one of elevation 25.92" high (12.96" of the mirror). A
place of the sky is covered when a place of the pattern is within `reach` of it: the angle off the beam's axis at
which a retroreflector still returns enough. Offsets are (x, y) in rad from the centre, x along increasing azimuth, y
along increasing Phi', on the sphere along great circles from the centre.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import ValidityError
from catseye.geometry.mirror.encoder import (
    BEAM_PER_COUNT,
    COUNTS_PER_TURN,
    azimuth_angle,
    elevation_angle,
    turned_within,
    within,
)
from catseye.geometry.mirror.mirror_path import direction_angles

PITCH_OVER_REACH = 1.35  # pitch of the spiral; sqrt(2) for straight turns, less for the curvature near the centre
HALF_DIAGONAL = 0.5 * float(np.hypot(*BEAM_PER_COUNT))  # rad, of a count at sin Phi = 1, where it is largest
LEAST_REACH = 1.5 * HALF_DIAGONAL  # rad, of a spiral that is rounded to whole counts
MOST_PLACES = 2_000_000  # places of one pattern
SIDE, ONES = np.linspace(-1.0, 1.0, 65), np.ones(65)
EDGE = np.stack(  # of a square of half width 1
    [np.concatenate([SIDE, SIDE, ONES, -ONES]), np.concatenate([ONES, -ONES, SIDE, SIDE])], axis=-1
)


@dataclass(frozen=True, eq=False)
class Pattern:
    """Places of a search, in order.

    counts     (n, 2) whole counts (Na, Ne), within the stops
    offsets    (n, 2) rad, of these counts, from the centre
    left_out   number of places beyond the stops
    """

    counts: Array
    offsets: Array
    left_out: int

    def __len__(self) -> int:
        return len(self.counts)


def count_size(centre: ArrayLike, zeros: ArrayLike) -> Array:
    """Size (2,), rad on the sky, of a count of azimuth and elevation.

    centre    (2,) counts (Na, Ne)
    zeros     (2,) counts (na0, ne0)

    Source: [PARKER04] eqs. 2.21, 2.22. Exact.

    >>> (count_size([0.0, 12_500.0], [0.0, 0.0]) * 206264.806).round(2).tolist()
    [12.96, 25.92]
    """
    phi = float(elevation_angle(np.asarray(centre, dtype=float)[1], np.asarray(zeros, dtype=float)[1]))
    return BEAM_PER_COUNT * np.array([abs(np.sin(phi)), 1.0])


def spiral_offsets(radius: float, reach: float) -> Array:
    """Places (n, 2), rad, of an Archimedean spiral that covers a disc.

    Steps along its arc are constant.

    radius    rad, 0 or more: every place within it of the centre is covered
    reach     rad, above 0: radius covered about a place of the pattern

    Turns are as far apart as steps along the arc.

    Source: geometry; full coverage for this pitch is checked densely (2.3 % to spare), not proven.

    >>> len(spiral_offsets(0.0, 1e-4)), len(spiral_offsets(1e-3, 1e-4))
    (1, 198)
    """
    _positive(reach=reach)
    if not 0.0 <= radius < np.inf:
        raise ValidityError(f"radius {radius} rad of a search is not 0 or more and finite")
    if radius <= 0.0:
        return np.zeros((1, 2))
    step = PITCH_OVER_REACH * reach
    b = step / TWO_PI  # r = b t
    last = (radius + 0.5 * step) / b
    expected = 0.5 * b * last**2 / step
    _refuse_many(expected, "a spiral")
    # Arc length s(t) = b/2 (t sqrt(1+t^2) + asinh t), inverted on a dense table: monotone and smooth.
    t = np.linspace(0.0, last + 1.0, int(64 * (last + 2.0)))
    arc = 0.5 * b * (t * np.sqrt(1.0 + t**2) + np.arcsinh(t))
    turn = np.interp(np.arange(0.0, arc[-1], step), arc, t)
    turn = turn[: np.searchsorted(turn, last) + 1]
    return np.stack([b * turn * np.cos(turn), b * turn * np.sin(turn)], axis=-1)


def raster(
    centre: ArrayLike, zeros: ArrayLike, half_width: ArrayLike, *, reach: float, limits: tuple[float, float]
) -> Pattern:
    """Raster of whole counts, alternating rows, that covers a rectangle.

    centre       (2,) counts (Na, Ne), real, direct or prime
    zeros        (2,) counts (na0, ne0)
    half_width   (2,) rad on the sky, 0 or more, along azimuth and elevation
    reach        rad, above half the diagonal of a count
    limits       azimuth stops, counts

    The steps of rows and columns are the whole counts with the largest area whose half diagonal is within reach. The
    size of an azimuth count is taken where it is largest in the rectangle; rows and columns reach as far as the counts
    of the rectangle's own edge, which is not a rectangle in counts. A rectangle that reaches the azimuth axis is
    refused (use a spiral there).

    Source: geometry. No gap, rounding included: the places are whole counts.
    """
    middle, zero = _pair(centre, "centre"), _pair(zeros, "zeros")
    half = _pair(half_width, "half width")
    if np.any(half < 0.0):
        raise ValidityError(f"half width {half.tolist()} rad of a search is below 0")
    phi = float(elevation_angle(middle[1], zero[1]))
    edge = half[1] + 2.0 * BEAM_PER_COUNT[1]
    across = np.abs(np.sin(phi + np.linspace(-edge, edge, 65)))
    crosses = not np.pi * np.ceil((phi - edge) / np.pi) > phi + edge
    if crosses:
        raise ValidityError(
            f"a raster of {2e3 * half[1]:.3g} mrad about Phi = {np.degrees(phi):.3f} deg reaches the azimuth axis "
            "(expected a smaller one, or a spiral)"
        )
    size = BEAM_PER_COUNT * np.array([float(across.max()), 1.0])
    step = _whole_steps(size, reach)
    around = counts_of_offsets(middle, zero, half * EDGE) - np.rint(middle)
    low_steps = np.maximum(np.ceil(-around.min(axis=0) / step - 0.5), 0.0)
    high_steps = np.maximum(np.ceil(around.max(axis=0) / step - 0.5), 0.0)
    _refuse_many(float(np.prod(low_steps + high_steps + 1.0)), "a raster")
    columns = np.rint(middle[0]) + step[0] * np.arange(-low_steps[0], high_steps[0] + 1.0)
    rows = np.rint(middle[1]) + step[1] * np.arange(-low_steps[1], high_steps[1] + 1.0)
    alternating = np.tile(columns, (len(rows), 1))
    alternating[1::2] = alternating[1::2, ::-1]
    counts = np.stack([alternating.ravel(), np.repeat(rows, len(columns))], axis=-1)
    return _within_stops(counts, middle, zero, limits)


def spiral(centre: ArrayLike, zeros: ArrayLike, radius: float, *, reach: float, limits: tuple[float, float]) -> Pattern:
    """Outward spiral of whole counts that covers a disc.

    centre    (2,) counts (Na, Ne), real, direct or prime
    zeros     (2,) counts (na0, ne0)
    radius    rad on the sky, 0 or more
    reach     rad, above 1.5 half diagonals of a count, which rounding subtracts
    limits    azimuth stops, counts

    Likely places come first. A place that rounds to an earlier one is skipped.

    Source: `spiral_offsets` and `counts_of_offsets`.
    """
    middle, zero = _pair(centre, "centre"), _pair(zeros, "zeros")
    if not reach >= LEAST_REACH:
        raise ValidityError(
            f"reach {reach * 1e6:.0f} urad is below {1e6 * LEAST_REACH:.0f} urad, too little for a spiral rounded "
            "to whole counts (expected a wider beam, or a raster)"
        )
    counts = np.rint(counts_of_offsets(middle, zero, spiral_offsets(radius, reach - HALF_DIAGONAL)))
    _, first = np.unique(counts, axis=0, return_index=True)
    return _within_stops(counts[np.sort(first)], middle, zero, limits)


def counts_of_offsets(centre: ArrayLike, zeros: ArrayLike, offsets: ArrayLike) -> Array:
    """Counts (n, 2), real, of sky offsets from a pointing, same setting.

    centre, zeros   (2,) counts
    offsets         (n, 2) rad

    Azimuth stays within half a turn of the centre's. Beyond the azimuth axis that is half a turn on.

    Source: [PARKER04] eqs. 2.16-2.18 and 2.21-2.26. Exact.

    >>> counts_of_offsets([0.0, 12_500.0], [0.0, 0.0], [[6.283185e-5, 0.0], [0.0, 1.256637e-4]]).round(4).tolist()
    [[1.0, 12500.0], [0.0, 12501.0]]
    """
    middle, zero, xy = _pair(centre, "centre"), _pair(zeros, "zeros"), np.asarray(offsets, dtype=float)
    theta, phi = float(azimuth_angle(middle[0], zero[0])), float(elevation_angle(middle[1], zero[1]))
    ahead, right, up = _axes(theta, phi)
    angle = np.hypot(xy[:, 0], xy[:, 1])
    aside = np.sinc(angle / np.pi)[:, None] * (xy[:, :1] * right + xy[:, 1:] * up)  # sin(angle)/angle (x, y)
    found_theta, found_phi = direction_angles(np.cos(angle)[:, None] * ahead + aside)
    if phi < 0.0:
        found_theta, found_phi = found_theta + np.pi, -found_phi
    turned = theta + np.remainder(found_theta - theta + np.pi, TWO_PI) - np.pi
    return np.stack([turned, found_phi], axis=-1) / BEAM_PER_COUNT + zero


def offsets_of_counts(centre: ArrayLike, zeros: ArrayLike, counts: ArrayLike) -> Array:
    """Offsets (n, 2), rad, on the sky of counts from a pointing.

    The inverse of `counts_of_offsets`.

    centre, zeros   (2,) counts
    counts          (n, 2)
    """
    middle, zero, n = _pair(centre, "centre"), _pair(zeros, "zeros"), np.asarray(counts, dtype=float)
    ahead, right, up = _axes(float(azimuth_angle(middle[0], zero[0])), float(elevation_angle(middle[1], zero[1])))
    theta, phi = azimuth_angle(n[:, 0], zero[0]), elevation_angle(n[:, 1], zero[1])
    u = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], axis=-1)
    x, y = u @ right, u @ up
    sine = np.hypot(x, y)
    stretch = np.where(sine > 0.0, np.arctan2(sine, u @ ahead) / np.where(sine > 0.0, sine, 1.0), 1.0)
    return np.stack([stretch * x, stretch * y], axis=-1)


def _axes(theta: float, phi: float) -> tuple[Array, Array, Array]:
    """Beam, and sky directions of growing azimuth and of growing Phi'.

    In prime, sin Phi' < 0: growing azimuth moves the beam along -(-sin Theta', cos Theta').
    """
    (s, c), (sp, cp) = (np.sin(theta), np.cos(theta)), (np.sin(phi), np.cos(phi))
    sign = -1.0 if phi < 0.0 else 1.0
    return np.array([sp * c, sp * s, cp]), sign * np.array([-s, c, 0.0]), np.array([cp * c, cp * s, -sp])


def _whole_steps(size: Array, reach: float) -> Array:
    """Largest whole-count steps (azimuth, elevation) with half diagonal within reach."""
    _positive(reach=reach)
    if 0.5 * np.hypot(*size) > reach:
        raise ValidityError(
            f"reach {reach * 1e6:.0f} urad is below half the diagonal of a count, {5e5 * np.hypot(*size):.0f} urad: no "
            "pattern of whole counts covers the sky (expected a wider beam)"
        )
    up = np.arange(1, int(2.0 * reach / size[1]) + 1)
    room = np.sqrt(np.maximum((2.0 * reach) ** 2 - (up * size[1]) ** 2, 0.0)) / size[0]
    along = np.floor(np.minimum(room, COUNTS_PER_TURN) * (1.0 + 1e-12))
    best = int(np.argmax(up * along))
    return np.array([along[best], up[best]])


def _within_stops(counts: Array, centre: Array, zeros: Array, limits: tuple[float, float]) -> Pattern:
    low, high = limits
    if not low < high:
        raise ValidityError(f"azimuth limits {low} and {high} are not in order (expected low < high)")
    turned = np.stack([turned_within(counts[:, 0], low, high), counts[:, 1]], axis=-1)
    good = within(turned[:, 0], low, high)
    retained = turned[good]
    return Pattern(retained, offsets_of_counts(centre, zeros, retained), int(np.sum(~good)))


def _refuse_many(expected: float, what: str) -> None:
    if expected > MOST_PLACES:
        raise ValidityError(
            f"{what} of some {expected:.3g} places is more than {MOST_PLACES} (expected a smaller area or a wider beam)"
        )


def _pair(values: ArrayLike, what: str) -> Array:
    array = np.asarray(values, dtype=float)
    if array.shape != (2,) or not np.all(np.isfinite(array)):
        raise ValidityError(f"{what} {array.tolist()} is not two finite numbers")
    return array


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not 0.0 < value < np.inf:
            raise ValidityError(f"{name} {value} is not above 0 and finite")
