"""Rigid motions of dish and feed arm, and the beam.

Motions since the reference epoch, in the reflector frame: x to the right when looking along the beam (along rising
azimuth), z along the beam, y away from the feed arm, downwards at low elevation. A small turn w of the dish moves the
beam by w x z = (w_y, -w_x, 0); elevation rises along -y, so that the beam's elevation changes by w_x and its azimuth,
times cos E, by w_y.

A feed at the prime focus that moves by d against the dish changes the path to a point of the surface, in the direction
s from the focus, by -d.s; the plane that fits these changes over the aperture tilts the wavefront, and the beam with
it, by its slopes u: azimuth times cos E by u_x, elevation by -u_y (`beam_per_feed_shift`). For a shallow dish that is
-d/f; an offset section deviates less in its plane of symmetry, and turns the beam for a shift along the axis, too. The
aperture is weighted evenly: a feed's taper is not known here. Corrections are offsets with their sign changed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError
from catseye.estimation.shapes.motions import motions
from catseye.geometry.antenna.beam_deviation import aperture, prime_focus_tilt
from catseye.records.site.folder import SiteFolder
from catseye.reduction.epoch.parameter import ParameterKind, point_parameters
from catseye.reduction.live.state import Carried

FEWEST = 3  # points of a body
BISECTIONS = 30


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """Rigid motion of a body since the reference epoch.

    Small angles, reflector frame.

    body          "dish" or "arm"
    pivot         (3,) m, point of rotation: the vertex, or the focus
    translation   (3,) m, of the pivot
    rotation      (3,) rad, right-hand rule
    covariance    (6, 6), translation then rotation
    chi2, degrees_of_freedom   of the points against a rigid motion
    points        number of points
    bending       m, of each coordinate beyond the measurement uncertainty (the body is not rigid); in the covariance
    """

    body: str
    pivot: Array
    translation: Array
    rotation: Array
    covariance: Array
    chi2: float
    degrees_of_freedom: int
    points: int
    bending: float = 0.0


@dataclass(frozen=True, eq=False)
class LivePose:
    """Pose of dish and feed since the reference epoch, and the beam.

    dish, feed    motions; None with fewer than three points, see `missing`
    offset        (3,) rad, rad, m: of the beam in azimuth times cos E and elevation, of the feed along the axis
                  (positive: too far from the dish); NaN if unknown
    covariance    (3, 3)
    missing       reason why something is unknown, else ""
    """

    dish: BodyMotion | None
    feed: BodyMotion | None
    offset: Array
    covariance: Array
    missing: str

    @property
    def correction(self) -> Array:
        """Correction (3,) that removes the offset: its opposite."""
        return -self.offset


def live_pose(state: Carried, bodies: Mapping[str, str], site: SiteFolder) -> LivePose:
    """Motions of dish and feed since the reference epoch.

    bodies   point: "dish", "arm", ...
    """
    focal_length = site.site.paraboloid.focal_length_mm * MILLIMETRE
    vertex, focus = np.zeros(3), np.array([0.0, 0.0, focal_length])
    names = {b: _referenced(state, [n for n in bodies if bodies[n] == b]) for b in ("dish", "arm")}
    points = [*names["dish"], *names["arm"]]
    few = [f"{b} has {len(n)} points with a reference position" for b, n in names.items() if len(n) < FEWEST]
    unknown = np.full(3, np.nan), np.full((3, 3), np.nan)
    if few:
        return LivePose(None, None, *unknown, f"{', '.join(few)} (expected {FEWEST} or more)")
    change, covariance, places = _change(state, points)
    k = len(names["dish"])
    try:
        dish, by_dish, dish_bends = _rigid("dish", places[:k], change[: 3 * k], covariance[: 3 * k, : 3 * k], vertex)
        feed, by_feed, feed_bends = _rigid("arm", places[k:], change[3 * k :], covariance[3 * k :, 3 * k :], focus)
    except EstimationError as problem:
        return LivePose(None, None, *unknown, str(problem))
    to_motion = np.zeros((12, len(change)))
    to_motion[:6, : 3 * k], to_motion[6:, 3 * k :] = by_dish, by_feed
    bending = np.concatenate([np.full(3 * k, dish_bends), np.full(len(change) - 3 * k, feed_bends)])
    joint = to_motion @ (covariance + np.diag(bending)) @ to_motion.T
    # offset = pointing by the dish's turn, and the feed at the focus minus the focus moved by the dish
    by = np.zeros((3, 12))
    at_focus = np.hstack([np.eye(3), motions(focus[None], vertex, 1.0)[:, 3:6]])  # motion of the focus with the dish
    relative = np.hstack([-at_focus, np.eye(3), np.zeros((3, 3))])
    slopes = beam_per_feed_shift(site)
    by[0], by[1] = slopes[0] @ relative, -slopes[1] @ relative
    by[0, 4] += 1.0
    by[1, 3] += 1.0
    by[2] = relative[2]
    motion = np.concatenate([dish.translation, dish.rotation, feed.translation, feed.rotation])
    return LivePose(dish, feed, by @ motion, _positive(by @ joint @ by.T), "")


def beam_per_feed_shift(site: SiteFolder) -> Array:
    """Slopes (2, 3) of the wavefront by feed shift, rad/m.

    Towards x and y, reflector frame: the beam's turn.

    Source: rays of geometrical optics; least squares of a plane over the aperture, all parts alike.
    """
    p = site.site.paraboloid
    f, radius = p.focal_length_mm * MILLIMETRE, p.aperture_radius_mm * MILLIMETRE
    return prime_focus_tilt(aperture(f, np.array(p.aperture_centre_mm) * MILLIMETRE, radius))


def _referenced(state: Carried, names: Sequence[str]) -> list[str]:
    current, reference = state.points(), state.points(ParameterKind.REFERENCE_PLACE)
    return [n for n in names if n in current and n in reference]


def _change(state: Carried, names: Sequence[str]) -> tuple[Array, Array, Array]:
    """Change (3k,), its covariance, and the reference positions (k, 3)."""
    current = state.columns(point_parameters(ParameterKind.POINT, names))
    reference = state.columns(point_parameters(ParameterKind.REFERENCE_PLACE, names))
    p = state.covariance
    cross = p[np.ix_(current, reference)]
    covariance = p[np.ix_(current, current)] + p[np.ix_(reference, reference)] - cross - cross.T
    return state.x[current] - state.x[reference], covariance, state.x[reference].reshape(-1, 3)


def _rigid(body: str, places: Array, change: Array, covariance: Array, pivot: Array) -> tuple[BodyMotion, Array, float]:
    """Rigid motion (6,), matrix (6, 3k) from changes, bending variance, m^2.

    The fit is weighted. A body that bends between epochs is not rigid: each coordinate deviates by more than its
    measurement uncertainty, by the amount that makes the points' chi-square equal to its degrees of freedom. With
    C = V diag(l) V', adding s^2 leaves V as it is. In the reference epoch itself nothing has changed, and nothing is
    uncertain: then all points have equal weight.
    """
    design = motions(places, pivot, 1.0)[:, :6]
    scale = float(np.trace(covariance)) / len(covariance)
    degrees = len(change) - 6
    if scale < 1e-16:
        values, turned, moved = np.ones(len(change)), design, change
        axes = np.eye(len(change))
    else:
        values, axes = np.linalg.eigh(covariance)
        values = np.maximum(values, 0.0) + 1e-6 * scale
        turned, moved = axes.T @ design, axes.T @ change
    size = np.linalg.norm(turned / np.sqrt(values)[:, None], axis=0)
    size[size == 0.0] = 1.0  # a rotation that moves no point
    normal = (turned / values[:, None]).T @ turned / np.outer(size, size)
    if np.linalg.cond(normal) > 1e12:
        raise EstimationError(
            f"{body}: its points lie on a line and do not determine its rotation (expected points beside that line)"
        )

    def solved(bending: float) -> tuple[Array, float]:
        weighted = turned / (values + bending)[:, None]
        gain = np.linalg.solve(weighted.T @ turned, weighted.T)
        residual = moved - turned @ (gain @ moved)
        return gain, float(residual @ (residual / (values + bending)))

    gain, chi2 = solved(0.0)
    bending = 0.0
    if scale >= 1e-16 and degrees > 0 and chi2 > degrees:
        low, high = 0.0, float(moved @ moved)
        for _ in range(BISECTIONS):
            bending = 0.5 * (low + high)
            low, high = (bending, high) if solved(bending)[1] > degrees else (low, bending)
        gain, _ = solved(bending)
    to_motion = gain @ axes.T
    six = to_motion @ change
    spread = to_motion @ covariance @ to_motion.T + bending * to_motion @ to_motion.T
    motion = BodyMotion(
        body=body,
        pivot=pivot,
        translation=six[:3],
        rotation=six[3:],
        covariance=_positive(spread),
        chi2=chi2 if scale >= 1e-16 else 0.0,
        degrees_of_freedom=degrees,
        points=len(places),
        bending=float(np.sqrt(bending)),
    )
    return motion, to_motion, bending


def _positive(covariance: Array) -> Array:
    """Symmetric covariance, negative diagonal entries from rounding set to zero."""
    even = 0.5 * (covariance + covariance.T)
    return np.asarray(even + np.diag(np.maximum(-np.diag(even), 0.0)))
