"""Common fields of lengths between two points, and their conversion to readings."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns
from catseye.estimation.observations.reading import Scaled, reading_columns
from catseye.estimation.observations.sight import triples


class ReadPair(Scaled, Protocol):
    """Protocol of two points and a reading of the length between them.

    See `BetweenPoints`.
    """

    @property
    def name(self) -> str: ...
    @property
    def origin(self) -> np.ndarray: ...
    @property
    def target(self) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class BetweenPoints:
    """First fields of a kind of length between two points.
    Fields of `Scaled` follow.

    name         of the group, for reports
    observed     (m,) metres
    covariance   of the observed values, see `ObservationGroup`
    origin       (m,) column of the x of the point measured from (y and z follow it)
    target       (m,) column of the x of the point measured to
    """

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray

    @cached_property
    def columns(self: ReadPair) -> np.ndarray:
        """Columns (m, 6 + q + s): origin, target, nuisance, scaling."""
        return joined_columns(
            self.name, len(self.observed), triples(self.origin), triples(self.target), *reading_columns(self)
        )

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return self.origin, self.target


@dataclass(frozen=True, eq=False)
class LengthsBetweenPoints(BetweenPoints, ObservationKind):
    """Fields of a length between static points.
    They are those of `BetweenPoints`, then the reading's.

    scale                 (m,) or one: reading per metre of distance, e.g. the group index of the path
    offset                (m,) or one, metres
    nuisance              (m, q) columns of linear nuisance parameters, e.g. a ranger's zero (repeats allowed, -1 for
                          none)
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
