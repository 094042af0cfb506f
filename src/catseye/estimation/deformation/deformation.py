"""Moved points between two epochs, and the smallest detectable movements."""

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
MAJORITY = "moved: {moved}; but only {stable} points are congruent (p = {p:.2g}): those may have moved instead"
ALL_MOVED = "moved: {moved}, all points compared (level {level:g})"


@dataclass(frozen=True, eq=False)
class Deformation:
    """Movements between two epochs; arrays over the n common points.

    names          n
    displacement   (n, 3) m, second less first, relative to the other stable points, taken as unmoved: the best
                   estimate with all correlations. 0 for fixed points; nan in coordinates not compared. Of a point that
                   these do not check: in the datum of inner constraints on all stable points, itself included, where
                   the covariance may be singular
    covariance     (n, 3, 3) m^2 of each (variance factor included); nan likewise
    statistic      (n,) displacement' covariance^-1 displacement over compared coordinates
    p              (n,) p-value: probability of a statistic at least as large if the point did not move, given the
                   stable set
    p_adjusted     (n,) p times the number of tested points (Bonferroni), at most 1
    moved          (n,) bool
    held           (n,) bool: fixed, without variance in both epochs or carried over: displacement 0 by definition, no
                   test
    stable         (n,) bool: not moved; they define the datum
    before, after  global tests of all points, and of the stable ones
    detectable     (n,) m, smallest displacement, in the weakest direction, that `before` detects with the power
    level, power   of the tests
    datum          allowed differences of the two datums
    steps          the removals in order, including points readmitted later
    conclusive     False if the search did not end with a congruent majority
    status         one line: congruent, which points moved, or why it is undecided
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
    variance_factor: VarianceFactor = KNOWN,
) -> tuple[np.ndarray, np.ndarray]:
    """Smallest displacement (n,) m of each point that the congruence test detects, and its direction (n, 3).

    epochs            see `Epochs`; for planning, the second epoch may repeat the first's coordinates
    datum             allowed differences of the two datums, a key of `congruence.DATUMS`
    level             of the test
    power             probability of detection
    variance_factor   known or estimated

    The direction is the weakest one. A point that the others do not check has nan. All other points are taken as
    unmoved.

    Source: [BAARDA68] (noncentrality), for a test of several degrees of freedom; [CASPARY87].
    """
    search = DeletionSearch(differences(epochs, datum, np.ones(len(epochs.names), dtype=bool)), variance_factor)
    global_test(search.pvv, search.degrees, variance_factor)
    return search.detectable(variance_factor.noncentrality(search.degrees, level, power))


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
    """Common points that moved, with displacements, covariances and tests.

    epochs            see `Epochs`
    datum             allowed differences of the two datums, a key of `congruence.DATUMS`
    level             probability of any false alarm if no point moved
    power             of the detectable displacement
    rule              "global": remove points until the congruence test of the remainder passes. "local": until no
                      single point is significant at level / points; more sensitive to one small movement among many
    variance_factor   known or estimated
    far               points excluded from the first alignment, from `far_points`; if something moved the search is
                      repeated without them, and the conclusive result with fewer points is taken

    Backward search: remove the point whose movement explains most of the quadratic form, define the datum by the
    others, and repeat; points removed because of others are readmitted if they are not significant at the end. Multiple
    tests: under "global" the first test alone decides if anything moved, so its level is that of the whole search (plus
    `SINGLE` of it, for single points); under "local" the level is a Bonferroni bound. p and p_adjusted are those of one
    point, given the stable set. The two datums are aligned exactly on the stable points, so they may differ by any
    rotation. If fixed points define the datum all others may have moved.

    Source: [PELZER71], [CASPARY87] (global test and localisation); [BAARDA73]. The readmission of points is ours.
    """
    if rule not in ("global", "local"):
        raise EstimationError(f"unknown rule {rule!r} (expected global or local)")
    n = len(epochs.names)
    options: dict[str, Any] = {"level": level, "rule": rule, "far": far}
    result = find_moved(epochs, datum, variance_factor, **options)
    if far and (result.stopped or (result.out and result.out != sorted(far))):
        result = min(result, find_moved(epochs, datum, variance_factor, **options, without=True), key=lambda f: f.rank)
    search, out = result.search, result.out
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
        steps=tuple(result.steps),
        **_outcome(search, epochs.names, out, state, stopped=result.stopped, level=level),
    )


def _after(state: DeletionState, variance_factor: VarianceFactor) -> CongruenceTest:
    """Test of the stable points.

    Zero degrees of freedom if all compared points moved.
    """
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
    """Conclusiveness and status of a search.

    With points fixed in both epochs any number may have moved.
    """
    n, absolute = len(names), search.absolute and bool(search.between.fixed.any())
    text = CONGRUENT if not out else MOVED if absolute or 2 * len(out) < n else MAJORITY
    text = ALL_MOVED if search.degrees and not state.degrees else text
    words = text.format(
        moved=", ".join(names[i] for i in sorted(out)), stable=n - len(out), p=state.rest_p, level=level
    )
    return {"conclusive": stopped is None and text != MAJORITY, "status": stopped or words}


def _point_arrays(epochs: Epochs, search: DeletionSearch, state: DeletionState, stable: np.ndarray) -> dict[str, Any]:
    """Point tests spread over arrays: 0 if fixed, nan if not compared."""
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
