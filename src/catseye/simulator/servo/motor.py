"""Mirror axis: motor and amplifier, inertia, friction, stops, encoder.

Between two samples of the chip the drive is constant and the motion has a closed form; where the axis comes to rest
within a sample the sample is split there, and friction either holds the axis or the motion reverses. So there is no
chatter at any sample time. Source: [KARNOPP85] for friction that holds; the closed form is derived in `Motor`.
"""

from dataclasses import dataclass
from math import expm1, floor, log1p, sin
from typing import Literal

import numpy as np

from catseye.constants import TWO_PI
from catseye.errors import ValidityError
from catseye.geometry.mirror.encoder import COUNTS_PER_TURN
from catseye.ranger.motion_units import SAMPLE_TIME

MOST_EVENTS = 4  # standstills within one sample: a constant drive allows one, ripple between cuts a second


@dataclass(frozen=True)
class AxisDesign:
    """Design of an axis: a 150 mm mirror and a small torque motor.

    No public values of the ZY are known.

    inertia            kg m^2, motor and mirror
    torque_constant    N m/A, and V s/rad
    amplifier          "current": `full_scale` is A; "voltage": V, behind `resistance`, the inductance neglected
    full_scale         at the converter's end (128 of 128)
    resistance         ohm, of the winding and the amplifier; "voltage" only
    viscous            N m s/rad
    coulomb            N m, friction while it moves
    static             N m, friction that holds it, at least `coulomb`
    ripple             of the torque, as a part of the drive's
    ripple_cycles      of the ripple, a turn
    disturbance        N m rms, new every sample; needs a generator
    low_stop, high_stop   rad, of the axis; it stops there without a bounce
    counts_per_turn    of the encoder
    index_count        count of the index pulse, since power came on, modulo a turn
    """

    inertia: float = 5e-3
    torque_constant: float = 0.3
    amplifier: Literal["current", "voltage"] = "current"
    full_scale: float = 1.0
    resistance: float = 5.0
    viscous: float = 5e-3
    coulomb: float = 8e-3
    static: float = 12e-3
    ripple: float = 0.0
    ripple_cycles: int = 24
    disturbance: float = 0.0
    low_stop: float = -1e3
    high_stop: float = 1e3
    counts_per_turn: int = int(COUNTS_PER_TURN)
    index_count: int = 0

    def __post_init__(self) -> None:
        for name in ("inertia", "torque_constant", "full_scale", "resistance", "counts_per_turn"):
            if not getattr(self, name) > 0:
                raise ValidityError(f"axis: {name} = {getattr(self, name):g} (expected above 0)")
        for name in ("viscous", "coulomb", "static", "ripple", "disturbance"):
            if not 0 <= getattr(self, name) < float("inf"):
                raise ValidityError(f"axis: {name} = {getattr(self, name):g} (expected 0 or above)")
        if self.static < self.coulomb:
            raise ValidityError(f"axis: static = {self.static:g} N m is below coulomb = {self.coulomb:g} N m")
        if not self.low_stop < self.high_stop:
            raise ValidityError(f"axis: low_stop = {self.low_stop:g} is not below high_stop = {self.high_stop:g} rad")
        if self.amplifier not in ("current", "voltage"):
            raise ValidityError(f"axis: amplifier {self.amplifier!r} is neither 'current' nor 'voltage'")

    @property
    def full_torque(self) -> float:
        """Torque of the full drive at rest, N m."""
        current = self.full_scale if self.amplifier == "current" else self.full_scale / self.resistance
        return self.torque_constant * current

    @property
    def damping(self) -> float:
        """Speed-dependent torque loss, N m s/rad: viscous friction, and back-EMF.

        The latter with a voltage amplifier.
        """
        back_emf = self.torque_constant**2 / self.resistance if self.amplifier == "voltage" else 0.0
        return self.viscous + back_emf


class Motor:
    """Axis in motion; `advance` moves it over one sample of the chip.

    With T the drive, B the damping and C the friction against the motion, J dw/dt = T - B w -+ C has, from angle a and
    speed w, over a time t,
        w(t) = w + q t f1(x),  a(t) = a + w t + q t^2 f2(x),  q = (T -+ C - B w)/J,  x = B t/J,
        f1 = (1 - e^-x)/x,  f2 = (x - 1 + e^-x)/x^2,
    and stands still at t = -(J/B) log(1 + w B/(J q)), when q reverses it.

    design      its design
    angle       rad, initial position
    generator   of the disturbance, None without
    sample      s, of the chip

    Raises ValidityError: a disturbance without a generator, or an angle beyond the stops.
    """

    def __init__(
        self,
        design: AxisDesign,
        angle: float = 0.0,
        *,
        generator: np.random.Generator | None = None,
        sample: float = SAMPLE_TIME,
    ):
        if design.disturbance > 0.0 and generator is None:
            raise ValidityError(f"axis: disturbance = {design.disturbance:g} N m needs a generator")
        if not design.low_stop <= angle <= design.high_stop:
            raise ValidityError(
                f"axis: angle {angle:g} rad is outside its stops {design.low_stop:g} to {design.high_stop:g}"
            )
        self.design, self.generator, self.sample = design, generator, sample
        self.angle, self.velocity = float(angle), 0.0
        self._full_torque, self._damping, self._per_radian = (
            design.full_torque, design.damping, design.counts_per_turn / TWO_PI
        )  # fmt: skip
        self._whole = _shares(sample, design.damping / design.inertia)

    @property
    def count(self) -> int:
        """Encoder count since power-on, with steps half-way between counts."""
        return floor(self.angle * self._per_radian + 0.5)

    def torque(self, drive: float) -> float:
        """Torque at rest, N m, of a drive of -1 to 1, with ripple and disturbance."""
        design = self.design
        torque = drive * self._full_torque
        if design.ripple:
            torque *= 1.0 + design.ripple * sin(design.ripple_cycles * self.angle)
        if design.disturbance and self.generator is not None:
            torque += design.disturbance * self.generator.standard_normal()
        return torque

    def advance(self, drive: float) -> None:
        """Move over one sample under a drive of -1 to 1."""
        design, torque = self.design, self.torque(drive)
        velocity = self.velocity
        if velocity != 0.0:
            friction = design.coulomb if velocity > 0.0 else -design.coulomb
            rate = (torque - friction - self._damping * velocity) / design.inertia
            after = velocity + rate * self._whole[0]
            if after * velocity > 0.0:
                self.velocity = after
                self.angle += velocity * self.sample + rate * self._whole[1]
            else:
                self._through_standstill(torque)
        elif abs(torque) > design.static:
            self._through_standstill(torque)
        if self.angle < design.low_stop or self.angle > design.high_stop:
            self.angle = min(max(self.angle, design.low_stop), design.high_stop)
            self.velocity = 0.0

    def _through_standstill(self, torque: float) -> None:
        """One sample in which the axis comes to rest, or leaves it."""
        design, remaining = self.design, self.sample
        for _ in range(MOST_EVENTS):
            if self.velocity == 0.0 and abs(torque) <= design.static:
                return
            sense = self.velocity if self.velocity != 0.0 else torque
            friction = design.coulomb if sense > 0.0 else -design.coulomb
            rate = (torque - friction - self._damping * self.velocity) / design.inertia
            stop_time = self._stop_time(rate)
            duration = min(stop_time, remaining)
            speed, travel = _shares(duration, self._damping / design.inertia)
            self.angle += self.velocity * duration + rate * travel
            if stop_time >= remaining:
                self.velocity += rate * speed
                return
            self.velocity, remaining = 0.0, remaining - duration

    def _stop_time(self, rate: float) -> float:
        """Time until the axis stands still under `rate`, rad/s^2.

        Infinite if it never does.
        """
        if self.velocity * rate >= 0.0:
            return float("inf")
        straight = -self.velocity / rate
        decay = self._damping / self.design.inertia
        if straight * decay >= 1.0:
            return float("inf")
        return -log1p(-straight * decay) / decay if straight * decay > 1e-12 else straight


def index_between(before: int, after: int, *, index: int, turn: int) -> int | None:
    """Count at which the index pulse was passed, None if it was not.

    Between two readings.

    before, after   counts at two samples
    index           count of the pulse, modulo a turn
    turn            counts a turn

    >>> index_between(-3, 4, index=0, turn=100_000), index_between(4, 9, index=0, turn=100_000)
    (0, None)
    """
    low, high = min(before, after), max(before, after)
    first = low + (index - low) % turn
    if first > high:
        return None
    return first if after >= before else high - (high - index) % turn


def _shares(duration: float, decay: float) -> tuple[float, float]:
    """Terms t f1(x), s, and t^2 f2(x), s^2, for speed and angle.

    Of an acceleration from the start.
    """
    x = duration * decay
    if x > 1e-2:
        decayed = -expm1(-x)
        return decayed / decay, (x - decayed) / decay**2
    f1 = 1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0))))
    f2 = 0.5 - x / 6.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0 * (1.0 - x / 7.0))))
    return duration * f1, duration**2 * f2
