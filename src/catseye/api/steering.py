"""`point` and `track`: a mirror's encoder counts for points that stand still, and for points that move."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.reading import place_of
from catseye.api.result import Result, digest_of, quantities
from catseye.api.units import In, with_units
from catseye.errors import InputError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.keep_out import KeepOut
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.records.site.monument import MonumentGeometry
    from catseye.reduction.site.stations import Pointings
    from catseye.reduction.steering.sighting import Sighting
    from catseye.reduction.steering.tracking import CountTrack
    from catseye.reduction.steering.visibility import Visibility


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
    pointings      everything else
    sightings      Sun and keep-out boxes, one a point, where they were asked for
    visibility     whether the mirror sees each point's reflector, where that was asked for
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
    pointings: "Pointings"
    sightings: "list[Sighting]" = field(default_factory=list)
    visibility: "Visibility | None" = None
    names: dict[str, str | None] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    def passages(self) -> "Sequence[Passage]":
        """Number of points within reach, and remarks."""
        from catseye.gateways.steering.pointing_objects import pointing_remarks
        from catseye.gateways.writers.passage import Passage

        reached = int(np.sum(self.allowed | self.prime_allowed))
        text = f"{self.names.get('mirror')} on {self.names.get('monument')} reaches {reached} of {len(self.to)} points."
        remarks = pointing_remarks(self.pointings, self.sightings, self.visibility)
        return [Passage("Counts", text), *(Passage("Note", remark) for remark in remarks)]

    def to_object(self) -> Any:
        """JSON object of `catseye point --json`: a list, one object a point."""
        from catseye.gateways.steering.pointing_objects import pointing_objects

        return [{**item, **self.names} for item in pointing_objects(self.pointings, self.sightings, self.visibility)]

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
    at_mjd: Annotated[Any, In("mjd", one=True)] = None,
    latitude_deg: Annotated[Any, In("deg", one=True)] = None,
    longitude_deg: Annotated[Any, In("deg", one=True)] = None,
    keep_out: "KeepOut | None" = None,
    reflector: str | None = None,
    facing: Annotated[Any, In("", many=True)] = None,
    solids: "str | os.PathLike[str] | None" = None,
    posture_deg: Annotated[Any, In("deg", many=True)] = None,
) -> PointingResult:
    """Encoder counts of a mirror for points, both pointings, with stops, Sun, keep-out boxes and visibility.

    monument, mirror   records, or their files
    to                 (n, 3) or (3,) m, ground; or a coord.dat of lines x y z in mm
    at_mjd             UTC: is the Sun in the way?
    latitude_deg, longitude_deg   of the site, east positive; the monument's record without
    keep_out           boxes that no beam may enter, and the cone kept from the Sun; what `load` gives of such a file
    reflector, facing  what stands at the points, and its outward axis in ground axes: is it visible?
    solids             what may stand in the way, with the telescope at posture_deg, azimuth and elevation

    Raises InputError for records that cannot be used. Source: [PARKER04] section 2.

    >>> counts = point("night-01/monuments/ZY103.toml", "night-01/mirrors/ZP103.toml", [0.0, 0.0, 50.0]).counts
    >>> counts.shape
    (1, 2)
    """
    from catseye.gateways.steering.pointing_objects import pointing_verdict
    from catseye.records.files.reading import read_record
    from catseye.records.laboratory.coordinate_list import read_coordinates
    from catseye.records.site.keep_out import KeepOut
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.records.site.monument import MonumentGeometry
    from catseye.records.site.solids import Solids
    from catseye.reduction.site.stations import point as pointed
    from catseye.reduction.site.stations import station_of
    from catseye.reduction.steering.sighting import place_of_monument, seen_from, sightings

    read: list[Path] = []

    def record(given: Any, kind: type) -> Any:
        if isinstance(given, kind):
            return given
        read.append(place_of(given))
        return read_record(read[-1], kind)

    stands, mirrors = record(monument, MonumentGeometry), record(mirror, MirrorGeometry)
    if isinstance(to, str | os.PathLike):
        read.append(place_of(to))
        where = read_coordinates(read[-1])
    else:
        where = np.atleast_2d(np.asarray(to, dtype=float))
    if where.ndim != 2 or where.shape[1] != 3 or not np.isfinite(where).all():
        raise InputError(f"points of shape {where.shape} (expected (n, 3) or (3,), finite, m)")
    pointings, station = pointed(stands, mirrors, where), station_of(stands, mirrors)
    zones = keep_out or KeepOut()
    sights: list[Sighting] = []
    if at_mjd is not None or zones.box:
        place = None if at_mjd is None else place_of_monument(stands, longitude_deg, latitude_deg)
        sights = sightings(
            station, mirrors, pointings.counts, name=stands.monument, mjd=at_mjd, place=place, keep_out=zones
        )
    seen = None
    if reflector or facing is not None or solids is not None:
        seen = seen_from(
            station,
            stands.monument,
            where,
            kind=reflector or "prism",
            facing=None if facing is None else np.asarray(facing, dtype=float),
            solids=Solids() if solids is None else record(solids, Solids),
            posture=None if posture_deg is None else (np.radians(posture_deg[0]), np.radians(posture_deg[1])),
            reachable=pointings.allowed | pointings.prime_allowed,
        )
    return PointingResult(
        pointing_verdict(pointings, sights, seen),
        pointings.to,
        pointings.aim.range,
        pointings.counts,
        pointings.u,
        pointings.prime,
        pointings.autocollimation,
        pointings.back_retro,
        pointings.allowed,
        pointings.prime_allowed,
        pointings,
        sights,
        seen,
        {"monument": stands.monument, "mirror": mirrors.zp, "mirror_of_monument": stands.zp},
        tuple(read),
    )


@dataclass(frozen=True, eq=False, repr=False)
class TrackResult(Result):
    """Counts along which one mirror follows n points that move, over intervals between k + 1 times.

    seconds    (k + 1,) s, ends of the intervals
    counts     (k + 1, n, 2) azimuth and elevation at each, on one turn and in one pointing
    misses     (s, k, n) m, how far the beam passes its target at s instants of each interval
    worst      (n,) m, the largest of each
    status     (n,) text: "followed", or why not
    followed   everything else
    """

    seconds: np.ndarray
    counts: np.ndarray
    misses: np.ndarray
    worst: np.ndarray
    status: tuple[str, ...]
    followed: "CountTrack"

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

        return {"misses": miss_figure(self.followed, self.misses[:, :, None, :], SHARES)}


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
    """Counts at t0 and t1 of each interval for points that move with the telescope as it slews or tracks.

    monument, mirror    records, or their files; of a ranger on the ground
    points              (n, 3) or (3,) m, fixed in the frame
    start_deg, end_deg  azimuth and elevation that the telescope goes from and to, both axes at once
    frame               "ground", "alidade", "elevation" or "reflector"
    start_mjd           UTC at the first t0
    interval_s          length of an interval: a buffer's
    azimuth_rate_deg_per_s, elevation_rate_deg_per_s   of the drives; the Green Bank Telescope's fastest without

    A point that the mirror cannot follow has a status that says why, and no counts that mean anything.
    Raises InputError for records and postures that cannot be used. Source: [PARKER04] section 2.6.

    >>> went = track("night-01/monuments/ZY103.toml", "night-01/mirrors/ZP103.toml", [0.0, 54.0, 12.0],
    ...              start_deg=(145.0, 30.0), end_deg=(145.3, 30.1))
    >>> went.status, bool(went.worst[0] < 1e-3)
    (('followed',), True)
    """
    from catseye.constants import DEGREE
    from catseye.gateways.writers.verdict import Verdict
    from catseye.geometry.sky.time_tag import TimeTag
    from catseye.records.files.reading import read_record
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.records.site.monument import MonumentGeometry
    from catseye.reduction.site.stations import station_of
    from catseye.reduction.steering.tracking import (
        AZIMUTH_SLEW,
        ELEVATION_SLEW,
        AntennaPath,
        Drive,
        fixed,
        follow,
        misses,
        mounted,
    )

    stands = monument if isinstance(monument, MonumentGeometry) else read_record(place_of(monument), MonumentGeometry)
    mirrors = mirror if isinstance(mirror, MirrorGeometry) else read_record(place_of(mirror), MirrorGeometry)
    where = np.atleast_2d(np.asarray(points, dtype=float))
    if where.ndim != 2 or where.shape[1] != 3 or not np.isfinite(where).all():
        raise InputError(f"points of shape {where.shape} (expected (n, 3) or (3,), finite, m)")
    for az, el in (start_deg, end_deg):
        if not (abs(az) <= 540.0 and -5.0 <= el <= 95.0):
            raise InputError(f"posture {az:g}, {el:g} deg (expected azimuth -540 to 540, elevation -5 to 95)")
    given = (azimuth_rate_deg_per_s, elevation_rate_deg_per_s)
    fastest = (AZIMUTH_SLEW, ELEVATION_SLEW)
    rates = [most if rate is None else rate * DEGREE for rate, most in zip(given, fastest, strict=True)]
    ends = zip(start_deg, end_deg, rates, strict=True)
    azimuth, elevation = (Drive(a * DEGREE, b * DEGREE, rate=rate) for a, b, rate in ends)
    path = AntennaPath(azimuth, elevation)
    intervals = max(1, int(np.ceil(max(path.azimuth.duration, path.elevation.duration) / interval_s)))
    limits = (mirrors.az_low_limit, mirrors.az_high_limit)
    stations, targets = mounted(station_of(stands, mirrors)[None]), fixed(where, frame, path)
    followed = follow(
        stations, targets, TimeTag.from_mjd(start_mjd), intervals=intervals, interval=interval_s, limits=limits
    )
    off = misses(followed, stations, targets)[:, :, 0]
    good = followed.status[0] == 0
    status = tuple(followed.reason(0, k) for k in range(len(where)))
    nodes = np.concatenate([followed.lines.start, followed.lines.end[-1:]])[:, 0]
    lost = np.flatnonzero(~good)
    if not good.any():
        verdict = Verdict("failed", f"the mirror follows no point; point 0 {status[0]}")
    elif len(lost):
        text = f"{len(lost)} of {len(where)} points are not followed; point {lost[0]} {status[lost[0]]}"
        verdict = Verdict("doubtful", text)
    else:
        verdict = Verdict("good", "every point is followed on one turn and in one pointing")
    worst = np.where(good, off.max(axis=(0, 1)), np.nan)
    return TrackResult(verdict, followed.since, nodes, off, worst, status, followed)
