"""Simulated mirror axes in time: moves, index search, tracking, faults.

Time is the number of samples of the motion chips since the head was built. `pass_to` brings the axes there in one
step or in many with the same result: searches and tracks act at fixed samples.
"""

from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import ceil

import numpy as np
from numpy.typing import NDArray

from catseye.constants import TWO_PI
from catseye.errors import InputError
from catseye.ranger.head import Homing
from catseye.ranger.motion_units import FRACTION, SAMPLE_TIME, acceleration_integer, velocity_integer
from catseye.records.site.mirror import MirrorGeometry
from catseye.simulator.servo.axis import HOMING_TIME, ServoAxis
from catseye.simulator.servo.kernel import AT_END, AT_INDEX, CompiledAxes
from catseye.simulator.servo.motion_chip import MotionChip
from catseye.simulator.servo.motor import AxisDesign, Motor
from catseye.simulator.servo.tuning import design_filter, plant_of
from catseye.simulator.twin.faults import FaultBoard

TRAVEL = ((-29_000, 77_000), (-32_000, 32_000))  # counts: wide enough for every mirror of the site
STOP_DISTANCE = 500  # counts from an allowed one to the stop
INTERVAL = 30  # samples between updates of a track, 10 ms
ENOUGH = 0.02  # counts of error of a track before a new speed
FARTHEST = 1e8  # counts of a track; the chip's end is at 2^30
NEAR_STOP = 2_000  # counts from a stop: no mirror is nearer at power-off
READS, BETWEEN = 5, 3  # successive readings of the index position, and samples between them
Job = Generator[tuple[int, int], None, None]  # yields the sample to continue at, and events to watch before it


def mirror_filter() -> tuple[int, int, int, int, int]:
    """Filter that settles the assumed axis to the count.

    docs/studies/servo.md, 30 Hz, interval 3.
    """
    return design_filter(plant_of(AxisDesign()), crossover_hz=30.0, interval=3).values


def travel_of(mirror: MirrorGeometry) -> tuple[tuple[float, float], tuple[float, float]]:
    """Counts between which the stops allow motion.

    Limits of azimuth, and all beams above or prime.
    """
    return (
        (mirror.az_low_limit - STOP_DISTANCE, mirror.az_high_limit + STOP_DISTANCE),
        (mirror.ne0 - 25_000 - STOP_DISTANCE, mirror.ne0 + 25_000 + STOP_DISTANCE),
    )


@dataclass(frozen=True)
class MirrorTuning:
    """Drive settings without a command.

    filter         kp, ki, kd, integration limit, derivative interval
    velocity       of searches and tracks, counts/s
    acceleration   of the same, counts/s^2
    error_limit    counts
    """

    filter: tuple[int, int, int, int, int] = field(default_factory=mirror_filter)
    velocity: float = 12_000.0
    acceleration: float = 40_000.0
    error_limit: int = 5_000


@dataclass(frozen=True, eq=False)
class CountSegment:
    """Counts (2,) at two samples, possibly fractions; linear between, held at ends."""

    samples: tuple[float, float]
    counts: tuple[NDArray[np.float64], NDArray[np.float64]]

    def at(self, sample: float, axis: int) -> float:
        """Counts of an axis at a sample."""
        (t0, t1), (n0, n1) = self.samples, self.counts
        share = min(max((sample - t0) / (t1 - t0), 0.0), 1.0)
        return float(n0[axis] + share * (n1[axis] - n0[axis]))

    def rate(self, sample: float, axis: int) -> float:
        """Counts a sample from a sample on."""
        (t0, t1), (n0, n1) = self.samples, self.counts
        return float(n1[axis] - n0[axis]) / (t1 - t0) if t0 <= sample < t1 else 0.0


class TwinMirror:
    """Both axes of a mirror behind their motion chips.

    ranger      its name, for its faults
    stands      (2,) counts from the index at power-on
    travel      lowest and highest counts of each axis that its stops allow
    tuning      drive settings without a command
    faults      of the twin
    origin      s since the twin's start at sample 0

    Raises InputError: the index is not between the stops, or twice, or the mirror is beyond one.
    """

    def __init__(
        self,
        ranger: str,
        stands: NDArray[np.float64],
        *,
        travel: tuple[tuple[float, float], tuple[float, float]] = TRAVEL,
        tuning: MirrorTuning | None = None,
        faults: FaultBoard,
        origin: float,
    ):
        self.ranger, self.faults, self.origin = ranger, faults, origin
        self.tuning = tuning or MirrorTuning()
        self._motors = [_motor(ranger, k, float(stands[k]), travel[k]) for k in (0, 1)]
        self.samples = 0
        self._power_on()

    def reset(self) -> None:
        """Switch power off and on: chips reset, amplifiers off, mirror in place."""
        for k in (0, 1):
            self.axes.axis(k)  # the motors keep their motion
        self._power_on()

    def _power_on(self) -> None:
        self.axes = CompiledAxes([ServoAxis(MotionChip(), motor) for motor in self._motors])
        self.homing: list[Homing] = ["never", "never"]
        self._jobs: dict[str, tuple[Job, int, int, int]] = {}  # name -> job, its next sample, axis and watch
        self._marks: list[int] = []
        self.marked: list[tuple[int, NDArray[np.float64]]] = []
        for k in (0, 1):
            self.set_filter(k, self.tuning.filter)
            self.set_error_limit(k, self.tuning.error_limit)

    # Time -----------------------------------------------------------------------------------------------------------

    @property
    def idle(self) -> bool:
        """True if nothing changes until a command."""
        return not self._jobs and not self._marks and self.axes.at_rest

    def pass_to(self, sample: int) -> None:
        """Bring both axes to a sample."""
        while self.samples < sample:
            if self.axes.at_rest and not self._jobs:  # all marks before the end have the present position
                marks = [n for n in self._marks if n <= sample]
                counts, self._marks = self.axes.counts, self._marks[len(marks) :]
                self.marked += [(n, counts) for n in marks]
                self.samples += self.axes.skip(sample - self.samples)
                return
            stop = min([sample, *self._marks[:1], *(job[1] for job in self._jobs.values())])
            stop = self._spoil(stop)
            self.samples += self.axes.skip(stop - self.samples)
            while self._marks and self._marks[0] <= self.samples:
                self.marked.append((self._marks.pop(0), self.axes.counts))
            for name, (_, wake, axis, watch) in list(self._jobs.items()):
                if name in self._jobs and (wake <= self.samples or self._event(axis, watch)):
                    self._go_on(name)

    def mark(self, samples: Iterable[int]) -> None:
        """Record in `marked` the true positions at these samples.

        Ascending and not yet past.
        """
        self._marks, self.marked = [int(n) for n in samples], []
        while self._marks and self._marks[0] <= self.samples:
            self.marked.append((self._marks.pop(0), self.axes.counts))

    def _spoil(self, stop: int) -> int:
        """Apply the present faults; sample before `stop` where one changes."""
        if not self.faults.faults:
            for k in (0, 1):
                self.axes.spoil(k, stuck=False, blind=False)
            return stop
        instant = self.origin + self.samples * SAMPLE_TIME
        for k in (0, 1):
            stuck = self.faults.active("stuck-axis", self.ranger, k, at=instant) is not None
            blind = self.faults.active("lost-index", self.ranger, k, at=instant) is not None
            self.axes.spoil(k, stuck=stuck, blind=blind)
        for fault in self.faults.faults:
            for edge in (fault.start, fault.end):
                if instant < edge < self.origin + stop * SAMPLE_TIME:
                    stop = min(stop, max(self.samples + 1, ceil((edge - self.origin) / SAMPLE_TIME)))
        return stop

    def _event(self, axis: int, watch: int) -> bool:
        return bool((watch & AT_INDEX and self.axes.index_found(axis)) or (watch & AT_END and self.axes.complete(axis)))

    def _begin(self, name: str, job: Job, axis: int) -> None:
        self._jobs[name] = (job, self.samples, axis, 0)
        self._go_on(name)

    def _go_on(self, name: str) -> None:
        job, _, axis, _ = self._jobs[name]
        wake, watch = next(job, (0, -1))
        if watch < 0:
            self._give_up(name)
            return
        self._jobs[name] = (job, max(wake, self.samples + 1), axis, watch)
        self.axes.watch(axis, watch)

    def _give_up(self, name: str) -> None:
        if name in self._jobs:
            self.axes.watch(self._jobs.pop(name)[2], 0)

    @contextmanager
    def _axis(self, k: int) -> Iterator[ServoAxis]:
        yield self.axes.axis(k)
        self.axes.take(k)

    # Commands: of the sample reached ---------------------------------------------------------------------------------

    def enable(self, k: int, on: bool) -> None:
        """Switch the amplifier of an axis."""
        with self._axis(k) as axis:
            axis.axis(on)

    def enabled(self, k: int) -> bool:
        """True if an axis is switched on."""
        return self.axes.enabled(k)

    def set_filter(self, k: int, values: tuple[int, int, int, int, int]) -> None:
        """Set filter values from the next sample on; five zeros: own tuning."""
        with self._axis(k) as axis:
            axis.flt(*(values if any(values) else self.tuning.filter))

    def set_error_limit(self, k: int, counts: int) -> None:
        """Set the position error that switches the motor off."""
        with self._axis(k) as axis:
            axis.chip.limit_error(counts, stop=True)

    def start(self, k: int, position: int, *, velocity: int, acceleration: int) -> bool:
        """Begin a move; a track ends. False if not possible.

        Amplifier off, a search, or another acceleration in a move.
        """
        if not self.enabled(k) or self.homing[k] == "searching":
            return False
        if self.following:
            self._give_up("track")
            for axis_number in (0, 1):
                self._stop_abruptly(axis_number)
        with self._axis(k) as axis:
            axis.chip.load_trajectory(position=position, velocity=velocity, acceleration=acceleration, mode="position")
            return axis.chip.start()

    def stop(self) -> None:
        """End searches and tracks, slow moves down."""
        for name in list(self._jobs):
            self._give_up(name)
        for k in (0, 1):
            if self.homing[k] == "searching":
                self.homing[k] = "failed"
            with self._axis(k) as axis:
                axis.chip.seeking = False
                if not axis.chip.trajectory_complete:
                    axis.chip.stop("smooth")

    def _stop_abruptly(self, k: int) -> None:
        with self._axis(k) as axis:
            if not axis.chip.trajectory_complete:
                axis.chip.stop("abrupt")

    def _go(self, k: int, position: int) -> bool:
        with self._axis(k) as axis:
            axis.chip.load_trajectory(
                position=position,
                velocity=velocity_integer(self.tuning.velocity),
                acceleration=acceleration_integer(self.tuning.acceleration),
                mode="position",
            )
            return axis.chip.start()

    # The search for the index ----------------------------------------------------------------------------------------

    def find_home(self, k: int) -> None:
        """Begin the index search of an axis, as `ServoAxis.fhm`.

        A turn at most, back at a stop.
        """
        self._give_up("track")
        self._give_up(f"home {k}")
        self._stop_abruptly(k)
        if not self.enabled(k):
            self.homing[k] = "failed"
            return
        self.homing[k] = "searching"
        self._begin(f"home {k}", self._search(k), k)

    def _search(self, k: int) -> Job:
        end = self.samples + round(HOMING_TIME / SAMPLE_TIME)
        turn = self._motors[k].design.counts_per_turn
        for sense in (1, -1):
            with self._axis(k) as axis:
                axis.chip.find_index()
            self._go(k, self.axes.actual(k) + sense * turn)
            yield end, AT_INDEX | AT_END
            if self.axes.index_found(k) or not self.axes.motor_off(k):  # a full turn without a pulse, or too late
                break
        with self._axis(k) as axis:
            axis.chip.seeking = False
        if not self.axes.index_found(k):
            with self._axis(k) as axis:
                axis.chip.stop("off")  # it may press on a stop: a filter that winds up would miss the next home
            self.homing[k] = "failed"
            return
        at = self.axes.axis(k).chip.index_position
        for _ in range(2):  # braking beyond the index, it may meet a stop: the motor is off, and starts again
            self._go(k, at)
            yield end, AT_END
            if not self.axes.motor_off(k):
                break
        row = 0
        while row < READS and self.samples < end and not self.axes.motor_off(k):
            row = row + 1 if self.axes.actual(k) == at else 0
            yield self.samples + BETWEEN, 0
        if row == READS:
            with self._axis(k) as axis:
                axis.chip.define_home()
        self.homing[k] = "home" if row == READS else "failed"

    # Following -------------------------------------------------------------------------------------------------------

    @property
    def following(self) -> bool:
        """True while a track is active."""
        return "track" in self._jobs

    def follow(self, track: CountSegment) -> bool:
        """Follow a track with both axes. False: amplifier off, or a move.

        It takes over from an earlier track.

        Far from the line the chip makes a trapezoidal move at it, aimed ahead by its braking distance; near
        to it, in velocity mode, a new speed every 10 ms leads the profile to the line, half a count ahead,
        because the chip takes the whole part of its profile. A profile holds fractions of a count: errors do not
        accumulate. From the end on, a move holds the nearest whole count.

        Raises InputError: counts that are not numbers, or beyond the chip.
        """
        if not np.all(np.abs(track.counts) < FARTHEST):
            raise InputError(f"{self.ranger}: a track of counts {track.counts} (expected within {FARTHEST:g})")
        moves = not self.following and not all(self.axes.complete(k) for k in (0, 1))
        if moves or "searching" in self.homing or not all(self.enabled(k) for k in (0, 1)):
            return False
        if not self.following:  # a motor that went off, or an end at another acceleration: as at a move's start
            for k in (0, 1):
                self._go(k, self.axes.desired(k) if not self.axes.motor_off(k) else self.axes.actual(k))
        self._give_up("track")
        self._begin("track", self._follow(track), 0)
        return True

    def _follow(self, track: CountSegment) -> Job:
        while self.samples < track.samples[1]:
            stop = min([self.samples + INTERVAL, *(ceil(t) for t in track.samples if t > self.samples)])
            for k in (0, 1):
                if self.axes.motor_off(k):
                    return
                self._lead(k, track, stop)
            yield stop, 0
        for k in (0, 1):
            if not self.axes.motor_off(k):
                self._go(k, round(track.at(self.samples, k)))

    def _lead(self, k: int, track: CountSegment, stop: int) -> None:
        """Bring the profile of an axis to the track at a later sample."""
        span, rate = stop - self.samples, track.rate(self.samples, k)
        goal = track.at(stop, k) + 0.5
        (at, speed), top = self.axes.profile(k), self.tuning.velocity * SAMPLE_TIME
        if abs(goal - at - speed * span) < ENOUGH and not self.axes.complete(k):
            return
        rate_needed, room = (goal - at) / span, 0.5 * self.tuning.acceleration * SAMPLE_TIME**2 * span
        if abs(rate_needed - speed) <= room and abs(rate_needed - rate) <= room and abs(rate_needed) <= top:
            with self._axis(k) as axis:
                axis.chip.load_trajectory(
                    velocity=round(abs(rate_needed) * FRACTION),
                    mode="velocity",
                    direction=1 if rate_needed >= 0.0 else -1,
                )
                axis.chip.start()
        else:
            pace = min(max(rate, -top), top)
            braking = pace * abs(pace) / (2.0 * self.tuning.acceleration * SAMPLE_TIME**2)
            self._go(k, round(goal - 0.5 + braking))


def _motor(ranger: str, axis: int, stands: float, travel: tuple[float, float]) -> Motor:
    """Axis whose angle is zero at the index."""
    turn = AxisDesign().counts_per_turn
    low, high = travel
    if not -turn < low <= stands <= high < turn or not low < 0.0 < high:
        raise InputError(
            f"{ranger} axis {axis}: stands at {stands:g}, stops at {low:g} and {high:g} counts (expected it between "
            f"them, the index at 0 too, and less than a turn of {turn} counts to either stop)"
        )
    radians = TWO_PI / turn
    return Motor(AxisDesign(low_stop=low * radians, high_stop=high * radians), stands * radians)
