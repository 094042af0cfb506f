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
from catseye.reduction.site.places import nominal_frame

FEWEST_CHECKS = 3  # used shots at a prism before it may shape the dish
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
    """

    names: tuple[str, ...]
    fit: ParaboloidFit
    focal_length: float
    pivot: np.ndarray

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

    A prism takes part with three used shots or more; with fewer its place along the surface's normal is uncertain.
    """
    shots = dict(zip(coordinates.points, coordinates.shots.tolist(), strict=True))
    names = tuple(name for name in dish_prisms(campaign) if shots.get(name, 0) >= FEWEST_CHECKS)
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
    return DishFit(names, fit, focal_length, nominal.translation), ""
