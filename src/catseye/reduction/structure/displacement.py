"""Displacement of targets and rangers of the telescope by a structural model.

A displacement is the place by the model minus the place of the rigid telescope in the same posture: the second order
of [PARKER04] section 2.6 minus the first. Its uncertainty is the model's: the coefficients' covariance and what the
model leaves in any one posture; not that of the sheet's places, which are common to both.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.geometry.frames.frame import Transforms
from catseye.records.site.folder import SiteFolder
from catseye.reduction.site.bodies import bodies_of
from catseye.reduction.site.places import places_of
from catseye.reduction.structure.antenna import Antenna
from catseye.verdict import Verdict

FEED_ARM = "feed_arm"
GROUND = "ground"


@dataclass(frozen=True, eq=False)
class BodyPoint:
    """Point of the telescope at rest.

    name       of the target or ranger
    kind       "target" or "ranger"
    frame      of the model, which carries it
    group      of the model that it belongs to; "" without one
    position   (3,) m, in the frame's nominal axes
    """

    name: str
    kind: str
    frame: str
    group: str
    position: np.ndarray


@dataclass(frozen=True, eq=False)
class ModelDisplacements:
    """Displacements of n points in p postures.

    antenna      the model
    posture      (p,)
    points       n
    rigid        (p, n, 3) m, ground frame: places of the rigid telescope
    ground       (p, n, 3) m, displacements, ground axes
    body         (p, n, 3) m, the same, axes of the frame that carries the point
    covariance   (p, n, 3, 3) m², ground axes
    body_covariance   (p, n, 3, 3) m², axes of the frame
    unmoved      names of a site's points on the ground, which no model moves
    """

    antenna: Antenna
    posture: TelescopePosture
    points: tuple[BodyPoint, ...]
    rigid: np.ndarray
    ground: np.ndarray
    body: np.ndarray
    covariance: np.ndarray
    body_covariance: np.ndarray
    unmoved: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the n targets and rangers."""
        return tuple(point.name for point in self.points)

    @property
    def places(self) -> np.ndarray:
        """Places (p, n, 3) m by the model, ground frame."""
        return np.asarray(self.rigid + self.ground)

    @property
    def exact(self) -> bool:
        """True if no coefficient has an uncertainty."""
        return not any(np.any(motion.covariance) for motion in self.antenna.motions.values())

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on u and on points, for the reader."""
        notes = []
        if self.exact:
            notes.append("The model's coefficients have no covariance: u is what it leaves in any one posture.")
        alone = sum(not point.group for point in self.points)
        if alone and any(group.shifts is not None for group in self.antenna.record.group):
            notes.append(f"{alone} points are in no group of the model: they move with their frame, by no own shifts.")
        if self.unmoved:
            notes.append(f"{len(self.unmoved)} points stand on the ground, which the model does not move.")
        return tuple(notes)

    @property
    def verdict(self) -> Verdict:
        """Verdict: postures outside the model's range were refused."""
        return Verdict("good", "all postures lie within the model's range")


def model_points(antenna: Antenna, patterns: Sequence[str] = ()) -> tuple[BodyPoint, ...]:
    """Points of the model's groups.

    antenna    the model
    patterns   names, or patterns such as "ZEG*"; all points without

    Raises InputError for a pattern that no point has.
    """
    points = [
        BodyPoint(name, "target", group.frame, group.group, group.position[i])
        for group in antenna.groups.values()
        for i, name in enumerate(group.names)
    ]
    return _chosen(points, patterns, "the structural model")


def site_points(
    antenna: Antenna, site: SiteFolder, patterns: Sequence[str] = ()
) -> tuple[tuple[BodyPoint, ...], tuple[str, ...]]:
    """Targets and moving rangers of a site, on the model's frames; and names of those on the ground.

    antenna    the model; its frame and group count for a name that it has
    site       its records, whose places count: what they put far above the dish is on the feed arm
    patterns   names, or patterns; without, all except the prisms of the dish's surface

    Raises InputError for a pattern that no moving point has, and for a point on a frame that the model lacks.
    """
    modelled = {point.name: point for point in model_points(antenna)}
    record = site.site.campaign
    at = TelescopePosture(record.azimuth_deg * DEGREE, record.elevation_deg * DEGREE, 0.0)
    places = places_of(site)
    triplet_frames = {name: triplet.frame for triplet in site.triplets.values() for name in triplet.targets}
    bodies = bodies_of(site, triplet_frames | {name: row.frame for name, row in site.targets.items()})
    points: list[BodyPoint] = []
    unmoved: list[str] = []
    inward: dict[str, Transforms] = {}  # from the ground, by frame
    for name, place in sorted(places.items()):
        frame = frame_of_body(antenna, bodies.get(name) or place.body)
        frame, group = (modelled[name].frame, modelled[name].group) if name in modelled else (frame, "")
        if frame == GROUND:
            unmoved.append(name)
        elif patterns or not (name in site.targets and site.targets[name].shapes_dish):
            if frame not in inward:
                inward[frame] = antenna.ground_from(frame, at, deformed=False).inverse()
            kind = "ranger" if name in site.rangers else "target"
            points.append(BodyPoint(name, kind, frame, group, inward[frame].points(place.start)))
    if not patterns:
        return tuple(points), tuple(unmoved)
    return _chosen(points, patterns, f"the moving points of {record.name}"), ()


def frame_of_body(antenna: Antenna, body: str) -> str:
    """Frame of the model that carries a body of a site."""
    if body == "arm":
        return FEED_ARM if FEED_ARM in antenna.parents else "reflector"
    return {"dish": "reflector", "alidade": "alidade"}.get(body, GROUND)


def _chosen(points: Sequence[BodyPoint], patterns: Sequence[str], what: str) -> tuple[BodyPoint, ...]:
    """Points by patterns, in their own order; InputError for a pattern without a point."""
    for pattern in patterns:
        if not any(fnmatchcase(point.name, pattern) for point in points):
            some = ", ".join(point.name for point in points[:8]) + (", ..." if len(points) > 8 else "")
            raise InputError(f"{what}: no point is {pattern!r} (it has {some or 'none'})")
    chosen = [p for p in points if not patterns or any(fnmatchcase(p.name, pattern) for pattern in patterns)]
    if not chosen:
        raise InputError(f"{what}: no point moves with the telescope (expected points in its groups, or a site)")
    return tuple(chosen)


def displacements(
    antenna: Antenna, points: Sequence[BodyPoint], posture: TelescopePosture, *, unmoved: Sequence[str] = ()
) -> ModelDisplacements:
    """Displacements of points by the model, with covariance.

    antenna   the model
    points    n, of its frames
    posture   (p,) of the telescope
    unmoved   names of points on the ground, for the notes

    Raises ValidityError outside the model's range.

    Source: [PARKER04] section 2.6, second order; [JCGM102] section 6.2 for the covariance.
    """
    a, e, t = np.broadcast_arrays(*np.atleast_1d(posture.azimuth, posture.elevation, posture.temperature_c))
    shape = (len(a), len(points), 3)
    rigid, ground, body = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    covariance, body_covariance = np.zeros((*shape, 3)), np.zeros((*shape, 3))
    owners = {(point.frame, point.group): None for point in points}
    for k in range(len(a)):
        at = TelescopePosture(a[k], e[k], t[k])
        for frame, group in owners:
            rows = [i for i, point in enumerate(points) if (point.frame, point.group) == (frame, group)]
            rest = np.array([points[i].position for i in rows])
            chosen = [antenna.groups[group].names.index(points[i].name) for i in rows] if group else []
            nominal = antenna.ground_from(frame, at, deformed=False)
            moved = rest
            if group:
                moved = rest + antenna.in_frame(group, at)[chosen] - antenna.groups[group].position[chosen]
            rigid[k, rows] = nominal.points(rest)
            ground[k, rows] = antenna.ground_from(frame, at).points(moved) - rigid[k, rows]
            body[k, rows] = ground[k, rows] @ nominal.rotation
            slopes = antenna.derivatives(frame, moved, at)
            fresh = np.zeros(len(rows))
            if group:
                if group in antenna.motions:
                    slopes[group] = antenna.group_derivatives(group, at)[group][chosen]
                fresh = antenna.u_points(group)[chosen] ** 2 - antenna.groups[group].u[chosen] ** 2
            total = np.maximum(fresh, 0.0)[:, None, None] * np.eye(3)
            for name, slope in slopes.items():
                if name in antenna.motions:
                    spread = antenna.motions[name].six_covariance(at)
                    total = total + slope @ spread @ np.swapaxes(slope, -1, -2)
            covariance[k, rows] = total
            body_covariance[k, rows] = nominal.rotation.T @ total @ nominal.rotation
    return ModelDisplacements(
        antenna=antenna,
        posture=TelescopePosture(a, e, t),
        points=tuple(points),
        rigid=rigid,
        ground=ground,
        body=body,
        covariance=covariance,
        body_covariance=body_covariance,
        unmoved=tuple(unmoved),
    )
