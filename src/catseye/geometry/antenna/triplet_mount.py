"""Triplet mount: two rotations, aimed by a rifle scope.

All units are aimed at a common point A.

Axes of a unit, origin where the mount's two axes meet: x from the left prism to the right, y up, z the normal of the
plate on the prism side. Axes of the mount's base are the same at both angles zero: y the outer axis, x the trunnions.
`swing` turns the unit about the base's y by the right-hand rule; `tip` then raises the normal towards +y, about the
unit's own x (the trunnions in the end plates), so that

    normal = (sin swing cos tip, sin tip, cos swing cos tip),  left to right = (cos swing, 0, -sin swing).

The prisms' line stays square to the outer axis: how the unit stands about its normal is not free. The scope's line of
sight is parallel to the normal but need not pass through the pivot; it is the sight that goes through A.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.errors import ValidityError
from catseye.geometry.frames.rotation import rx, ry


def base_from_unit(swing: ArrayLike, tip: ArrayLike) -> Array:
    """Matrix (..., 3, 3) from unit axes to mount base axes.

    swing   rad, about the outer axis
    tip     rad, above zero raises the normal

    Source: [GOLDMAN00] section 1.3, items 4 and 5 (two rotations, trunnions in the end plates); signs are ours. Exact.

    >>> base_from_unit(np.radians(90.0), 0.0).round(12)[:, 2].tolist()
    [1.0, 0.0, 0.0]
    """
    return np.asarray(np.swapaxes(ry(swing), -1, -2) @ rx(tip))  # rx, ry turn axes: -tip about x turns the point


def aim_angles(towards: ArrayLike, sight_offset: ArrayLike = (0.0, 0.0)) -> tuple[Array, Array]:
    """Swing (...) in (-pi, pi], tip (...) in [-pi/2, pi/2], rad, to aim the sight.

    towards        (..., 3) m, from the pivot to A, axes of the base, not on the outer axis
    sight_offset   (..., 2) m, where the sight crosses the unit's x and y

    The unit's coordinates of A must come out as (x, y) of the sight: first the swing makes x right, then the tip y.
    Raises ValidityError where A is nearer to an axis than the sight is, so that no angle reaches it.

    Source: [GOLDMAN00] appendix C (the aim by rifle scope), solved in closed form here. Exact.

    >>> swing, tip = aim_angles([3.0, 4.0 * np.sqrt(2.0), np.sqrt(7.0)])
    >>> round(float(np.degrees(tip)), 9)
    54.735610317
    """
    v, offset = np.asarray(towards, dtype=float), np.asarray(sight_offset, dtype=float)
    if v.shape[-1:] != (3,) or offset.shape[-1:] != (2,):
        raise ValidityError(f"towards {v.shape} and sight_offset {offset.shape}: (..., 3) and (..., 2) are expected")
    level = np.hypot(v[..., 0], v[..., 2])
    x, y = offset[..., 0], offset[..., 1]
    _require(level > np.abs(x), "the aim point lies nearer to the outer axis than the sight's offset x")
    swing = np.arctan2(v[..., 0], v[..., 2]) - np.arcsin(x / level)
    out = np.sqrt((level - x) * (level + x))
    far = np.hypot(v[..., 1], out)
    _require(far > np.abs(y), "the aim point lies nearer to the trunnions than the sight's offset y")
    tip = np.arctan2(v[..., 1], out) - np.arcsin(y / far)
    return np.arctan2(np.sin(swing), np.cos(swing)), tip


def misaim(swing: ArrayLike, tip: ArrayLike, *, towards: ArrayLike, ball: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """Angle of the plate's normal from the direction ball to A, (..., 2) rad.

    Along the unit's x and its y.

    swing, tip   rad, of the mount
    towards      (..., 3) m, from the pivot to A, axes of the base
    ball         (..., 3) m, ball's centre from the pivot, axes of the unit

    Above zero A lies towards +x (the right prism), +y of the normal. The memo takes the normal as pointing at A
    (e_TR): a scope that sits `sight_offset` beside the ball leaves that offset over the distance, 2 mrad for 0.1 m at
    50 m. Add the lean of the scope's line against the normal.

    Source: [GOLDMAN00] appendix C and figure 10, whose e_TR it questions. Exact.

    >>> misaim(0.0, 0.0, towards=[0.05, 0.0, 50.0]).round(6).tolist()
    [0.001, 0.0]
    """
    turn = base_from_unit(swing, tip)
    aim = np.einsum("...ji,...j->...i", turn, np.asarray(towards, dtype=float)) - np.asarray(ball, dtype=float)
    return np.stack([np.arctan2(aim[..., 0], aim[..., 2]), np.arctan2(aim[..., 1], aim[..., 2])], axis=-1)


def _require(good: NDArray[np.bool_], text: str) -> None:
    if not np.all(good):
        raise ValidityError(f"{text}: no angle aims the sight at it; give coordinates of A from the pivot, in m")
