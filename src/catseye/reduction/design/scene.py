"""Rangers and targets of a site or of a layout, as a design study varies them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.constants import MILLIMETRE, PPM
from catseye.errors import InputError
from catseye.estimation.design.network import DesignNetwork, RangeVariance, TiedPoints
from catseye.geometry.frames.frame import Transform
from catseye.optics.retroreflector.kinds.kind import RetroreflectorKind
from catseye.records.site.design_layout import DesignLayout
from catseye.records.site.folder import SiteFolder
from catseye.records.site.retroreflector import kind_named
from catseye.records.site.solids import DishRecord, Solids
from catseye.records.site.triplet import TripletRecord
from catseye.reduction.design.vary import Role
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.site.places import RangedPoint, nominal_frame, places_of
from catseye.reduction.steering.visibility import RangeLimits, Retroreflectors, frames_at, visibility

DISH_DEPTH_MM = 50.0  # of a site's own dish behind its surface: panels; less than where the triplets' balls are
SIGMA = 30e-6  # m, of a range, as a coordinator plans with
U_AIR = 0.3 * PPM  # a thermometer's 0.3 °C
GROUND = "ground"


@dataclass(frozen=True)
class DesignPoint:
    """Ranger or target of a design.

    name      of the point
    role      "ranger" or "target"
    place     (3,) m, in its frame
    frame     "ground", "alidade" or "reflector": what carries it
    kind      of retroreflector; None for a ranger
    axis      (3,) outward, in its frame; None without one
    u         (3,) m, prior of its coordinates
    u_zero    m, of a ranger's zero
    body      "arm", "dish", "alidade", "structure"; "" on the ground
    unit      what moves as one: its own name, or its triplet's
    dish      True for a prism that stands for the dish's surface
    """

    name: str
    role: Role
    place: tuple[float, float, float]
    frame: str
    kind: RetroreflectorKind | None
    axis: tuple[float, float, float] | None
    u: tuple[float, float, float]
    u_zero: float
    body: str
    unit: str
    dish: bool = False


@dataclass(frozen=True, eq=False)
class Tie:
    """Tie of a triplet's left prism, right prism and ball, in their frame.

    matrix   (6, 9) rows of its data sheet, divided by their u
    """

    names: tuple[str, str, str]
    frame: str
    normal: Array
    axis: Array
    u_height: float
    u_lateral: float
    u_spacing: float
    u_across: float

    def information(self, turn: Array) -> Array:
        """Information (9, 9) 1/m^2 in the ground frame, by the frame's turn (3, 3) to it."""
        normal, axis = turn @ self.normal, turn @ self.axis
        along = np.outer(normal, normal)
        weight = along / self.u_height**2 + (np.eye(3) - along) / self.u_lateral**2
        ball = np.hstack([-0.5 * np.eye(3), -0.5 * np.eye(3), np.eye(3)])
        across = np.eye(3) - np.outer(axis, axis)
        spacing = np.outer(axis, axis) / self.u_spacing**2 + across / self.u_across**2
        apart = np.hstack([-np.eye(3), np.eye(3), np.zeros((3, 3))])
        return np.asarray(ball.T @ weight @ ball + apart.T @ spacing @ apart)


@dataclass(frozen=True, eq=False)
class DishSurface:
    """Design paraboloid of a site: focal length m, and the aperture's centre (2,) and radius m, reflector frame."""

    focal_length: float
    centre: tuple[float, float]
    radius: float


@dataclass(frozen=True, eq=False)
class DesignScene:
    """All points of a design, and what decides which ranges between them there are.

    name        of the site or layout
    points      rangers and targets
    ties        of triplets
    claim       uncertainty of a range
    u_scale     of the air, common to all ranges
    limits      of usable ranges
    solids      that obstruct beams
    postures    transforms to the ground frame from each frame, one mapping a posture
    labels      name of each posture
    dish        surface for the gain; None without one
    """

    name: str
    points: tuple[DesignPoint, ...]
    ties: tuple[Tie, ...]
    claim: RangeVariance
    u_scale: float
    limits: RangeLimits
    solids: Solids
    postures: tuple[Mapping[str, Transform], ...]
    labels: tuple[str, ...]
    dish: DishSurface | None = None

    @cached_property
    def row(self) -> dict[str, int]:
        """Row of each point by its name."""
        return {point.name: i for i, point in enumerate(self.points)}

    @cached_property
    def places(self) -> Array:
        """Places (n, 3) m, each in its own frame."""
        return np.array([point.place for point in self.points])

    @cached_property
    def rangers(self) -> NDArray[np.int64]:
        """Rows (R,) of the rangers."""
        return np.array([i for i, point in enumerate(self.points) if point.role == "ranger"], dtype=int)

    @cached_property
    def turns(self) -> tuple[Array, ...]:
        """Rotations (n, 3, 3) to the ground frame of each point's frame, one array a posture."""
        return tuple(np.array([frames[p.frame].rotation for p in self.points]) for frames in self.postures)

    @cached_property
    def _origins(self) -> tuple[Array, ...]:
        return tuple(np.array([frames[p.frame].translation for p in self.points]) for frames in self.postures)

    def on_ground(self, posture: int) -> Array:
        """Places (n, 3) m in the ground frame."""
        return np.asarray(np.einsum("nij,nj->ni", self.turns[posture], self.places) + self._origins[posture])

    def with_places(self, places: Array) -> "DesignScene":
        """Scene with its points at other places (n, 3), each in its own frame."""
        moved = tuple(
            point
            if tuple(place) == point.place
            else replace(point, place=(float(place[0]), float(place[1]), float(place[2])))
            for point, place in zip(self.points, places, strict=True)
        )
        return replace(self, points=moved)

    def without(self, names: Sequence[str]) -> "DesignScene":
        """Scene without some points, and without ties that lose one."""
        gone = set(names)
        return replace(
            self,
            points=tuple(point for point in self.points if point.name not in gone),
            ties=tuple(tie for tie in self.ties if not gone & set(tie.names)),
        )

    def with_point(self, point: DesignPoint) -> "DesignScene":
        """Scene with one point more."""
        return replace(self, points=(*self.points, point))

    def network(self, posture: int) -> DesignNetwork:
        """Network of all ranges that are visible in a posture, each once."""
        points = self.on_ground(posture)
        units = tuple(
            TiedPoints(
                tuple(self.row[name] for name in tie.names),
                tie.information(np.asarray(self.postures[posture][tie.frame].rotation)),
            )
            for tie in self.ties
        )
        return DesignNetwork(
            points=points,
            rangers=self.rangers,
            pairs=self._pairs(points, posture),
            claim=self.claim,
            information=np.array([np.diag(1.0 / np.square(point.u)) for point in self.points]),
            u_zero=np.array([self.points[i].u_zero for i in self.rangers]),
            u_scale=self.u_scale,
            units=units,
        )

    def _pairs(self, points: Array, posture: int) -> NDArray[np.int64]:
        """Visible pairs (m, 2): a ranger's index, its target's row.

        Retroreflectors by range, incidence and obstruction; rangers on one moving body see each other.
        """
        rows = np.array([i for i, point in enumerate(self.points) if point.kind is not None], dtype=int)
        kinds = [self.points[i].kind for i in rows]
        axes = [
            None if self.points[i].axis is None else self.turns[posture][i] @ np.array(self.points[i].axis)
            for i in rows
        ]
        table = Retroreflectors.with_axes(
            tuple(self.points[i].name for i in rows), tuple(k for k in kinds if k is not None), points[rows], axes
        )
        stands = {self.points[i].name: points[i] for i in self.rangers}
        seen = visibility(stands, table, self.solids, frames=self.postures[posture], limits=self.limits).seen
        ranger, column = np.nonzero(seen)
        bodies = np.array([self.points[i].body for i in self.rangers])
        both = (bodies[:, None] == bodies) & (bodies[:, None] != "") & ~np.eye(len(bodies), dtype=bool)
        apart = np.linalg.norm(points[self.rangers][:, None] - points[self.rangers], axis=2)
        both &= (apart >= self.limits.near) & (apart <= self.limits.far)
        first, second = np.nonzero(both)
        return np.concatenate(
            [np.stack([ranger, rows[column]], axis=1), np.stack([first, self.rangers[second]], axis=1)]
        )


def scene_of_layout(layout: DesignLayout, solids: Solids, *, claim: RangeVariance | None = None) -> DesignScene:
    """Scene of a layout's file.

    solids   that obstruct beams
    claim    of a range, instead of the file's

    Raises InputError for a solid that a telescope carries.
    """
    moving = next((solid for solid in solids.all if solid.frame != GROUND), None)
    if moving is not None:
        raise InputError(f"{moving.name}: frame = {moving.frame!r} needs a site with a telescope (expected 'ground')")
    points = []
    for rangers in layout.rangers:
        for name, place in zip(rangers.names, rangers.places, strict=True):
            u = 3 * (rangers.u_mm * MILLIMETRE,)
            points.append(_point(name, "ranger", place, u=u, u_zero=rangers.u_zero_mm * MILLIMETRE))
    for targets in layout.targets:
        kind = kind_named(targets.type)
        for name, place in zip(targets.names, targets.places, strict=True):
            point = _point(name, "target", place, u=3 * (targets.u_mm * MILLIMETRE,), u_zero=0.0)
            points.append(replace(point, kind=kind, body="structure"))
    ranges, ground = layout.ranges, Transform(GROUND, GROUND, np.eye(3), np.zeros(3))
    return DesignScene(
        name=layout.name,
        points=tuple(points),
        ties=(),
        claim=claim or RangeVariance(ranges.u_mm * MILLIMETRE, ranges.u_ppm * PPM),
        u_scale=ranges.u_air_ppm * PPM,
        limits=RangeLimits(ranges.near_m, ranges.far_m),
        solids=solids,
        postures=({GROUND: ground},),
        labels=("as it stands",),
    )


def _point(name: str, role: Role, place: Array, *, u: tuple[float, float, float], u_zero: float) -> DesignPoint:
    where = (float(place[0]), float(place[1]), float(place[2]))
    return DesignPoint(
        name=name, role=role, place=where, frame=GROUND, kind=None, axis=None, u=u, u_zero=u_zero, body="", unit=name
    )


def scene_of_site(
    site: SiteFolder,
    solids: Solids,
    *,
    postures: Sequence[tuple[float, float]] = (),
    claim: RangeVariance | None = None,
    dish: bool = False,
    limits: RangeLimits | None = None,
) -> DesignScene:
    """Scene of a site's records.

    solids     that obstruct beams, beside the dish itself
    postures   azimuth and elevation, rad; the record's without
    claim      of a range; 0.03 mm and the site's fluctuation of a path's index without
    dish       True: with all prisms of the dish
    limits     of usable ranges

    Certified distances of benchmarks are not counted: they belong to the monuments as they stand.
    """
    settings = ReductionSettings()
    frame = nominal_frame(site)
    record = (np.radians(site.site.campaign.azimuth_deg), np.radians(site.site.campaign.elevation_deg))
    moved = [_frames(site, *posture) for posture in postures or (record,)]
    labels = [f"azimuth {np.degrees(a):.1f}°, elevation {np.degrees(e):.1f}°" for a, e in postures or (record,)]
    alidade = frames_at(*record)["alidade"]
    frames = {"reflector": frame, "alidade": alidade, GROUND: Transform(GROUND, GROUND, np.eye(3), np.zeros(3))}
    triplet_of = {name: t for t in site.triplets.values() for name in t.targets}
    points = []
    for name, place in sorted(places_of(site).items()):
        shapes = name in site.targets and site.targets[name].shapes_dish
        if shapes and not dish:
            continue
        carrier = _carrier(site, name, place, triplet_of)
        points.append(_site_point(site, place, carrier, frames[carrier], settings, triplet_of, shapes))
    shape, ppm = site.site.paraboloid, site.site.ranging.path_index_fluctuation_ppm
    centre = np.array(shape.aperture_centre_mm) * MILLIMETRE
    return DesignScene(
        name=site.site.campaign.name,
        points=tuple(points),
        ties=tuple(_tie(triplet, settings) for triplet in site.triplets.values()),
        claim=claim or RangeVariance(SIGMA, ppm * PPM),
        u_scale=U_AIR,
        limits=limits or RangeLimits(),
        solids=_with_dish(site, solids),
        postures=tuple(moved),
        labels=tuple(labels),
        dish=DishSurface(
            shape.focal_length_mm * MILLIMETRE,
            (float(centre[0]), float(centre[1])),
            shape.aperture_radius_mm * MILLIMETRE,
        ),
    )


def _with_dish(site: SiteFolder, solids: Solids) -> Solids:
    """Solids with the site's own dish, unless they have one in the reflector's frame."""
    if any(dish.frame == "reflector" for dish in solids.dish):
        return solids
    shape = site.site.paraboloid
    dish = DishRecord(
        name="the dish",
        frame="reflector",
        focal_length_mm=shape.focal_length_mm,
        aperture_centre_mm=shape.aperture_centre_mm,
        aperture_radius_mm=shape.aperture_radius_mm,
        below_mm=DISH_DEPTH_MM,
    )
    return solids.model_copy(update={"dish": (*solids.dish, dish)})


def _frames(site: SiteFolder, azimuth: float, elevation: float) -> dict[str, Transform]:
    """Transforms to ground of a site's frames in a posture."""
    turned = site.site.model_copy(
        update={
            "campaign": site.site.campaign.model_copy(
                update={"azimuth_deg": float(np.degrees(azimuth)), "elevation_deg": float(np.degrees(elevation))}
            )
        }
    )
    return frames_at(azimuth, elevation, nominal_frame(replace(site, site=turned)))


def _carrier(site: SiteFolder, name: str, place: RangedPoint, triplet_of: Mapping[str, TripletRecord]) -> str:
    """Frame that carries a point: the one its record names, and the alidade for what stands high above the ground."""
    if name in site.monuments:
        return GROUND
    if name in triplet_of:
        return triplet_of[name].frame
    if name in site.targets:
        frame = site.targets[name].frame
        return "alidade" if frame == GROUND and place.body == "alidade" else frame
    return "reflector"


def _site_point(
    site: SiteFolder,
    place: RangedPoint,
    carrier: str,
    frame: Transform,
    settings: ReductionSettings,
    triplet_of: Mapping[str, TripletRecord],
    dish: bool,
) -> DesignPoint:
    name = place.name
    local = frame.inverse().points(place.start)
    axis = None if place.axis is None else frame.rotation.T @ place.axis
    u = 3 * (place.u_typed(settings.u_position),)
    ranger = name in site.rangers
    u_zero = 0.0
    if ranger:
        mirror = site.mirror_of(name)
        u_zero = mirror.u_d0_mm * MILLIMETRE
        if name in site.monuments:
            monument, offset = site.monuments[name], mirror.u_offset_mm
            x, y, z = (float(np.hypot(v, offset)) for v in (monument.u_x_mm, monument.u_y_mm, monument.u_z_mm))
            u = (x * MILLIMETRE, y * MILLIMETRE, z * MILLIMETRE)
    return DesignPoint(
        name=name,
        role="ranger" if ranger else "target",
        place=(float(local[0]), float(local[1]), float(local[2])),
        frame=carrier,
        kind=place.kind,
        axis=None if axis is None else (float(axis[0]), float(axis[1]), float(axis[2])),
        u=u,
        u_zero=u_zero,
        body=place.body,
        unit=triplet_of[name].triplet if name in triplet_of else name,
        dish=dish,
    )


def _tie(triplet: TripletRecord, settings: ReductionSettings) -> Tie:
    normal, axis = np.array(triplet.normal), np.array(triplet.axis)
    return Tie(
        names=(triplet.left_prism.target, triplet.right_prism.target, triplet.ball.target),
        frame=triplet.frame,
        normal=normal / np.linalg.norm(normal),
        axis=axis / np.linalg.norm(axis),
        u_height=triplet.u_h_corr_mm * MILLIMETRE,
        u_lateral=triplet.u_lateral_mm * MILLIMETRE,
        u_spacing=triplet.u_d12_mm * MILLIMETRE,
        u_across=triplet.d12_mm * MILLIMETRE * settings.u_plate_normal,
    )
