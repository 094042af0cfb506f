"""Compiled servo axes: many samples a call, bit-identical to the classes.

They are `MotionChip`, `Motor` and `ServoAxis`.

Imported only when a living site needs it. Those classes are the reference and execute every command: the
state lives in two arrays, is written into the Python objects before a command and read back after it. A test compares
both bit for bit.

An axis at rest costs nothing, exactly: without disturbance the next state follows from this one alone, so a state that
repeats after one interval of the derivative repeats for ever, and the remaining time is skipped.
"""

from collections.abc import Sequence
from math import expm1, floor, log1p, sin, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from catseye.simulator.servo.axis import ServoAxis
from catseye.simulator.servo.motion_chip import ERROR_HIGH, POSITION, RANGE, SUM_HIGH, VELOCITY
from catseye.simulator.servo.motor import MOST_EVENTS

CHIP = (  # what a step of the chip reads or changes, by its names there
    *("mode", "direction", "target", "velocity_limit", "acceleration"),
    *("kp", "ki", "kd", "il", "interval", "error_limit", "stops_on_error"),
    *("position", "velocity", "home", "raw", "error", "error_sum", "difference", "output"),
    *("_last_error", "_until_difference", "index_position", "seeking"),
    *("motor_off", "on_target", "excessive_error", "index_found", "wraparound"),
)
FLAGS = frozenset(CHIP[-5:]) | {"seeking", "stops_on_error"}
MODE, DIRECTION, TARGET, LIMIT, ACCELERATION, KP, KI, KD, IL, INTERVAL, ERROR_LIMIT, STOPS = range(12)
WHERE, SPEED, HOME, RAW, ERROR, SUM, DIFFERENCE, OUTPUT, LAST, UNTIL, INDEX_AT, SEEKING = range(12, 24)
OFF, ON_TARGET, EXCESSIVE, INDEX_SEEN, WRAPAROUND = range(24, 29)
START, ENABLED, TURN, INDEX, SHIFT, WRAPS, FULL, STUCK, BLIND, WATCH, AT_REST, WIDTH = range(29, 41)  # beyond CHIP
ANGLE, RATE, DRIVE, REALS = range(4)
INERTIA, TORQUE, DAMPING, STATIC, COULOMB, LOW, HIGH, PER_RADIAN, SAMPLE = range(9)
SPEED_LIMIT, TRAVEL_LIMIT, RIPPLE, RIPPLE_CYCLES, DISTURBANCE, CONSTANTS = range(9, 15)
AT_INDEX, AT_END = 1, 2  # events to watch for: the index was seen, the profile is complete
NO_NORMALS = np.empty((0, 0))

_inlined = njit(error_model="numpy")  # cached with their caller


class CompiledAxes:
    """Servo axes that share a clock, stepped together.

    axes      in Python; from here on only `axis` updates them
    at_rest   True if the last `skip` found that no axis changes without a command
    """

    def __init__(self, axes: Sequence[ServoAxis]):
        self._axes, self.at_rest = tuple(axes), False
        shape = len(self._axes)
        self._ints = np.zeros((shape, WIDTH), dtype=np.int64)
        self._reals, self._fixed = np.zeros((shape, REALS)), np.zeros((shape, CONSTANTS))
        for k, axis in enumerate(self._axes):
            design, motor, chip = axis.motor.design, axis.motor, axis.chip
            self._fixed[k] = (
                *(design.inertia, motor._full_torque, motor._damping, design.static, design.coulomb),
                *(design.low_stop, design.high_stop, motor._per_radian, motor.sample, *motor._whole),
                *(design.ripple, design.ripple_cycles, design.disturbance),
            )
            self._ints[k, [TURN, INDEX]] = design.counts_per_turn, design.index_count
            self._ints[k, [SHIFT, WRAPS, FULL]] = chip._shift, chip._wraps, axis._full
            self.take(k)
        self._disturbed = bool(self._fixed[:, DISTURBANCE].any())

    def axis(self, k: int) -> ServoAxis:
        """Axis k in Python, up to date; changes need `take`."""
        axis, ints, reals = self._axes[k], self._ints[k].tolist(), self._reals[k].tolist()
        chip = axis.chip
        for name, value in zip(CHIP, ints, strict=False):
            setattr(chip, name, bool(value) if name in FLAGS else value)
        axis._raw = chip.raw
        axis.motor.angle, axis.motor.velocity, axis._drive = reals
        return axis

    def take(self, k: int) -> None:
        """Read the state of axis k from its Python form."""
        axis, ints = self._axes[k], self._ints[k]
        ints[: len(CHIP)] = [getattr(axis.chip, name) for name in CHIP]
        ints[RAW] = axis._raw
        ints[START], ints[ENABLED] = axis._start, axis.enabled
        self.at_rest = False
        self._reals[k] = axis.motor.angle, axis.motor.velocity, axis._drive

    def spoil(self, k: int, *, stuck: bool, blind: bool) -> None:
        """Set the faults of an axis: stuck, or without index pulse."""
        if (self._ints[k, STUCK], self._ints[k, BLIND]) != (stuck, blind):
            self._ints[k, [STUCK, BLIND]] = stuck, blind
            self.at_rest = False

    def watch(self, k: int, what: int) -> None:
        """Let `skip` end early at the index (AT_INDEX) or profile end (AT_END) of axis k.

        0: neither.
        """
        self._ints[k, WATCH] = what

    def skip(self, samples: int) -> int:
        """Let time pass; number of samples done, fewer at a watched event.

        samples   0 or above
        """
        if self._disturbed and samples > 1 and self._ints[:, WATCH].any():  # draw no number that is not used
            for completed in range(samples):
                if not self.skip(1):
                    return completed
            return samples
        normals = NO_NORMALS
        if self._disturbed:
            normals = np.zeros((len(self._axes), samples))
            for k, axis in enumerate(self._axes):
                if self._fixed[k, DISTURBANCE] and axis.motor.generator is not None:
                    normals[k] = axis.motor.generator.standard_normal(samples)
        completed = int(advance(self._ints, self._reals, self._fixed, normals, samples))
        self.at_rest = bool(self._ints[:, AT_REST].all())
        for axis in self._axes:
            axis.samples += completed
        return completed

    @property
    def counts(self) -> NDArray[np.float64]:
        """True positions (axes,), counts with fraction, from angle zero."""
        return self._reals[:, ANGLE] * self._fixed[:, PER_RADIAN]

    def actual(self, k: int) -> int:
        """Encoder of axis k, counts from home."""
        count = int(self._ints[k, RAW] - self._ints[k, HOME])
        return (count + RANGE // 2) % RANGE - RANGE // 2

    def desired(self, k: int) -> int:
        """Profile of axis k, whole counts."""
        return int(self._ints[k, WHERE]) >> 16

    def profile(self, k: int) -> tuple[float, float]:
        """Profile of axis k: counts, and counts a sample."""
        return int(self._ints[k, WHERE]) / 65_536, int(self._ints[k, SPEED]) / 65_536

    def enabled(self, k: int) -> bool:
        """True if the amplifier of axis k is on."""
        return bool(self._ints[k, ENABLED])

    def motor_off(self, k: int) -> bool:
        """True if chip k drives nothing."""
        return bool(self._ints[k, OFF])

    def excessive(self, k: int) -> bool:
        """True if the position error of axis k passed its limit in this move."""
        return bool(self._ints[k, EXCESSIVE])

    def complete(self, k: int) -> bool:
        """True if the profile of axis k is complete, or its motor off."""
        return bool(self._ints[k, OFF] or self._ints[k, ON_TARGET])

    def index_found(self, k: int) -> bool:
        """True if the requested index was seen."""
        return bool(self._ints[k, INDEX_SEEN])


@njit(cache=True, error_model="numpy")
def advance(ints, reals, fixed, normals, samples):
    """Step axes (a,) together; number of samples done.

    ints      (a, WIDTH) int64, changed
    reals     (a, REALS), changed
    fixed     (a, CONSTANTS)
    normals   (a, samples) of the disturbance, or empty
    """
    axes = len(ints)
    before, real_before = np.empty(WIDTH, np.int64), np.empty(REALS)
    awake = 0
    for k in range(axes):
        s, f, c = ints[k], reals[k], fixed[k]
        s[AT_REST] = 0
        period = s[INTERVAL] + 1
        still = s[WATCH] == 0 and s[SPEED] == 0 and f[RATE] == 0.0 and (s[OFF] or s[ON_TARGET])
        if still and c[DISTURBANCE] == 0.0 and samples > period:
            before[:], real_before[:] = s, f
            for _ in range(period):
                _step(s, f, c, 0.0)
            s[AT_REST] = np.array_equal(before, s) and np.array_equal(real_before, f)
            if not s[AT_REST]:
                s[:], f[:] = before, real_before
        awake += 1 - s[AT_REST]
    completed = 0
    if awake == 0:
        completed = samples
    while completed < samples:
        for k in range(axes):
            s = ints[k]
            if (s[WATCH] & AT_INDEX and s[INDEX_SEEN]) or (s[WATCH] & AT_END and (s[OFF] or s[ON_TARGET])):
                samples = completed
        if completed == samples:
            break
        for k in range(axes):
            if not ints[k, AT_REST]:
                normal = normals[k, completed] if fixed[k, DISTURBANCE] != 0.0 else 0.0
                _step(ints[k], reals[k], fixed[k], normal)
        completed += 1
    for k in range(axes):
        if ints[k, AT_REST]:
            for _ in range(completed % (ints[k, INTERVAL] + 1)):  # phase within the derivative's interval
                _step(ints[k], reals[k], fixed[k], 0.0)
    return completed


@_inlined
def _step(s, f, c, normal):
    """One sample, as `ServoAxis._step`."""
    raw = np.int64(floor(f[ANGLE] * c[PER_RADIAN] + 0.5)) - s[START]
    if s[SEEKING] and not s[BLIND]:
        low, high = min(s[RAW], raw), max(s[RAW], raw)
        at, turn = s[INDEX] - s[START], s[TURN]
        first = low + (at - low) % turn
        if first <= high:
            passed = first if raw >= s[RAW] else high - (high - at) % turn
            s[INDEX_AT] = _wrapped(passed - s[HOME], 1)
            s[SEEKING], s[INDEX_SEEN] = 0, 1
    s[RAW] = raw
    word = 0
    if not s[OFF]:
        word = _drive_word(s, raw)
    _advance_motor(s, f, c, normal)
    f[DRIVE] = word / s[FULL] if s[ENABLED] else 0.0


@_inlined
def _drive_word(s, raw):
    """Drive word, as `MotionChip.step` with the motor on."""
    _move_on(s)
    error = _wrapped((s[WHERE] >> 16) - (raw - s[HOME]), 1)
    error = max(-ERROR_HIGH - 1, min(ERROR_HIGH, error))
    s[ERROR] = error
    if abs(error) > s[ERROR_LIMIT]:
        s[EXCESSIVE] = 1
        if s[STOPS]:
            s[OFF] = 1
            s[SPEED] = s[OUTPUT] = s[ERROR] = s[SUM] = s[DIFFERENCE] = s[LAST] = s[UNTIL] = 0
            return 0
    s[SUM] = max(-SUM_HIGH - 1, min(SUM_HIGH, s[SUM] + error))
    if s[UNTIL] == 0:
        s[DIFFERENCE] = _product(s[KD], error - s[LAST], s[WRAPS])
        s[LAST] = error
        s[UNTIL] = s[INTERVAL] + 1
    s[UNTIL] -= 1
    integral = max(-s[IL], min(s[IL], _product(s[KI], s[SUM] >> 8, s[WRAPS])))
    total = _product(s[KP], error, s[WRAPS]) + integral + s[DIFFERENCE]
    s[OUTPUT] = max(-ERROR_HIGH - 1, min(ERROR_HIGH, total)) >> s[SHIFT]
    return s[OUTPUT]


@_inlined
def _move_on(s):
    """Next sample of the profile, as `MotionChip._move_on`."""
    if s[ON_TARGET]:
        return
    speed, rate = s[SPEED], s[ACCELERATION]
    if s[MODE] == POSITION:
        remaining = s[TARGET] - s[WHERE]
        speed = _next_velocity(remaining, speed, s[LIMIT], rate)
        s[ON_TARGET] = remaining == 0 and speed == 0
    else:
        target_speed = s[DIRECTION] * s[LIMIT] if s[MODE] == VELOCITY else 0
        speed = max(speed - rate, min(speed + rate, target_speed))
        s[ON_TARGET] = s[MODE] != VELOCITY and speed == 0
    s[SPEED] = speed
    moved = s[WHERE] + speed
    s[WHERE] = _wrapped(moved, 65_536)
    if s[WHERE] != moved:
        s[WRAPAROUND] = 1


@_inlined
def _next_velocity(remaining, velocity, limit, acceleration):
    """Next velocity as `next_velocity`, with `stopping_distance` and `fastest_approach`."""
    if acceleration == 0:
        return velocity
    away, along = (remaining, velocity) if remaining >= 0 else (-remaining, -velocity)
    speed = min(along + acceleration, limit)
    if speed > 0:
        k = speed // acceleration
        if speed * (k + 1) - acceleration * (k * (k + 1) // 2) > away:
            k = np.int64((sqrt(1.0 + 8.0 * away / acceleration) - 1.0) / 2.0)
            while acceleration * (k * (k + 1) // 2) > away:
                k -= 1
            while acceleration * ((k + 1) * (k + 2) // 2) <= away:
                k += 1
            speed = min(limit, (away + acceleration * (k * (k + 1) // 2)) // (k + 1))
    speed = max(speed, along - acceleration)
    return speed if remaining >= 0 else -speed


@_inlined
def _wrapped(position, unit):
    half = unit * (RANGE // 2)
    return (position + half) % (2 * half) - half


@_inlined
def _product(gain, signal, wraps):
    product = gain * signal
    if wraps:
        return ((product + 0x8000) & 0xFFFF) - 0x8000
    return max(-ERROR_HIGH - 1, min(ERROR_HIGH, product))


@_inlined
def _advance_motor(s, f, c, normal):
    """Motor over one sample, as `Motor.advance`."""
    torque = f[DRIVE] * c[TORQUE]
    if c[RIPPLE] != 0.0:
        torque *= 1.0 + c[RIPPLE] * sin(c[RIPPLE_CYCLES] * f[ANGLE])
    if c[DISTURBANCE] != 0.0:
        torque += c[DISTURBANCE] * normal
    if s[STUCK]:
        f[RATE] = 0.0
        return
    velocity = f[RATE]
    if velocity != 0.0:
        friction = c[COULOMB] if velocity > 0.0 else -c[COULOMB]
        rate = (torque - friction - c[DAMPING] * velocity) / c[INERTIA]
        after = velocity + rate * c[SPEED_LIMIT]
        if after * velocity > 0.0:
            f[RATE] = after
            f[ANGLE] += velocity * c[SAMPLE] + rate * c[TRAVEL_LIMIT]
        else:
            _through_standstill(f, c, torque)
    elif abs(torque) > c[STATIC]:
        _through_standstill(f, c, torque)
    if f[ANGLE] < c[LOW] or f[ANGLE] > c[HIGH]:
        f[ANGLE] = min(max(f[ANGLE], c[LOW]), c[HIGH])
        f[RATE] = 0.0


@_inlined
def _through_standstill(f, c, torque):
    """Pass through a standstill, as `Motor._through_standstill`."""
    remaining, decay = c[SAMPLE], c[DAMPING] / c[INERTIA]
    for _ in range(MOST_EVENTS):
        velocity = f[RATE]
        if velocity == 0.0 and abs(torque) <= c[STATIC]:
            return
        sense = velocity if velocity != 0.0 else torque
        friction = c[COULOMB] if sense > 0.0 else -c[COULOMB]
        rate = (torque - friction - c[DAMPING] * velocity) / c[INERTIA]
        stop_time = _stop_time(velocity, rate, decay)
        duration = min(stop_time, remaining)
        speed, travel = _shares(duration, decay)
        f[ANGLE] += velocity * duration + rate * travel
        if stop_time >= remaining:
            f[RATE] = velocity + rate * speed
            return
        f[RATE] = 0.0
        remaining -= duration


@_inlined
def _stop_time(velocity, rate, decay):
    if velocity * rate >= 0.0:
        return np.inf
    straight = -velocity / rate
    if straight * decay >= 1.0:
        return np.inf
    return -log1p(-straight * decay) / decay if straight * decay > 1e-12 else straight


@_inlined
def _shares(duration, decay):
    x = duration * decay
    if x > 1e-2:
        decayed = -expm1(-x)
        return decayed / decay, (x - decayed) / decay**2
    f1 = 1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0))))
    f2 = 0.5 - x / 6.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0 * (1.0 - x / 7.0))))
    return duration * f1, duration**2 * f2
