"""Points on a plane, or at known distances from it."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns, value
from catseye.estimation.observations.sight import triples
from catseye.estimation.observations.unit_direction import direction, require_direction


@dataclass(frozen=True, eq=False)
class PointsOnPlane(ObservationKind):
    """observed = u . (P - centre) - x[offset] + error, positive on the normal's side.

    The value is the distance from the plane. Three parameters are minimal: two tilts of the normal u from its start
    (see `observations.unit_direction`) and the offset along u. A known plane has -1 in place of its parameters.
    Observed 0 means on the plane; the radius of a touching ball is another use.

    name         of the group, for reports
    observed     (m,) metres
    covariance   of the observed values, see `ObservationGroup`
    point        (m,) column of the point's x
    centre       (3,) or (m, 3) m, near the points: the tilts turn the plane about it
    normal       (3,) or (m, 3), the normal's start
    surface      (3,) or (m, 3) columns of tilt 1, tilt 2 and offset, m; -1 for a parameter fixed at zero
    """

    kind: ClassVar[str] = "point_on_plane"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    point: np.ndarray
    centre: np.ndarray
    normal: np.ndarray
    surface: np.ndarray

    def __post_init__(self) -> None:
        super().__post_init__()
        require_direction(self.name, "normal", self.normal)

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 6): point, tilts, offset."""
        return joined_columns(self.name, len(self.observed), triples(self.point), np.atleast_2d(self.surface))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return (self.point,)

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 6) at the parameters x.

        >>> floor = np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([3, 4, 5])
        >>> p = PointsOnPlane("p", np.zeros(1), np.ones(1), np.array([0]), *floor)
        >>> p.predict(np.array([5.0, 0.0, 1.0, 0.75, 0.0, 3.0]))[0].round(12)
        array([0.8])
        """
        surface = self.columns[:, 3:]
        m = len(surface)
        plane = direction(np.broadcast_to(self.normal, (m, 3)), value(x, surface[:, :2]))
        lever = x[triples(self.point)] - self.centre
        slope = np.concatenate([np.einsum("mik,mk->mi", plane.du, lever), np.full((m, 1), -1.0)], axis=1)
        values = np.sum(plane.u * lever, axis=1) - value(x, surface[:, 2])
        return values, np.concatenate([plane.u, np.where(surface < 0, 0.0, slope)], axis=1)
