"""Which points moved between two epochs, and how small a movement would have been seen."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.deformation.congruence import (
    KNOWN,
    CongruenceTest,
    Epochs,
    VarianceFactor,
    differences,
    global_test,
)
from catseye.estimation.deformation.deletion import DeletionSearch, DeletionState, Step, find_moved

CONGRUENT = "congruent: no point moved (p = {p:.2g}, level {level:g})"
MOVED = "moved: {moved}; the other {stable} points are congruent (p = {p:.2g}, level {level:g})"
MAJORITY = "moved: {moved}; but only {stable} points are congruent (p = {p:.2g}): it may be those that moved"
EVERY = "moved: {moved}, all that are compared (level {level:g})"


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
    search = DeletionSearch(differences(epochs, datum, np.ones(len(epochs.names), dtype=bool)), variance_factor)
    global_test(search.pvv, search.degrees, variance_factor)
    if not single:
        return search.detectable(variance_factor.noncentrality(search.degrees, level, power))
    ranks = np.array([len(rows) for rows in search.rows])
    unit, direction = search.detectable(1.0)
    each = level / max(int(np.isfinite(unit).sum()), 1)
    needed = {int(r): variance_factor.noncentrality(int(r), each, power) for r in set(ranks[np.isfinite(unit)])}
    return unit * np.sqrt([needed.get(int(r), np.nan) for r in ranks]), direction


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
    far               points that the datums are not first aligned on, from `far_points`; where something moved the
                      search is repeated without them, and what is conclusive with fewer points is taken

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
    options: dict[str, Any] = {"level": level, "rule": rule, "far": far}
    found = find_moved(epochs, datum, variance_factor, **options)
    if far and (found.stopped or (found.out and found.out != sorted(far))):
        found = min(found, find_moved(epochs, datum, variance_factor, **options, without=True), key=lambda f: f.rank)
    search, out = found.search, found.out
    before = global_test(search.pvv, search.degrees, variance_factor)
    detectable = search.detectable(variance_factor.noncentrality(search.degrees, level, power))[0]
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
        steps=tuple(found.steps),
        **_outcome(search, epochs.names, out, state, stopped=found.stopped, level=level),
    )


def _after(state: DeletionState, variance_factor: VarianceFactor) -> CongruenceTest:
    """The test of the stable points; of no degree of freedom where all that are compared moved."""
    if state.degrees == 0:
        return CongruenceTest(0.0, 0, np.nan)
    return global_test(state.pvv, state.degrees, variance_factor)


def _outcome(
    search: DeletionSearch,
    names: Sequence[str],
    out: Sequence[int],
    state: DeletionState,
    *,
    stopped: str | None,
    level: float,
) -> dict[str, Any]:
    """If the search is conclusive, and its status; beside points held in both epochs any number may have moved."""
    n, known = len(names), search.absolute and bool(search.between.held.any())
    text = CONGRUENT if not out else MOVED if known or 2 * len(out) < n else MAJORITY
    text = EVERY if search.degrees and not state.degrees else text
    words = text.format(
        moved=", ".join(names[i] for i in sorted(out)), stable=n - len(out), p=state.rest_p, level=level
    )
    return {"conclusive": stopped is None and text != MAJORITY, "status": stopped or words}


def _point_arrays(epochs: Epochs, search: DeletionSearch, state: DeletionState, stable: np.ndarray) -> dict[str, Any]:
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
