"""Which observations are wrong: a robust start, the smallest conflict of each point, then removal and return by test."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.stats import chi2

from catseye.estimation.adjustment import CONVERGED, Solution, adjust
from catseye.estimation.observations import Observations

UNDECIDED = "rejection undecided after {rounds} rounds: some observations contradict each other and none stands out"
MOST_AT_ONE_POINT = 2  # wrong observations searched for at one point, exhaustively
LARGEST_SEARCH = 24  # observations at a point; a point with more has redundancy enough for the robust fit alone
SLACK = 2.0  # on sigma in the search, because everything but the point itself is held there


def adjust_robustly(
    x0: np.ndarray,
    groups: Sequence[Observations],
    removable: Sequence[np.ndarray],
    *,
    points: Sequence[np.ndarray] = (),
    free: np.ndarray | None = None,
    active: Sequence[np.ndarray] | None = None,
    names: Sequence[str] | None = None,
    critical: float = 3.5,
    rounds: int = 40,
) -> Solution:
    """An adjustment without the observations that do not belong to it; the fits say which (`active`).

    x0          (n,) start values
    groups      observations, as for `adjust`
    removable   one (m,) bool array a group: True for observations that may be wrong and may be left out
    points      columns of each point, (3,) an array: where a few observations meet, the smallest conflict is sought
    free        (n,) bool, as for `adjust`
    active      one (m,) bool array a group: start from this selection instead of searching for one
    names       (n,) what the parameters are called
    critical    |w| above which an observation is left out, below which it comes back; 3.5 leaves out one good
                observation in 2000
    rounds      cap of removal rounds; if they do not end, the status says so

    Three steps. A reweighted fit (Cauchy weights of the residual) keeps an observation that is wrong by a thousand
    sigmas from dragging others along. Where few observations meet in a point such a fit can share the blame between
    innocent ones; so every point in conflict is searched for the smallest set whose absence makes the rest agree.
    At last Baarda's test with correlations, over everything: out with the worst, back in with those that pass.

    Source: [BAARDA68]; [FOERSTNER16] section 4.7; the search is the minimal-conflict form of data snooping.
    """
    if active is None:
        solution, active = _robust_start(x0, groups, removable, points, free, names)
        x = solution.x
    else:
        x = x0
    for _ in range(rounds):
        solution = adjust(x, groups, free=free, active=active, names=names)
        if solution.status != CONVERGED:
            return solution
        x = solution.x
        tests = [np.where(may, np.abs(f.standardised), 0.0) for f, may in zip(solution.fits, removable, strict=True)]
        worst = max(float(t[a].max(initial=0.0)) for t, a in zip(tests, active, strict=True))
        back = [~a & (t < 0.9 * critical) for t, a in zip(tests, active, strict=True)]
        if worst <= critical and not any(b.any() for b in back):
            return solution
        limit = max(critical, 0.8 * worst)
        active = [(a & (t < limit)) | b for t, a, b in zip(tests, active, back, strict=True)]
        if worst <= critical:  # a return that makes trouble again is not tried twice
            removable = [may & ~b for may, b in zip(removable, back, strict=True)]
    return Solution(
        solution.x, solution.covariance, UNDECIDED.format(rounds=rounds), solution.iterations, solution.fits
    )


def _robust_start(
    x0: np.ndarray,
    groups: Sequence[Observations],
    removable: Sequence[np.ndarray],
    points: Sequence[np.ndarray],
    free: np.ndarray | None,
    names: Sequence[str] | None,
) -> tuple[Solution, list[np.ndarray]]:
    extra = [np.zeros(len(g.observed)) for g in groups]
    solution = adjust(x0, groups, free=free, names=names, iterations=1, tests=False)
    for _ in range(8):
        for i, (fit, may) in enumerate(zip(solution.fits, removable, strict=True)):
            extra[i] = np.where(may, (fit.residual / 2.0) ** 2, 0.0)
        solution = adjust(solution.x, groups, free=free, extra_variance=extra, names=names, iterations=1, tests=False)
    active = [
        ~may | (np.abs(fit.residual) < 10.0 * fit.sigma) for fit, may in zip(solution.fits, removable, strict=True)
    ]
    predictions = [g.predict(solution.x)[1] for g in groups]
    for columns in points:
        rows, slopes = _rows_at(columns, groups, predictions, removable)
        if not 4 <= len(rows) <= LARGEST_SEARCH:
            continue
        residual = np.array([solution.fits[i].residual[k] for i, k in rows])
        sigma = np.array([solution.fits[i].sigma[k] for i, k in rows])
        if np.max(np.abs(residual) / sigma) < 3.0:
            continue
        wrong = smallest_conflict(residual / (SLACK * sigma), slopes / (SLACK * sigma[:, None]))
        if wrong is not None:
            for index, (i, k) in enumerate(rows):
                active[i][k] = index not in wrong
    return solution, active


def _rows_at(
    columns: np.ndarray,
    groups: Sequence[Observations],
    jacobians: Sequence[np.ndarray],
    removable: Sequence[np.ndarray],
) -> tuple[list[tuple[int, int]], np.ndarray]:
    """Removable observations (group, row) that depend on a point, and their derivatives by it."""
    rows: list[tuple[int, int]] = []
    slopes: list[np.ndarray] = []
    for i, (group, jacobian, may) in enumerate(zip(groups, jacobians, removable, strict=True)):
        at = np.searchsorted(group.columns, columns)
        if not may.any() or at.max() >= len(group.columns) or np.any(group.columns[at] != columns):
            continue
        for k in np.flatnonzero(may & np.any(jacobian[:, at] != 0.0, axis=1)):
            rows.append((i, int(k)))
            slopes.append(jacobian[k, at])
    return rows, np.array(slopes)


def smallest_conflict(residual: np.ndarray, slopes: np.ndarray) -> tuple[int, ...] | None:
    """The fewest observations at one point whose absence lets the rest agree, or None where two are not enough.

    residual   (k,) over sigma
    slopes     (k, 3) derivatives by the point's coordinates, over sigma

    The rest agrees when its sum of squares stays below the chi-square quantile at 99.9 %. Of several sets of one size
    the one with the best rest is taken; with a single redundant observation that choice is a guess, and the caller's
    test statistics (all equal) say so.

    >>> slopes = np.vstack([np.eye(3), np.ones((1, 3)), [[1.0, -1.0, 0.0]], [[0.0, 1.0, -1.0]]])
    >>> smallest_conflict(slopes @ np.array([5.0, -3.0, 2.0]) + np.array([0, 0, 30.0, 0, 0, 0]), slopes)
    (2,)
    """
    k = len(residual)
    for size in range(min(MOST_AT_ONE_POINT, k - 4) + 1):
        best, found = np.inf, None
        for out in combinations(range(k), size):
            keep = np.setdiff1d(np.arange(k), out)
            step, _, rank, _ = np.linalg.lstsq(slopes[keep], residual[keep], rcond=None)
            rest = float(np.sum((residual[keep] - slopes[keep] @ step) ** 2))
            if rank == 3 and rest < min(best, chi2.ppf(0.999, len(keep) - 3)):
                best, found = rest, out
        if found is not None:
            return found
    return None
