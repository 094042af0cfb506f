"""Significance of movements between two epochs of a run, point by point."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.records.site.folder import SiteFolder
from catseye.reduction.site.motion import ALIDADE, REFLECTOR, frames_of, ground_from
from catseye.verdict import Verdict

LEVEL = 0.01  # probability of one significant point or more among points that rest
NAMED = 3
SQUARE = ((0, 1, 2), (1, 3, 4), (2, 4, 5))  # places of a triangle's six numbers in the matrix


@dataclass(frozen=True, eq=False)
class Moves:
    """Test of movements.

    w            (n,) length of each in its own standard uncertainty: root of d' C^-1 d; NaN where unknown
    significant  (n,) True where it stands out at `level`, shared among all
    level        probability of a false alarm
    """

    w: Array
    significant: np.ndarray
    level: float

    @property
    def verdict(self) -> Verdict:
        """Verdict on the comparison."""
        count = int(self.significant.sum())
        tested = int(np.isfinite(self.w).sum())
        if not tested:
            return Verdict("doubtful", "no movement has an uncertainty")
        if not count:
            return Verdict("good", f"none of {tested} points moved significantly")
        return Verdict(
            "good", f"{count} of {tested} points moved significantly, at a level of {self.level:.0%} for all"
        )


def at_posture(
    site: SiteFolder,
    names: Sequence[str],
    points: Array,
    triangles: Array,
    *,
    before: tuple[float, float],
    after: tuple[float, float],
) -> tuple[Array, Array]:
    """Points (n, 3) m and covariances (n, 6) m^2 of one posture, carried to another by a rigid telescope.

    before, after   azimuth and elevation, rad; points on the ground stay
    """
    frames = frames_of(site)
    points, triangles = points.copy(), triangles.copy()
    for frame in (ALIDADE, REFLECTOR):
        rows = [k for k, name in enumerate(names) if frames.get(name) == frame]
        if not rows:
            continue
        old, new = (ground_from(site, frame, *posture).single for posture in (before, after))
        turn = new.rotation @ old.rotation.T
        points[rows] = new.points(old.inverse().points(points[rows]))
        turned = turn @ triangles[rows][:, np.array(SQUARE)] @ turn.T
        triangles[rows] = np.stack([turned[:, i, j] for i in range(3) for j in range(i, 3)], axis=1)
    return points, triangles


def significant_moves(moved: Array, triangles: Array, level: float = LEVEL) -> Moves:
    """Test each movement against its covariance, by chi squared with three degrees of freedom.

    moved      (n, 3) m
    triangles  (n, 6) m^2: xx, xy, xz, yy, yz, zz
    level      of all tests together; each has its n-th part

    >>> moved = np.array([[3e-3, 0.0, 0.0], [1e-4, 0.0, 0.0]])
    >>> moves = significant_moves(moved, np.array([[1e-8, 0, 0, 1e-8, 0, 1e-8]] * 2))
    >>> moves.w.round(6).tolist(), moves.significant.tolist()
    ([30.0, 1.0], [True, False])
    """
    from scipy.stats import chi2

    matrices = triangles[:, np.array(SQUARE)]
    with np.errstate(invalid="ignore"):
        usable = np.isfinite(moved).all(axis=1) & np.isfinite(triangles).all(axis=1)
    square = np.full(len(moved), np.nan)
    rows = np.flatnonzero(usable)
    rows = rows[np.linalg.eigvalsh(matrices[rows])[:, 0] > 0.0] if len(rows) else rows
    if len(rows):
        solved = np.linalg.solve(matrices[rows], moved[rows][:, :, None])[:, :, 0]
        square[rows] = np.sum(moved[rows] * solved, axis=1)
    limit = chi2.isf(level / max(1, len(rows)), 3)
    return Moves(np.sqrt(square), np.nan_to_num(square, nan=0.0) > limit, level)
