"""Pose of a moving frame: ground = T + exp([w]x) R0 frame.

T is the translation, w the rotation vector, R0 a fixed start. The rotation vector is in ground axes and turns the frame
about its own origin, the point T, after R0. The six parameters of a pose are T then w. A pose is smooth up to a whole
turn from R0, so R0 need not be near.
"""

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.observations.kind import value
from catseye.estimation.observations.sight import triples
from catseye.geometry.frames.rotation import from_vector, skew

SERIES_BELOW = 0.3  # rad: there (t - sin t) / t^3 by its series and by its formula are both good to 1e-14


def right_jacobian(w: np.ndarray) -> np.ndarray:
    """Right Jacobian J (..., 3, 3): exp(w + dw) = exp(w) exp(J dw) to first order.

    J = 1 - (1 - cos t) / t^2 [w]x + (t - sin t) / t^3 [w]x^2, with t the length of w.

    w   (..., 3) rotation vectors, rad

    >>> right_jacobian(np.zeros(3)).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    t = np.linalg.norm(w, axis=-1)[..., None, None]
    k = skew(w)
    large = np.maximum(t, SERIES_BELOW)
    s = t * t
    series = (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0)))) / 6.0
    third = np.where(t < SERIES_BELOW, series, (large - np.sin(large)) / large**3)
    return np.eye(3) - 0.5 * np.sinc(t / (2.0 * np.pi)) ** 2 * k + third * (k @ k)


def require_rotation(name: str, start: np.ndarray) -> None:
    """Raise EstimationError if start R0, (3, 3) or (n, 3, 3), is not a rotation."""
    if start.shape[-2:] != (3, 3) or not np.allclose(start @ np.swapaxes(start, -1, -2), np.eye(3), rtol=0, atol=1e-9):
        raise EstimationError(f"{name}: the start R0 is not orthonormal within 1e-9; give a rotation matrix")
    if np.any(np.linalg.det(start) < 0.0):
        raise EstimationError(f"{name}: the start R0 has determinant -1, a reflection; exchange or reverse an axis")


def turned_back(vector: np.ndarray, w: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ground vector in the frame's axes, R' v, and its derivatives by v and w.

    R = exp([w]x) R0. With y = exp(-w) v, dy = [y]x J dw, J the right Jacobian of w.

    vector   (n, 3)
    w        (n, 3) or (1, 3) rad
    start    R0, (3, 3) or (n, 3, 3)

    Returns (n, 3), (n or 1, 3, 3) and (n, 3, 3).
    """
    turn, back = from_vector(w), np.swapaxes(start, -1, -2)
    y = np.einsum("nji,nj->ni", np.broadcast_to(turn, (len(vector), 3, 3)), vector)
    local = np.einsum("...ij,...j->...i", back, y)
    return local, back @ np.swapaxes(turn, -1, -2), back @ skew(y) @ right_jacobian(w)


def in_frame(x: np.ndarray, point: np.ndarray, pose: np.ndarray, *, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ground points in frame coordinates, R' (X - T), and their derivatives.

    x       parameters
    point   (n,) columns of the x of the points
    pose    (6,) or (n, 6) columns of T and w, -1 for a parameter fixed at zero
    start   R0, (3, 3) or (n, 3, 3)

    Returns coordinates (n, 3), derivatives by X, T, w (n, 3, 9).
    """
    n = len(point)
    pose = np.atleast_2d(pose)
    local, by_point, by_turn = turned_back(x[triples(point)] - value(x, pose[:, :3]), value(x, pose[:, 3:]), start)
    by_point = np.broadcast_to(by_point, (n, 3, 3))
    slope = np.concatenate([-by_point, by_turn], axis=2)
    return local, np.concatenate([by_point, np.where(pose[:, None] < 0, 0.0, slope)], axis=2)


def frame_columns(point: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Columns (3n, 9) of points and pose, three rows per point."""
    n = len(point)
    rows = np.concatenate([triples(point), np.broadcast_to(np.atleast_2d(pose), (n, 6))], axis=1)
    return np.repeat(rows, 3, axis=0)
