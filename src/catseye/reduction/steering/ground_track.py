"""Track of moving points by one mirror on the ground."""

from dataclasses import dataclass

import numpy as np

from catseye.geometry.sky.time_tag import TimeTag
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from catseye.reduction.site.stations import station_of
from catseye.reduction.steering.tracking import (
    AntennaPath,
    CountTrack,
    Following,
    fixed,
    follow,
    misses,
    mounted,
)
from catseye.verdict import Verdict


@dataclass(frozen=True, eq=False)
class GroundTrack:
    """Track of one mirror over n points.

    track    counts at the ends of each interval
    misses   (s, k, n) m, distances of the beam from its target at s instants of each interval
    """

    track: CountTrack
    misses: np.ndarray

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
        return np.concatenate([self.track.lines.start, self.track.lines.end[-1:]])[:, 0]

    @property
    def worst(self) -> np.ndarray:
        """Largest miss (n,), m; nan for a point that is not followed."""
        return np.where(self.followed, self.misses.max(axis=(0, 1)), np.nan)

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


def follow_points(
    monument: MonumentGeometry,
    mirror: MirrorGeometry,
    points: np.ndarray,
    *,
    frame: str,
    path: AntennaPath,
    start: TimeTag,
    interval: float,
) -> GroundTrack:
    """Follow points (n, 3), m, fixed in a frame of the telescope.

    frame      "ground", "alidade", "elevation" or "reflector"
    path       of the telescope, to its end
    start      UTC at the first interval's begin
    interval   s, a buffer's length

    Source: [PARKER04] section 2.6.
    """
    intervals = max(1, int(np.ceil(max(path.azimuth.duration, path.elevation.duration) / interval)))
    stations, targets = mounted(station_of(monument, mirror)[None]), fixed(points, frame, path)
    limits = (mirror.az_low_limit, mirror.az_high_limit)
    track = follow(stations, targets, start, intervals=intervals, interval=interval, limits=limits)
    return GroundTrack(track, misses(track, stations, targets)[:, :, 0])
