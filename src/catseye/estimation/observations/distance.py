"""Slope distances between two points, scaled, with an offset and nuisance terms: what a ranger reports."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, beside
from catseye.estimation.observations.reading import reading, reading_columns
from catseye.estimation.observations.sight import both, length, sight, triples


@dataclass(frozen=True, eq=False)
class Distances(ObservationKind):
    """observed = (scale + sum s_q x[scaling_q]) |target - origin + shift| + offset + sum c_q x[nuisance_q] + error.

    name                  what the group is, for reports
    observed              (m,) metres
    covariance            of the observed values, see `Observations`
    origin                (m,) column of the x of the point measured from (y and z follow it)
    target                (m,) the same of the point measured to
    scale                 (m,) or one: what a metre of distance reads, e.g. the group index of the path
    offset                (m,) or one, metres
    nuisance              (m, q) columns that act linearly, e.g. a ranger's zero (repeats allowed, -1 for none)
    coefficient           (m, q) or one: their derivatives, metres per unit
    shift                 (m, 3) or (3,) m, added to target minus origin: (0, 0, target less instrument height)
    scaling               (m, s) columns that multiply the distance: a ranger's scale, the refractivity of an epoch
    scaling_coefficient   (m, s) or one: 1 for a ratio, 1e-6 for a parameter in ppm
    """

    kind: ClassVar[str] = "slope_distance"
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
        """Values (m,) and Jacobian (m, 6 + q + s) at the parameters x; nan where two points coincide.

        >>> d = Distances("d", np.ones(1), np.ones(1), np.array([0]), np.array([3]))
        >>> d.predict(np.array([0.0, 0.0, 0.0, 3.0, 4.0, 12.0]))[0]
        array([13.])
        """
        size, unit = length(sight(x, self.origin, self.target, self.shift))
        return reading(self, x, size, both(unit))
