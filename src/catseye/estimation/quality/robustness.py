"""Robust estimation and data snooping over any engine that solves least squares.

The engine is one function: `solve(inflation)` adjusts with the sigma of each observation multiplied by its inflation
(one (m,) array a group, 1 or more; infinite leaves it out) and returns one `GroupFit` a group. In the fits, `sigma` is
the claimed one, not inflated; the tests belong to the inflated one. Of correlated observations, inflation k adds
(k^2 - 1) sigma^2 to the variance of that one alone. An observation left out is inactive, and its `standardised` is that
of its prediction by the others. Each call should start from the same approximate parameters: an answer on the way may
be far off. Where the parameters are not held, solve raises EstimationError (or returns nan).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import CONVERGED, NONCENTRALITY, GroupFit
from catseye.estimation.quality.reliability import UNCHECKED, single_level, w_critical

Solve = Callable[[Sequence[np.ndarray]], Sequence[GroupFit]]

NOT_CONVERGED = "not converged: weights still changed by {change:.2g} after {iterations} iterations"
UNDECIDED = (
    "undecided: observations (group:row) {rows} contradict others and nothing tells which is wrong; "
    "what only they hold is held with their sigmas times {size:.3g}"
)
NOT_ENDED = "not ended after {rounds} rounds of data snooping; the worst |w| is {worst:.3g} (limit {limit:.3g})"

MAD_TO_SIGMA = 1.482602218505602  # of normal errors: 1 / 0.6744897501960817
MOST_INFLATION = 1e3  # where a weight is zero on the way: 1e-6 no longer moves an answer, and the row stays predicted
SETTLED = 1e-3  # change of the root of a weight, beside the largest, below which reweighting ends
DECISIVE = 9.0  # difference of [pvv] between two explanations below which neither is believed
LEAST_AGREEMENT = 2  # rows beyond those that hold a place: one more may agree by chance where several were rejected
MOST_RETURNS = 2  # of one observation to the solution; so the rounds end


def huber(t: np.ndarray, k: float = 1.345) -> np.ndarray:
    """Huber's weights min(1, k / |t|); k = 1.345 keeps 95 % efficiency with normal errors. Source: [HUBER09]."""
    return np.minimum(1.0, k / np.maximum(np.abs(t), k))


def l1(t: np.ndarray, epsilon: float = 0.1) -> np.ndarray:
    """Weights epsilon / |t| of the least sum of absolute residuals, 1 below epsilon. Source: [HUBER09]."""
    return huber(t, epsilon)


def biweight(t: np.ndarray, c: float = 4.685) -> np.ndarray:
    """Tukey's biweight (1 - (t/c)^2)^2, zero from c on; c = 4.685 keeps 95 % efficiency. Source: [BEATON74]."""
    return np.square(np.maximum(1.0 - np.square(t / c), 0.0))


def igg3(t: np.ndarray, k0: float = 2.0, k1: float = 6.0) -> np.ndarray:
    """IGG III weights: 1 up to k0, falling to zero at k1; its constants are our choice. Source: [YANG02]."""
    a = np.maximum(np.abs(t), k0)
    return k0 / a * np.square(np.maximum(k1 - a, 0.0) / (k1 - k0))


def geman_mcclure(t: np.ndarray, c: float = 3.0) -> np.ndarray:
    """Geman and McClure's weights 1 / (1 + (t/c)^2)^2, never zero; the constant is our choice. Source: [GEMAN87]."""
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
    """The end of a robust estimation; tuples hold one (m,) array a group.

    weights      1e-6 (for none) to 1
    rejected     |statistic| beyond the limit
    undecided    rows at places where another choice of wrong observations explains the rest as well
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
    status: str
    fits: tuple[GroupFit, ...]


class _Rows:
    """The observations of all groups in one row: solves, counts, and knows which may be wrong."""

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
        """Residuals over their standard uncertainties in plain least squares: leverage does not hide an error."""
        return np.where(self.may, self.of("residual") / self.unit, 0.0)

    def w(self) -> np.ndarray:
        """w of each observation, its own inflation undone: the estimated error does not depend on its own weight.

        With inflation k the variance of the estimated error is (k^2 - 1) sigma^2 too large, exactly.
        """
        active = np.isfinite(self.inflation)
        extra = np.where(active, np.square(np.where(active, self.inflation, 1.0)) - 1.0, 0.0) * self.sigma**2
        variance = np.square(self.of("detectable_error") / NONCENTRALITY) - extra
        with np.errstate(invalid="ignore", divide="ignore"):
            w = self.of("estimated_error") / np.sqrt(np.maximum(variance, self.sigma**2 * UNCHECKED))  # rounding
        return np.where(active, np.where(self.may, w, np.nan), self.of("standardised"))


@dataclass(frozen=True)
class RobustOptions:
    """How `estimate_robustly` weighs and searches.

    method       a key of WEIGHTS; the convex huber and l1 need no start
    start        of a redescending method: "annealed" (Geman-McClure from the largest residual down), "l1", or "none"
    scale        "known" sigmas, or "mad": all sigmas off by one factor, from the median absolute residual
    limit        |w| beyond which an observation counts as rejected
    iterations   cap of each reweighting
    trials       of the search of places; a quarter of them takes part in each
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
    """M-estimate by iterated reweighting of studentised residuals, with a start that survives many wrong observations.

    solve        the engine, see the top of this file
    sizes        number of observations of each group
    removable    one (m,) bool array a group: False for observations that are never down-weighted
    places       one (m,) int array a group: rows with the same number (not negative) share local unknowns, such as the
                 target of a range. Given, each place with several rejections is searched for a better choice: a few
                 rows drawn at random hold it, those that agree with them join. Reweighting alone often chooses wrong
                 where a third of a place's ranges are wrong
    options      method, start, scale and caps

    Weights are those of Schweppe's form: of the residual over its own standard uncertainty in plain least squares.
    Raises EstimationError for an unknown name, or where the engine has no answer.

    Source: [HUBER09] (iterated reweighting, leverage); [BLACK96] (annealing); [TORR00] (the cost of a choice).
    """
    method, start, scale, iterations = options.method, options.start, options.scale, options.iterations
    if method not in WEIGHTS or start not in STARTS or scale not in ("known", "mad"):
        raise EstimationError(
            f"robust estimation {method!r} from {start!r} with {scale!r} scale is unknown; known: "
            f"{', '.join(WEIGHTS)}; {', '.join(STARTS)}; known, mad"
        )
    rows = _Rows(solve, sizes, removable)
    anew = scale == "mad"
    if method in REDESCENDING and start == "annealed":
        width = float(np.abs(rows.studentised()).max(initial=1.0) / _scale(rows, anew))
        for halving in range(int(np.ceil(np.log2(max(width, 1.0)))), -1, -1):
            _reweight(rows, geman_mcclure, 2.0**halving, anew, 3)
    elif method in REDESCENDING and start == "l1":
        _reweight(rows, l1, 1.0, anew, iterations)
    s = _scale(rows, anew)
    undecided = np.zeros(len(rows.inflation), dtype=bool)
    if places is not None:
        if method in REDESCENDING:
            _reweight(rows, geman_mcclure, s, False, iterations)
        undecided = _search(rows, np.concatenate(list(places)), s, options)
    anew = anew and method not in REDESCENDING  # a redescending method keeps the scale of its start
    change = _reweight(rows, WEIGHTS[method], 1.0 if anew else s, anew, iterations)
    s = _scale(rows, anew) if anew else s
    w = rows.w() / s
    status = CONVERGED if change < SETTLED else NOT_CONVERGED.format(change=change, iterations=iterations)
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


def _scale(rows: _Rows, anew: bool) -> float:
    """1, or the scale of the studentised residuals; a median is not moved by a minority of wrong ones."""
    if not anew or not rows.may.any():
        return 1.0
    scale = float(MAD_TO_SIGMA * np.median(np.abs(rows.studentised()[rows.may])))
    if not scale > 0.0:
        raise EstimationError(
            f"scale of the residuals is {scale:g}: more than half of the {np.count_nonzero(rows.may)} checked "
            "observations fit exactly or are no numbers; use scale 'known'"
        )
    return scale


def _reweight(
    rows: _Rows, weight: Callable[[np.ndarray], np.ndarray], scale: float, anew: bool, iterations: int
) -> float:
    """Reweights until the roots of the weights settle; `anew` multiplies `scale` by that of the residuals each time."""
    change = np.inf
    for _ in range(iterations):
        factor = scale * _scale(rows, anew)
        root = np.sqrt(weight(rows.studentised() / factor))
        inflation = np.where(rows.may, 1.0 / np.maximum(root, 1.0 / MOST_INFLATION), 1.0)
        change = float(np.abs(1.0 / inflation - 1.0 / rows.inflation).max(initial=0.0) * inflation.min(initial=np.inf))
        rows.solve(inflation)
        if change < SETTLED:
            break
    return change


def _search(rows: _Rows, places: np.ndarray, scale: float, options: RobustOptions) -> np.ndarray:
    """Searches places with several rejections for the cheapest choice of wrong observations; True where undecided.

    That is where a rival is nearly as cheap, or where hardly more rows agree than hold the place.
    A choice costs the sum of min(t^2, limit^2) over its place. A quarter of the places is tried at a time, each held by
    no more rows than it needs: a wrong choice then says nothing about what it shares with the others.
    """
    rng, hold, limit = np.random.default_rng(options.seed), options.hold, options.limit
    count = int(places.max(initial=-1)) + 1
    at, inside = np.where(places < 0, count, places), places >= 0

    def costs() -> np.ndarray:
        t = rows.of("residual") / (rows.sigma * scale)
        return np.bincount(at, np.minimum(t * t, limit**2), count + 1)

    def kept(choice: np.ndarray) -> np.ndarray:
        rows.solve(np.where(choice, 1.0, MOST_INFLATION))
        return costs()

    def agrees() -> np.ndarray:
        return ~(np.abs(rows.w()) > limit * scale)

    def touched(flags: np.ndarray) -> np.ndarray:
        return np.bincount(at, flags, count + 1) > 0

    def grave() -> np.ndarray:
        return np.abs(rows.of("residual")) > 1.5 * limit * scale * rows.sigma

    best = agrees()
    cost, wrong, rival = kept(best), grave(), np.full(count + 1, np.inf)
    for _ in range(options.trials):
        tried = (np.bincount(at, ~best & inside, count + 1) > 1) & (rng.random(count + 1) < 0.25)
        if not tried.any():
            continue
        order = np.lexsort((np.where(rows.may, rng.random(len(at)), -1.0), at))
        rank = np.empty(len(at), dtype=int)
        rank[order] = np.arange(len(at)) - np.searchsorted(at[order], at[order])
        holding = np.where(tried[at] & rows.may, rank < hold, best)
        kept(holding)
        choice = np.where(tried[at], agrees() | holding, best)
        new = kept(choice)
        better = tried & (new < cost - 1.0)
        # the loser is a rival if it trusts what the winner finds gravely wrong; slight errors hardly matter
        differs = tried & touched(np.where(better[at], best & ~choice & grave(), choice & ~best & wrong))
        rival = np.where(differs, np.fmin(rival, np.where(better, cost, new)), rival)
        if better.any():
            best = np.where(better[at], choice, best)
            cost, wrong = kept(best), grave()
    kept(best)
    lost = np.bincount(at, ~best, count + 1)
    chance = (lost > 1) & (np.bincount(at, best, count + 1) - hold < LEAST_AGREEMENT)
    return inside & (chance | (rival - cost < DECISIVE))[at]


@dataclass(frozen=True)
class Rejection:
    """One observation that data snooping left out.

    group, row        which
    statistic         w of its prediction by the others
    estimated_error   observed minus predicted by the others
    margin            by how much less [pvv] falls if its best rival goes in its place; nan without a rival
    rival             group and row of the one that explains its contradiction best in its place; None without one
    """

    group: int
    row: int
    statistic: float
    estimated_error: float
    margin: float
    rival: tuple[int, int] | None


@dataclass(frozen=True, eq=False)
class Snooped:
    """The end of data snooping; tuples hold one (m,) array a group.

    rejected     left out in the last solution
    undecided    of two that explain a contradiction alike, both, and those given as doubtful: they weigh so little
                 that they only hold what nothing else holds
    rejections   one each, largest |w| first
    critical     |w| beyond which an observation went
    solutions    computed
    status       "converged", or one line
    fits         of the last solution
    """

    rejected: tuple[np.ndarray, ...]
    undecided: tuple[np.ndarray, ...]
    rejections: tuple[Rejection, ...]
    critical: float
    solutions: int
    status: str
    fits: tuple[GroupFit, ...]


@dataclass(frozen=True)
class SnoopingOptions:
    """What `snoop` tests by.

    level        chance of leaving any good observation out, over all
    correction   for their number, as `reliability.single_level`
    rounds       cap of the solutions before weighing
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
) -> Snooped:
    """Data snooping: out with the worst, one by one; back in with those that pass; rivals weighed at the end.

    solve       the engine, see the top of this file; sigmas are known
    sizes       number of observations of each group
    options     level of the tests and cap of rounds
    removable   one (m,) bool array a group: False for observations that are never left out
    start       one (m,) bool array a group, left out at first, such as `RobustEstimate.rejected`
    doubtful    one (m,) bool array a group, such as `RobustEstimate.undecided`: neither trusted nor tested
    weigh       one more solution for each rejection: would another observation explain as much?

    Raises EstimationError where the engine has no answer with `start` left out.

    Source: [BAARDA68] (data snooping), [SIDAK67]; the margin is the difference of the tests' squares, our rule.
    """
    rows = _Rows(solve, sizes, removable)
    if doubtful is not None:
        rows.doubt(np.concatenate(list(doubtful)))
    critical = w_critical(single_level(options.level, max(int(np.count_nonzero(rows.may)), 1), options.correction))
    out = np.zeros(len(rows.may), dtype=bool) if start is None else np.concatenate(list(start)) & rows.may
    returns = np.zeros(len(out), dtype=int)
    worst, ended = np.inf, False
    for _ in range(options.rounds):
        w = _tests(rows, out)
        inside = np.where(out, -1.0, w)
        worst = float(inside.max(initial=0.0))
        back = np.where(out & (returns < MOST_RETURNS), w, np.inf)
        if worst > critical:
            out[np.argmax(inside)] = True
        elif back.min(initial=np.inf) < critical:
            returns[np.argmin(back)] += 1
            out[np.argmin(back)] = False
        else:
            ended = True
            break
    status = CONVERGED if ended else NOT_ENDED.format(rounds=options.rounds, worst=worst, limit=critical)
    rejections, undecided = _rejections(rows, out, critical, weigh)
    undecided |= rows.doubtful
    status = _loosen(rows, out, undecided, status)
    return Snooped(
        rows.split(out & ~undecided), rows.split(undecided), rejections, critical, rows.solved, status, rows.fits
    )


def _tests(rows: _Rows, out: np.ndarray) -> np.ndarray:
    """|w| of each row with some left out; 0 of those never left out or now unchecked."""
    rows.solve(np.where(out, np.inf, np.where(rows.doubtful, MOST_INFLATION, 1.0)))
    u = rows.of("detectable_error") / NONCENTRALITY
    with np.errstate(invalid="ignore"):
        seen = rows.may & (rows.sigma**2 > UNCHECKED * u**2)
    w = np.abs(rows.of("standardised"))
    if not np.isfinite(w[seen]).all() or not np.isfinite(rows.of("residual")).all():
        raise EstimationError(
            f"no answer with {np.count_nonzero(out)} observations left out: something is no longer held; "
            "leave out fewer at the start"
        )
    return np.where(seen | out, w, 0.0)


def _rejections(rows: _Rows, out: np.ndarray, critical: float, weigh: bool) -> tuple[tuple[Rejection, ...], np.ndarray]:
    """What was left out, and which rows explain a contradiction as well as the one left out does.

    [pvv] falls by the same whichever of two goes first: w_i^2 + w_(j without i)^2 = w_j^2 + w_(i without j)^2. So with
    i back in, j is a rival if it takes nearly as much away, and i would then pass.
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
        rejections.append(Rejection(*rows.place(int(row)), float(w[row]), float(errors[row]), margin, rival))
    return tuple(rejections), undecided


def _loosen(rows: _Rows, out: np.ndarray, undecided: np.ndarray, status: str) -> str:
    """The last solution: what was left out is out, the undecided hold loosely what nothing else holds."""
    _tests(rows, out)
    error = np.abs(rows.of("estimated_error") / rows.sigma)
    size = float(error[(undecided & out) | rows.doubtful].max(initial=MOST_INFLATION))
    rows.solve(np.where(undecided, size, np.where(out, np.inf, 1.0)))
    holding = undecided & (rows.of("redundancy") < 0.99)
    if not holding.any():
        return status
    named = [f"{g}:{k}" for g, k in map(rows.place, np.flatnonzero(holding)[:6])]
    rest = " ..." if np.count_nonzero(holding) > 6 else ""
    return UNDECIDED.format(rows=", ".join(named) + rest, size=size)
