"""Observed coordinates of points, all three or some, with their covariance."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.observations.kind import ObservationKind, joined_columns
from catseye.estimation.observations.sight import triples


@dataclass(frozen=True, eq=False)
class ObservedCoordinates(ObservationKind):
    """observed = coordinate of a point + error, one row per coordinate.

    name         of the group, for reports
    observed     (m,) metres
    covariance   of the observed values, see `ObservationGroup`
    point        (m,) column of the point's x
    axis         (m,) 0, 1, 2 for x, y, z
    """

    kind: ClassVar[str] = "coordinates"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    point: np.ndarray
    axis: np.ndarray

    @classmethod
    def of_points(cls, name: str, xyz: np.ndarray, covariance: np.ndarray, point: np.ndarray) -> "ObservedCoordinates":
        """Observe all three coordinates of b points.

        name         of the group, for reports
        xyz          (b, 3) m
        covariance   (3b,), (3b, 3b) or (b, 3, 3) m^2, point by point
        point        (b,) columns of their x

        >>> ObservedCoordinates.of_points("c", np.ones((2, 3)), np.ones(6), np.array([0, 6])).columns.ravel().tolist()
        [0, 1, 2, 6, 7, 8]
        """
        return cls(name, np.ravel(xyz), covariance, np.repeat(point, 3), np.tile(np.arange(3), len(point)))

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 1) of the coordinates."""
        if not np.isin(self.axis, (0, 1, 2)).all():
            raise EstimationError(
                f"{self.name}: an axis is {np.setdiff1d(self.axis, (0, 1, 2))[0]}, expected 0, 1 or 2"
            )
        return joined_columns(self.name, len(self.observed), triples(self.point)[:, :1] + self.axis[:, None])

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return (self.point,)

    @property
    def component(self) -> np.ndarray:
        return np.array(["x", "y", "z"])[self.axis]

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 1) at the parameters x."""
        return x[self.columns[:, 0]], np.ones((len(self.observed), 1))
