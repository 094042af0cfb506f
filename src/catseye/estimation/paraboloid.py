"""The paraboloid of known focal length that fits points best: where it stands, how far each point lies off it."""

from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError
from catseye.geometry.frame import Transform
from catseye.geometry.rotation import from_vector, skew

FREE = 5  # a turn about its own axis leaves a paraboloid unchanged
CONVERGED_STEP = 1e-10  # m and rad: a tenth of a nanometre at a metre's arm
ITERATIONS = 30


@dataclass(frozen=True, eq=False)
class ParaboloidFit:
    """A paraboloid's place relative to a nominal frame, and the points' deviations from it.

    translation          (3,) m, of the vertex, in the outer frame
    rotation             (3,) rad, rotation vector about the nominal vertex, in the outer frame; none about the axis
    covariance           (6, 6), translation then rotation, from the points' covariance; singular about the axis
    frame                outer frame from the fitted paraboloid's frame
    local                (k, 3) m, the points in the fitted paraboloid's frame
    deviation            (k,) m, normal to the surface, positive towards the focus
    deviation_covariance (k, k) m^2, from the points' covariance, the fit's own uncertainty included
    """

    translation: np.ndarray
    rotation: np.ndarray
    covariance: np.ndarray
    frame: Transform
    local: np.ndarray
    deviation: np.ndarray
    deviation_covariance: np.ndarray


def fit_paraboloid(
    points: np.ndarray, covariance: np.ndarray, nominal: Transform, focal_length: float
) -> ParaboloidFit:
    """Least squares of the normal deviations, unweighted, over translation and the two tilts.

    points         (k, 3) m, in the frame `nominal.to`, at least 5
    covariance     (3k, 3k) m^2, of the points; it does not weigh them, it is carried through
    nominal        outer frame from the nominal paraboloid's: vertex at its origin, axis along its z
    focal_length   m, held

    Unweighted, because the surface's own errors, some tenths of a millimetre, are larger than the points' uncertainty.
    The deviation is (z - r^2/4f) / sqrt(1 + r^2/4f^2), which differs from the distance to the nearest point of the
    surface by deviation^2 / 8f at most: 2 nm for a millimetre on f = 60 m. Raises EstimationError for fewer than five
    points and for points that do not hold the five parameters.
    """
    points = np.asarray(points, dtype=float)
    k = len(points)
    if k < FREE:
        raise EstimationError(f"a paraboloid of known focal length needs {FREE} points, {k} given")
    tilts = nominal.rotation[:, :2]  # its x and y axes in the outer frame
    translation, turn = np.zeros(3), np.zeros(2)
    for _ in range(ITERATIONS):
        local, normal, deviation = _deviation(points, nominal, translation, tilts @ turn, focal_length)
        arm = points - nominal.translation - translation
        design = np.concatenate([normal, -np.einsum("ki,kij,jt->kt", normal, skew(arm), tilts)], axis=1)
        scale = np.linalg.norm(design, axis=0)
        orthogonal, triangle = np.linalg.qr(design / scale)
        if np.min(np.abs(np.diag(triangle))) < 1e-10:
            raise EstimationError(
                f"{k} points do not hold the paraboloid: they lie on one line or circle about its axis"
            )
        gain = np.linalg.solve(triangle, orthogonal.T) / scale[:, None]
        step = gain @ deviation
        translation, turn = translation + step[:3], turn + step[3:]
        if np.max(np.abs(step)) < CONVERGED_STEP:
            break
    else:
        raise EstimationError(f"the paraboloid did not settle in {ITERATIONS} iterations; last step {step} m, rad")
    local, normal, deviation = _deviation(points, nominal, translation, tilts @ turn, focal_length)
    blocks = covariance.reshape(k, 3, k, 3)
    along = np.einsum("ki,kimj,mj->km", normal, blocks, normal)
    expand = np.zeros((6, FREE))
    expand[:3, :3], expand[3:, 3:] = np.eye(3), tilts
    rest = np.eye(k) - design @ gain
    carried = expand @ gain
    rotation = from_vector(tilts @ turn)
    return ParaboloidFit(
        translation=translation,
        rotation=tilts @ turn,
        covariance=carried @ along @ carried.T,
        frame=Transform(nominal.to, nominal.from_, rotation @ nominal.rotation, nominal.translation + translation),
        local=local,
        deviation=deviation,
        deviation_covariance=rest @ along @ rest.T,
    )


def _deviation(
    points: np.ndarray, nominal: Transform, translation: np.ndarray, rotation: np.ndarray, focal_length: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points in the paraboloid's frame, unit normals in the outer frame, deviations along them."""
    axes = from_vector(rotation) @ nominal.rotation
    local = (points - nominal.translation - translation) @ axes
    slope = local[:, :2] / (2.0 * focal_length)
    length = np.sqrt(1.0 + np.sum(slope**2, axis=1))
    normal = np.concatenate([-slope, np.ones((len(points), 1))], axis=1) / length[:, None]
    height = local[:, 2] - np.sum(local[:, :2] ** 2, axis=1) / (4.0 * focal_length)
    return local, normal @ axes.T, height / length
