"""Observations that are linear in the parameters: priors, coordinates, vectors between points."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, value


@dataclass(frozen=True, eq=False)
class Linear(ObservationKind):
    """observed = matrix @ x[columns] + error.

    name         of the group, for reports
    observed     (m,)
    covariance   of the observed values, see `ObservationGroup`
    columns      (k,) indices of parameters, without repeats; or (m, w) per row, -1 for none
    matrix       (m, k) or (m, w)
    """

    kind: ClassVar[str] = "linear"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    columns: np.ndarray
    matrix: np.ndarray

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian, (m, k) or (m, w), at the parameters x.

        >>> rod = Linear("rod", np.array([2.0]), np.eye(1), np.array([0, 3]), np.array([[-1.0, 1.0]]))
        >>> rod.predict(np.array([1.0, 0.0, 0.0, 3.5]))[0]
        array([2.5])
        """
        if self.columns.ndim == 2:
            return np.sum(self.matrix * value(x, self.columns), axis=1), np.where(self.columns < 0, 0.0, self.matrix)
        return self.matrix @ x[self.columns], self.matrix
