"""Outlier search: a robust start, the smallest conflict of each point, then removal by test."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from catseye.estimation.least_squares.adjustment import (
    NONCENTRALITY,
    GroupFit,
    LeastSquaresSolution,
    SolverSettings,
    adjust,
)
from catseye.estimation.least_squares.bordered import Border
from catseye.estimation.least_squares.conflict import (
    LARGEST_SEARCH,
    MOST_AT_ONE_POINT,
    PointObservations,
    SharedErrors,
    at_point,
    contradicted,
    search,
    total_residuals,
    touched,
)
from catseye.estimation.least_squares.influence import Influence
from catseye.estimation.least_squares.patterns import Patterns, PatternTests
from catseye.estimation.least_squares.status import AdjustmentOutcome, Status
from catseye.estimation.observations.kinds import ObservationGroup

UNDECIDED = "after {rounds} rounds: some observations contradict each other and none stands out"
DECISIVE = 9.0  # difference of sums of squares between two explanations, below which neither is believed
GRAVE = 6.0  # |w| of a rejected observation from which it matters whether the right one was rejected
UNCHECKED = 0.05  # share of sigma^2 / variance of the estimated error below which nothing else speaks for or against
CHECKED = NONCENTRALITY / UNCHECKED**0.5  # detectable error over sigma up to which an observation is checked
BACK = 0.9  # of `critical`: what is out comes back below it; between the two it stays as it is, or rounds would not end
MOST_AT_ONCE = 200  # observations left out between two adjustments
SUSPECT, WRONG = 3.0, 10.0  # sigmas of a residual after the robust start: a suspect, and left out at first
ITERATIONS, CROSSING = 8, 2  # fits of the robust start; and residuals that may still cross at the last
MOST_RETURNS = 2  # of one observation; so the rounds end


@dataclass(frozen=True, eq=False)
class OutlierSearch:
    """Settings of the search of `adjust_robustly`.

    points     columns of each point, (3,) an array: where a few observations meet, the smallest conflict is sought
    advice     what is known of single points besides; it helps to tell which observation is wrong, and takes no part
               in the answer
    critical   |w| above which an observation is left out, and below nine tenths of which it comes back; 3.5 leaves out
               one good observation in 2000
    rounds     cap of removal rounds; if they do not end, the status says so
    shared     what the observations of the first groups share, where that is parameters
    rivals     explanations of a misfit other than wrong observations: function of groups and solution, see `Patterns`;
               where one is better than leaving out the worst observation, its rows are left out instead, and where it
               has none the search ends
    doubtful   names of groups that may be wrong though not left out: the robust start weighs them by their residuals
    settled    columns of parameters that are known well beside a point's: what depends on them and the point alone is
               known of the point
    """

    points: Sequence[np.ndarray] = ()
    advice: Sequence[ObservationGroup] = ()
    critical: float = 3.5
    rounds: int = 100
    shared: Sequence[SharedErrors | None] = ()
    settled: Sequence[int] = ()
    rivals: Callable[[Sequence[ObservationGroup], LeastSquaresSolution], Patterns] | None = None
    doubtful: Collection[str] = ()


TESTS_ALONE = OutlierSearch()


def adjust_robustly(
    x0: np.ndarray,
    groups: Sequence[ObservationGroup],
    removable: Sequence[np.ndarray],
    *,
    outliers: OutlierSearch = TESTS_ALONE,
    free: np.ndarray | None = None,
    active: Sequence[np.ndarray] | None = None,
    names: Sequence[str] | None = None,
    border: Border | None = None,
) -> LeastSquaresSolution:
    """An adjustment without the observations that do not belong to it; the fits say which (`active`).

    x0          (n,) start values
    groups      observations, as for `adjust`
    removable   one (m,) bool array a group: True for observations that may be wrong and may be left out
    outliers    how wrong ones are searched for
    free        (n,) bool, as for `adjust`
    active      one (m,) bool array a group: start from this selection instead of searching for one
    names       (n,) what the parameters are called
    border      of a large system, see `bordered`; its tests are then good to a thousandth

    Three steps. A reweighted fit (Cauchy weights of the residual) keeps an observation that is wrong by a thousand
    sigmas from dragging others along. Where few observations meet in a point such a fit can share the blame between
    innocent ones; so every point in conflict is searched for the smallest set whose absence makes the rest agree.
    At last Baarda's test with correlations, over everything: out with the worst, one by one, and back in with those
    that pass. What all other tests are without the worst follows from one adjustment (`Influence`); a new one is made
    when none is left to go.

    Source: [BAARDA68] (data snooping); [FOERSTNER16] chapter 4 (robust estimation and outlier detection); [HUBER09]
    (reweighting). The search for the smallest conflict is ours.
    """
    careful = None  # what to try instead, should a selection leave too little to hold every parameter
    if active is None:
        careful = [np.ones(len(g.observed), dtype=bool) for g in groups]
        yielding = [
            np.full(len(may), g.name in outliers.doubtful) | may for g, may in zip(groups, removable, strict=True)
        ]
        solution = _reweighted(x0, groups, yielding, free, names, border)
        whole = total_residuals(solution.fits, solution.x, outliers.shared)
        large = [may & (np.abs(v) > SUSPECT * sigma) for (v, sigma), may in zip(whole, removable, strict=True)]
        active = [~may | (np.abs(v) < WRONG * sigma) for (v, sigma), may in zip(whole, removable, strict=True)]
    else:
        solution = adjust(x0, groups, free=np.zeros(len(x0), dtype=bool), solver=SolverSettings(tests=False))
        large = [may & ~a & bool(outliers.advice) for may, a in zip(removable, active, strict=True)]
    active = _searched(solution, groups, removable, outliers, large, active)
    x, solver = solution.x, SolverSettings(border=border, rough=True)
    returns = [np.zeros(len(g.observed), dtype=int) for g in groups]
    for _ in range(outliers.rounds):
        solution = adjust(x, groups, free=free, active=active, names=names, solver=solver)
        if not solution.solved:
            if careful is None:
                return solution
            active, careful = careful, None
            continue
        x, careful = solution.x, None
        left, beaten = _without_worst(solution, groups, removable, outliers)
        if left is not None:
            active = left
            continue
        if beaten:
            return solution
        tests = [
            np.where(may & _checked(f), np.abs(f.standardised), 0.0)
            for f, may in zip(solution.fits, removable, strict=True)
        ]
        back = [
            may & ~a & (t < BACK * outliers.critical) & (n < MOST_RETURNS)
            for may, t, a, n in zip(removable, tests, active, returns, strict=True)
        ]
        if not any(b.any() for b in back):
            return _without_undecided(solution, groups, removable, outliers, free, names, solver)
        active = [a | b for a, b in zip(active, back, strict=True)]
        returns = [n + b for n, b in zip(returns, back, strict=True)]
    return replace(
        solution, status=Status(AdjustmentOutcome.REJECTION_UNDECIDED, UNDECIDED.format(rounds=outliers.rounds))
    )


def _without_worst(
    solution: LeastSquaresSolution,
    groups: Sequence[ObservationGroup],
    removable: Sequence[np.ndarray],
    outliers: OutlierSearch,
) -> tuple[list[np.ndarray] | None, bool]:
    """The selection without the worst, the worst of the rest, and so on; None where nothing is worse than the limit.

    One at a time: neighbours at a point with few checks look wrong together. Second True where a rival explanation
    stopped the search.
    """
    may = np.concatenate([may & f.active & _checked(f) for f, may in zip(solution.fits, removable, strict=True)])
    if not np.any(may & (np.concatenate([np.abs(f.standardised) for f in solution.fits]) > outliers.critical)):
        return None, False
    may = np.concatenate([m & f.active for f, m in zip(solution.fits, removable, strict=True)])
    tests = Influence(groups, solution)
    rivals = None if outliers.rivals is None else PatternTests(tests, outliers.rivals(groups, solution))
    while True:
        w = np.where(may & tests.active & (tests.detectable < CHECKED * tests.sigma), np.abs(tests.standardised), 0.0)
        worst = int(np.argmax(w))
        out, beaten = [worst], False
        if w[worst] > outliers.critical and rivals is not None:
            rival, score = rivals.best
            if score > w[worst] ** 2:
                out = rivals.patterns.rows[rival].tolist()
                beaten = not out
        if beaten or w[worst] <= outliers.critical or tests.left_out >= MOST_AT_ONCE:
            left = [a.copy() for a in np.split(tests.active, tests.first[1:-1])] if tests.left_out else None
            return left, beaten
        for row in out:
            step = tests.leave_out(row, np.argsort(-w)[: np.count_nonzero(w > outliers.critical)])
            if rivals is not None:
                rivals.add(*step)


def _checked(fit: GroupFit) -> np.ndarray:
    """Observations that the others check, so that an error of some sigmas shows; all inactive ones.

    Without correlations this is redundancy > UNCHECKED. With them a redundancy number may be zero or negative although
    a neighbour that shares its errors checks the observation well.
    """
    return ~fit.active | (fit.detectable_error < CHECKED * fit.sigma)


def _without_undecided(
    solution: LeastSquaresSolution,
    groups: Sequence[ObservationGroup],
    removable: Sequence[np.ndarray],
    outliers: OutlierSearch,
    free: np.ndarray | None,
    names: Sequence[str] | None,
    solver: SolverSettings,
) -> LeastSquaresSolution:
    """The solution without observations that might be the wrong ones just as well as those rejected.

    Of two that contradict each other alone at a point, the test cannot say which is wrong: both go. Nothing comes back
    here, because what comes back is not tested again. If the rest does not hold every parameter, the status says so.
    """
    active = [f.active.copy() for f in solution.fits]
    checked = [_checked(f) for f in solution.fits]
    rejected = [may & ~f.active for f, may in zip(solution.fits, removable, strict=True)]
    if not any(r.any() for r in rejected):
        return solution
    meeting = PointObservations.of(groups, solution, removable, outliers.advice, outliers.shared, outliers.settled)
    for columns in touched(outliers.points, meeting, chosen=rejected):
        local = at_point(columns, meeting, slack=1.0)
        out = [index for index, (i, k) in enumerate(local.rows) if not solution.fits[i].active[k]]
        grave = [
            index
            for index in out
            if abs(solution.fits[local.rows[index][0]].standardised[local.rows[index][1]]) > GRAVE
        ]
        if not grave or len(local.rows) > LARGEST_SEARCH:
            continue
        if len(grave) > MOST_AT_ONE_POINT:  # too many to search: trust what is checked
            for i, k in local.rows:
                active[i][k] &= checked[i][k]
            continue
        # The slight ones count here: which of them is out hardly matters, and without them nothing would be checked.
        costs = {choice: local.cost(choice) for choice in combinations(range(len(local.rows)), len(grave))}
        limit = min(costs.values()) + DECISIVE
        doubtful = {index for choice, cost in costs.items() if cost < limit for index in choice}
        for index, (i, k) in enumerate(local.rows):
            active[i][k] &= index not in doubtful
    if all(np.array_equal(a, f.active) for a, f in zip(active, solution.fits, strict=True)):
        return solution
    final = adjust(solution.x, groups, free=free, active=active, names=names, solver=solver)
    if not final.solved:
        return replace(final, status=Status(AdjustmentOutcome.NOT_HELD, final.status))
    return final


def _reweighted(
    x0: np.ndarray,
    groups: Sequence[ObservationGroup],
    removable: Sequence[np.ndarray],
    free: np.ndarray | None,
    names: Sequence[str] | None,
    border: Border | None,
) -> LeastSquaresSolution:
    """A fit in which every observation that may be wrong weighs by its own residual."""
    extra = [np.zeros(len(g.observed)) for g in groups]
    if border is not None:  # without details
        free = ~border.fine if free is None else free & ~border.fine
    rough = SolverSettings(iterations=1, tests=False, border=border)
    solution = adjust(x0, groups, free=free, names=names, solver=rough)
    before: list[np.ndarray] = []
    for _ in range(ITERATIONS):
        if not solution.solved or _steady(solution, before):
            break
        before = [f.residual for f in solution.fits]
        for i, (fit, may) in enumerate(zip(solution.fits, removable, strict=True)):
            extra[i] = np.where(may, (fit.residual / 2.0) ** 2, 0.0)
        solution = adjust(
            solution.x,
            groups,
            free=free,
            extra_variance=extra,
            names=names,
            solver=rough,
        )
    return solution


def _steady(solution: LeastSquaresSolution, before: Sequence[np.ndarray]) -> bool:
    """True where hardly a residual still crosses one of the limits by which observations are sorted."""
    if not before:
        return False
    old, new = np.concatenate(before), np.concatenate([f.residual for f in solution.fits])
    sigma = np.concatenate([f.sigma for f in solution.fits])
    crossed = [(np.abs(old) < k * sigma) != (np.abs(new) < k * sigma) for k in (SUSPECT, WRONG)]
    return int(np.sum(crossed)) <= CROSSING


def _searched(
    solution: LeastSquaresSolution,
    groups: Sequence[ObservationGroup],
    removable: Sequence[np.ndarray],
    outliers: OutlierSearch,
    suspects: Sequence[np.ndarray],
    active: Sequence[np.ndarray],
) -> list[np.ndarray]:
    """The selection, without the smallest conflict at each point that a suspect depends on, or that is elsewhere.

    Observations that check nothing among themselves agree on a wrong place; what is known of the place tells.
    """
    active = [a.copy() for a in active]
    if not solution.solved:
        return [np.ones(len(g.observed), dtype=bool) for g in groups]
    if not (outliers.points or any(s.any() for s in suspects)):
        return active
    meeting = PointObservations.of(groups, solution, removable, outliers.advice, outliers.shared, outliers.settled)
    for columns in touched(outliers.points, meeting, chosen=suspects):
        local, wrong = search(columns, meeting)
        if wrong is not None:
            for index, (i, k) in enumerate(local.rows):
                active[i][k] = index not in wrong
    for columns in contradicted(outliers.points, meeting):
        local, wrong = search(columns, meeting)
        if wrong and local.decisive(wrong, DECISIVE):
            for index in wrong:
                i, k = local.rows[index]
                active[i][k] = False
    return active
