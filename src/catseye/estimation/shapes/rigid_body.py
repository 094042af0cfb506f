"""The rigid, similarity or affine transformation between two sets of points, weighted with the covariance of both.

Both covariances may be singular, as those of free networks are. What is estimated takes their null space in: only the
part of the misclosures that no motion explains is weighted, by the inverse of its own covariance. So the sum of squares
and its degrees of freedom do not depend on the datum of either set; the parameters do, and their covariance says so.

The covariance is factorised at the start and again only where the search has turned so far that steps shrink slowly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.singular import FactoredModel, LinearEstimate
from catseye.estimation.shapes.motions import motions
from catseye.estimation.shapes.place_covariances import PlaceCovariances

CONVERGED = "converged"
NOT_CONVERGED = "not converged: the last step moved a point by {step:.2g} m after {iterations} iterations"
WEAK = "weak: the turn about ({axis}) is uncertain by {u:.2g} rad; add a point away from that line"
MIRRORED = "mirrored: a mirror image fits better; check the handedness of the axes"
PARAMETERS = {"rigid": 6, "similarity": 7, "affine": 12}
POINTS = {"rigid": 3, "similarity": 3, "affine": 4}
ITERATIONS = 50
STEP = 1e-12  # of the size of the set: below it rounding rules
FLAT = 1e-9  # of the size of the set: points no further off a line or plane do not hold a turn about it
NEAR = 1e-2  # of the step before: a factor that leaves more of it is of another place; so near are weights known
HELD = 1e-4  # of a column's length: what must be left of it beside those before it, for a start to take the step
WEAK_TURN = 0.1  # rad: beyond it a turn is no longer small, and its covariance only an indication


def motion_columns(points: np.ndarray, pivot: np.ndarray) -> np.ndarray:
    """Derivatives of coordinates with respect to small translation, rotation and change of scale, (3n, 7).

    points   (n, 3) m
    pivot    (3,) m, what the rotation and the scale leave in place

    Columns: translation x, y, z (1), rotation x, y, z (m/rad, right-hand rule), scale (m). Source: [BAARDA73].

    >>> motion_columns(np.array([[2.0, 0.0, 0.0]]), np.zeros(3))[:, 5]  # turned about z, a point on x moves along y
    array([0., 2., 0.])
    """
    return motions(np.asarray(points, dtype=float), pivot, 1.0)


@dataclass(frozen=True, eq=False)
class Transformation:
    """second = pivot + translation + matrix (first - pivot), with residuals: second minus that.

    kind                "rigid", "similarity" or "affine"
    pivot               (3,) m, in the axes of the first set; the translation is that of this point
    translation         (3,) m
    matrix              (3, 3): rotation, scale times rotation, or any
    covariance          (6, 6), (7, 7) or (12, 12): translation; then rotation (a further small turn about the axes of
                        the second set, rad); then scale; or, affine, translation and the matrix row by row
    residual            (n, 3) m
    pvv                 weighted sum of squares
    degrees_of_freedom  3 n less parameters
    iterations          steps taken
    status              "converged", or one line that says what is wrong and what to do
    """

    kind: str
    pivot: np.ndarray
    translation: np.ndarray
    matrix: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    pvv: float
    degrees_of_freedom: int
    iterations: int
    status: str

    @property
    def scale(self) -> float:
        """Cube root of the change of volume: 1 for a rigid motion."""
        return float(np.cbrt(np.linalg.det(self.matrix)))

    @property
    def rotation(self) -> np.ndarray:
        """(3,) rad, rotation vector of the rotation nearest to the matrix."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_matrix(_polar(self.matrix)[0]).as_rotvec()

    @property
    def variance_factor(self) -> float:
        """[pvv] / degrees of freedom, expectation 1; nan without redundancy."""
        return self.pvv / self.degrees_of_freedom if self.degrees_of_freedom else float("nan")

    def require_converged(self) -> "Transformation":
        """This transformation, or EstimationError with its status."""
        if self.status != CONVERGED:
            raise EstimationError(self.status)
        return self

    def apply(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) m of the first set's axes in those of the second."""
        return self.pivot + self.translation + (np.asarray(points, dtype=float) - self.pivot) @ self.matrix.T

    def about(self, pivot: np.ndarray) -> "Transformation":
        """The same transformation with another pivot (3,) m: translation and covariance follow, nothing else changes.

        translation' = translation + (matrix - 1) (pivot' - pivot). Exact.
        """
        pivot = np.asarray(pivot, dtype=float)
        move = np.eye(len(self.covariance))
        move[:3] = _columns(self.kind, (pivot - self.pivot)[None], self.matrix)[:, : len(move)]
        return replace(
            self,
            pivot=pivot,
            translation=self.translation + (self.matrix - np.eye(3)) @ (pivot - self.pivot),
            covariance=move @ self.covariance @ move.T,
        )

    def strain(self) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3,) rad and strain (6,) xx yy zz yz xz xy, stretch less one, with their covariance (9, 9).

        The matrix is rotation times stretch (polar decomposition), so the strain is seen in the axes of the first set
        and a rotation of any size leaves it at zero. The rotation's covariance is as in `covariance`.
        """
        turn, stretch = _polar(self.matrix)
        slope = np.zeros((9, 9))
        for i in range(9):
            change = turn.T @ np.eye(9)[i].reshape(3, 3)
            skew = change - change.T
            axial = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
            spin = np.linalg.solve(np.trace(stretch) * np.eye(3) - stretch, axial)
            slope[:3, i] = turn @ spin
            slope[3:, i] = _six(change - np.cross(spin, stretch, axisb=0, axisc=0))
        q = slope @ self._of_matrix() @ slope.T
        return np.concatenate([self.rotation, _six(stretch - np.eye(3))]), q

    def _of_matrix(self) -> np.ndarray:
        """Covariance (9, 9) of the matrix, row by row."""
        if self.kind == "affine":
            return self.covariance[3:, 3:]
        # row 3 i + j of the matrix depends on the parameters as component i of the image of unit vector j
        image = _columns(self.kind, np.eye(3), self.matrix)[:, 3:].reshape(3, 3, -1)
        slope = image.transpose(1, 0, 2).reshape(9, -1)
        return slope @ self.covariance[3:, 3:] @ slope.T


def _six(tensor: np.ndarray) -> np.ndarray:
    return np.array([tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))])


def _polar(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and symmetric stretch whose product is the matrix."""
    u, s, vt = np.linalg.svd(matrix)
    return u @ vt, (vt.T * s) @ vt


def _columns(kind: str, arm: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Derivatives (3n, p) of pivot + translation + matrix @ arm with respect to the parameters."""
    n = len(arm)
    if kind == "affine":
        blocks = np.zeros((n, 3, 12))
        blocks[:, :, :3] = np.eye(3)
        for i in range(3):
            blocks[:, i, 3 + 3 * i : 6 + 3 * i] = arm
        return blocks.reshape(-1, 12)
    columns = motion_columns(arm @ matrix.T, np.zeros(3))
    if kind == "rigid":
        return columns[:, :6]
    columns[:, 6] /= np.cbrt(np.linalg.det(matrix))
    return columns


def closed_form(first: np.ndarray, second: np.ndarray, *, with_scale: bool = False) -> tuple[np.ndarray, bool]:
    """The matrix (rotation, or scale times rotation) that fits two sets of points best unweighted, and if mirrored.

    first, second   (n, 3) m
    with_scale      True fits a change of scale too

    Always a proper rotation, also of points in one plane; the second value is True where an improper one fits better.
    The translation is that of the centroid. Source: [KABSCH76]; [UMEYAMA91] (sign that keeps it proper, scale). Exact.

    >>> turned = np.eye(3) @ [[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    >>> closed_form(np.eye(3), turned)[0].round(12) + 0.0  # a quarter turn about z
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """
    x, y = (p - p.mean(axis=0) for p in (np.asarray(first, dtype=float), np.asarray(second, dtype=float)))
    u, s, vt = np.linalg.svd(y.T @ x)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    scale = float(s @ sign / np.sum(x * x)) if with_scale else 1.0
    return scale * (u * sign) @ vt, bool(sign[2] < 0.0 and s[2] > FLAT * s[0])


def fit_transformation(
    first: np.ndarray,
    second: np.ndarray,
    *,
    kind: str = "rigid",
    covariance_first: np.ndarray | None = None,
    covariance_second: np.ndarray | None = None,
    cross: np.ndarray | None = None,
    pivot: np.ndarray | None = None,
    names: Sequence[str] | None = None,
) -> Transformation:
    """The transformation from one set of points to another that fits both best, with full covariance.

    first               (n, 3) m, n at least 3 (affine 4)
    second              (n, 3) m, the same points in the same order
    kind                "rigid" (6 parameters), "similarity" (7) or "affine" (12)
    covariance_first    (3n, 3n) m^2, may be singular; None: the first set is exact
    covariance_second   likewise; both None: equal weights of 1 m, so multiply the answer's covariance by its
                        variance factor
    cross               (3n, 3n) m^2, covariance of the first (rows) with the second (columns), if any
    pivot               (3,) m, in the first set's axes; default the centroid
    names               n, for errors

    Starts from the closed form, then Gauss-Newton on the Gauss-Helmert model: the derivatives are taken at adjusted
    points, so that the answer is the maximum of the likelihood however noisy the first set is. Singular covariances:
    see the top of this file. A rigid motion also of networks whose scale is free is refused: fit a similarity. Raises
    EstimationError for sets that do not fit together or do not hold the parameters, naming what floats.

    Source: [KABSCH76], [UMEYAMA91] (start); [POPE72] (derivatives at adjusted observations); [RAO73] section 4i.
    """
    known = PlaceCovariances(covariance_first, covariance_second, cross)
    if covariance_first is None and covariance_second is None:
        known = PlaceCovariances(second=np.tile(np.eye(3), (len(first), 1, 1)))
    return adjusted_motion(first, second, known, kind=kind, pivot=pivot, names=names)[0]


def adjusted_motion(
    first: np.ndarray,
    second: np.ndarray,
    covariance: PlaceCovariances,
    *,
    kind: str = "rigid",
    pivot: np.ndarray | None = None,
    names: Sequence[str] | None = None,
    extra: np.ndarray | None = None,
) -> tuple[Transformation, LinearEstimate]:
    """`fit_transformation`, with the linear estimate at its end: gain, weighted residuals, weights.

    extra   (3n,) m^2, more variance of the second set

    Each step solves the linear model for what is left of the conditions at its place, misclosure = spread times
    weighted residuals and columns' weighted residuals = 0, so that a factor of a place nearby leads to the same end.
    The weights P of the estimate are of the last factor, by NEAR of themselves; everything else is of the end.
    """
    x, y, called = _checked(first, second, kind, names)
    known = covariance.checked(len(x))
    pivot = x.mean(axis=0) if pivot is None else np.asarray(pivot, dtype=float)
    smallest = STEP * max(float(np.abs(x - pivot).max()), float(np.abs(y - pivot).max()))
    if kind == "affine":
        arm = x - x.mean(axis=0)
        matrix, mirrored = np.linalg.lstsq(arm, y - y.mean(axis=0), rcond=None)[0].T, False
    else:
        matrix, mirrored = closed_form(x, y, with_scale=kind == "similarity")
    translation = np.mean(y - pivot - (x - pivot) @ matrix.T, axis=0)
    matrix, translation = _by_own_blocks(kind, x - pivot, y - pivot, known, matrix, translation)
    adjusted, weighted, taken, used = x, np.zeros(x.size), 0, 0
    before = step = np.inf
    model = None
    while step >= smallest and taken < ITERATIONS:
        taken += 1
        misclosure = (y - pivot - translation - (x - pivot) @ matrix.T).ravel()
        columns = _columns(kind, adjusted - pivot, matrix)
        if model is None or (used > 1 and step > NEAR * before):
            model, used = None, 0  # its memory goes first
            model = FactoredModel.of(
                columns, known.difference(len(x), matrix, extra), parameters=_names(kind), rows=called, overwrite=True
            )
        used += 1
        left = misclosure - known.difference_times(matrix, weighted[:, None], extra)[:, 0]
        more, change = model.solve(left, -columns.T @ weighted)
        weighted = weighted + more
        before, step = step, float(np.abs(columns @ change).max())
        at = matrix
        adjusted = x + known.pull(at, weighted).reshape(-1, 3)
        translation = translation + change[:3]
        matrix = _stepped(kind, at, change[3:])
    assert model is not None
    gain, spread_of = model.refined(columns, lambda a: known.difference_times(at, a, extra))
    status = NOT_CONVERGED.format(step=step, iterations=taken)
    if step < smallest:
        status = _status(kind, spread_of, mirrored or np.linalg.det(matrix) < 0.0)
    free = x.size - columns.shape[1]
    linear = LinearEstimate(change, spread_of, gain, weighted, float(misclosure @ weighted), free, columns, model)
    motion = Transformation(
        kind=kind,
        pivot=pivot,
        translation=translation,
        matrix=matrix,
        covariance=spread_of,
        residual=misclosure.reshape(-1, 3),
        pvv=linear.pvv,
        degrees_of_freedom=free,
        iterations=taken,
        status=status,
    )
    return motion, linear


def _by_own_blocks(
    kind: str, x: np.ndarray, y: np.ndarray, known: PlaceCovariances, matrix: np.ndarray, translation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A start nearer to the end: one step in which each point counts by its own covariance, as if independent.

    x, y   (n, 3) m, from the pivot

    Matrix and translation come back as they were where a point's own covariance is singular or the step is not held.
    """
    try:
        half = np.linalg.inv(np.linalg.cholesky(known.blocks(len(x), matrix)))
    except np.linalg.LinAlgError:
        return matrix, translation
    rows = (half @ _columns(kind, x, matrix).reshape(len(x), 3, -1)).reshape(x.size, -1)
    left = (half @ (y - translation - x @ matrix.T)[:, :, None]).ravel()
    size = np.linalg.norm(rows, axis=0)
    base, triangle = np.linalg.qr(rows / size)
    if np.abs(np.diag(triangle)).min() < HELD:
        return matrix, translation
    step = np.linalg.solve(triangle, base.T @ left) / size
    return _stepped(kind, matrix, step[3:]), translation + step[:3]


def _names(kind: str) -> list[str]:
    moves = [f"translation {a}" for a in "xyz"]
    if kind == "affine":
        return moves + [f"matrix {a}{b}" for a in "xyz" for b in "xyz"]
    return [*moves, *(f"rotation {a}" for a in "xyz"), "scale"][: PARAMETERS[kind]]


def _stepped(kind: str, matrix: np.ndarray, step: np.ndarray) -> np.ndarray:
    if kind == "affine":
        return matrix + step.reshape(3, 3)
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_rotvec(step[:3]).as_matrix() @ matrix
    return turned * (1.0 + step[3] / np.cbrt(np.linalg.det(matrix))) if kind == "similarity" else turned


def _status(kind: str, covariance: np.ndarray, mirrored: bool) -> str:
    if mirrored:
        return MIRRORED
    if kind != "affine":
        values, vectors = np.linalg.eigh(covariance[3:6, 3:6])
        if values[-1] > WEAK_TURN**2:
            axis = ", ".join(f"{v:.3f}" for v in vectors[:, -1])
            return WEAK.format(axis=axis, u=values[-1] ** 0.5)
    return CONVERGED


def _checked(
    first: np.ndarray, second: np.ndarray, kind: str, names: Sequence[str] | None
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Both sets as floats and the names of their coordinates; refused where they cannot hold the parameters."""
    if kind not in PARAMETERS:
        raise EstimationError(f"kind {kind!r} is none of {', '.join(PARAMETERS)}")
    x, y = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if x.ndim != 2 or x.shape[1] != 3 or x.shape != y.shape or not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise EstimationError(f"points have shapes {x.shape} and {y.shape}, expected (n, 3) twice, all finite")
    called = list(names) if names is not None else [f"point {i}" for i in range(len(x))]
    if len(called) != len(x):
        raise EstimationError(f"{len(called)} names for {len(x)} points")
    some = ", ".join(called[:4]) + (" ..." if len(called) > 4 else "")
    if len(x) < POINTS[kind]:
        floats = {0: "everything", 1: "every rotation", 2: "the turn about the line through them"}
        floating = floats.get(len(x), "the strain across their plane")
        raise EstimationError(f"{kind}: needs {POINTS[kind]} points, {len(x)} given ({some}): {floating} floats")
    for points in (x, y):
        _, s, vt = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
        rank = int(np.sum(s > FLAT * s[0])) if s[0] > 0.0 else 0
        if rank == 0:
            raise EstimationError(f"{kind}: {some} are all at one place: every rotation floats")
        if rank == 1:
            axis = ", ".join(f"{v:.3f}" for v in vt[0])
            raise EstimationError(f"{kind}: {some} lie on one line: the turn about ({axis}) floats; add a point off it")
        if rank == 2 and kind == "affine":
            axis = ", ".join(f"{v:.3f}" for v in vt[2])
            raise EstimationError(f"affine: {some} lie in one plane: strain along its normal ({axis}) floats")
    return x, y, [f"{name} {axis}" for name in called for axis in "xyz"]
