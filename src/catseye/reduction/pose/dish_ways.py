"""Comparison of catseye's estimates of the dish's pose.

They differ by the fitted model. All are in ground axes about the nominal vertex. A paraboloid and a rigid body
share the direction of the dish's axis; only points determine a turn about that axis, and a free focal length
absorbs part of an offset dish's turn.
"""

from dataclasses import dataclass

import numpy as np

from catseye.errors import EstimationError, InputError
from catseye.records.network.solved_points import SolvedPoints
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.pose.pose import pose_of_group
from catseye.reduction.site.places import nominal_frame
from catseye.reduction.site.posture import axis_lean
from catseye.reduction.surface.shape import LitAperture, Prisms, ShapeSettings, shape_of


@dataclass(frozen=True, eq=False)
class DishEstimate:
    """One estimate of the dish's pose.

    command       that prints it
    fitted        to which data, with which free parameters
    translation   (3,) m, of the nominal vertex, ground axes
    rotation      (3,) rad, rotation vector, ground axes
    u             (6,) their standard uncertainties; zero for a turn that is not observed
    axis          (2,) rad, tilt of the dish's axis: across elevation, towards larger azimuth, and in elevation
    u_axis        (2,) rad
    """

    command: str
    fitted: str
    translation: np.ndarray
    rotation: np.ndarray
    u: np.ndarray
    axis: np.ndarray
    u_axis: np.ndarray


def dish_ways(reduction: Reduction) -> tuple[DishEstimate, ...]:
    """All estimates from the night's points; none without a dish."""
    surface, campaign = reduction.surface, reduction.campaign
    if surface is None:
        return ()
    lean = axis_lean(*np.radians([campaign.site.campaign.azimuth_deg, campaign.site.campaign.elevation_deg]))
    names = surface.names
    rows = reduction.coordinates.rows(names)
    prisms = Prisms(
        names,
        reduction.coordinates.x[rows],
        reduction.coordinates.joint.of_points(rows),
        nominal_frame(campaign),
        campaign.site.campaign.name,
    )
    aperture = LitAperture.of(campaign.site.paraboloid)
    many = f"paraboloid through {len(names)} prisms"
    fit = surface.fit
    ways = [
        _estimate("catseye reduce", f"{many}, focal length held", fit.translation, fit.rotation, fit.covariance, lean)
    ]
    for free, text in (
        (("vertex", "axis"), f"{many}, focal length held, each weighted by its share of the aperture"),
        (("vertex", "axis", "focal-length"), f"{many}, focal length free"),
    ):
        try:
            shape = shape_of(prisms, aperture, ShapeSettings(free)).fit
        except EstimationError:
            continue
        command = "catseye surface" + ("" if "focal-length" in free else " --free vertex,axis")
        ways.append(_estimate(command, text, shape.translation, shape.rotation, shape.covariance[:6, :6], lean))
    try:
        group = pose_of_group(solved_points(reduction), None, campaign, group="dish")
    except (InputError, EstimationError):
        return tuple(ways)
    body = group.pose
    text = f"{len(body.names)} points as one body against their design"
    return (*ways, _estimate("catseye pose", text, body.translation, body.rotation, body.covariance, lean))


def solved_points(reduction: Reduction) -> SolvedPoints:
    """Points of a reduced night for a pose.

    As `catseye reduce --out` writes them and `catseye pose` reads them.
    """
    coordinates, posture = reduction.coordinates, reduction.campaign.site.campaign
    angles = (float(np.radians(posture.azimuth_deg)), float(np.radians(posture.elevation_deg)))
    names = tuple(coordinates.points)
    return SolvedPoints(
        file=posture.name,
        campaign=posture.name,
        names=names,
        x=coordinates.x,
        covariance=coordinates.joint,
        posture=angles,
        hashes=reduction.campaign.hashes,
        unchecked=coordinates.unchecked,
    )


def _estimate(
    command: str, fitted: str, translation: np.ndarray, rotation: np.ndarray, covariance: np.ndarray, lean: np.ndarray
) -> DishEstimate:
    u = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    u_axis = np.sqrt(np.einsum("ai,ij,aj->a", lean, covariance[3:6, 3:6], lean))
    return DishEstimate(
        command=command,
        fitted=fitted,
        translation=translation,
        rotation=rotation,
        u=u,
        axis=lean @ rotation,
        u_axis=u_axis,
    )
