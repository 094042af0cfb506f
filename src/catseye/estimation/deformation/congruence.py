"""Congruence of the points common to two epochs: datum-free differences, and the global test.

The coordinates of an epoch refer to its own datum. The caller states by which motions the datums may differ ("rigid"
for ranges alone, "levelled" if heights and plumb lines determine two rotations). Every test here weights only the part
that no such motion explains, so that decisions do not depend on how either datum was fixed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from catseye.errors import EstimationError
from catseye.estimation.least_squares.singular import LinearEstimate, best_linear_estimate
from catseye.estimation.network.datum import to_datum
from catseye.estimation.shapes.motions import MOTIONS
from catseye.estimation.shapes.place_covariances import rotated_covariance
from catseye.estimation.shapes.rigid_body import motion_columns

DATUMS: dict[str, tuple[int, ...]] = {
    "absolute": (),
    "translation": (0, 1, 2),
    "levelled": (0, 1, 2, 5),
    "levelled similarity": (0, 1, 2, 5, 6),
    "rigid": (0, 1, 2, 3, 4, 5),
    "similarity": (0, 1, 2, 3, 4, 5, 6),
}
CHANGED = ([0], [1], [2], [1, 2], [0, 2], [0, 1], [0, 1, 2])  # axes along which each of MOTIONS moves points
FIXED = 1e-12  # of the epochs' variances: a difference with less variance is fixed, not measured
FIXED_TOLERANCE = 1e-9  # m: fixed coordinates may differ by rounding only
CURVED = 0.05  # of the smallest sigma: limit of a rotation's second-order effect in a linear datum motion
ALIGNMENTS = 20
UNSEEN = 1e-9  # of the largest singular value of the datum motions: below it a motion is not observed


@dataclass(frozen=True)
class VarianceFactor:
    """Factor on the covariances: known (infinite degrees, chi-square tests) or estimated (F tests)."""

    value: float = 1.0
    degrees_of_freedom: float = np.inf

    def p(self, pvv: float | np.ndarray, rank: float | np.ndarray) -> np.ndarray:
        """Probability of a sum of squares at least pvv, of `rank` degrees of freedom, without movement."""
        pvv, rank = np.asarray(pvv) / self.value, np.maximum(rank, 1)
        if np.isinf(self.degrees_of_freedom):
            return special.chdtrc(rank, np.maximum(pvv, 0.0))
        return special.fdtrc(rank, self.degrees_of_freedom, np.maximum(pvv / rank, 0.0))

    def noncentrality(self, rank: int, level: float, power: float) -> float:
        """Squared size, in sigmas, of an effect that a test of this level and power detects.

        Source: [BAARDA68]; at rank 1, level 0.1 %, power 80 % the root is 4.13.
        """
        f = self.degrees_of_freedom
        if np.isinf(f):
            limit = special.chdtri(rank, level)
            return _crossing(lambda nc: 1.0 - special.chndtr(limit, rank, nc) - power)
        limit = special.fdtri(rank, f, 1.0 - level)
        return _crossing(lambda nc: 1.0 - special.ncfdtr(rank, f, nc, limit) - power)


KNOWN = VarianceFactor()


def _crossing(rising: Callable[[float], float]) -> float:
    """Zero of a rising function, by bisection to double precision."""
    low, high = 0.0, 1.0
    while rising(high) < 0.0:
        low, high = high, 2.0 * high
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rising(middle) < 0.0 else (low, middle)
    return high


def pooled_variance_factor(first: tuple[float, float], second: tuple[float, float]) -> tuple[VarianceFactor, float]:
    """Pooled variance factor of two epochs, and p-value of their equality (two-sided F test).

    first, second   (variance factor, degrees of freedom) of each epoch, as `LeastSquaresSolution.variance_factor`

    Source: [CASPARY87] (homogeneity of two epochs).

    >>> pooled, p = pooled_variance_factor((1.2, 30.0), (0.8, 10.0))
    >>> round(pooled.value, 3), pooled.degrees_of_freedom, round(p, 3)
    (1.1, 40.0, 0.509)
    """
    (a, f), (b, g) = first, second
    if not (a > 0.0 and b > 0.0 and f > 0.0 and g > 0.0):
        raise EstimationError(f"variance factors {a}, {b} with {f}, {g} degrees of freedom: all must be positive")
    p = 2.0 * min(special.fdtrc(f, g, a / b), special.fdtr(f, g, a / b))
    return VarianceFactor((a * f + b * g) / (f + g), f + g), float(p)


@dataclass(frozen=True, eq=False)
class Epochs:
    """Points common to two epochs.

    names               n, unique
    first, second       (n, 3) m, all finite
    covariance_first    (3n, 3n) m^2, joint, may be singular
    covariance_second   likewise
    cross               (3n, 3n) m^2, covariance of the first epoch (rows) with the second (columns); None: independent
    compared            (n, 3) bool: False for a coordinate that is not common, e.g. of a benchmark with known height
                        only; it is not tested, its value is only the position. None: all are compared
    """

    names: tuple[str, ...]
    first: np.ndarray
    second: np.ndarray
    covariance_first: np.ndarray
    covariance_second: np.ndarray
    cross: np.ndarray | None = None
    compared: np.ndarray | None = None

    def __post_init__(self) -> None:
        n = len(self.names)
        if len(set(self.names)) != n or n == 0:
            raise EstimationError(f"{n} points with {len(set(self.names))} different names: names must be unique")
        for what, array, shape in (
            ("first epoch", self.first, (n, 3)),
            ("second epoch", self.second, (n, 3)),
            ("covariance of the first epoch", self.covariance_first, (3 * n, 3 * n)),
            ("covariance of the second epoch", self.covariance_second, (3 * n, 3 * n)),
            ("covariance between the epochs", self.cross, (3 * n, 3 * n)),
        ):
            if array is not None and (np.shape(array) != shape or not np.isfinite(array).all()):
                raise EstimationError(f"the {what} has shape {np.shape(array)}, expected {shape}, all finite")


@dataclass(frozen=True)
class CongruenceTest:
    """Global test that points did not move relative to each other.

    pvv                 weighted sum of squares of the differences that no datum motion explains
    degrees_of_freedom  compared coordinates less datum motions
    p                   probability of a pvv at least as large if nothing moved
    """

    pvv: float
    degrees_of_freedom: int
    p: float


def _combination(points: np.ndarray, datum: str, pivot: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Datum motions (7, g) from those of `motion_columns`, scaled to unit columns over the points.

    axes   (3,) bool: compared in any point; motions that change no such coordinate are omitted
    """
    if datum not in DATUMS:
        raise EstimationError(f"unknown datum {datum!r} (expected one of {', '.join(DATUMS)})")
    chosen = np.eye(7)[:, [k for k in DATUMS[datum] if np.any(axes[CHANGED[k]])]]
    length = np.linalg.norm(motion_columns(points, pivot) @ chosen, axis=0)
    return chosen / np.where(length > 0.0, length, 1.0)


@dataclass(frozen=True, eq=False)
class Differences:
    """Coordinate differences, second less first, aligned on chosen points, with their weights' inputs.

    names         n
    datum         allowed differences of the two datums
    d             (3n,) m
    q             (3n, 3n) m^2, variance factor 1
    used          (3n,) bool: compared and not fixed
    fixed         (3n,) bool: compared, without variance
    pivot         (3,) m
    combination   (7, g): datum motions left free by fixed coordinates, about the pivot
    motions       (3n, g): their displacements of the points, m
    called        g names of them
    turned        (3, 3), and
    shifted       (3,) m: the second epoch was aligned as turned @ second + shifted
    """

    names: tuple[str, ...]
    datum: str
    d: np.ndarray
    q: np.ndarray
    used: np.ndarray
    fixed: np.ndarray
    pivot: np.ndarray
    combination: np.ndarray
    motions: np.ndarray
    called: tuple[str, ...]
    turned: np.ndarray
    shifted: np.ndarray

    @property
    def _visible(self) -> np.ndarray:
        """Motions (3n, r) observable in the compared coordinates.

        A rotation about a line of points is not.
        """
        return self.motions @ observable_motions(self.motions[self.used])[0]

    def holds(self, stable: np.ndarray) -> bool:
        """True if these points (n,) bool determine every observable datum motion."""
        motions = self._visible
        rows, count = motions[np.repeat(stable, 3) & self.used], motions.shape[1]
        if len(rows) < count or count == 0:  # numpy 2.0 has no rank of an empty matrix
            return count == 0
        return bool(np.linalg.matrix_rank(rows) == count)

    def fit(self, extra: np.ndarray | None = None, called: Sequence[str] = ()) -> LinearEstimate:
        """Best fit of the differences by datum motions and extra columns (3n, k)."""
        rows = np.flatnonzero(self.used)
        if not len(rows):
            raise EstimationError("no coordinate is compared: every common one is fixed or excluded")
        motions, names = self._visible[rows], self.called
        if motions.shape[1] < len(names):
            names = tuple(f"datum motion {i + 1}" for i in range(motions.shape[1]))
        return best_linear_estimate(
            motions if extra is None else np.concatenate([motions, extra[rows]], axis=1),
            self.d[rows],
            self.q[np.ix_(rows, rows)],
            parameters=[*names, *called],
            rows=[f"{self.names[r // 3]} {'xyz'[r % 3]}" for r in rows],
        )

    def in_datum(self, stable: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Plain differences (3n,) m and covariance (3n, 3n) m^2 in the datum of stable points (n,) bool.

        Fixed coordinates come first; the remaining motions are fixed by inner constraints on the stable points, by
        S-transformation. Raises EstimationError if these do not determine the datum. Source: [BAARDA73].
        """
        motions = self._visible
        conditions = np.where((np.repeat(stable, 3) & self.used)[:, None], motions, 0.0).T
        if not self.holds(stable):
            raise EstimationError(
                f"{int(stable.sum())} stable points do not determine a {self.datum} datum; more are needed"
            )
        moved, t = to_datum(self.d, np.zeros(len(self.d)), motions, conditions=conditions)
        s = np.eye(len(self.d)) - t @ conditions
        return self.d + moved, s @ self.q @ s.T

    def plain(self, stable: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Differences as `in_datum`; nan if undetermined or not compared."""
        n = len(self.d)
        d, q = self.in_datum(stable) if self.holds(stable) else (np.full(n, np.nan), np.full((n, n), np.nan))
        known_rows = self.used | self.fixed
        return np.where(known_rows, d, np.nan), np.where(known_rows[:, None] & known_rows, q, np.nan)

    @staticmethod
    def blocks(d: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (n, 3) and covariances (n, 3, 3) of single points from (3n,) and (3n, 3n)."""
        n = len(d) // 3
        return d.reshape(n, 3), q.reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n)]


def observable_motions(motions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Combinations (g, r) of motions (m, g) observable in these rows, and the unobservable (g, g - r)."""
    _, s, vt = np.linalg.svd(np.linalg.qr(motions, mode="r"), full_matrices=True)
    rank = int(np.sum(s > UNSEEN * s.max(initial=0.0)))
    return (np.eye(len(vt)), np.zeros((len(vt), 0))) if rank == len(vt) else (vt[:rank].T, vt[rank:].T)


def differences(epochs: Epochs, datum: str, stable: np.ndarray) -> Differences:
    """Differences with the best unweighted datum motion of the stable points removed exactly.

    epochs   see `Epochs`
    datum    allowed differences of the two datums, a key of `DATUMS`
    stable   (n,) bool

    Raises EstimationError if fixed coordinates differ, or for a large rotation with partly compared coordinates.
    """
    x, y = (np.asarray(p, dtype=float) for p in (epochs.first, epochs.second))
    n = len(x)
    qx, qy = (np.asarray(q, dtype=float) for q in (epochs.covariance_first, epochs.covariance_second))
    cross = np.zeros((3 * n, 3 * n)) if epochs.cross is None else np.asarray(epochs.cross, dtype=float)
    compared = np.ones(3 * n, dtype=bool) if epochs.compared is None else np.ravel(epochs.compared).astype(bool)
    variance = np.diag(qx) + np.diag(qy)
    fixed = compared & (np.diag(qx + qy - cross - cross.T) <= FIXED * variance)
    _check_fixed(epochs.names, np.where(fixed, np.abs((y - x).ravel()), 0.0))
    fixed_points = fixed.reshape(n, 3).all(axis=1)
    pivot = x[fixed_points].mean(axis=0) if fixed_points.any() else x[stable].mean(axis=0)
    axes = np.asarray(compared.reshape(n, 3).any(axis=0))
    combination = _combination(x, datum, pivot, axes)
    base = motion_columns(x, pivot)
    called = tuple(MOTIONS[i] for i in DATUMS[datum] if np.any(axes[CHANGED[i]]))
    if fixed.any() and combination.shape[1]:  # only motions that leave fixed coordinates unchanged
        _, s, vt = np.linalg.svd(base[fixed] @ combination)
        free = vt[int(np.sum(s > UNSEEN * s.max(initial=0.0))) :].T
        combination, called = combination @ free, tuple(f"datum motion {i + 1}" for i in range(free.shape[1]))
    partial = not _turns_alike(compared.reshape(n, 3), fixed.reshape(n, 3), combination)
    on = np.repeat(stable, 3) & compared & ~fixed
    turned = np.eye(3)
    aligned = y
    if combination.shape[1] and on.any():
        smallest = float(np.sqrt(variance[on & (variance > 0.0)].min(initial=np.inf)))
        aligned, turned = _aligned(x, y, on, pivot, combination=combination, limit=smallest if partial else np.inf)
        cross = rotated_covariance(cross, turned, columns=True)
        qy = rotated_covariance(rotated_covariance(qy, turned, columns=True), turned, columns=False)
    return Differences(
        names=epochs.names,
        datum=datum,
        d=(aligned - x).ravel(),
        q=qx + qy - cross - cross.T,
        used=compared & ~fixed,
        fixed=fixed,
        pivot=pivot,
        combination=combination,
        motions=base @ combination,
        called=called,
        turned=turned,
        shifted=aligned[0] - turned @ y[0],
    )


def _turns_alike(compared: np.ndarray, fixed: np.ndarray, combination: np.ndarray) -> bool:
    """True if the datum's rotations mix only coordinates of one state.

    The states, (n, 3) bool each, are fixed, compared or neither.
    """
    axes = [0, 1, 2] if np.any(combination[3:5]) else [0, 1] if np.any(combination[5]) else [0]
    return all(bool(np.all(part[:, axes] == part[:, :1])) for part in (compared, fixed))


def _check_fixed(names: Sequence[str], apart: np.ndarray) -> None:
    worst = int(np.argmax(apart))
    if apart[worst] > FIXED_TOLERANCE:
        raise EstimationError(
            f"{names[worst // 3]} is fixed: the difference of its {'xyz'[worst % 3]} has no variance, but is "
            f"{apart[worst]:.3g} m; give its covariance, or the same coordinate in both epochs"
        )


def _aligned(
    x: np.ndarray, y: np.ndarray, on: np.ndarray, pivot: np.ndarray, *, combination: np.ndarray, limit: float
) -> tuple[np.ndarray, np.ndarray]:
    """y moved exactly onto x by datum motions, and the matrix used.

    Coordinates `on` are fitted.

    With a finite `limit`, m, the smallest sigma, y is returned unchanged if the second-order effect of the rotation is
    negligible against it.
    """
    from scipy.spatial.transform import Rotation

    turned = np.eye(3)
    base = motion_columns(x, pivot)
    size = float(np.abs(base[:, 3:]).max())
    for _ in range(ALIGNMENTS):
        columns = (base @ combination)[on]
        motion = combination @ np.linalg.lstsq(columns, (y - x).ravel()[on], rcond=None)[0]
        curved = float(motion[3:6] @ motion[3:6] + motion[6] ** 2) * size
        if np.isfinite(limit):
            if curved > CURVED * limit:
                raise EstimationError(
                    f"the epochs' axes differ by {np.linalg.norm(motion[3:6]):.2g} rad, too much for points known or "
                    "fixed in some coordinates only; bring both epochs to the same axes first"
                )
            return y, turned
        back = Rotation.from_rotvec(-motion[3:6]).as_matrix() / (1.0 + motion[6])
        y = pivot + (y - motion[:3] - pivot) @ back.T
        turned = back @ turned
        if curved < 1e-15 * (size + 1.0):
            break
    return y, turned


def global_test(pvv: float, degrees: int, variance_factor: VarianceFactor) -> CongruenceTest:
    """Test that a sum of squares with its degrees of freedom is zero but for noise.

    For two epochs, pvv is the quadratic form of their differences with the pseudo-inverse of the covariance, both in
    one datum: `Differences.fit`, the same for every datum. Raises EstimationError without a degree of freedom.

    Source: [PELZER71]; [CASPARY87].
    """
    if degrees <= 0:
        raise EstimationError(
            "nothing to test: the compared coordinates have no redundancy beyond the datum; compare more points"
        )
    return CongruenceTest(pvv, degrees, float(variance_factor.p(pvv, degrees)))
