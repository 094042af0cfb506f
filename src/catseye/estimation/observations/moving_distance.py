"""Distances between moving points: rotated and shifted to the instant of each shot."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.between_points import BetweenPoints
from catseye.estimation.observations.kind import ObservationKind
from catseye.estimation.observations.reading import reading
from catseye.estimation.observations.sight import length, triples


@dataclass(frozen=True, eq=False)
class MovingDistances(BetweenPoints, ObservationKind):
    """observed = scale |B target + b - A origin - a| + offset + sum c_q x[nuisance_q] + error.

    The parameters are the points at one instant, the epoch; A, a and B, b transform them to the instant of each shot,
    as rigid motions. First come the fields of `BetweenPoints`, last those of `LengthsBetweenPoints` without `shift`.

    origin_turn, target_turn     (m, 3, 3) A, B: rotations
    origin_shift, target_shift   (m, 3) a, b, m
    """

    kind: ClassVar[str] = "moving_distance"
    unit: ClassVar[str] = "m"

    origin_turn: np.ndarray
    origin_shift: np.ndarray
    target_turn: np.ndarray
    target_shift: np.ndarray
    scale: np.ndarray | float = 1.0
    offset: np.ndarray | float = 0.0
    nuisance: np.ndarray | None = None
    coefficient: np.ndarray | float = 1.0
    scaling: np.ndarray | None = None
    scaling_coefficient: np.ndarray | float = 1.0

    def ends_at_shots(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Origins and targets (m, 3) at the instants of the shots."""
        a = np.einsum("mij,mj->mi", self.origin_turn, x[triples(self.origin)]) + self.origin_shift
        b = np.einsum("mij,mj->mi", self.target_turn, x[triples(self.target)]) + self.target_shift
        return a, b

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 6 + q + s).

        Values are nan where two points coincide.

        >>> turn = np.array([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
        >>> still = np.eye(3)[None], np.zeros((1, 3))
        >>> one, ends = np.ones(1), (np.array([0]), np.array([3]))
        >>> d = MovingDistances("d", one, one, *ends, *still, turn, np.zeros((1, 3)))
        >>> d.predict(np.array([0.0, 4.0, 0.0, 1.0, 0.0, 0.0]))[0]
        array([3.])
        """
        a, b = self.ends_at_shots(x)
        size, unit = length(b - a)
        by_origin = -np.einsum("mij,mi->mj", self.origin_turn, unit)
        by_target = np.einsum("mij,mi->mj", self.target_turn, unit)
        return reading(self, x, size, slope=np.concatenate([by_origin, by_target], axis=1))
