"""Where the spot stands on a quadrant detector."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def quadrant_position(
    signals: ArrayLike, *, slope: float, u_signal: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Place of the spot (..., 2), m, on a quadrant detector, and its covariance (..., 2, 2) m^2.

    signals    (..., 4), any unit: quadrants counter-clockwise from that of positive x and y
    slope      m: the spot's place over the difference of halves over the sum, small against the spot; for a Gaussian
               spot of radius w (1/e^2) it is w sqrt(pi/8)
    u_signal   noise of each quadrant, same unit as the signals, independent

    A sum not above zero, no light, gives NaN.

    Source: halves of a Gaussian, erf(sqrt(2) x/w) to first order; [JCGM100] eq. 10.

    >>> quadrant_position([1.1, 0.9, 0.9, 1.1], slope=1e-3)[0].round(9).tolist()
    [0.0001, 0.0]
    """
    q = np.asarray(signals, dtype=float)
    total = np.sum(q, axis=-1)
    safe = np.where(total > 0.0, total, np.nan)[..., None]
    signs = np.array([[1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]])
    ratio = q @ signs.T / safe
    by_signal = slope * (signs - ratio[..., None]) / safe[..., None]
    return slope * ratio, u_signal**2 * by_signal @ np.swapaxes(by_signal, -1, -2)
