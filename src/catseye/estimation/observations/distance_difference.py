"""Differences of two slope distances: interferometer count, or time difference of arrival."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns
from catseye.estimation.observations.reading import reading, reading_columns
from catseye.estimation.observations.sight import by_ends, length, sight, triples


@dataclass(frozen=True, eq=False)
class DistanceDifferences(ObservationKind):
    """observed = (scale + sum s_q x[scaling_q]) (|target - origin| - |target_2 - origin_2|) + offset + ... + error.

    With one target, origin B and origin_2 A it is |P - B| - |P - A|; the four points may all differ.

    origin, target       (m,) columns of the ends of the distance counted positive
    origin_2, target_2   (m,) of the distance counted negative
    shift, shift_2       (m, 3) or (3,) m, added to each target minus its origin, or None
    others               as those of `Distances`
    """

    kind: ClassVar[str] = "distance_difference"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    origin_2: np.ndarray
    target_2: np.ndarray
    scale: np.ndarray | float = 1.0
    offset: np.ndarray | float = 0.0
    nuisance: np.ndarray | None = None
    coefficient: np.ndarray | float = 1.0
    shift: np.ndarray | None = None
    shift_2: np.ndarray | None = None
    scaling: np.ndarray | None = None
    scaling_coefficient: np.ndarray | float = 1.0

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 12 + q + s): origin, target, origin_2, target_2, nuisance, scaling."""
        points = (self.origin, self.target, self.origin_2, self.target_2)
        return joined_columns(self.name, len(self.observed), *map(triples, points), *reading_columns(self))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        """Origin, target, second origin, second target."""
        return self.origin, self.target, self.origin_2, self.target_2

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 12 + q + s).

        Values are nan where the ends of a distance coincide.

        >>> at = np.array([0]), np.array([3]), np.array([0]), np.array([6])
        >>> d = DistanceDifferences("d", np.ones(1), np.ones(1), *at)
        >>> d.predict(np.array([0.0, 0.0, 0.0, 3.0, 4.0, 12.0, 0.0, 3.0, 4.0]))[0]
        array([8.])
        """
        first, unit = length(sight(x, self.origin, self.target, shift=self.shift))
        second, unit_2 = length(sight(x, self.origin_2, self.target_2, shift=self.shift_2))
        return reading(self, x, first - second, slope=np.concatenate([by_ends(unit), -by_ends(unit_2)], axis=1))
