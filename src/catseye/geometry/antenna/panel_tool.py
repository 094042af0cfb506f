"""Four gauges on a shaft that turns by quarter turns."""

import numpy as np


def turned(xy: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Places (..., 2) of the tool's axes in the corner's, after quarter turns.

    xy     (..., 2) m, tool
    turn   (...) whole quarter turns of the tool on its shaft, from x to y

    >>> turned(np.array([1.0, 0.0]), np.array(1)).tolist()
    [0.0, 1.0]
    """
    c, s = np.array([1, 0, -1, 0])[turn % 4], np.array([0, 1, 0, -1])[turn % 4]
    return np.stack([c * xy[..., 0] - s * xy[..., 1], s * xy[..., 0] + c * xy[..., 1]], axis=-1)
