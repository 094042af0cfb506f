"""Tuning an axis: plant, filter integers, margins, step response.

Beyond friction the axis is gain/(s (s + decay)) from converter steps to counts. Sampled with the converter holding its
word, and the word one sample late, this has an exact discrete form; so has the filter. The two zeros of the filter are
set equal (a symmetrical choice: integral and derivative then share the phase) at the largest frequency that leaves the
phase margin at the required crossover, found on the discrete loop; the loop's gain there gives the size. Margins are
then computed again with the integers. Source: [FRANKLIN98], sampled plants, discrete PID, margins.
"""

from dataclasses import dataclass
from math import expm1, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import DEGREE, TWO_PI
from catseye.errors import ValidityError
from catseye.ranger.motion_units import LARGEST_GAIN, LIMITS, SAMPLE_TIME, checked
from catseye.simulator.servo.axis import ServoAxis
from catseye.simulator.servo.motion_chip import MotionChip
from catseye.simulator.servo.motor import AxisDesign, Motor

STEPS = 128.0  # steps of the 8-bit converter; gains refer to it, a 12-bit converter is only finer
SCALE = 256.0  # of the filter's 16-bit sum to a step; of the sum of errors to what ki multiplies
BISECTIONS = 60


@dataclass(frozen=True)
class Plant:
    """Axis as seen by the filter.

    gain       counts/s^2 a converter step
    decay      1/s, of the speed without drive: damping over inertia
    friction   converter steps, dry friction of the moving axis
    sample     s
    late       s, of the drive beyond one sample; below 0 within its uncertainty
    """

    gain: float
    decay: float
    friction: float = 0.0
    sample: float = SAMPLE_TIME
    late: float = 0.0

    def __post_init__(self) -> None:
        if not (self.gain > 0.0 and self.decay >= 0.0 and self.friction >= 0.0 and self.sample > 0.0):
            raise ValidityError(
                f"plant: gain {self.gain:g} counts/s^2, decay {self.decay:g} 1/s, friction {self.friction:g} steps, "
                f"sample {self.sample:g} s (expected above 0, 0 or above, 0 or above, above 0)"
            )


@dataclass(frozen=True)
class Filter:
    """Five integers of the filter, in the order of FLT."""

    kp: int
    ki: int
    kd: int
    il: int
    interval: int = 0

    @property
    def values(self) -> tuple[int, int, int, int, int]:
        """Values kp, ki, kd, il, interval."""
        return self.kp, self.ki, self.kd, self.il, self.interval


@dataclass(frozen=True)
class Margins:
    """Stability margins of a loop.

    crossover      rad/s, the highest at which the loop's gain is one
    phase          rad, left at the crossover
    gain           factor by which the loop's gain may rise
    gain_below     factor, below one, to which it may fall: not to nothing with an integral term; 0 without
    """

    crossover: float
    phase: float
    gain: float
    gain_below: float


@dataclass(frozen=True)
class StepMetrics:
    """Metrics of a step response.

    rise        s, from 10 to 90 % of the step
    overshoot   part of the step, 0 or above
    settling    s, after which it stays within the tolerance; NaN when it does not
    """

    rise: float
    overshoot: float
    settling: float


def ready_axis(
    filter_: Filter,
    *,
    velocity: int,
    acceleration: int,
    design: AxisDesign | None = None,
    error_limit: int = 2000,
    angle: float = 0.0,
    chip: MotionChip | None = None,
) -> ServoAxis:
    """Axis ready to move: amplifier on, filter and profile loaded.

    filter_                  its integers
    velocity, acceleration   of its moves, as ABV and ABA take them
    design                   of the axis; the assumed one if None
    error_limit              counts, as ERL takes it
    angle                    rad, initial position
    chip                     after reset; one with an 8-bit converter if None

    Raises ValidityError for values that a command does not accept.
    """
    axis = ServoAxis(chip or MotionChip(), Motor(design or AxisDesign(), angle))
    axis.axis(True)
    axis.flt(*filter_.values)
    axis.erl(error_limit)
    axis.abv(velocity)
    axis.aba(acceleration)
    return axis


def plant_of(design: AxisDesign, sample: float = SAMPLE_TIME) -> Plant:
    """Plant of an axis of known design.

    design   of the axis
    sample   s

    >>> f"{plant_of(AxisDesign()).gain:.0f} counts/s^2 a step"
    '7460 counts/s^2 a step'
    """
    torque = design.full_torque / STEPS
    gain = torque / design.inertia * design.counts_per_turn / TWO_PI
    return Plant(gain, design.damping / design.inertia, design.coulomb / torque, sample)


def plant_response(plant: Plant, frequency: ArrayLike) -> NDArray[np.complex128]:
    """Counts a converter step at a frequency: axis, hold and delay.

    plant       the axis
    frequency   rad/s, below pi over the sample time

    Source: [FRANKLIN98], zero-order hold equivalent of K/(s (s + d)), here times 1/z.
    """
    angular = np.asarray(frequency, dtype=float)
    z = np.exp(1j * angular * plant.sample)
    (b1, b0), pole = _sampled_plant(plant)
    return (b1 * z + b0) / ((z - 1.0) * (z - pole)) / z * np.exp(-1j * angular * plant.late)


def filter_response(filter_: Filter, frequency: ArrayLike, sample: float = SAMPLE_TIME) -> NDArray[np.complex128]:
    """Converter steps a count of error at a frequency, unrounded, unlimited.

    filter_     its integers
    frequency   rad/s
    sample      s

    With an interval of m samples the difference is taken every m-th sample and held: valid below half that rate.
    """
    return _response((filter_.kp, filter_.ki, filter_.kd), filter_.interval, frequency, sample)


def margins(plant: Plant, filter_: Filter) -> Margins:
    """Crossover, phase and gain margins of the sampled loop.

    plant     the axis
    filter_   its integers

    Raises ValidityError: the loop's gain is never one.
    """
    frequency = np.geomspace(1e-2, pi / plant.sample / (filter_.interval + 1), 60_001)[:-1]
    loop = plant_response(plant, frequency) * filter_response(filter_, frequency, plant.sample)
    size, phase = np.abs(loop), np.unwrap(np.angle(loop))
    phase -= TWO_PI * np.round((phase[0] + pi) / TWO_PI)  # starts between -270 and -90 degrees
    above = np.flatnonzero((size[:-1] >= 1.0) & (size[1:] < 1.0))
    if not len(above):
        raise ValidityError(f"the loop with kp {filter_.kp}, ki {filter_.ki}, kd {filter_.kd} has no crossover")
    last = above[-1]
    crossings = np.flatnonzero((phase[:-1] + pi) * (phase[1:] + pi) < 0.0)
    higher, lower = crossings[crossings > last], crossings[crossings <= last]
    return Margins(
        crossover=float(frequency[last]),
        phase=float(phase[last] + pi),
        gain=float(1.0 / size[higher[0]]) if len(higher) else float("inf"),
        gain_below=float(1.0 / size[lower[-1]]) if len(lower) else 0.0,
    )


def bandwidth(plant: Plant, filter_: Filter) -> float:
    """Frequency, rad/s, above which the closed loop follows with less than half of the power.

    plant     the axis
    filter_   its integers

    Raises ValidityError: the loop follows at no frequency.
    """
    frequency = np.geomspace(1e-2, pi / plant.sample / (filter_.interval + 1), 60_001)[:-1]
    loop = plant_response(plant, frequency) * filter_response(filter_, frequency, plant.sample)
    follows = np.flatnonzero(np.abs(loop / (1.0 + loop)) >= 0.5**0.5)
    if not len(follows):
        raise ValidityError(f"the loop with kp {filter_.kp}, ki {filter_.ki}, kd {filter_.kd} follows nothing")
    return float(frequency[follows[-1]])


def design_filter(
    plant: Plant, *, crossover_hz: float = 20.0, phase_margin: float = 55.0 * DEGREE, interval: int = 0
) -> Filter:
    """Filter integers for a crossover and a phase margin.

    plant          the axis
    crossover_hz   where the loop's gain is one
    phase_margin   rad, at the crossover; above 0, below pi/2
    interval       of the derivative, samples less one, 0 to 255: a longer one is quieter and costs phase

    The integral's limit is three times the friction and at least 16 steps: it must cover the friction, no more.
    Raises ValidityError: the margin is not attainable there, or an integer would not fit its register.
    """
    checked("FSI", interval)
    if not 0.0 < phase_margin < 0.5 * pi:
        raise ValidityError(f"phase margin {phase_margin:g} rad is outside 0 to pi/2: check its unit")
    frequency = TWO_PI * crossover_hz
    if not 0.0 < frequency < pi / plant.sample / (interval + 1):
        raise ValidityError(f"crossover {crossover_hz:g} Hz is outside 0 to half the derivative's rate")
    axis = plant_response(plant, frequency)

    def loop(zero: float) -> NDArray[np.complex128]:
        """Response of axis and filter (s + zero)^2/s at the crossover."""
        return axis * _response(_gains(zero, 1.0, plant, interval), interval, frequency, plant.sample)

    def margin(zero: float) -> float:
        """Phase margin with both zeros at a frequency, between -pi and pi."""
        return float(np.angle(-loop(zero)))

    low, high = 1e-6 * frequency, frequency
    if margin(low) < phase_margin:
        raise ValidityError(
            f"phase margin {phase_margin / DEGREE:.0f} degrees is not attainable at {crossover_hz:g} Hz: at most "
            f"{margin(low) / DEGREE:.0f}; lower the crossover or the derivative's interval"
        )
    for _ in range(BISECTIONS):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if margin(middle) > phase_margin else (low, middle)
    kp, ki, kd = _gains(low, float(1.0 / np.abs(loop(low))), plant, interval)
    rounded = {"FKP": round(kp), "FKI": round(ki), "FKD": round(kd)}
    for command, value in rounded.items():
        if not 1 <= value <= LARGEST_GAIN:
            raise ValidityError(
                f"{command}: {LIMITS[command].name} {value} for a crossover of {crossover_hz:g} Hz does not fit "
                f"1 to {LARGEST_GAIN}: another crossover, interval or amplifier gain"
            )
    limit = min(LARGEST_GAIN, round(SCALE * max(16.0, 3.0 * plant.friction)))
    return Filter(rounded["FKP"], rounded["FKI"], rounded["FKD"], limit, interval)


def closed_loop(plant: Plant, filter_: Filter) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Closed loop from desired to actual counts: numerator, denominator in z.

    Falling powers of z, for a derivative every sample.

    plant     the axis
    filter_   its integers

    Raises ValidityError: a derivative less often or a drive later than a sample, which have no such form.
    """
    if plant.late:
        raise ValidityError(f"drive late by {plant.late:g} s: the closed form holds for one sample of delay")
    if filter_.interval:
        raise ValidityError(f"interval {filter_.interval}: the closed form holds for a derivative every sample (0)")
    b, pole = _sampled_plant(plant)
    ki = filter_.ki / SCALE
    pid = np.array([filter_.kp + ki + filter_.kd, -filter_.kp - 2.0 * filter_.kd, filter_.kd]) / SCALE
    # Over z (z - 1) of the filter, z of the delay, (z - 1)(z - pole) of the axis.
    forward: NDArray[np.float64] = np.asarray(np.polymul(pid, b), dtype=np.float64)
    below = np.polymul(np.polymul([1.0, -1.0, 0.0], [1.0, 0.0]), np.polymul([1.0, -1.0], [1.0, -pole]))
    return forward, np.asarray(np.polyadd(below, forward), dtype=np.float64)


def step_metrics(time: ArrayLike, position: ArrayLike, *, target: float, tolerance: float = 1.0) -> StepMetrics:
    """Rise, overshoot and settling of a step response.

    time        (n,) s, the step at the first
    position    (n,) counts
    target      counts, where it should end
    tolerance   counts about the target

    Raises ValidityError: no step, or positions that are not (n,) finite numbers, n above 1.

    >>> step_metrics([0, 1, 2, 3], [0, 50, 150, 100], target=100)
    StepMetrics(rise=1.2, overshoot=0.5, settling=3.0)
    """
    t, y = np.asarray(time, dtype=float), np.asarray(position, dtype=float)
    if t.shape != y.shape or t.ndim != 1 or len(t) < 2 or not np.isfinite([t, y]).all():
        raise ValidityError(f"step response: times {t.shape}, positions {y.shape} (expected (n,) finite numbers each)")
    size = target - y[0]
    if size == 0.0:
        raise ValidityError(f"step response: it starts at its target, {target:g} counts (expected another)")
    part = (y - y[0]) / size
    rise = _first(t, part, 0.9) - _first(t, part, 0.1)
    outside = np.flatnonzero(np.abs(y - target) > tolerance)
    last = int(outside[-1]) if len(outside) else -1
    settling = float("nan") if last + 1 >= len(t) else float(t[last + 1] - t[0])
    return StepMetrics(rise, max(0.0, float(part.max()) - 1.0), settling)


def _first(t: NDArray[np.float64], part: NDArray[np.float64], level: float) -> float:
    """Time of first reaching a level, interpolated; NaN if never."""
    at = np.flatnonzero(part >= level)
    if not len(at):
        return float("nan")
    i = int(at[0])
    if i == 0:
        return float(t[0])
    return float(t[i - 1] + (level - part[i - 1]) / (part[i] - part[i - 1]) * (t[i] - t[i - 1]))


def _sampled_plant(plant: Plant) -> tuple[NDArray[np.float64], float]:
    """Sampled plant: (b1, b0) and pole of (b1 z + b0)/((z - 1)(z - pole)), counts a step."""
    t, x = plant.sample, plant.decay * plant.sample
    if x < 1e-4:  # the closed forms cancel; the next terms of their series are below 1e-8 of these
        return plant.gain * t**2 * np.array([0.5 - x / 6.0, 0.5 - x / 3.0]), 1.0 - x + 0.5 * x**2
    decayed = -expm1(-x)
    pole = 1.0 - decayed
    return plant.gain / plant.decay**2 * np.array([x - decayed, decayed - x * pole]), pole


def _gains(zero: float, size: float, plant: Plant, interval: int) -> tuple[float, float, float]:
    """Gains kp, ki and kd, unrounded, of size (s + zero)^2/s: steps a count."""
    t = plant.sample
    return SCALE * 2.0 * zero * size, SCALE**2 * zero**2 * size * t, SCALE * size / (t * (interval + 1))


def _response(
    gains: tuple[float, float, float], interval: int, frequency: ArrayLike, sample: float
) -> NDArray[np.complex128]:
    kp, ki, kd = gains
    back = np.exp(-1j * np.asarray(frequency, dtype=float) * sample)  # one sample
    m = interval + 1
    derivative = kd * (1.0 - back**m) ** 2 / (1.0 - back) / m
    response: NDArray[np.complex128] = np.asarray((kp + ki / SCALE / (1.0 - back) + derivative) / SCALE)
    return response
