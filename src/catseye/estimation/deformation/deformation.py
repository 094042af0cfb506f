"""Which points moved between two epochs, and how small a movement would have been seen."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.deformation.congruence import (
    KNOWN,
    CongruenceTest,
    Differences,
    Epochs,
    VarianceFactor,
    differences,
    global_test,
)

CONGRUENT = "congruent: no point moved (p = {p:.2g}, level {level:g})"
MOVED = "moved: {moved}; the other {stable} points are congruent (p = {p:.2g}, level {level:g})"
MAJORITY = "moved: {moved}; but only {stable} points are congruent (p = {p:.2g}): it may be those that moved"
EVERY = "moved: {moved}, all that are compared (level {level:g})"
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
class Deformation:
    """What moved between two epochs; arrays over the n common points.

    names          n
    displacement   (n, 3) m, second less first, relative to the stable points other than itself, those taken as
                   unmoved: the best estimate from all of them with all correlations. 0 for held points; nan in
                   coordinates not compared. Of a point that these do not check: in the datum of inner constraints on
                   all stable points, itself among them, where the covariance may be singular
    covariance     (n, 3, 3) m^2 of each (variance factor included); nan likewise
    statistic      (n,) displacement' covariance^-1 displacement over compared coordinates
    p              (n,) chance of such a statistic or a larger one if the point did not move, the stable set given
    p_adjusted     (n,) times the number of points that could be suspected (Bonferroni), at most 1
    moved          (n,) bool
    held           (n,) bool: without variance in both epochs or carried over: displacement 0 by definition, no test
    stable         (n,) bool: not moved; they define the datum
    before, after  global tests of all points, and of the stable ones
    detectable     (n,) m, the smallest displacement, in the direction seen worst, that `before` finds with the power
    level, power   of the tests
    datum          what the two datums may differ by
    steps          the removals in order, also of points that came back in the end
    conclusive     bool: False where the search did not end with a congruent majority
    status         one line: congruent, who moved, or why it is undecided
    """

    names: tuple[str, ...]
    displacement: np.ndarray
    covariance: np.ndarray
    statistic: np.ndarray
    p: np.ndarray
    p_adjusted: np.ndarray
    moved: np.ndarray
    held: np.ndarray
    stable: np.ndarray
    before: CongruenceTest
    after: CongruenceTest
    detectable: np.ndarray
    level: float
    power: float
    datum: str
    steps: tuple[Step, ...]
    conclusive: bool
    status: str


@dataclass(frozen=True, eq=False)
class _PointTest:
    """One point's displacement (k,) over its k compared coordinates, its covariance, and its test."""

    displacement: np.ndarray
    covariance: np.ndarray
    statistic: float
    p: float


@dataclass(frozen=True, eq=False)
class _State:
    """Tests of all points (None: not checked by the others), pvv, degrees and p of the rest, with some left out."""

    tests: list[_PointTest | None]
    pvv: float
    degrees: int
    rest_p: float

    def passed(self, out: Sequence[int], level: float, rule: str) -> bool:
        p = [t.p for i, t in enumerate(self.tests) if t is not None and i not in out]
        single = min(p, default=1.0) * max(len(p), 1)
        if rule == "global":
            return self.rest_p >= level and single >= SINGLE * level
        return single >= level


class _Search:
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

    def without(self, out: Sequence[int]) -> _State:
        """The state with points `out` left out; each of those is itself tested against the rest."""
        rows = np.concatenate([np.zeros(0, dtype=int), *(self.rows[i] for i in out)])
        covariance = np.linalg.inv(self.precision[np.ix_(rows, rows)])
        displacement = covariance @ self.weighted[rows]
        across = covariance @ self.precision[rows]
        weighted = self.weighted - self.precision[:, rows] @ displacement
        tests: list[_PointTest | None] = []
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
        return _State(tests, pvv, degrees, float(self.variance_factor.p(pvv, degrees)) if degrees else 1.0)

    def unchecked(self, stable: np.ndarray) -> list[_PointTest]:
        """Each point in the datum of inner constraints on the stable points (n,) bool, where these hold it."""
        between = self.between
        d, q = between.seen_from(stable if between.holds(stable) else np.ones(len(self.rows), dtype=bool))
        at = np.flatnonzero(between.used)
        return [self._singular_test(d[at[rows]], q[np.ix_(at[rows], at[rows])]) for rows in self.rows]

    def _singular_test(self, displacement: np.ndarray, covariance: np.ndarray) -> _PointTest:
        """The test in the directions that have a variance, each coordinate in its own sigma."""
        sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        sigma = np.where(sigma > 0.0, sigma, 1.0)
        values, vectors = np.linalg.eigh(covariance / sigma[:, None] / sigma)
        seen = values > UNCHECKED
        statistic = float(np.sum((displacement / sigma @ vectors[:, seen]) ** 2 / values[seen]))
        p = float(self.variance_factor.p(statistic, int(seen.sum()))) if seen.any() else np.nan
        factor = self.variance_factor.value
        return _PointTest(displacement, covariance * factor, statistic / factor, p)

    def _test(self, displacement: np.ndarray, covariance: np.ndarray) -> _PointTest:
        statistic = float(displacement @ np.linalg.solve(covariance, displacement))
        p = float(self.variance_factor.p(statistic, len(displacement)))
        factor = self.variance_factor.value
        return _PointTest(displacement, covariance * factor, statistic / factor, p)

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


def detectable_displacement(
    epochs: Epochs,
    *,
    datum: str = "rigid",
    level: float = 0.05,
    power: float = 0.8,
    single: bool = False,
    variance_factor: VarianceFactor = KNOWN,
) -> tuple[np.ndarray, np.ndarray]:
    """Smallest displacement (n,) m of each point that a test finds, and its direction (n, 3), the one seen worst.

    epochs            see there; before measuring, the second epoch may repeat the first's coordinates
    datum             what the two datums may differ by, as `congruence_test`
    level             of the test
    power             chance of finding it
    single            False: the congruence test of all points; True: the test of that point alone, at level / points
    variance_factor   known or estimated

    A point that the others do not check has nan. All other points are taken as unmoved.

    Source: [BAARDA68] (noncentrality), for a test of several degrees of freedom; [CASPARY87].
    """
    search = _Search(differences(epochs, datum, np.ones(len(epochs.names), dtype=bool)), variance_factor)
    global_test(search.pvv, search.degrees, variance_factor)
    if not single:
        return search.detectable(variance_factor.noncentrality(search.degrees, level, power))
    ranks = np.array([len(rows) for rows in search.rows])
    unit, direction = search.detectable(1.0)
    each = level / max(int(np.isfinite(unit).sum()), 1)
    needed = {int(r): variance_factor.noncentrality(int(r), each, power) for r in set(ranks[np.isfinite(unit)])}
    return unit * np.sqrt([needed.get(int(r), np.nan) for r in ranks]), direction


def _backward(
    search: _Search, names: Sequence[str], level: float, rule: str
) -> tuple[list[int], list[Step], str | None]:
    """Points left out until the rest passes, the removals, and why it stopped short if it did."""
    out: list[int] = []
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


def _returned(search: _Search, out: list[int], level: float, rule: str) -> list[int]:
    """Points left out in the shadow of others come back, the least significant first, while the rest still passes."""
    while len(out) > 1:
        tests = search.without(out).tests
        p, calmest = max((t.p, i) for i, t in enumerate(tests) if t is not None and i in out)
        fewer = [i for i in out if i != calmest]
        if p < level or not search.without(fewer).passed(fewer, level, rule):
            break
        out = fewer
    return out


def moved_points(
    epochs: Epochs,
    *,
    datum: str = "rigid",
    level: float = 0.05,
    power: float = 0.8,
    rule: str = "global",
    variance_factor: VarianceFactor = KNOWN,
    far: Sequence[int] = (),
) -> Deformation:
    """Which common points moved, how far, and how sure that is.

    epochs            see there
    datum             what the two datums may differ by, as `congruence_test`
    level             chance that any point at all is called moved where none did
    power             of the detectable displacement
    rule              "global": points go until the congruence test of the rest passes. "local": until no single point
                      is significant at level / points; finds one small movement among many points better
    variance_factor   known or estimated
    far               points that the datums are not first aligned on, from `far_points`

    Backward search: the point whose movement explains most of the quadratic form goes, the datum is then that of the
    others, and so on; points left out in the shadow of others come back if they are not significant after all. Many
    tests: under "global" the first test alone decides if anything moved, so its level is that of the whole search
    (and `SINGLE` of it, for single points); under "local" Bonferroni's bound holds it. p and p_adjusted are those of
    one point, the stable set given. The two datums are aligned exactly on the stable points, so they may lie any turn
    apart. Where held points define the datum every other may have moved.

    Source: [PELZER71], [CASPARY87] (global test and localisation); [BAARDA73]. The return of points is ours.
    """
    if rule not in ("global", "local"):
        raise EstimationError(f"rule {rule!r} is none of global, local")
    n = len(epochs.names)
    aligned = sorted(far)  # left out when the datums were aligned
    search = _Search(differences(epochs, datum, ~np.isin(np.arange(n), aligned)), variance_factor)
    before = global_test(search.pvv, search.degrees, variance_factor)
    detectable = search.detectable(variance_factor.noncentrality(search.degrees, level, power))[0]
    for _ in range(SEARCHES):
        out, steps, stopped = _backward(search, epochs.names, level, rule)
        out = out if stopped else sorted(_returned(search, out, level, rule))
        if out == aligned or stopped:
            break
        aligned = out
        search = _Search(differences(epochs, datum, ~np.isin(np.arange(n), out)), variance_factor)
    else:
        stopped = CIRCLES.format(rounds=SEARCHES, moved=", ".join(epochs.names[i] for i in out))
    state = search.without(out)
    moved = np.isin(np.arange(n), out)
    return Deformation(
        names=epochs.names,
        **_point_arrays(epochs, search, state, ~moved),
        moved=moved,
        stable=~moved,
        before=before,
        after=_after(state, variance_factor),
        detectable=detectable,
        level=level,
        power=power,
        datum=datum,
        steps=tuple(steps),
        **_outcome(search, epochs.names, out, state, stopped=stopped, level=level),
    )


def _after(state: _State, variance_factor: VarianceFactor) -> CongruenceTest:
    """The test of the stable points; of no degree of freedom where all that are compared moved."""
    if state.degrees == 0:
        return CongruenceTest(0.0, 0, np.nan)
    return global_test(state.pvv, state.degrees, variance_factor)


def _outcome(
    search: _Search, names: Sequence[str], out: Sequence[int], state: _State, *, stopped: str | None, level: float
) -> dict[str, Any]:
    """If the search is conclusive, and its status; beside points held in both epochs any number may have moved."""
    n, known = len(names), search.absolute and bool(search.between.held.any())
    text = CONGRUENT if not out else MOVED if known or 2 * len(out) < n else MAJORITY
    text = EVERY if search.degrees and not state.degrees else text
    words = text.format(
        moved=", ".join(names[i] for i in sorted(out)), stable=n - len(out), p=state.rest_p, level=level
    )
    return {"conclusive": stopped is None and text != MAJORITY, "status": stopped or words}


def _point_arrays(epochs: Epochs, search: _Search, state: _State, stable: np.ndarray) -> dict[str, np.ndarray]:
    """Tests of the points spread over arrays: 0 where held, nan where not compared."""
    n = len(epochs.names)
    compared = np.ones((n, 3), dtype=bool) if epochs.compared is None else np.asarray(epochs.compared, dtype=bool)
    displacement, covariance = np.where(compared, 0.0, np.nan), np.zeros((n, 3, 3))
    covariance[~(compared[:, :, None] & compared[:, None, :])] = np.nan
    statistic, p = np.full(n, np.nan), np.full(n, np.nan)
    unchecked = search.unchecked(stable) if None in state.tests else state.tests
    for i, rows in enumerate(search.rows):
        if not len(rows):
            continue
        test = state.tests[i] or unchecked[i]
        assert test is not None
        axes = search.axes[rows]
        displacement[i, axes] = test.displacement
        covariance[i][np.ix_(axes, axes)] = test.covariance
        statistic[i], p[i] = test.statistic, test.p
    return {
        "displacement": displacement,
        "covariance": covariance,
        "statistic": statistic,
        "p": p,
        "p_adjusted": np.minimum(1.0, p * np.isfinite(p).sum()),
        "held": np.array([len(rows) == 0 for rows in search.rows]) & compared.any(axis=1),
    }
