"""Poses of the antenna's parts from solved points.

Between two epochs, or against the design in a site's records. Groups by name are the bodies of `reduction.site.bodies`:
"dish" (prisms, triplets at the rim), "feed-arm" (its rangers, targets at the arm), "alidade"; "subreflector" are
targets whose names begin with SUB. Any other group is a list of points. Every epoch is first brought into the axes
that carry the group by its commanded posture, so that two epochs at different postures compare: the remainder is the
departure of the real antenna from [PARKER04] eq. 2.44.

Against the design, a prism of the dish is certain only along its normal, within the surface's own u; across it, only to
its mounting or typing: its design place has that covariance, with its foot on the paraboloid as the mean. Other points
have u_position of their records in every direction.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.errors import InputError
from catseye.estimation.least_squares.covariance import JointPoints
from catseye.estimation.shapes.place_covariances import Known, PlaceCovariances, RotatedPoints, rotate_in_place
from catseye.estimation.shapes.pose import Pose, fit_pose
from catseye.geometry.antenna.frames import ground_from_alidade
from catseye.geometry.frames.frame import Transform
from catseye.records.network.solved_points import SolvedPoints
from catseye.records.site.folder import SiteFolder
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.site.bodies import bodies_of
from catseye.reduction.site.places import RangedPoint, nominal_frame, places_of
from catseye.reduction.site.posture import PostureOffset, offset_of

GROUPS = ("dish", "feed-arm", "alidade", "subreflector")
FRAMES = ("ground", "alidade", "reflector")
CARRIES = {"dish": "reflector", "feed-arm": "reflector", "alidade": "alidade", "subreflector": "reflector"}
BODY = {"dish": "dish", "feed-arm": "arm", "alidade": "alidade"}
SUBREFLECTOR = "SUB"  # how names of targets on the subreflector begin
FEWEST = 3
U_SURFACE = 0.3 * MILLIMETRE  # chosen: of a prism off the best paraboloid, along the normal, for an adjusted surface


@dataclass(frozen=True, eq=False)
class GroupPose:
    """Pose with its input.

    group     "dish" and so on, or "points"
    pose      in the requested frame, about the requested pivot
    against   "design", or the name of the first epoch
    places    (n, 3) m, first places of the used points, in the pose's frame
    missing   names of the group absent on one side
    epoch     the later one
    earlier   the earlier one; None against the design
    posture   direction of a part carried by the telescope, minus the commanded posture; None for others
    suspicion probable mistake or point that prevents a rigid motion, as a text; "" for none
    """

    group: str
    pose: Pose
    against: str
    places: np.ndarray
    missing: tuple[str, ...]
    epoch: SolvedPoints
    earlier: SolvedPoints | None = None
    posture: PostureOffset | None = None
    suspicion: str = ""


def at_posture(site: SiteFolder, azimuth: float, elevation: float) -> SiteFolder:
    """Site with the telescope at another posture, rad."""
    campaign = site.site.campaign.model_copy(
        update={"azimuth_deg": azimuth / DEGREE, "elevation_deg": elevation / DEGREE}
    )
    return replace(site, site=site.site.model_copy(update={"campaign": campaign}))


def group_names(group: str, site: SiteFolder) -> tuple[str, ...]:
    """Names of a group's possible points.

    InputError for an unknown or an empty group.
    """
    if group not in GROUPS:
        raise InputError(f"group {group!r} is not one of {', '.join(GROUPS)} (expected one, or points by name)")
    if group == "subreflector":
        names = [n for n in site.targets if n.startswith(SUBREFLECTOR)]
    else:
        frames = {n: t.frame for n, t in site.targets.items()}
        names = [n for n, body in bodies_of(site, frames).items() if body == BODY[group]]
    if not names:
        hint = f" (targets named {SUBREFLECTOR}...)" if group == "subreflector" else ""
        raise InputError(f"the site {site.directory} has no points of the group {group!r}{hint}; name them by points")
    return tuple(sorted(names))


def frame_transform(frame: str, site: SiteFolder) -> Transform:
    """Transform to ground from one of FRAMES, at the site's posture."""
    if frame == "reflector":
        return nominal_frame(site)
    if frame == "alidade":
        return ground_from_alidade(site.site.campaign.azimuth_deg * DEGREE)
    if frame == "ground":
        return Transform("ground", "ground", np.eye(3), np.zeros(3))
    raise InputError(f"frame {frame!r} is not one of {', '.join(FRAMES)}")


def default_pivot(group: str, frame: str, site: SiteFolder) -> np.ndarray | None:
    """Default pivot (3,), m in the frame.

    The vertex for the dish, the focus for arm and subreflector; None: the points' mean.
    """
    focal = site.site.paraboloid.focal_length_mm * MILLIMETRE
    inside = {"dish": (0.0, 0.0, 0.0), "feed-arm": (0.0, 0.0, focal), "subreflector": (0.0, 0.0, focal)}
    if group == "alidade":  # where its axis of azimuth meets the ground's z = 0
        return np.zeros(3)
    if group not in inside:
        return None
    ground = nominal_frame(site).points(inside[group])
    return np.asarray(frame_transform(frame, site).inverse().points(ground))


def pose_of_group(
    later: SolvedPoints,
    earlier: SolvedPoints | None,
    site: SiteFolder,
    *,
    group: str | None = None,
    points: Sequence[str] | None = None,
    frame: str = "ground",
    pivot: np.ndarray | None = None,
    robust: str | None = None,
) -> GroupPose:
    """Motion of a group between epochs, or from its design.

    later     epoch
    earlier   epoch, or None: against the site's design
    site      records; its posture is the later epoch's (`at_posture`)
    group     one of GROUPS, or
    points    names, three or more
    frame     of the answer: one of FRAMES, at the later epoch's posture
    pivot     (3,) m, in that frame; by default that of the group, or the points' mean
    robust    as `estimation.shapes.pose.fit_pose`

    Of a group, points that nothing checks (`SolvedPoints.unchecked`) are left out. Two epochs count as independent:
    shared errors, such as of the monuments' survey and a ranger's zero, make a change more certain than stated. Raises
    InputError where points or postures are missing, EstimationError as `fit_pose`.
    """
    if (group is None) == (points is None):
        raise InputError("a pose needs a group or points by name (expected one of the two)")
    names = tuple(points) if points is not None else group_names(str(group), site)
    site_places = places_of(site)
    unchecked = set() if group is None else {*later.unchecked, *(() if earlier is None else earlier.unchecked)}
    both = set(later.names) & (set(site_places) if earlier is None else set(earlier.names))
    have = [n for n in names if n in both and n not in unchecked]
    missing = tuple(n for n in names if n not in have)
    if points is not None and missing:
        where = "the epoch and the design" if earlier is None else "both epochs"
        raise InputError(f"point {missing[0]!r} is not in {where} (expected points of both)")
    if len(have) < FEWEST:
        raise InputError(f"{len(have)} points of {group or 'the list'} are in both (expected {FEWEST} or more)")
    carrier = CARRIES[group] if group is not None else "ground"
    carrier_from_ground = frame_transform(carrier, site).inverse()
    second, q_second = _into(carrier_from_ground, later, have)
    q_first: Known
    if earlier is None:
        first, q_first = _design(have, site_places, site, carrier_from_ground)
    else:
        before = frame_transform(carrier, _posture_of(earlier, site, carrier)).inverse()
        first, q_first = _into(before, earlier, have)
    pose = fit_pose(
        have, first, second, frame=carrier, covariance=PlaceCovariances(first=q_first, second=q_second), robust=robust
    )
    used = np.isin(have, pose.names)
    to_frame = frame_transform(frame, site).inverse() @ frame_transform(carrier, site)
    result = pose if to_frame.to == to_frame.from_ else pose.in_frame(to_frame)
    new_pivot = pivot if pivot is not None else default_pivot(group or "", frame, site)
    result = result if new_pivot is None else result.about(new_pivot)
    against = "design" if earlier is None else earlier.campaign or earlier.file
    places = first[used] if to_frame.to == to_frame.from_ else to_frame.points(first[used])
    off = _posture_offset(group, pose, carrier_from_ground, later, earlier) if carrier == "reflector" else None
    return GroupPose(
        group=group or "points",
        pose=result,
        against=against,
        places=places,
        missing=missing,
        epoch=later,
        earlier=earlier,
        posture=off,
    )


def _posture_offset(
    group: str | None, pose: Pose, reflector_from_ground: Transform, later: SolvedPoints, earlier: SolvedPoints | None
) -> PostureOffset | None:
    """Direction of a group against the commanded posture.

    None where the epoch has no posture.
    """
    if later.posture is None:
        return None
    turn = reflector_from_ground.rotation.T
    spread = turn @ pose.covariance[3:, 3:] @ turn.T
    offset = offset_of(str(group), turn @ pose.rotation, spread, later.posture)
    return offset if earlier is None else replace(offset, postures=2)


def _posture_of(epoch: SolvedPoints, site: SiteFolder, carrier: str) -> SiteFolder:
    """Site at an epoch's posture; the ground needs none."""
    if carrier == "ground":
        return site
    if epoch.posture is None:
        raise InputError(f"{epoch.file}: its posture is unknown (expected pose.json beside it, or earlier_posture_deg)")
    return at_posture(site, *epoch.posture)


def _into(to_from: Transform, epoch: SolvedPoints, names: Sequence[str]) -> tuple[np.ndarray, Known]:
    """Places (n, 3) of an epoch's points in another frame, with covariance."""
    x = to_from.points(epoch.places(names))
    if isinstance(epoch.covariance, JointPoints):
        return x, RotatedPoints(epoch.covariance.of_points(epoch.rows(names)), to_from.rotation)
    return x, rotate_in_place(epoch.block(names), to_from.rotation)


def _design(
    names: Sequence[str], site_places: dict[str, RangedPoint], site: SiteFolder, to_from: Transform
) -> tuple[np.ndarray, np.ndarray]:
    """Design places (n, 3) and covariances (n, 3, 3), in `to_from.to`.

    Independent from point to point.
    """
    settings = ReductionSettings()
    focal = site.site.paraboloid.focal_length_mm * MILLIMETRE
    on_dish = {n for n, t in site.targets.items() if t.shapes_dish}
    inside = nominal_frame(site)
    x, q = np.zeros((len(names), 3)), np.zeros((len(names), 3, 3))
    for k, name in enumerate(names):
        place = site_places[name]
        u = place.u_typed(settings.u_position) if place.typed else settings.u_position
        spread, where = np.eye(3) * u**2, place.start
        if name in on_dish:
            local = inside.inverse().points(where)
            foot = np.array([*local[:2], float(local[:2] @ local[:2]) / (4.0 * focal)])
            normal = np.array([-local[0], -local[1], 2.0 * focal])
            along = inside.directions(normal / np.linalg.norm(normal))
            where = inside.points(foot)
            spread = spread + (U_SURFACE**2 - u**2) * np.outer(along, along)
        x[k] = to_from.points(where)
        q[k] = to_from.rotation @ spread @ to_from.rotation.T
    return x, q
