"""Pointing and focus errors from poses, term by term, with covariance.

Poses are in the reflector frame: x along rising azimuth, z along the beam, y downwards at low elevation. A small turn w
of the dish moves the beam by w x z: azimuth times cos E by w_y, elevation by w_x. A motion against the dish adds the
tilt of its wavefront (`geometry.antenna.beam_deviation`): azimuth by the slope towards x, elevation by minus that
towards y. For a feed at the prime focus the shallow dish's -d/f is the plate scale; the beam deviation factor corrects
it for an aperture of this depth and offset, 0.77 across and 0.55 in the plane of symmetry of 100 m at f = 60 m.

`reduction.live.pose` gives the same offsets for the coordinator's filter state; this is their form for any poses.
"""

from dataclasses import dataclass

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import FrameError, InputError
from catseye.estimation.shapes.place_covariances import rotated_covariance
from catseye.estimation.shapes.pose import Pose, pivot_change, relative_pose
from catseye.geometry.antenna.beam_deviation import (
    ApertureNodes,
    Gregorian,
    aperture,
    prime_focus_tilt,
    subreflector_tilt,
)
from catseye.records.network.solved_points import SolvedPoints
from catseye.records.site.folder import SiteFolder
from catseye.reduction.pose.pose import GroupPose, at_posture, frame_transform

OPTICS = ("prime", "gregorian")
COMPONENTS = ("azimuth times cos E", "elevation", "focus")


@dataclass(frozen=True, eq=False)
class PointingOffset:
    """Beam direction and focus against dish and feed at rest.

    optics       "prime" or "gregorian"
    offset       (3,) rad, rad, m: azimuth times cos E and elevation of the beam, and how much farther from the dish
                 than at rest feed or subreflector are, along the beam
    covariance   (3, 3)
    terms        name: its part (3,) of the offset
    slopes       (2, 3) rad/m, azimuth and elevation of the beam by a shift of feed or subreflector against the dish
    plate_scale  rad/m, of a shallow dish about its vertex: 1/f
    relative     (6,) m and rad, motion of feed or subreflector relative to the dish, about the prime focus
    relative_covariance  (6, 6)
    """

    optics: str
    offset: np.ndarray
    covariance: np.ndarray
    terms: dict[str, np.ndarray]
    slopes: np.ndarray
    plate_scale: float
    relative: np.ndarray
    relative_covariance: np.ndarray

    @property
    def correction(self) -> np.ndarray:
        """Correction (3,) of the offset, its opposite.

        Angles as in `geometry.antenna.pointing_series`.
        """
        return -self.offset

    @property
    def beam_deviation(self) -> np.ndarray:
        """Beam deviation factor (2,), as a share of the plate scale.

        For a shift across, and one in the plane of symmetry.
        """
        return np.array([-self.slopes[0, 0], self.slopes[1, 1]]) / self.plate_scale


def pointing_offset(
    dish: Pose, carried: Pose, site: SiteFolder, *, cross: np.ndarray | None = None, optics: str = "prime"
) -> PointingOffset:
    """Beam and focus from the poses of dish and feed.

    Or of the dish and its subreflector.

    dish      reflector frame
    carried   the feed's (arm's), or the subreflector's with optics "gregorian"; reflector frame
    site      its paraboloid
    cross     (6, 6) covariance of the carried six numbers (rows) with the dish's; None: independent
    optics    "prime" or "gregorian" (`Gregorian`'s chosen parameters; the receiver is fixed to the dish)

    First order in the turns. Raises FrameError for poses in other frames. Source: [RUZE65] for the beam deviation; the
    derivation above and in `geometry.antenna.beam_deviation`.
    """
    if optics not in OPTICS:
        raise InputError(f"optics {optics!r} is not one of {', '.join(OPTICS)}")
    for pose in (dish, carried):
        if pose.frame != "reflector":
            raise FrameError(f"pose in the frame '{pose.frame}', expected 'reflector', the frame of the beam")
    of = site_aperture(site)
    at_focus = carried.about(of.focus)
    mixed = _about(cross, carried, at_focus)
    relative, spread = relative_pose(at_focus, dish, mixed)
    to_dish = _cross_with_dish(at_focus, dish, mixed)
    tilt = np.zeros((2, 6))
    if optics == "prime":
        tilt[:, :3] = prime_focus_tilt(of)
    else:
        tilt = subreflector_tilt(of, Gregorian(), of.focus)
    by_relative = np.vstack([tilt[0], -tilt[1], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])
    by_dish = np.zeros((3, 6))
    by_dish[0, 4] = by_dish[1, 3] = 1.0
    mover = "feed" if optics == "prime" else "subreflector"
    terms = {
        "turn of the dish": by_dish @ np.concatenate([dish.translation, dish.rotation]),
        f"{mover} across the plane of symmetry": by_relative[:, 0] * relative[0],
        f"{mover} in the plane of symmetry": by_relative[:, 1] * relative[1],
        f"{mover} along the beam": by_relative[:, 2] * relative[2],
    }
    if optics == "gregorian":
        terms["turn of the subreflector"] = by_relative[:, 3:] @ relative[3:]
    cross_term = by_relative @ to_dish @ by_dish.T
    covariance = (
        by_relative @ spread @ by_relative.T + by_dish @ dish.covariance @ by_dish.T + cross_term + cross_term.T
    )
    return PointingOffset(
        optics=optics,
        offset=np.asarray(sum(terms.values())),
        covariance=0.5 * (covariance + covariance.T),
        terms=terms,
        slopes=np.asarray(by_relative[:2, :3]),
        plate_scale=1.0 / of.focal_length,
        relative=relative,
        relative_covariance=spread,
    )


def site_aperture(site: SiteFolder) -> ApertureNodes:
    """Paraboloid and aperture of the site."""
    p = site.site.paraboloid
    centre = np.array(p.aperture_centre_mm) * MILLIMETRE
    return aperture(p.focal_length_mm * MILLIMETRE, centre, p.aperture_radius_mm * MILLIMETRE)


def _about(cross: np.ndarray | None, carried: Pose, moved: Pose) -> np.ndarray:
    """Cross covariance after a change of the carried pose's pivot."""
    if cross is None:
        return np.zeros((6, 6))
    return np.asarray(pivot_change(moved.pivot - carried.pivot, carried.motion.matrix) @ cross)


def _cross_with_dish(carried: Pose, dish: Pose, mixed: np.ndarray) -> np.ndarray:
    """Covariance (6, 6) of the relative motion with the dish's pose."""
    return np.asarray(mixed - pivot_change(carried.pivot - dish.pivot, dish.motion.matrix) @ dish.covariance)


def cross_covariance(
    carried: GroupPose, dish: GroupPose, site: SiteFolder, *, earlier: SolvedPoints | None
) -> np.ndarray:
    """Cross covariance (6, 6) of the carried pose (rows) and the dish's.

    From the coordinates' covariance of both epochs.

    carried, dish   poses in the reflector frame
    site            at the later epoch's posture
    earlier         the first epoch, or None: against the design, whose points share nothing

    Both are linear in the changes of their points (`Pose.gain`), and points of one epoch share stations and air.
    """
    total = np.zeros((6, 6))
    for epoch in (dish.epoch, earlier):
        if epoch is not None:
            posture = epoch.posture
            at = site if posture is None else at_posture(site, *posture)
            turn = frame_transform("reflector", at).inverse().rotation
            q = epoch.between(carried.pose.names, dish.pose.names)
            q = rotated_covariance(rotated_covariance(q, turn, columns=True), turn, columns=False)
            total += carried.pose.gain @ q @ dish.pose.gain.T
    return total
