"""Noise as a function of time: sums of seeded waves.

A process of given spectrum is cut into bands; each band is one wave, its frequency drawn inside the band, its cosine
and sine amplitudes drawn normal with the band's variance. At every instant the sum is then exactly normal over seeds,
with the variance of all bands; its structure function is the spectrum's for lags between shortest and longest period.
Nothing is stepped or stored: two processes with equal draws agree, and rates of change exist.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import TWO_PI

LONGEST = 40 * 86_400.0  # s: period of the slowest wave of a walk; its structure function holds for some days of lag
WALK_BANDS, CORRELATED_BANDS, MODE_WAVES = 36, 18, 8


@dataclass(frozen=True, eq=False)
class Waves:
    """Sum of waves in one or more channels.

    omega          (n,) rad/s
    cosine, sine   (n, channels) amplitudes
    origin         (channels,) subtracted, so that a walk begins at zero
    """

    omega: Array
    cosine: Array
    sine: Array
    origin: Array

    def __call__(self, seconds: ArrayLike) -> Array:
        """Values (k, channels) at times (k,), s."""
        angle = np.multiply.outer(np.asarray(seconds, dtype=float), self.omega)
        return np.cos(angle) @ self.cosine + np.sin(angle) @ self.sine - self.origin

    def scaled(self, factor: ArrayLike) -> "Waves":
        """Waves times a factor, of one number or (channels,)."""
        by = np.asarray(factor, dtype=float)
        return Waves(self.omega, self.cosine * by, self.sine * by, self.origin * by)

    def lagged(self, lag: float) -> "Waves":
        """Waves followed with a first-order lag, s.

        Each is multiplied by 1 / (1 + i w T).
        """
        turn = (self.omega * lag)[:, None]
        less = 1.0 + turn**2
        return Waves(
            self.omega, (self.cosine - turn * self.sine) / less, (self.sine + turn * self.cosine) / less, self.origin
        )


def joined(*parts: Waves) -> Waves:
    """Combine several with their channels side by side, for one call."""
    omega = np.concatenate([p.omega for p in parts])
    shape = (len(omega), sum(p.cosine.shape[1] for p in parts))
    cosine, sine = np.zeros(shape), np.zeros(shape)
    row = column = 0
    for p in parts:
        n, channels = p.cosine.shape
        cosine[row : row + n, column : column + channels] = p.cosine
        sine[row : row + n, column : column + channels] = p.sine
        row, column = row + n, column + channels
    return Waves(omega, cosine, sine, np.concatenate([p.origin for p in parts]))


def _drawn(edges: Array, variance: Array, channels: int, rng: np.random.Generator) -> Waves:
    """One wave a band: edges (n + 1,) Hz ascending, variance (n,)."""
    hertz = edges[:-1] * (edges[1:] / edges[:-1]) ** rng.uniform(size=len(edges) - 1)
    amplitudes = rng.normal(size=(2, len(hertz), channels)) * np.sqrt(variance)[:, None]
    return Waves(TWO_PI * hertz, amplitudes[0], amplitudes[1], np.zeros(channels))


def walk(rng: np.random.Generator, per_root_second: float, *, shortest: float, channels: int = 1) -> Waves:
    """Random walk from zero: variance per_root_second^2 tau in tau.

    shortest   s: below it the walk is smooth

    One-sided spectrum s^2 / (2 pi^2 f^2) for lags of `shortest` to some days: D = 2 int S (1 - cos 2 pi f tau) df.
    """
    edges = np.geomspace(1.0 / LONGEST, 1.0 / shortest, WALK_BANDS + 1)
    variance = per_root_second**2 / (2.0 * np.pi**2) * (1.0 / edges[:-1] - 1.0 / edges[1:])
    raw = _drawn(edges, variance, channels, rng)
    return Waves(raw.omega, raw.cosine, raw.sine, raw.cosine.sum(axis=0))


def correlated(rng: np.random.Generator, sigma: float, correlation: float, *, channels: int = 1) -> Waves:
    """Stationary noise with exponential correlation exp(-tau / correlation), s.

    Its standard deviation is sigma.

    One-sided spectrum 4 sigma^2 T / (1 + (2 pi f T)^2), cut where 0.5 % of the variance lies beyond either end.
    """
    edges = np.geomspace(1.0 / 800.0, 20.0, CORRELATED_BANDS + 1) / correlation
    below = 2.0 / np.pi * np.arctan(TWO_PI * edges * correlation)
    below[0], below[-1] = 0.0, 1.0
    return _drawn(edges, sigma**2 * np.diff(below), channels, rng)


def band(rng: np.random.Generator, sigma: float, low: float, *, high: float, channels: int = 1) -> Waves:
    """Noise of standard deviation sigma, white between two frequencies, Hz.

    Its envelope varies in 1 / (high - low).
    """
    edges = np.linspace(low, high, MODE_WAVES + 1)
    return _drawn(edges, np.full(MODE_WAVES, sigma**2 / MODE_WAVES), channels, rng)
