"""Fixed distances: lengths known so well that they act as constraints, e.g. of a calibrated bar."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns
from catseye.estimation.observations.sight import by_ends, length, sight, triples

U_FIXED = 1e-7  # m: below any ranger's resolution, above double-precision rounding of 1 km coordinates


@dataclass(frozen=True, eq=False)
class FixedDistances(ObservationKind):
    """observed = |target - origin + shift| + error, with a small non-zero standard uncertainty.

    With zero the covariance would have no inverse, and contradictory constraints would be hidden: with 0.1 um the
    residual and its test show them, and the result differs from the exact constraint's by far less than 0.1 um.

    name         of the group, for reports
    observed     (m,) metres
    covariance   of the observed values, see `ObservationGroup`; set by `constrained`
    origin       (m,) column of the x of one end
    target       (m,) column of the x of the other
    shift        (m, 3) or (3,) m, added to target minus origin, or None
    """

    kind: ClassVar[str] = "fixed_distance"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    shift: np.ndarray | None = None

    @classmethod
    def constrained(
        cls, name: str, observed: np.ndarray, origin: np.ndarray, target: np.ndarray, *, u: float = U_FIXED
    ) -> "FixedDistances":
        """Distances constrained to (m,) metres with standard uncertainty u, m.
        Other arguments as the fields.

        >>> FixedDistances.constrained("bar", np.array([2.0]), np.array([0]), np.array([3])).covariance
        array([1.e-14])
        """
        return cls(name, observed, np.full(len(observed), u**2), origin, target)

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 6) of origin and target."""
        return joined_columns(self.name, len(self.observed), triples(self.origin), triples(self.target))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return self.origin, self.target

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 6); nan where two points coincide."""
        size, unit = length(sight(x, self.origin, self.target, shift=self.shift))
        return size, by_ends(unit)
