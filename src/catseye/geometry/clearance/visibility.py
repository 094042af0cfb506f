"""Visibility of retroreflectors from rangers: incidence, range, obstructions."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.geometry.clearance.solids import Solid

CLEAR = -1  # in the result of `first_obstruction`


def incidence(scan_points: ArrayLike, points: ArrayLike, axes: ArrayLike) -> Array:
    """Angle (r, t), rad, between retroreflector axis and direction to ranger.

    0 to pi.

    scan_points   (r, 3), m
    points        (t, 3), m, same frame
    axes          (t, 3), any length: outward normals; NaN where unknown, and then the result is NaN

    Source: arctangent of cross over dot product, which loses no digits near 0. Exact.

    >>> incidence([[10.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], [[1.0, 1.0, 0.0]]).round(6).tolist()
    [[0.785398]]
    """
    towards = _points(scan_points, "scan points")[:, None, :] - _points(points, "points")[None, :, :]
    axis = np.broadcast_to(_points(axes, "axes")[None, :, :], towards.shape)
    cross = np.linalg.norm(np.cross(axis, towards), axis=-1)
    return np.asarray(np.arctan2(cross, np.sum(axis * towards, axis=-1)))


def ranges(scan_points: ArrayLike, points: ArrayLike) -> Array:
    """Straight distances (r, t), m.

    scan_points, points   (r, 3) and (t, 3), m, same frame

    >>> ranges([[0.0, 0.0, 0.0]], [[3.0, 4.0, 0.0]]).tolist()
    [[5.0]]
    """
    return np.asarray(
        np.linalg.norm(_points(scan_points, "scan points")[:, None, :] - _points(points, "points")[None], axis=-1)
    )


def first_obstruction(
    scan_points: ArrayLike,
    points: ArrayLike,
    solids: Sequence[Solid],
    *,
    clear_start: float = 0.0,
    clear_end: float = 0.0,
) -> tuple[NDArray[np.int64], Array]:
    """First solid (r, t) in each path, -1 if none, and its distance (r, t), m.

    The distance is from the ranger, infinite if none.

    scan_points, points   (r, 3) and (t, 3), m, in the frame of the solids
    solids                all in that frame
    clear_start           m, 0 or more, of the path at the ranger taken as clear: its mount
    clear_end             m, 0 or more, of the path at the retroreflector taken as clear: its seat

    A path shorter than both is clear. Raises ValidityError for lengths below 0.

    Source: `solids`. Exact.

    >>> from catseye.geometry.clearance.solids import SolidSphere
    >>> index, at = first_obstruction([[0.0, 0.0, 0.0]], [[10.0, 0.0, 0.0]], [SolidSphere((5.0, 0.0, 0.0), 1.0)])
    >>> index.tolist(), at.tolist()
    ([[0]], [[4.0]])
    """
    if not (clear_start >= 0.0 and clear_end >= 0.0):
        raise ValidityError(f"clear_start = {clear_start}, clear_end = {clear_end} m: not both 0 or more")
    r, t = _points(scan_points, "scan points"), _points(points, "points")
    vector = t[None] - r[:, None]
    length = np.linalg.norm(vector, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = vector / length[..., None]
        start = r[:, None] + clear_start * unit
        end = t[None] - clear_end * unit
    remainder = length - clear_start - clear_end
    best = np.full(length.shape, np.inf)
    which = np.full(length.shape, CLEAR, dtype=np.int64)
    open_ = remainder > 0.0
    if not solids or not open_.any():
        return which, best
    start, end = np.where(open_[..., None], start, 0.0), np.where(open_[..., None], end, 1.0)
    for k, solid in enumerate(solids):
        share = np.where(open_, solid.first_hit(start, end), np.inf)
        nearer = share < best
        best, which = np.where(nearer, share, best), np.where(nearer, k, which)
    hit = which != CLEAR
    return which, np.where(hit, clear_start + np.where(hit, best, 0.0) * remainder, np.inf)


def _points(values: ArrayLike, what: str) -> Array:
    array = np.asarray(values, dtype=float)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValidityError(f"{what} have shape {array.shape}, expected (n, 3)")
    return array
