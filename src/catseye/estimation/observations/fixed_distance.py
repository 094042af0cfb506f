"""Fixed distances: lengths that are known so well that they hold as conditions, such as a calibrated bar's."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, beside
from catseye.estimation.observations.sight import both, length, sight, triples

U_FIXED = 1e-7  # m: below what any ranger sees, above what rounding in double precision does to coordinates of 1 km


@dataclass(frozen=True, eq=False)
class FixedDistances(ObservationKind):
    """observed = |target - origin + shift| + error, with a standard uncertainty that is small but not zero.

    With zero the covariance would have no inverse, and two conditions that contradict would be hidden: with 0.1 um the
    residual and its test show it, and the answer differs from the exact condition's by far less than 0.1 um.

    name         what the group is, for reports
    observed     (m,) metres
    covariance   of the observed values, see `ObservationGroup`; `held` makes it
    origin       (m,) column of the x of one end
    target       (m,) the same of the other
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
    def held(
        cls, name: str, observed: np.ndarray, origin: np.ndarray, target: np.ndarray, *, u: float = U_FIXED
    ) -> "FixedDistances":
        """Distances held at (m,) metres, each with the standard uncertainty u, m; other arguments as the fields.

        >>> FixedDistances.held("bar", np.array([2.0]), np.array([0]), np.array([3])).covariance
        array([1.e-14])
        """
        return cls(name, observed, np.full(len(observed), u**2), origin, target)

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns of origin and target, (m, 6)."""
        return beside(self.name, len(self.observed), triples(self.origin), triples(self.target))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return self.origin, self.target

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 6) at the parameters x; nan where two points coincide."""
        size, unit = length(sight(x, self.origin, self.target, shift=self.shift))
        return size, both(unit)
