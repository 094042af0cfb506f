"""Site whose telescope bends by its structural model: places of its points in any posture.

A point at rest, where its record has it, is carried by the rigid telescope and then by the model: x = D N x_rest, N the
first order of [PARKER04] section 2.6 with the site's own constants, D the second. D is the model's deformed transform
after the inverse of its rigid one, so that a model moves a site's points by what it bends alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from catseye.constants import DEGREE, MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.geometry.frames.frame import Transforms
from catseye.records.site.folder import SiteFolder
from catseye.records.site.target import FeedArmRanger, TargetRow
from catseye.records.site.triplet import TripletRecord
from catseye.reduction.site.motion import ground_from
from catseye.reduction.structure.antenna import Antenna, antenna_of
from catseye.reduction.structure.displacement import BodyPoint, displacements, frame_of_body, site_points

Folder = TypeVar("Folder", bound=SiteFolder)
Typed = TypeVar("Typed", TargetRow, TripletRecord, FeedArmRanger)
MOST_REMEMBERED = 64
LOWEST_DEG, HIGHEST_DEG = 5.0, 95.0  # elevations of a telescope that moves


@dataclass(frozen=True, eq=False)
class SiteBending:
    """Bending of a site's telescope; a `reduction.site.motion.Bending`.

    antenna        the model
    points         name: point of the telescope, at rest
    temperature_c  of the structure
    """

    antenna: Antenna
    points: Mapping[str, BodyPoint]
    temperature_c: float

    def body(self, name: str) -> str:
        """Name shared by points that move as one: a frame of the model; "" on the ground.

        A point of a group that moves in its frame is a body of its own.
        """
        point = self.points.get(name)
        if point is None:
            return ""
        return name if point.group and self._moves(point.group) else point.frame

    def frame_of(self, part: str) -> str:
        """Frame of the model that carries a body of the site: "arm", "dish" or "alidade"."""
        return frame_of_body(self.antenna, part)

    def _moves(self, group: str) -> bool:
        record = next(g for g in self.antenna.record.group if g.name == group)
        return group in self.antenna.motions or record.shifts is not None

    def motion(self, body: str, azimuth: ArrayLike, elevation: ArrayLike) -> Transforms:
        """Motion (...) of a body away from the rigid telescope, ground axes.

        body               from `body`
        azimuth, elevation   (...) rad

        Raises ValidityError outside the model's range.

        Source: [PARKER04] section 2.6, second order.
        """
        at = TelescopePosture(azimuth, elevation, self.temperature_c)
        point = self.points.get(body)
        frame = body if point is None else point.frame
        moved = self.antenna.ground_from(frame, at)
        if point is not None:
            row = self.antenna.groups[point.group].names.index(body)
            inner = self.antenna.in_frame(point.group, at)[..., row, :] - self.antenna.groups[point.group].position[row]
            moved = moved @ Transforms(frame, frame, np.eye(3), inner)
        return moved @ self.antenna.ground_from(frame, at, deformed=False).inverse()


@dataclass(frozen=True, eq=False)
class RememberedBending:
    """Bending that remembers its last motions: many points of one body are asked for at the same instants.

    bending   that it asks
    """

    bending: SiteBending
    _last: dict[tuple[str, tuple[int, ...], bytes], Transforms] = field(default_factory=dict, repr=False)

    @property
    def antenna(self) -> Antenna:
        """Antenna by the structural model."""
        return self.bending.antenna

    def body(self, name: str) -> str:
        """Name shared by points that move as one: `SiteBending.body`."""
        return self.bending.body(name)

    def frame_of(self, part: str) -> str:
        """Frame of the model for a body: `SiteBending.frame_of`."""
        return self.bending.frame_of(part)

    def motion(self, body: str, azimuth: ArrayLike, elevation: ArrayLike) -> Transforms:
        """Motion (...) of a body: `SiteBending.motion`."""
        angles = np.stack(np.broadcast_arrays(np.asarray(azimuth, dtype=float), np.asarray(elevation, dtype=float)))
        key = body, angles.shape, angles.tobytes()
        if key not in self._last:
            while len(self._last) >= MOST_REMEMBERED:
                del self._last[next(iter(self._last))]
            self._last[key] = self.bending.motion(body, azimuth, elevation)
        return self._last[key]


def bending_of(site: SiteFolder) -> SiteBending | None:
    """Bending of a site's telescope by its structural model; None without one.

    Raises InputError for a model that does not fit the site: a frame that is missing, no point that moves.
    """
    if site.structure is None:
        return None
    antenna = antenna_of(site.structure)
    points, _ = site_points(antenna, site, ("*",))
    return SiteBending(antenna, {point.name: point for point in points}, site.structure.usual_temperature_c)


def refuse_narrow_model(bending: RememberedBending) -> None:
    """Raise InputError for a model that does not hold in every posture that the telescope can have."""
    low, high = bending.antenna.record.elevation_deg
    if low > LOWEST_DEG or high < HIGHEST_DEG:
        raise InputError(
            f"structural model: it holds from elevation {low:g} to {high:g} deg (expected {LOWEST_DEG:g} to "
            f"{HIGHEST_DEG:g} for a telescope that moves)"
        )


def displaced_site(site: Folder) -> Folder:
    """Site with typed positions and axes where its model has them at its posture.

    site   or campaign; itself without a structural model

    A position with an uncertainty of its own gets the model's added; the mounts of the arm's rangers turn with it.
    Raises ValidityError outside the model's range.

    Source: [PARKER04] section 2.6: coordinates of the targets from the telescope model.
    """
    bending = bending_of(site)
    if bending is None:
        return site
    record = site.site.campaign
    azimuth, elevation = record.azimuth_deg * DEGREE, record.elevation_deg * DEGREE
    at = TelescopePosture(azimuth, elevation, bending.temperature_c)
    moving = list(bending.points.values())
    blocks = displacements(bending.antenna, moving, at).covariance[0]
    u_mm = {p.name: float(np.sqrt(np.trace(q) / 3.0)) / MILLIMETRE for p, q in zip(moving, blocks, strict=True)}
    inside: dict[tuple[str, str], Transforms] = {}  # from a file's frame to itself, by body

    def motion_in_file(name: str, frame: str) -> Transforms | None:
        body = bending.body(name)
        if body and (body, frame) not in inside:
            nominal = ground_from(site, frame, azimuth, elevation)
            inside[body, frame] = nominal.inverse() @ bending.motion(body, azimuth, elevation) @ nominal
        return inside.get((body, frame))

    def displaced(record: Typed, name: str, frame: str, place: str, axes: tuple[str, ...]) -> Typed:
        moved = motion_in_file(name, frame)
        if moved is None:
            return record
        where = moved.points(np.array(getattr(record, place)) * MILLIMETRE) / MILLIMETRE
        values: dict[str, object] = {place: tuple(where.tolist())}
        for key in axes:
            if getattr(record, key) is not None:
                values[key] = tuple(moved.directions(getattr(record, key)).tolist())
        if record.u_position_mm is not None:
            values["u_position_mm"] = float(np.hypot(record.u_position_mm, u_mm[name]))
        return record.model_copy(update=values)

    targets = {n: displaced(t, n, t.frame, "position_mm", ("normal",)) for n, t in site.targets.items()}
    triplets = {
        n: displaced(t, t.ball.target, t.frame, "nominal_position_mm", ("normal", "axis"))
        for n, t in site.triplets.items()
    }
    rangers = tuple(
        displaced(r, r.name, "reflector", "nominal_scan_point_mm", ("mount_z", "mount_y")) for r in site.feedarm.ranger
    )
    arm = site.feedarm.model_copy(update={"ranger": rangers})
    return replace(site, targets=targets, triplets=triplets, feedarm=arm)
