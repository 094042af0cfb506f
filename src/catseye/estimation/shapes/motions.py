"""Motions of a figure of points as a whole, by which nothing between them changes."""

import numpy as np

MOTIONS = ("shift along x", "shift along y", "shift along z", "turn about x", "turn about y", "turn about z", "scale")


def motions(xyz: np.ndarray, centre: np.ndarray | None = None, size: float | None = None) -> np.ndarray:
    """The seven motions of points (n, 3): (3 n, 7), none moving the points by more than metres.

    centre   (3,) m, about which points are turned and scaled; their mean if None
    size     m, by which turns and scale are divided; their root mean square distance from the mean if None

    Order as MOTIONS.

    >>> motions(np.array([[0.0, 0, 0], [2.0, 0, 0]]))[:, 6].tolist()
    [-1.0, 0.0, 0.0, 1.0, 0.0, 0.0]
    """
    n = len(xyz)
    arm = xyz - (xyz.mean(axis=0) if centre is None else centre)
    arm = arm / (figure_size(arm) if size is None else size)
    result = np.zeros((n, 3, 7))
    result[:, [0, 1, 2], [0, 1, 2]] = 1.0
    x, y, z = arm.T
    result[:, 1, 3], result[:, 2, 3] = 0.0 - z, y  # turn about an axis: its unit vector cross the arm
    result[:, 0, 4], result[:, 2, 4] = z, 0.0 - x
    result[:, 0, 5], result[:, 1, 5] = 0.0 - y, x
    result[:, :, 6] = arm
    return result.reshape(3 * n, 7)


def figure_size(arm: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(arm**2, axis=1)))) or 1.0
