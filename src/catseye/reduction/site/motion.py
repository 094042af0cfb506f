"""Motion of a telescope's points by its postures.

Between two readings, and from an epoch to a shot: a telescope on a perfect track, [PARKER04] eq. 2.44, rigid or bent by
its structural model. Departures of the real one are left to the solution; their rate of change is an uncertainty of the
filter state.
"""

import math
from bisect import bisect_right, insort
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import MILLIMETRE, SECONDS_PER_DAY, TWO_PI
from catseye.errors import InputError
from catseye.geometry.antenna.frames import ground_from_alidade_at, ground_from_reflector_at
from catseye.geometry.frames.frame import Transforms
from catseye.records.night.live import TICK_SECONDS, TICKS_PER_DAY, LivePosture
from catseye.records.site.folder import SiteFolder

RETENTION = 3600.0  # s, retention of postures
UNTHINNED = 300.0  # s with all readings: a shot comes within two minutes
THINNED = 1.0  # s between older readings: used only for the age of a reference shot's posture
LONGEST_GAP = 2.0  # s between readings, or after the last, for which rates hold
GROUND, ALIDADE, REFLECTOR = "ground", "alidade", "reflector"


class PostureTrack:
    """Azimuth and elevation of the telescope in time.

    From readings that may come late or out of order.
    """

    def __init__(self) -> None:
        self._ticks: list[int] = []
        self._reads: dict[int, LivePosture] = {}
        self._table = np.empty((5, 0))  # s from the first, angles, rates; spare columns beyond the readings
        self._turns, self._filled = 0, 0  # turns of azimuth before the last column; filled columns
        self._thin = 0  # readings before this one are thinned out

    def add(self, read: LivePosture) -> None:
        """Add a reading; a second one of an instant replaces the first.

        Old ones are thinned out and forgotten.
        """
        if self._ticks and read.ticks <= self._ticks[-1]:
            self._filled, self._thin = 0, 0
        if read.ticks not in self._reads:
            insort(self._ticks, read.ticks)
        self._reads[read.ticks] = read
        if len(self._ticks) > 2 and self._ticks[-1] - self._ticks[0] > 1.25 * RETENTION / TICK_SECONDS:
            first = bisect_right(self._ticks, self._ticks[-1] - round(RETENTION / TICK_SECONDS))
            for dropped in self._ticks[:first]:
                del self._reads[dropped]
            del self._ticks[:first]
            self._filled, self._thin = 0, 0
        self._thin_out()

    def _thin_out(self) -> None:
        """Forget most readings older than `UNTHINNED`, a block at a time."""
        if not self._ticks or self._ticks[-1] - self._ticks[self._thin] < 1.25 * UNTHINNED / TICK_SECONDS:
            return
        end = bisect_right(self._ticks, self._ticks[-1] - round(UNTHINNED / TICK_SECONDS))
        retained = [self._ticks[self._thin]]
        for ticks in self._ticks[self._thin + 1 : end]:
            if ticks - retained[-1] < round(THINNED / TICK_SECONDS) and ticks != self._ticks[end - 1]:
                del self._reads[ticks]
            else:
                retained.append(ticks)
        self._ticks[self._thin : end] = retained
        self._thin, self._filled = self._thin + len(retained) - 1, 0

    def forget_after(self, ticks: int) -> None:
        """Forget readings with a later stamp: the clock was set back."""
        first = bisect_right(self._ticks, ticks)
        for dropped in self._ticks[first:]:
            del self._reads[dropped]
        del self._ticks[first:]
        self._filled, self._thin = 0, 0

    @classmethod
    def of(cls, reads: Sequence[LivePosture]) -> "PostureTrack":
        """Fixed track of some readings, in order of time."""
        track = cls()
        track._ticks, track._reads = [read.ticks for read in reads], {read.ticks: read for read in reads}
        return track

    def between(self, first: float, last: float) -> "PostureTrack":
        """Fixed track of the current readings from MJD to MJD.

        Those within, and up to a gap beyond.
        """
        gap = LONGEST_GAP / SECONDS_PER_DAY
        i = max(bisect_right(self._ticks, (first - gap) * TICKS_PER_DAY) - 1, 0)
        j = bisect_right(self._ticks, (last + gap) * TICKS_PER_DAY) + 1
        track = PostureTrack()
        track._ticks = self._ticks[min(i, max(len(self._ticks) - 2, 0)) : j]
        track._reads = {k: self._reads[k] for k in track._ticks}
        return track

    def __len__(self) -> int:
        return len(self._ticks)

    @property
    def latest(self) -> LivePosture | None:
        """Reading of the latest instant."""
        return self._reads[self._ticks[-1]] if self._ticks else None

    def at(self, mjd: ArrayLike) -> tuple[Array, Array]:
        """Azimuth and elevation (...), rad, at times (...).

        Cubic between readings, by the last rates beyond.

        Raises InputError: no reading at all. Between readings the cubic has their angles and rates; for an acceleration
        of 0.2 deg/s^2 that begins half-way between two readings 0.1 s apart it is off by 0.01". Azimuth is unwrapped.
        """
        if not self._ticks:
            raise InputError("no telescope position received (expected at least one before anything on it is solved)")
        table = self._columns()
        t = (np.asarray(mjd, dtype=float) * TICKS_PER_DAY - self._ticks[0]) * SECONDS_PER_DAY / TICKS_PER_DAY
        i = np.clip(np.searchsorted(table[0], t, side="right") - 1, 0, max(len(self._ticks) - 2, 0))
        return self._angle(table, i, t, 1, 3), self._angle(table, i, t, 2, 4)

    def angles(self, mjd: float) -> tuple[float, float]:
        """Azimuth and elevation at one time, without arrays.

        Raises InputError: no reading at all.
        """
        if len(self._ticks) < 2:
            azimuth, elevation = self.at(mjd)
            return float(azimuth), float(elevation)
        ticks = mjd * TICKS_PER_DAY
        i = min(max(bisect_right(self._ticks, ticks) - 1, 0), len(self._ticks) - 2)
        a, b = self._reads[self._ticks[i]], self._reads[self._ticks[i + 1]]
        h = (b.ticks - a.ticks) * TICK_SECONDS
        t = (ticks - a.ticks) * TICK_SECONDS
        u = min(max(t / h, 0.0), 1.0)
        w = (1 + 2 * u) * (1 - u) ** 2, u**2 * (3 - 2 * u), h * u * (1 - u) ** 2, -h * u**2 * (1 - u)
        outside = max(t - h, 0.0), min(t, 0.0)
        return (
            _cubic(w, outside, a.azimuth, _near(b.azimuth, a.azimuth), a.azimuth_rate, b.azimuth_rate),
            _cubic(w, outside, a.elevation, b.elevation, a.elevation_rate, b.elevation_rate),
        )

    def age(self, mjd: ArrayLike) -> Array:
        """Time from the nearest reading (...), s."""
        if not self._ticks:
            return np.full(np.shape(mjd), np.inf)
        times = self._columns()[0]
        t = (np.asarray(mjd, dtype=float) * TICKS_PER_DAY - self._ticks[0]) * SECONDS_PER_DAY / TICKS_PER_DAY
        i = np.clip(np.searchsorted(times, t), 1, max(len(times) - 1, 1))
        near = np.minimum(np.abs(t - times[i - 1]), np.abs(t - times[np.minimum(i, len(times) - 1)]))
        return np.asarray(near)

    def _columns(self) -> Array:
        """All readings as columns, (5, n).

        Only new ones are filled in.
        """
        if self._filled < len(self._ticks):
            if len(self._ticks) > self._table.shape[1]:
                self._table = np.concatenate([self._table, np.empty((5, len(self._ticks) + 64))], axis=1)
            reads = [self._reads[k] for k in self._ticks[max(self._filled - 1, 0) :]]
            azimuth = np.array([r.azimuth for r in reads])
            before = self._turns if self._filled else 0
            turns = before - np.concatenate([[0], np.cumsum(np.rint(np.diff(azimuth) / TWO_PI))])
            seconds = np.array([r.ticks - self._ticks[0] for r in reads]) * SECONDS_PER_DAY / TICKS_PER_DAY
            new = self._table[:, len(self._ticks) - len(reads) : len(self._ticks)]
            new[0], new[1], new[2] = seconds, azimuth + TWO_PI * turns, [r.elevation for r in reads]
            new[3], new[4] = [r.azimuth_rate for r in reads], [r.elevation_rate for r in reads]
            self._turns, self._filled = int(turns[-1]), len(self._ticks)
        return self._table[:, : self._filled]

    def _angle(self, table: Array, i: NDArray[np.int64], t: Array, angle: int, rate: int) -> Array:
        """[Hermite] cubic in each interval, linear outside of all.

        Outside with the end's rate.
        """
        if table.shape[1] == 1:
            return np.asarray(table[angle, 0] + table[rate, 0] * (t - table[0, 0]))
        t0, t1 = table[0, i], table[0, i + 1]
        h = t1 - t0
        u = np.clip((t - t0) / h, 0.0, 1.0)
        y0, y1, v0, v1 = table[angle, i], table[angle, i + 1], table[rate, i], table[rate, i + 1]
        cubic = (
            y0 * (1 + 2 * u) * (1 - u) ** 2
            + y1 * u**2 * (3 - 2 * u)
            + h * (v0 * u * (1 - u) ** 2 - v1 * u**2 * (1 - u))
        )
        return np.asarray(cubic + np.where(t > t1, v1 * (t - t1), np.where(t < t0, v0 * (t - t0), 0.0)))


def _cubic(
    w: tuple[float, float, float, float], outside: tuple[float, float], y0: float, y1: float, v0: float, v1: float
) -> float:
    return w[0] * y0 + w[1] * y1 + w[2] * v0 + w[3] * v1 + outside[0] * v1 + outside[1] * v0


def _near(angle: float, reference: float) -> float:
    """Angle plus full turns, nearest to a reference."""
    return angle + TWO_PI * round((reference - angle) / TWO_PI)


def carried_point(
    site: SiteFolder, frame: str, point: Array, azimuth: float, elevation: float
) -> tuple[float, float, float]:
    """Point of a frame in the ground frame, m, without arrays.

    point  (3,) m, in the frame

    Source: [PARKER04] eq. 2.40-2.44, multiplied out.
    """
    x, y, z = point.tolist()
    if frame == GROUND:
        return x, y, z
    if frame == REFLECTOR:
        reflector = site.site.frames.reflector
        dx, dy, dz = reflector.reflector_to_elevation_mm
        x, y, z = x + dx * MILLIMETRE, y + dy * MILLIMETRE, z + dz * MILLIMETRE
        s, c = math.sin(elevation), math.cos(elevation)
        y, z = s * y + c * z, s * z - c * y + reflector.elevation_axis_height_mm * MILLIMETRE
    s, c = math.sin(azimuth), math.cos(azimuth)
    return c * x + s * y, c * y - s * x, z


def ground_from(site: SiteFolder, frame: str, azimuth: ArrayLike, elevation: ArrayLike) -> Transforms:
    """Transform to ground from a frame at postures (...), rad.

    Identity for the ground itself.

    Source: [PARKER04] eq. 2.40-2.44 with the site's constants.
    """
    if frame == REFLECTOR:
        reflector = site.site.frames.reflector
        return ground_from_reflector_at(
            azimuth,
            elevation,
            elevation_axis_height=reflector.elevation_axis_height_mm * MILLIMETRE,
            reflector_to_elevation=np.array(reflector.reflector_to_elevation_mm) * MILLIMETRE,
        )
    if frame == ALIDADE:
        return ground_from_alidade_at(azimuth)
    return Transforms(GROUND, GROUND, np.eye(3), np.zeros((*np.shape(azimuth), 3)))


class Bending(Protocol):
    """Bending of a telescope away from the rigid one: `reduction.structure.site_bending`."""

    def body(self, name: str) -> str:
        """Name shared by points that move as one; "" on the ground."""

    def motion(self, body: str, azimuth: ArrayLike, elevation: ArrayLike) -> Transforms:
        """Motion (...) of a body away from the rigid telescope, ground axes."""


def bent_ground_from(
    site: SiteFolder, frame: str, body: str, azimuth: ArrayLike, elevation: ArrayLike, bending: Bending | None
) -> Transforms:
    """Transform to ground from a frame at postures (...), rad, of a body that bends.

    frame     of the site's records
    body      of `Bending.body`; of no effect without a bending
    bending   None of a rigid telescope

    Source: [PARKER04] section 2.6, first and second order.
    """
    rigid = ground_from(site, frame, azimuth, elevation)
    if bending is None or frame == GROUND or not body:
        return rigid
    return bending.motion(body, azimuth, elevation) @ rigid


def frames_of(site: SiteFolder) -> dict[str, str]:
    """Frame of each point of a site: rangers, fixed points, targets."""
    on_ground = [*site.monuments, *(f"{name}-F" for name in site.monuments)]
    return {
        **dict.fromkeys(on_ground, GROUND),
        **{ranger.name: REFLECTOR for ranger in site.feedarm.ranger},
        **{target.name: target.frame for target in site.targets.values()},
        **{name: triplet.frame for triplet in site.triplets.values() for name in triplet.targets},
    }


def shaken(body: str, other_bodies: Sequence[str], jitter_mm: Mapping[str, ArrayLike]) -> Array:
    """Variance (m,), m^2, of ranges between bodies by their jitter.

    Between a point of one body and one of each of the others.

    jitter_mm   of each body, () or (m,); none of the ground's ""

    Points of one body move together: their ranges do not change.
    """
    far = np.array(other_bodies, dtype=str)
    near_mm, far_mm = np.broadcast_to(jitter_mm.get(body, 0.0), len(far)), np.zeros(len(far))
    for jittering, mm in jitter_mm.items():
        far_mm = np.where(far == jittering, mm, far_mm)
    return np.asarray(np.where(far == body, 0.0, np.hypot(near_mm, far_mm) * MILLIMETRE) ** 2)


@dataclass(frozen=True, eq=False)
class TelescopeCarrier:
    """Motion of the telescope's points from an epoch to other instants.

    site        its constants
    track       postures
    frames      name: frame
    epoch       MJD
    bodies      name: its body, where that is not the ground
    jitter_mm   body: deviation of its points at a shot from their mean place
    lasting     constant share of the standard deviation of a path's index: a parameter of the line
    bending     of the telescope by its structural model; None of a rigid one
    """

    site: SiteFolder
    track: PostureTrack
    frames: Mapping[str, str]
    epoch: float
    bodies: Mapping[str, str] = field(default_factory=dict)
    jitter_mm: Mapping[str, float] = field(default_factory=dict)
    lasting: float = 0.0
    bending: Bending | None = None

    def body(self, name: str) -> str:
        """Name shared by the points that move as one with a point; "" on the ground."""
        if self.frames[name] == GROUND:
            return ""
        return self.frames[name] if self.bending is None else self.bending.body(name)

    def ground_from(self, name: str, azimuth: ArrayLike, elevation: ArrayLike) -> Transforms:
        """Transform to ground from a point's frame, where it is at rest, at postures (...), rad."""
        return bent_ground_from(self.site, self.frames[name], self.body(name), azimuth, elevation, self.bending)

    def jitter(self, ranger: str, targets: tuple[str, ...]) -> Array:
        """Variance (m,), m^2, of ranges to targets by jitter.

        Zero where both ends move together.
        """
        return shaken(self.bodies.get(ranger, ""), [self.bodies.get(target, "") for target in targets], self.jitter_mm)

    def distances(self, a: str, b: str, places: Mapping[str, Array], mjd: Array) -> Array:
        """Distances (m,), m, between two points at times (m,).

        Of given places (3,), each in its own frame.
        """
        if self.body(a) == self.body(b):
            return np.full(len(mjd), np.linalg.norm(places[b] - places[a]))
        azimuth, elevation = self.track.at(mjd)
        ground_places = [self.ground_from(n, azimuth, elevation).points(places[n]) for n in (a, b)]
        return np.asarray(np.linalg.norm(ground_places[1] - ground_places[0], axis=-1))

    def carried(self, names: tuple[str, ...], mjd: Array) -> tuple[Array, Array]:
        """Rotation and shift of each named point from the epoch.

        Turn (m, 3, 3) and shift (m, 3), m, ground axes, from the epoch to its time (m,).

        Source: x(t) = M(t) M(epoch)^-1 x(epoch), M ground from the point's frame.
        """
        turn, shift = np.broadcast_to(np.eye(3), (len(names), 3, 3)).copy(), np.zeros((len(names), 3))
        body = np.array([self.body(name) for name in names])
        for moving in sorted({*body.tolist()} - {""}):
            rows = np.flatnonzero(body == moving)
            azimuth, elevation = self.track.at(np.append(mjd[rows], self.epoch))
            ground_frames = self.ground_from(names[rows[0]], azimuth, elevation)
            turn[rows] = ground_frames.rotation[:-1] @ ground_frames.rotation[-1].T
            shift[rows] = ground_frames.translation[:-1] - turn[rows] @ ground_frames.translation[-1]
        return turn, shift
