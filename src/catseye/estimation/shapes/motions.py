"""Rigid motions and scale of a set of points."""

import numpy as np

MOTIONS = ("shift along x", "shift along y", "shift along z", "turn about x", "turn about y", "turn about z", "scale")


def motions(xyz: np.ndarray, centre: np.ndarray | None = None, size: float | None = None) -> np.ndarray:
    """Seven motions of points (n, 3) as columns (3 n, 7), in the order of MOTIONS.

    centre   (3,) m, of rotation and scale; mean of the points if None
    size     m, divisor of rotations and scale; RMS distance from the mean if None

    No motion moves the points by more than metres.

    >>> motions(np.array([[0.0, 0, 0], [2.0, 0, 0]]))[:, 6].tolist()
    [-1.0, 0.0, 0.0, 1.0, 0.0, 0.0]
    """
    n = len(xyz)
    arm = xyz - (xyz.mean(axis=0) if centre is None else centre)
    arm = arm / (figure_size(arm) if size is None else size)
    result = np.zeros((n, 3, 7))
    result[:, [0, 1, 2], [0, 1, 2]] = 1.0
    x, y, z = arm.T
    result[:, 1, 3], result[:, 2, 3] = 0.0 - z, y  # rotation about an axis: its unit vector cross the arm
    result[:, 0, 4], result[:, 2, 4] = z, 0.0 - x
    result[:, 0, 5], result[:, 1, 5] = 0.0 - y, x
    result[:, :, 6] = arm
    return result.reshape(3 * n, 7)


def figure_size(arm: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(arm**2, axis=1)))) or 1.0
