"""Horizontal distances: the level part of the line between two points."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, beside
from catseye.estimation.observations.reading import reading, reading_columns
from catseye.estimation.observations.sight import both, level_length, sight, triples


@dataclass(frozen=True, eq=False)
class HorizontalDistances(ObservationKind):
    """observed = (scale + sum s_q x[scaling_q]) hypot(dx, dy) + offset + sum c_q x[nuisance_q] + error.

    The height of the points does not enter, nor do heights of instrument and target; `shift` serves eccentric ones.
    Fields are those of `Distances`.
    """

    kind: ClassVar[str] = "horizontal_distance"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    scale: np.ndarray | float = 1.0
    offset: np.ndarray | float = 0.0
    nuisance: np.ndarray | None = None
    coefficient: np.ndarray | float = 1.0
    shift: np.ndarray | None = None
    scaling: np.ndarray | None = None
    scaling_coefficient: np.ndarray | float = 1.0

    @cached_property
    def columns(self) -> np.ndarray:
        """(m, 6 + q + s): origin, target, nuisance, scaling."""
        return beside(self.name, len(self.observed), triples(self.origin), triples(self.target), *reading_columns(self))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return self.origin, self.target

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 6 + q + s) at the parameters x; nan where one point is above the other.

        >>> d = HorizontalDistances("d", np.ones(1), np.ones(1), np.array([0]), np.array([3]))
        >>> d.predict(np.array([0.0, 0.0, 0.0, 3.0, 4.0, 12.0]))[0]
        array([5.])
        """
        size, outward = level_length(sight(x, self.origin, self.target, self.shift))
        return reading(self, x, size, both(outward))
