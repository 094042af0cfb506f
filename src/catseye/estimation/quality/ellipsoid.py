"""Standard and confidence ellipsoids of points, ellipses in plan and elevation, relative ellipsoids.

Axes are x east, y north, z up. A covariance may be singular (a fixed coordinate has zero variance): its ellipsoid is
then flat. A point without a solution has a covariance of nan, and so are all results. A coordinate that does not exist
has nan in its row and column only: the ellipsoid is that of the others, and its last semi-axes are nan.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtr, chdtri, fdtr, fdtri

from catseye.errors import EstimationError

PLAN = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # east to the right, north up
ROUNDING = 1e-10  # of the largest eigenvalue: a smaller negative one is zero, a larger one invalid


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """Standard ellipsoid: the surface x' C^-1 x = 1.

    semi_axes    (..., 3) m, longest first
    directions   (..., 3, 3): column k is the unit vector of semi-axis k; a rotation (right-handed), the first two
                 columns with their largest component positive
    """

    semi_axes: np.ndarray
    directions: np.ndarray


@dataclass(frozen=True, eq=False)
class Ellipse:
    """Standard ellipse in a plane with axes right and up (in plan: east and north).

    major, minor   (...) m, semi-axes
    bearing        (...) rad of the major axis, clockwise from the axis up (in plan: from north), 0 to pi; 0 of a circle
    """

    major: np.ndarray
    minor: np.ndarray
    bearing: np.ndarray


def _square_roots(values: np.ndarray) -> np.ndarray:
    """Square roots of ascending eigenvalues; negative rounding errors give zero."""
    with np.errstate(invalid="ignore"):
        negative = np.fmin.reduce(values, axis=-1) < -ROUNDING * np.abs(values[..., -1])
    if np.any(negative):
        where = np.unravel_index(np.argmax(negative), negative.shape)
        raise EstimationError(
            f"covariance {', '.join(str(int(i)) for i in where) or 'given'} is invalid: its smallest eigenvalue is "
            f"{values[where][0]:.3g}, its largest {values[where][-1]:.3g}; it must not be negative"
        )
    return np.sqrt(np.where(values < 0.0, 0.0, values))


def _eigen(covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ascending eigenvalues and eigenvectors.

    Values are nan for matrices that are not finite, nan rows first.
    """
    size = covariance.shape[-1]
    missing = np.isnan(np.diagonal(covariance, axis1=-2, axis2=-1))
    pairs = ~(missing[..., :, None] | missing[..., None, :])
    valid = (np.isfinite(covariance) | ~pairs).all(axis=(-2, -1))
    inside = np.where(pairs & valid[..., None, None], covariance, 0.0)
    scale = np.abs(inside).max(axis=(-2, -1))[..., None]
    last = np.where(missing, np.where(scale > 0.0, scale, 1.0), 0.0)  # below all others, and no larger: rounding
    values, vectors = np.linalg.eigh(inside - last[..., None] * np.eye(size))
    defined = valid[..., None] & (np.arange(size) >= missing.sum(axis=-1)[..., None])
    return np.where(defined, values, np.nan), np.where(defined[..., None, :], vectors, np.nan)


def ellipsoid(covariance: np.ndarray) -> Ellipsoid:
    """Standard ellipsoid of each covariance.

    covariance   (..., 3, 3) m^2

    Raises EstimationError for a matrix with a negative eigenvalue. Multiply `semi_axes` by `confidence_scale`.

    Source: [FOERSTNER16] chapter 2, standard ellipse and ellipsoid of the normal distribution.

    >>> ellipsoid(np.diag([4.0, 1.0, 9.0])).semi_axes
    array([3., 2., 1.])
    """
    values, vectors = _eigen(np.asarray(covariance, dtype=float))
    first, second = (_upright(vectors[..., :, k]) for k in (2, 1))
    directions = np.stack([first, second, np.cross(first, second)], axis=-1)
    return Ellipsoid(_square_roots(values)[..., ::-1], directions)


def _upright(vectors: np.ndarray) -> np.ndarray:
    """Vectors with the sign that makes their largest component positive."""
    largest = np.take_along_axis(vectors, np.argmax(np.abs(vectors), axis=-1)[..., None], axis=-1)
    return np.where(largest < 0.0, -vectors, vectors)


def confidence_scale(probability: float, dimensions: int, degrees_of_freedom: float = np.inf) -> float:
    """Factor on the standard ellipsoid (3), ellipse (2) or interval (1) for a coverage probability.

    probability          0 to 1, both ends excluded
    dimensions           1, 2 or 3 (any other number of quantities taken together as well)
    degrees_of_freedom   of the variance factor, if the covariance was multiplied by it; infinite for a-priori ones

    An ellipse in plan with the factor of 3 dimensions is the projection of the ellipsoid, of higher probability.

    Source: [JCGM102] clause 6.5.2 (chi-square; Fisher's F with an estimated variance factor).

    >>> [round(confidence_scale(0.95, d), 4) for d in (1, 2, 3)]
    [1.96, 2.4477, 2.7955]
    """
    if not (0.0 < probability < 1.0 and dimensions >= 1 and degrees_of_freedom > 0.0):
        raise EstimationError(
            f"no confidence region of probability {probability:g} in {dimensions} dimensions with "
            f"{degrees_of_freedom:g} degrees of freedom: expected 0 to 1, 1 or more, more than 0"
        )
    if np.isinf(degrees_of_freedom):
        return float(np.sqrt(chdtri(dimensions, 1.0 - probability)))
    return float(np.sqrt(dimensions * fdtri(dimensions, degrees_of_freedom, probability)))


def contained_probability(scale: float, dimensions: int, degrees_of_freedom: float = np.inf) -> float:
    """Coverage probability of `scale` times the standard region; inverse of `confidence_scale`.

    Source: [JCGM102] clause 6.5.2.

    >>> [round(contained_probability(1.0, d), 4) for d in (1, 2, 3)]
    [0.6827, 0.3935, 0.1987]
    """
    if np.isinf(degrees_of_freedom):
        return float(chdtr(dimensions, scale**2))
    return float(fdtr(dimensions, degrees_of_freedom, scale**2 / dimensions))


def elevation_view(bearing: float) -> np.ndarray:
    """Axes (2, 3) right and up of a view along a horizontal bearing, clockwise from north, rad.

    >>> elevation_view(0.0) + 0.0  # looking north, east is to the right
    array([[1., 0., 0.],
           [0., 0., 1.]])
    """
    return np.array([[np.cos(bearing), -np.sin(bearing), 0.0], [0.0, 0.0, 1.0]])


def projected(covariance: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Covariance (..., 2, 2) in a view: the projection of the ellipsoid.

    covariance   (..., 3, 3) m^2
    view         (2, 3) orthonormal axes to the right and up: PLAN, or `elevation_view`

    Source: [FOERSTNER16] chapter 2, variance propagation.
    """
    return view @ np.asarray(covariance, dtype=float) @ view.T


def ellipse(covariance: np.ndarray) -> Ellipse:
    """Standard ellipse of each (..., 2, 2) covariance, axes right and up.

    Raises EstimationError for a matrix with a negative eigenvalue.

    Source: [FOERSTNER16] chapter 2, standard ellipse.
    """
    covariance = np.asarray(covariance, dtype=float)
    values = _square_roots(_eigen(covariance)[0])
    right, up, cross = covariance[..., 0, 0], covariance[..., 1, 1], covariance[..., 0, 1]
    bearing = np.mod(0.5 * np.arctan2(2.0 * cross, up - right), np.pi)
    return Ellipse(values[..., 1], values[..., 0], bearing)


def horizontal_ellipse(covariance: np.ndarray) -> Ellipse:
    """Standard ellipse in plan of each (..., 3, 3) covariance, bearing clockwise from north.

    >>> e = horizontal_ellipse(np.array([[2.5, 1.5, 0.0], [1.5, 2.5, 0.0], [0.0, 0.0, 9.0]]))  # longest to the NE
    >>> round(float(np.degrees(e.bearing)), 9), round(float(e.major), 9), round(float(e.minor), 9)
    (45.0, 2.0, 1.0)
    """
    return ellipse(np.asarray(covariance)[..., :2, :2])  # not projected: an unknown height leaves the plan known


def relative_covariance(joint: np.ndarray) -> np.ndarray:
    """Covariance (..., 3, 3) of the vector between two points from their joint covariance.

    joint   (..., 6, 6) m^2, first point first

    Source: [FOERSTNER16] chapter 2, variance propagation.
    """
    joint = np.asarray(joint, dtype=float)
    cross = joint[..., :3, 3:]
    return joint[..., :3, :3] + joint[..., 3:, 3:] - cross - np.swapaxes(cross, -1, -2)


def point_uncertainty(covariance: np.ndarray) -> np.ndarray:
    """Helmert's point error (...), m: root of the trace, the same in every frame.

    covariance   (..., d, d) m^2; coordinates that do not exist (nan) add nothing; nan where none exists

    Source: [FOERSTNER16] chapter 4, evaluation of the result.

    >>> float(point_uncertainty(np.diag([4.0, 4.0, 1.0])))
    3.0
    """
    variance = np.diagonal(np.asarray(covariance, dtype=float), axis1=-2, axis2=-1)
    return np.where(np.isnan(variance).all(axis=-1), np.nan, np.sqrt(np.nansum(variance, axis=-1)))


def weakest_direction(joint: np.ndarray) -> tuple[float, np.ndarray]:
    """Standard uncertainty, m, of a network's weakest direction, and that direction.

    joint   (k, k) m^2, joint covariance of k coordinates

    Returns the root of the largest eigenvalue and its unit vector (k,), largest component positive.
    Raises EstimationError where the covariance is not finite.

    Source: [FOERSTNER16] chapter 2, principal axes of the standard ellipsoid.

    >>> u, motion = weakest_direction(np.diag([1.0, 4.0, 1.0, 1.0, 1.0, 1.0]))
    >>> float(u), motion[:3]
    (2.0, array([0., 1., 0.]))
    """
    from scipy.linalg import eigh

    joint = np.asarray(joint, dtype=float)
    if not np.isfinite(joint).all():
        raise EstimationError("no weakest direction of a covariance with nan: a point has no solution; leave it out")
    values, vectors = eigh(joint, subset_by_index=[len(joint) - 1, len(joint) - 1])
    return float(np.sqrt(values[0])), _upright(vectors[:, 0])
