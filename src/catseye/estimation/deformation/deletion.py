"""Backward search for moved points: deletion algebra, removal one by one, and readmission."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catseye.estimation.deformation.congruence import Differences, Epochs, VarianceFactor, differences

UNDECIDED = (
    "undecided: without {moved} the other points are still not congruent (p = {p:.2g}), and no more can be removed"
)
CIRCLES = "undecided: the search did not settle in {rounds} rounds, the last without {moved}"
TIE = "undecided: {one} or {other} moved, the observations cannot tell which"
UNCHECKED = 1e-9  # of the largest precision, in units of each coordinate's sigma: below it a point is unchecked
SINGLE = (
    1e-3  # of the level, for tests of single points: one large movement is diluted among hundreds in the global test
)
ROUNDS = 10
TIED = 1e-6  # of a statistic: two explanations closer than this are tied


@dataclass(frozen=True)
class Step:
    """One removal of the backward search: point, p, runner-up, its p, and p of the remainder."""

    name: str
    p: float
    rival: str
    rival_p: float
    rest_p: float


@dataclass(frozen=True, eq=False)
class PointTest:
    """Displacement (k,) of a point over its k compared coordinates, its covariance and test."""

    displacement: np.ndarray
    covariance: np.ndarray
    statistic: float
    p: float


@dataclass(frozen=True, eq=False)
class DeletionState:
    """Tests of all points (None: unchecked), and pvv, degrees and p of the remainder."""

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
    """Deletion algebra: with P of all points, removals need no new decomposition.

    The best estimate of displacements D of points M, all others unmoved, is P_MM^-1 (P d)_M with covariance P_MM^-1;
    it lowers the pvv by D' P_MM D, and P of the remainder is P - P_.M P_MM^-1 P_M.
    """

    def __init__(self, between: Differences, variance_factor: VarianceFactor) -> None:
        fit = between.fit()
        self.between = between
        self.precision, self.weighted, self.pvv = fit.weight, fit.weighted_residual, fit.pvv
        self.absolute = len(fit.estimate) == 0  # fixed coordinates, or identical datums: no free motion
        self.degrees, self.variance_factor = fit.degrees_of_freedom, variance_factor
        spread = np.diag(between.q)[between.used]  # single-coordinate variance: P times it is about 1
        self.scale = np.sqrt(spread / max(float(np.max(spread * np.diag(fit.weight))), 1e-300))
        point = np.flatnonzero(between.used) // 3
        self.axes = np.flatnonzero(between.used) % 3
        self.rows = [np.flatnonzero(point == i) for i in range(len(between.names))]

    def _holds(self, precision: np.ndarray, rows: np.ndarray) -> bool:
        """True if the precision of these rows is sufficient in every direction: the others check them."""
        scale = self.scale[rows]
        return len(rows) == 0 or bool(np.linalg.eigvalsh(precision * scale[:, None] * scale)[0] > UNCHECKED)

    def spares(self, out: Sequence[int]) -> bool:
        """True if the datum stays determined without these points, with a test remaining.

        Without a free datum no test need remain.
        """
        rows = np.concatenate([self.rows[i] for i in out])
        remaining = self.degrees - len(rows)
        enough = remaining > 0 or (remaining == 0 and self.absolute)
        return enough and self._holds(self.precision[np.ix_(rows, rows)], rows)

    def without(self, out: Sequence[int]) -> DeletionState:
        """State with points `out` left out.

        Each of them is tested against the remainder.
        """
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
            precision = self.precision[np.ix_(point, point)] - self.precision[np.ix_(point, rows)] @ across[:, point]
            if len(point) and self._holds(precision, point):
                inverse = np.linalg.inv(precision)
                tests.append(self._test(inverse @ weighted[point], inverse))
            else:
                tests.append(None)
        pvv, degrees = self.pvv - float(self.weighted[rows] @ displacement), self.degrees - len(rows)
        return DeletionState(tests, pvv, degrees, float(self.variance_factor.p(pvv, degrees)) if degrees else 1.0)

    def unchecked(self, stable: np.ndarray) -> list[PointTest]:
        """Tests of all points in the datum of inner constraints on the stable points (n,) bool.

        On all points if the stable ones do not determine the datum.
        """
        between = self.between
        d, q = between.in_datum(stable if between.holds(stable) else np.ones(len(self.rows), dtype=bool))
        at = np.flatnonzero(between.used)
        return [self._singular_test(d[at[rows]], q[np.ix_(at[rows], at[rows])]) for rows in self.rows]

    def _singular_test(self, displacement: np.ndarray, covariance: np.ndarray) -> PointTest:
        """Test in the directions of non-zero variance, coordinates scaled to unit sigma."""
        sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        sigma = np.where(sigma > 0.0, sigma, 1.0)
        values, vectors = np.linalg.eigh(covariance / sigma[:, None] / sigma)
        significant = values > UNCHECKED
        statistic = float(np.sum((displacement / sigma @ vectors[:, significant]) ** 2 / values[significant]))
        p = float(self.variance_factor.p(statistic, int(significant.sum()))) if significant.any() else np.nan
        factor = self.variance_factor.value
        return PointTest(displacement, covariance * factor, statistic / factor, p)

    def _test(self, displacement: np.ndarray, covariance: np.ndarray) -> PointTest:
        statistic = float(displacement @ np.linalg.solve(covariance, displacement))
        p = float(self.variance_factor.p(statistic, len(displacement)))
        factor = self.variance_factor.value
        return PointTest(displacement, covariance * factor, statistic / factor, p)

    def detectable(self, noncentrality: float) -> tuple[np.ndarray, np.ndarray]:
        """Displacement of this noncentrality per point in its weakest direction, and that direction."""
        size, direction = np.full(len(self.rows), np.nan), np.full((len(self.rows), 3), np.nan)
        for i, point in enumerate(self.rows):
            precision = self.precision[np.ix_(point, point)]
            if len(point) == 0 or not self._holds(precision, point):
                continue
            values, vectors = np.linalg.eigh(precision)
            size[i] = np.sqrt(noncentrality * self.variance_factor.value / values[0])
            direction[i] = 0.0
            direction[i, self.axes[point]] = vectors[:, 0]
        return size, direction


def backward(
    search: DeletionSearch, names: Sequence[str], level: float, rule: str, start: Sequence[int] = ()
) -> tuple[list[int], list[Step], str | None]:
    """Points removed until the remainder passes (with `start`), the removals, and why it stopped early."""
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
        (p, cost, worst), (rival_p, rival_cost, rival) = order[0], order[min(1, len(order) - 1)]
        if rival != worst and rival_cost - cost < TIED * -cost and abs(rival_p - p) <= TIED * p:
            rival_test = search.without([*out, worst]).tests[rival]
            if rival_test is None or rival_test.p >= level:  # either explains the same
                return out, steps, TIE.format(one=names[min(worst, rival)], other=names[max(worst, rival)])
        out.append(worst)
        steps.append(Step(names[worst], p, names[rival], rival_p, np.nan))


def returned(search: DeletionSearch, out: list[int], level: float, rule: str) -> list[int]:
    """Readmit insignificant points, the least significant first, while the remainder passes."""
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
    """Moved points, the search aligned on the others, the removals, and why it stopped early."""

    search: DeletionSearch
    out: list[int]
    steps: list[Step]
    stopped: str | None

    @property
    def rank(self) -> tuple[bool, int]:
        """Sort key, lower is better: conclusive first, then fewer moved points."""
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
    """Moved points, with datums aligned exactly on the others.

    far       points excluded from the first alignment
    without   True: start the removal without these; else with all points
    Other arguments as `moved_points`.
    """
    n = len(epochs.names)
    aligned = sorted(far)
    search = DeletionSearch(differences(epochs, datum, ~np.isin(np.arange(n), aligned)), variance_factor)
    start = aligned if without and search.spares(aligned) else []
    for _ in range(ROUNDS):
        out, steps, stopped = backward(search, epochs.names, level, rule, start)
        out = out if stopped else sorted(returned(search, out, level, rule))
        if out == aligned or stopped:
            return MovedSet(search, out, steps, stopped)
        aligned = out
        search = DeletionSearch(differences(epochs, datum, ~np.isin(np.arange(n), out)), variance_factor)
    stopped = CIRCLES.format(rounds=ROUNDS, moved=", ".join(epochs.names[i] for i in out))
    return MovedSet(search, out, steps, stopped)
