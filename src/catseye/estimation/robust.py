"""Which observations are wrong: a robust start, the smallest conflict of each point, then removal by test."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.stats import chi2

from catseye.estimation.adjustment import CONVERGED, Solution, adjust
from catseye.estimation.observations import Observations

UNDECIDED = "rejection undecided after {rounds} rounds: some observations contradict each other and none stands out"
MOST_AT_ONE_POINT = 2  # wrong observations searched for at one point, exhaustively
LARGEST_SEARCH = 24  # observations at a point; a point with more has redundancy enough for the robust fit alone
DECISIVE = 9.0  # difference of sums of squares between two explanations, below which neither is believed
GRAVE = 6.0  # |w| of a rejected observation from which it matters whether the right one was rejected
UNCHECKED = 0.05  # redundancy below which nothing else speaks for or against an observation
MOST_RETURNS = 2  # of one observation; so the rounds end
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
    rounds: int = 100,
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
    returns = [np.zeros(len(g.observed), dtype=int) for g in groups]
    for _ in range(rounds):
        solution = adjust(x, groups, free=free, active=active, names=names)
        if solution.status != CONVERGED:
            return solution
        x = solution.x
        tests = [
            np.where(may & (f.redundancy > UNCHECKED), np.abs(f.standardised), 0.0)
            for f, may in zip(solution.fits, removable, strict=True)
        ]
        worst = max(float(t[a].max(initial=0.0)) for t, a in zip(tests, active, strict=True))
        if worst > critical:
            limit = max(critical, 0.8 * worst)
            active = [a & (t < limit) for t, a in zip(tests, active, strict=True)]
            continue
        back = [~a & (t < 0.9 * critical) & (n < MOST_RETURNS) for t, a, n in zip(tests, active, returns, strict=True)]
        if not any(b.any() for b in back):
            return _without_undecided(solution, groups, removable, points, free, names)
        active = [a | b for a, b in zip(active, back, strict=True)]
        returns = [n + b for n, b in zip(returns, back, strict=True)]
    return replace(solution, status=UNDECIDED.format(rounds=rounds))


def _without_undecided(
    solution: Solution,
    groups: Sequence[Observations],
    removable: Sequence[np.ndarray],
    points: Sequence[np.ndarray],
    free: np.ndarray | None,
    names: Sequence[str] | None,
) -> Solution:
    """The solution without observations that might be the wrong ones just as well as those rejected.

    Of two that contradict each other alone at a point, the test cannot say which is wrong: both go.
    """
    active = [f.active.copy() for f in solution.fits]
    jacobians = [g.predict(solution.x)[1] for g in groups]
    for columns in points:
        local = _at_point(columns, groups, jacobians, removable, solution, slack=1.0)
        out = tuple(index for index, (i, k) in enumerate(local.rows) if not active[i][k])
        grave = max((abs(solution.fits[i].standardised[k]) for i, k in (local.rows[q] for q in out)), default=0.0)
        if grave < GRAVE or len(out) > MOST_AT_ONE_POINT or len(local.rows) > LARGEST_SEARCH:
            continue
        costs = {other: local.cost(other) for other in combinations(range(len(local.rows)), len(out))}
        limit = min(costs.values()) + DECISIVE
        doubtful = {index for other, cost in costs.items() if cost < limit for index in other}
        for index, (i, k) in enumerate(local.rows):
            active[i][k] = index not in doubtful
    if all(np.array_equal(a, f.active) for a, f in zip(active, solution.fits, strict=True)):
        return solution
    return adjust(solution.x, groups, free=free, active=active, names=names)


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
    jacobians = [g.predict(solution.x)[1] for g in groups]
    for columns in points:
        local = _at_point(columns, groups, jacobians, removable, solution, SLACK)
        if not 2 <= len(local.rows) <= LARGEST_SEARCH or np.max(np.abs(local.residual)) * SLACK < 3.0:
            continue
        wrong = local.smallest_conflict()
        if wrong is not None:
            for index, (i, k) in enumerate(local.rows):
                active[i][k] = index not in wrong
    return solution, active


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
        keep = np.ones(len(self.rows), dtype=bool)
        keep[list(out)] = False
        v = np.concatenate([self.residual[keep], self.prior])
        a = np.concatenate([self.slopes[keep], self.prior_slopes])
        return float(np.sum((v - a @ np.linalg.lstsq(a, v, rcond=None)[0]) ** 2))

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
            if sets[best] < chi2.ppf(0.999, degrees):
                return best
        return None


def _at_point(
    columns: np.ndarray,
    groups: Sequence[Observations],
    jacobians: Sequence[np.ndarray],
    removable: Sequence[np.ndarray],
    solution: Solution,
    slack: float,
) -> LocalConflict:
    """What meets in a point: removable observations that depend on it, and others that depend on it alone."""
    rows: list[tuple[int, int]] = []
    parts: dict[bool, list[tuple[float, np.ndarray]]] = {True: [], False: []}
    for i, (group, jacobian, may, fit) in enumerate(zip(groups, jacobians, removable, solution.fits, strict=True)):
        at = np.searchsorted(group.columns, columns)
        if at.max() >= len(group.columns) or np.any(group.columns[at] != columns):
            continue
        touching = np.any(jacobian[:, at] != 0.0, axis=1)
        alone = touching & (np.count_nonzero(jacobian, axis=1) == np.count_nonzero(jacobian[:, at], axis=1))
        for k in np.flatnonzero(touching & (may | alone)):
            sigma = fit.sigma[k] * (slack if may[k] else 1.0)
            parts[bool(may[k])].append((fit.residual[k] / sigma, jacobian[k, at] / sigma))
            if may[k]:
                rows.append((i, int(k)))
    (residual, slopes), (prior, prior_slopes) = (
        (np.array([v for v, _ in parts[may]]), np.array([a for _, a in parts[may]]).reshape(-1, 3))
        for may in (True, False)
    )
    return LocalConflict(rows, residual, slopes, prior, prior_slopes)
