"""Inclinations: elevation of the line between two points, as read by a clinometer on a bar."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns, optional, value
from catseye.estimation.observations.sight import by_ends, elevation, nearest_turn, sight, triples


@dataclass(frozen=True, eq=False)
class Inclinations(ObservationKind):
    """observed = elevation of target seen from origin + x[zero] + error, positive upward.

    name         of the group, for reports
    observed     (m,) rad
    covariance   of the observed values, see `ObservationGroup`
    origin       (m,) column of the x of the point where the line begins
    target       (m,) column of the x of the point where it ends
    shift        (m, 3) or (3,) m, added to target minus origin, or None
    zero         (m,) column of the clinometer's reading when level, rad, -1 for none; or None
    """

    kind: ClassVar[str] = "inclination"
    unit: ClassVar[str] = "rad"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    shift: np.ndarray | None = None
    zero: np.ndarray | None = None

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 7): origin, target, zero."""
        zero = optional(self.zero, len(self.observed))
        return joined_columns(self.name, len(self.observed), triples(self.origin), triples(self.target), zero)

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return self.origin, self.target

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 7); nan for a vertical line.

        Values are on the turn nearest to the observed ones.

        >>> i = Inclinations("i", np.zeros(1), np.ones(1), np.array([0]), np.array([3]))
        >>> i.predict(np.array([0.0, 0.0, 0.0, 0.0, 3.0, -3.0]))[0] == -np.pi / 4
        array([ True])
        """
        zero = self.columns[:, 6:]
        above, slope = elevation(sight(x, self.origin, self.target, shift=self.shift))
        jacobian = np.concatenate([by_ends(slope), np.where(zero < 0, 0.0, 1.0)], axis=1)
        return nearest_turn(above + value(x, zero[:, 0]), self.observed), jacobian
