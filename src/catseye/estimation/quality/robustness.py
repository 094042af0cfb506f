"""Robust estimation and data snooping with any least-squares engine.

The engine is one function: `solve(inflation)` adjusts with the sigma of each observation multiplied by its inflation
(one (m,) array a group, 1 or more; infinite leaves it out) and returns one `GroupFit` a group. In the fits, `sigma` is
the claimed one, not inflated; the tests belong to the inflated one. Of correlated observations, inflation k adds
(k^2 - 1) sigma^2 to the variance of that one alone. An observation left out is inactive, and its `standardised` is that
of its prediction by the others. Each call should start from the same approximate parameters, since intermediate
solutions may be far off. If the parameters are not determined, solve raises EstimationError (or returns nan).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import NONCENTRALITY, GroupFit
from catseye.estimation.least_squares.status import CONVERGED, AdjustmentOutcome, Status
from catseye.estimation.quality.reliability import UNCHECKED, single_level, w_critical

Solve = Callable[[Sequence[np.ndarray]], Sequence[GroupFit]]

NOT_CONVERGED = "weights still changed by {change:.2g} after {iterations} iterations"
UNDECIDED = (
    "observations (group:row) {rows} contradict others, and which are wrong cannot be decided; "
    "parameters that only they determine use their sigmas times {size:.3g}"
)
UNFINISHED = "after {rounds} rounds of data snooping; the worst |w| is {worst:.3g} (limit {limit:.3g})"

MAD_TO_SIGMA = 1.482602218505602  # of normal errors: 1 / 0.6744897501960817
MOST_INFLATION = 1e3  # for zero weights: a weight of 1e-6 no longer affects the result, and the row stays predicted
SETTLED = 1e-3  # relative change of the root of a weight, below which reweighting ends
DECISIVE = 9.0  # difference of [pvv] between two explanations, below which neither is accepted
LEAST_AGREEMENT = 2  # rows beyond those that determine a place: one more may agree by chance if several were rejected
MOST_RETURNS = 2  # readmissions of one observation, so that the rounds end


def huber(t: np.ndarray, k: float = 1.345) -> np.ndarray:
    """Huber's weights min(1, k / |t|).

    k = 1.345 gives 95 % efficiency for normal errors. Source: [HUBER09].
    """
    return np.minimum(1.0, k / np.maximum(np.abs(t), k))


def l1(t: np.ndarray, epsilon: float = 0.1) -> np.ndarray:
    """Weights epsilon / |t| of least absolute residuals, 1 below epsilon. Source: [HUBER09]."""
    return huber(t, epsilon)


def biweight(t: np.ndarray, c: float = 4.685) -> np.ndarray:
    """Tukey's biweight (1 - (t/c)^2)^2, zero beyond c. Source: [BEATON74].

    c = 4.685 gives 95 % efficiency for normal errors.
    """
    return np.square(np.maximum(1.0 - np.square(t / c), 0.0))


def igg3(t: np.ndarray, k0: float = 2.0, k1: float = 6.0) -> np.ndarray:
    """IGG III weights: 1 up to k0, falling to zero at k1. Source: [YANG02].

    The constants are our choice.
    """
    a = np.maximum(np.abs(t), k0)
    return k0 / a * np.square(np.maximum(k1 - a, 0.0) / (k1 - k0))


def geman_mcclure(t: np.ndarray, c: float = 3.0) -> np.ndarray:
    """Geman-McClure weights 1 / (1 + (t/c)^2)^2, never zero. Source: [GEMAN87].

    The constant is our choice.
    """
    return 1.0 / np.square(1.0 + np.square(t / c))


WEIGHTS: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "huber": huber,
    "l1": l1,
    "biweight": biweight,
    "igg3": igg3,
    "geman_mcclure": geman_mcclure,
}
REDESCENDING = ("biweight", "igg3", "geman_mcclure")
STARTS = ("annealed", "l1", "none")


@dataclass(frozen=True, eq=False)
class RobustEstimate:
    """Result of a robust estimation.

    Tuples hold one (m,) array per group.

    weights      1e-6 (for zero) to 1
    rejected     |statistic| beyond the limit
    undecided    rows at places where another choice of wrong observations fits about as well
    statistic    w of each observation against all the others at their weights, over the scale; nan where unchecked
    scale        1, or estimated from the median of the standardised residuals
    iterations   solutions computed
    status       "converged", or one line
    fits         of the last solution, with inflation 1 / sqrt(weight)
    """

    weights: tuple[np.ndarray, ...]
    rejected: tuple[np.ndarray, ...]
    undecided: tuple[np.ndarray, ...]
    statistic: tuple[np.ndarray, ...]
    scale: float
    iterations: int
    status: Status
    fits: tuple[GroupFit, ...]


class _Rows:
    """Observations of all groups in one sequence, with the solver and the removable mask."""

    def __init__(self, solve: Solve, sizes: Sequence[int], removable: Sequence[np.ndarray] | None) -> None:
        self._solve, self._cuts, self.solved = solve, np.cumsum(sizes)[:-1], 0
        self.inflation = np.ones(int(sum(sizes)))
        self.doubtful = np.zeros(len(self.inflation), dtype=bool)
        self.solve(self.inflation)
        u = self.of("detectable_error") / NONCENTRALITY
        self.sigma = self.of("sigma")
        may = np.ones(len(u), dtype=bool) if removable is None else np.concatenate(list(removable))
        with np.errstate(divide="ignore", invalid="ignore"):
            self.may = may & (self.sigma**2 > UNCHECKED * u**2)
            self.unit = np.where(self.may, self.sigma**2 / u, 1.0)  # of a residual: sigma sqrt(r) if independent

    def solve(self, inflation: np.ndarray) -> None:
        self.inflation, self.solved = inflation, self.solved + 1
        self.fits = tuple(self._solve(self.split(inflation)))

    def doubt(self, doubtful: np.ndarray) -> None:
        self.doubtful, self.may = doubtful, self.may & ~doubtful

    def of(self, name: str) -> np.ndarray:
        return np.concatenate([getattr(fit, name) for fit in self.fits])

    def split(self, values: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(np.split(values, self._cuts))

    def place(self, row: int) -> tuple[int, int]:
        group = int(np.searchsorted(self._cuts, row, side="right"))
        return group, int(row - (self._cuts[group - 1] if group else 0))

    def studentised(self) -> np.ndarray:
        """Studentised residuals of plain least squares, independent of leverage."""
        return np.where(self.may, self.of("residual") / self.unit, 0.0)

    def w(self) -> np.ndarray:
        """w of each observation with its own inflation removed.

        The estimated error does not depend on its own weight. With inflation k the variance of the estimated error is
        (k^2 - 1) sigma^2 too large, exactly.
        """
        active = np.isfinite(self.inflation)
        extra = np.where(active, np.square(np.where(active, self.inflation, 1.0)) - 1.0, 0.0) * self.sigma**2
        variance = np.square(self.of("detectable_error") / NONCENTRALITY) - extra
        with np.errstate(invalid="ignore", divide="ignore"):
            w = self.of("estimated_error") / np.sqrt(np.maximum(variance, self.sigma**2 * UNCHECKED))  # rounding
        return np.where(active, np.where(self.may, w, np.nan), self.of("standardised"))


@dataclass(frozen=True)
class RobustOptions:
    """Settings of `estimate_robustly`.

    method       a key of WEIGHTS; the convex huber and l1 need no start
    start        of a redescending method: "annealed" (Geman-McClure from the largest residual down), "l1", or "none"
    scale        "known" sigmas, or "mad": all sigmas off by one factor, from the median absolute residual
    limit        |w| beyond which an observation is rejected
    iterations   limit of each reweighting
    trials       of the search of places; each includes a quarter of them
    hold         number of local unknowns of a place
    seed         of the search
    """

    method: str = "biweight"
    start: str = "annealed"
    scale: str = "known"
    limit: float = 4.0
    iterations: int = 100
    trials: int = 100
    hold: int = 3
    seed: int = 0


BIWEIGHT = RobustOptions()


def estimate_robustly(
    solve: Solve,
    sizes: Sequence[int],
    *,
    removable: Sequence[np.ndarray] | None = None,
    places: Sequence[np.ndarray] | None = None,
    options: RobustOptions = BIWEIGHT,
) -> RobustEstimate:
    """M-estimate by iterated reweighting of studentised residuals, with a robust start.

    solve        the engine, see the top of this file
    sizes        number of observations of each group
    removable    one (m,) bool array per group: False for observations that are never down-weighted
    places       one (m,) int array a group: rows with the same number (not negative) share local unknowns, such as the
                 target of a range. If given, each place with several rejections is searched for a better choice: random
                 minimal sets of rows determine it, rows that agree are added. Reweighting alone often fails if a third
                 of a place's ranges are wrong
    options      method, start, scale and limits

    Weights are those of Schweppe's form: of the residual over its own standard uncertainty in plain least squares.
    Raises EstimationError for an unknown name, or if the engine has no solution.

    Source: [HUBER09] (iterated reweighting, leverage); [BLACK96] (annealing); [TORR00] (the cost of a choice).
    """
    method, start, scale, iterations = options.method, options.start, options.scale, options.iterations
    if method not in WEIGHTS or start not in STARTS or scale not in ("known", "mad"):
        raise EstimationError(
            f"unknown robust estimation: method {method!r}, start {start!r}, scale {scale!r}; expected one of "
            f"{', '.join(WEIGHTS)}; {', '.join(STARTS)}; known, mad"
        )
    rows = _Rows(solve, sizes, removable)
    rescale = scale == "mad"
    if method in REDESCENDING and start == "annealed":
        width = float(np.abs(rows.studentised()).max(initial=1.0) / _scale(rows, rescale))
        for halving in range(int(np.ceil(np.log2(max(width, 1.0)))), -1, -1):
            _reweight(rows, geman_mcclure, 2.0**halving, rescale, 3)
    elif method in REDESCENDING and start == "l1":
        _reweight(rows, l1, 1.0, rescale, iterations)
    s = _scale(rows, rescale)
    undecided = np.zeros(len(rows.inflation), dtype=bool)
    if places is not None:
        if method in REDESCENDING:
            _reweight(rows, geman_mcclure, s, False, iterations)
        undecided = _search(rows, np.concatenate(list(places)), s, options)
    rescale = rescale and method not in REDESCENDING  # a redescending method keeps the scale of its start
    change = _reweight(rows, WEIGHTS[method], 1.0 if rescale else s, rescale, iterations)
    s = _scale(rows, rescale) if rescale else s
    w = rows.w() / s
    status = CONVERGED
    if not change < SETTLED:
        status = Status(AdjustmentOutcome.NOT_CONVERGED, NOT_CONVERGED.format(change=change, iterations=iterations))
    return RobustEstimate(
        weights=rows.split(1.0 / rows.inflation**2),
        rejected=rows.split(np.abs(w) > options.limit),
        undecided=rows.split(undecided),
        statistic=rows.split(w),
        scale=s,
        iterations=rows.solved,
        status=status,
        fits=rows.fits,
    )


def _scale(rows: _Rows, rescale: bool) -> float:
    """1, or the robust scale (MAD) of the studentised residuals."""
    if not rescale or not rows.may.any():
        return 1.0
    scale = float(MAD_TO_SIGMA * np.median(np.abs(rows.studentised()[rows.may])))
    if not scale > 0.0:
        raise EstimationError(
            f"scale of the residuals is {scale:g}: more than half of the {np.count_nonzero(rows.may)} checked "
            "observations fit exactly or are not numbers; use scale 'known'"
        )
    return scale


def _reweight(
    rows: _Rows, weight: Callable[[np.ndarray], np.ndarray], scale: float, rescale: bool, iterations: int
) -> float:
    """Reweight until the roots of the weights settle.

    Returns the last change.

    With `rescale`, `scale` is multiplied by that of the residuals at each iteration.
    """
    change = np.inf
    for _ in range(iterations):
        factor = scale * _scale(rows, rescale)
        root = np.sqrt(weight(rows.studentised() / factor))
        inflation = np.where(rows.may, 1.0 / np.maximum(root, 1.0 / MOST_INFLATION), 1.0)
        change = float(np.abs(1.0 / inflation - 1.0 / rows.inflation).max(initial=0.0) * inflation.min(initial=np.inf))
        rows.solve(inflation)
        if change < SETTLED:
            break
    return change


def _search(rows: _Rows, places: np.ndarray, scale: float, options: RobustOptions) -> np.ndarray:
    """Search places with several rejections for the cheapest set of wrong observations.

    Returns a mask, True where undecided.

    A place is undecided if a rival is nearly as cheap, or if hardly more rows agree than determine the place.
    A choice costs the sum of min(t^2, limit^2) over its place. A quarter of the places is tried at a time, each with a
    minimal set of rows, so that a wrong choice does not affect parameters shared with the others.
    """
    rng, hold, limit = np.random.default_rng(options.seed), options.hold, options.limit
    count = int(places.max(initial=-1)) + 1
    at, inside = np.where(places < 0, count, places), places >= 0

    def costs() -> np.ndarray:
        t = rows.of("residual") / (rows.sigma * scale)
        return np.bincount(at, np.minimum(t * t, limit**2), count + 1)

    def cost_of(choice: np.ndarray) -> np.ndarray:
        rows.solve(np.where(choice, 1.0, MOST_INFLATION))
        return costs()

    def agrees() -> np.ndarray:
        return ~(np.abs(rows.w()) > limit * scale)

    def touched(flags: np.ndarray) -> np.ndarray:
        return np.bincount(at, flags, count + 1) > 0

    def gross_errors() -> np.ndarray:
        return np.abs(rows.of("residual")) > 1.5 * limit * scale * rows.sigma

    best = agrees()
    cost, wrong, rival = cost_of(best), gross_errors(), np.full(count + 1, np.inf)
    for _ in range(options.trials):
        tried = (np.bincount(at, ~best & inside, count + 1) > 1) & (rng.random(count + 1) < 0.25)
        if not tried.any():
            continue
        order = np.lexsort((np.where(rows.may, rng.random(len(at)), -1.0), at))
        rank = np.empty(len(at), dtype=int)
        rank[order] = np.arange(len(at)) - np.searchsorted(at[order], at[order])
        holding = np.where(tried[at] & rows.may, rank < hold, best)
        cost_of(holding)
        choice = np.where(tried[at], agrees() | holding, best)
        new = cost_of(choice)
        better = tried & (new < cost - 1.0)
        # the loser is a rival if it keeps rows with gross errors under the winner; small errors do not count
        differs = tried & touched(np.where(better[at], best & ~choice & gross_errors(), choice & ~best & wrong))
        rival = np.where(differs, np.fmin(rival, np.where(better, cost, new)), rival)
        if better.any():
            best = np.where(better[at], choice, best)
            cost, wrong = cost_of(best), gross_errors()
    cost_of(best)
    rejected_rows = np.bincount(at, ~best, count + 1)
    chance = (rejected_rows > 1) & (np.bincount(at, best, count + 1) - hold < LEAST_AGREEMENT)
    return inside & (chance | (rival - cost < DECISIVE))[at]


@dataclass(frozen=True)
class Rejection:
    """Observation left out by data snooping.

    group, row        indices
    statistic         w of its prediction by the others
    estimated_error   observed minus predicted by the others
    margin            smaller decrease of [pvv] if its best rival is left out instead; nan without a rival
    rival             group and row of the observation that explains the contradiction best in its place, or None
    """

    group: int
    row: int
    statistic: float
    estimated_error: float
    margin: float
    rival: tuple[int, int] | None


@dataclass(frozen=True, eq=False)
class SnoopingResult:
    """Result of data snooping; tuples hold one (m,) array per group.

    rejected     left out in the last solution
    undecided    both of two that explain a contradiction equally well, and the `doubtful` input: their weight is so
                 small that they only determine otherwise undetermined parameters
    rejections   one per rejected observation, largest |w| first
    critical     |w| beyond which an observation is rejected
    solutions    number computed
    status       "converged", or one line
    fits         of the last solution
    """

    rejected: tuple[np.ndarray, ...]
    undecided: tuple[np.ndarray, ...]
    rejections: tuple[Rejection, ...]
    critical: float
    solutions: int
    status: Status
    fits: tuple[GroupFit, ...]


@dataclass(frozen=True)
class SnoopingOptions:
    """Settings of `snoop`.

    level        family-wise probability of rejecting a good observation
    correction   for multiple testing, as `reliability.single_level`
    rounds       limit of solutions before the comparison of rivals
    """

    level: float = 0.05
    correction: str = "sidak"
    rounds: int = 1000


SIDAK = SnoopingOptions()


def snoop(
    solve: Solve,
    sizes: Sequence[int],
    *,
    options: SnoopingOptions = SIDAK,
    removable: Sequence[np.ndarray] | None = None,
    start: Sequence[np.ndarray] | None = None,
    doubtful: Sequence[np.ndarray] | None = None,
    weigh: bool = True,
) -> SnoopingResult:
    """Data snooping: reject the worst one by one, readmit those that pass, compare rivals at the end.

    solve       the engine, see the top of this file; sigmas are known
    sizes       number of observations of each group
    options     level of the tests and limit of rounds
    removable   one (m,) bool array per group: False for observations that are never left out
    start       one (m,) bool array per group, left out initially, such as `RobustEstimate.rejected`
    doubtful    one (m,) bool array per group, such as `RobustEstimate.undecided`: neither trusted nor tested
    weigh       True: compare each rejection with its rivals, one more solution each

    Raises EstimationError if the engine has no solution with `start` left out.

    Source: [BAARDA68] (data snooping), [SIDAK67]; the margin is the difference of the tests' squares, our rule.
    """
    rows = _Rows(solve, sizes, removable)
    if doubtful is not None:
        rows.doubt(np.concatenate(list(doubtful)))
    critical = w_critical(single_level(options.level, max(int(np.count_nonzero(rows.may)), 1), options.correction))
    out = np.zeros(len(rows.may), dtype=bool) if start is None else np.concatenate(list(start)) & rows.may
    returns = np.zeros(len(out), dtype=int)
    worst, finished = np.inf, False
    for _ in range(options.rounds):
        w = _tests(rows, out)
        active_w = np.where(out, -1.0, w)
        worst = float(active_w.max(initial=0.0))
        readmissible = np.where(out & (returns < MOST_RETURNS), w, np.inf)
        if worst > critical:
            out[np.argmax(active_w)] = True
        elif readmissible.min(initial=np.inf) < critical:
            returns[np.argmin(readmissible)] += 1
            out[np.argmin(readmissible)] = False
        else:
            finished = True
            break
    status = CONVERGED
    if not finished:
        detail = UNFINISHED.format(rounds=options.rounds, worst=worst, limit=critical)
        status = Status(AdjustmentOutcome.UNFINISHED, detail)
    rejections, undecided = _rejections(rows, out, critical, weigh)
    undecided |= rows.doubtful
    status = _loosen(rows, out, undecided, status)
    return SnoopingResult(
        rejected=rows.split(out & ~undecided),
        undecided=rows.split(undecided),
        rejections=rejections,
        critical=critical,
        solutions=rows.solved,
        status=status,
        fits=rows.fits,
    )


def _tests(rows: _Rows, out: np.ndarray) -> np.ndarray:
    """|w| of each row with some left out.

    0 for fixed or unchecked rows.
    """
    rows.solve(np.where(out, np.inf, np.where(rows.doubtful, MOST_INFLATION, 1.0)))
    u = rows.of("detectable_error") / NONCENTRALITY
    with np.errstate(invalid="ignore"):
        testable = rows.may & (rows.sigma**2 > UNCHECKED * u**2)
    w = np.abs(rows.of("standardised"))
    if not np.isfinite(w[testable]).all() or not np.isfinite(rows.of("residual")).all():
        raise EstimationError(
            f"no solution with {np.count_nonzero(out)} observations left out: a parameter is no longer determined; "
            "leave out fewer at the start"
        )
    return np.where(testable | out, w, 0.0)


def _rejections(rows: _Rows, out: np.ndarray, critical: float, weigh: bool) -> tuple[tuple[Rejection, ...], np.ndarray]:
    """Rejections, and mask of rows that explain a contradiction as well as the rejected one.

    [pvv] falls by the same whichever of two goes first: w_i^2 + w_(j without i)^2 = w_j^2 + w_(i without j)^2. So with
    i readmitted, j is a rival if it reduces [pvv] nearly as much, and i would then pass.
    """
    without = np.square(np.where(out, 0.0, _tests(rows, out)))
    w, errors = rows.of("standardised"), rows.of("estimated_error")
    undecided = np.zeros(len(out), dtype=bool)
    rejections = []
    for row in sorted(np.flatnonzero(out), key=lambda i: -abs(w[i])):
        margin, rival = np.nan, None
        if weigh:
            trial = out.copy()
            trial[row] = False
            squares = np.where(trial, 0.0, np.square(_tests(rows, trial)))
            margins = squares[row] - squares
            margins[row] = np.inf
            explains = margins + without < max(critical, DECISIVE**0.5) ** 2
            nearest = int(np.argmin(np.where(explains, margins, np.inf)))
            if explains.any():
                margin, rival = float(margins[nearest]), rows.place(nearest)
            alike = explains & (margins < DECISIVE)
            alike[row] = alike.any()
            undecided |= alike
        g, k = rows.place(int(row))
        rejections.append(
            Rejection(
                group=g,
                row=k,
                statistic=float(w[row]),
                estimated_error=float(errors[row]),
                margin=margin,
                rival=rival,
            )
        )
    return tuple(rejections), undecided


def _loosen(rows: _Rows, out: np.ndarray, undecided: np.ndarray, status: Status) -> Status:
    """Last solution: rejected rows out, undecided rows with large sigmas.

    Returns the status.
    """
    _tests(rows, out)
    error = np.abs(rows.of("estimated_error") / rows.sigma)
    size = float(error[(undecided & out) | rows.doubtful].max(initial=MOST_INFLATION))
    rows.solve(np.where(undecided, size, np.where(out, np.inf, 1.0)))
    holding = undecided & (rows.of("redundancy") < 0.99)
    if not holding.any():
        return status
    named = [f"{g}:{k}" for g, k in map(rows.place, np.flatnonzero(holding)[:6])]
    ellipsis = " ..." if np.count_nonzero(holding) > 6 else ""
    return Status(AdjustmentOutcome.UNDECIDED, UNDECIDED.format(rows=", ".join(named) + ellipsis, size=size))
