"""`point` and `track`: a mirror's encoder counts for points."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np

from catseye.api.reading import place_of
from catseye.api.result import Result, digest_of, quantities
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError, InputError, ValidityError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.files.record import Record
    from catseye.records.site.keep_out import KeepOut
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.records.site.monument import MonumentGeometry
    from catseye.records.site.solids import Solids
    from catseye.reduction.site.stations import Pointings
    from catseye.reduction.steering.aiming import AimedPoints
    from catseye.reduction.steering.ground_track import GroundTrack
    from catseye.reduction.steering.sighting import Sighting
    from catseye.reduction.steering.visibility import Visibility

R = TypeVar("R", bound="Record")


@dataclass(frozen=True, eq=False, repr=False)
class PointingResult(Result):
    """Counts of one mirror for n points: CAL.EQ.

    to             (n, 3) m, ground
    range_         (n,) m, from the scan point
    counts         (n, 2) azimuth and elevation, direct pointing; real numbers, not rounded
    u              (n, 2) counts; nan where a record does not have what it needs
    prime          (n, 2) counts of the prime pointing
    autocollimation, back_retro   (n,) counts of elevation
    allowed, prime_allowed        (n,) bool: within the mirror's stops
    aimed          everything else
    names          monument, mirror, and the mirror that the monument's record names
    read           files that were read
    """

    to: np.ndarray
    range_: np.ndarray
    counts: np.ndarray
    u: np.ndarray
    prime: np.ndarray
    autocollimation: np.ndarray
    back_retro: np.ndarray
    allowed: np.ndarray
    prime_allowed: np.ndarray
    aimed: "AimedPoints"
    names: dict[str, str | None] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    @property
    def pointings(self) -> "Pointings":
        """Counts, stops and uncertainties, and the rays they follow from."""
        return self.aimed.pointings

    @property
    def sightings(self) -> "list[Sighting]":
        """Sun and keep-out boxes, one a point, where they were asked for."""
        return self.aimed.sightings

    @property
    def visibility(self) -> "Visibility | None":
        """Visibility of each point's reflector, where that was asked for."""
        return self.aimed.visibility

    def passages(self) -> "Sequence[Passage]":
        """Number of points within reach, and remarks."""
        from catseye.gateways.steering.pointing_objects import pointing_remarks
        from catseye.gateways.writers.passage import Passage

        reached = int(np.sum(self.allowed | self.prime_allowed))
        text = f"{self.names.get('mirror')} on {self.names.get('monument')} reaches {reached} of {len(self.to)} points."
        remarks = pointing_remarks(self.aimed)
        recorded, used = self.names.get("mirror_of_monument"), self.names.get("mirror")
        if recorded is not None and recorded != used:
            of = self.names.get("monument")
            remarks = [f"{used} is not the mirror that the record of {of} names, {recorded}", *remarks]
        return [Passage("Counts", text), *(Passage("Note", remark) for remark in remarks)]

    def to_object(self) -> Any:
        """JSON object of `catseye point --json`: a list, one object a point."""
        from catseye.gateways.steering.pointing_objects import pointing_objects

        return [{**item, **self.names} for item in pointing_objects(self.aimed)]

    def lines(self) -> list[str]:
        """Lines of the table of counts that the command prints."""
        from catseye.gateways.steering.pointing_objects import pointing_table

        return pointing_table(self.pointings).splitlines()

    def save_counts(self, path: "str | os.PathLike[str]") -> None:
        """Write CAL.EQ's output.dat.

        path   new, or an earlier file of catseye

        Raises InputError for another's file, and where nothing can be written.
        """
        from catseye.gateways.steering.pointing_objects import write_output_dat

        write_output_dat(self.pointings, f"{self.names['mirror']} on {self.names['monument']}", Path(path))

    def tables(self) -> "dict[str, QTable]":
        """`counts`: a row a point."""
        columns = {
            **{axis: (self.to[:, k], "m") for k, axis in enumerate("xyz")},
            "range": (self.range_, "m"),
            "azimuth_counts": (self.counts[:, 0], ""),
            "elevation_counts": (self.counts[:, 1], ""),
            "u_azimuth_counts": (self.u[:, 0], ""),
            "u_elevation_counts": (self.u[:, 1], ""),
            "allowed": (self.allowed, ""),
            "prime_azimuth_counts": (self.prime[:, 0], ""),
            "prime_elevation_counts": (self.prime[:, 1], ""),
            "prime_allowed": (self.prime_allowed, ""),
        }
        return {"counts": quantities(columns)}

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each record read."""
        return {path.name: digest_of(path) for path in self.read}

    def sources(self) -> tuple[Path, ...]:
        """Records that `save` leaves alone: those read."""
        return self.read


@with_units
def point(
    monument: "str | os.PathLike[str] | MonumentGeometry",
    mirror: "str | os.PathLike[str] | MirrorGeometry",
    to: Annotated[Any, In("m", text=True)],
    *,
    at_mjd: Annotated[Any, In("mjd", one=True, text=True)] = None,
    latitude_deg: Annotated[Any, In("deg", one=True)] = None,
    longitude_deg: Annotated[Any, In("deg", one=True)] = None,
    sun_cone_deg: Annotated[Any, In("deg", one=True)] = None,
    keep_out: "str | os.PathLike[str] | KeepOut | None" = None,
    reflector: str | None = None,
    facing: Annotated[Any, In("", many=True)] = None,
    solids: "str | os.PathLike[str] | Solids | None" = None,
    posture_deg: Annotated[Any, In("deg", many=True)] = None,
) -> PointingResult:
    """Encoder counts of a mirror for points: CAL.EQ.

    Both pointings, with stops, Sun, keep-out boxes and visibility.

    monument, mirror   records, or their files
    to                 (n, 3) or (3,) m, ground; or a coord.dat of lines x y z in mm
    at_mjd             UTC, MJD or a text such as 2003-09-07T15:12:09Z: is the Sun in the way?
    latitude_deg, longitude_deg   of the site, east positive; the monument's record without; with at_mjd
    sun_cone_deg       half angle kept from the Sun, 0.5 to 60; of keep_out, or 5, without; with at_mjd
    keep_out           boxes that no beam may enter, or their file
    reflector          "prism", "hollow" or "ball" at the points: is it visible?
    facing             (3,) outward axis of the reflectors, ground axes
    solids             obstacles, or their file
    posture_deg        azimuth and elevation of the telescope, for solids that it carries; with solids

    Raises ArgumentError for arguments that do not fit together, InputError for records that cannot be used.
    Source: [PARKER04] section 2.

    >>> counts = point("night-01/monuments/ZY103.toml", "night-01/mirrors/ZP103.toml", [0.0, 0.0, 50.0]).counts
    >>> counts.shape
    (1, 2)
    """
    from catseye.records.site.keep_out import KeepOut
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.records.site.monument import MonumentGeometry
    from catseye.records.site.solids import Solids
    from catseye.reduction.steering.aiming import BeamSurroundings, aim_mirror

    mjd, cone, posture = _mjd(at_mjd), _sun_cone(sun_cone_deg), _posture(posture_deg)
    axis = _facing(facing)
    by_sun = {"sun_cone_deg": sun_cone_deg, "latitude_deg": latitude_deg, "longitude_deg": longitude_deg}
    _refuse_alone(by_sun, "at_mjd", at_mjd)
    _refuse_alone({"posture_deg": posture_deg}, "solids", solids)
    records = _Records()
    stands, mirrors = records.read(monument, MonumentGeometry), records.read(mirror, MirrorGeometry)
    where = records.points(to)
    zones = KeepOut() if keep_out is None else records.read(keep_out, KeepOut)
    if cone is not None:
        zones = zones.model_copy(update={"sun": zones.sun.model_copy(update={"half_angle_deg": cone})})
    surroundings = BeamSurroundings(
        mjd=mjd,
        longitude_deg=longitude_deg,
        latitude_deg=latitude_deg,
        keep_out=zones,
        kind=reflector,
        facing=axis,
        solids=None if solids is None else records.read(solids, Solids),
        posture=posture,
    )
    aimed = aim_mirror(stands, mirrors, where, surroundings)
    pointings = aimed.pointings
    return PointingResult(
        verdict=aimed.verdict,
        to=pointings.to,
        range_=pointings.aim.range,
        counts=pointings.counts,
        u=pointings.u,
        prime=pointings.prime,
        autocollimation=pointings.autocollimation,
        back_retro=pointings.back_retro,
        allowed=pointings.allowed,
        prime_allowed=pointings.prime_allowed,
        aimed=aimed,
        names={"monument": stands.monument, "mirror": mirrors.zp, "mirror_of_monument": stands.zp},
        read=tuple(records.paths),
    )


@dataclass
class _Records:
    """Records read from files; `paths` collects these."""

    paths: list[Path] = field(default_factory=list)

    def read(self, source: Any, kind: type[R]) -> R:
        """Record of a kind, or the one in a file."""
        from catseye.records.files.reading import read_record

        if isinstance(source, kind):
            return source
        self.paths.append(place_of(source))
        return read_record(self.paths[-1], kind)

    def points(self, to: Any) -> np.ndarray:
        """Points (n, 3) m, of numbers or of a coord.dat."""
        if isinstance(to, str | os.PathLike):
            from catseye.records.laboratory.coordinate_list import read_coordinates

            self.paths.append(place_of(to))
            return read_coordinates(self.paths[-1])
        where = np.atleast_2d(np.asarray(to, dtype=float))
        if where.ndim != 2 or where.shape[1] != 3 or not np.isfinite(where).all():
            raise InputError(f"points of shape {where.shape} (expected (n, 3) or (3,), finite, m)")
        return where


def _refuse_alone(values: Mapping[str, Any], needed: str, value: Any) -> None:
    """Raises ArgumentError for what says nothing without another argument."""
    for name, each in values.items():
        if each is not None and value is None:
            raise ArgumentError(f"{name} says nothing without {needed}", name, needed)


def _mjd(at_mjd: Any) -> float | None:
    """MJD of a number or a text. Raises ArgumentError for another text."""
    from catseye.geometry.sky.time_tag import mjd_of

    if not isinstance(at_mjd, str):
        return None if at_mjd is None else float(at_mjd)
    try:
        return mjd_of(at_mjd)
    except ValidityError as problem:
        raise ArgumentError(f"at_mjd = {problem}", "at_mjd") from problem


def _sun_cone(sun_cone_deg: float | None) -> float | None:
    """Half angle of the Sun's cone, deg. Raises ArgumentError outside 0.5 to 60."""
    if sun_cone_deg is not None and not 0.5 <= sun_cone_deg <= 60.0:
        raise ArgumentError(f"sun_cone_deg = {sun_cone_deg:g} is not 0.5 to 60 degrees", "sun_cone_deg")
    return sun_cone_deg


def _facing(facing: Sequence[float] | None) -> np.ndarray | None:
    """Outward axis (3,). Raises ArgumentError for a zero vector."""
    axis = None if facing is None else np.asarray(facing, dtype=float)
    if axis is not None and (axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any()):
        raise ArgumentError(f"facing = {axis.tolist()} points nowhere (expected three numbers, not all zero)", "facing")
    return axis


def _posture(posture_deg: Sequence[float] | None) -> tuple[float, float] | None:
    """Posture (2,), rad. Raises ArgumentError beyond the telescope's."""
    if posture_deg is None:
        return None
    if len(posture_deg) != 2 or not _within(*posture_deg):
        said = ", ".join(f"{v:g}" for v in posture_deg)
        raise ArgumentError(f"posture_deg = {said} (expected azimuth -540 to 540, elevation -5 to 95)", "posture_deg")
    return float(np.radians(posture_deg[0])), float(np.radians(posture_deg[1]))


def _within(azimuth_deg: float, elevation_deg: float) -> bool:
    return abs(azimuth_deg) <= 540.0 and -5.0 <= elevation_deg <= 95.0


@dataclass(frozen=True, eq=False, repr=False)
class TrackResult(Result):
    """Counts of one mirror that follows n points.

    Over intervals between k + 1 times.

    seconds    (k + 1,) s, ends of the intervals
    counts     (k + 1, n, 2) azimuth and elevation at each, on one turn and in one pointing
    misses     (s, k, n) m, how far the beam passes its target at s instants of each interval
    worst      (n,) m, the largest of each
    status     (n,) text: "followed", or the reason against it
    track      everything else
    """

    seconds: np.ndarray
    counts: np.ndarray
    misses: np.ndarray
    worst: np.ndarray
    status: tuple[str, ...]
    track: "GroundTrack"

    def passages(self) -> "Sequence[Passage]":
        """Number of points followed, and the beams' largest distances from them."""
        from catseye.gateways.writers.passage import Passage

        good = np.isfinite(self.worst)
        text = f"{int(good.sum())} of {len(self.worst)} points followed over {np.ptp(self.seconds):g} s in "
        text += f"{len(self.seconds) - 1} intervals"
        if good.any():
            text += f"; beams pass them by {1e3 * float(np.max(self.worst[good])):.3g} mm at most, counts not rounded"
        bad = [f"point {k}: {why}" for k, why in enumerate(self.status) if not good[k]]
        return [Passage("The track", text + "."), *(Passage("Not followed", line) for line in bad[:5])]

    def to_object(self) -> dict[str, Any]:
        """Arrays in SI and counts."""
        names = ("seconds", "counts", "worst", "status")
        return {"verdict": self.verdict.to_object(), **{name: getattr(self, name) for name in names}}

    def tables(self) -> "dict[str, QTable]":
        """`counts`: a row a time, columns of all points."""
        columns = {
            "time": (self.seconds, "s"),
            "azimuth_counts": (self.counts[:, :, 0], ""),
            "elevation_counts": (self.counts[:, :, 1], ""),
        }
        return {"counts": quantities(columns)}

    def figures(self) -> "dict[str, Figure]":
        """Distances of the beams from their targets, over the track."""
        from catseye.gateways.steering.tracking_figures import miss_figure
        from catseye.reduction.steering.tracking import SHARES

        return {"misses": miss_figure(self.track.track, self.misses[:, :, None, :], SHARES)}


@with_units
def track(
    monument: "str | os.PathLike[str] | MonumentGeometry",
    mirror: "str | os.PathLike[str] | MirrorGeometry",
    points: Annotated[Any, In("m")],
    *,
    start_deg: Annotated[Any, In("deg", many=True)],
    end_deg: Annotated[Any, In("deg", many=True)],
    frame: str = "reflector",
    start_mjd: Annotated[Any, In("mjd", one=True)] = 60_635.125,
    interval_s: Annotated[Any, In("s", one=True)] = 0.128,
    azimuth_rate_deg_per_s: Annotated[Any, In("deg / s", one=True)] = None,
    elevation_rate_deg_per_s: Annotated[Any, In("deg / s", one=True)] = None,
) -> TrackResult:
    """Mirror counts for points that move with the telescope.

    At t0 and t1 of each interval, as it slews or tracks.

    monument, mirror    records, or their files; of a ranger on the ground
    points              (n, 3) or (3,) m, fixed in the frame
    start_deg, end_deg  azimuth and elevation that the telescope goes from and to, both axes at once
    frame               "ground", "alidade", "elevation" or "reflector"
    start_mjd           UTC at the first t0
    interval_s          length of an interval: a buffer's
    azimuth_rate_deg_per_s, elevation_rate_deg_per_s   of the drives; the Green Bank Telescope's fastest without

    A point that the mirror cannot follow has a status that names the reason, and no counts that mean anything.
    Raises InputError for records and postures that cannot be used. Source: [PARKER04] section 2.6.

    >>> went = track("night-01/monuments/ZY103.toml", "night-01/mirrors/ZP103.toml", [0.0, 54.0, 12.0],
    ...              start_deg=(145.0, 30.0), end_deg=(145.3, 30.1))
    >>> went.status, bool(went.worst[0] < 1e-3)
    (('followed',), True)
    """
    from catseye.constants import DEGREE
    from catseye.geometry.sky.time_tag import TimeTag
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.records.site.monument import MonumentGeometry
    from catseye.reduction.steering.ground_track import follow_points
    from catseye.reduction.steering.tracking import AZIMUTH_SLEW, ELEVATION_SLEW, AntennaPath, Drive

    records = _Records()
    stands, mirrors = records.read(monument, MonumentGeometry), records.read(mirror, MirrorGeometry)
    where = np.atleast_2d(np.asarray(points, dtype=float))
    if where.ndim != 2 or where.shape[1] != 3 or not np.isfinite(where).all():
        raise InputError(f"points of shape {where.shape} (expected (n, 3) or (3,), finite, m)")
    for az, el in (start_deg, end_deg):
        if not _within(az, el):
            raise InputError(f"posture {az:g}, {el:g} deg (expected azimuth -540 to 540, elevation -5 to 95)")
    fastest = ((azimuth_rate_deg_per_s, AZIMUTH_SLEW), (elevation_rate_deg_per_s, ELEVATION_SLEW))
    rates = [most if rate is None else rate * DEGREE for rate, most in fastest]
    ends = zip(start_deg, end_deg, rates, strict=True)
    azimuth, elevation = (Drive(a * DEGREE, b * DEGREE, rate=rate) for a, b, rate in ends)
    followed = follow_points(
        stands,
        mirrors,
        where,
        frame=frame,
        path=AntennaPath(azimuth, elevation),
        start=TimeTag.from_mjd(start_mjd),
        interval=interval_s,
    )
    return TrackResult(
        verdict=followed.verdict,
        seconds=followed.track.since,
        counts=followed.counts,
        misses=followed.misses,
        worst=followed.worst,
        status=followed.status,
        track=followed,
    )
