"""Four gauges on a shaft: observable and unobservable parts of panel heights."""

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


def observed_freedoms(gauges: np.ndarray, *, tilt_known: bool, height_known: bool) -> int:
    """Number of independent combinations of panel heights in one placement.

    gauges         (n, 2) m, a panel each
    tilt_known     the lean of the tool's shaft was measured
    height_known   the position of the shaft was measured

    reading_i = h_i - s + lean · place_i: the space of the tool's unknown freedoms is unobservable.

    >>> square = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * 0.075
    >>> [observed_freedoms(square, tilt_known=t, height_known=h) for t, h in ((0, 0), (1, 0), (1, 1))]
    [1, 3, 4]
    """
    unobservable = [] if height_known else [np.ones(len(gauges))]
    unobservable += [] if tilt_known else [gauges[:, 0], gauges[:, 1]]
    return len(gauges) - (int(np.linalg.matrix_rank(np.array(unobservable))) if unobservable else 0)
