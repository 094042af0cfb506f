"""Cascade from the longest beat of several modulations to the carrier."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.signal.cycles.sets import SURE, checked_frequencies, checked_u_phase
from catseye.signal.cycles.whole import whole_cycles


@dataclass(frozen=True, eq=False)
class CascadeLength:
    """Lengths from the cascade, with the margin of each step.

    length   m, in air, after the last step: least squares of all phases with the cycles found
    cycles   (..., k) N of each frequency
    margin   (..., k - 1) m of length in air, by step after the longest beat: how much further it may have been off
    u        (..., k - 1) m, standard uncertainty of each step's misfit
    thin     (...) True where a step's misfit plus SURE times u exceeds its margin, where the longest beat's length is
             so near one limit that noise may have moved it to the other, or where an input is not finite (N is then 0)
    """

    length: NDArray[np.float64]
    cycles: NDArray[np.int64]
    margin: NDArray[np.float64]
    u: NDArray[np.float64]
    thin: NDArray[np.bool_]


def cascade_length(
    phase_fractions: ArrayLike,
    frequencies_hz: ArrayLike,
    *,
    u_phase: float,
    low: float,
    group_index: ArrayLike = 1.0,
) -> CascadeLength:
    """Length by steps from the longest beat to the lowest frequency.

    phase_fractions   (..., k) rad, from `fraction`
    frequencies_hz    (k,) two or more different, above 0
    u_phase           rad, above 0, of each phase fraction
    low               m, the smallest possible length; the largest is one longest beat's half wavelength beyond
    group_index       (...) mean along each path, at the carrier

    Slips where a step's misfit passes its quarter wavelength; `joint_length` is better. Raises ValidityError for values
    outside those limits.

    Source: [PARKER04] eq. 5.18 for each frequency and for the differences of two.

    >>> f = np.array([1500e6, 1500.5e6, 1510e6])
    >>> phases = np.mod(-4 * np.pi * f * 123.456789 / 299792458.0, 2 * np.pi)
    >>> round(float(cascade_length(phases, f, u_phase=1e-3, low=5.0).length), 9)
    123.456789
    """
    f = np.asarray(frequencies_hz, dtype=float)
    order = np.argsort(checked_frequencies(f))
    f = f[order]
    phase = np.asarray(phase_fractions, dtype=float)[..., order]
    n = np.asarray(group_index, dtype=float)
    u = float(checked_u_phase(u_phase, f)[0])
    k = len(f)
    lift = np.eye(k)[1:] - np.eye(k)[0]  # phases of the beats with the lowest frequency, then of that frequency itself
    steps = np.concatenate([lift, np.eye(k)[:1]])
    half = SPEED_OF_LIGHT / (2.0 * np.append(f[1:] - f[0], f[0]))
    turned = np.mod(phase @ steps.T, TWO_PI)
    by_phase = -steps * (half / TWO_PI)[:, None]  # derivative of each step's length by the phases
    first = -turned[..., 0] / TWO_PI * half[0]
    optical_low = low * n
    length = first + np.ceil((optical_low - first) / half[0]) * half[0]
    u_first = u * float(np.linalg.norm(by_phase[0]))
    edge = np.minimum(length - optical_low, optical_low + half[0] - length)
    margins, us, thin = [], [], np.asarray(~(edge > SURE * u_first))  # NaN is thin too
    for previous, current in pairwise(range(k)):
        cycles, margin = whole_cycles(length, turned[..., current], half[current])
        u_step = u * float(np.linalg.norm(by_phase[previous] - by_phase[current]))
        thin = thin | ~(margin > SURE * u_step)
        margins.append(margin / n)
        us.append(np.full(length.shape, u_step) / n)
        length = (cycles - turned[..., current] / TWO_PI) * half[current]
    half_waves = SPEED_OF_LIGHT / (2.0 * f)
    numbers = np.rint(length[..., None] / half_waves + phase / TWO_PI)
    lengths = (numbers - phase / TWO_PI) * half_waves
    cycles = np.where(np.isfinite(numbers), numbers, 0.0).astype(np.int64)
    weight = half_waves**-2.0 / np.sum(half_waves**-2.0)  # one u_phase: u of a length goes as half wavelength
    back = np.argsort(order)
    return CascadeLength(
        lengths @ weight / n, cycles[..., back], np.stack(margins, axis=-1), np.stack(us, axis=-1), np.asarray(thin)
    )
