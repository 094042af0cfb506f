"""Height differences, as from levelling."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns
from catseye.estimation.observations.sight import sight, triples


@dataclass(frozen=True, eq=False)
class HeightDifferences(ObservationKind):
    """observed = z of target - z of origin + shift_z + error.

    name         of the group, for reports
    observed     (m,) metres
    covariance   of the observed values, see `ObservationGroup`
    origin       (m,) column of the x of the point measured from
    target       (m,) column of the x of the point measured to
    shift        (m, 3) or (3,) m, added to target minus origin, or None; only z matters
    """

    kind: ClassVar[str] = "height_difference"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    shift: np.ndarray | None = None

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 2): z of origin, z of target."""
        return joined_columns(self.name, len(self.observed), triples(self.origin)[:, 2:], triples(self.target)[:, 2:])

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return self.origin, self.target

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 2) at the parameters x.

        >>> h = HeightDifferences("h", np.ones(1), np.ones(1), np.array([0]), np.array([3]))
        >>> h.predict(np.array([0.0, 0.0, 1.0, 3.0, 4.0, 1.5]))[0]
        array([0.5])
        """
        up = sight(x, self.origin, self.target, shift=self.shift)[:, 2]
        return up, np.broadcast_to(np.array([-1.0, 1.0]), (len(up), 2))
