"""Positions of rangers and retroreflectors in their frames, from a site's records.

A ranger on the ground is in the ground frame, one on the feed arm in the reflector frame: there it is fixed, its counts
for the dish do not change, and it is the Sun and the ground that turn.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import DEGREE, MILLIMETRE
from catseye.geometry.antenna.frames import ground_from_reflector
from catseye.geometry.frames.frame import Transform
from catseye.geometry.mirror.encoder import prime_counts, turned_within, within
from catseye.geometry.mirror.pointing import MirrorStation, counts
from catseye.geometry.mirror.slew import Pace
from catseye.ranger.initialisation import frame_of, local_station
from catseye.ranger.motion_units import acceleration_counts, pace_of, velocity_counts
from catseye.ranger.state import AxisSettings
from catseye.records.night.live import TICK_SECONDS, LivePosture
from catseye.records.site.folder import SiteFolder
from catseye.records.site.mirror import Mirror
from catseye.records.site.retroreflector import RetroreflectorKind
from catseye.records.site.target import FrameName

Frame = Literal["ground", "reflector"]
Part = Literal["dish", "plate", "underside", "structure", "benchmark"]
TYPED = 0.010  # m: u of a coordinate without a stated one, as in the reduction


@dataclass(frozen=True, eq=False)
class Vantage:
    """A ranger's position.

    name        of the ranger
    frame       ground, or reflector for the feed arm
    station     its mirror, in that frame
    mirror      its record: stops, ZRG, tilts
    pace        speed and acceleration of its axes
    """

    name: str
    frame: Frame
    station: MirrorStation
    mirror: Mirror
    pace: Pace

    @property
    def stops(self) -> tuple[float, float]:
        """Azimuth counts, low and high."""
        return float(self.mirror.az_low_limit), float(self.mirror.az_high_limit)

    @property
    def reference(self) -> tuple[float, float]:
        """Counts that point at ZRG."""
        return float(self.mirror.azm_zrg), float(self.mirror.elv_zrg)

    def look(self, points: ArrayLike) -> Array:
        """Counts (..., 2) of its ZY for points (..., 3), m, own frame.

        Direct within the stops, else prime; NaN if neither is.

        Source: as `ranger.cubes.Cubes.look` without a current pointing.
        """
        direct = counts(self.station, points)
        low, high = self.stops
        prime = np.stack(prime_counts(direct[..., 0], direct[..., 1], self.station.zeros[1]), axis=-1)
        answer = np.full(direct.shape, np.nan)
        for setting in (prime, direct):
            azimuth = turned_within(setting[..., 0], low, high)
            allowed = within(azimuth, low, high)
            answer[allowed] = np.stack([azimuth, setting[..., 1]], axis=-1)[allowed]
        return answer

    def on_ground(self, frame: Transform) -> MirrorStation:
        """Its mirror in the ground frame, given `ground_from_reflector`."""
        if self.frame == "ground":
            return self.station
        station = self.station
        turned = station.gamma @ frame.rotation.T
        return MirrorStation.from_matrix(
            frame.points(station.scan_point), turned, offset=station.offset, beta=station.beta, zeros=station.zeros
        )


@dataclass(frozen=True, eq=False)
class SeenRetroreflector:
    """A retroreflector, in its frame.

    point   (3,) m
    axis    (3,) outward; None for a kind without one
    u       m, of each coordinate
    part    what it belongs to; a triplet has its prisms on the plate and its ball on the underside

    Raises InputError for a kind with an axis that lacks it.
    """

    name: str
    kind: RetroreflectorKind
    frame: FrameName
    point: Array
    axis: Array | None
    u: float
    part: Part

    def __post_init__(self) -> None:
        self.kind.axis_of(self.name, self.axis)


def vantages_of(site: SiteFolder) -> dict[str, Vantage]:
    """Every ranger of a site, by name, sorted.

    Mounts without a record as in `ranger.initialisation`.
    """
    return {
        name: Vantage(name, frame_of(site, name), local_station(site, name), mirror, pace_by(mirror))
        for name in site.rangers
        for mirror in [site.mirror_of(name)]
    }


def pace_by(mirror: Mirror) -> Pace:
    """Speeds of the axes by the record, else a ZY's defaults."""
    if all(getattr(mirror, key) for key in ("abv_0", "aba_0", "abv_1", "aba_1")):
        return pace_of(mirror)
    boot = AxisSettings()
    speed, acceleration = velocity_counts(boot.velocity), acceleration_counts(boot.acceleration)
    return Pace((speed, speed), (acceleration, acceleration))


def retros_of(site: SiteFolder) -> dict[str, SeenRetroreflector]:
    """Every retroreflector of a site, by name.

    Source: [GOLDMAN00] figure 10 for triplets: ball = mid-point + h_corr normal, which points to the prisms' side.
    """
    benches = {benchmark.target for benchmark in site.benchmarks}
    retros: dict[str, SeenRetroreflector] = {}
    for target in site.targets.values():
        part: Part = "structure"
        if target.name in benches:
            part = "benchmark"
        elif target.shapes_dish:
            part = "dish"
        axis = None if target.normal is None else np.array(target.normal)
        point = np.array(target.position_mm) * MILLIMETRE
        retros[target.name] = SeenRetroreflector(
            name=target.name,
            kind=target.kind,
            frame=target.frame,
            point=point,
            axis=axis,
            u=_u(target.u_position_mm),
            part=part,
        )
    for triplet in site.triplets.values():
        ball, normal = np.array(triplet.nominal_position_mm) * MILLIMETRE, np.array(triplet.normal)
        middle = ball - triplet.h_corr_mm * MILLIMETRE * normal
        half = 0.5 * triplet.d12_mm * MILLIMETRE * np.array(triplet.axis)
        u, frame = _u(triplet.u_position_mm), triplet.frame
        for side, point in ((triplet.left_prism, middle - half), (triplet.right_prism, middle + half)):
            retros[side.target] = SeenRetroreflector(
                name=side.target, kind=side.kind, frame=frame, point=point, axis=normal, u=u, part="plate"
            )
        eye = triplet.ball
        retros[eye.target] = SeenRetroreflector(
            name=eye.target, kind=eye.kind, frame=frame, point=ball, axis=-normal, u=u, part="underside"
        )
    return retros


def reflector_at(site: SiteFolder, posture: LivePosture, seconds: float = 0.0) -> Transform:
    """Nominal ground from reflector some s after a posture, rates constant."""
    reflector = site.site.frames.reflector
    return ground_from_reflector(
        posture.azimuth + posture.azimuth_rate * seconds,
        posture.elevation + posture.elevation_rate * seconds,
        elevation_axis_height=reflector.elevation_axis_height_mm * MILLIMETRE,
        reflector_to_elevation=np.array(reflector.reflector_to_elevation_mm) * MILLIMETRE,
    )


def nominal_posture(site: SiteFolder) -> LivePosture:
    """Azimuth and elevation of the record's [campaign]."""
    posture = site.site.campaign
    return LivePosture(0, posture.azimuth_deg * DEGREE, posture.elevation_deg * DEGREE)


def seconds_between(since_ticks: int, ticks: int) -> float:
    """Seconds from one tick to another."""
    return (ticks - since_ticks) * TICK_SECONDS


def _u(u_mm: float | None) -> float:
    return TYPED if u_mm is None else u_mm * MILLIMETRE
