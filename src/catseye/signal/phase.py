"""Synchronous detection: amplitude and phase of the fundamental in samples locked to the modulation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.signal.cycles import fraction

BLOCK_SAMPLES = 2**18  # samples in work at a time: 2 MB of float64, which stays in cache
HARMONICS = (2, 3)


@dataclass(frozen=True, eq=False)
class Detection:
    """What a buffer of samples says, one element a buffer.

    phasor       V, complex: (2/mn)(a + i b), the fundamental A exp(i phi) of s_j = A cos(2 pi j/n - phi)
    u_phasor     V, standard uncertainty of each quadrature component of the phasor; NaN where no scatter shows
    offset       V, the mean
    harmonics    V, (..., 2), amplitudes of harmonics 2 and 3; NaN where n samples a cycle cannot tell them
    noise        V, rms of the samples about the folded waveform, n (m - 1) degrees of freedom
    largest      V, largest magnitude of a sample
    clipped      number of samples at the converter's ends
    """

    phasor: NDArray[np.complex128]
    u_phasor: NDArray[np.float64]
    offset: NDArray[np.float64]
    harmonics: NDArray[np.float64]
    noise: NDArray[np.float64]
    largest: NDArray[np.float64]
    clipped: NDArray[np.int64]

    @property
    def amplitude(self) -> NDArray[np.float64]:
        """Amplitude of the fundamental, V. Source: [PARKER04] eq. 5.3."""
        return np.abs(self.phasor)

    @property
    def phase(self) -> NDArray[np.float64]:
        """Phase of the fundamental, rad in [0, 2 pi). Source: [PARKER04] eq. 5.4, with the quadrant it omits."""
        return fraction(np.angle(self.phasor), 0.0)


def detect(
    samples: ArrayLike,
    samples_per_cycle: int,
    volts_per_code: float = 1.0,
    *,
    converter_ends: tuple[float, float] | None = None,
) -> Detection:
    """Phasor, noise and health of buffers of samples that span whole cycles of the modulation.

    samples              (..., m n), codes or volts: m cycles of n samples each
    samples_per_cycle    n, at least 3
    volts_per_code       V, above 0
    converter_ends       lowest and highest code; by default those of the samples' integer type, none for floats

    Integer samples of up to 32 bits are summed over the cycles in 64 bits, as the notes do, and cannot overflow: that
    would take 2^32 cycles. Wider ones are taken as floats. The uncertainty is that of the mean of m cycles from their
    own scatter, so it sees noise between cycles, not a disturbance locked to them (leakage, stray light). One cycle
    alone has no such scatter: then noise and uncertainty come from its residuals about mean and three harmonics.
    Harmonic k is rejected unless n divides k - 1 or k + 1.

    Source: [PARKER04] eq. 5.5 and 5.6, the same as 5.1 and 5.2; uncertainty as the standard deviation of a mean. Exact
    but for rounding, 1e-15 of the amplitude.

    >>> j = np.arange(128)
    >>> shot = detect(np.round(1000 * np.cos(2 * np.pi * j / 64 - 2.0)).astype(np.int16), 64, 0.001)
    >>> round(float(shot.amplitude), 3), round(float(shot.phase), 3)
    (1.0, 2.0)
    """
    array = np.asarray(samples)
    n, m = _shape(array, samples_per_cycle)
    if not 0.0 < volts_per_code < np.inf:
        raise ValidityError(f"volts per code {volts_per_code} V is not above 0 and finite")
    if converter_ends is None and array.dtype.kind in "iu":
        limits = np.iinfo(array.dtype)
        converter_ends = (limits.min, limits.max)
    buffers = array.reshape(-1, m * n)
    count = len(buffers)
    parts = Detection(
        phasor=np.empty(count, dtype=complex),
        u_phasor=np.empty(count),
        offset=np.empty(count),
        harmonics=np.empty((count, len(HARMONICS))),
        noise=np.empty(count),
        largest=np.empty(count),
        clipped=np.zeros(count, dtype=np.int64),
    )
    step = max(1, BLOCK_SAMPLES // (m * n))
    with np.errstate(invalid="ignore"):  # a buffer that holds NaN or infinity answers NaN
        for start in range(0, count, step):
            _detect_block(buffers[start : start + step].reshape(-1, m, n), converter_ends, parts, start)
    shape = array.shape[:-1]
    return Detection(
        phasor=(parts.phasor * volts_per_code).reshape(shape),
        u_phasor=(parts.u_phasor * volts_per_code).reshape(shape),
        offset=(parts.offset * volts_per_code).reshape(shape),
        harmonics=(parts.harmonics * volts_per_code).reshape((*shape, len(HARMONICS))),
        noise=(parts.noise * volts_per_code).reshape(shape),
        largest=(parts.largest * volts_per_code).reshape(shape),
        clipped=parts.clipped.reshape(shape),
    )


def _shape(array: NDArray[np.generic], samples_per_cycle: int) -> tuple[int, int]:
    """Samples a cycle and cycles, refused where they do not fit the buffers."""
    if array.dtype.kind not in "iuf":
        raise ValidityError(f"samples are of type {array.dtype}, expected integers or floats")
    if samples_per_cycle != int(samples_per_cycle) or samples_per_cycle < 3:
        raise ValidityError(f"{samples_per_cycle} samples a cycle do not show a phase; at least 3 do")
    n = int(samples_per_cycle)
    length = array.shape[-1] if array.ndim else 0
    if length == 0 or length % n:
        raise ValidityError(f"a buffer of {length} samples is not a whole number of cycles of {n} samples")
    return n, length // n


def _detect_block(block: NDArray[np.generic], ends: tuple[float, float] | None, parts: Detection, start: int) -> None:
    """Write the answers of one block (buffers, m, n), in codes, into rows `start` and on."""
    rows = slice(start, start + len(block))
    _, m, n = block.shape
    lowest, highest = block.min(axis=(1, 2)), block.max(axis=(1, 2))
    parts.largest[rows] = np.maximum(-lowest.astype(float), highest.astype(float))
    if ends is not None:
        for suspect in np.flatnonzero((lowest <= ends[0]) | (highest >= ends[1])):
            buffer = block[suspect]
            parts.clipped[start + suspect] = np.count_nonzero((buffer <= ends[0]) | (buffer >= ends[1]))

    exact = block.dtype.kind in "iu" and block.dtype.itemsize <= 4
    folded = block.sum(axis=1, dtype=np.int64 if exact else np.float64) / m  # the inner sums of eq. 5.5 and 5.6
    spectrum = folded @ _exponentials(n, (0, 1, *HARMONICS)) / n
    parts.offset[rows] = spectrum[:, 0].real
    parts.phasor[rows] = 2.0 * spectrum[:, 1]
    for i, k in enumerate(HARMONICS):
        factor = 2.0 if 2 * k < n else 1.0 if 2 * k == n else np.nan  # at and beyond half the sampling frequency
        parts.harmonics[rows, i] = factor * np.abs(spectrum[:, 1 + i + 1])

    if m > 1:
        residual = block - folded[:, None, :]
        parts.noise[rows] = np.sqrt(np.einsum("bmn,bmn->b", residual, residual) / (n * (m - 1)))
        waves = _exponentials(n, (1,))[:, 0]
        quadratures = residual.reshape(-1, n) @ np.stack([waves.real, waves.imag], axis=1) * (2.0 / n)
        squares = np.einsum("bq,bq->b", *[quadratures.reshape(len(block), -1)] * 2)
        parts.u_phasor[rows] = np.sqrt(squares / (2.0 * (m - 1) * m))
    else:
        noise = _noise_of_one_cycle(folded)
        parts.noise[rows] = noise
        parts.u_phasor[rows] = noise * np.sqrt(2.0 / n)


def _noise_of_one_cycle(cycle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rms of single cycles (buffers, n) about their mean and first three harmonics; NaN when nothing is left over."""
    n = cycle.shape[-1]
    known = 1 + 2 * (1 + len(HARMONICS))
    if n <= known:
        return np.full(len(cycle), np.nan)
    spectrum = np.fft.rfft(cycle, axis=-1)
    spectrum[:, : 2 + len(HARMONICS)] = 0.0
    return np.sqrt(np.sum(np.fft.irfft(spectrum, n, axis=-1) ** 2, axis=-1) / (n - known))


def _exponentials(n: int, orders: tuple[int, ...]) -> NDArray[np.complex128]:
    """exp(2 pi i k l / n), (n, orders): cosine as real part, sine as imaginary part."""
    turns = np.outer(np.arange(n), orders) % n  # reduced first, so that large k l lose nothing
    return np.exp(2j * np.pi * turns / n)
