"""Change of a surface between two epochs.

The dish's motion by all coordinates of its prisms, and the remaining deformation. The motion comes from the prisms
themselves, not from paraboloids through them: a turn of an offset dish about its centre of curvature leaves nearly
the same paraboloid but for astigmatism, which a fitted paraboloid therefore takes for a turn. The prisms' motion
along the surface, some 20 mm for such a turn, separates them.
"""

from dataclasses import dataclass, replace

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.least_squares.covariance import JointPoints
from catseye.estimation.shapes.paraboloid import cosine
from catseye.estimation.shapes.place_covariances import rotate_in_place
from catseye.geometry.frames.rotation import from_vector, skew, to_vector
from catseye.optics.aperture import cells
from catseye.optics.zernike import zernike
from catseye.reduction.surface.shape import (
    Expansion,
    Gain,
    LitAperture,
    MeanSquare,
    Prisms,
    ShapeSettings,
    expansion_of,
    gains_of,
    mean_square,
)

FEWEST = 6  # prisms common to both epochs
ITERATIONS = 20
SETTLED = 1e-11  # m and rad


@dataclass(frozen=True, eq=False)
class Change:
    """Difference second minus first epoch.

    first, second         the epochs' prisms
    names                 k prisms of both
    local                 (k, 3) m, first epoch, nominal paraboloid's frame
    motion                (6,) m and rad, of the dish against its nominal posture: translation, rotation about the
                          nominal vertex, reflector axes
    motion_covariance     (6, 6)
    deviation             (k,) m, along the normal, above zero towards the focus
    deviation_covariance  (k, k) m^2
    half_path             (k,) m
    weights, places       as in `SurfaceShape`
    """

    first: Prisms
    second: Prisms
    aperture: LitAperture
    settings: ShapeSettings
    names: tuple[str, ...]
    local: np.ndarray
    motion: np.ndarray
    motion_covariance: np.ndarray
    deviation: np.ndarray
    deviation_covariance: np.ndarray
    half_path: np.ndarray
    weights: np.ndarray
    places: np.ndarray
    expansion: Expansion
    square: MeanSquare
    gains: tuple[Gain, ...]


def change_between(first: Prisms, second: Prisms, aperture: LitAperture, *, settings: ShapeSettings) -> Change:
    """Change of a surface between two epochs.

    Each is in its own nominal posture.

    first, second   at least six prisms of the same names
    aperture        of the design
    settings        terms, illumination and frequencies; nothing of the paraboloid is fitted

    The motion is least squares of all three coordinates, each prism by the inverse of its own covariance; the full
    covariances are propagated. The epochs are taken as independent. Raises EstimationError for
    fewer prisms, and for prisms that do not determine a motion.
    """
    at = {name: row for row, name in enumerate(second.names)}
    rows = [row for row, name in enumerate(first.names) if name in at]
    names = tuple(first.names[row] for row in rows)
    if len(names) < FEWEST:
        raise EstimationError(
            f"{first.source} and {second.source} have {len(names)} prisms in common (expected {FEWEST} at least)"
        )
    one, first_covariance = _own_frame(first, rows)
    two, second_covariance = _own_frame(second, [at[name] for name in names])
    covariance = _sum(first_covariance, second_covariance)
    motion, columns, gain = _motion(one, two, _blocks(covariance, len(names)))
    moved = from_vector(motion[3:]).T
    displacement = (two - motion[:3]) @ moved.T - one
    f = aperture.focal_length
    slope = one[:, :2] / (2.0 * f)
    normal = np.column_stack([-slope, np.ones(len(one))]) * cosine(one, f)[:, None]
    deviation = np.einsum("ki,ki->k", normal, displacement)
    propagated = _through(covariance, normal, columns, gain)
    places, cos = aperture.unit(one), cosine(one, f)
    weights = cells(places, edge_db=settings.taper_db)
    half, half_covariance = deviation * cos, propagated * cos[:, None] * cos
    plain = ShapeSettings((), settings.taper_db, settings.frequencies, settings.terms, settings.numbering)
    expansion = expansion_of(
        places, half, weights=weights, covariance=half_covariance, along=half_covariance,
        design=np.zeros((len(names), 0)), settings=plain,
    )  # fmt: skip
    undetermined = np.full_like(expansion.joint, np.nan)
    expansion = replace(
        expansion,
        share=_motion_share(expansion, places, weights, normal=normal, cos=cos, columns=columns, gain=gain),
        joint=undetermined,
        joint_covariance=np.outer(undetermined, undetermined),
    )
    square = mean_square(half, half_covariance, weights)
    return Change(
        first=first,
        second=second,
        aperture=aperture,
        settings=plain,
        names=names,
        local=one,
        motion=motion,
        motion_covariance=_sandwich(gain, covariance),
        deviation=deviation,
        deviation_covariance=propagated,
        half_path=half,
        weights=weights,
        places=places,
        expansion=expansion,
        square=square,
        gains=gains_of(half, weights, square, frequencies=settings.frequencies),
    )


def _motion_share(
    expansion: Expansion,
    places: np.ndarray,
    weights: np.ndarray,
    *,
    normal: np.ndarray,
    cos: np.ndarray,
    columns: np.ndarray,
    gain: np.ndarray,
) -> np.ndarray:
    """Share (t,) of each term's square that the motion absorbs.

    When the surface moves by it along its normals.
    """
    values = zernike(expansion.terms, places[:, 0], places[:, 1])
    moved = (normal[:, :, None] * (values / cos[:, None])[:, None, :]).reshape(-1, values.shape[1])
    rest = values - np.einsum("ki,kij->kj", normal, columns) @ (gain @ moved) * cos[:, None]
    return 1.0 - weights @ rest**2 / (weights @ values**2)


def _own_frame(prisms: Prisms, rows: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Some prisms in the nominal paraboloid's frame, with covariance."""
    turn = prisms.nominal.rotation
    points = (prisms.points[rows] - prisms.nominal.translation) @ turn
    covariance = prisms.covariance
    if isinstance(covariance, JointPoints):
        return points, rotate_in_place(covariance.block(np.array(rows)), turn.T)
    if covariance.ndim == 3:
        return points, turn.T @ covariance[rows] @ turn
    at = (3 * np.array(rows)[:, None] + np.arange(3)).ravel()
    return points, rotate_in_place(covariance[np.ix_(at, at)], turn.T)


def _sum(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Sum of two covariances.

    Each full (3k, 3k) or a block per point (k, 3, 3); full where one of them is.
    """
    if first.ndim == second.ndim:
        return first + second
    full, blocks = (first, second) if first.ndim == 2 else (second, first)
    total = full.copy()
    for k, block in enumerate(blocks):
        total[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += block
    return total


def _blocks(covariance: np.ndarray, k: int) -> np.ndarray:
    if covariance.ndim == 3:
        return covariance
    return np.einsum("kikj->kij", covariance.reshape(k, 3, k, 3))


def _motion(one: np.ndarray, two: np.ndarray, blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Motion (6,), its columns (k, 3, 6), and its gain (6, 3k).

    Columns in the first epoch's axes; gain from displacements.
    """
    try:
        weight = np.linalg.inv(blocks)
    except np.linalg.LinAlgError as problem:
        raise EstimationError("a prism's covariance is singular: give each coordinate an uncertainty") from problem
    columns = np.concatenate([np.broadcast_to(np.eye(3), (len(one), 3, 3)), -skew(one)], axis=2)
    pulled = np.einsum("kia,kij->akj", columns, weight)
    normal = np.einsum("akj,kjb->ab", pulled, columns)
    scale = np.sqrt(np.diag(normal))
    scaled = normal / np.outer(scale, scale)
    if not np.linalg.cond(scaled) < 1e12:
        raise EstimationError(f"{len(one)} prisms do not determine a motion: they lie on one line")
    gain = np.linalg.solve(scaled, pulled.reshape(6, -1) / scale[:, None]) / scale[:, None]
    motion = np.zeros(6)
    for _ in range(ITERATIONS):
        turn = from_vector(motion[3:])
        displacement = (two - motion[:3]) @ turn - one  # turned back into the first epoch's axes
        step = gain @ displacement.ravel()
        # a small turn on top of the present one, in the moved axes
        motion = np.concatenate([motion[:3] + turn @ step[:3], to_vector(turn @ from_vector(step[3:]))])
        if np.max(np.abs(step)) < SETTLED:
            return motion, columns, gain
    raise EstimationError(f"the motion did not settle in {ITERATIONS} iterations; last step {np.max(np.abs(step)):.2g}")


def _sandwich(gain: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """gain covariance gain^T, (6, 6)."""
    if covariance.ndim == 2:
        return gain @ covariance @ gain.T
    parts = gain.reshape(len(gain), -1, 3)
    return np.einsum("aki,kij,bkj->ab", parts, covariance, parts, optimize=True)


def _through(covariance: np.ndarray, normal: np.ndarray, columns: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Covariance (k, k), m^2, of normal displacements minus the motion."""
    k = len(normal)
    lever = np.einsum("ki,kij->kj", normal, columns)  # (k, 6)
    if covariance.ndim == 3:
        along = np.diag(np.einsum("ki,kij,kj->k", normal, covariance, normal))
        parts = gain.reshape(6, k, 3)
        cross = np.einsum("aki,kij,kj->ak", parts, covariance, normal, optimize=True)
    else:
        blocks = covariance.reshape(k, 3, k, 3)
        along = np.einsum("ki,kimj,mj->km", normal, blocks, normal, optimize=True)
        cross = np.einsum("ari,rimj,mj->am", gain.reshape(6, k, 3), blocks, normal, optimize=True)
    mixed = lever @ cross
    return along - mixed - mixed.T + lever @ _sandwich(gain, covariance) @ lever.T
