"""Value of a range: reduction of the variances of its point.

A range of standard uncertainty s along the unit vector e to a point of covariance P lowers its trace by
|P e|^2 / (s^2 + e'P e): the update of information, one range at a time, as `estimation.network.plan.schedule` does it
for whole networks. The ranger's own covariance along e is added to s^2. Points are treated singly, without their
correlations: a plan needs the order, not the figure.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array

SIGMA = 30e-6  # m, of a range


@dataclass(frozen=True, eq=False)
class Worth:
    """Value of some ranges.

    Fall of the trace (m,), m^2; P e (m, 3); and s^2 + e'P e (m,).
    """

    gain: Array
    across: Array
    total: Array


class Knowledge:
    """Covariances of points during planning.

    names         of the points
    covariances   (p, 3, 3) m^2
    """

    def __init__(self, names: tuple[str, ...], covariances: ArrayLike):
        self.names = names
        self.at = {name: i for i, name in enumerate(names)}
        self.covariances = np.array(covariances, dtype=float).reshape(-1, 3, 3)

    def worth(self, points: NDArray[np.int64], units: Array, variance: Array) -> Worth:
        """Value of ranges along unit vectors to points.

        units (m, 3), ground; points (m,), by index; variances (m,), m^2.

        Source: rank-one update of a covariance, Sherman and Morrison 1950.

        >>> know = Knowledge(("A",), np.diag([4.0, 1.0, 1.0]))
        >>> know.worth(np.array([0]), np.array([[1.0, 0.0, 0.0]]), np.array([4.0])).gain.tolist()
        [2.0]
        """
        across = np.matmul(self.covariances[points], units[:, :, None])[:, :, 0]
        total = variance + np.sum(units * across, axis=1)
        return Worth(np.sum(across**2, axis=1) / total, across, total)

    def learn(self, point: int, across: Array, total: float) -> tuple[float, float]:
        """Update by a planned range; the point's u, m, before and after.

        u is the root of the mean variance.
        """
        p = self.covariances[point]
        before = float(p.trace())
        self.covariances[point] = p - np.outer(across, across / total)
        return (before / 3.0) ** 0.5, (max(float(self.covariances[point].trace()), 0.0) / 3.0) ** 0.5
