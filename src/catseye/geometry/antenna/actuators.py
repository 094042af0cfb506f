"""Lengths of six actuators that hold a subreflector, and its six degrees of freedom.

Each actuator joins a point b of the fixed frame to a point m of the moving one, both in the prime-focus frame, m at
rest. At a position q (shift, angles) of `subreflector` its length is |p(q) - b|, p = pivot + shift + R (m - pivot), and

    dl / dq = (p - b)/l . dp/dq

with dp/dq of `subreflector.position_jacobian`. The inverse is Newton's from rest: of several positions with the same
lengths, the one that moves there without a jump.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.geometry.antenna.subreflector import position_jacobian, prime_focus_from_subreflector

ITERATIONS = 50
SETTLED = 1e-12  # m, of every length: rounding of some metres is 1e-15
MOST_TURN = 1.5  # rad: of any angle on the way, below the quarter turn where they are not separable


class AttainedPosition(NamedTuple):
    """Position at six lengths: shift (3,), m, angles (3,), rad; NaN where no way from rest leads to one."""

    shift: NDArray[np.float64]
    angles: NDArray[np.float64]


def actuator_lengths(
    shift: ArrayLike, angles: ArrayLike, *, fixed: ArrayLike, moving: ArrayLike, pivot: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lengths (n,), m, of actuators at a position, and derivatives (n, 6) by shift (1) and angles (m/rad).

    shift, angles   (3,), m and rad, of the position
    fixed           (n, 3), m, prime-focus frame: joints that do not move
    moving          (n, 3), m, prime-focus frame: joints on the subreflector, at rest
    pivot           (3,), m, prime-focus frame

    Source: derived at the top of this file for [PARKER04] section 2.6. Exact.

    >>> joints = {"fixed": [[0, 0, -2]], "moving": [[0, 0, 0]]}
    >>> length, slope = actuator_lengths([0, 0, 0.5], [0, 0, 0], **joints, pivot=[0, 0, 0])
    >>> length.tolist(), slope[0].tolist()
    ([2.5], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    """
    at_rest, still = np.asarray(moving, dtype=float), np.asarray(fixed, dtype=float)
    moved = prime_focus_from_subreflector(shift, angles, pivot=pivot).single.points(at_rest)
    arm = moved - still
    length = np.linalg.norm(arm, axis=-1)
    if not np.all(length > 0.0):
        raise ValidityError(f"actuator {int(np.argmin(length)) + 1} has no length: its two joints coincide")
    slopes = position_jacobian(np.zeros(3), angles, at_rest, pivot=pivot)
    return length, np.einsum("ni,nij->nj", arm / length[:, None], slopes)


def position_at_lengths(
    lengths: ArrayLike, *, fixed: ArrayLike, moving: ArrayLike, pivot: ArrayLike
) -> AttainedPosition:
    """Position of the subreflector at the lengths (6,), m, of its actuators, reached from rest.

    fixed, moving, pivot   as for `actuator_lengths`, of six actuators

    Source: Newton's iteration on `actuator_lengths`. To 1e-12 m of every length.

    >>> fixed = [[2, 0, 3], [2, 0.5, 3], [-1, 1.7, 3], [-1.4, 1.4, 3], [-1, -1.7, 3], [-0.6, -2, 3]]
    >>> moving = [[1, -1, 1], [1.3, 0.9, 1], [0.5, 1.5, 1], [-1.5, 0.2, 1], [-1.5, -0.2, 1], [0.5, -1.5, 1]]
    >>> place = {"fixed": fixed, "moving": moving, "pivot": [0.0, 0.0, 1.0]}
    >>> length, _ = actuator_lengths([0.01, 0.0, -0.02], [0.001, 0.0, 0.003], **place)
    >>> [v.round(9).tolist() for v in position_at_lengths(length, **place)]
    [[0.01, 0.0, -0.02], [0.001, 0.0, 0.003]]
    """
    target, six = np.asarray(lengths, dtype=float), np.zeros(6)
    for _ in range(ITERATIONS):
        length, slope = actuator_lengths(six[:3], six[3:], fixed=fixed, moving=moving, pivot=pivot)
        misfit = target - length
        if np.max(np.abs(misfit)) <= SETTLED:
            return AttainedPosition(six[:3] + 0.0, six[3:] + 0.0)
        six = six + np.linalg.lstsq(slope, misfit, rcond=None)[0]
        if not (np.isfinite(six).all() and np.max(np.abs(six[3:])) < MOST_TURN):
            break
    return AttainedPosition(np.full(3, np.nan), np.full(3, np.nan))
