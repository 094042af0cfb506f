"""Tilts: readings of an inclinometer fixed in a moving frame."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.estimation.observations.bodies.pose import require_rotation, turned_back
from catseye.estimation.observations.kind import ObservationKind, joined_columns, optional, value
from catseye.estimation.observations.unit_direction import require_direction


@dataclass(frozen=True, eq=False)
class ObservedTilts(ObservationKind):
    """observed = asin(axis . R' up / |axis|) + x[zero] + error.

    The angle is the elevation of a sensitive axis. R = exp([w]x) R0 is ground from frame, see `bodies.pose`. A two-axis
    inclinometer gives two rows, with axes (1, 0, 0) and (0, 1, 0) if mounted square: for a small w the first reads
    -w_y, the second w_x. A rotation about the vertical is not observed.

    name         of the group, for reports
    observed     (m,) rad, positive when the axis points up
    covariance   of the observed values, see `ObservationGroup`
    axis         (m, 3) or (3,) directions in the frame, of any length but zero
    turn         (3,) or (m, 3) columns of w, rad; -1 for a parameter fixed at zero
    start        R0, (3, 3) or (m, 3, 3), ground from frame
    zero         (m,) column of the reading when level, rad, -1 for none; or None
    """

    kind: ClassVar[str] = "tilt"
    unit: ClassVar[str] = "rad"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    axis: np.ndarray
    turn: np.ndarray
    start: np.ndarray
    zero: np.ndarray | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require_rotation(self.name, self.start)
        require_direction(self.name, "sensitive axis", self.axis)

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, 4) of the rotation w and the zero."""
        m = len(self.observed)
        return joined_columns(self.name, m, np.atleast_2d(self.turn), optional(self.zero, m))

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, 4).

        Values are nan where an axis is vertical.

        >>> t = ObservedTilts("t", np.zeros(1), np.ones(1), np.array([0.0, 1.0, 0.0]), np.arange(3), np.eye(3))
        >>> t.predict(np.array([0.25, 0.0, 0.0]))[0]
        array([0.25])
        """
        m = len(self.observed)
        turn = np.atleast_2d(self.turn)
        up, _, by_turn = turned_back(np.tile([0.0, 0.0, 1.0], (m, 1)), value(x, turn), self.start)
        axis = np.broadcast_to(self.axis, (m, 3))
        sine = np.sum(axis * up, axis=1)
        cosine = np.linalg.norm(np.cross(axis, up), axis=1)  # not from the sine, which loses digits near the vertical
        zero = self.columns[:, 3]
        slope = np.einsum("mi,mij->mj", axis, by_turn) / np.where(cosine > 0.0, cosine, np.nan)[:, None]
        jacobian = np.concatenate([np.where(turn < 0, 0.0, slope), np.where(zero < 0, 0.0, 1.0)[:, None]], axis=1)
        return np.arctan2(sine, np.where(cosine > 0.0, cosine, np.nan)) + value(x, zero), jacobian
