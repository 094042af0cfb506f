"""Points on a straight line, or at known offsets from it."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns, value
from catseye.estimation.observations.sight import triples
from catseye.estimation.observations.unit_direction import direction, require_direction


@dataclass(frozen=True, eq=False)
class PointsOnLine(ObservationKind):
    """observed_i = f_i . (P - centre) - x[shift_i] + error, i = 1, 2.

    These are the two components of the distance from a line: f_1, f_2 are perpendicular to the line and to each other.
    The distance itself would have no derivative on the line. Four parameters are minimal: two tilts of the direction
    from its start (see `observations.unit_direction`) and the shifts along f_1, f_2. A known line has -1 in place of
    its parameters.

    name         of the group, for reports
    observed     (2b,) metres, point by point
    covariance   of the observed values, see `ObservationGroup`
    point        (b,) column of the point's x
    centre       (3,) or (b, 3) m, near the points: the tilts turn the line about it
    along        (3,) or (b, 3), the direction's start
    line         (4,) or (b, 4) columns of tilt 1, tilt 2, shift 1, shift 2, m; -1 for a parameter fixed at zero
    """

    kind: ClassVar[str] = "point_on_line"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    point: np.ndarray
    centre: np.ndarray
    along: np.ndarray
    line: np.ndarray

    def __post_init__(self) -> None:
        super().__post_init__()
        require_direction(self.name, "line", self.along)

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (2b, 6): point, tilts, shift of the component."""
        b = len(self.point)
        line = np.broadcast_to(np.atleast_2d(self.line), (b, 4))
        common = np.repeat(np.concatenate([triples(self.point), line[:, :2]], axis=1), 2, axis=0)
        return joined_columns(self.name, len(self.observed), common, line[:, 2:].reshape(-1, 1))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return (np.repeat(self.point, 2),)

    @property
    def component(self) -> np.ndarray:
        return np.tile(["1", "2"], len(self.point))

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (2b,) and Jacobian (2b, 6) at the parameters x.

        >>> mast = np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([3, 4, 5, 6])
        >>> p = PointsOnLine("p", np.zeros(2), np.ones(2), np.array([0]), *mast)
        >>> p.predict(np.array([3.0, 4.0, 9.0, 0.0, 0.0, 1.0, 0.0]))[0]
        array([2., 4.])
        """
        b = len(self.point)
        tilts, shifts = self.columns[::2, 3:5], self.columns[:, 5]
        line = direction(np.broadcast_to(self.along, (b, 3)), value(x, tilts))
        lever = x[triples(self.point)] - self.centre
        values = np.einsum("mik,mk->mi", line.f, lever).ravel() - value(x, shifts)
        slope = np.where(tilts[:, None] < 0, 0.0, np.einsum("mijk,mk->mij", line.df, lever))
        by_shift = np.where(shifts < 0, 0.0, -1.0)[:, None]
        return values, np.concatenate([line.f.reshape(-1, 3), slope.reshape(-1, 2), by_shift], axis=1)
