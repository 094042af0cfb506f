"""Observations that meet in one point and cannot all be right: which are the fewest that might be wrong?"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import chdtri

from catseye.estimation.least_squares.adjustment import LeastSquaresSolution, SolverSettings, adjust
from catseye.estimation.least_squares.rows import variances
from catseye.estimation.observations.kinds import ObservationGroup

MOST_AT_ONE_POINT = 2  # wrong observations searched for at one point, exhaustively
LARGEST_SEARCH = 24  # observations at a point; a point with more has redundancy enough for the robust fit alone
SEARCHES = 6  # at one point, each about the place that the one before found likeliest
SLACK = 2.0  # on sigma in the search, because everything but the point itself is held there


@dataclass(frozen=True, eq=False)
class LocalConflict:
    """The observations that meet in one point, everything else held: which of them cannot all be right?

    rows       (group, row) of each observation that may be wrong
    residual   (k,) over sigma
    slopes     (k, 3) derivatives by the point's coordinates, over sigma
    prior      (q,) residuals over sigma of what is known of the point besides, and is not in doubt
    prior_slopes   (q, 3)

    >>> slopes = np.vstack([np.eye(3), np.ones((1, 3)), [[1.0, -1.0, 0.0]], [[0.0, 1.0, -1.0]]])
    >>> wrong = slopes @ np.array([5.0, -3.0, 2.0]) + np.array([0, 0, 30.0, 0, 0, 0])
    >>> LocalConflict([(0, k) for k in range(6)], wrong, slopes, np.zeros(0), np.zeros((0, 3))).smallest_conflict()
    (2,)
    """

    rows: list[tuple[int, int]]
    residual: np.ndarray
    slopes: np.ndarray
    prior: np.ndarray
    prior_slopes: np.ndarray

    def cost(self, out: Sequence[int]) -> float:
        """Sum of squares at the best place for the point when some observations are left out."""
        return self._best(out)[0]

    def _best(self, out: Sequence[int]) -> tuple[float, np.ndarray]:
        keep = np.ones(len(self.rows), dtype=bool)
        keep[list(out)] = False
        v = np.concatenate([self.residual[keep], self.prior])
        a = np.concatenate([self.slopes[keep], self.prior_slopes])
        place = np.linalg.lstsq(a, v, rcond=None)[0]
        return float(np.sum((v - a @ place) ** 2)), place

    def likeliest_place(self) -> np.ndarray | None:
        """Where the point moves (3,) when as many are left out as is searched for; None where the rest is no check."""
        k = len(self.rows)
        size = min(MOST_AT_ONE_POINT, k + len(self.prior) - 4)
        if size < 1:
            return None
        return min((self._best(out) for out in combinations(range(k), size)), key=lambda best: best[0])[1]

    def smallest_conflict(self) -> tuple[int, ...] | None:
        """The fewest observations whose absence lets the rest agree, or None where two are not enough.

        The rest agrees when its sum of squares stays below the chi-square quantile at 99.9 %; of several sets of one
        size the one with the best rest is taken.
        """
        k = len(self.rows)
        for size in range(min(MOST_AT_ONE_POINT, k - 1) + 1):
            degrees = k - size + len(self.prior) - 3
            if degrees < 1:
                return None
            sets = {out: self.cost(out) for out in combinations(range(k), size)}
            best = min(sets, key=sets.__getitem__)
            if sets[best] < chdtri(degrees, 0.001):
                return best
        return None


def search(
    columns: np.ndarray,
    groups: Sequence[ObservationGroup],
    jacobians: Sequence[np.ndarray],
    *,
    removable: Sequence[np.ndarray],
    solution: LeastSquaresSolution,
    advice: Sequence[ObservationGroup] = (),
) -> tuple[LocalConflict, tuple[int, ...] | None]:
    """The smallest conflict at a point; where there is none, searched again about the place of the best explanation.

    A wrong range of half a metre carries its point so far that slopes taken there explain nothing to 25 um.
    """
    for _ in range(SEARCHES):
        local = at_point(columns, groups, jacobians, removable=removable, solution=solution, advice=advice, slack=SLACK)
        if not 2 <= len(local.rows) <= LARGEST_SEARCH:
            return local, None
        wrong = local.smallest_conflict()
        place = local.likeliest_place()
        if wrong is not None or place is None:
            return local, wrong
        x = solution.x.copy()
        x[columns] += place
        solution = adjust(x, groups, free=np.zeros(len(x), dtype=bool), solver=SolverSettings(tests=False))
        jacobians = [g.predict(x)[1] for g in groups]
    return local, None


def at_point(
    columns: np.ndarray,
    groups: Sequence[ObservationGroup],
    jacobians: Sequence[np.ndarray],
    *,
    removable: Sequence[np.ndarray],
    solution: LeastSquaresSolution,
    advice: Sequence[ObservationGroup] = (),
    slack: float,
) -> LocalConflict:
    """What meets in a point: removable observations that depend on it; others, and advice, that depend on it alone."""
    rows: list[tuple[int, int]] = []
    doubted: list[tuple[float, np.ndarray]] = []
    prior: list[tuple[float, np.ndarray]] = []
    for i, (group, jacobian, may, fit) in enumerate(zip(groups, jacobians, removable, solution.fits, strict=True)):
        slope, touching, alone = _slopes(columns, group, jacobian)
        for k in np.flatnonzero(touching & may):
            sigma = slack * fit.sigma[k]
            doubted.append((fit.residual[k] / sigma, slope[k] / sigma))
            rows.append((i, int(k)))
        prior += [(fit.residual[k] / fit.sigma[k], slope[k] / fit.sigma[k]) for k in np.flatnonzero(alone & ~may)]
    for group in advice:
        if np.isin(columns, group.columns).any():
            values, jacobian = group.predict(solution.x)
            slope, _, alone = _slopes(columns, group, jacobian)
            sigma = np.sqrt(variances(group))
            residual = group.observed - values
            prior += [(residual[k] / sigma[k], slope[k] / sigma[k]) for k in np.flatnonzero(alone)]
    (residual, slopes), (prior_residual, prior_slopes) = (
        (np.array([v for v, _ in part]), np.array([a for _, a in part]).reshape(-1, 3)) for part in (doubted, prior)
    )
    return LocalConflict(rows, residual, slopes, prior_residual, prior_slopes)


def _slopes(
    columns: np.ndarray, group: ObservationGroup, jacobian: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives (m, 3) of a group by a point, which rows depend on it, and which on nothing else."""
    here = group.columns[..., None] == columns  # in any order, and perhaps not all three
    if here.ndim == 2:
        slope, others = jacobian @ here, jacobian[:, ~here.any(axis=1)]
    else:
        slope, others = np.einsum("mw,mwa->ma", jacobian, here), np.where(here.any(axis=2), 0.0, jacobian)
    touching = np.any(slope != 0.0, axis=1)
    return slope, touching, touching & ~np.any(others != 0.0, axis=1)


def touched(
    points: Sequence[np.ndarray],
    groups: Sequence[ObservationGroup],
    jacobians: Sequence[np.ndarray],
    *,
    chosen: Sequence[np.ndarray],
) -> list[np.ndarray]:
    """The points that the chosen observations depend on."""
    columns = {
        int(c)
        for group, jacobian, rows in zip(groups, jacobians, chosen, strict=True)
        for c in _columns_of(group, jacobian, rows)
    }
    return [p for p in points if columns.intersection(p.tolist())]


def _columns_of(group: ObservationGroup, jacobian: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Columns that some rows of a group depend on."""
    used = jacobian[rows] != 0.0
    return group.columns[np.any(used, axis=0)] if group.columns.ndim == 1 else group.columns[rows][used]
