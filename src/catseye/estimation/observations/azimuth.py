"""Azimuths: horizontal angles from +y, clockwise to +x."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns
from catseye.estimation.observations.sight import bearing, by_ends, nearest_turn, sight, triples


@dataclass(frozen=True, eq=False)
class Azimuths(ObservationKind):
    """observed = azimuth of target from origin + error.

    name         of the group, for reports
    observed     (m,) rad, on any turn
    covariance   of the observed values, see `ObservationGroup`
    origin       (m,) column of the x of the point measured from
    target       (m,) column of the x of the point measured to
    shift        (m, 3) or (3,) m, added to target minus origin, or None; only eccentricities matter
    """

    kind: ClassVar[str] = "azimuth"
    unit: ClassVar[str] = "rad"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    shift: np.ndarray | None = None

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 6) of origin and target."""
        return joined_columns(self.name, len(self.observed), triples(self.origin), triples(self.target))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return self.origin, self.target

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 6); nan for a vertical sight.

        Values are on the turn nearest to the observed ones.

        >>> a = Azimuths("a", np.full(1, 4.7), np.ones(1), np.array([0]), np.array([3]))
        >>> a.predict(np.array([0.0, 0.0, 0.0, -7.0, 0.0, 1.0]))[0] == 1.5 * np.pi
        array([ True])
        """
        azimuth, slope = bearing(sight(x, self.origin, self.target, shift=self.shift))
        return nearest_turn(azimuth, self.observed), by_ends(slope)
