"""Phase by Fourier transform, for locked or unknown frequency."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import TWO_PI
from catseye.errors import ValidityError
from catseye.signal.cycles.whole import fraction

BLOCK_SAMPLES = 2**18  # samples processed at a time
LOWEST_BIN = 3  # a Hann window spreads the constant and the negative frequencies over the bins below
NEWTON_STEPS = 4  # from 0.01 bin at worst; each step squares the error


def bin_phasor(samples: ArrayLike, samples_per_cycle: int) -> NDArray[np.complex128]:
    """Phasor A exp(i phi) of locked samples, by Fourier transform.

    samples              (..., m n) V or codes: m cycles of n samples each
    samples_per_cycle    n, at least 3

    The conjugate of bin m, times 2/mn: the same value as synchronous detection, but all other bins are computed too.

    Raises ValidityError for buffers that are not whole cycles. Source: [PARKER04] eq. 5.1 to 5.4.

    >>> phasor = bin_phasor(3 * np.cos(2 * np.pi * np.arange(640) / 64 - 2.0), 64)
    >>> round(float(np.abs(phasor)), 9), round(float(np.angle(phasor)), 9)
    (3.0, 2.0)
    """
    array = _real(samples)
    n, length = samples_per_cycle, array.shape[-1]
    if n != int(n) or n < 3:
        raise ValidityError(f"{n} samples a cycle do not determine a phase; at least 3 do")
    if length == 0 or length % int(n):
        raise ValidityError(f"a buffer of {length} samples is not a whole number of cycles of {n} samples")
    buffers = array.reshape(-1, length)
    phasor = np.empty(len(buffers), dtype=complex)
    with np.errstate(invalid="ignore"):
        for rows in _blocks(len(buffers), length):
            phasor[rows] = np.fft.rfft(buffers[rows], axis=-1)[:, length // int(n)].conj() * (2.0 / length)
    return phasor.reshape(array.shape[:-1])


@dataclass(frozen=True, eq=False)
class Tone:
    """Strongest tone A cos(2 pi f t - phi); NaN if none.

    Time t counts from a buffer's first sample.

    frequency_hz     Hz
    amplitude        in the unit of the samples
    phase            rad in [0, 2 pi), at the first sample: phi
    phase_centre     rad in [0, 2 pi), in the middle of the buffer, t_c: phi - 2 pi f t_c; uncorrelated with
                     the estimated frequency, which adds variance to the phase at the first sample
    """

    frequency_hz: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    phase: NDArray[np.float64]
    phase_centre: NDArray[np.float64]


def strongest_tone(samples: ArrayLike, sample_rate_hz: float) -> Tone:
    """Strongest tone of unlocked samples.

    Frequency, amplitude and phase, by Hann window and interpolated peak.

    samples           (..., k) V or codes, k at least 16; at least three cycles of the tone
    sample_rate_hz    samples a second, above 0

    The largest bin and its larger neighbour give a first frequency; Newton's method then climbs to the maximum of the
    windowed transform itself, at most four steps and never beyond a bin from the peak. For one tone in white noise the
    variances are 1.5 (amplitude, phase in the middle) and 2.3 (frequency) times the Cramer-Rao bounds, the cost of the
    window; in return a harmonic or the tone's own image p bins away adds less than about 1/p^3 of itself. A spur
    stronger than the signal is returned instead. NaN where a sample is not finite, where nothing varies, or where the
    peak lies at an end.

    Raises ValidityError for buffers that are too short. Source: [RIFE74] (search, then climb; its bounds, for a complex
    tone, are half those of a real one), [HARRIS78] (the Hann window), [GRANDKE83] (first frequency from two bins).

    >>> t = np.arange(8192) / 64e3
    >>> tone = strongest_tone(0.5 * np.cos(2 * np.pi * 1003.21 * t - 2.0) + 0.1, 64e3)
    >>> [round(float(x), 6) for x in (tone.frequency_hz, tone.amplitude, tone.phase)]
    [1003.21, 0.5, 2.0]
    """
    array = _real(samples)
    length = array.shape[-1]
    if length < 16:
        raise ValidityError(f"a buffer of {length} samples shows no tone of unknown frequency; at least 16 do")
    if not 0.0 < sample_rate_hz < np.inf:
        raise ValidityError(f"sample rate {sample_rate_hz} Hz is not above 0 and finite")
    buffers = array.reshape(-1, length)
    omega, amplitude, centre = (np.full(len(buffers), np.nan) for _ in range(3))
    for rows in _blocks(len(buffers), length):
        with np.errstate(invalid="ignore", divide="ignore"):
            omega[rows], amplitude[rows], centre[rows] = _peak(buffers[rows])
    shape = array.shape[:-1]
    return Tone(
        frequency_hz=(omega * sample_rate_hz / TWO_PI).reshape(shape),
        amplitude=amplitude.reshape(shape),
        phase=fraction(centre + omega * (length - 1) / 2.0, 0.0).reshape(shape),
        phase_centre=fraction(centre, 0.0).reshape(shape),
    )


def _real(samples: ArrayLike) -> NDArray[np.generic]:
    array = np.asarray(samples)
    if array.dtype.kind not in "iuf" or array.ndim == 0:
        raise ValidityError(
            f"samples of type {array.dtype} in {array.ndim} dimensions; expected (..., samples) numbers"
        )
    return array


def _blocks(count: int, length: int) -> list[slice]:
    step = max(1, BLOCK_SAMPLES // length)
    return [slice(start, start + step) for start in range(0, count, step)]


def _peak(block: NDArray[np.generic]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Strongest tone of (buffers, k): radians a sample, amplitude, phase in the middle; NaN if none."""
    length = block.shape[-1]
    time = np.arange(length) - (length - 1) / 2.0
    window = 0.5 + 0.5 * np.cos(TWO_PI * time / length)  # Hann, symmetric about the middle
    weighted = window * (block - (block @ window / window.sum())[:, None])
    power = np.abs(np.fft.rfft(weighted, axis=-1))
    inner = power[:, LOWEST_BIN:-1]
    peak = LOWEST_BIN + np.argmax(inner, axis=-1)
    row = np.arange(len(block))
    top, lower, upper = power[row, peak], power[row, peak - 1], power[row, peak + 1]
    varies = block.min(axis=-1) < block.max(axis=-1)
    peaked = np.isfinite(power).all(axis=-1) & varies & (top > 0.0) & (top >= lower) & (top >= upper)
    ratio = np.where(peaked, np.maximum(lower, upper) / top, 0.5)  # (1 + d)/(2 - d) at d bins from the peak
    shift = (2.0 * ratio - 1.0) / (1.0 + ratio) * np.where(upper >= lower, 1.0, -1.0)
    bin_width = TWO_PI / length
    omega = (peak + shift) * bin_width

    powers = np.stack([np.ones(length), time, time**2], axis=1)
    for _ in range(NEWTON_STEPS):
        moments = (weighted * np.exp(-1j * omega[:, None] * time)) @ powers
        s, s1, s2 = moments[:, 0], -1j * moments[:, 1], -moments[:, 2]  # the windowed transform and its derivatives
        slope, curvature = (s.conj() * s1).real, np.abs(s1) ** 2 + (s.conj() * s2).real
        step = np.where(curvature < 0.0, -slope / curvature, 0.0)
        omega = np.clip(omega + step, (peak - 1.0) * bin_width, (peak + 1.0) * bin_width)
    height = np.einsum("bk,bk->b", weighted, np.exp(-1j * omega[:, None] * time))
    return (
        np.where(peaked, omega, np.nan),
        np.where(peaked, 2.0 * np.abs(height) / window.sum(), np.nan),
        np.where(peaked, -np.angle(height), np.nan),
    )
