"""Rigid triplets: two prisms and a ball with calibrated geometry, in any pose."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.observations.kind import ObservationKind, optional, value
from catseye.estimation.observations.sight import length, triples
from catseye.estimation.observations.unit_direction import direction, require_direction

ROWS = 5
EYE = np.eye(3)


@dataclass(frozen=True, eq=False)
class RigidTriplets(ObservationKind):
    """Five rows per unit, observed = (along, across, height, spacing, squareness) - x[offset] + error.

    With e the unit vector from the left to the right prism, u the plate's normal at its tilts, n the unit vector along
    the part of u perpendicular to e, m = n x e, and b the ball's centre less the prisms' mid-point:

        along = b . e, across = b . m, height = b . n (H_corr), spacing between the prisms, squareness = e . u.

    The prisms alone do not determine the rotation about their line; the plate's normal does: two tilts from a start,
    with a prior. The squareness determines one of the tilts to a tenth of a milliradian, as the ranges' obliquity
    needs.

    name         of the group, for reports
    observed     (5n,) four lengths in m and an angle in rad, unit by unit; 0, 0, H_corr, D_12, 0 of a data sheet
    covariance   of the observed values: (n, 5, 5), or another form of `ObservationGroup`
    left         (n,) column of the x of the left prism's reference point
    right        (n,) column of the x of the right prism's reference point
    ball         (n,) column of the x of the ball's centre
    tilt         (n, 2) columns of the tilts of the normal from its start, rad; -1 for a tilt fixed at zero
    start        (n, 3) or (3,) plate's normal on the prism side, any length, less than a right angle off
    offset       (n, 5) columns of calibration errors, constant in all postures; -1 for none; or None
    """

    kind: ClassVar[str] = "rigid_triplet"
    unit: ClassVar[str] = ""

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    left: np.ndarray
    right: np.ndarray
    ball: np.ndarray
    tilt: np.ndarray
    start: np.ndarray
    offset: np.ndarray | None = None

    def __post_init__(self) -> None:
        n, m = len(self.left), len(self.observed)
        if m != ROWS * n:
            raise EstimationError(f"{self.name}: {m} observed values for {n} triplets; give {ROWS} per unit")
        super().__post_init__()
        require_direction(self.name, "plate's normal", self.start)

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (5n, 12): left prism, right prism, ball, two tilts, offset of the row."""
        n = len(self.left)
        common = [*(triples(p) for p in (self.left, self.right, self.ball)), self.tilt.reshape(n, 2)]
        offset = optional(self.offset, n, ROWS).reshape(-1, 1)
        return np.concatenate([np.repeat(np.concatenate(common, axis=1), ROWS, axis=0), offset], axis=1)

    @property
    def units(self) -> np.ndarray:
        return np.tile(["m", "m", "m", "m", "rad"], len(self.left))

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        """Columns of the left prism, the right prism and the ball."""
        return tuple(np.repeat(p, ROWS) for p in (self.left, self.right, self.ball))

    @property
    def component(self) -> np.ndarray:
        """Components (5n,): x along, y across, z height of the unit.

        It is "" for other rows.
        """
        return np.tile(["x", "y", "z", "", ""], len(self.left))

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (5n,) and Jacobian (5n, 12); nan where two prisms coincide.

        >>> t = RigidTriplets("t", np.zeros(5), np.ones(5), *(np.array([c]) for c in (0, 3, 6)),
        ...                   np.array([[-1, -1]]), np.array([0.0, 0.0, 1.0]))
        >>> t.predict(np.array([0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 2.5, 0.1, 0.2]))[0].tolist()
        [0.5, 0.1, 0.2, 4.0, 0.0]
        """
        n = len(self.left)
        left, right, ball = (x[triples(p)] for p in (self.left, self.right, self.ball))
        spacing, e = length(right - left)
        tilted = direction(np.broadcast_to(self.start, (n, 3)), value(x, self.tilt.reshape(n, 2)))
        body, slopes = _in_body(ball - 0.5 * (left + right), e, tilted.u)
        by_b, by_e, by_u = slopes
        by_s = by_e @ ((EYE - e[:, :, None] * e[:, None, :]) / spacing[:, None, None])
        by_s[:, 3] += e  # row of the spacing
        tilts = np.einsum("nrk,nak->nra", by_u, tilted.du)
        tilts = np.where(self.tilt.reshape(n, 1, 2) < 0, 0.0, tilts)
        parts = [-0.5 * by_b - by_s, -0.5 * by_b + by_s, by_b, tilts]
        offset = self.columns[:, -1]
        jacobian = np.concatenate(parts, axis=2).reshape(-1, 11)
        values = np.stack([body[:, 0], body[:, 1], body[:, 2], spacing, body[:, 3]], axis=1).ravel()
        return values - value(x, offset), np.concatenate([jacobian, np.where(offset < 0, 0.0, -1.0)[:, None]], axis=1)


def _in_body(b: np.ndarray, e: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Coordinates (along, across, height, squareness) of n units, and derivatives by b, e and u.

    The derivatives are (n, 5, 3) each, of five rows. With q = e . u, w = u - q e and c = |w|: dn = (1 - n n')/c dw, dw
    = du - e (e . du) - (e u' + q) de, and across is the scalar triple product of b, n and e. The fourth row, the
    spacing, is 0: it does not depend on them.
    """
    q = np.sum(e * u, axis=1)
    w = u - q[:, None] * e
    c = np.linalg.norm(w, axis=1)
    n = w / np.where(c > 0.0, c, np.nan)[:, None]
    m = np.cross(n, e)
    turn = (EYE - n[:, :, None] * n[:, None, :]) / c[:, None, None]
    n_by_u = turn @ (EYE - e[:, :, None] * e[:, None, :])
    n_by_e = -turn @ (e[:, :, None] * u[:, None, :] + q[:, None, None] * EYE)
    zeros = np.zeros_like(b)
    box_n = np.cross(e, b)

    def by_n(row: np.ndarray, n_by: np.ndarray) -> np.ndarray:
        return np.einsum("nk,nkl->nl", row, n_by)

    by_b = np.stack([e, m, n, zeros, zeros], axis=1)
    by_e = np.stack([b, np.cross(b, n) + by_n(box_n, n_by_e), by_n(b, n_by_e), zeros, u], axis=1)
    by_u = np.stack([zeros, by_n(box_n, n_by_u), by_n(b, n_by_u), zeros, e], axis=1)
    body = np.stack([np.sum(b * e, axis=1), np.sum(b * m, axis=1), np.sum(b * n, axis=1), q], axis=1)
    return body, (by_b, by_e, by_u)
