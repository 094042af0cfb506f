"""Points on a sphere, or at known distances from it."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns, optional, value
from catseye.estimation.observations.sight import by_ends, length, sight, triples


@dataclass(frozen=True, eq=False)
class PointsOnSphere(ObservationKind):
    """observed = |P - C| - radius - x[radius_column] + error, positive outside.

    name            of the group, for reports
    observed        (m,) metres
    covariance      of the observed values, see `ObservationGroup`
    point           (m,) column of the point's x
    centre          (m,) column of the x of the centre C, an ordinary point
    radius          (m,) or one, the known part of the radius, m
    radius_column   (m,) column of the unknown part, m, -1 for none; or None
    """

    kind: ClassVar[str] = "point_on_sphere"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    point: np.ndarray
    centre: np.ndarray
    radius: np.ndarray | float = 0.0
    radius_column: np.ndarray | None = None

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 7): centre, point, radius."""
        m = len(self.observed)
        return joined_columns(self.name, m, triples(self.centre), triples(self.point), optional(self.radius_column, m))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        """Columns of the point and of the centre."""
        return self.point, self.centre

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 7).

        Values are nan for a point at the centre.

        >>> p = PointsOnSphere("p", np.zeros(1), np.ones(1), np.array([0]), np.array([3]), 4.5)
        >>> p.predict(np.array([3.0, 4.0, 0.0, 0.0, 0.0, 0.0]))[0]
        array([0.5])
        """
        radius = self.columns[:, 6]
        size, unit = length(sight(x, self.centre, self.point, shift=None))
        jacobian = np.concatenate([by_ends(unit), np.where(radius < 0, 0.0, -1.0)[:, None]], axis=1)
        return size - self.radius - value(x, radius), jacobian
