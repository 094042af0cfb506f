"""Trend of a noisy record: smoothed level and rate, their covariance, and noise strengths.

    level' = rate + level wander,   rate' = rate wander,   reading = level + noise

Level and rate are random walks. The states at n times are one Gaussian with a banded precision (bandwidth seven), so
that the likelihood of the strengths, the states and any column of their covariance take time proportional to n.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

LEAST_SHARE = 0.7  # of the usual noise: few sparse readings separate noise and wander badly
FEWEST = 6  # readings needed to estimate the strengths
STEPS = (2, 3)  # refinements of the likelihood's grid: divisors of its step
GRID = 5  # values of each time scale tried at first


@dataclass(frozen=True)
class TrendStrength:
    """Noise of a record, and random walks of its level and rate.

    noise   standard deviation of a reading
    level   wander of the level, a unit per root second
    rate    wander of its rate, a unit per second per root second; above 0
    """

    noise: float
    level: float
    rate: float


@dataclass(frozen=True, eq=False)
class Trend:
    """Smoothed level and rate of a record, at the times of a grid.

    seconds       (g,) s, ascending
    level, rate   (g,) unit, unit/s: expectation given all readings
    strength      of the record
    factor        banded Cholesky factor of the states' precision (level and rate, time by time)
    """

    seconds: np.ndarray
    level: np.ndarray
    rate: np.ndarray
    strength: TrendStrength
    factor: np.ndarray
    first: float
    last: float

    def at(self, seconds: np.ndarray) -> np.ndarray:
        """Level at times (...).

        Constant before the first and after the last reading.
        """
        return np.interp(np.clip(seconds, self.first, self.last), self.seconds, self.level)

    def rate_at(self, seconds: np.ndarray) -> np.ndarray:
        """Rate at times (...), unit/s, from adjacent grid steps.

        Zero outside the readings.
        """
        if len(self.seconds) < 2:
            return np.zeros(np.shape(seconds))
        inside = (seconds >= self.first) & (seconds <= self.last)
        return np.where(inside, np.interp(seconds, self.seconds, np.gradient(self.level, self.seconds)), 0.0)

    def covariance(self, seconds: np.ndarray) -> np.ndarray:
        """Covariance (k, k) unit^2 of the errors of `at` at k times.

        Outside the readings it grows with the distance.
        """
        clipped = np.clip(seconds, self.first, self.last)
        right = np.zeros((2 * len(self.seconds), len(seconds)))
        after = np.clip(np.searchsorted(self.seconds, clipped), 1, max(len(self.seconds) - 1, 1))
        if len(self.seconds) == 1:
            right[0] = 1.0
        else:
            span = self.seconds[after] - self.seconds[after - 1]
            share = (clipped - self.seconds[after - 1]) / span
            right[2 * (after - 1), np.arange(len(seconds))] = 1.0 - share
            right[2 * after, np.arange(len(seconds))] += share
        inside = right.T @ cho_solve_banded((self.factor, True), right, check_finite=False)
        return 0.5 * (inside + inside.T) + self._extrapolation_covariance(np.asarray(seconds) - clipped)

    def _extrapolation_covariance(self, distance: np.ndarray) -> np.ndarray:
        """Covariance of a constant level at distances (k,) s outside the readings, negative before the first."""
        d, s = np.abs(distance), self.strength
        same_side = np.sign(distance)[:, None] * np.sign(distance) > 0.0
        shorter = np.minimum(d[:, None], d)
        usual = float(np.sqrt(np.mean(self.rate**2))) if len(self.rate) else 0.0
        return np.where(same_side, s.level**2 * shorter + s.rate**2 * shorter**3 / 3.0 + usual**2 * np.outer(d, d), 0.0)


@dataclass(frozen=True, eq=False)
class _Record:
    """Readings at distinct times; `weight` is the number averaged in each."""

    seconds: np.ndarray
    values: np.ndarray
    weight: np.ndarray

    @staticmethod
    def of(seconds: ArrayLike, values: ArrayLike) -> "_Record":
        distinct, which = np.unique(np.round(np.asarray(seconds, dtype=float), 1), return_inverse=True)
        weight = np.bincount(which).astype(float)
        return _Record(distinct, np.bincount(which, np.asarray(values, dtype=float)) / weight, weight)

    @cached_property
    def step(self) -> float:
        return float(np.median(np.diff(self.seconds)))

    def likelihood(self, level: float, rate: float) -> tuple[float, float]:
        """Minus twice the log restricted likelihood, and the best noise variance.

        level, rate   wander over the noise, squared: 1/s and 1/s^3
        """
        band, logarithm = _precision(np.diff(self.seconds), level, rate)
        band[0, 0::2] += self.weight
        right = np.zeros(band.shape[1])
        centre = self.values - np.average(self.values, weights=self.weight)
        right[0::2] = self.weight * centre
        try:
            factor = cholesky_banded(band, lower=True, check_finite=False)
        except LinAlgError:
            return np.inf, 0.0
        state = cho_solve_banded((factor, True), right, check_finite=False)
        squares = max(float(centre @ (right[0::2] - self.weight * state[0::2])), 0.0)
        degrees = len(self.values) - 2
        variance = max(squares / degrees, 1e-12 * float(np.mean(self.values**2)) + 1e-30)
        return degrees * np.log(variance) + 2.0 * float(np.log(factor[0]).sum()) + logarithm, variance


def trend_strength(seconds: ArrayLike, values: ArrayLike, *, usual: TrendStrength, least_noise: float) -> TrendStrength:
    """Noise of a record and wander of its level and rate, estimated from its readings.

    seconds       (n,) s, any order
    values        (n,)
    usual         assumed for fewer than six readings
    least_noise   lower limit of a reading's noise, by rounding; it is also at least seven tenths of the usual

    Restricted maximum likelihood over two time scales, on a grid that is refined; the noise follows in closed form.

    Source: [PATTERSON71]; structural time series, local linear trend.
    """
    record = _Record.of(seconds, values)
    if len(record.seconds) < FEWEST:
        return usual
    step, span = record.step, float(np.ptp(record.seconds))
    # A time scale is the averaging time of the steady-state filter: sqrt(r step/q), and (r step/q)^(1/4) of a rate.
    axes = [np.linspace(np.log(0.3 * step), np.log(span), GRID) for _ in range(2)]
    tried: dict[tuple[float, float], tuple[float, float]] = {}

    def cost(a: float, b: float) -> float:
        if (a, b) not in tried:
            tried[a, b] = record.likelihood(step / np.exp(2.0 * a), step / np.exp(4.0 * b))
        return tried[a, b][0]

    best = min(((a, b) for a in axes[0] for b in axes[1]), key=lambda p: cost(*p))
    width = axes[0][1] - axes[0][0]
    for by in STEPS:
        width /= by
        near = [(best[0] + i * width, best[1] + j * width) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        best = min((p for p in near if p[1] <= axes[1][-1]), key=lambda p: cost(*p))
    variance = max(tried[best][1], least_noise**2, (LEAST_SHARE * usual.noise) ** 2)
    level, rate = (np.sqrt(variance * step / np.exp(k * v)) for k, v in zip((2.0, 4.0), best, strict=True))
    return TrendStrength(float(np.sqrt(variance)), float(level), float(rate))


def trend_of(seconds: ArrayLike, values: ArrayLike, strength: TrendStrength, *, grid: ArrayLike = ()) -> Trend:
    """Level and rate of a record of n >= 1 readings, at their times and those of a grid.

    Source: fixed-interval smoother of a local linear trend, as one banded system; flat priors on both states.
    """
    record = _Record.of(seconds, values)
    first, last = record.seconds[0], record.seconds[-1]
    more = np.asarray(grid, dtype=float)
    more = more[(more > first) & (more < last)]
    after = np.searchsorted(record.seconds, more)
    apart = np.minimum(more - record.seconds[after - 1], record.seconds[after] - more) if len(more) else more
    times = np.union1d(record.seconds, more[apart > 0.1 * (more[1] - more[0])] if len(more) > 1 else more)
    band, _ = _precision(np.diff(times), strength.level**2, strength.rate**2)
    at = 2 * np.searchsorted(times, record.seconds)
    weight = record.weight / strength.noise**2
    band[0, at] += weight
    if len(record.seconds) < 2:
        band[0, 1::2] += 1.0 / (strength.level**2 + 1e-30)  # one reading gives no rate
    mean = float(np.mean(record.values))
    right = np.zeros(band.shape[1])
    right[at] = weight * (record.values - mean)
    factor = cholesky_banded(band, lower=True, check_finite=False)
    state = cho_solve_banded((factor, True), right, check_finite=False)
    return Trend(
        seconds=times,
        level=state[0::2] + mean,
        rate=state[1::2],
        strength=strength,
        factor=factor,
        first=float(first),
        last=float(last),
    )


def _precision(steps: np.ndarray, level: float, rate: float) -> tuple[np.ndarray, float]:
    """Lower band (4, 2g) of the precision by the wander alone, and log determinant of the steps' covariances.

    steps         (g - 1,) s, above 0
    level, rate   variances a second of the two wanders
    """
    band = np.zeros((4, 2 * (len(steps) + 1)))
    d = steps
    aa, ab, bb = rate * d**3 / 3.0 + level * d, 0.5 * rate * d**2, rate * d
    determinant = rate * d * (level * d + rate * d**3 / 12.0)
    paa, pab, pbb = bb / determinant, -ab / determinant, aa / determinant
    band[0, 2::2] += paa  # of the later time
    band[0, 3::2] += pbb
    band[1, 2::2] += pab
    band[0, 0:-2:2] += paa  # of the earlier: F' P F with F = [1 d; 0 1]
    band[1, 0:-2:2] += paa * d + pab
    band[0, 1:-2:2] += paa * d**2 + 2.0 * pab * d + pbb
    band[2, 0:-2:2] += -paa  # later level, earlier level
    band[3, 0:-2:2] += -pab  # later rate, earlier level
    band[1, 1:-2:2] += -(paa * d + pab)  # later level, earlier rate
    band[2, 1:-2:2] += -(pab * d + pbb)  # later rate, earlier rate
    return band, float(np.log(determinant).sum())
