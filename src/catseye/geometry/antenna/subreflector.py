"""Subreflector position: three translations and three rotations about a pivot.

At rest its frame stands in the prime-focus frame as the home transform says. A position (shift, angles) moves it from
there: first turned about the x axis, then y, then z of the prime-focus frame, each axis through the pivot, each by the
right-hand rule; then shifted. The axes stay where they are, so

    x_prime_focus = pivot + shift + Rz(c) Ry(b) Rx(a) (home(x) - pivot),     R active, angles (a, b, c).

The notes only name six degrees of freedom; order and pivot are our choice, and any other needs `about` or another
matrix. The effect on the beam is not in this file.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import FrameError, ValidityError
from catseye.geometry.frames.frame import Transform, Transforms
from catseye.geometry.frames.rotation import rx, ry, rz

HOME = Transform("prime_focus", "subreflector", np.eye(3), np.zeros(3))  # chosen: both frames coincide at rest
LOCK = 1e-6  # of cos b: below it, near a quarter turn about y, turns about x and z are not separable


def turned(angles: ArrayLike) -> NDArray[np.float64]:
    """Active rotation matrix (..., 3, 3): about fixed x, then y, then z.

    angles    (..., 3), rad, about x, y, z

    Source: [SHUSTER93], the Euler sequence 3-2-1 of its section on Euler angles. Exact.

    >>> turned([np.pi / 2, 0.0, np.pi / 2])[:, 1].round(6).tolist()[1:]
    [0.0, 1.0]
    """
    a, b, c = np.moveaxis(_triples(angles, "angles"), -1, 0)
    return rz(-c) @ ry(-b) @ rx(-a)  # rx, ry, rz are passive


def angles_of(matrix: ArrayLike) -> NDArray[np.float64]:
    """Angles (..., 3), rad, about x, y, z of a `turned` matrix.

    The angle about y is within a quarter turn.

    matrix    (..., 3, 3), an active rotation

    Raises ValidityError at a quarter turn about y, where only the sum or difference of the other two is defined.

    Source: [SHUSTER93]. Exact.

    >>> angles_of(turned([0.1, -0.2, 0.3])).round(12).tolist()
    [0.1, -0.2, 0.3]
    """
    m = np.asarray(matrix, dtype=float)
    if m.shape[-2:] != (3, 3):
        raise ValidityError(f"rotation matrix has shape {m.shape}, expected (..., 3, 3)")
    cosine = np.hypot(m[..., 0, 0], m[..., 1, 0])
    if np.any(cosine < LOCK):
        raise ValidityError(
            f"turn about y is within {LOCK:.0e} rad of a quarter turn: angles about x and z are not separable"
        )
    a = np.arctan2(m[..., 2, 1], m[..., 2, 2])
    return np.stack([a, np.arctan2(-m[..., 2, 0], cosine), np.arctan2(m[..., 1, 0], m[..., 0, 0])], axis=-1)


def prime_focus_from_subreflector(
    shift: ArrayLike, angles: ArrayLike, *, pivot: ArrayLike, home: Transform = HOME
) -> Transforms:
    """Transforms of subreflector points into the prime-focus frame at positions (...).

    shift     (..., 3), m, of the pivot, prime-focus axes
    angles    (..., 3), rad, about x, then y, then z
    pivot     (3,), m, prime-focus frame
    home      prime_focus_from_subreflector at rest

    Raises FrameError where home joins other frames, ValidityError for other shapes.

    Source: derived above for [PARKER04] section 2.6. Exact.

    >>> moved = prime_focus_from_subreflector([0.0, 0.0, 0.01], [0.0, 0.0, np.pi / 2], pivot=[1.0, 0.0, 0.0]).single
    >>> moved.points([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]).round(12).tolist()
    [[1.0, 0.0, 0.01], [1.0, 1.0, 0.01]]
    """
    if (home.to, home.from_) != ("prime_focus", "subreflector"):
        raise FrameError(f"home is {home}, expected prime_focus_from_subreflector")
    matrix, p = turned(angles), _triples(pivot, "pivot")
    translation = p + _triples(shift, "shift") + np.einsum("...ij,...j->...i", matrix, home.translation - p)
    return Transforms("prime_focus", "subreflector", matrix @ home.rotation, translation)


def position_of(
    transform: Transform | Transforms, *, pivot: ArrayLike, home: Transform = HOME
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Position (shift (..., 3) m, angles (..., 3) rad) from a transform.

    transform   prime_focus_from_subreflector, as measured
    pivot       (3,), m, prime-focus frame, of the result
    home        prime_focus_from_subreflector at rest

    Raises as `angles_of`. Source: the inverse of `prime_focus_from_subreflector`. Exact.

    >>> at = prime_focus_from_subreflector([0.0, 0.01, 0.0], [0.001, 0.0, 0.0], pivot=[0.0, 0.0, 4.0])
    >>> [v.round(6).tolist() for v in position_of(at, pivot=[0.0, 0.0, 0.0])]
    [[0.0, 0.014, 2e-06], [0.001, -0.0, 0.0]]
    """
    moved = Transforms.of(transform) @ home.inverse()  # prime focus to prime focus
    if moved.to != "prime_focus":
        raise FrameError(f"{transform} does not lead to prime_focus")
    p = _triples(pivot, "pivot")
    return moved.points(p) - p, angles_of(moved.rotation)


def position_jacobian(
    shift: ArrayLike, angles: ArrayLike, points: ArrayLike, *, pivot: ArrayLike
) -> NDArray[np.float64]:
    """Derivatives (..., 3, 6) of points by shift (1) and angles (m/rad).

    Points are in the prime-focus frame.

    shift, angles   (..., 3), m and rad, of the position
    points          (..., 3), m, prime-focus frame, where they are at rest (home applied)
    pivot           (3,), m, prime-focus frame

    Source: derivatives of the formula above: the axes are fixed, so the angle about z turns about z, that about y about
    the y axis turned by z, that about x about the x axis turned by both. Exact.

    >>> position_jacobian(np.zeros(3), np.zeros(3), [0.0, 2.0, 0.0], pivot=np.zeros(3))[:, 3].tolist()
    [0.0, 0.0, 2.0]
    """
    _, b, c = np.moveaxis(_triples(angles, "angles"), -1, 0)
    arm = np.einsum("...ij,...j->...i", turned(angles), _triples(points, "points") - _triples(pivot, "pivot"))
    about_z = np.broadcast_to([0.0, 0.0, 1.0], arm.shape)
    about_y = np.broadcast_to(rz(-c)[..., :, 1], arm.shape)
    about_x = np.broadcast_to((rz(-c) @ ry(-b))[..., :, 0], arm.shape)
    turns = [np.cross(axis, arm) for axis in (about_x, about_y, about_z)]
    batch = np.broadcast_shapes(np.shape(shift)[:-1], arm.shape[:-1])
    moves = np.broadcast_to(np.eye(3), (*batch, 3, 3))
    return np.concatenate([moves, np.broadcast_to(np.stack(turns, axis=-1), (*batch, 3, 3))], axis=-1)


def _triples(values: ArrayLike, what: str) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=float)
    if array.shape[-1:] != (3,):
        raise ValidityError(f"{what} has shape {array.shape}, expected (..., 3)")
    return array
