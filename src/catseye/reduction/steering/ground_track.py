"""Track of moving points by one mirror, on the ground or on the feed arm."""

from dataclasses import dataclass

import numpy as np

from catseye.geometry.antenna.rigid_telescope import BELOW_ELEVATION, RigidTelescope
from catseye.geometry.sky.time_tag import TimeTag
from catseye.reduction.site.stations import counts_uncertainty, imperfections_of
from catseye.reduction.steering.mounted import MountedRanger
from catseye.reduction.steering.tracking import (
    AntennaPath,
    CountTrack,
    Following,
    Stations,
    Targets,
    carried,
    count_errors,
    fixed,
    follow,
    ideal_track,
    misses,
    mounted,
)
from catseye.verdict import Verdict


@dataclass(frozen=True, eq=False)
class GroundTrack:
    """Track of one mirror over n points.

    track    counts at the ends of each interval, with the axis offsets, tilts and encoder errors of the mirror's record
    misses   (k, s, n) m, distances of the beam from its target at s instants of each interval
    errors   (k, s, n, 2) linear counts less exact ones at these instants
    ranger   that follows
    ideal    the same by a mirror without offsets, tilts and encoder errors; None where the record has none
    ideal_misses   (k, s, n) m, of this mirror's beam at the ideal mirror's counts; `misses` where the record has none
    u_counts  (k + 1, n, 2) standard uncertainty of the counts at the ends of the intervals, by the records of mirror,
              monument or feed arm; NaN where they lack a key, and for a point that is not followed
    lacking   these keys
    """

    track: CountTrack
    misses: np.ndarray
    errors: np.ndarray
    ranger: MountedRanger
    ideal: CountTrack | None
    ideal_misses: np.ndarray
    u_counts: np.ndarray
    lacking: tuple[str, ...]

    @property
    def followed(self) -> np.ndarray:
        """True (n,) for each point that the mirror follows."""
        return np.asarray(self.track.status[0] == Following.FOLLOWED)

    @property
    def status(self) -> tuple[str, ...]:
        """Text of each point's status."""
        return tuple(self.track.reason(0, k) for k in range(len(self.followed)))

    @property
    def counts(self) -> np.ndarray:
        """Counts (k + 1, n, 2) at the ends of the intervals."""
        return _nodes(self.track)

    @property
    def mirror_counts(self) -> np.ndarray:
        """Counts (k + 1, n, 2) less those of an ideal mirror; 0 where the record is one."""
        return np.zeros_like(self.counts) if self.ideal is None else self.counts - _nodes(self.ideal)

    @property
    def worst_ideal(self) -> np.ndarray:
        """Largest miss (n,), m, at the counts of an ideal mirror; nan for a point that is not followed."""
        return np.where(self.followed, self.ideal_misses.max(axis=(0, 1)), np.nan)

    @property
    def worst(self) -> np.ndarray:
        """Largest miss (n,), m; nan for a point that is not followed."""
        return np.where(self.followed, self.misses.max(axis=(0, 1)), np.nan)

    @property
    def worst_counts(self) -> np.ndarray:
        """Largest error (n, 2), counts, of azimuth and elevation; nan for a point that is not followed."""
        return np.where(self.followed[:, None], np.abs(self.errors).max(axis=(0, 1)), np.nan)

    @property
    def verdict(self) -> Verdict:
        """Verdict by the number of points that are followed."""
        lost, status = np.flatnonzero(~self.followed), self.status
        if not len(lost):
            return Verdict("good", "every point is followed on one turn and in one pointing")
        if len(lost) == len(status):
            return Verdict("failed", f"the mirror follows no point; point 0 {status[0]}")
        text = f"{len(lost)} of {len(status)} points are not followed; point {lost[0]} {status[lost[0]]}"
        return Verdict("doubtful", text)


def follow_by(
    ranger: MountedRanger,
    points: np.ndarray,
    *,
    frame: str,
    path: AntennaPath,
    start: TimeTag,
    interval: float,
) -> GroundTrack:
    """Follow points (n, 3), m, fixed in a frame of the telescope, by a ranger on the ground or on the feed arm.

    frame      one of `geometry.antenna.rigid_telescope.FRAMES`
    path       of the telescope, to its end
    start      UTC at the first interval's begin
    interval   s, a buffer's length

    Frames beyond the reflector, the subreflector's at rest, and the feed arm do not move against it.

    Source: [PARKER04] sections 2.6 and 2.6.1; offsets between the mirror's axes and face, section 2.4.
    """
    intervals = max(1, int(np.ceil(max(path.azimuth.duration, path.elevation.duration) / interval)))
    telescope = RigidTelescope(
        azimuth=float(path.azimuth.at(0.0)[0]),
        elevation=float(path.elevation.at(0.0)[0]),
        elevation_axis_height=path.elevation_axis_height,
        reflector_to_elevation=path.reflector_to_elevation,
    )
    if frame not in (*BELOW_ELEVATION, "elevation", "reflector"):
        points, frame = telescope.between("reflector", frame).points(points), "reflector"
    station = ranger.station(telescope)[None]
    stations, targets = carried(station, path, 0.0) if ranger.moves else mounted(station), fixed(points, frame, path)
    limits = (ranger.mirror.az_low_limit, ranger.mirror.az_high_limit)
    imperfections = imperfections_of(ranger.mirror)
    track = follow(
        stations, targets, start, intervals=intervals, interval=interval, limits=limits, imperfections=imperfections
    )
    passed = misses(track, stations, targets, imperfections=imperfections)
    u_counts, lacking = _uncertainty(ranger, track, stations, targets)
    ideal, passed_ideal = None, passed
    if imperfections is not None:
        ideal = ideal_track(track, stations, targets)
        passed_ideal = misses(ideal, stations, targets, imperfections=imperfections)
    return GroundTrack(
        track,
        passed[:, :, 0],
        errors=count_errors(track, stations, targets, imperfections=imperfections)[:, :, 0],
        ranger=ranger,
        ideal=ideal,
        ideal_misses=passed_ideal[:, :, 0],
        u_counts=u_counts,
        lacking=lacking,
    )


def _uncertainty(
    ranger: MountedRanger, track: CountTrack, stations: Stations, targets: Targets
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Standard uncertainties (k + 1, n, 2), counts, of the nodes of the only ranger, and the keys that records lack."""
    good = track.status[0] == Following.FOLLOWED
    station, points = stations(track.since), targets(track.since)[:, :, good]
    u, lacking = counts_uncertainty(
        station,
        ranger.mirror,
        points,
        spread=lambda to: ranger.counts_covariance(station, to),
        prime=track.prime[None, :, good],
    )
    every = np.full((len(track.since), len(good), 2), np.nan)
    every[:, good] = u[:, 0]
    return every, lacking


def _nodes(track: CountTrack) -> np.ndarray:
    """Counts (k + 1, n, 2) of the only ranger at the ends of the intervals."""
    return np.concatenate([track.lines.start, track.lines.end[-1:]])[:, 0]
