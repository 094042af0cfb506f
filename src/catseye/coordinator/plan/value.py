"""What a range is worth: by how much it lowers the variances of the point that it leads to.

A range of standard uncertainty s along the unit vector e to a point of covariance P lowers its trace by
|P e|^2 / (s^2 + e'P e): the update of information, one range at a time, as `estimation.network.plan.schedule` does it
for whole networks. The ranger's own covariance along e counts to s^2. Points are taken one by one, their correlations
left out: a plan needs the order, not the figure.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
SIGMA = 30e-6  # m, of a range


@dataclass(frozen=True, eq=False)
class Worth:
    """What some ranges are worth: fall of the trace (m,), m^2; P e (m, 3); and s^2 + e'P e (m,)."""

    gain: Array
    across: Array
    total: Array


class Knowledge:
    """Covariances of points while a plan is made.

    names         of the points
    covariances   (p, 3, 3) m^2
    """

    def __init__(self, names: tuple[str, ...], covariances: ArrayLike):
        self.names = names
        self.at = {name: i for i, name in enumerate(names)}
        self.covariances = np.array(covariances, dtype=float).reshape(-1, 3, 3)

    def worth(self, points: NDArray[np.int64], units: Array, variance: Array) -> Worth:
        """The worth of a range along each of units (m, 3), ground, to points (m,), by index, of variances (m,), m^2.

        Source: rank-one update of a covariance, Sherman and Morrison 1950.

        >>> know = Knowledge(("A",), np.diag([4.0, 1.0, 1.0]))
        >>> know.worth(np.array([0]), np.array([[1.0, 0.0, 0.0]]), np.array([4.0])).gain.tolist()
        [2.0]
        """
        across = np.matmul(self.covariances[points], units[:, :, None])[:, :, 0]
        total = variance + np.sum(units * across, axis=1)
        return Worth(np.sum(across**2, axis=1) / total, across, total)

    def learn(self, point: int, across: Array, total: float) -> tuple[float, float]:
        """Take a range as measured; the point's u, m (root of the mean variance), before and after."""
        p = self.covariances[point]
        before = float(p.trace())
        self.covariances[point] = p - np.outer(across, across / total)
        return (before / 3.0) ** 0.5, (max(float(self.covariances[point].trace()), 0.0) / 3.0) ** 0.5
