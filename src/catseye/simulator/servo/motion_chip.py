"""LM628 motion chip: profile, PID filter, error limit, index, in integers.

One `step` is one sample of the chip: it advances the desired position, takes the position error and returns the
word for the converter that drives the motor. Values loaded by the host wait in a second set of registers: STT takes the
trajectory over, UDF the filter. Source: [TEXAS13], pages 9 to 24.

Choices where the data sheet is open:
- The last fraction of a count of a move: the profile takes the largest speed from which it can still stop at the
  target, so that it arrives exactly and never decelerates harder than commanded.
- The data sheet keeps only the bottom 16 bits of the filter's products. Taken literally (overflow = "wrap") the drive
  reverses once a product passes 32 767, at kp = 200 from 164 counts. By default products stop at 16 bits, as the
  position error does ("saturate").
- The integral is shifted right by 8 bits, once. The text can be read as twice; the user guide draws once.
- The sum of errors stops at 24 bits. It is emptied when the motor is off.
- STT after the motor was off starts from where the motor is.
- The desired position is 16 bits finer than a count; its whole part, rounded down, enters the error.
"""

from math import sqrt
from typing import Literal

from catseye.errors import ValidityError
from catseye.ranger.motion_units import FRACTION, LARGEST_GAIN, checked

POSITION, VELOCITY, STOPPING = range(3)  # states of the profile
RANGE = 2**31  # counts until the position wraps round
ERROR_HIGH = 2**15 - 1
SUM_HIGH = 2**23 - 1


def stopping_distance(velocity: int, acceleration: int) -> int:
    """Stopping distance from one sample at a speed, 1/65536 count.

    The speed falls by the acceleration every sample.

    velocity       of the first sample, 1/65536 count a sample, 0 or above
    acceleration   1/65536 count a sample squared, above 0

    >>> stopping_distance(25, 10)  # 25 + 15 + 5
    45
    """
    k = velocity // acceleration
    return velocity * (k + 1) - acceleration * (k * (k + 1) // 2)


def fastest_approach(remaining: int, acceleration: int) -> int:
    """Largest speed from which a move of this length can stop in time.

    remaining      way to the target, 1/65536 count, 0 or above
    acceleration   1/65536 count a sample squared, above 0

    The inverse of `stopping_distance`, rounded down. Every move thus ends in a sample that covers exactly the
    remainder.

    >>> fastest_approach(45, 10), fastest_approach(44, 10), fastest_approach(7, 10)
    (25, 24, 7)
    """
    k = int((sqrt(1.0 + 8.0 * remaining / acceleration) - 1.0) / 2.0)
    while acceleration * (k * (k + 1) // 2) > remaining:
        k -= 1
    while acceleration * ((k + 1) * (k + 2) // 2) <= remaining:
        k += 1
    return (remaining + acceleration * (k * (k + 1) // 2)) // (k + 1)


def next_velocity(remaining: int, velocity: int, *, limit: int, acceleration: int) -> int:
    """Speed of the next sample on the way to a target.

    No sample changes it by more than the acceleration.

    remaining      to the target, with its sign, 1/65536 count
    velocity       of the last sample, with its sign, 1/65536 count a sample
    limit          largest speed, 0 or above
    acceleration   1/65536 count a sample squared, 0 or above; with 0 nothing changes

    >>> next_velocity(1000, 0, limit=50, acceleration=20), next_velocity(-5, 12, limit=50, acceleration=20)
    (20, -5)
    """
    if acceleration == 0:
        return velocity
    away, along = (remaining, velocity) if remaining >= 0 else (-remaining, -velocity)
    speed = min(along + acceleration, limit)
    if speed > 0 and stopping_distance(speed, acceleration) > away:
        speed = min(limit, fastest_approach(away, acceleration))
    speed = max(speed, along - acceleration)
    return speed if remaining >= 0 else -speed


def approached(velocity: int, goal: int, acceleration: int) -> int:
    """Speed brought nearer to a goal by at most the acceleration.

    All in 1/65536 count a sample.
    """
    return max(velocity - acceleration, min(velocity + acceleration, goal))


def wrapped(position: int, unit: int = 1) -> int:
    """Position wrapped into the chip's range, -2^30 to 2^30 - 1 counts.

    `unit` is the size of a count.
    """
    half = unit * (RANGE // 2)
    return (position + half) % (2 * half) - half


class MotionChip:
    """One LM628 after a reset: motor off, gains and registers zero.

    output_bits   8 or 12: width of the converter
    overflow      "saturate" or "wrap": treatment of filter products beyond 16 bits
    """

    def __init__(self, *, output_bits: Literal[8, 12] = 8, overflow: Literal["saturate", "wrap"] = "saturate"):
        if output_bits not in (8, 12):
            raise ValidityError(f"converter of {output_bits} bits: the LM628 drives 8 or 12")
        if overflow not in ("saturate", "wrap"):
            raise ValidityError(f"overflow {overflow!r} is neither 'saturate' nor 'wrap'")
        self.output_bits, self.overflow = output_bits, overflow
        self._shift, self._wraps = 16 - output_bits, overflow == "wrap"
        # loaded, waiting for STT and UDF
        self.loaded_position = self.loaded_velocity = self.loaded_acceleration = 0
        self.loaded_mode, self.loaded_direction = POSITION, 1
        self.loaded_filter = (0, 0, 0, 0, 0)
        # at work
        self.mode, self.direction = POSITION, 1
        self.target = self.velocity_limit = self.acceleration = 0
        self.kp = self.ki = self.kd = self.il = self.interval = 0
        self.error_limit, self.stops_on_error = ERROR_HIGH, False
        # registers
        self.position = self.velocity = 0  # desired, in 1/65536 count and 1/65536 count a sample
        self.home, self.raw = 0, 0  # the encoder's count at position zero, and the last one
        self.error = self.error_sum = self.difference = self.output = 0
        self._last_error, self._until_difference = 0, 0
        self.index_position, self.seeking = 0, False
        # flags
        self.motor_off, self.on_target = True, False
        self.excessive_error = self.index_found = self.wraparound = self.command_error = False

    @property
    def actual_position(self) -> int:
        """Position of the encoder, counts (RDRP)."""
        return wrapped(self.raw - self.home)

    @property
    def desired_position(self) -> int:
        """Position of the profile, whole counts (RDDP)."""
        return self.position // FRACTION

    @property
    def desired_velocity(self) -> int:
        """Speed of the profile, 1/65536 count a sample (RDDV)."""
        return self.velocity

    @property
    def trajectory_complete(self) -> bool:
        """True if the profile is complete or the motor off.

        The motor itself may not have arrived.
        """
        return self.on_target or self.motor_off

    def load_trajectory(
        self,
        *,
        position: int | None = None,
        velocity: int | None = None,
        acceleration: int | None = None,
        mode: Literal["position", "velocity"] | None = None,
        direction: Literal[1, -1] | None = None,
    ) -> None:
        """Load values for the next STT (LTRJ); others are unchanged.

        position       target, counts
        velocity       largest speed, or in velocity mode the speed, 1/65536 count a sample, 0 or above
        acceleration   1/65536 count a sample squared, 0 or above
        mode           "position" or "velocity"
        direction      of velocity mode, 1 or -1

        Raises ValidityError: a value outside its register. Nothing is loaded then.
        """
        target = self.loaded_position if position is None else checked("ABP", position)
        limit = self.loaded_velocity if velocity is None else checked("ABV", velocity)
        rate = self.loaded_acceleration if acceleration is None else checked("ABA", acceleration)
        if mode not in (None, "position", "velocity"):
            raise ValidityError(f"mode {mode!r} is neither 'position' nor 'velocity'")
        if direction not in (None, 1, -1):
            raise ValidityError(f"direction {direction!r} is neither 1 nor -1")
        self.loaded_position, self.loaded_velocity, self.loaded_acceleration = target, limit, rate
        if mode is not None:
            self.loaded_mode = VELOCITY if mode == "velocity" else POSITION
        if direction is not None:
            self.loaded_direction = direction

    def start(self) -> bool:
        """Start the loaded trajectory (STT).

        False, without effect, if the acceleration changed during a move.
        """
        if self.loaded_acceleration != self.acceleration and not self.trajectory_complete:
            self.command_error = True
            return False
        if self.motor_off:
            self._begin_at_the_motor()
        self.mode, self.direction = self.loaded_mode, self.loaded_direction
        self.target = self.loaded_position * FRACTION
        self.velocity_limit, self.acceleration = self.loaded_velocity, self.loaded_acceleration
        self.motor_off = self.on_target = self.excessive_error = False
        return True

    def stop(self, how: Literal["smooth", "abrupt", "off"]) -> None:
        """Stop manually (LTRJ bits 8 to 10 with STT).

        how   "smooth" with the present acceleration, "abrupt" at the motor's position, "off" without drive

        Raises ValidityError: another word.
        """
        if how == "smooth":
            self.mode, self.on_target = STOPPING, False
        elif how == "abrupt":
            self._begin_at_the_motor()
            self.mode, self.on_target = STOPPING, True
        elif how == "off":
            self._switch_off()
        else:
            raise ValidityError(f"stop {how!r} is none of 'smooth', 'abrupt', 'off'")

    def load_filter(
        self,
        *,
        kp: int | None = None,
        ki: int | None = None,
        kd: int | None = None,
        il: int | None = None,
        interval: int | None = None,
    ) -> None:
        """Load filter values for the next UDF (LFIL); others are unchanged.

        kp, ki, kd   gains, 0 to 32 767
        il           limit of the integral term, 0 to 32 767
        interval     of the derivative, samples less one, 0 to 255

        Raises ValidityError: a value outside its register. Nothing is loaded then.
        """
        requested = zip(
            ("FKP", "FKI", "FKD", "FIL", "FSI"), (kp, ki, kd, il, interval), self.loaded_filter, strict=True
        )
        five = [old if new is None else checked(command, new) for command, new, old in requested]
        self.loaded_filter = (five[0], five[1], five[2], five[3], five[4])

    def update_filter(self) -> None:
        """Apply the loaded filter values (UDF)."""
        self.kp, self.ki, self.kd, self.il, self.interval = self.loaded_filter

    def limit_error(self, counts: int, *, stop: bool) -> None:
        """Set the position error limit (LPEI); with `stop` it switches the motor off (LPES).

        counts   0 to 32 767

        Raises ValidityError: outside the register.
        """
        if not 0 <= counts <= LARGEST_GAIN:
            raise ValidityError(f"position error limit {counts} is outside 0 to {LARGEST_GAIN} (counts)")
        self.error_limit, self.stops_on_error = int(counts), stop

    def find_index(self) -> None:
        """Store the position of the next index pulse in the index register (SIP)."""
        self.seeking, self.index_found = True, False

    def define_home(self) -> None:
        """Set the present position to zero (DFH) without a jerk.

        The profile moves along.
        """
        present = self.actual_position
        self.home = self.raw
        self.position = wrapped(self.position - present * FRACTION, FRACTION)
        self.target -= present * FRACTION
        self.index_position = wrapped(self.index_position - present)

    def step(self, raw: int, index: int | None = None) -> int:
        """One sample: converter word, -128 to 127 or -2048 to 2047.

        raw     the encoder's count since power came on
        index   the raw count at which an index pulse passed since the last sample, None without
        """
        self.raw = raw
        if index is not None and self.seeking:
            self.index_position = wrapped(index - self.home)
            self.seeking, self.index_found = False, True
        if self.motor_off:
            return 0
        self._move_on()
        error = wrapped((self.position >> 16) - (raw - self.home))
        self.error = error = max(-ERROR_HIGH - 1, min(ERROR_HIGH, error))
        if abs(error) > self.error_limit:
            self.excessive_error = True
            if self.stops_on_error:
                self._switch_off()
                return 0
        self.output = self._filtered(error) >> self._shift
        return self.output

    def _move_on(self) -> None:
        """Advance desired position and velocity by one sample."""
        if self.on_target:
            return
        if self.mode == POSITION:
            remaining = self.target - self.position
            self.velocity = next_velocity(
                remaining, self.velocity, limit=self.velocity_limit, acceleration=self.acceleration
            )
            self.on_target = remaining == 0 and self.velocity == 0
        else:
            target_speed = self.direction * self.velocity_limit if self.mode == VELOCITY else 0
            self.velocity = approached(self.velocity, target_speed, self.acceleration)
            self.on_target = self.mode == STOPPING and self.velocity == 0
        moved = self.position + self.velocity
        self.position = wrapped(moved, FRACTION)
        if self.position != moved:
            self.wraparound = True

    def _filtered(self, error: int) -> int:
        """16-bit sum u(n) = kp e(n) + ki sum e / 256 + kd (e(n') - e(n' - 1)).

        The second term is held within il.

        Source: [TEXAS13] pages 11 and 12.
        """
        self.error_sum = max(-SUM_HIGH - 1, min(SUM_HIGH, self.error_sum + error))
        if self._until_difference == 0:
            self.difference = self._product(self.kd, error - self._last_error)
            self._last_error = error
            self._until_difference = self.interval + 1
        self._until_difference -= 1
        integral = self._product(self.ki, self.error_sum >> 8)
        integral = max(-self.il, min(self.il, integral))
        total = self._product(self.kp, error) + integral + self.difference
        return max(-ERROR_HIGH - 1, min(ERROR_HIGH, total))

    def _product(self, gain: int, signal: int) -> int:
        product = gain * signal
        if self._wraps:
            return ((product + 0x8000) & 0xFFFF) - 0x8000
        return max(-ERROR_HIGH - 1, min(ERROR_HIGH, product))

    def _switch_off(self) -> None:
        """Switch the drive off and clear the filter's memory."""
        self.motor_off = True
        self.velocity = self.output = 0
        self.error = self.error_sum = self.difference = self._last_error = self._until_difference = 0

    def _begin_at_the_motor(self) -> None:
        self.position, self.velocity = self.actual_position * FRACTION, 0
