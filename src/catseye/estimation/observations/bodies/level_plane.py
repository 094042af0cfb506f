"""Level planes: points at known heights from one unknown level, as from a levelling instrument."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, joined_columns, optional, value
from catseye.estimation.observations.sight import triples


@dataclass(frozen=True, eq=False)
class LevelPlanes(ObservationKind):
    """observed = z of point + height - x[level] + error.

    The observed value is usually 0.

    For a levelling instrument that reads a staff on every point, the reading is the `height` and its line of sight the
    unknown `level`.

    name         of the group, for reports
    observed     (m,) metres, usually zeros
    covariance   of the observed values, see `ObservationGroup`
    point        (m,) column of the point's x
    level        (m,) column of the plane's height, m, -1 for the plane z = 0
    height       (m,) or one, m, of the plane's mark above the point
    """

    kind: ClassVar[str] = "level_plane"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    point: np.ndarray
    level: np.ndarray
    height: np.ndarray | float = 0.0

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 2): z of the point, height of the plane."""
        m = len(self.observed)
        return joined_columns(self.name, m, triples(self.point)[:, 2:], optional(self.level, m))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return (self.point,)

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 2) at the parameters x.

        >>> p = LevelPlanes("p", np.zeros(1), np.ones(1), np.array([0]), np.array([3]), 1.25)
        >>> p.predict(np.array([5.0, 6.0, 100.0, 101.0]))[0]
        array([0.25])
        """
        level = self.columns[:, 1]
        jacobian = np.stack([np.ones(len(level)), np.where(level < 0, 0.0, -1.0)], axis=1)
        return x[self.point + 2] + self.height - value(x, level), jacobian
