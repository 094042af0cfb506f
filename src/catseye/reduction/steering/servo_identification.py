"""Servo axis identified from recorded moves: gain, decay, dry friction, delay of the drive.

With x the position in counts, u the drive in steps held between samples, the moving axis obeys

    x'' = gain (u(t - delay) - friction sign(x')) - decay x'

Position is never differentiated: the equation is multiplied by a smooth window w that vanishes with its slopes at both
ends, and integrated by parts over each window in which the axis moves one way,

    int x w'' = gain (int u(t - delay) w - friction sign int w) + decay int x w',

where the integral of the held drive is exact for any delay. Windows do not overlap, so that their errors, of the
encoder's counts and of torque that is not in the model, are nearly independent; their scatter gives the uncertainty.
Source: [PARKER04] section 6.3.1 for the servo; the equations are derived here from Newton's law of the axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.aliases import Array
from catseye.constants import DEGREE
from catseye.errors import EstimationError
from catseye.records.laboratory.move_table import RecordedMove
from catseye.verdict import Verdict

NAMES = ("gain", "decay", "friction", "delay")
UNITS = ("counts/s²", "1/s", "steps", "s")
WINDOW = 0.06  # s
POWER = 4  # of the window (1 - x^2)^4
SLOWEST = 4.0  # counts that the axis moves in each tenth of a window
TENTHS = 10
FEWEST = 12  # windows
ROUNDS = 30
CONDITION = 1e4  # of the scaled equations
FAR = 5.0  # residuals over their scatter
COUNT_NOISE = 12.0**-0.5  # counts, of a position read as a whole number
LARGEST_FACTOR = 3.0  # scatter over that of whole counts
LEAST_PHASE, LEAST_GAIN = 30.0 * DEGREE, 2.0  # of a loop
LARGEST_U = 0.2  # relative, of the gain


@dataclass(frozen=True)
class ServoLoop:
    """Closed loop of the identified axis with the filter's integers.

    gains        kp, ki, kd, interval
    crossover    rad/s, the highest at which the loop's gain is one
    bandwidth    rad/s, above which the loop follows with less than half of the power
    phase        rad, margin left at the crossover
    gain         factor by which the loop's gain may rise; infinite without a limit
    gain_below   factor, below one, to which it may fall
    """

    gains: tuple[int, int, int, int]
    crossover: float
    bandwidth: float
    phase: float
    gain: float
    gain_below: float

    @property
    def doubts(self) -> list[str]:
        """Objections to its margins."""
        if self.phase <= 0.0 or self.gain <= 1.0:
            return ["with these gains the loop is not stable"]
        if self.phase < LEAST_PHASE:
            return [f"the phase margin is {self.phase / DEGREE:.0f}° (30 or more is usual)"]
        if self.gain < LEAST_GAIN:
            return [f"the loop's gain may rise by {self.gain:.2f} only (2 or more is usual)"]
        return []


@dataclass(frozen=True, eq=False)
class ServoFit:
    """Axis identified from moves.

    moves        as recorded
    values       (4,) of NAMES: counts/s² a step, 1/s, steps, s
    covariance   (4, 4), from the scatter of the windows
    move         (m,) index of each window's move
    centre       (m,) s, of each window
    measured     (m,) counts/s², mean acceleration over the window
    predicted    (m,) counts/s², by the identified axis
    expected     counts/s², scatter of the windows by whole counts alone
    """

    moves: tuple[RecordedMove, ...]
    values: Array
    covariance: Array
    move: np.ndarray
    centre: Array
    measured: Array
    predicted: Array
    expected: float

    @property
    def u(self) -> Array:
        """Standard uncertainties (4,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def residual(self) -> Array:
        """Measured less predicted acceleration (m,), counts/s²."""
        return self.measured - self.predicted

    @property
    def scatter(self) -> float:
        """Standard deviation of the residuals, counts/s²."""
        return float(np.sqrt(np.sum(self.residual**2) / (len(self.residual) - len(NAMES))))

    @cached_property
    def verdict(self) -> Verdict:
        """Good where the moves agree with the axis within their counts."""
        gain = self.values[0]
        signs = {float(np.sign(np.ptp(m.position) and m.position[-1] - m.position[0])) for m in self.moves}
        if self.u[0] > LARGEST_U * gain:
            return Verdict("doubtful", f"the gain is known to {100.0 * self.u[0] / gain:.0f} % only")
        for name, value, u in zip(NAMES[1:], self.values[1:], self.u[1:], strict=True):
            if value < -3.0 * u:
                return Verdict("doubtful", f"the {name} is negative by {-value / u:.1f} u, which no axis has")
        if self.scatter > LARGEST_FACTOR * self.expected:
            factor = self.scatter / self.expected
            return Verdict("doubtful", f"the scatter is {factor:.1f} times that of whole counts: other torques act")
        if np.abs(self.residual).max() > FAR * self.scatter:
            worst = int(np.abs(self.residual).argmax())
            name = self.moves[self.move[worst]].name
            return Verdict("doubtful", f"move {name} leaves the axis near {self.centre[worst]:.3f} s")
        if not {1.0, -1.0} <= signs:
            return Verdict("doubtful", "the moves go one way only, which does not tell friction from a constant torque")
        return Verdict("good", f"{len(self.residual)} windows of {len(self.moves)} moves agree with one axis")


def identify_axis(moves: Sequence[RecordedMove]) -> ServoFit:
    """Axis identified from its recorded moves.

    moves   that accelerate, cruise and brake, both ways

    Raises EstimationError: too little motion, moves that do not separate the four, or a drive of the wrong sign.
    Source: [PARKER04] section 6.3.1; the integrals are derived at the top of this file.
    """
    windows = [(k, i) for k, move in enumerate(moves) for i in _starts(move)]
    if len(windows) < FEWEST:
        raise EstimationError(
            f"the axis moves one way in {len(windows)} windows of {WINDOW:g} s (expected {FEWEST} or more): record "
            "longer or faster moves"
        )
    delay = float(np.mean([move.sample for move in moves]))
    for _ in range(ROUNDS):
        rows = np.array([_equation(moves[k], i, delay) for k, i in windows])
        measured, drive, slope, sign, speed = rows.T
        design = np.column_stack([drive, speed, -sign])
        gain, decay, dry = _solved(design, measured)[0]
        if gain <= 0.0:
            raise EstimationError("the drive works against the acceleration: encoder or motor leads are swapped")
        whole = np.column_stack([design, gain * slope])
        (gain, decay, dry, change), normal = _solved(whole, measured)
        delay += change
        if not -0.25 * WINDOW < delay < 0.5 * WINDOW:
            raise EstimationError(
                f"the delay does not settle ({delay:.3g} s): the moves have too little change of drive"
            )
        if abs(change) < 1e-9:
            break
    rows = np.array([_equation(moves[k], i, delay) for k, i in windows])
    measured, drive, _, sign, speed = rows.T
    predicted = gain * drive + decay * speed - dry * sign
    left = measured - predicted
    of_four = normal * float(left @ left) / (len(left) - len(NAMES))
    to_friction = np.eye(4)
    to_friction[2] = [-dry / gain**2, 0.0, 1.0 / gain, 0.0]
    return ServoFit(
        moves=tuple(moves),
        values=np.array([gain, decay, dry / gain, delay]),
        covariance=to_friction @ of_four @ to_friction.T,
        move=np.array([k for k, _ in windows]),
        centre=np.array([moves[k].time[i] + 0.5 * WINDOW for k, i in windows]),
        measured=measured,
        predicted=predicted,
        expected=float(np.mean([_count_scatter(move) for move in moves])),
    )


def _solved(design: Array, measured: Array) -> tuple[Array, Array]:
    """Least-squares values, and the inverse of the normal matrix."""
    scale = np.sqrt(np.mean(design**2, axis=0))
    if not (scale > 0.0).all() or np.linalg.cond(design / scale) > CONDITION:
        raise EstimationError(
            "the moves do not separate gain, decay, friction and delay: accelerate, cruise and brake, both ways"
        )
    inverse = np.linalg.pinv(design / scale)
    return inverse @ measured / scale, inverse @ inverse.T / np.outer(scale, scale)


def _length(move: RecordedMove) -> int:
    """Samples between both ends of a window."""
    return max(TENTHS, round(WINDOW / move.sample))


def _starts(move: RecordedMove) -> list[int]:
    """First samples of the windows, end to end, in which the axis keeps moving one way."""
    n, starts = _length(move), []
    at = max(0, n // 2)  # the drive before the window is needed, too
    while at + n + 1 < len(move.time):
        parts = np.diff(move.position[np.linspace(at, at + n, TENTHS + 1).round().astype(int)])
        if (parts >= SLOWEST).all() or (parts <= -SLOWEST).all():
            starts.append(at)
            at += n
        else:
            at += max(1, n // TENTHS)
    return starts


def _window(x: Array) -> tuple[Array, Array, Array]:
    """Window of unit area over -1 to 1: its integral from -1, itself, its second derivative."""
    inside = np.clip(x, -1.0, 1.0)
    w = np.polynomial.Polynomial([1.0, 0.0, -1.0]) ** POWER
    area = w.integ(lbnd=-1.0)
    size = float(area(1.0))
    within = np.abs(x) <= 1.0
    return (
        area(inside) / size,
        np.where(within, w(inside), 0.0) / size,
        np.where(within, w.deriv(2)(inside), 0.0) / size,
    )


def _equation(move: RecordedMove, start: int, delay: float) -> tuple[float, float, float, float, float]:
    """Integrals of one window, for a window of unit area in time.

    Mean acceleration, drive, slope of the drive's by the delay, sign of the motion, mean speed with its sign turned.
    """
    n = _length(move)
    half = 0.5 * n * move.sample
    middle = move.time[start] + half
    x = (move.time[start : start + n + 1] - middle) / half
    position = move.position[start : start + n + 1]
    origin = position - position[n // 2]
    _, _, curve = _window(x)
    step = move.sample / half
    acceleration = float(np.sum(origin * curve)) * step / half**2
    w = np.polynomial.Polynomial([1.0, 0.0, -1.0]) ** POWER
    tilt = w.deriv(1)(np.clip(x, -1.0, 1.0)) / float(w.integ(lbnd=-1.0)(1.0))
    speed = -float(np.sum(origin * tilt)) * step / half
    edges = (np.append(move.time, move.time[-1] + move.sample) + delay - middle) / half
    area, height, _ = _window(edges)
    drive = float(np.sum(move.drive * np.diff(area)))
    slope = float(np.sum(move.drive * np.diff(height))) / half
    return acceleration, drive, slope, float(np.sign(position[-1] - position[0])), -speed


def _count_scatter(move: RecordedMove) -> float:
    """Scatter of a window's mean acceleration by whole counts, counts/s²."""
    n = _length(move)
    half = 0.5 * n * move.sample
    curve = _window(np.linspace(-1.0, 1.0, n + 1))[2]
    return float(COUNT_NOISE * np.sqrt(np.sum(curve**2)) * move.sample / half**3)
