"""Simulated ranger hardware behind the server's head: mirror, converter, clock, power.

No thread and no sleep: at each call the head reads the clock and simulates up to it, servo included. While a mirror
is at rest nothing is computed. A return is sampled along the beam's true path during the buffer.

Five zeros as filter mean the head's own tuning: a ranger loads them at its boot, as they give no drive.
"""

from dataclasses import dataclass
from math import ceil
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from catseye.clock import Clock
from catseye.constants import TWO_PI
from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND, TimeTag
from catseye.ranger.head import Buffer, Homing, SamplingSettings
from catseye.ranger.motion_units import CLOCK_HZ, CLOCKS_PER_SAMPLE, SAMPLE_TIME
from catseye.simulator.night.faults import Streams
from catseye.simulator.night.head import VOLT_PER_CODE
from catseye.simulator.twin.converter import Converter
from catseye.simulator.twin.faults import FaultBoard
from catseye.simulator.twin.mirror import NEAR_STOP, TRAVEL, CountSegment, MirrorTuning, TwinMirror

POINTS = 24  # points in a buffer for mirror and return: 5.3 ms of 128 ms
LONGEST_STEP = 15  # samples between two of them, 5 ms, in longer buffers
MOST_POINTS = 4096  # a buffer of more than 20 s has wider points
LARGEST_CLOCK_ERROR = 5e-4  # s, of a clock that follows its time signal: a pulse per second and IRIG-B
LAGGING = 3_000  # samples that a head may lag before a mere query catches up, 1 s
SUPPLIES = {"+5": 5.0, "+12": 12.0, "-12": -12.0, "+24": 24.0}  # V


class HeadWorld(Protocol):
    """Site truth as needed by a head."""

    def seconds(self, ns: int, /) -> float:
        """Seconds since the twin's start, of nanoseconds since MJD 0."""
        ...

    def phasors(
        self, ranger: str, counts: NDArray[np.float64], seconds: NDArray[np.float64], /
    ) -> NDArray[np.complex128]:
        """Return (k,), V, with the mirror truly at counts (k, 2) at times (k,).

        Counts from its indices.
        """
        ...


@dataclass(frozen=True)
class HeadBuild:
    """Build of one head.

    travel        counts between the stops of azimuth and elevation: `mirror.travel_of(record)`
    clock_error   s, largest clock error while locked to its time signal
    converter     its electronics; drawn by the head's seed if None
    """

    travel: tuple[tuple[float, float], tuple[float, float]] = TRAVEL
    clock_error: float = LARGEST_CLOCK_ERROR
    converter: Converter | None = None


class TwinHead:
    """Simulated `ranger.head.RangerHead`.

    ranger        its name
    world         the site's truth
    clock         true UTC
    seed          of the twin: where the mirror stands at power on, offset, noise
    faults        of the twin: stuck-axis, lost-index, saturated-adc, drifting-clock are the head's
    tuning        drive settings without a command
    build         stops, clock, electronics

    Raises InputError: stops that exclude the index, or include it twice.
    """

    def __init__(
        self,
        ranger: str,
        world: HeadWorld,
        clock: Clock,
        *,
        seed: int,
        faults: FaultBoard | None = None,
        tuning: MirrorTuning | None = None,
        build: HeadBuild | None = None,
    ):
        build = build or HeadBuild()
        self.ranger, self._world, self._clock, self._seed = ranger, world, clock, seed
        self._faults = FaultBoard() if faults is None else faults
        rng = Streams(seed)(f"head/{ranger}")
        self._boot = clock.now_ns()
        self._mirror = TwinMirror(
            ranger,
            np.array([rng.uniform(low + NEAR_STOP, high - NEAR_STOP) for low, high in build.travel]),
            travel=build.travel,
            tuning=tuning,
            faults=self._faults,
            origin=world.seconds(self._boot),
        )
        self._offset = round(rng.uniform(-build.clock_error, build.clock_error) * PER_SECOND)
        self._set_at, self._latest = -float("inf"), 0
        self._converter = build.converter or Converter.of(ranger, seed)
        self._supplies = {name: volt * (1.0 + 0.01 * rng.uniform(-1.0, 1.0)) for name, volt in SUPPLIES.items()}
        self._warmth = rng.uniform(24.0, 30.0), rng.uniform(1.0, 3.0), rng.uniform(0.0, TWO_PI)
        self._forget()

    def _forget(self) -> None:
        self._taking: tuple[SamplingSettings, int, TimeTag, bool] | None = None
        self._last: Buffer | None = None
        self._laser = True

    # Time -----------------------------------------------------------------------------------------------------------

    def now(self) -> TimeTag:
        """UTC of the head's clock; a clock ahead waits for true time."""
        reading = self._reading(self._clock.now_ns())
        return TimeTag(np.asarray(reading // PER_DAY), np.asarray(reading % PER_DAY))

    def now_ns(self) -> int:
        """Clock reading as nanoseconds since MJD 0, for frequent calls."""
        return self._reading(self._clock.now_ns())

    def _reading(self, true_ns: int) -> int:
        seconds = self._world.seconds(true_ns)
        fault = self._faults.active("drifting-clock", self.ranger, at=seconds)
        drift = 0.0 if fault is None else fault.size * (seconds - max(fault.start, self._set_at))
        self._latest = max(self._latest, true_ns + self._offset + round(drift * PER_SECOND))
        return self._latest

    def set_clock(self, tag: TimeTag) -> None:
        """Set the clock; drift continues from there."""
        true_ns = self._clock.now_ns()
        self._set_at = self._world.seconds(true_ns)
        self._latest = _nanoseconds(tag)
        self._offset = self._latest - true_ns

    def clock_locked(self) -> bool:
        """True if the clock follows its time signal."""
        seconds = self._world.seconds(self._clock.now_ns())
        return self._faults.active("drifting-clock", self.ranger, at=seconds) is None

    def _sample_of(self, ns: int) -> int:
        """Samples of the motion chips until a time, exact."""
        return (ns - self._boot) * round(CLOCK_HZ) // (CLOCKS_PER_SAMPLE * PER_SECOND)

    def _caught_up(self, *, exactly: bool = False) -> TwinMirror:
        """Mirror brought up to now; `exactly` before a command."""
        if exactly or not self._mirror.idle:
            self._mirror.pass_to(self._sample_of(self._clock.now_ns()))
        return self._mirror

    # Buffers --------------------------------------------------------------------------------------------------------

    def trigger(self, sampling: SamplingSettings) -> None:
        """Begin a buffer; one in progress is abandoned."""
        true_ns = self._clock.now_ns()
        self._taking, self._last = (sampling, true_ns, self.now(), self._laser), None
        first, last = self._sample_of(true_ns), self._sample_of(true_ns + _duration_ns(sampling))
        most = max(1, last - first)
        step = max(1, min(most // POINTS, LONGEST_STEP), ceil(most / MOST_POINTS))
        mirror = self._caught_up(exactly=True)
        mirror.mark([*range(first, first + most, step), first + most])

    def buffer(self) -> Buffer | None:
        """Last complete buffer; None before the first and during one."""
        if self._taking is not None:
            sampling, begin, tag, lit = self._taking
            true_ns = self._clock.now_ns()
            if true_ns < begin + _duration_ns(sampling):
                if self._sample_of(true_ns) - self._mirror.samples > LAGGING:
                    self._caught_up()
                return None
            self._mirror.pass_to(max(self._sample_of(true_ns), self._sample_of(begin) + 1))
            self._last = Buffer(self._codes(sampling, begin, lit), tag, sampling, VOLT_PER_CODE)
            self._taking = None
        return self._last

    def _codes(self, sampling: SamplingSettings, begin: int, lit: bool) -> NDArray[np.int16]:
        """Converter codes of the return along the mirror's path."""
        since_boot = np.array([sample for sample, _ in self._mirror.marked]) * SAMPLE_TIME
        counts = np.array([counts for _, counts in self._mirror.marked])
        seconds = self._mirror.origin + since_boot
        phasors = self._world.phasors(self.ranger, counts, seconds) if lit else np.zeros(len(seconds), dtype=complex)
        fault = self._faults.active("saturated-adc", self.ranger, at=self._world.seconds(begin))
        return self._converter.codes(
            since_boot - (begin - self._boot) / PER_SECOND,
            phasors,
            sampling=sampling,
            generator=Streams(self._seed)(f"buffer/{self.ranger}/{begin}"),
            gain=1.0 if fault is None else fault.size,
        )

    # Axes -----------------------------------------------------------------------------------------------------------

    def enable(self, axis: int, on: bool) -> None:
        """Switch the amplifier of an axis; off at boot."""
        self._caught_up(exactly=True).enable(axis, on)

    def enabled(self, axis: int) -> bool:
        """True if the amplifier is on."""
        return self._mirror.enabled(axis)

    def actual(self, axis: int) -> int:
        """Encoder position: counts from the index once homed.

        Before, from its initial place.
        """
        return self._caught_up().axes.actual(axis)

    def desired(self, axis: int) -> int:
        """Profile position, counts."""
        return self._caught_up().axes.desired(axis)

    def start(self, axis: int, position: int, *, velocity: int, acceleration: int) -> bool:
        """Begin a trapezoidal move in the chip's integers; a track ends."""
        return self._caught_up(exactly=True).start(axis, position, velocity=velocity, acceleration=acceleration)

    def follow(self, counts: tuple[NDArray[np.float64], NDArray[np.float64]], when: tuple[TimeTag, TimeTag]) -> bool:
        """Follow counts (2,) linearly between two times, held at the ends.

        Of the head's clock.

        Raises InputError: the second time is not after the first.
        """
        true_ns = self._clock.now_ns()
        ahead = true_ns - self._reading(true_ns)
        begin, end = ((_nanoseconds(tag) + ahead - self._boot) / PER_SECOND / SAMPLE_TIME for tag in when)
        if not begin < end:
            raise InputError(f"{self.ranger}: a track from {when[0].text()} to {when[1].text()} (expected later)")
        return self._caught_up(exactly=True).follow(CountSegment((begin, end), counts))

    def moving(self, axis: int) -> bool:
        """True while a profile, a track, or an index search is active."""
        mirror = self._caught_up()
        return mirror.following or mirror.homing[axis] == "searching" or not mirror.axes.complete(axis)

    def motor_off(self, axis: int) -> bool:
        """True if the chip switched the motor off; the next move clears it.

        The position error passed its limit.
        """
        axes = self._caught_up().axes
        return axes.motor_off(axis) and axes.excessive(axis)

    def set_filter(self, axis: int, values: tuple[int, int, int, int, int]) -> None:
        """Set the filter: kp, ki, kd, integration limit, derivative interval.

        Five zeros: the head's own.
        """
        self._caught_up(exactly=True).set_filter(axis, values)

    def set_error_limit(self, axis: int, counts: int) -> None:
        """Set the position error that switches the motor off."""
        self._caught_up(exactly=True).set_error_limit(axis, counts)

    def find_home(self, axis: int) -> None:
        """Begin the search for the index, which becomes zero."""
        self._caught_up(exactly=True).find_home(axis)

    def homing(self, axis: int) -> Homing:
        """State of the last search."""
        return self._caught_up().homing[axis]

    def stop(self) -> None:
        """Slow both axes down; a search or track ends."""
        self._caught_up(exactly=True).stop()

    # Power ----------------------------------------------------------------------------------------------------------

    def switch_laser(self, on: bool) -> None:
        """Switch the laser; effective from the next buffer on."""
        self._laser = on

    def interlock(self) -> str:
        """Hardware reason against light and moves; empty if none."""
        if not self._faults.faults:
            return ""
        seconds = self._world.seconds(self._clock.now_ns())
        return "a door is open" if self._faults.active("open-interlock", self.ranger, at=seconds) else ""

    def laser_on(self) -> bool:
        """True if the laser is on."""
        return self._laser

    def supplies(self) -> dict[str, float]:
        """Power supplies by name, V: within 1 % of their names."""
        return dict(self._supplies)

    def enclosure_temperature_c(self) -> float:
        """Enclosure temperature: slow, warmer in the afternoon (UTC of the clock)."""
        mean, swing, phase = self._warmth
        return mean + swing * float(np.sin(TWO_PI * (self._clock.now_ns() % PER_DAY) / PER_DAY + phase))

    def reset(self) -> None:
        """Reset as at power-on: amplifiers off, not homed, no buffer, laser on.

        The mirror stays in place.
        """
        self._caught_up(exactly=True).reset()
        self._forget()


def _nanoseconds(tag: TimeTag) -> int:
    return int(tag.day) * PER_DAY + int(tag.nanoseconds)


def _duration_ns(sampling: SamplingSettings) -> int:
    return sampling.cycles * PER_SECOND // sampling.frequency_hz
