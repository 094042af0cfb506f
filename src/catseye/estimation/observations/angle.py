"""Horizontal angles at a point, clockwise from a backsight to a foresight."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns
from catseye.estimation.observations.sight import bearing, nearest_turn, sight, triples


@dataclass(frozen=True, eq=False)
class HorizontalAngles(ObservationKind):
    """observed = azimuth of foresight - azimuth of backsight + error, both from the point `at`.

    name             of the group, for reports
    observed         (m,) rad, clockwise seen from above, on any turn
    covariance       of the observed values, see `ObservationGroup`
    at               (m,) column of the x of the point where the instrument stands
    backsight        (m,) column of the x of the point sighted first
    foresight        (m,) column of the x of the point sighted second
    backsight_shift  (m, 3) or (3,) m, added to backsight minus at, or None; only eccentricities matter
    foresight_shift  the same for the foresight
    """

    kind: ClassVar[str] = "angle"
    unit: ClassVar[str] = "rad"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    at: np.ndarray
    backsight: np.ndarray
    foresight: np.ndarray
    backsight_shift: np.ndarray | None = None
    foresight_shift: np.ndarray | None = None

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 9): at, backsight, foresight."""
        return joined_columns(self.name, len(self.observed), *map(triples, (self.at, self.backsight, self.foresight)))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        """At, backsight, foresight."""
        return self.at, self.backsight, self.foresight

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 9); nan for a vertical sight.

        Values are on the turn nearest to the observed ones.

        >>> a = HorizontalAngles("a", np.ones(1), np.ones(1), np.array([0]), np.array([3]), np.array([6]))
        >>> a.predict(np.array([0.0, 0.0, 0.0, 0.0, 9.0, 0.0, 2.0, 0.0, 0.0]))[0] == np.pi / 2
        array([ True])
        """
        back, by_back = bearing(sight(x, self.at, self.backsight, shift=self.backsight_shift))
        fore, by_fore = bearing(sight(x, self.at, self.foresight, shift=self.foresight_shift))
        jacobian = np.concatenate([by_back - by_fore, -by_back, by_fore], axis=1)
        return nearest_turn(fore - back, self.observed), jacobian
