"""Best-fit paraboloid of points: pose, focal length and deviation of every point."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Literal, NamedTuple

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.shapes.surface_field import Roughness
from catseye.geometry.frames.frame import Transform
from catseye.geometry.frames.rotation import from_vector, skew

Free = Literal["vertex", "axis", "focal-length"]
Measure = Literal["normal", "half-path"]
AlongNormals = Callable[[np.ndarray], np.ndarray]
PARAMETERS: dict[str, int] = {"vertex": 3, "axis": 2, "focal-length": 1}
POSE: tuple[Free, ...] = ("vertex", "axis")  # a rotation about its axis leaves a paraboloid unchanged
CONVERGED_STEP = 1e-10  # m and rad: a tenth of a nanometre at a metre's arm
ITERATIONS = 30
SQUARE = 500  # limit of points for full matrix products, which take seconds beyond it
DEPENDENT = 1e-10  # of a column's length: minimum left after orthogonalisation


class ParaboloidStatus(IntEnum):
    """Status of a fitted paraboloid; the reason of its EstimationError."""

    CONVERGED = 0
    TOO_FEW = 1
    UNDETERMINED = 2
    UNSETTLED = 3


TEXTS = {
    ParaboloidStatus.CONVERGED: "converged",
    ParaboloidStatus.TOO_FEW: "fewer points than parameters",
    ParaboloidStatus.UNDETERMINED: "the points do not hold the paraboloid",
    ParaboloidStatus.UNSETTLED: "not settled",
}


@dataclass(frozen=True, eq=False)
class ParaboloidFit:
    """Fitted paraboloid's pose relative to a nominal frame, and the points' deviations from it.

    translation          (3,) m, of the vertex, in the outer frame
    rotation             (3,) rad, rotation vector about the nominal vertex, in the outer frame; zero about the axis
    covariance           (6, 6), translation then rotation, from the points' covariance; singular about the axis
    frame                outer frame from the fitted paraboloid's frame
    local                (k, 3) m, the points in the fitted paraboloid's frame
    deviation            (k,) m, normal to the surface, positive towards the focus
    deviation_covariance (k, k) m^2, from the points' covariance, the fit's own uncertainty included
    focal_length         m, fitted or fixed
    u_focal_length       m, 0 if fixed
    free                 fitted parts
    parameter_covariance (p, p) m and rad: vertex x, y, z along the outer frame's axes, tilts about the nominal
                         paraboloid's x and y, focal length; of these the fitted ones
    normal               (k, 3) unit normals, outer frame
    design               (k, p) decrease of the deviations per unit of the parameters
    gain                 (p, k) parameters from deviations
    along                (k, k) m^2, covariance of the points along their normals, without the fit
    """

    translation: np.ndarray
    rotation: np.ndarray
    covariance: np.ndarray
    frame: Transform
    local: np.ndarray
    deviation: np.ndarray
    deviation_covariance: np.ndarray
    focal_length: float
    u_focal_length: float
    free: tuple[str, ...]
    parameter_covariance: np.ndarray
    normal: np.ndarray
    design: np.ndarray
    gain: np.ndarray
    along: np.ndarray

    @property
    def cos_incidence(self) -> np.ndarray:
        """Cosine (k,) of the incidence of light along the axis: normal's component along it."""
        return cosine(self.local, self.focal_length)

    @property
    def half_path(self) -> np.ndarray:
        """Half-path error (k,) m: deviation times the cosine of the incidence.

        It is half of the shortening of the path to the focus.
        """
        return self.deviation * self.cos_incidence

    @property
    def half_path_covariance(self) -> np.ndarray:
        """Covariance (k, k) m^2 of the half-path errors."""
        c = self.cos_incidence
        return self.deviation_covariance * c[:, None] * c


class PlacedParaboloid(NamedTuple):
    """Fitted paraboloid without covariance; its fields are those of `ParaboloidFit`."""

    free: tuple[str, ...]
    translation: np.ndarray
    rotation: np.ndarray
    focal_length: float
    local: np.ndarray
    normal: np.ndarray
    deviation: np.ndarray
    cos_incidence: np.ndarray
    design: np.ndarray
    gain: np.ndarray


def fit_paraboloid(
    points: np.ndarray,
    covariance: np.ndarray | AlongNormals,
    nominal: Transform,
    *,
    focal_length: float,
    free: Sequence[str] = POSE,
    weights: np.ndarray | None = None,
    measure: Measure = "normal",
) -> ParaboloidFit:
    """Least-squares paraboloid over the free parts of vertex, axis and focal length.

    points         (k, 3) m, in the frame `nominal.to`, at least as many as parameters
    covariance     (3k, 3k) or, points independent of each other, (k, 3, 3) m^2, or a function from unit vectors (k, 3)
                   to the covariance (k, k) along them; not used as weight, only propagated
    nominal        outer frame from the nominal paraboloid's: vertex at its origin, axis along its z
    focal_length   m, fixed, or the start value
    free           of "vertex" (its three coordinates), "axis" (two tilts), "focal-length"; the others are nominal
    weights        (k,) 0 or more, of squares; default 1
    measure        quantity that is squared: the "normal" deviation or the "half-path" error

    Not weighted by the covariance, because the surface errors, some tenths of a millimetre, exceed the points'
    uncertainty. The deviation is (z - r^2/4f) / sqrt(1 + r^2/4f^2), which differs from the distance to the
    surface by at most deviation^2 / 8f: 2 nm for a millimetre on f = 60 m. The half-path error is
    that times cos i = 1 / sqrt(1 + r^2/4f^2). Raises EstimationError for too few points and for points that do not
    determine the parameters.
    """
    placed = place_paraboloid(points, nominal, focal_length=focal_length, free=free, weights=weights, measure=measure)
    tilts = nominal.rotation[:, :2]
    free, normal, design, gain = placed.free, placed.normal, placed.design, placed.gain
    translation, focal = placed.translation, placed.focal_length
    along = covariance_along(covariance, normal)
    expansion = _expansion(free, tilts) @ gain
    parameters = gain @ along @ gain.T
    rotation = from_vector(placed.rotation) @ nominal.rotation
    return ParaboloidFit(
        translation=translation,
        rotation=placed.rotation,
        covariance=expansion @ along @ expansion.T,
        frame=Transform(nominal.to, nominal.from_, rotation, nominal.translation + translation),
        local=placed.local,
        deviation=placed.deviation,
        deviation_covariance=without(along, design, gain),
        focal_length=focal,
        u_focal_length=float(np.sqrt(parameters[-1, -1])) if "focal-length" in free else 0.0,
        free=free,
        parameter_covariance=parameters,
        normal=normal,
        design=design,
        gain=gain,
        along=along,
    )


def with_missing_points(
    fit: ParaboloidFit, missing: np.ndarray, nominal: Transform, *, roughness: Roughness
) -> ParaboloidFit:
    """Fit with the covariance of the paraboloid through its points and missing ones.

    fit         with equal weights of the normal deviations
    missing     (m, 2) m, x and y in the fitted paraboloid's frame
    nominal     outer frame from the nominal paraboloid's, as in the fit
    roughness   of the surface's own deviations

    Of the deviations d at all points, the parameters of all are G d and the fitted ones g d, g 0 at the missing points.
    They differ by H d, H = G - g, wherever the paraboloid is, as H A = 0 of the design A; K being the covariance of d,
    the difference has H K H'. For independent d of variance s^2: s^2 ((A'A)^-1 of the measured less that of all).

    Raises EstimationError as `fit_paraboloid`. Source: for independent deviations [HAUSMAN78] lemma 2.1; for correlated
    ones derived here.
    """
    k = len(fit.local)
    places = np.concatenate([fit.local[:, :2], missing])
    design = np.concatenate([fit.design, design_rows(fit, missing, nominal)])
    difference = _gain(design, np.ones((len(places), 1)), len(places))
    difference[:, :k] -= fit.gain
    smooth = difference @ roughness.covariance(places, places) @ difference.T
    added = smooth + roughness.own**2 * difference @ difference.T
    expansion = _expansion(fit.free, nominal.rotation[:, :2])
    parameters = fit.parameter_covariance + added
    return replace(
        fit,
        covariance=fit.covariance + expansion @ added @ expansion.T,
        deviation_covariance=fit.deviation_covariance + fit.design @ added @ fit.design.T,
        u_focal_length=float(np.sqrt(parameters[-1, -1])) if "focal-length" in fit.free else 0.0,
        parameter_covariance=parameters,
    )


def place_paraboloid(
    points: np.ndarray,
    nominal: Transform,
    *,
    focal_length: float,
    free: Sequence[str] = POSE,
    weights: np.ndarray | None = None,
    measure: Measure = "normal",
) -> PlacedParaboloid:
    """Least-squares paraboloid without its covariance, as `fit_paraboloid` does it and with its arguments."""
    points = np.asarray(points, dtype=float)
    free = ordered(free)
    k, count = len(points), sum(PARAMETERS[name] for name in free)
    weights = np.ones(k) if weights is None else np.asarray(weights, dtype=float)
    if (available := int(np.count_nonzero(weights))) < count:
        what = "a paraboloid of known focal length" if free == POSE else f"a paraboloid of free {', '.join(free)}"
        raise EstimationError(f"{what} needs {count} points, {available} given", reason=ParaboloidStatus.TOO_FEW)
    tilts = nominal.rotation[:, :2]  # its x and y axes in the outer frame
    root = np.sqrt(weights)[:, None]
    translation, turn, focal = np.zeros(3), np.zeros(2), focal_length
    for _ in range(ITERATIONS):
        _, normal, deviation, cos = _deviation(points, nominal, translation, tilts @ turn, focal)
        design = _design(points - nominal.translation - translation, normal, tilts, cos, free)
        scaled = root * (cos[:, None] if measure == "half-path" else 1.0)
        gain = _gain(design, scaled, k)
        step = gain @ deviation
        parts = _parts(step, free)
        translation, turn = translation + parts.get("vertex", 0.0), turn + parts.get("axis", 0.0)
        focal = focal + float(parts["focal-length"][0]) if "focal-length" in free else focal
        if not 0.0 < focal < np.inf:
            raise EstimationError(
                f"the paraboloid's focal length ran to {focal:g} m; hold it, or begin nearer",
                reason=ParaboloidStatus.UNSETTLED,
            )
        if count == 0 or np.max(np.abs(step)) < CONVERGED_STEP:
            break
    else:
        raise EstimationError(
            f"the paraboloid did not settle in {ITERATIONS} iterations; last step {step} m, rad",
            reason=ParaboloidStatus.UNSETTLED,
        )
    local, normal, deviation, cos = _deviation(points, nominal, translation, tilts @ turn, focal)
    return PlacedParaboloid(
        free=free,
        translation=translation,
        rotation=tilts @ turn,
        focal_length=focal,
        local=local,
        normal=normal,
        deviation=deviation,
        cos_incidence=cos,
        design=design,
        gain=gain,
    )


def _parts(step: np.ndarray, free: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Step of the parameters, split by free part."""
    ends = np.cumsum([PARAMETERS[name] for name in free])
    return {name: step[end - PARAMETERS[name] : end] for name, end in zip(free, ends.tolist(), strict=True)}


def ordered(free: Sequence[str]) -> tuple[str, ...]:
    """Free parts in the order of the parameters.

    EstimationError for an unknown name.
    """
    for name in free:
        if name not in PARAMETERS:
            raise EstimationError(f"{name!r} is not a part of a paraboloid (expected {', '.join(PARAMETERS)})")
    return tuple(name for name in PARAMETERS if name in free)


def cosine(local: np.ndarray, focal_length: float) -> np.ndarray:
    """Cosine (k,) of the incidence at points (k, 3) m of a paraboloid's frame: of tan i = r/2f."""
    return 1.0 / np.sqrt(1.0 + np.sum(local[:, :2] ** 2, axis=1) / (2.0 * focal_length) ** 2)


def covariance_along(covariance: np.ndarray | AlongNormals, normal: np.ndarray) -> np.ndarray:
    """Covariance (k, k) m^2 of the points' components along unit vectors.

    covariance   (3k, 3k) or (k, 3, 3) m^2, or a function that gives it
    normal       (k, 3)
    """
    k = len(normal)
    if callable(covariance):
        return covariance(normal)
    if covariance.shape == (k, 3, 3):
        return np.diag(np.einsum("ki,kij,kj->k", normal, covariance, normal))
    blocks = covariance.reshape(k, 3, k, 3)
    return np.einsum("ki,kimj,mj->km", normal, blocks, normal, optimize=True)


def without(covariance: np.ndarray, design: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Residual covariance (1 - design gain) covariance (1 - design gain)^T, (k, k) m^2.

    covariance   (k, k) m^2
    design       (k, p)
    gain         (p, k)
    """
    if len(design) <= SQUARE:  # as a square: never negative, also if nothing is left
        projection = np.eye(len(design)) - design @ gain
        return projection @ covariance @ projection.T
    crossed = design @ (gain @ covariance)
    return covariance - crossed - crossed.T + design @ (gain @ covariance @ gain.T) @ design.T


def design_rows(fit: ParaboloidFit, places: np.ndarray, nominal: Transform) -> np.ndarray:
    """Rows (m, p) of `ParaboloidFit.design` at other places of the fitted surface.

    fit       a fit
    places    (m, 2) m, x and y in the fitted paraboloid's frame
    nominal   outer frame from the nominal paraboloid's, as in the fit
    """
    height = np.sum(places**2, axis=1) / (4.0 * fit.focal_length)
    points = fit.frame.points(np.column_stack([places, height]))
    turn, shift = fit.rotation, fit.translation
    _, normal, _, cos = _deviation(points, nominal, shift, turn, fit.focal_length)
    return _design(points - nominal.translation - shift, normal, nominal.rotation[:, :2], cos, fit.free)


def _gain(design: np.ndarray, scaled: np.ndarray, k: int) -> np.ndarray:
    """Gain (p, k) of the least squares of scaled * (deviation - design parameters)."""
    if not design.shape[1]:
        return np.zeros((0, k))
    rows = scaled * design
    scale = np.linalg.norm(rows, axis=0)
    orthogonal, triangle = np.linalg.qr(rows / scale)
    if np.min(np.abs(np.diag(triangle))) < DEPENDENT:
        raise EstimationError(
            f"{k} points do not hold the paraboloid: they lie on one line or circle about its axis",
            reason=ParaboloidStatus.UNDETERMINED,
        )
    return np.linalg.solve(triangle, (orthogonal * scaled).T) / scale[:, None]


def _design(
    arm: np.ndarray, normal: np.ndarray, tilts: np.ndarray, cos: np.ndarray, free: tuple[str, ...]
) -> np.ndarray:
    """Design (k, p) of the deviations by the parameters.

    A shift lowers the deviation by its component along the normal, a rotation w by that of w x arm.

    A longer focal length f lowers the surface z = r^2/4f by r^2/4f^2 = tan^2 i, so it raises the deviation by
    tan^2 i cos i.
    """
    columns: list[np.ndarray] = []
    if "vertex" in free:
        columns.append(normal)
    if "axis" in free:
        columns.append(-np.einsum("ki,kij,jt->kt", normal, skew(arm), tilts))
    if "focal-length" in free:
        columns.append(-((1.0 - cos**2) / cos)[:, None])
    return np.concatenate(columns, axis=1) if columns else np.zeros((len(arm), 0))


def _expansion(free: tuple[str, ...], tilts: np.ndarray) -> np.ndarray:
    """Translation and rotation vector in the outer frame by the parameters, (6, p)."""
    expansion = np.zeros((6, sum(PARAMETERS[name] for name in free)))
    at = 0
    for name in free:
        if name == "vertex":
            expansion[:3, at : at + 3] = np.eye(3)
        elif name == "axis":
            expansion[3:, at : at + 2] = tilts
        at += PARAMETERS[name]
    return expansion


def _deviation(
    points: np.ndarray, nominal: Transform, translation: np.ndarray, rotation: np.ndarray, focal_length: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points in the paraboloid's frame, unit normals in the outer frame, deviations, cosines."""
    axes = from_vector(rotation) @ nominal.rotation
    local = (points - nominal.translation - translation) @ axes
    slope = local[:, :2] / (2.0 * focal_length)
    length = np.sqrt(1.0 + np.sum(slope**2, axis=1))
    normal = np.concatenate([-slope, np.ones((len(points), 1))], axis=1) / length[:, None]
    height = local[:, 2] - np.sum(local[:, :2] ** 2, axis=1) / (4.0 * focal_length)
    return local, normal @ axes.T, height / length, 1.0 / length
