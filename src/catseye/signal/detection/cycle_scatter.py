"""Scatter of a buffer's cycles: their phasors, covariance and dropouts.

The standard uncertainty of a buffer's phasor comes from here. Along the phasor its scatter is that of the amplitude,
across it that of the phase. The two are separate because they can differ: the receiver's noise is the same in
both, but the oscillators' is only across, and the laser's intensity only along.

White noise of standard deviation sigma gives each cycle's phasor the variance 2 sigma^2/n in either component, so the
mean of m cycles has u^2 = 2 sigma^2/(m n) and the phase u = sqrt(2/(m n)) sigma/A. That is the Cramer-Rao bound: with
s_j = A cos(2 pi j/n - phi) the Fisher information is sum (ds_j/dphi)^2/sigma^2 = A^2 m n/(2 sigma^2), and over whole
cycles phi is uncorrelated with A, with the mean, or with other harmonics.

Noise correlated between neighbouring cycles does not average as m^(-1/2). So the cycles are also divided into eight
consecutive batches: white noise makes the variance between batches, m-fold that of their mean, equal to that within
them, and their ratio, the *colour*, has Fisher's distribution. Where it exceeds the 1 % point
of white noise, the scatter of the batches is used instead. That is correct for noise whose correlation ends within a
batch. For slower noise it is a lower limit: a factor of 2 to 3 may be missing, mostly without the threshold (2.8 at 128
cycles) being passed, and below it noise of short correlation can hide a factor of 1.5 too. Noise slower than a buffer
shows between buffers: see `signal.drift.walk` and the calibration "oscillator". Noise with a colour below 1 (a line
that averages out) keeps the larger uncertainty.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.signal.detection.folding import exponentials, layout

BATCHES = 8
FEWEST_FOR_BATCHES = 2 * BATCHES  # cycles
ALARM = 0.01  # probability that white noise is classed as coloured
FEWEST_FOR_DROPOUT = 8  # cycles
COLLAPSE = 6.0  # standard deviations of a cycle, across, that half the amplitude must exceed to detect a dropout


@dataclass(frozen=True, eq=False)
class CycleScatter:
    """Scatter of cycle phasors about their mean, one element a buffer.

    cycles    m
    total     V^2, (..., 3): sums over the cycles of re re, im im, re im of the departures
    between   V^2, (..., 3): the same of the batches' means, each times its cycles; NaN below 16 cycles
    dropped   cycles that collapse, see `dropped_cycles`
    """

    cycles: NDArray[np.int64]
    total: NDArray[np.float64]
    between: NDArray[np.float64]
    dropped: NDArray[np.int64]

    def colour(self, phasor: ArrayLike) -> NDArray[np.float64]:
        """Noise colour (..., 2): variance between batches over that within, along and across the phasor.

        NaN where undefined.

        1 for white noise, with Fisher's distribution of 7 and m - 8 degrees of freedom.
        """
        m = np.asarray(self.cycles)[..., None]
        between = _turned(self.between, phasor)
        within = _turned(self.total, phasor) - between
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = between / (BATCHES - 1) / (within / (m - BATCHES))
        return np.where(m >= FEWEST_FOR_BATCHES, ratio, np.nan)

    def variance(self, phasor: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Variance (..., 2) of the mean along and across the phasor, V^2, and its degrees of freedom (..., 2).

        NaN for m = 1.
        """
        m = np.asarray(self.cycles)[..., None]
        limit = np.vectorize(colour_limit, otypes=[float])(m)
        coloured = self.colour(phasor) > limit
        with np.errstate(invalid="ignore", divide="ignore"):
            white = _turned(self.total, phasor) / ((m - 1.0) * m)
            slow = _turned(self.between, phasor) / ((BATCHES - 1.0) * m)
        degrees = np.where(coloured, BATCHES - 1.0, np.where(m > 1, m - 1.0, np.nan))
        return np.where(coloured, slow, white), degrees


@cache
def colour_limit(cycles: int) -> float:
    """Noise colour limit for white noise; infinite without batches."""
    from scipy.special import fdtri

    return float(fdtri(BATCHES - 1, cycles - BATCHES, 1.0 - ALARM)) if cycles >= FEWEST_FOR_BATCHES else math.inf


def variance_across(total: Sequence[float], between: Sequence[float], cycles: int, *, phasor: complex) -> float:
    """Variance of one buffer's mean across its phasor, V^2.

    The same as `CycleScatter.variance`, without arrays.

    total, between   (3) V^2, as there
    cycles           m, at least 2
    """
    size = abs(phasor)
    c, s = (phasor.real / size, phasor.imag / size) if size > 0.0 else (1.0, 0.0)
    within = max(s * s * total[0] + c * c * total[1] - 2.0 * s * c * total[2], 0.0)
    white = within / ((cycles - 1.0) * cycles)
    if cycles < FEWEST_FOR_BATCHES:
        return white
    batches = max(s * s * between[0] + c * c * between[1] - 2.0 * s * c * between[2], 0.0)
    remainder = (within - batches) / (cycles - BATCHES)
    coloured = batches / (BATCHES - 1) > colour_limit(cycles) * remainder
    return batches / ((BATCHES - 1.0) * cycles) if coloured else white


def cycle_phasors(samples: ArrayLike, samples_per_cycle: int, volts_per_code: float = 1.0) -> NDArray[np.complex128]:
    """Phasor of each cycle, (..., m) V, as in the ranger's SEQ.

    samples              (..., m n), codes or volts
    samples_per_cycle    n, at least 3
    volts_per_code       V, above 0

    Their mean is the buffer's phasor. Raises ValidityError for buffers that are not whole cycles.

    Source: [PARKER04] eq. 5.1 and 5.2 with m = 1. Exact but for rounding.

    >>> seen = cycle_phasors(np.cos(2 * np.pi * np.arange(16) / 8 - 0.5), 8)
    >>> np.round(np.abs(seen), 12).tolist(), np.round(np.angle(seen), 12).tolist()
    ([1.0, 1.0], [0.5, 0.5])
    """
    array = np.asarray(samples)
    n, m = layout(array, samples_per_cycle)
    if not 0.0 < volts_per_code < np.inf:
        raise ValidityError(f"volts per code {volts_per_code} V is not above 0 and finite")
    return weighed(array.reshape(*array.shape[:-1], m, n)) * volts_per_code


def weighed(cycles: NDArray[Any]) -> NDArray[np.complex128]:
    """Phasors of folded cycles (..., n)."""
    wave = exponentials(cycles.shape[-1], (1,))[:, 0]
    parts = cycles @ np.stack([wave.real, wave.imag], axis=1) * (2.0 / len(wave))
    return parts[..., 0] + 1j * parts[..., 1]


def moments(departures: NDArray[np.complex128]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sums of squares and products (b, 3) of zero-mean departures (b, m), in total and between batches."""
    m = departures.shape[-1]
    total = _products(departures)
    if m < FEWEST_FOR_BATCHES:
        return total, np.full_like(total, np.nan)
    edges = np.arange(BATCHES + 1) * m // BATCHES
    sums = np.add.reduceat(departures, edges[:-1], axis=-1)
    return total, _products(sums / np.sqrt(np.diff(edges)))


def dropped_cycles(
    departures: NDArray[np.complex128], phasor: NDArray[np.complex128], total: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Count cycles (b,) of less than half amplitude, not caused by noise.

    departures   (b, m) of the cycles' phasors from their mean
    phasor       (b,) the mean
    total        (b, 3) from `moments`

    Noise is taken across the phasor, where an interrupted beam adds nothing: half the amplitude must exceed six of
    its standard deviations a cycle, which excludes weak beams. Fewer than 8 cycles do not determine the noise.
    """
    m = departures.shape[-1]
    if m < FEWEST_FOR_DROPOUT:
        return np.zeros(len(departures), dtype=np.int64)
    square = phasor.real**2 + phasor.imag**2
    across = _turned(total, phasor)[..., 1] / (m - 1)
    clear = square > 4.0 * COLLAPSE**2 * across
    along = (departures * phasor.conj()[:, None]).real
    return np.count_nonzero((along < -0.5 * square[:, None]) & clear[:, None], axis=-1)


def _products(z: NDArray[np.complex128]) -> NDArray[np.float64]:
    re, im = np.ascontiguousarray(z.real), np.ascontiguousarray(z.imag)
    return np.stack([np.einsum("bm,bm->b", p, q) for p, q in ((re, re), (im, im), (re, im))], axis=-1)


def _turned(products: NDArray[np.float64], phasor: ArrayLike) -> NDArray[np.float64]:
    """Sums of squares (..., 2) along and across the phasor; along the real axis if it is zero."""
    z = np.asarray(phasor, dtype=complex)
    size = np.abs(z)
    lit = size > 0.0
    c = np.divide(z.real, size, out=np.ones_like(size), where=lit)
    s = np.divide(z.imag, size, out=np.zeros_like(size), where=lit)
    xx, yy, xy = products[..., 0], products[..., 1], products[..., 2]
    along = c * c * xx + s * s * yy + 2.0 * s * c * xy
    across = s * s * xx + c * c * yy - 2.0 * s * c * xy
    return np.maximum(np.stack([along, across], axis=-1), 0.0)  # rounding may leave a zero just below it
