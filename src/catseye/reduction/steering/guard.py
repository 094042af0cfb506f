"""Guard of a ranger's mirror against the Sun, the structure and people.

Every move is checked before it is made.

    Guard(name, station, pace, azimuth_limits, place)   one ranger
        pointing(mjd, counts)           may the mirror stand there?
        slew(mjd, start, end)           may it go there, along the path of its two axes?
        route(mjd, waypoints)           ... from point to point: a search pattern, a scan
        track(mjd, counts)              ... at time-tagged counts, straight between them (eq. 2.45, 2.46)
        until(mjd, counts)              how long may it stand there?

A refusal is a value, a GuardAnswer with one line of text. The Sun's cone counts while the Sun is above `horizon`: its
middle may be seen 0.6 degrees below by refraction, its limb 0.3 more, and from 130 m above the ground the horizon lies
0.4 lower.

Between the Sun's directions at both ends of a move, uniform motion along the chord is assumed. Its acceleration, at
most w^2 and `BENDING` times that where refraction bends it most, bounds the error: w^2 T^2 / 8, added to the cone.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import DEGREE, SECONDS_PER_DAY
from catseye.errors import ValidityError
from catseye.geometry.clearance.keep_out import (
    TOUCH,
    BoxZone,
    ConeZone,
    Entries,
    EntryStatus,
    Zone,
    clearances,
    first_entry,
    servo_margin,
)
from catseye.geometry.mirror.encoder import COUNTS_PER_TURN, within
from catseye.geometry.mirror.pointing import MirrorStation, ray
from catseye.geometry.mirror.slew import MirrorSlew, Pace, straight, trapezoid
from catseye.geometry.sky.sun import SUN_RATE
from catseye.geometry.sky.time_tag import utc_text
from catseye.records.site.keep_out import KeepOut
from catseye.records.site.mirror import MirrorGeometry
from catseye.reduction.site.earth_rotation import FramePlace, sun_at

LOOK_AHEAD = 1.0  # days
SCAN = 60.0 / SECONDS_PER_DAY  # days, in which the Sun moves by a quarter of a degree
FIRST_LOOKS = 32  # at a fixed beam, SCAN apart; twice as many whenever they find no change
PLACES = 33  # samples of a move in the search for the deepest place in the Sun's cone
MOST_STARTS = 1000  # of a path that waits for the Sun
BENDING = 36.0  # of the Sun's path by refraction, per w^2; 20 at 1010 hPa, 10 C and an altitude of -1.9 degrees
BENDING_HIGH = 2.0  # above 5 degrees, where it is 1.4
HIGH = 5.0 * DEGREE
WIDEST = 0.99 * np.pi  # a cone that leaves no path
LONGEST = 60.0  # s, pieces of a halt or a track: the Sun moves between them
SETTLED = 1e-3  # s, resolution of the time when a beam becomes free


@dataclass(frozen=True)
class GuardAnswer:
    """Answer to a request.

    allowed     True if the mirror may
    reason      one line: reason of a refusal; else empty
    clearance   rad, from the nearest zone at the path's start or its entry; inf without zones
    at          s from the start of the path to the entry; None where there is none
    free_at_mjd time when the Sun permits the pointing, or the start of the path; None where waiting does not help
    """

    allowed: bool
    reason: str
    clearance: float
    at: float | None = None
    free_at_mjd: float | None = None


@dataclass(frozen=True)
class Guard:
    """One ranger and its forbidden zones.

    name              of the ranger, for the answers
    station           its mirror on its monument
    pace              speeds and accelerations of its axes
    azimuth_limits    counts, low and high, both allowed
    place             origin of the ground frame, or None: the Sun is not watched
    boxes             structure and people
    half_angle        rad, of the Sun's cone about its middle
    margin_counts     largest error of each axis against its profile: following, overshoot, settling, and one axis
                      starting after the other (10 ms at 10 000 counts/s are 100 counts)
    horizon           rad: below this altitude the Sun is set; -pi/2 keeps its cone always
    off_beam          rad: largest error of the mirror's beam, by tilts and encoder errors
    """

    name: str
    station: MirrorStation
    pace: Pace
    azimuth_limits: tuple[float, float]
    place: FramePlace | None
    boxes: tuple[BoxZone, ...] = ()
    half_angle: float = 5.0 * DEGREE
    margin_counts: tuple[float, float] = (20.0, 20.0)
    horizon: float = -2.0 * DEGREE
    off_beam: float = 0.0
    margin: float = field(init=False)

    def __post_init__(self) -> None:
        low, high = self.azimuth_limits
        if not low < high:
            raise ValidityError(f"{self.name}: azimuth limits {low:g}, {high:g} are not low, high")
        if not 0.0 < self.half_angle < 0.5 * np.pi:
            raise ValidityError(f"{self.name}: half angle {self.half_angle:g} rad is outside 0 to pi/2: check its unit")
        if self.station.shape != ():
            raise ValidityError(f"{self.name}: stations {self.station.shape} (expected one)")
        if not 0.0 <= self.off_beam < 0.5 * np.pi:
            raise ValidityError(f"{self.name}: off_beam {self.off_beam:g} rad is outside 0 to pi/2: check its unit")
        if not -0.5 * np.pi <= self.horizon <= 0.5 * np.pi:
            raise ValidityError(f"{self.name}: horizon {self.horizon:g} rad is outside -pi/2 to pi/2: check its unit")
        late = np.array(self.pace.velocity) * self.pace.start_skew
        object.__setattr__(self, "margin", servo_margin(np.add(self.margin_counts, late)) + self.off_beam)

    def clearance(self, mjd: ArrayLike, counts: ArrayLike, *, exact_below: float = np.inf) -> NDArray[np.float64]:
        """Angle (..., 1 + boxes), rad, from fixed beams to the zones.

        The Sun's cone, then the boxes; margin subtracted.

        mjd       (...), UTC
        counts    (..., 2), azimuth and elevation
        exact_below  rad: above it a box's angle may be underestimated

        A mirror may stand where all are above TOUCH; `pointing` gives this as an answer.
        """
        shape = np.broadcast_shapes(np.shape(mjd), np.shape(counts)[:-1])
        n = np.broadcast_to(np.asarray(counts, dtype=float), (*shape, 2))
        return self.around(mjd, ray(self.station, n).direction, exact_below + self.margin) - self.margin

    def around(self, mjd: ArrayLike, direction: ArrayLike, exact_below: float = np.inf) -> NDArray[np.float64]:
        """Angle (..., 1 + boxes), rad, from directions to the zones.

        Directions (..., 3), unit, ground; the Sun's cone, then the boxes.
        """
        days = np.asarray(mjd, dtype=float)
        zones: list[Zone] = [self._cone(days, np.zeros(days.shape)), *self.boxes]
        return clearances(zones, self.station.scan_point, direction, exact_below=exact_below)

    def entries(
        self, mjd: ArrayLike, slews: MirrorSlew, *, widened: float = 0.0, compiled: bool | None = None
    ) -> Entries:
        """Entries of moves (n,) into the zones; zone 0 is the Sun.

        Each move begins at its mjd, (n,) or one; then the boxes.

        widened    rad, added to the Sun's cone
        compiled   as for `first_entry`
        """
        start = np.broadcast_to(np.asarray(mjd, dtype=float), slews.shape)
        sun = self._cone(start, slews.total)
        sun = replace(sun, half_angle=sun.half_angle + widened)
        return first_entry(self.station, slews, (sun, *self.boxes), margin=self.margin, compiled=compiled)

    def pointing(self, mjd: float, counts: ArrayLike) -> GuardAnswer:
        """Answer for a mirror at counts (2,) at a time.

        If the Sun forbids it, with the time when it is permitted.
        """
        n = _pair(counts)
        gap = self.clearance(mjd, n)
        remaining = float(np.min(gap))
        stops_text = self._stops_violation(n)
        if stops_text:
            return GuardAnswer(False, f"{self.name}: pointing at {_counts_text(n)}: {stops_text}", remaining)
        if remaining > TOUCH:
            return GuardAnswer(True, "", remaining)
        zone = int(np.argmin(gap))
        text = f"{self.name}: pointing at {_counts_text(n)} {self._nearness(zone, remaining)}"
        return self._refused(text, zone, remaining, self._change(mjd, n) if zone == 0 else None, None)

    def slew(self, mjd: float, start: ArrayLike, end: ArrayLike) -> GuardAnswer:
        """Answer for a slew from counts to counts (2,), beginning at mjd.

        Along the profiles of its axes.
        """
        return self.route(mjd, [_pair(start), _pair(end)])

    def route(self, mjd: float, waypoints: ArrayLike, dwell: float = 0.0) -> GuardAnswer:
        """Answer for a path through counts (n, 2), n at least 2.

        Halting at each for a dwell, s.
        """
        points = np.asarray(waypoints, dtype=float)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not 0.0 <= dwell < np.inf:
            raise ValidityError(
                f"{self.name}: waypoints {points.shape} and dwell {dwell} s: expected (n, 2), 0 or above"
            )
        moves = trapezoid(points[:-1], points[1:], self.pace)
        if dwell > 0.0:
            halts = straight(points, points, dwell)
            order = np.argsort(np.r_[np.arange(len(points)) * 2, np.arange(len(moves.start)) * 2 + 1])
            parts = [np.concatenate([getattr(halts, k), getattr(moves, k)])[order] for k in MirrorSlew.__annotations__]
            moves = MirrorSlew(*parts)
        before = np.concatenate([[0.0], np.cumsum(moves.total)[:-1]])
        return self._along(mjd, before, moves, word="slew", waits=True)

    def track(self, mjd: ArrayLike, counts: ArrayLike) -> GuardAnswer:
        """Answer for a track of counts (n, 2) at rising times mjd (n,).

        Straight between them; n at least 2.
        """
        times, points = np.asarray(mjd, dtype=float), np.asarray(counts, dtype=float)
        if times.ndim != 1 or points.shape != (len(times), 2) or len(times) < 2 or not np.all(np.diff(times) > 0.0):
            raise ValidityError(f"{self.name}: a track needs rising times (n,) and counts (n, 2), n at least 2")
        steps = np.diff(times) * SECONDS_PER_DAY
        before = (times[:-1] - times[0]) * SECONDS_PER_DAY
        moves = straight(points[:-1], points[1:], steps)
        return self._along(float(times[0]), before, moves, word="track", waits=False)

    def until(self, mjd: float, counts: ArrayLike) -> float | None:
        """Time when the Sun's cone reaches a mirror at counts (2,).

        mjd if it is there already; None within a day.
        """
        return self._change(mjd, _pair(counts), comes=True)

    def _along(
        self, mjd: float, before: NDArray[np.float64], moves: MirrorSlew, *, word: str, waits: bool
    ) -> GuardAnswer:
        """Answer for consecutive moves, each `before` s after mjd.

        `waits`: all may begin later.
        """
        for n in (*moves.start, moves.end[-1]):
            stops_text = self._stops_violation(n)
            if stops_text:
                return GuardAnswer(False, f"{self.name}: {word} by {_counts_text(n)}: {stops_text}", np.nan)
        before, moves = _cut(before, moves)
        bad = self._first_bad(mjd, before, moves)
        if bad is None:
            return GuardAnswer(True, "", float(np.min(self.clearance(mjd, moves.start[0]))))
        at, n, zone, inside = bad
        when = mjd + at / SECONDS_PER_DAY
        # A cone that counts for part of a move counts for all of it, also before sunrise.
        remaining = float(replace(self, horizon=-0.5 * np.pi).clearance(when, n)[zone])
        place = f"starts at {_counts_text(n)}, which" if inside else f"after {at:.3f} s at {_counts_text(n)}"
        text = f"{self.name}: {word} to {_counts_text(moves.end[-1])} {place} {self._nearness(zone, remaining)}"
        free = (self._free_start(mjd, before, moves) if waits else self._change(when, n)) if zone == 0 else None
        return self._refused(text, zone, remaining, free, at)

    def _first_bad(
        self, mjd: float, before: NDArray[np.float64], moves: MirrorSlew
    ) -> tuple[float, NDArray[np.float64], int, bool] | None:
        """First entry of consecutive moves.

        Time, s after mjd, counts, zone, and True if it is their start.
        """
        entries = self.entries(mjd + before / SECONDS_PER_DAY, moves)
        bad = np.flatnonzero(entries.status)
        if len(bad) == 0:
            return None
        first = int(bad[0])
        inside = first == 0 and entries.status[0] == EntryStatus.STARTS_INSIDE
        time = entries.time[first]
        return float(before[first] + time), moves[first].position(time), int(entries.zone[first]), inside

    def _free_start(self, mjd: float, before: NDArray[np.float64], moves: MirrorSlew) -> float | None:
        """First start from which the whole path avoids the Sun.

        None if none is within a day, or a box is hit.

        The deepest place of the path stays in the cone until `_change`: no start that reaches it earlier succeeds.
        """
        start = mjd
        for _ in range(MOST_STARTS):
            bad = self._first_bad(start, before, moves)
            if bad is None:
                return start
            time, n = self._deepest(start, before, moves) if bad[2] == 0 else bad[:2]
            when = start + time / SECONDS_PER_DAY
            free = self._change(when, n)
            if bad[2] > 0 or free is None:
                return None
            start += max(free - when, 0.1 * SCAN)
            if start > mjd + LOOK_AHEAD:
                return None
        return None

    def _deepest(self, mjd: float, before: NDArray[np.float64], moves: MirrorSlew) -> tuple[float, NDArray[np.float64]]:
        """Time, s after mjd, and counts of the deepest sample in the Sun's cone.

        Of consecutive moves.
        """
        times = moves.total[:, None] * np.linspace(0.0, 1.0, PLACES)
        n = moves[:, None].position(times)
        after = before[:, None] + times
        deepest = np.unravel_index(np.argmin(self._from_sun(mjd + after / SECONDS_PER_DAY, n)), after.shape)
        return float(after[deepest]), n[deepest]

    def _from_sun(self, mjd: ArrayLike, counts: ArrayLike) -> NDArray[np.float64]:
        """First column of `clearance`."""
        days, n = np.asarray(mjd, dtype=float), np.asarray(counts, dtype=float)
        direction = ray(self.station, n).direction
        return self._cone(days, np.zeros(days.shape)).clearance(direction) - self.margin

    def _refused(self, text: str, zone: int, remaining: float, free: float | None, at: float | None) -> GuardAnswer:
        if zone > 0:
            why = self.boxes[zone - 1].why
            ending = f"a box is permanent{f' ({why})' if why else ''}: choose another path or target"
        elif free is None:
            ending = f"not free within {LOOK_AHEAD:g} day: choose another path or target"
        else:
            ending = f"free at {utc_text(free)}"
        return GuardAnswer(False, f"{text}; {ending}", remaining, at, free)

    def _nearness(self, zone: int, remaining: float) -> str:
        """Distance of a beam to a zone as a text.

        `remaining` (rad, margin subtracted) is the free angle.
        """
        margin = f"{self.margin / DEGREE:.2f} deg for {'servo, tilts and encoders' if self.off_beam else 'the servo'}"
        if zone == 0:
            angle = (remaining + self.margin + self.half_angle) / DEGREE
            return f"is {angle:.1f} deg from the Sun (limit {self.half_angle / DEGREE:.1f} deg and {margin})"
        angle = (remaining + self.margin) / DEGREE
        box = self.boxes[zone - 1].name
        return f"hits {box}" if angle <= 0.0 else f"is {angle:.2f} deg from {box} (limit {margin})"

    def _stops_violation(self, n: NDArray[np.float64]) -> str:
        low, high = self.azimuth_limits
        if not within(n[0], low, high):
            return f"azimuth count {n[0]:.1f} is outside {low:g} to {high:g}"
        zero = float(self.station.zeros[1])
        if abs(n[1] - zero) > COUNTS_PER_TURN:
            return f"elevation count {n[1]:.1f} is more than a turn from {zero:.1f}"
        return ""

    def _cone(self, mjd: NDArray[np.float64], total: NDArray[np.float64]) -> ConeZone:
        """Sun's cone for paths from mjd (...) with a total (...) s.

        None while the Sun is set.
        """
        if self.place is None:
            return ConeZone(np.array([0.0, 0.0, 1.0]), np.array(-np.inf))
        sun = sun_at(np.stack([mjd, mjd + total / SECONDS_PER_DAY]), self.place).direction
        highest = np.max(np.arcsin(np.clip(sun[..., 2], -1.0, 1.0)), axis=0) + 0.5 * SUN_RATE * total
        bend = (SUN_RATE * total) ** 2 / 8.0
        if self.place.pressure_hpa is not None:
            lowest = np.min(np.arcsin(np.clip(sun[..., 2], -1.0, 1.0)), axis=0) - 0.5 * SUN_RATE * total
            bend = bend * np.where(lowest > HIGH, BENDING_HIGH, BENDING)
        half = np.where(highest >= self.horizon, np.minimum(self.half_angle + bend, WIDEST), -np.inf)
        return ConeZone(sun[0], half, sun[1])

    def _change(self, mjd: float, n: NDArray[np.float64], *, comes: bool = False) -> float | None:
        """First time from mjd on when the Sun's cone leaves, or reaches, a beam.

        None within a day.

        Sampled once a minute, then halved down to a millisecond: a change of less than a minute may be missed, and the
        next is returned. None too where a box blocks the beam.
        """
        if self.place is None or np.any(self.clearance(mjd, n)[1:] <= TOUCH):
            return None

        def changed(days: ArrayLike) -> NDArray[np.bool_]:
            return (self._from_sun(days, n) <= TOUCH) == comes

        start, looks = mjd, FIRST_LOOKS
        while start <= mjd + LOOK_AHEAD:
            grid = start + SCAN * np.arange(looks)
            grid = grid[grid <= mjd + LOOK_AHEAD]
            hit = np.flatnonzero(changed(grid))
            if len(hit):
                before, after = grid[hit[0]] - SCAN, grid[hit[0]]
                if after == mjd:
                    return float(mjd)
                while (after - before) * SECONDS_PER_DAY > SETTLED:
                    middle = 0.5 * (before + after)
                    before, after = (before, middle) if changed(middle) else (middle, after)
                return float(after)
            start, looks = grid[-1] + SCAN, 2 * looks
        return None


def _cut(before: NDArray[np.float64], moves: MirrorSlew) -> tuple[NDArray[np.float64], MirrorSlew]:
    """Consecutive moves with those of even speed cut into pieces.

    Each `before` s after the start; pieces of at most LONGEST.
    """
    even = np.all(moves.ramp == 0.0, axis=-1)
    pieces = np.where(even, np.maximum(np.ceil(moves.total / LONGEST), 1.0), 1.0).astype(int)
    if np.all(pieces == 1):
        return before, moves
    which = np.repeat(np.arange(len(pieces)), pieces)
    share = (np.arange(len(which)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[which]
    long_moves, displacement = moves[which], (moves.end - moves.start)[which]
    start = long_moves.start + share[:, None] * displacement
    end = long_moves.start + (share + 1.0 / pieces[which])[:, None] * displacement
    cut = MirrorSlew(start, end, long_moves.ramp, long_moves.duration / pieces[which, None])
    return before[which] + share * long_moves.total, cut


def guard_of(
    name: str,
    station: MirrorStation,
    mirror: MirrorGeometry,
    *,
    keep_out: KeepOut,
    place: FramePlace | None,
    pace: Pace,
) -> Guard:
    """Guard of a ranger by its records.

    name        of the ranger
    station     of its monument and mirror (`pointing.station_of`), or on the feed arm at the telescope's posture
    mirror      its stops, and its tilts and encoder errors, whose sizes together widen every zone
    keep_out    boxes, cone, horizon, margin
    place       of the ground frame's origin (`reduction.site.earth_rotation.place_of`); None ignores the Sun
    pace        of its axes
    """
    encoder = [
        sum(abs(c) for side in ("cosine", "sine") for c in getattr(mirror, f"{axis}_encoder_{side}_counts"))
        for axis in ("azimuth", "elevation")
    ]
    # The beam turns by twice the face's angle.
    tilt = 2.0 * abs(mirror.face_tilt_rad) + float(np.hypot(mirror.beam_tilt_x_rad, mirror.beam_tilt_y_rad))
    return Guard(
        name=name,
        station=station,
        pace=pace,
        azimuth_limits=(mirror.az_low_limit, mirror.az_high_limit),
        place=place,
        boxes=keep_out.boxes(),
        half_angle=keep_out.sun.half_angle_deg * DEGREE,
        margin_counts=keep_out.margin_counts,
        horizon=keep_out.sun.horizon_deg * DEGREE,
        off_beam=servo_margin(encoder) + tilt,
    )


def _pair(counts: ArrayLike) -> NDArray[np.float64]:
    n = np.asarray(counts, dtype=float)
    if n.shape != (2,) or not np.isfinite(n).all():
        raise ValidityError(f"counts {n.tolist()} are not two finite numbers (azimuth, elevation)")
    return n


def _counts_text(n: NDArray[np.float64]) -> str:
    return f"counts {n[0]:.1f}, {n[1]:.1f}"
