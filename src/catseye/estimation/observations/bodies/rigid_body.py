"""Rigid bodies: points that move together, such as the prisms of a triplet or of a panel."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.bodies.pose import frame_columns, in_frame, require_rotation
from catseye.estimation.observations.kind import ObservationKind


@dataclass(frozen=True, eq=False)
class RigidBodies(ObservationKind):
    """observed = R' (X - T) + error: coordinates of ground points X in the body.

    R = exp([w]x) R0, see `pose`. The observed values are calibrated body coordinates with their covariance; six
    parameters give the pose. Several bodies can share a group, with pose columns per point.

    name         of the group, for reports
    observed     (3n,) m, body coordinates x, y, z point by point
    covariance   of the observed values, (3n, 3n) or another form of `ObservationGroup`
    point        (n,) column of the x of each point on the ground
    pose         (6,) or (n, 6) columns of T, m, and w, rad; -1 for a parameter fixed at zero
    start        R0, (3, 3) or (n, 3, 3), ground from body
    """

    kind: ClassVar[str] = "rigid_body"
    unit: ClassVar[str] = "m"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    point: np.ndarray
    pose: np.ndarray
    start: np.ndarray

    def __post_init__(self) -> None:
        super().__post_init__()
        require_rotation(self.name, self.start)

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (3n, 9): x, y, z of the point, T, w."""
        return frame_columns(self.point, self.pose)

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        return (np.repeat(self.point, 3),)

    @property
    def component(self) -> np.ndarray:
        return np.tile(["x", "y", "z"], len(self.point))

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (3n,) and Jacobian (3n, 9) at the parameters x.

        >>> b = RigidBodies("b", np.zeros(3), np.ones(3), np.array([0]), np.arange(3, 9), np.eye(3))
        >>> b.predict(np.array([5.0, 2.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0, np.pi / 2]))[0].round(12)
        array([2., 0., 0.])
        """
        local, slope = in_frame(x, self.point, self.pose, start=self.start)
        return local.ravel(), slope.reshape(-1, 9)
