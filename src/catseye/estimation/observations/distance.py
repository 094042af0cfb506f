"""Slope distances between two points, with scale, offset and nuisance terms, as from a ranger."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.between_points import LengthsBetweenPoints
from catseye.estimation.observations.reading import reading
from catseye.estimation.observations.sight import by_ends, length, sight


@dataclass(frozen=True, eq=False)
class Distances(LengthsBetweenPoints):
    """observed = (scale + sum s_q x[scaling_q]) |target - origin + shift| + offset + sum c_q x[nuisance_q] + error.

    Fields are those of `LengthsBetweenPoints`.
    """

    kind: ClassVar[str] = "slope_distance"
    unit: ClassVar[str] = "m"

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 6 + q + s).

        Values are nan where two points coincide.

        >>> d = Distances("d", np.ones(1), np.ones(1), np.array([0]), np.array([3]))
        >>> d.predict(np.array([0.0, 0.0, 0.0, 3.0, 4.0, 12.0]))[0]
        array([13.])
        """
        size, unit = length(sight(x, self.origin, self.target, shift=self.shift))
        return reading(self, x, size, slope=by_ends(unit))
