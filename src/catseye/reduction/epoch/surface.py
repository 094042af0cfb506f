"""Dish points, their fitted paraboloid, and its pose.

The pose is relative to the nominal posture.
"""

from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError
from catseye.estimation.shapes.paraboloid import ParaboloidFit, fit_paraboloid
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.coordinates import AdjustedCoordinates
from catseye.reduction.epoch.dish import dish_prisms
from catseye.reduction.epoch.lines.cycles import MANY
from catseye.reduction.site.places import nominal_frame

FEWEST_LINES = 3  # that place a prism
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
    fit            the paraboloid and the deviations
    focal_length   m, as designed, fixed
    pivot          (3,) m, ground frame: the nominal vertex, about which the rotation turns
    unchecked      prisms of these that an error of one of their lines would move unseen; () where there are enough
                   others
    """

    names: tuple[str, ...]
    fit: ParaboloidFit
    focal_length: float
    pivot: np.ndarray
    unchecked: tuple[str, ...] = ()

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


def fit_surface(campaign: ObservedSite, coordinates: AdjustedCoordinates) -> tuple[DishFit | None, str]:
    """Dish from its prisms, or the reason that there is none.

    Single prisms of the reflector frame; the reason is "" where there is a fit.

    A prism takes part if its lines check each other. Where that leaves too few for a fit, all with three lines do, and
    `unchecked` names those that nothing checks.
    """
    lines = dict(zip(coordinates.points, coordinates.lines.tolist(), strict=True))
    ranged = tuple(name for name in dish_prisms(campaign) if lines.get(name, 0) >= FEWEST_LINES)
    doubtful = frozenset(coordinates.unchecked)
    checked = tuple(name for name in ranged if name not in doubtful)
    fit, missing = _fit(campaign, coordinates, checked)
    return (fit, missing) if fit is not None or len(ranged) == len(checked) else _fit(campaign, coordinates, ranged)


def _fit(
    campaign: ObservedSite, coordinates: AdjustedCoordinates, names: tuple[str, ...]
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
    return DishFit(names, fit, focal_length, nominal.translation, unchecked), ""


def surface_notes(surface: DishFit | None) -> list[str]:
    """Note on prisms of surface and pose that nothing checks."""
    if surface is None or not surface.unchecked:
        return []
    some = ", ".join(surface.unchecked[:MANY]) + " ..." * (len(surface.unchecked) > MANY)
    return [
        f"surface and pose depend on {len(surface.unchecked)} of {len(surface.names)} prisms whose lines do not check "
        f"each other: {some}"
    ]
