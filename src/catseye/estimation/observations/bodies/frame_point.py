"""Points in a moving frame: ground point = T + R p, with p constant, known or estimated."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.bodies.pose import frame_columns, in_frame, require_rotation
from catseye.estimation.observations.kind import ObservationKind, joined_columns, value
from catseye.estimation.observations.sight import XYZ


@dataclass(frozen=True, eq=False)
class FramePoints(ObservationKind):
    """observed = R' (X - T) - x[p] + error, in the frame's axes.

    R = exp([w]x) R0, see `pose`. With p among the parameters the observed value is 0, or nominal coordinates from which
    p departs.

    name          of the group, for reports
    observed      (3n,) m, x, y, z point by point
    covariance    of the observed values: (n, 3, 3), or as `ObservationGroup` has it; its smallest sensible standard
                  uncertainty is that of `FixedDistances`, for the same reason
    point         (n,) column of the x of each point on the ground
    pose          (6,) or (n, 6) columns of T, m, and w, rad; -1 for a parameter fixed at zero
    start         R0, (3, 3) or (n, 3, 3), ground from frame
    frame_point   (n,) column of the x of p, which y and z follow; -1 where p is zero
    """

    kind: ClassVar[str] = "frame_point"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    point: np.ndarray
    pose: np.ndarray
    start: np.ndarray
    frame_point: np.ndarray

    def __post_init__(self) -> None:
        super().__post_init__()
        require_rotation(self.name, self.start)

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (3n, 10): x, y, z of the point, T, w, the coordinate of p."""
        frame_coordinate = np.where(self.frame_point[:, None] < 0, -1, self.frame_point[:, None] + XYZ).reshape(-1, 1)
        return joined_columns(self.name, len(self.observed), frame_columns(self.point, self.pose), frame_coordinate)

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        """Columns of the point on the ground and of the point in the frame."""
        return np.repeat(self.point, 3), np.repeat(self.frame_point, 3)

    @property
    def component(self) -> np.ndarray:
        return np.tile(["x", "y", "z"], len(self.point))

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (3n,) and Jacobian (3n, 10) at the parameters x.

        >>> at = np.array([0]), np.arange(3, 9), np.eye(3), np.array([9])
        >>> p = FramePoints("p", np.zeros(3), np.ones(3), *at)
        >>> p.predict(np.array([5.0, 2.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 1.0]))[0]
        array([ 0.,  0., -1.])
        """
        frame_coordinate = self.columns[:, 9]
        local, slope = in_frame(x, self.point, self.pose, start=self.start)
        jacobian = np.concatenate([slope.reshape(-1, 9), np.where(frame_coordinate < 0, 0.0, -1.0)[:, None]], axis=1)
        return local.ravel() - value(x, frame_coordinate), jacobian
