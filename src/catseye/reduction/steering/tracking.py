"""Tracking of the moving antenna: predicted places, counts, and errors.

Drive, AntennaPath      motion of the telescope's axes
mounted, carried        rangers on the ground, and rangers on the reflector's frame
follow                  counts at the ends of every interval, on one turn and in one pointing
misses                  distances of the beams from their targets in between
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import DEGREE, TWO_PI
from catseye.errors import InputError, ValidityError
from catseye.geometry.antenna.frames import ELEVATION_AXIS_HEIGHT, REFLECTOR_TO_ELEVATION
from catseye.geometry.frames.rotation import rx, rz
from catseye.geometry.mirror.encoder import COUNTS_PER_TURN, HALF_TURN, within
from catseye.geometry.mirror.imperfect import Imperfections, imperfect_counts
from catseye.geometry.mirror.pointing import MirrorStation, counts
from catseye.geometry.mirror.track import CountLine, miss
from catseye.geometry.sky.time_tag import PER_SECOND, TimeTag

AZIMUTH_SLEW = 35.2 * DEGREE / 60.0  # rad/s, the GBT's, site facts
ELEVATION_SLEW = 17.6 * DEGREE / 60.0  # rad/s
SLEW_ACCELERATION = 0.2 * DEGREE  # rad/s^2: chosen; on the fast side for such a telescope
BUFFER = 0.128  # s, [PARKER04] section 2.6.1
SHARES = np.arange(1, 16) / 16.0  # of an interval, where beams are evaluated


@dataclass(frozen=True)
class Drive:
    """One axis of the telescope, from rest to rest.

    A steady acceleration, a steady rate, and a steady deceleration.

    start, end      rad
    rate            rad/s, above 0: not exceeded
    acceleration    rad/s^2, above 0
    begin           s

    >>> round(Drive(0.0, 1.0, rate=0.1, acceleration=0.1).duration, 9)
    11.0
    """

    start: float
    end: float
    rate: float
    acceleration: float = SLEW_ACCELERATION
    begin: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (("rate", self.rate), ("acceleration", self.acceleration)):
            if not 0.0 < value < np.inf:
                raise ValidityError(f"{name} {value} of a drive is not above 0 and finite")
        for name, value in (("start", self.start), ("end", self.end), ("begin", self.begin)):
            if not np.isfinite(value):
                raise ValidityError(f"{name} {value} of a drive is not finite")

    @property
    def peak(self) -> float:
        """Largest rate, rad/s: below `rate` on a short path."""
        return min(self.rate, float(np.sqrt(abs(self.end - self.start) * self.acceleration)))

    @property
    def duration(self) -> float:
        """Time from rest to rest, s."""
        distance = abs(self.end - self.start)
        return distance / self.peak + self.peak / self.acceleration if distance > 0.0 else 0.0

    def at(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Angle (...), rad, rate and acceleration at times (...), s."""
        since = np.clip(np.asarray(t, dtype=float) - self.begin, 0.0, self.duration)
        ramp = self.peak / self.acceleration
        remaining = self.duration - since
        sign = float(np.sign(self.end - self.start))
        early, late = since < ramp, remaining < ramp
        travelled = np.where(early, 0.5 * self.acceleration * since**2, self.peak * (since - 0.5 * ramp))
        angle = np.where(late, self.end - sign * 0.5 * self.acceleration * remaining**2, self.start + sign * travelled)
        rate = sign * np.where(
            late, self.acceleration * remaining, np.where(early, self.acceleration * since, self.peak)
        )
        moving = (since > 0.0) & (remaining > 0.0)
        bend = sign * self.acceleration * np.where(early, 1.0, np.where(late, -1.0, 0.0))
        return angle, np.where(moving, rate, 0.0), np.where(moving, bend, 0.0)


class PathAxis(Protocol):
    """Motion of one axis of the telescope: a `Drive`, or a `sky_path.SkyAxis`."""

    @property
    def peak(self) -> float:
        """Largest rate of the axis, rad/s."""

    @property
    def acceleration(self) -> float:
        """Largest acceleration, rad/s^2."""

    @property
    def duration(self) -> float:
        """Time from begin to end, s."""

    def at(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Angle (...), rad, rate and acceleration at times (...), s."""


@dataclass(frozen=True, eq=False)
class AntennaPath:
    """Path of a rigid telescope on a perfect track.

    Azimuth clockwise from north, elevation.

    azimuth, elevation       motion of each axis
    elevation_axis_height    m
    reflector_to_elevation   (3,) m
    """

    azimuth: PathAxis
    elevation: PathAxis
    elevation_axis_height: float = ELEVATION_AXIS_HEIGHT
    reflector_to_elevation: tuple[float, float, float] = REFLECTOR_TO_ELEVATION

    def motion(self, points: ArrayLike, frame: str, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Place, velocity and acceleration of points fixed in a frame.

        (t..., n, 3), m and s, ground.

        points    (n, 3), m, in the frame
        frame     "ground", "alidade", "elevation" or "reflector"
        t         (t...) s

        Source: [PARKER04] eqs. 2.40-2.44 differentiated: azimuth turns about -z, elevation about +x of the alidade.
        """
        at, still = np.asarray(points, dtype=float), np.zeros(3)
        t = np.asarray(t, dtype=float)
        if frame == "ground":
            position = np.broadcast_to(at, (*t.shape, *at.shape))
            return position, np.zeros(position.shape), np.zeros(position.shape)
        azimuth, azimuth_rate, azimuth_bend = (x[..., None, None] for x in self.azimuth.at(t))
        v, a = np.broadcast_to(still, at.shape), np.broadcast_to(still, at.shape)
        if frame in ("elevation", "reflector"):
            elevation, rate, bend = (x[..., None, None] for x in self.elevation.at(t))
            shifted = at + (np.asarray(self.reflector_to_elevation) if frame == "reflector" else still)
            arm = np.einsum("...ij,...j->...i", rx(0.5 * np.pi - elevation[..., 0]), shifted)
            x_axis = np.array([1.0, 0.0, 0.0])
            swing = np.cross(x_axis, arm)
            v, a = rate * swing, bend * swing + rate**2 * np.cross(x_axis, swing)
            at = arm + np.array([0.0, 0.0, self.elevation_axis_height])
        elif frame != "alidade":
            raise InputError(f"frame {frame!r} is unknown (expected ground, alidade, elevation or reflector)")
        turn = rz(azimuth[..., 0])
        place, v, a = (np.einsum("...ij,...j->...i", turn, vector) for vector in (at, v, a))
        spin = np.array([0.0, 0.0, -1.0])
        swing = np.cross(spin, place)
        acceleration = (
            azimuth_bend * swing + azimuth_rate**2 * np.cross(spin, swing) + 2.0 * azimuth_rate * np.cross(spin, v) + a
        )
        return place, azimuth_rate * swing + v, acceleration

    def rotation(self, t: ArrayLike) -> Array:
        """Axes of the reflector in the ground frame (t..., 3, 3), as columns."""
        return rz(self.azimuth.at(t)[0]) @ rx(0.5 * np.pi - self.elevation.at(t)[0])

    def spin(self, t: ArrayLike) -> tuple[Array, Array]:
        """Angular velocity of the reflector (t..., 3), rad/s, and its change.

        rad/s^2, ground axes.
        """
        azimuth, azimuth_rate, azimuth_bend = (x[..., None] for x in self.azimuth.at(t))
        _, rate, bend = (x[..., None] for x in self.elevation.at(t))
        x_axis = rz(azimuth[..., 0])[..., :, 0]  # of the alidade
        down = np.array([0.0, 0.0, -1.0])
        change = azimuth_bend * down + bend * x_axis + azimuth_rate * rate * np.cross(down, x_axis)
        return azimuth_rate * down + rate * x_axis, change


Stations = Callable[[Array], MirrorStation]
Targets = Callable[[Array], Array]


def mounted(stations: MirrorStation) -> Stations:
    """Rangers (r,) fixed to the ground, for `follow`."""
    return lambda t: stations[None, :, None]


def carried(stations: MirrorStation, path: AntennaPath, when: float) -> Stations:
    """Rangers (r,) on the reflector's frame, for `follow`.

    Their stations are at one time.

    stations    (r,), in the ground frame at `when`
    path        of the telescope
    when        s

    Source: [PARKER04] section 2.6.1: R_i and gamma are functions of azimuth and elevation.
    """
    place, first = path.motion(np.zeros((1, 3)), "reflector", when)[0][0], path.rotation(when)
    own_point = (stations.scan_point - place) @ first
    own_gamma = stations.gamma @ first

    def at(t: Array) -> MirrorStation:
        own_places, _, _ = path.motion(own_point, "reflector", t)
        gamma = own_gamma[None] @ np.swapaxes(path.rotation(t), -1, -2)[:, None]
        moved = MirrorStation.from_matrix(
            own_places, gamma, offset=stations.offset, beta=stations.beta, zeros=stations.zeros
        )
        return moved[:, :, None]

    return at


def fixed(points: ArrayLike, frame: str, path: AntennaPath) -> Targets:
    """Targets (n, 3), m, fixed in a frame of the telescope, for `follow`."""
    local = np.asarray(points, dtype=float)
    return lambda t: path.motion(local, frame, t)[0][:, None]


class Following(IntEnum):
    """Status of a target that a ranger is to follow."""

    FOLLOWED = 0
    BEYOND_STOPS = 1
    TOO_FAST = 2
    NOWHERE = 3


REASONS = {
    Following.FOLLOWED: "followed",
    Following.BEYOND_STOPS: "leaves the azimuth stops in either pointing (expected a shorter track, or another ranger)",
    Following.TOO_FAST: "exceeds the axes' rate: it passes near the azimuth axis",
    Following.NOWHERE: "has no direction: it meets the scan point, or no setting of the mirror with its offsets looks "
    "there",
}


@dataclass(frozen=True, eq=False)
class CountTrack:
    """Counts along which rangers follow targets, interval by interval.

    begin      (s,) instants t0
    since      (s + 1,) s from the first t0: limits of the intervals
    lines      (s, r, p): real counts; meaningless for pairs not followed
    prime      (r, p) bool: in the prime pointing, throughout
    status     (r, p) of Following
    """

    begin: TimeTag
    since: Array
    lines: CountLine
    prime: NDArray[np.bool_]
    status: NDArray[np.int64]

    def reason(self, ranger: int, target: int) -> str:
        """Status of a ranger and a target as one line."""
        return REASONS[Following(int(self.status[ranger, target]))]


def follow(
    stations: Stations,
    targets: Targets,
    begin: TimeTag,
    *,
    intervals: int,
    interval: float = BUFFER,
    limits: ArrayLike = (-np.inf, np.inf),
    most_rate: float = np.inf,
    imperfections: Imperfections | None = None,
) -> CountTrack:
    """Counts of every ranger for every target, with status.

    At the ends of each interval; the status says if they can be run.

    stations    times (s,) -> Station (s or 1, r, 1); times count from `begin`
    targets     times (s,) -> points (s, 1 or r, p, 3), m, ground
    begin       the first t0
    intervals   number, 1 or more
    interval    s, a whole number of nanoseconds
    limits      azimuth stops (2,) or (r, 2), counts
    most_rate   counts/s, of either axis
    imperfections   axis offsets, tilts and encoder errors of every mirror; None: ideal mirrors

    A pair stays on one turn and in one pointing for the whole track: the direct one where the stops allow it, else the
    prime one. Failure is a status.

    Source: [PARKER04] eqs. 2.12-2.26, 2.45, 2.46; with imperfections `geometry.mirror.imperfect`.
    """
    if intervals < 1 or not 0.0 < interval < np.inf:
        raise ValidityError(f"{intervals} intervals of {interval} s are an empty track (expected 1 or more, above 0)")
    step = round(interval * PER_SECOND)
    if abs(interval * PER_SECOND - step) > 1e-6 * max(1.0, 1e-6 * step):
        raise ValidityError(f"interval {interval!r} s is not a whole number of nanoseconds, as time tags are")
    steps = step * np.arange(intervals + 1)
    since = steps / PER_SECOND
    station, points = stations(since), targets(since)
    nodes, prime_nodes = (_continuous(_exact_counts(station, points, imperfections, prime)) for prime in (False, True))
    low, high = (np.asarray(limits, dtype=float)[..., k] for k in (0, 1))
    if not np.all(low < high):
        raise ValidityError(f"azimuth limits {np.asarray(limits).tolist()} are not in order (expected low < high)")
    low, high = (np.broadcast_to(x, station.shape[1:2])[:, None] for x in (low, high))
    direct, allowed = _on_one_turn(nodes, low, high)
    prime, allowed_prime = _on_one_turn(prime_nodes, low, high)
    second = ~allowed & allowed_prime
    chosen = np.where(second[None, :, :, None], prime, direct)
    lines = CountLine(chosen[:-1], chosen[1:], np.full(chosen.shape[:-1], interval)[:-1])
    status = np.where(allowed | allowed_prime, Following.FOLLOWED, Following.BEYOND_STOPS)
    fast = np.abs(lines.rate).max(axis=(0, -1)) > most_rate
    status = np.where((status == Following.FOLLOWED) & fast, Following.TOO_FAST, status)
    status = np.where(np.isfinite(chosen).all(axis=(0, -1)), status, Following.NOWHERE)
    return CountTrack(begin.plus(steps[:-1]), since, lines, second, status.astype(np.int64))


def misses(
    track: CountTrack,
    stations: Stations,
    targets: Targets,
    *,
    whole_counts: bool = False,
    shares: ArrayLike = SHARES,
    imperfections: Imperfections | None = None,
) -> Array:
    """Distances (s, k, r, p), m, of the beams from their targets.

    At shares of each interval.

    track, stations, targets   as followed
    whole_counts               round the mirrors to the nearest whole count
    shares                     (k,) 0 to 1 of the interval
    imperfections              of every mirror; the track may have been followed without them

    Source: exact rays, `track.miss`.
    """
    passed = []
    for share in np.asarray(shares, dtype=float):
        t = track.since[:-1] + share * np.diff(track.since)
        counts = track.lines.at(share * track.lines.interval)
        passed.append(miss(stations(t), np.rint(counts) if whole_counts else counts, targets(t), imperfections))
    return np.stack(passed, axis=1)


def count_errors(
    track: CountTrack,
    stations: Stations,
    targets: Targets,
    *,
    shares: ArrayLike = SHARES,
    imperfections: Imperfections | None = None,
) -> Array:
    """Linear counts less exact ones (s, k, r, p, 2), counts, at shares of each interval.

    track, stations, targets   as followed
    shares                     (k,) 0 to 1 of the interval
    imperfections              of every mirror, as followed

    Source: [PARKER04] eqs. 2.45 and 2.46 against 2.12 to 2.22 at every instant.
    """
    errors = []
    for share in np.asarray(shares, dtype=float):
        t = track.since[:-1] + share * np.diff(track.since)
        exact = _exact_counts(stations(t), targets(t), imperfections, track.prime[None])
        off = track.lines.at(share * track.lines.interval) - exact
        off[..., 0] -= COUNTS_PER_TURN * np.rint(off[..., 0] / COUNTS_PER_TURN)
        errors.append(off)
    return np.stack(errors, axis=1)


def ideal_track(track: CountTrack, stations: Stations, targets: Targets) -> CountTrack:
    """Track of the same mirrors without imperfections, in the same pointings and on the same turns.

    track, stations, targets   as followed, with imperfections

    Source: [PARKER04] eqs. 2.12-2.26.
    """
    nodes = _exact_counts(stations(track.since), targets(track.since), None, track.prime[None])
    followed = np.concatenate([track.lines.start, track.lines.end[-1:]])
    turns = np.rint((followed[..., 0] - nodes[..., 0]) / COUNTS_PER_TURN)
    nodes[..., 0] += COUNTS_PER_TURN * turns
    return replace(track, lines=replace(track.lines, start=nodes[:-1], end=nodes[1:]))


def smear(range_rate: ArrayLike, *, wavelength: float, duration: float = BUFFER) -> tuple[Array, Array]:
    """Phase run and amplitude share of a range that changes during a buffer.

    Run of the phase (...), rad.

    range_rate    (...) m/s, of the distance
    wavelength    m, above 0: of the modulation in air
    duration      s, above 0, of the buffer

    The phase runs by -4 pi v T / wavelength; the sum over the buffer keeps sin(x)/x of it, x half that run. It
    vanishes where the range changes by half a wavelength.

    Source: [PARKER04] eqs. 5.1-5.3 and 5.9 for a phase that runs evenly. Exact.

    >>> run, left = smear([0.0, 0.0999 / 0.128], wavelength=0.1998)
    >>> (run + 0.0).round(6).tolist(), left.round(6).tolist()
    ([0.0, -6.283185], [1.0, 0.0])
    """
    if not (0.0 < wavelength < np.inf and 0.0 < duration < np.inf):
        raise ValidityError(f"wavelength {wavelength} m, duration {duration} s: expected both above 0 and finite")
    run = -2.0 * TWO_PI * np.asarray(range_rate, dtype=float) * duration / wavelength
    return run, np.abs(np.sinc(0.5 * run / np.pi))


def _exact_counts(
    station: MirrorStation, points: Array, imperfections: Imperfections | None, prime: ArrayLike
) -> Array:
    """Counts (..., 2) for points (..., 3), m, in the direct pointing, or in the prime one, half a turn above."""
    if imperfections is not None:
        return imperfect_counts(station, imperfections, points, prime=prime)
    direct = counts(station, points)
    zero = np.broadcast_to(station.zeros, (*station.shape, 2))
    second = np.stack([direct[..., 0] + HALF_TURN, 2.0 * zero[..., 1] - direct[..., 1]], axis=-1)
    return np.where(np.asarray(prime)[..., None], second, direct)


def _continuous(nodes: Array) -> Array:
    """Counts (s, ..., 2) without jumps of a turn of azimuth from time to time."""
    return np.stack([np.unwrap(nodes[..., 0], period=COUNTS_PER_TURN, axis=0), nodes[..., 1]], axis=-1)


def _on_one_turn(nodes: Array, low: Array, high: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Counts (s, r, p, 2) moved by whole turns to lie within the stops.

    And True (r, p) where that is possible.
    """
    least, most = nodes[..., 0].min(axis=0), nodes[..., 0].max(axis=0)
    with np.errstate(invalid="ignore"):
        bounded = np.isfinite(low) & (least < low)
        turns = np.where(bounded, np.ceil((np.where(np.isfinite(low), low, 0.0) - least) / COUNTS_PER_TURN), 0.0)
        over = np.isfinite(high) & (most + turns * COUNTS_PER_TURN > high)
        down = np.ceil((most + turns * COUNTS_PER_TURN - np.where(np.isfinite(high), high, 0.0)) / COUNTS_PER_TURN)
    turns = turns - np.where(over, down, 0.0)
    moved = nodes + (turns * COUNTS_PER_TURN)[None, :, :, None] * np.array([1.0, 0.0])
    shift = turns * COUNTS_PER_TURN
    return moved, within(least + shift, low, high) & within(most + shift, low, high)
