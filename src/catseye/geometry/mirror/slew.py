"""Slews of a mirror's axes: position, bound of beam rate.

Each axis ramps up at constant acceleration, runs, and ramps down (a trapezoid of speed, a triangle for a short
move). The axes start together, and each takes the time it needs: the path is not straight in counts. Coordinated axes
share one trapezoid and end together: straight in counts. Tracking, eq. 2.45 and 2.46, is a ramp of no length.

The beam u = (sin Phi cos Theta, sin Phi sin Theta, cos Phi) turns at sqrt(Theta'^2 sin^2 Phi + Phi'^2), primes for
rates: never faster than sqrt(Theta'^2 + Phi'^2), which `beam_rate` is. Theta' is the rate of the azimuth axis, Phi'
twice that of the elevation axis.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.geometry.mirror.encoder import BEAM_PER_COUNT


@dataclass(frozen=True)
class Pace:
    """Limits of the axes: speed, counts/s, and acceleration, counts/s^2, above 0.

    Azimuth and elevation.

    coordinated    both axes share one profile, straight in counts; else each has its own
    start_skew     s, 0 or more: largest delay of one axis after the other; a guard widens its margin by it

    Raises ValidityError otherwise.
    """

    velocity: tuple[float, float]
    acceleration: tuple[float, float]
    coordinated: bool = False
    start_skew: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.start_skew < np.inf:
            raise ValidityError(f"start_skew = {self.start_skew} s is not 0 or more and finite")
        for name in ("velocity", "acceleration"):
            value = tuple(float(v) for v in getattr(self, name))
            if len(value) != 2 or not all(0.0 < v < np.inf for v in value):
                unit = "counts/s" if name == "velocity" else "counts/s^2"
                raise ValidityError(f"{name} = {value} is not two numbers above 0 (azimuth, elevation, {unit})")
            object.__setattr__(self, name, value)


@dataclass(frozen=True, eq=False)
class MirrorSlew:
    """Moves of both axes, a batch (...); `trapezoid` and `straight` make them.

    start, end    (..., 2), counts, azimuth and elevation
    ramp          (..., 2), s, length of the ramp up and of the ramp down of each axis
    duration      (..., 2), s, from the common start to each axis' end
    """

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    ramp: NDArray[np.float64]
    duration: NDArray[np.float64]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch of moves."""
        return self.start.shape[:-1]

    @property
    def total(self) -> NDArray[np.float64]:
        """Time (...), s, until both axes stand."""
        return np.max(self.duration, axis=-1)

    @property
    def top_speed(self) -> NDArray[np.float64]:
        """Signed speed (..., 2), counts/s, between the ramps; 0 without a move."""
        running = self.duration - self.ramp
        return (self.end - self.start) / np.where(running > 0.0, running, np.inf)

    def __getitem__(self, index: Any) -> "MirrorSlew":
        """Moves selected from the batch."""
        return MirrorSlew(self.start[index], self.end[index], self.ramp[index], self.duration[index])

    def position(self, time: ArrayLike) -> NDArray[np.float64]:
        """Counts (..., 2) at times (...) s from the start.

        Before it the start, after the end the end.
        """
        full = np.broadcast_to(self.duration, np.broadcast_shapes(self.duration.shape, (*np.shape(time), 2)))
        t = np.clip(np.asarray(time, dtype=float)[..., None], 0.0, full)
        remaining, ramp = full - t, np.where(self.ramp > 0.0, self.ramp, 1.0)
        half = 0.5 * self.ramp
        way_up = np.where(t < self.ramp, 0.5 * t**2 / ramp, t - half)
        way_down = np.where(remaining < self.ramp, 0.5 * remaining**2 / ramp, remaining - half)
        # Each half from its own end: both ends are exact.
        return np.where(t < remaining, self.start + self.top_speed * way_up, self.end - self.top_speed * way_down)

    def beam_rate(self, after: ArrayLike = 0.0) -> NDArray[np.float64]:
        """Bound (...), rad/s, of the beam's turning rate from a time (...) s on."""
        remaining = np.clip(self.duration - np.asarray(after, dtype=float)[..., None], 0.0, None)
        slowed = np.where(
            remaining < self.ramp, remaining / np.where(self.ramp > 0.0, self.ramp, 1.0), 1.0 * (remaining > 0.0)
        )
        rate = self.top_speed * slowed * BEAM_PER_COUNT
        return np.hypot(rate[..., 0], rate[..., 1])


def trapezoid(start: ArrayLike, end: ArrayLike, pace: Pace) -> MirrorSlew:
    """Quickest moves between counts, at rest at both ends.

    start, end    (..., 2), counts
    pace          of the axes

    Source: the trapezoidal profile of the motion chip, [TEXAS13]; duration d/v + v/a, or 2 sqrt(d/a) where d < v^2/a.

    >>> move = trapezoid([0.0, 0.0], [10_000.0, 400.0], Pace((5000.0, 5000.0), (10_000.0, 10_000.0)))
    >>> move.duration.tolist(), move.position(0.4).round(9).tolist()
    ([2.5, 0.4], [800.0, 400.0])
    """
    a, b = _pairs(start, end)
    travel = np.abs(b - a)
    velocity, acceleration = np.array(pace.velocity), np.array(pace.acceleration)
    if pace.coordinated:
        # The completed share, 0 to 1, is one trapezoid within the limits of both axes.
        divisor, moves = np.where(travel > 0.0, travel, 1.0), np.any(travel > 0.0, axis=-1)
        limits = (np.where(travel > 0.0, v / divisor, np.inf) for v in (velocity, acceleration))
        fast, steep = (np.where(moves, np.min(v, axis=-1), 1.0) for v in limits)
        ramp, full = (np.where(moves, v, 0.0)[..., None] for v in _times(1.0, fast, steep))
        return MirrorSlew(a, b, np.broadcast_to(ramp, a.shape), np.broadcast_to(full, a.shape))
    ramp, full = _times(travel, velocity, acceleration)
    return MirrorSlew(a, b, ramp, full)


def straight(start: ArrayLike, end: ArrayLike, duration: ArrayLike) -> MirrorSlew:
    """Moves at constant rates, as tracks between time tags.

    start, end    (..., 2), counts
    duration      (...), s, 0 or above; 0 only where start and end agree

    Raises ValidityError otherwise.

    Source: [PARKER04] eq. 2.45 and 2.46. Exact.

    >>> straight([0.0, 0.0], [10.0, -4.0], 2.0).position(0.5).tolist()
    [2.5, -1.0]
    """
    a, b = _pairs(start, end)
    seconds = np.broadcast_to(np.asarray(duration, dtype=float), a.shape[:-1])
    jump = ~((seconds > 0.0) | ((seconds == 0.0) & np.all(a == b, axis=-1)))
    if np.any(jump):
        raise ValidityError(f"duration {float(seconds[jump].flat[0])} s of a move is not above 0")
    full = np.broadcast_to(seconds[..., None], a.shape)
    return MirrorSlew(a, b, np.zeros_like(full), full)


def _times(travel: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> tuple[NDArray, NDArray]:
    """Durations of a ramp and of the full move, s."""
    travel, velocity, acceleration = np.broadcast_arrays(travel, velocity, acceleration)
    short = travel < velocity**2 / acceleration
    ramp = np.where(short, np.sqrt(travel / acceleration), np.where(travel > 0.0, velocity / acceleration, 0.0))
    return ramp, np.where(short, 2.0 * ramp, travel / velocity + ramp)


def _pairs(start: ArrayLike, end: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Both as floats of one shape (..., 2); others are refused."""
    a, b = np.broadcast_arrays(np.asarray(start, dtype=float), np.asarray(end, dtype=float))
    if a.shape[-1:] != (2,):
        raise ValidityError(f"counts of a slew have shape {a.shape}, expected (..., 2)")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise ValidityError("counts of a slew hold a number that is not finite")
    return a, b
