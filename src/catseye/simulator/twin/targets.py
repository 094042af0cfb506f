"""True rest places of all targets of a living site, and retroreflectors.

The files have the typed places.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.constants import DEGREE, MILLIMETRE
from catseye.records.site.folder import SiteFolder
from catseye.records.site.retroreflector import GlassForm, RetroreflectorKind
from catseye.records.site.target import FrameName
from catseye.records.site.target import TargetRow as TargetRecord
from catseye.records.site.triplet import TripletPrism, TripletRecord
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.night.head import BENCHMARK_VOLT, USUAL_VOLT
from catseye.simulator.night.structure import tilted, unit
from catseye.simulator.twin.telescope import low_orders

TYPING_MM, MOST_TYPING = 8.0, 2.0  # of each coordinate without a record; clipped at so many sigma
SURFACE_MM, ROUGH_MM = 0.25, 0.15  # normal deviations of the dish: low orders, and from prism to prism
NEAR_SURFACE, BEYOND_RIM = 2.0, 3.0  # m: points nearer to the paraboloid belong to the dish, others to the feed arm
CORNER_RADIUS, BALL_RADIUS = 0.045, 0.050  # m: largest offset of a returned beam


@dataclass(frozen=True, eq=False)
class BodyRetroreflector:
    """Retroreflector in the frame of its body.

    kind         facts of its kind: form of glass, axis
    body         "ground", "alidade", "dish" or "arm"
    rest_place   (3,) m, true
    facing       (3,) unit vector: outward axis; None for a kind without one: any direction
    sizes        m, true: height of the prism; both radii of the ball
    volts        limits of its usual amplitude

    Raises InputError for a kind with an axis that lacks it.
    """

    kind: RetroreflectorKind
    body: str
    rest_place: Array
    facing: Array | None
    sizes: tuple[float, ...]
    volts: tuple[float, float]

    def __post_init__(self) -> None:
        self.kind.axis_of(f"retroreflector on the {self.body}", self.facing)

    @property
    def radius(self) -> float:
        """Largest offset of a returned beam, m."""
        return BALL_RADIUS if self.kind.glass is GlassForm.SPHERES else CORNER_RADIUS


@dataclass(frozen=True, eq=False)
class TrueSurface:
    """Design paraboloid, and the true dish's normal deviations from it.

    focal_length, centre (2,), radius   m
    orders   (6,) m of `low_orders`
    """

    focal_length: float
    centre: Array
    radius: float
    orders: Array

    @staticmethod
    def of(site: SiteFolder, streams: Streams, planted: Planted) -> "TrueSurface":
        p = site.site.paraboloid
        size = planted.gain("surface") * SURFACE_MM * MILLIMETRE / np.sqrt(6.0)
        centre = np.array(p.aperture_centre_mm) * MILLIMETRE
        orders = size * streams("surface").normal(size=6)
        return TrueSurface(p.focal_length_mm * MILLIMETRE, centre, p.aperture_radius_mm * MILLIMETRE, orders)

    def height(self, xy: Array) -> Array:
        """Height z of the design (...) at (..., 2), m."""
        return np.sum(xy**2, axis=-1) / (4.0 * self.focal_length)

    def up(self, xy: Array) -> Array:
        """Unit normals (n, 3) towards the focus at (n, 2), m."""
        return unit(np.column_stack([-xy / (2.0 * self.focal_length), np.ones(len(xy))]))

    def body(self, rest_place: Array) -> str:
        """Body of a reflector-frame point: dish or arm."""
        near = abs(rest_place[2] - self.height(rest_place[:2])) < NEAR_SURFACE
        return "dish" if near and np.hypot(*(rest_place[:2] - self.centre)) < self.radius + BEYOND_RIM else "arm"


@dataclass(frozen=True, eq=False)
class Drawing:
    """Random source of a site's truth."""

    streams: Streams
    planted: Planted
    surface: TrueSurface

    def typed(self, rng: np.random.Generator, u_mm: float | None, shape: int = 3) -> Array:
        """True minus typed coordinates, m."""
        draw = np.clip(rng.normal(size=shape), -MOST_TYPING, MOST_TYPING)
        return self.planted.gain("typing") * (TYPING_MM if u_mm is None else u_mm) * MILLIMETRE * draw

    def body(self, frame: FrameName, rest_place: Array) -> str:
        """Body of a point at rest at (3,), m, in a file's frame."""
        return self.surface.body(rest_place) if frame == "reflector" else frame


def drawing(site: SiteFolder, streams: Streams, planted: Planted) -> Drawing:
    """Drawing of a site's targets: random streams, planted effects, true surface."""
    return Drawing(streams, planted, TrueSurface.of(site, streams, planted))


def retroreflectors(site: SiteFolder, scan_points: Mapping[str, Array], draw: Drawing) -> dict[str, BodyRetroreflector]:
    """All single targets and triplet parts of a site.

    scan_points   true, ground frame, of the rangers from which benchmarks are certified
    """
    drawn = {name: single(record, draw) for name, record in site.targets.items()}
    for record in site.triplets.values():
        drawn |= triplet(record, draw)
    gain = draw.planted.gain("calibration")
    for row in site.benchmarks:
        if row.target in drawn and drawn[row.target].body == "ground" and row.ranger in scan_points:
            station, old = scan_points[row.ranger], drawn[row.target]
            miss = gain * row.u_mm * draw.streams(f"benchmark/{row.target}").normal()
            rest_place = station + unit(old.rest_place - station) * (row.certified_distance_mm + miss) * MILLIMETRE
            drawn[row.target] = BodyRetroreflector(
                kind=old.kind,
                body=old.body,
                rest_place=rest_place,
                facing=old.facing,
                sizes=old.sizes,
                volts=BENCHMARK_VOLT,
            )
    return drawn


def single(record: TargetRecord, draw: Drawing) -> BodyRetroreflector:
    """True single target; on the dish displaced along and off the surface.

    Along it by typing, off it by the deviations.
    """
    rng = draw.streams(f"place/{record.name}")
    miss, rough, lean = draw.typed(rng, record.u_position_mm), rng.normal(), rng.normal(size=3)
    rest_place = np.array(record.position_mm) * MILLIMETRE
    if record.frame == "reflector" and draw.surface.body(rest_place) == "dish":
        surface = draw.surface
        above = rest_place[2] - surface.height(rest_place[:2])
        xy = (rest_place + miss)[None, :2]
        off = low_orders(xy, surface.centre, surface.radius) @ surface.orders
        off = off + draw.planted.gain("surface") * ROUGH_MM * MILLIMETRE * rough
        rest_place = np.array([*xy[0], surface.height(xy[0]) + above]) + off * surface.up(xy)[0]
    else:
        rest_place = rest_place + miss
    facing: Array | None = None
    sizes: tuple[float, ...] = ()
    if record.normal is not None:
        normal = unit(np.array(record.normal))
        facing = unit(normal + np.cross(normal, draw.planted.gain("normals") * 0.1 * DEGREE * lean))
    if record.height_mm is not None:
        u = draw.planted.gain("calibration") * (record.u_height_mm or 0.0)
        sizes = ((record.height_mm + u * rng.normal()) * MILLIMETRE,)
    body = draw.body(record.frame, rest_place)
    volts = USUAL_VOLT["single" if facing is None else "dish" if body == "dish" else "plate"]
    return BodyRetroreflector(
        kind=record.kind, body=body, rest_place=rest_place, facing=facing, sizes=sizes, volts=volts
    )


def triplet(record: TripletRecord, draw: Drawing) -> dict[str, BodyRetroreflector]:
    """True prisms and ball of a triplet, by data sheet and u.

    As `simulator.night.structure.triplet`.
    """
    rng, gain = draw.streams(f"place/{record.triplet}"), draw.planted.gain
    ball = np.array(record.nominal_position_mm) * MILLIMETRE + draw.typed(rng, record.u_position_mm)
    normal = tilted(unit(np.array(record.normal)), gain("normals") * 0.3, rng)
    axis = tilted(unit(np.array(record.axis)), gain("normals") * 0.3, rng)
    axis = unit(axis - axis @ normal * normal)
    u = np.array([record.u_d12_mm, record.u_h_corr_mm, record.u_lateral_mm, record.u_lateral_mm])
    miss = rng.normal(size=4) * u
    d12 = (record.d12_mm + gain("calibration") * miss[0]) * MILLIMETRE
    high = gain("h_corr") * (record.h_corr_mm + gain("calibration") * miss[1]) * MILLIMETRE
    aside = gain("lateral") * MILLIMETRE * (miss[2] * axis + miss[3] * np.cross(normal, axis))
    middle = ball - high * normal - aside
    body = draw.body(record.frame, ball)
    r1, r2 = (
        (r + gain("calibration") * record.ball.u_r_mm * rng.normal()) * MILLIMETRE
        for r in (record.ball.r1_mm, record.ball.r2_mm)
    )

    def prism(side: TripletPrism, sign: float) -> BodyRetroreflector:
        height = (side.height_mm + gain("calibration") * side.u_height_mm * rng.normal()) * MILLIMETRE
        return BodyRetroreflector(
            kind=side.kind,
            body=body,
            rest_place=middle + sign * 0.5 * d12 * axis,
            facing=normal,
            sizes=(height,),
            volts=USUAL_VOLT["plate"],
        )

    return {
        record.left_prism.target: prism(record.left_prism, -1.0),
        record.right_prism.target: prism(record.right_prism, 1.0),
        record.ball.target: BodyRetroreflector(
            kind=record.ball.kind,
            body=body,
            rest_place=ball,
            facing=-normal,
            sizes=(r1, r2),
            volts=USUAL_VOLT["underside"],
        ),
    }
