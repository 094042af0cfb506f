"""Rigid, similarity or affine transformation between two sets of points, weighted with both covariances.

Both covariances may be singular, as those of free networks are. The parameters absorb their null space: only the part
of the misclosures that no motion explains is weighted, by the inverse of its own covariance. So the sum of squares and
its degrees of freedom do not depend on the datum of either set; the parameters do, as their covariance shows.

The covariance is factorised at the start and again only if the solution has rotated so far that convergence is slow.
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
WEAK = "weak: the rotation about ({axis}) is uncertain by {u:.2g} rad; add a point away from that line"
MIRRORED = "mirrored: a mirror image fits better; check the handedness of the axes"
PARAMETERS = {"rigid": 6, "similarity": 7, "affine": 12}
POINTS = {"rigid": 3, "similarity": 3, "affine": 4}
ITERATIONS = 50
STEP = 1e-12  # of the size of the set: rounding limit
FLAT = 1e-9  # of the size of the set: points closer to a line or plane do not determine a rotation about it
NEAR = 1e-2  # of the previous step: above it the factor is recomputed; also the accuracy of the weights
INDEPENDENT = 1e-4  # of a column's length: minimum left after orthogonalisation, for the starting step
WEAK_TURN = 0.1  # rad: above it a rotation is not small, and its covariance only indicative


def motion_columns(points: np.ndarray, pivot: np.ndarray) -> np.ndarray:
    """Derivatives (3n, 7) of coordinates by small translation, rotation and scale.

    points   (n, 3) m
    pivot    (3,) m, fixed by rotation and scale

    Columns: translation x, y, z (1), rotation x, y, z (m/rad, right-hand rule), scale (m). Source: [BAARDA73].

    >>> motion_columns(np.array([[2.0, 0.0, 0.0]]), np.zeros(3))[:, 5]  # turned about z, a point on x moves along y
    array([0., 2., 0.])
    """
    return motions(np.asarray(points, dtype=float), pivot, 1.0)


@dataclass(frozen=True, eq=False)
class Transformation:
    """second = pivot + translation + matrix (first - pivot), with residuals.

    The residuals are second minus its prediction.

    kind                "rigid", "similarity" or "affine"
    pivot               (3,) m, in the axes of the first set; point of reference of the translation
    translation         (3,) m
    matrix              (3, 3): rotation, scale times rotation, or any
    covariance          (6, 6), (7, 7) or (12, 12): translation; then rotation (a further small rotation about the axes
                        of the second set, rad); then scale; or, affine, translation and the matrix row by row
    residual            (n, 3) m
    pvv                 weighted sum of squares
    degrees_of_freedom  3 n less parameters
    iterations          steps taken
    status              "converged", or one line with the problem and the remedy
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
        """Cube root of the volume ratio: 1 for a rigid motion."""
        return float(np.cbrt(np.linalg.det(self.matrix)))

    @property
    def rotation(self) -> np.ndarray:
        """Rotation vector (3,) rad of the rotation nearest to the matrix."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_matrix(_polar(self.matrix)[0]).as_rotvec()

    @property
    def variance_factor(self) -> float:
        """Variance factor [pvv] / degrees of freedom, expectation 1.

        It is nan without redundancy.
        """
        return self.pvv / self.degrees_of_freedom if self.degrees_of_freedom else float("nan")

    @property
    def converged(self) -> bool:
        """True for a transformation without a problem."""
        return self.status == CONVERGED

    def require_converged(self) -> "Transformation":
        """Return this transformation, or raise EstimationError with its status."""
        if self.status != CONVERGED:
            raise EstimationError(self.status)
        return self

    def apply(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) m transformed from the first set's axes to the second's."""
        return self.pivot + self.translation + (np.asarray(points, dtype=float) - self.pivot) @ self.matrix.T

    def about(self, pivot: np.ndarray) -> "Transformation":
        """The same transformation with another pivot (3,) m.

        Translation and covariance follow.

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
        """Rotation (3,) rad and strain (6,) xx yy zz yz xz xy, with covariance (9, 9).

        Strain is stretch less one. The matrix is rotation times stretch (polar decomposition), so the strain refers to
        the axes of the first set and is zero for a rotation of any size. The rotation's covariance is as in
        `covariance`.
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
        """Covariance (9, 9) of the matrix elements, row by row."""
        if self.kind == "affine":
            return self.covariance[3:, 3:]
        # row 3 i + j of the matrix depends on the parameters as component i of the image of unit vector j
        image = _columns(self.kind, np.eye(3), self.matrix)[:, 3:].reshape(3, 3, -1)
        slope = image.transpose(1, 0, 2).reshape(9, -1)
        return slope @ self.covariance[3:, 3:] @ slope.T


def _six(tensor: np.ndarray) -> np.ndarray:
    return np.array([tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))])


def _polar(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and symmetric stretch of a matrix (polar decomposition)."""
    u, s, vt = np.linalg.svd(matrix)
    return u @ vt, (vt.T * s) @ vt


def _columns(kind: str, arm: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Derivatives (3n, p) of pivot + translation + matrix @ arm by the parameters."""
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
    """Best unweighted matrix (rotation, or scale times rotation) between two sets, and mirror flag.

    first, second   (n, 3) m
    with_scale      True fits a change of scale too

    Always a proper rotation, also of coplanar points; the flag is True if an improper one fits better.
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
    """Best transformation between two sets of points, with full covariance.

    first               (n, 3) m, n at least 3 (affine 4)
    second              (n, 3) m, the same points in the same order
    kind                "rigid" (6 parameters), "similarity" (7) or "affine" (12)
    covariance_first    (3n, 3n) m^2, may be singular; None: the first set is exact
    covariance_second   likewise; both None: equal weights of 1 m, so multiply the resulting covariance by its
                        variance factor
    cross               (3n, 3n) m^2, covariance of the first (rows) with the second (columns), if any
    pivot               (3,) m, in the first set's axes; default the centroid
    names               n, for errors

    Starts from the closed form, then Gauss-Newton on the Gauss-Helmert model: the derivatives are taken at adjusted
    points, so that the result is the maximum likelihood solution for any noise of the first set. Singular covariances:
    see the top of this file. A rigid motion of networks with free scale is refused: fit a similarity. Raises
    EstimationError for inconsistent sets or undetermined parameters, which are named.

    Source: [KABSCH76], [UMEYAMA91] (start); [POPE72] (derivatives at adjusted observations); [RAO73] section 4i.
    """
    covariance = PlaceCovariances(covariance_first, covariance_second, cross)
    if covariance_first is None and covariance_second is None:
        covariance = PlaceCovariances(second=np.tile(np.eye(3), (len(first), 1, 1)))
    return adjusted_motion(first, second, covariance, kind=kind, pivot=pivot, names=names)[0]


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
    """Transformation as `fit_transformation`, and the final linear estimate.

    extra   (3n,) m^2, additional variance of the second set

    Each step solves the linear model for the remaining conditions, misclosure = covariance times weighted residuals and
    columns' weighted residuals = 0, so that a factor from a nearby state gives the same solution. The weights P of the
    estimate are of the last factor, accurate to NEAR; everything else is of the final state.
    """
    x, y, coordinate_names = _checked(first, second, kind, names)
    covariances = covariance.checked(len(x))
    pivot = x.mean(axis=0) if pivot is None else np.asarray(pivot, dtype=float)
    smallest = STEP * max(float(np.abs(x - pivot).max()), float(np.abs(y - pivot).max()))
    if kind == "affine":
        arm = x - x.mean(axis=0)
        matrix, mirrored = np.linalg.lstsq(arm, y - y.mean(axis=0), rcond=None)[0].T, False
    else:
        matrix, mirrored = closed_form(x, y, with_scale=kind == "similarity")
    translation = np.mean(y - pivot - (x - pivot) @ matrix.T, axis=0)
    matrix, translation = _with_point_blocks(kind, x - pivot, y - pivot, covariances, matrix, translation)
    adjusted, weighted, iterations, used = x, np.zeros(x.size), 0, 0
    before = step = np.inf
    model = None
    while step >= smallest and iterations < ITERATIONS:
        iterations += 1
        misclosure = (y - pivot - translation - (x - pivot) @ matrix.T).ravel()
        columns = _columns(kind, adjusted - pivot, matrix)
        if model is None or (used > 1 and step > NEAR * before):
            model, used = None, 0  # frees its memory first
            model = FactoredModel.of(
                columns,
                covariances.difference(len(x), matrix, extra),
                parameters=_names(kind),
                rows=coordinate_names,
                overwrite=True,
            )
        used += 1
        remaining = misclosure - covariances.difference_times(matrix, weighted[:, None], extra)[:, 0]
        more, change = model.solve(remaining, -columns.T @ weighted)
        weighted = weighted + more
        before, step = step, float(np.abs(columns @ change).max())
        at = matrix
        adjusted = x + covariances.pull(at, weighted).reshape(-1, 3)
        translation = translation + change[:3]
        matrix = _stepped(kind, at, change[3:])
    assert model is not None
    gain, spread_of = model.refined(columns, lambda a: covariances.difference_times(at, a, extra))
    status = NOT_CONVERGED.format(step=step, iterations=iterations)
    if step < smallest:
        status = _status(kind, spread_of, mirrored or np.linalg.det(matrix) < 0.0)
    free = x.size - columns.shape[1]
    linear = LinearEstimate(
        estimate=change,
        covariance=spread_of,
        gain=gain,
        weighted_residual=weighted,
        pvv=float(misclosure @ weighted),
        degrees_of_freedom=free,
        design=columns,
        model=model,
    )
    motion = Transformation(
        kind=kind,
        pivot=pivot,
        translation=translation,
        matrix=matrix,
        covariance=spread_of,
        residual=misclosure.reshape(-1, 3),
        pvv=linear.pvv,
        degrees_of_freedom=free,
        iterations=iterations,
        status=status,
    )
    return motion, linear


def _with_point_blocks(
    kind: str, x: np.ndarray, y: np.ndarray, covariances: PlaceCovariances, matrix: np.ndarray, translation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Better start: one step with each point weighted by its own covariance block.

    x, y   (n, 3) m, from the pivot

    Matrix and translation are returned unchanged if a block is singular or the step is undetermined.
    """
    try:
        half = np.linalg.inv(np.linalg.cholesky(covariances.blocks(len(x), matrix)))
    except np.linalg.LinAlgError:
        return matrix, translation
    rows = (half @ _columns(kind, x, matrix).reshape(len(x), 3, -1)).reshape(x.size, -1)
    misclosure = (half @ (y - translation - x @ matrix.T)[:, :, None]).ravel()
    size = np.linalg.norm(rows, axis=0)
    base, triangle = np.linalg.qr(rows / size)
    if np.abs(np.diag(triangle)).min() < INDEPENDENT:
        return matrix, translation
    step = np.linalg.solve(triangle, base.T @ misclosure) / size
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


def weak_axis(covariance: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Axis (3,) of an undetermined rotation and its u, rad; None for none.

    covariance   (6, 6) or more, translation then rotation
    """
    values, vectors = np.linalg.eigh(covariance[3:6, 3:6])
    return (vectors[:, -1], float(values[-1] ** 0.5)) if values[-1] > WEAK_TURN**2 else None


def _status(kind: str, covariance: np.ndarray, mirrored: bool) -> str:
    if mirrored:
        return MIRRORED
    if kind != "affine":
        weak = weak_axis(covariance)
        if weak is not None:
            return WEAK.format(axis=", ".join(f"{v:.3f}" for v in weak[0]), u=weak[1])
    return CONVERGED


def _checked(
    first: np.ndarray, second: np.ndarray, kind: str, names: Sequence[str] | None
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Validated float arrays of both sets, and coordinate names."""
    if kind not in PARAMETERS:
        raise EstimationError(f"unknown kind {kind!r} (expected one of {', '.join(PARAMETERS)})")
    x, y = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if x.ndim != 2 or x.shape[1] != 3 or x.shape != y.shape or not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise EstimationError(f"points have shapes {x.shape} and {y.shape}, expected (n, 3) twice, all finite")
    labels = list(names) if names is not None else [f"point {i}" for i in range(len(x))]
    if len(labels) != len(x):
        raise EstimationError(f"{len(labels)} names for {len(x)} points")
    some = ", ".join(labels[:4]) + (" ..." if len(labels) > 4 else "")
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
    return x, y, [f"{name} {axis}" for name in labels for axis in "xyz"]
