"""One mirror axis: motion chip, converter, motor, encoder; ZY commands.

The parts are stepped together. In each sample the chip reads the encoder and computes; its result drives the motor from
the next sample on. That full sample of delay is a choice: the data sheet does not say when within a sample the
converter is written.

The methods named after ZY commands (`aba` to `cwt`) do the work of those commands for one axis. Times are simulated:
nothing sleeps. Source: [CREAGER02], the pages of the commands; [TEXAS13] for the chip.

Source: [PARKER04] section 6.4.3.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from catseye.errors import ValidityError
from catseye.ranger.motion_units import FRACTION, checked, checked_rates
from catseye.simulator.servo.motion_chip import MotionChip
from catseye.simulator.servo.motor import Motor, index_between

HOMING_TIME = 30.0  # s, [CREAGER02] page FHM
TRACKING_SAMPLES = 375  # 128 ms at 6 MHz, exactly
COLUMNS = ("desired", "velocity", "actual", "angle", "output")
Status = Literal["done", "motor off", "timeout"]


@dataclass(frozen=True, eq=False)
class AxisTrace:
    """Trace of an axis, one row a sample.

    time       s, since power came on, when the encoder was read
    desired    counts, with its fraction
    velocity   counts/s, of the profile
    actual     counts, as the encoder reads
    angle      rad, true angle of the axis from its place at power-on
    output     steps of the converter
    """

    time: NDArray[np.float64]
    desired: NDArray[np.float64]
    velocity: NDArray[np.float64]
    actual: NDArray[np.float64]
    angle: NDArray[np.float64]
    output: NDArray[np.float64]

    @property
    def error(self) -> NDArray[np.float64]:
        """Following error, counts: desired less actual."""
        return self.desired - self.actual


@dataclass(frozen=True)
class Settling:
    """Criteria of CWT for a settled axis.

    tolerance   counts (WTOL)
    reads       in a row within it (WCNT)
    timeout     s (WTMO; its unit is open, the manual's example is 18)
    strict      True if a timeout fails (WMD other than 0)
    every       s between two reads; the manual says continuously
    """

    tolerance: int = 5
    reads: int = 5
    timeout: float = 18.0
    strict: bool = True
    every: float = 1e-3

    def __post_init__(self) -> None:
        if not (self.tolerance >= 0 and self.reads >= 1 and self.timeout > 0.0 and self.every > 0.0):
            raise ValidityError(
                f"settling: tolerance {self.tolerance} counts, {self.reads} reads, timeout {self.timeout:g} s, every "
                f"{self.every:g} s (expected 0 or above, 1 or more, above 0, above 0)"
            )


@dataclass(frozen=True)
class Wait:
    """Result of a wait: `success` as the ZY reports it, `status`, duration, s."""

    success: bool
    status: Status
    seconds: float


@dataclass(frozen=True)
class Homing:
    """Result of a search for the index; `text` describes it."""

    success: bool
    text: str
    seconds: float


class ServoAxis:
    """Chip, motor, and the time since power-on.

    chip    after reset, or with its filter loaded
    motor   the axis; its encoder's count is zero wherever it stands when power comes on

    The amplifier is off at first (`axis`), as at the ZY's boot.
    """

    def __init__(self, chip: MotionChip, motor: Motor):
        self.chip, self.motor = chip, motor
        self.enabled = False
        self.samples = 0  # since power came on, as the counts are
        self._start, self._raw = motor.count, 0
        self._full = 2 ** (chip.output_bits - 1)
        self._drive = 0.0  # computed in the last sample

    @property
    def time(self) -> float:
        """Seconds since power came on."""
        return self.samples * self.motor.sample

    def run(self, samples: int) -> AxisTrace:
        """Let time pass and record every sample.

        samples   number of samples, 0 or above
        """
        rows = np.empty((len(COLUMNS), samples))
        begin, chip, motor = self.samples, self.chip, self.motor
        per_second = 1.0 / (FRACTION * motor.sample)
        for i in range(samples):
            rows[3, i] = motor.angle
            self._step()
            rows[0, i], rows[1, i] = chip.position, chip.velocity
            rows[2, i], rows[4, i] = chip.actual_position, chip.output
        rows[0] /= FRACTION
        rows[1] *= per_second
        time: NDArray[np.float64] = (begin + np.arange(samples, dtype=np.float64)) * motor.sample
        return AxisTrace(time=time, **dict(zip(COLUMNS, rows, strict=True)))

    def skip(self, samples: int) -> None:
        """Let time pass without a record."""
        for _ in range(samples):
            self._step()

    def _step(self) -> None:
        chip, motor = self.chip, self.motor
        before, self._raw = self._raw, motor.count - self._start
        index = None
        if chip.seeking:
            design = motor.design
            index = index_between(
                before, self._raw, index=design.index_count - self._start, turn=design.counts_per_turn
            )
        word = chip.step(self._raw, index)
        motor.advance(self._drive)
        self._drive = word / self._full if self.enabled else 0.0
        self.samples += 1

    # The commands ---------------------------------------------------------------------------------------------------

    def axis(self, on: bool) -> None:
        """AXIS: switch the amplifier on or off; off at boot."""
        self.enabled = on

    def acp(self) -> int:
        """ACP: actual position, counts."""
        return self.chip.actual_position

    def dsp(self) -> int:
        """DSP: desired position, counts."""
        return self.chip.desired_position

    def aba(self, value: int | None = None) -> int:
        """ABA: acceleration of the next moves, 1/65536 count a sample squared.

        It must not exceed the velocity.

        value   0 to 2^30 - 1, None to read

        Raises ValidityError: outside these limits, or above the velocity loaded.
        """
        if value is not None:
            checked_rates("ABA", self.chip.loaded_velocity, checked("ABA", value))
            self.chip.load_trajectory(acceleration=value)
        return self.chip.loaded_acceleration

    def abv(self, value: int | None = None) -> int:
        """ABV: largest velocity of the next moves, 1/65536 count a sample.

        At least the acceleration.

        value   0 to 2^30 - 1, None to read

        Raises ValidityError: outside these limits, or below the acceleration loaded.
        """
        if value is not None:
            checked_rates("ABV", checked("ABV", value), self.chip.loaded_acceleration)
            self.chip.load_trajectory(velocity=value)
        return self.chip.loaded_velocity

    def abp(self, counts: int) -> int:
        """ABP: target of the next move, counts, which STT starts.

        counts   -2^30 to 2^30 - 1

        Raises ValidityError: outside these limits.
        """
        self.chip.load_trajectory(position=counts, mode="position")
        return self.chip.loaded_position

    def stt(self) -> bool:
        """STT: start the move; False after an acceleration change in motion.

        The current move then continues.
        """
        return self.chip.start()

    def flt(
        self,
        kp: int | None = None,
        ki: int | None = None,
        kd: int | None = None,
        il: int | None = None,
        interval: int | None = None,
    ) -> tuple[int, int, int, int, int]:
        """FLT, FKP, FKI, FKD, FIL, FSI: filter values, from the next sample on.

        kp, ki, kd   gains, 0 to 32 767
        il           limit of the integral term, 0 to 32 767
        interval     of the derivative, samples less one, 0 to 255

        Raises ValidityError: outside these limits.
        """
        self.chip.load_filter(kp=kp, ki=ki, kd=kd, il=il, interval=interval)
        self.chip.update_filter()
        return self.chip.loaded_filter

    def fkp(self, value: int | None = None) -> int:
        """FKP: the proportional gain."""
        return self.flt(kp=value)[0]

    def fki(self, value: int | None = None) -> int:
        """FKI: the gain of the integral."""
        return self.flt(ki=value)[1]

    def fkd(self, value: int | None = None) -> int:
        """FKD: the derivative gain."""
        return self.flt(kd=value)[2]

    def fil(self, value: int | None = None) -> int:
        """FIL: limit of the integral term."""
        return self.flt(il=value)[3]

    def fsi(self, value: int | None = None) -> int:
        """FSI: interval of the derivative, samples less one."""
        return self.flt(interval=value)[4]

    def erl(self, counts: int | None = None) -> int:
        """ERL: position error that switches the motor off until the next move.

        counts   0 to 25 000, None to read

        Raises ValidityError: outside these limits.
        """
        if counts is not None:
            self.chip.limit_error(checked("ERL", counts), stop=True)
        return self.chip.error_limit

    def wai(self, timeout: float = 60.0) -> Wait:
        """WAI: wait until the profile is complete; motor off is a failure.

        timeout   s
        """
        begin = self.samples
        for _ in range(self._samples_of(timeout)):
            if self.chip.trajectory_complete:
                break
            self._step()
        complete = self.chip.on_target and not self.chip.motor_off
        status: Status = "done" if complete else "motor off" if self.chip.motor_off else "timeout"
        return Wait(complete, status, (self.samples - begin) * self.motor.sample)

    def cwt(self, target: int, settling: Settling = Settling()) -> Wait:
        """CWT: wait until the encoder reads within tolerance repeatedly.

        target     counts where the cube is
        settling   WTOL, WCNT, WTMO, WMD
        """
        begin, row = self.samples, 0
        between = max(1, round(settling.every / self.motor.sample))
        for i in range(self._samples_of(settling.timeout)):
            if i % between == 0:
                row = row + 1 if abs(self.acp() - target) <= settling.tolerance else 0
                if row == settling.reads:
                    return Wait(True, "done", (self.samples - begin) * self.motor.sample)
            self._step()
        status: Status = "motor off" if self.chip.motor_off else "timeout"
        return Wait(not settling.strict, status, (self.samples - begin) * self.motor.sample)

    def fhm(self, direction: Literal[1, -1] = 1, timeout: float = HOMING_TIME) -> Homing:
        """FHM: find the index pulse, return to it, settle, set zero.

        It turns at most once.

        direction   of the first search, 1 or -1
        timeout     s, of all of it

        Where an end stop comes first (the motor is then off by its error limit) the search turns back; the manual does
        not say what the ZY did. It settles with tolerance zero: a count off would stay in every pointing. The velocity
        and acceleration are those loaded; the target loaded is zero afterwards.
        """
        begin, chip, turn = self.samples, self.chip, self.motor.design.counts_per_turn
        if not chip.stops_on_error:
            return Homing(
                False, "no position error limit is set: send ERL first, or the axis may push against a stop", 0.0
            )
        end = begin + self._samples_of(timeout)
        homed = False
        for sense in (direction, -direction):
            chip.find_index()
            self.abp(self.acp() + sense * turn)
            if not self.stt():
                chip.seeking = False
                text = "the acceleration (ABA) was changed during a move: home after it ends"
                return Homing(False, text, (self.samples - begin) * self.motor.sample)
            while self.samples < end and not (chip.index_found or chip.trajectory_complete):
                self._step()
            homed = chip.index_found
            if homed or not chip.motor_off:  # a full turn without a pulse, or no time left
                break
        chip.seeking = False
        if homed:
            self.abp(chip.index_position)
            for _ in range(2):  # braking beyond the index, it may meet a stop: the motor is off, and starts again
                self.stt()
                if self.wai((end - self.samples) * self.motor.sample).status != "motor off":
                    break
            time_left = (end - self.samples) * self.motor.sample
            homed = time_left > 0.0 and self.cwt(chip.index_position, Settling(tolerance=0, timeout=time_left)).success
            text = (
                "home" if homed else f"the index at {chip.index_position} counts was found but the axis did not settle"
            )
        else:
            text = f"no index pulse within a turn from {self.acp()} counts, or in {timeout:g} s"
        if homed:
            chip.define_home()
            self.abp(0)
        return Homing(homed, text, (self.samples - begin) * self.motor.sample)

    def follow(self, counts: Sequence[float], samples: int = TRACKING_SAMPLES) -> AxisTrace:
        """Track a moving target through counts, linearly between them.

        counts    target positions after each interval, with fractions
        samples   of an interval: 375 are 128 ms

        Velocity mode, a new speed each interval: from where the profile is to where the target will be. Afterwards the
        loaded velocity is restored for the next move. The profile
        holds fractions of a count, so errors do not accumulate. A change of speed dv takes dv/a, and its dv^2/2a of
        travel is recovered in the next interval.

        Raises ValidityError: no counts, or not finite; a speed beyond the chip; the acceleration changed during a move.
        """
        if not len(counts) or not np.isfinite(counts).all() or samples < 1:
            raise ValidityError(
                f"{len(counts)} counts to follow, {samples} samples each (expected finite counts, 1 or more of both)"
            )
        rows, usual = [], self.chip.loaded_velocity
        for to in counts:
            travel = to - self.chip.position / FRACTION
            speed = checked("ABV", round(abs(travel) / samples * FRACTION))
            self.chip.load_trajectory(velocity=speed, mode="velocity", direction=1 if travel >= 0.0 else -1)
            started = self.stt()
            self.chip.load_trajectory(velocity=usual)
            if not started:
                raise ValidityError("ABA: the acceleration was changed during a move (expected the same until it ends)")
            rows.append(self.run(samples))
        return AxisTrace(**{name: np.concatenate([getattr(row, name) for row in rows]) for name in ("time", *COLUMNS)})

    def _samples_of(self, seconds: float) -> int:
        if not np.isfinite(seconds):
            raise ValidityError(f"waiting {seconds} s has no end (expected a finite time)")
        return max(0, round(seconds / self.motor.sample))
