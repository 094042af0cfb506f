"""Four gauges on a shaft: what their readings say of four panels, and what they leave unsaid."""

import numpy as np


def turned(xy: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Places (..., 2) of the tool's axes in the corner's, after so many quarter turns.

    xy     (..., 2) m, tool
    turn   (...) whole quarter turns of the tool on its shaft, from x to y

    >>> turned(np.array([1.0, 0.0]), np.array(1)).tolist()
    [0.0, 1.0]
    """
    c, s = np.array([1, 0, -1, 0])[turn % 4], np.array([0, 1, 0, -1])[turn % 4]
    return np.stack([c * xy[..., 0] - s * xy[..., 1], s * xy[..., 0] + c * xy[..., 1]], axis=-1)


def observed_freedoms(gauges: np.ndarray, *, tilt_known: bool, height_known: bool) -> int:
    """How many independent combinations of the panels' heights one placement observes.

    gauges         (n, 2) m, a panel each
    tilt_known     the lean of the tool's shaft was measured
    height_known   where the shaft stands was measured

    reading_i = h_i - s + lean · place_i: what the tool's unknown freedoms span is lost.

    >>> square = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * 0.075
    >>> [observed_freedoms(square, tilt_known=t, height_known=h) for t, h in ((0, 0), (1, 0), (1, 1))]
    [1, 3, 4]
    """
    lost = [] if height_known else [np.ones(len(gauges))]
    lost += [] if tilt_known else [gauges[:, 0], gauges[:, 1]]
    return len(gauges) - (int(np.linalg.matrix_rank(np.array(lost))) if lost else 0)
