"""Vectors between points: baselines of satellite receivers, or differences of coordinates."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns
from catseye.estimation.observations.sight import sight, triples


@dataclass(frozen=True, eq=False)
class Vectors(ObservationKind):
    """observed = target - origin + shift + error, three rows x, y, z per vector.

    name         of the group, for reports
    observed     (3b,) metres, vector by vector
    covariance   of the observed values: (b, 3, 3), or another form of `ObservationGroup`
    origin       (b,) column of the x of the point measured from
    target       (b,) column of the x of the point measured to
    shift        (b, 3) or (3,) m, added to target minus origin: (0, 0, target less instrument height); or None
    """

    kind: ClassVar[str] = "vector"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    shift: np.ndarray | None = None

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (3b, 2): coordinate of the origin, of the target."""
        ends = (triples(p).reshape(-1, 1) for p in (self.origin, self.target))
        return joined_columns(self.name, len(self.observed), *ends)

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return np.repeat(self.origin, 3), np.repeat(self.target, 3)

    @property
    def component(self) -> np.ndarray:
        return np.tile(["x", "y", "z"], len(self.origin))

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (3b,) and Jacobian (3b, 2) at the parameters x.

        >>> v = Vectors("v", np.zeros(3), np.eye(3)[None], np.array([0]), np.array([3]))
        >>> v.predict(np.array([1.0, 0.0, 0.0, 3.0, 4.0, 12.0]))[0]
        array([ 2.,  4., 12.])
        """
        values = sight(x, self.origin, self.target, shift=self.shift).ravel()
        return values, np.broadcast_to(np.array([-1.0, 1.0]), (len(values), 2))
