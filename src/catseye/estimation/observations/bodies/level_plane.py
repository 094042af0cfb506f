"""Level planes: points at one unknown height, or at known heights above it, as a level's line of sight gives them."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, beside, optional, value
from catseye.estimation.observations.sight import triples


@dataclass(frozen=True, eq=False)
class LevelPlanes(ObservationKind):
    """observed = z of point + height - x[level] + error; observed 0 says that the point plus its height is level.

    A level that stands anywhere and reads a staff on each point: the reading is the `height`, and its line of sight the
    unknown `level`.

    name         what the group is, for reports
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
        """(m, 2): z of the point, height of the plane."""
        m = len(self.observed)
        return beside(self.name, m, triples(self.point)[:, 2:], optional(self.level, m))

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
