"""Horizontal directions: circle readings with an unknown orientation."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns, optional, value
from catseye.estimation.observations.sight import bearing, by_ends, nearest_turn, sight, triples


@dataclass(frozen=True, eq=False)
class Directions(ObservationKind):
    """observed = azimuth of target from origin - x[orientation] + error, clockwise seen from above.

    The orientation is the azimuth of the circle's zero: azimuth = reading + orientation.

    name          of the group, for reports
    observed      (m,) rad, on any turn
    covariance    of the observed values, see `ObservationGroup`
    origin        (m,) column of the x of the point where the instrument stands
    target        (m,) column of the x of the point sighted
    orientation   (m,) column of the set's orientation, rad
    shift         (m, 3) or (3,) m, added to target minus origin, or None; only eccentricities matter
    """

    kind: ClassVar[str] = "direction"
    unit: ClassVar[str] = "rad"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    orientation: np.ndarray
    shift: np.ndarray | None = None

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 7): origin, target, orientation."""
        turn = optional(self.orientation, len(self.observed))
        return joined_columns(self.name, len(self.observed), triples(self.origin), triples(self.target), turn)

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return self.origin, self.target

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 7); nan for a vertical sight.

        Values are on the turn nearest to the observed ones.

        >>> d = Directions("d", np.ones(1), np.ones(1), np.array([0]), np.array([3]), np.array([6]))
        >>> d.predict(np.array([0.0, 0.0, 0.0, 5.0, 5.0, 1.0, 0.25]))[0].round(6)
        array([0.535398])
        """
        azimuth, slope = bearing(sight(x, self.origin, self.target, shift=self.shift))
        jacobian = np.concatenate([by_ends(slope), np.where(self.orientation < 0, 0.0, -1.0)[:, None]], axis=1)
        return nearest_turn(azimuth - value(x, self.orientation), self.observed), jacobian
