"""Dish points, their fitted paraboloid, and its pose.

The pose is relative to the nominal posture.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError
from catseye.estimation.shapes.paraboloid import (
    POSE,
    ParaboloidFit,
    fit_paraboloid,
    place_paraboloid,
    with_missing_points,
)
from catseye.estimation.shapes.surface_field import SPARE, Roughness, estimate_roughness
from catseye.geometry.frames.frame import Transform
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.coordinates import AdjustedCoordinates
from catseye.reduction.epoch.dish import dish_prisms
from catseye.reduction.epoch.lines.cycles import MANY
from catseye.reduction.site.places import nominal_frame

FEWEST_LINES = 3  # that place a prism
FEWEST_PRISMS = 12  # of which one can stand out, twice what the fit needs
OUTLYING = 10.0  # times the other prisms' scatter about the paraboloid,
OUTLYING_M = 3e-3  # and at least, chosen: panels are set to fractions of a millimetre, a half wavelength is 100 mm
OTHER_FOCUS, OTHER_FOCUS_M = 2.0, 4e-4  # times the rms with a free focal length, and at least: above a set surface's
TRIMMED, TRIMS = 4.0, 10  # times the scatter from which a prism does not place the paraboloid; cap of rounds
NORMAL_SCATTER = 1.4826  # standard deviation over the median magnitude of a normal distribution
UNOBSERVED = "rotation about the dish's own axis: a paraboloid does not show it"


class DishPose(TypedDict):
    """Pose of the dish, for JSON: metres and radians.

    `covariance` of the motion, in `covariance_order`.
    """

    frame: str
    pivot: list[float]
    axis: list[float]
    vertex: list[float]
    focus: list[float]
    translation: list[float]
    rotation: list[float]
    covariance: list[list[float]]
    covariance_order: list[str]
    unobserved: list[str]


@dataclass(frozen=True, eq=False)
class DishFit:
    """Fit of the dish prisms.

    names          of the prisms, in order
    fit            the paraboloid and the deviations; its covariance is of the paraboloid through all dish prisms
    missing        dish prisms of the site that did not take part
    focal_length   m, as designed, fixed
    pivot          (3,) m, ground frame: the nominal vertex, about which the rotation turns
    unchecked      prisms of these that an error of one of their lines would move unseen; () where there are enough
                   others
    outlying       prism: m, deviation from the paraboloid of the others, which scatter by far less
    other_focus    m, focal length that the prisms fit far better than the design; 0 without
    """

    names: tuple[str, ...]
    fit: ParaboloidFit
    focal_length: float
    pivot: np.ndarray
    missing: tuple[str, ...] = ()
    unchecked: tuple[str, ...] = ()
    outlying: Mapping[str, float] = field(default_factory=dict)
    other_focus: float = 0.0

    @property
    def count_text(self) -> str:
        """Number of its prisms, for the user; "45 of 60 prisms" where some did not take part."""
        all_prisms = f" of {len(self.names) + len(self.missing)}" if self.missing else ""
        return f"{len(self.names)}{all_prisms} prisms"

    @property
    def rms(self) -> float:
        """Root mean square of the normal deviations, m."""
        return float(np.sqrt(np.mean(self.fit.deviation**2)))

    @property
    def u_deviation(self) -> np.ndarray:
        """Standard uncertainty of each deviation, (k,) m."""
        return np.sqrt(np.diag(self.fit.deviation_covariance))

    def pose(self) -> DishPose:
        """Pose of the dish, SI units.

        Axis, vertex and focus in the ground frame, and the rigid motion from the nominal posture.
        """
        axis = self.fit.frame.rotation[:, 2]
        vertex = self.fit.frame.translation
        return {
            "frame": "ground",
            "pivot": self.pivot.tolist(),
            "axis": axis.tolist(),
            "vertex": vertex.tolist(),
            "focus": (vertex + self.focal_length * axis).tolist(),
            "translation": self.fit.translation.tolist(),
            "rotation": self.fit.rotation.tolist(),
            "covariance": self.fit.covariance.tolist(),
            "covariance_order": ["translation x", "y", "z", "rotation x", "y", "z"],
            "unobserved": [UNOBSERVED],
        }


def fit_surface(
    campaign: ObservedSite, coordinates: AdjustedCoordinates, *, u_surface: float
) -> tuple[DishFit | None, str]:
    """Dish from its prisms, or the reason that there is none.

    Single prisms of the reflector frame; the reason is "" where there is a fit.

    u_surface   m, scatter of prisms along the normal, where too few took part to show it

    A prism takes part if its lines check each other. Where that leaves too few for a fit, all with three lines do, and
    `unchecked` names those that nothing checks. The surface's deviations at prisms that do not take part are unknown:
    the covariance includes by how much the paraboloid through all may differ.
    """
    lines = dict(zip(coordinates.points, coordinates.lines.tolist(), strict=True))
    ranged = tuple(name for name in dish_prisms(campaign) if lines.get(name, 0) >= FEWEST_LINES)
    doubtful = frozenset(coordinates.unchecked)
    checked = tuple(name for name in ranged if name not in doubtful)
    fit, reason = _fit(campaign, coordinates, checked, u_surface)
    if fit is not None or len(ranged) == len(checked):
        return fit, reason
    return _fit(campaign, coordinates, ranged, u_surface)


def _fit(
    campaign: ObservedSite, coordinates: AdjustedCoordinates, names: tuple[str, ...], u_surface: float
) -> tuple[DishFit | None, str]:
    """Dish through some prisms, or the reason that there is none."""
    nominal = nominal_frame(campaign)
    focal_length = campaign.site.paraboloid.focal_length_mm * MILLIMETRE
    rows = coordinates.rows(names)
    try:
        fit = fit_paraboloid(
            coordinates.x[rows],
            lambda normals: coordinates.joint.along(rows, normals),
            nominal,
            focal_length=focal_length,
        )
    except EstimationError as problem:
        return None, f"no paraboloid: {problem}"
    unchecked = tuple(name for name in names if name in coordinates.unchecked)
    outlying = _outlying(names, coordinates.x[rows], nominal, focal_length=focal_length)
    other = 0.0 if outlying else _other_focus(coordinates.x[rows], fit, nominal)
    missing = tuple(sorted(set(dish_prisms(campaign)).difference(names)))
    typed = np.array([campaign.targets[name].position_mm[:2] for name in missing]).reshape(-1, 2) * MILLIMETRE
    found = DishFit(
        names=names,
        fit=with_missing_points(fit, typed, nominal, roughness=_roughness(fit, u_surface)) if missing else fit,
        focal_length=focal_length,
        pivot=nominal.translation,
        missing=missing,
        unchecked=unchecked,
        outlying=outlying,
        other_focus=other,
    )
    return found, ""


def _roughness(fit: ParaboloidFit, u_surface: float) -> Roughness:
    """Deviations of the surface by the prisms of a fit; as assumed and independent, where they are too few."""
    if len(fit.deviation) < fit.design.shape[1] + SPARE:
        return Roughness(smooth=0.0, length=1.0, own=u_surface)
    return estimate_roughness(fit.local[:, :2], fit.deviation, fit.along, trend=fit.design)


def _outlying(
    names: tuple[str, ...], points: np.ndarray, nominal: Transform, *, focal_length: float
) -> dict[str, float]:
    """Deviations, m, of prisms that stand far off the paraboloid through all that do not."""
    if len(names) < FEWEST_PRISMS:
        return {}
    weights = np.ones(len(names))
    for _ in range(TRIMS):
        try:
            placed = place_paraboloid(points, nominal, focal_length=focal_length, weights=weights)
        except EstimationError:
            return {}
        size, before = np.abs(placed.deviation), weights
        scatter = NORMAL_SCATTER * float(np.median(size[weights > 0.0]))
        weights = (size <= TRIMMED * scatter).astype(float)
        if np.array_equal(weights, before):
            break
    far = np.flatnonzero(size > max(OUTLYING * scatter, OUTLYING_M))
    return {names[k]: float(placed.deviation[k]) for k in far.tolist()}


def _other_focus(points: np.ndarray, fit: ParaboloidFit, nominal: Transform) -> float:
    """Focal length, m, of a paraboloid from which prisms depart far less than from the design; 0 without."""
    rms = float(np.sqrt(np.mean(fit.deviation**2)))
    if len(points) < FEWEST_PRISMS or rms < OTHER_FOCUS_M:
        return 0.0
    try:
        free = place_paraboloid(points, nominal, focal_length=fit.focal_length, free=(*POSE, "focal-length"))
    except EstimationError:
        return 0.0
    return free.focal_length if rms > OTHER_FOCUS * float(np.sqrt(np.mean(free.deviation**2))) else 0.0


def surface_doubts(surface: DishFit | None) -> list[str]:
    """Prisms far off the surface of the others: a wrong sheet moves one so, along its lines."""
    if surface is None or not surface.outlying:
        return []
    some = ", ".join(f"{n} by {d / MILLIMETRE:+.1f} mm" for n, d in list(surface.outlying.items())[:MANY])
    more = f" and {len(surface.outlying) - MANY} more" if len(surface.outlying) > MANY else ""
    return [
        f"prisms stand far off the paraboloid of the others: {some}{more}: see their height_mm, their typed positions "
        "and their panels; the ranges of one place alone do not decide"
    ]


def surface_notes(surface: DishFit | None) -> list[str]:
    """Notes on a focal length that fits better, and on prisms of surface and pose that nothing checks."""
    if surface is None:
        return []
    notes = []
    if len(surface.missing) >= len(surface.names):
        notes.append(
            f"surface and pose follow from {surface.count_text} of the dish: their uncertainties include how much the "
            "surface may deviate at the others"
        )
    if surface.other_focus:
        notes.append(
            f"the prisms fit a focal length of {surface.other_focus / MILLIMETRE:.1f} mm {OTHER_FOCUS:g} times as well "
            f"as the design's {surface.focal_length / MILLIMETRE:.1f} mm, or better: see focal_length_mm in "
            "site.toml; vertex and axis belong to the design's"
        )
    if surface.unchecked:
        some = ", ".join(surface.unchecked[:MANY]) + " ..." * (len(surface.unchecked) > MANY)
        notes.append(
            f"surface and pose depend on {len(surface.unchecked)} of {len(surface.names)} prisms whose lines do not "
            f"check each other: {some}"
        )
    return notes
