"""Unit vector with two parameters, regular within a right angle of its start, and its moving axes."""

from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError


@dataclass(frozen=True, eq=False)
class Direction:
    """u = (u0 + a_1 e_1 + a_2 e_2) / |...|, with e_1, e_2 across u0.

    Small a are angles, a right angle is infinite.

    u     (m, 3)
    f     (m, 2, 3) e_1, e_2 turned with u by the shortest rotation
    du    (m, 2, 3) derivatives of u by a_1, a_2
    df    (m, 2, 2, 3) derivatives of f: df[:, i, j] is that of f_i by a_j
    """

    u: np.ndarray
    f: np.ndarray
    du: np.ndarray
    df: np.ndarray


def require_direction(name: str, what: str, start: np.ndarray) -> None:
    """Raise EstimationError for vectors (3,) or (m, 3) without a direction."""
    if not np.all(np.linalg.norm(start, axis=-1) > 0.0):
        raise EstimationError(f"{name}: the {what} has zero length or is not a number; give a direction")


def across(start: np.ndarray) -> np.ndarray:
    """Right-handed e_1, e_2 (m, 2, 3) across unit vectors start (m, 3), e_1 x e_2 = start.

    e_1 is the coordinate axis farthest from the start, made perpendicular to it.

    >>> across(np.array([[0.0, 0.0, 1.0]])).tolist()
    [[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]
    """
    axis = np.eye(3)[np.argmin(np.abs(start), axis=1)]
    first = axis - np.sum(axis * start, axis=1, keepdims=True) * start
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(start, first)], axis=1)


def direction(start: np.ndarray, a: np.ndarray) -> Direction:
    """Direction at parameters a, with derivatives.

    With n = sqrt(1 + a_1^2 + a_2^2): f_i = e_i - a_i / (n + 1) (u0 + u), the image of e_i by the rotation about
    u0 x u that takes u0 to u.

    start   (m, 3) u0; any length but zero
    a       (m, 2)

    >>> direction(np.array([[0.0, 0.0, 2.0]]), np.array([[0.75, 0.0]])).u
    array([[0.6, 0. , 0.8]])
    """
    u0 = start / np.linalg.norm(start, axis=1, keepdims=True)
    e = across(u0)
    n = np.sqrt(1.0 + np.sum(a * a, axis=1))[:, None]
    u = (u0 + np.einsum("mi,mik->mk", a, e)) / n
    du = e / n[:, None] - (a / n**2)[:, :, None] * u[:, None]
    middle = u0 + u
    share = a / (n + 1.0)
    f = e - share[:, :, None] * middle[:, None]
    by = np.eye(2) / (n + 1.0)[:, None] - a[:, :, None] * a[:, None, :] / (n * (n + 1.0) ** 2)[:, None]
    df = -by[..., None] * middle[:, None, None] - share[:, :, None, None] * du[:, None]
    return Direction(u, f, du, df)
