"""Horizontal distances between two points."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.between_points import LengthsBetweenPoints
from catseye.estimation.observations.reading import reading
from catseye.estimation.observations.sight import by_ends, level_length, sight


@dataclass(frozen=True, eq=False)
class HorizontalDistances(LengthsBetweenPoints):
    """observed = (scale + sum s_q x[scaling_q]) hypot(dx, dy) + offset + sum c_q x[nuisance_q] + error.

    Heights of the points, the instrument and the target do not enter; `shift` is for eccentric set-ups.
    Fields are those of `LengthsBetweenPoints`.
    """

    kind: ClassVar[str] = "horizontal_distance"
    unit: ClassVar[str] = "m"

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 6 + q + s).

        Values are nan where one point is above the other.

        >>> d = HorizontalDistances("d", np.ones(1), np.ones(1), np.array([0]), np.array([3]))
        >>> d.predict(np.array([0.0, 0.0, 0.0, 3.0, 4.0, 12.0]))[0]
        array([5.])
        """
        size, outward = level_length(sight(x, self.origin, self.target, shift=self.shift))
        return reading(self, x, size, slope=by_ends(outward))
