"""What kinds of length between two points share: the points, and how an instrument's reading follows from a length."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, beside
from catseye.estimation.observations.reading import Scaled, reading_columns
from catseye.estimation.observations.sight import triples


class ReadPair(Scaled, Protocol):
    """Two points and the reading of the length between them; see `BetweenPoints`."""

    @property
    def name(self) -> str: ...
    @property
    def origin(self) -> np.ndarray: ...
    @property
    def target(self) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class BetweenPoints:
    """First fields of a kind of length between two points; fields of `Scaled` follow.

    name         what the group is, for reports
    observed     (m,) metres
    covariance   of the observed values, see `ObservationGroup`
    origin       (m,) column of the x of the point measured from (y and z follow it)
    target       (m,) the same of the point measured to
    """

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray

    @cached_property
    def columns(self: ReadPair) -> np.ndarray:
        """(m, 6 + q + s): origin, target, nuisance, scaling."""
        return beside(self.name, len(self.observed), triples(self.origin), triples(self.target), *reading_columns(self))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return self.origin, self.target


@dataclass(frozen=True, eq=False)
class LengthsBetweenPoints(BetweenPoints, ObservationKind):
    """Fields of a length between points that stand still: those of `BetweenPoints`, then how it is read.

    scale                 (m,) or one: what a metre of distance reads, e.g. the group index of the path
    offset                (m,) or one, metres
    nuisance              (m, q) columns that act linearly, e.g. a ranger's zero (repeats allowed, -1 for none)
    coefficient           (m, q) or one: their derivatives, metres per unit
    shift                 (m, 3) or (3,) m, added to target minus origin: (0, 0, target less instrument height)
    scaling               (m, s) columns that multiply the distance: a ranger's scale, the refractivity of an epoch
    scaling_coefficient   (m, s) or one: 1 for a ratio, 1e-6 for a parameter in ppm
    """

    scale: np.ndarray | float = 1.0
    offset: np.ndarray | float = 0.0
    nuisance: np.ndarray | None = None
    coefficient: np.ndarray | float = 1.0
    shift: np.ndarray | None = None
    scaling: np.ndarray | None = None
    scaling_coefficient: np.ndarray | float = 1.0
