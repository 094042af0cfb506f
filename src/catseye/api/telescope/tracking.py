"""`track`: a mirror's encoder counts for points that move with the telescope."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.result import Result, digest_of, quantities
from catseye.api.telescope.inputs import InputFiles, mjd_of_argument, posture_of, telescope_of
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.folder import SiteFolder
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.records.site.monument import MonumentGeometry
    from catseye.reduction.steering.ground_track import GroundTrack
    from catseye.reduction.steering.mounted import MountedRanger
    from catseye.reduction.steering.sky_path import SkyAxis
    from catseye.reduction.steering.tracking import Drive

START_MJD = 60_635.125  # of a track whose time says nothing: 2024-11-21, 3 h UTC
MOST_NODES = 200_000  # intervals times points: some seconds of work


@dataclass(frozen=True, eq=False, repr=False)
class TrackResult(Result):
    """Counts of one mirror that follows n points.

    Over intervals between k + 1 times.

    seconds    (k + 1,) s, ends of the intervals
    counts     (k + 1, n, 2) azimuth and elevation at each, on one turn and in one pointing
    misses     (k, s, n) m, how far the beam passes its target at s instants of each interval
    worst      (n,) m, the largest of each
    status     (n,) text: "followed", or the reason against it
    track      everything else
    errors     (k, s, n, 2) linear counts less exact ones at these instants
    worst_counts   (n, 2) the largest of each
    mirror_counts  (k + 1, n, 2) counts less those of an ideal mirror: by axis offsets, tilts, encoder errors
    ideal_misses   (k, s, n) m, how far this mirror's beam passes its target at the ideal mirror's counts
    worst_ideal    (n,) m, the largest of each
    u_counts       (k + 1, n, 2) standard uncertainty of the counts by the records of mirror, monument or feed arm, all
                   but common to the ends of an interval; nan where the records lack a key, `track.lacking`. Points and
                   posture count as exact
    frame      of the points
    read       files that were read
    """

    seconds: np.ndarray
    counts: np.ndarray
    misses: np.ndarray
    worst: np.ndarray
    status: tuple[str, ...]
    track: "GroundTrack"
    errors: np.ndarray
    worst_counts: np.ndarray
    mirror_counts: np.ndarray
    ideal_misses: np.ndarray
    worst_ideal: np.ndarray
    u_counts: np.ndarray
    frame: str
    read: tuple[Path, ...] = field(default=())

    def passages(self) -> "Sequence[Passage]":
        """Number of points followed, and the beams' largest distances from them."""
        from catseye.gateways.steering.track_objects import track_passages

        return track_passages(self.track)

    def rows(self) -> list[str]:
        """Lines of the tables that the command prints: points, and the first nodes."""
        from catseye.gateways.steering.track_objects import track_lines

        return track_lines(self.track)

    def to_object(self) -> dict[str, Any]:
        """Arrays in SI and counts."""
        names = ("seconds", "counts", "u_counts", "worst", "status", "worst_counts", "mirror_counts", "worst_ideal")
        more = {
            "frame": self.frame,
            "prime": self.track.track.prime[0],
            "uncertainties_lacking": list(self.track.lacking),
            **self.track.ranger.names,
        }
        return {"verdict": self.verdict.to_object(), **{name: getattr(self, name) for name in names}, **more}

    def tables(self) -> "dict[str, QTable]":
        """`counts`: a row a time and point; `nodes`: a row an interval and point."""
        k, n = self.counts.shape[0] - 1, self.counts.shape[1]
        columns: dict[str, tuple[Any, str]] = {
            "point": (np.tile(np.arange(n), k + 1), ""),
            "time": (np.repeat(self.seconds, n), "s"),
            "azimuth_counts": (self.counts[:, :, 0].ravel(), ""),
            "elevation_counts": (self.counts[:, :, 1].ravel(), ""),
            "u_azimuth_counts": (self.u_counts[:, :, 0].ravel(), ""),
            "u_elevation_counts": (self.u_counts[:, :, 1].ravel(), ""),
        }
        nodes: dict[str, tuple[Any, str]] = {"point": (np.tile(np.arange(n), k), "")}
        for name, part in (("t0", slice(None, -1)), ("t1", slice(1, None))):
            nodes[name] = (np.repeat(self.seconds[part], n), "s")
            nodes[f"azimuth_{name}_counts"] = (self.counts[part, :, 0].ravel(), "")
            nodes[f"elevation_{name}_counts"] = (self.counts[part, :, 1].ravel(), "")
            nodes[f"u_azimuth_{name}_counts"] = (self.u_counts[part, :, 0].ravel(), "")
            nodes[f"u_elevation_{name}_counts"] = (self.u_counts[part, :, 1].ravel(), "")
        for axis, name in enumerate(("azimuth", "elevation")):
            nodes[f"{name}_mirror_counts"] = (self.mirror_counts[:-1, :, axis].ravel(), "")
        worst = np.abs(self.errors).max(axis=1).reshape(-1, 2)
        nodes["azimuth_error_counts"], nodes["elevation_error_counts"] = (worst[:, 0], ""), (worst[:, 1], "")
        nodes["miss"] = (self.misses.max(axis=1).ravel(), "m")
        nodes["ideal_miss"] = (self.ideal_misses.max(axis=1).ravel(), "m")
        return {"counts": quantities(columns), "nodes": quantities(nodes)}

    def figures(self) -> "dict[str, Figure]":
        """Distances of the beams from their targets, linear counts less exact ones, counts by the mirror's offsets."""
        from catseye.gateways.steering.tracking_figures import error_figure, mirror_figure, miss_figure
        from catseye.reduction.steering.tracking import SHARES

        track = self.track.track
        imperfect = self.track.ideal is not None
        ideal_misses = self.ideal_misses[:, :, None, :] if imperfect else None
        figures = {
            "misses": miss_figure(track, self.misses[:, :, None, :], SHARES, ideal_misses=ideal_misses),
            "errors": error_figure(track, self.errors[:, :, None], SHARES),
        }
        return {**figures, "mirror": mirror_figure(track, self.mirror_counts)} if imperfect else figures

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return {path.name: digest_of(path) for path in self.read if path.is_file()}

    def sources(self) -> tuple[Path, ...]:
        """Files and directories that `save` leaves alone: those read."""
        return self.read


@with_units
def track(
    monument: "str | os.PathLike[str] | MonumentGeometry | None" = None,
    mirror: "str | os.PathLike[str] | MirrorGeometry | None" = None,
    points: Annotated[Any, In("m", text=True)] = None,
    *,
    start_deg: Annotated[Any, In("deg", many=True)] = None,
    end_deg: Annotated[Any, In("deg", many=True)] = None,
    frame: str = "reflector",
    start_mjd: Annotated[Any, In("mjd", one=True, text=True)] = None,
    interval_s: Annotated[Any, In("s", one=True)] = 0.128,
    azimuth_rate_deg_per_s: Annotated[Any, In("deg / s", one=True)] = None,
    elevation_rate_deg_per_s: Annotated[Any, In("deg / s", one=True)] = None,
    site: "str | os.PathLike[str] | SiteFolder | None" = None,
    ranger: str | None = None,
    star_deg: Annotated[Any, In("deg", many=True)] = None,
    duration_s: Annotated[Any, In("s", one=True)] = None,
) -> TrackResult:
    """Mirror counts for points that move with the telescope.

    At t0 and t1 of each interval, as it slews from posture to posture or tracks a star. The axis offsets, tilts and
    encoder errors of the mirror's record are in the counts.

    monument, mirror    records, or their files; of a ranger on the ground
    points              (n, 3) or (3,) m, fixed in the frame; or a coord.dat of lines x y z in mm
    start_deg, end_deg  azimuth and elevation that the telescope goes from and to, both axes at once
    frame               "ground", "alidade", "elevation", "reflector", "feed_arm", "prime_focus" or "subreflector"
    start_mjd           UTC at the first t0, MJD or a text such as 2003-09-07T15:12:09Z; 60635.125 without
    interval_s          length of an interval: a buffer's
    azimuth_rate_deg_per_s, elevation_rate_deg_per_s   of the drives; the Green Bank Telescope's fastest without
    site, ranger        instead of the records: a site, and the name of its ranger, on the ground or the feed arm
    star_deg            right ascension and declination, ICRS J2000, instead of start_deg and end_deg: the telescope
                        follows it, raised by standard air, without a pointing model
    duration_s          of the star's track

    A point that the mirror cannot follow has a status that names the reason, and no counts that mean anything.
    Raises ArgumentError for arguments that do not fit together, InputError for records that cannot be used and a star
    that is too low. Source: [PARKER04] section 2.6, eqs. 2.45 and 2.46.

    >>> went = track("night-01/monuments/ZY103.toml", "night-01/mirrors/ZP103.toml", [0.0, 54.0, 12.0],
    ...              start_deg=(145.0, 30.0), end_deg=(145.3, 30.1))
    >>> went.status, bool(went.worst[0] < 1e-3)
    (('followed',), True)
    """
    from catseye.geometry.antenna.rigid_telescope import FRAMES
    from catseye.geometry.sky.time_tag import TimeTag
    from catseye.reduction.steering.ground_track import follow_by
    from catseye.reduction.steering.tracking import AntennaPath

    files = InputFiles()
    stands = None if site is None else files.site(site)
    mounted = files.ranger(monument, mirror, stands, ranger)
    if points is None:
        raise ArgumentError("points are missing (expected points, or their file)", "points")
    if frame not in FRAMES:
        raise ArgumentError(f"frame = {frame!r} is unknown (expected one of {', '.join(FRAMES)})", "frame")
    where = files.points(points)
    if not 1e-3 <= interval_s <= 60.0:
        raise ArgumentError(f"interval_s = {interval_s:g} (expected 0.001 to 60)", "interval_s")
    begin = mjd_of_argument(start_mjd, "start_mjd")
    begin = START_MJD if begin is None else begin
    axes: tuple[Drive, Drive] | tuple[SkyAxis, SkyAxis]
    if star_deg is None:
        axes = _slew(start_deg, end_deg, azimuth_rate_deg_per_s, elevation_rate_deg_per_s)
        if duration_s is not None:
            raise ArgumentError("duration_s says nothing without star_deg", "duration_s", "star_deg")
    else:
        ways = {
            "start_deg": start_deg,
            "end_deg": end_deg,
            "azimuth_rate_deg_per_s": azimuth_rate_deg_per_s,
            "elevation_rate_deg_per_s": elevation_rate_deg_per_s,
        }
        for name, value in ways.items():
            if value is not None:
                raise ArgumentError(f"{name} does not go with star_deg: a star moves the telescope", name, "star_deg")
        axes = _star(mounted, star_deg, begin, duration_s, interval_s)
    intervals = max(axes[0].duration, axes[1].duration) / interval_s
    if intervals * len(where) > MOST_NODES:
        raise ArgumentError(
            f"{intervals:.0f} intervals of {len(where)} points are too many (expected {MOST_NODES} at most together): "
            "make interval_s longer, or the track shorter",
            "interval_s",
        )
    lengths = telescope_of(stands, (0.0, 0.0))
    followed = follow_by(
        mounted,
        where,
        frame=frame,
        path=AntennaPath(
            axes[0],
            axes[1],
            elevation_axis_height=lengths.elevation_axis_height,
            reflector_to_elevation=lengths.reflector_to_elevation,
        ),
        start=TimeTag.from_mjd(begin),
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
        errors=followed.errors,
        worst_counts=followed.worst_counts,
        mirror_counts=followed.mirror_counts,
        ideal_misses=followed.ideal_misses,
        worst_ideal=followed.worst_ideal,
        u_counts=followed.u_counts,
        frame=frame,
        read=tuple(files.paths),
    )


def _slew(start_deg: Any, end_deg: Any, azimuth_rate: Any, elevation_rate: Any) -> "tuple[Drive, Drive]":
    """Motion of both axes from posture to posture. Raises ArgumentError for postures and rates that cannot be."""
    from catseye.constants import DEGREE
    from catseye.reduction.steering.tracking import AZIMUTH_SLEW, ELEVATION_SLEW, Drive

    start, end = posture_of(start_deg, "start_deg"), posture_of(end_deg, "end_deg")
    if start is None or end is None:
        missing = "start_deg" if start is None else "end_deg"
        raise ArgumentError(
            f"{missing} is missing (expected start_deg and end_deg, or star_deg)", "start_deg", "end_deg", "star_deg"
        )
    rates = {"azimuth_rate_deg_per_s": azimuth_rate, "elevation_rate_deg_per_s": elevation_rate}
    for name, rate in rates.items():
        if rate is not None and not 0.0 < rate <= 10.0:
            raise ArgumentError(f"{name} = {rate:g} (expected above 0, to 10)", name)
    azimuth, elevation = (
        most if rate is None else rate * DEGREE
        for rate, most in zip(rates.values(), (AZIMUTH_SLEW, ELEVATION_SLEW), strict=True)
    )
    return Drive(start[0], end[0], rate=azimuth), Drive(start[1], end[1], rate=elevation)


def _star(
    ranger: "MountedRanger", star_deg: Any, begin: float, duration_s: Any, interval_s: float
) -> "tuple[SkyAxis, SkyAxis]":
    """Motion of both axes with a star. Raises ArgumentError for a place beyond the sky's, or a track without end."""
    from catseye.constants import DEGREE
    from catseye.geometry.sky.star import Star
    from catseye.reduction.steering.sighting import place_of_ranger
    from catseye.reduction.steering.sky_path import star_axes

    if len(star_deg) != 2 or not (0.0 <= star_deg[0] <= 360.0 and -90.0 < star_deg[1] < 90.0):
        text = ", ".join(f"{v:g}" for v in star_deg)
        raise ArgumentError(f"star_deg = {text} (expected right ascension 0 to 360, declination -90 to 90)", "star_deg")
    if duration_s is None or not 0.0 < duration_s <= 86_400.0:
        text = "is missing" if duration_s is None else f"= {duration_s:g}"
        raise ArgumentError(f"duration_s {text} (expected above 0, to 86400, with star_deg)", "duration_s", "star_deg")
    star = Star("the star", star_deg[0] * DEGREE, star_deg[1] * DEGREE)
    length = interval_s * np.ceil(duration_s / interval_s - 1e-9)
    return star_axes(star, begin, float(length), place_of_ranger(ranger, None, None))
