"""Search for the points that moved: deletion algebra, removal one by one, and the return of the innocent."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catseye.estimation.deformation.congruence import Differences, Epochs, VarianceFactor, differences

UNDECIDED = "undecided: without {moved} the rest is still not congruent (p = {p:.2g}), and no more points can be spared"
CIRCLES = "undecided: the search went in circles for {rounds} rounds, the last without {moved}"
TIE = "undecided: {one} or {other} moved, the observations cannot tell which"
UNCHECKED = 1e-9  # of the largest precision, each in its coordinate's sigmas: with less nothing else checks it
SINGLE = 1e-3  # of the level, spent on single points beside the global test: one far move drowns among hundreds
SEARCHES = 10
TIED = 1e-6  # of a statistic: nearer than this two explanations are the same one


@dataclass(frozen=True)
class Step:
    """One removal of the backward search: who went, with what p; who would have gone else; p of the rest then."""

    name: str
    p: float
    rival: str
    rival_p: float
    rest_p: float


@dataclass(frozen=True, eq=False)
class PointTest:
    """One point's displacement (k,) over its k compared coordinates, its covariance, and its test."""

    displacement: np.ndarray
    covariance: np.ndarray
    statistic: float
    p: float


@dataclass(frozen=True, eq=False)
class DeletionState:
    """Tests of all points (None: not checked by the others), pvv, degrees and p of the rest, with some left out."""

    tests: list[PointTest | None]
    pvv: float
    degrees: int
    rest_p: float

    def passed(self, out: Sequence[int], level: float, rule: str) -> bool:
        p = [t.p for i, t in enumerate(self.tests) if t is not None and i not in out]
        single = min(p, default=1.0) * max(len(p), 1)
        if rule == "global":
            return self.rest_p >= level and single >= SINGLE * level
        return single >= level


class DeletionSearch:
    """Deletion algebra: with P of all points at hand, leaving points out needs no new decomposition.

    The best estimate of displacements D of points M, all others unmoved, is P_MM^-1 (P d)_M with covariance P_MM^-1;
    it lowers the pvv by D' P_MM D, and P of the rest is P - P_.M P_MM^-1 P_M.
    """

    def __init__(self, between: Differences, variance_factor: VarianceFactor) -> None:
        fit = between.fit()
        self.between = between
        self.precision, self.weighted, self.pvv = fit.weight, fit.weighted_residual, fit.pvv
        self.absolute = len(fit.estimate) == 0  # held coordinates, or both datums alike: nothing floats
        self.degrees, self.variance_factor = fit.degrees_of_freedom, variance_factor
        spread = np.diag(between.q)[between.used]  # of a coordinate by itself: P times it is 1 or about it
        self.scale = np.sqrt(spread / max(float(np.max(spread * np.diag(fit.weight))), 1e-300))
        point = np.flatnonzero(between.used) // 3
        self.axes = np.flatnonzero(between.used) % 3
        self.rows = [np.flatnonzero(point == i) for i in range(len(between.names))]

    def _holds(self, own: np.ndarray, rows: np.ndarray) -> bool:
        """True if enough is left of the precision of these rows in every direction: the others check them."""
        scale = self.scale[rows]
        return len(rows) == 0 or bool(np.linalg.eigvalsh(own * scale[:, None] * scale)[0] > UNCHECKED)

    def spares(self, out: Sequence[int]) -> bool:
        """True if the datum holds without these points, and a test remains; none need where nothing floats."""
        rows = np.concatenate([self.rows[i] for i in out])
        left = self.degrees - len(rows)
        enough = left > 0 or (left == 0 and self.absolute)
        return enough and self._holds(self.precision[np.ix_(rows, rows)], rows)

    def without(self, out: Sequence[int]) -> DeletionState:
        """The state with points `out` left out; each of those is itself tested against the rest."""
        rows = np.concatenate([np.zeros(0, dtype=int), *(self.rows[i] for i in out)])
        covariance = np.linalg.inv(self.precision[np.ix_(rows, rows)])
        displacement = covariance @ self.weighted[rows]
        across = covariance @ self.precision[rows]
        weighted = self.weighted - self.precision[:, rows] @ displacement
        tests: list[PointTest | None] = []
        for i, point in enumerate(self.rows):
            if i in out:
                at = np.flatnonzero(np.isin(rows, point))
                tests.append(self._test(displacement[at], covariance[np.ix_(at, at)]))
                continue
            own = self.precision[np.ix_(point, point)] - self.precision[np.ix_(point, rows)] @ across[:, point]
            if len(point) and self._holds(own, point):
                inverse = np.linalg.inv(own)
                tests.append(self._test(inverse @ weighted[point], inverse))
            else:
                tests.append(None)
        pvv, degrees = self.pvv - float(self.weighted[rows] @ displacement), self.degrees - len(rows)
        return DeletionState(tests, pvv, degrees, float(self.variance_factor.p(pvv, degrees)) if degrees else 1.0)

    def unchecked(self, stable: np.ndarray) -> list[PointTest]:
        """Each point in the datum of inner constraints on the stable points (n,) bool, where these hold it."""
        between = self.between
        d, q = between.seen_from(stable if between.holds(stable) else np.ones(len(self.rows), dtype=bool))
        at = np.flatnonzero(between.used)
        return [self._singular_test(d[at[rows]], q[np.ix_(at[rows], at[rows])]) for rows in self.rows]

    def _singular_test(self, displacement: np.ndarray, covariance: np.ndarray) -> PointTest:
        """The test in the directions that have a variance, each coordinate in its own sigma."""
        sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        sigma = np.where(sigma > 0.0, sigma, 1.0)
        values, vectors = np.linalg.eigh(covariance / sigma[:, None] / sigma)
        seen = values > UNCHECKED
        statistic = float(np.sum((displacement / sigma @ vectors[:, seen]) ** 2 / values[seen]))
        p = float(self.variance_factor.p(statistic, int(seen.sum()))) if seen.any() else np.nan
        factor = self.variance_factor.value
        return PointTest(displacement, covariance * factor, statistic / factor, p)

    def _test(self, displacement: np.ndarray, covariance: np.ndarray) -> PointTest:
        statistic = float(displacement @ np.linalg.solve(covariance, displacement))
        p = float(self.variance_factor.p(statistic, len(displacement)))
        factor = self.variance_factor.value
        return PointTest(displacement, covariance * factor, statistic / factor, p)

    def detectable(self, noncentrality: float) -> tuple[np.ndarray, np.ndarray]:
        """Per point the displacement of this noncentrality in the direction seen worst, and that direction."""
        size, direction = np.full(len(self.rows), np.nan), np.full((len(self.rows), 3), np.nan)
        for i, point in enumerate(self.rows):
            own = self.precision[np.ix_(point, point)]
            if len(point) == 0 or not self._holds(own, point):
                continue
            values, vectors = np.linalg.eigh(own)
            size[i] = np.sqrt(noncentrality * self.variance_factor.value / values[0])
            direction[i] = 0.0
            direction[i, self.axes[point]] = vectors[:, 0]
        return size, direction


def backward(
    search: DeletionSearch, names: Sequence[str], level: float, rule: str, start: Sequence[int] = ()
) -> tuple[list[int], list[Step], str | None]:
    """Points left out until the rest passes, `start` among them, the removals, and why it stopped short if it did."""
    out: list[int] = list(start)
    steps: list[Step] = []
    while True:
        state = search.without(out)
        if steps:
            steps[-1] = replace(steps[-1], rest_p=state.rest_p)
        if state.passed(out, level, rule):
            return out, steps, None
        tested = [(t.p, -t.statistic, i) for i, t in enumerate(state.tests) if t is not None and i not in out]
        order = [entry for entry in sorted(tested) if search.spares([*out, entry[2]])]
        if not order:
            moved = ", ".join(names[i] for i in out) or "any point"
            return out, steps, UNDECIDED.format(moved=moved, p=state.rest_p)
        (p, less, worst), (rival_p, rival_less, rival) = order[0], order[min(1, len(order) - 1)]
        if rival != worst and rival_less - less < TIED * -less and abs(rival_p - p) <= TIED * p:
            other = search.without([*out, worst]).tests[rival]
            if other is None or other.p >= level:  # either explains what the other does
                return out, steps, TIE.format(one=names[min(worst, rival)], other=names[max(worst, rival)])
        out.append(worst)
        steps.append(Step(names[worst], p, names[rival], rival_p, np.nan))


def returned(search: DeletionSearch, out: list[int], level: float, rule: str) -> list[int]:
    """Points left out in the shadow of others come back, the least significant first, while the rest still passes."""
    while len(out) > 1:
        tests = search.without(out).tests
        p, calmest = max((t.p, i) for i, t in enumerate(tests) if t is not None and i in out)
        fewer = [i for i in out if i != calmest]
        if p < level or not search.without(fewer).passed(fewer, level, rule):
            break
        out = fewer
    return out


@dataclass(frozen=True, eq=False)
class MovedSet:
    """Rows of points found to have moved, the search aligned on the others, the removals, and why it stopped short."""

    search: DeletionSearch
    out: list[int]
    steps: list[Step]
    stopped: str | None

    @property
    def rank(self) -> tuple[bool, int]:
        """Less is better: conclusive before stopped, few moved before many."""
        return self.stopped is not None, len(self.out)


def find_moved(
    epochs: Epochs,
    datum: str,
    variance_factor: VarianceFactor,
    *,
    level: float,
    rule: str,
    far: Sequence[int],
    without: bool = False,
) -> MovedSet:
    """The points that moved, datums aligned exactly on the others.

    far       points that the datums are not first aligned on
    without   the removal begins without these; else with all points
    others as `moved_points`
    """
    n = len(epochs.names)
    aligned = sorted(far)
    search = DeletionSearch(differences(epochs, datum, ~np.isin(np.arange(n), aligned)), variance_factor)
    start = aligned if without and search.spares(aligned) else []
    for _ in range(SEARCHES):
        out, steps, stopped = backward(search, epochs.names, level, rule, start)
        out = out if stopped else sorted(returned(search, out, level, rule))
        if out == aligned or stopped:
            return MovedSet(search, out, steps, stopped)
        aligned = out
        search = DeletionSearch(differences(epochs, datum, ~np.isin(np.arange(n), out)), variance_factor)
    stopped = CIRCLES.format(rounds=SEARCHES, moved=", ".join(epochs.names[i] for i in out))
    return MovedSet(search, out, steps, stopped)
