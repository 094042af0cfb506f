"""Synchronous detection: amplitude and phase of locked samples.

One method serves a buffer, a batch, a file larger than memory and a stream of channels (`channels`): the cycles are
folded with integer sums, and trigonometry is done once a buffer. `phasors` does only that; `detect` also gives the
scatter of the samples. Large arrays of 16-bit samples go to the compiled form in `phase_kernel`.

A disturbance at the fundamental cannot be separated from the signal. Harmonic k is rejected exactly unless n divides k
- 1 or k + 1: with n samples a cycle harmonic n - 1 is the fundamental's mirror image, so that B cos((n-1) x - psi) adds
B exp(-i psi) to the phasor. Clipping makes a sine smaller but leaves it even about its crest, on one side or on both:
its phase moves only by the harmonics n - 1, n + 1, 2 n - 1, ... that fold back: up to 1.5/n^2 rad clipped on one side
at half the amplitude or above, 4/n^2 rad on both; towards a square wave it is pi/n.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.signal.cycles.whole import fraction
from catseye.signal.detection.cycle_scatter import CycleScatter, dropped_cycles, moments, weighed
from catseye.signal.detection.folding import exponentials, fold, layout

BLOCK_SAMPLES = 2**18  # samples processed at a time: 2 MB of float64, which fits the cache
COMPILED_FROM = 2**25  # samples: loading numba takes about as long as the plain form for these
HARMONICS = (2, 3)


@dataclass(frozen=True, eq=False)
class Detection:
    """Detected values of buffers of samples, one element a buffer.

    phasor       V, complex: (2/mn)(a + i b), the fundamental A exp(i phi) of s_j = A cos(2 pi j/n - phi)
    u_phasor     V, standard uncertainty of each quadrature component of the phasor, both taken as equal and the
                 noise as white between cycles; NaN without scatter. See u_amplitude and u_phase.
    offset       V, the mean
    overtones    V, complex (..., h), phasors B exp(i psi) of the chosen harmonics, B cos(2 pi k j/n - psi); NaN where n
                 samples a cycle cannot resolve them; at k = n/2 only the cosine
    noise        V, rms of the samples about the folded waveform, n (m - 1) degrees of freedom
    largest      V, largest magnitude of a sample
    clipped      number of samples at the converter's ends
    scatter      of the cycles' phasors
    """

    phasor: NDArray[np.complex128]
    u_phasor: NDArray[np.float64]
    offset: NDArray[np.float64]
    overtones: NDArray[np.complex128]
    noise: NDArray[np.float64]
    largest: NDArray[np.float64]
    clipped: NDArray[np.int64]
    scatter: CycleScatter

    @property
    def amplitude(self) -> NDArray[np.float64]:
        """Amplitude of the fundamental, V.

        A weak one reads u^2/2A too large. Source: [PARKER04] eq. 5.3.
        """
        return np.abs(self.phasor)

    @property
    def phase(self) -> NDArray[np.float64]:
        """Phase of the fundamental, rad in [0, 2 pi).

        Source: [PARKER04] eq. 5.4, with the quadrant it omits.
        """
        return fraction(np.angle(self.phasor), 0.0)

    @property
    def harmonics(self) -> NDArray[np.float64]:
        """Amplitudes of the chosen harmonics, V, (..., h)."""
        return np.abs(self.overtones)

    @property
    def distortion(self) -> NDArray[np.float64]:
        """Total harmonic distortion: rms of chosen harmonics over fundamental.

        Infinite without a fundamental. Harmonics that n samples cannot resolve count as zero. Noise alone makes it
        about u_phase sqrt(2 h).
        """
        power = np.nansum(self.harmonics**2, axis=-1)
        return _over(np.where(np.isnan(self.phasor), np.nan, np.sqrt(power)), self.amplitude)

    @property
    def u_amplitude(self) -> NDArray[np.float64]:
        """Standard uncertainty of the amplitude, V, with coloured noise.

        Scatter along the phasor.
        """
        return np.sqrt(self._variance()[0][..., 0])

    @property
    def u_phase(self) -> NDArray[np.float64]:
        """Standard uncertainty of the phase, rad; infinite without amplitude.

        Scatter across the phasor over the amplitude. Coloured noise is allowed for, see `cycle_scatter`. To first
        order: from about 0.3 rad on the phase is not normal any more, and beyond 1 rad unknown.
        """
        return _over(np.sqrt(self._variance()[0][..., 1]), self.amplitude)

    @property
    def degrees(self) -> NDArray[np.float64]:
        """Degrees of freedom (..., 2) of u_amplitude and u_phase.

        NaN for a single cycle.
        """
        return self._variance()[1]

    def _variance(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        variance, degrees = self.scatter.variance(self.phasor)
        single = (self.scatter.cycles == 1)[..., None]
        return np.where(single, self.u_phasor[..., None] ** 2, variance), degrees


def detect(
    samples: ArrayLike,
    samples_per_cycle: int,
    volts_per_code: float = 1.0,
    *,
    converter_ends: tuple[float, float] | None = None,
    harmonics: Sequence[int] = HARMONICS,
    compiled: bool | None = None,
) -> Detection:
    """Phasor, noise and health of buffers of whole cycles.

    samples              (..., m n), codes or volts: m cycles of n samples each; a memory map is read block by block
    samples_per_cycle    n, at least 3
    volts_per_code       V, above 0
    converter_ends       lowest and highest code; by default those of the samples' integer type, none for floats
    harmonics            orders, each at least 2
    compiled             True for the compiled form, for int16 of two cycles and more (None: from 2^25 samples
                         on); sums and counts are the same, noise and uncertainty to 1e-5

    Integer samples of up to 32 bits are summed over the cycles in 64 bits, as the notes do, and cannot overflow: that
    would take 2^32 cycles. Wider ones are taken as floats. The uncertainty is that of the mean of m cycles from their
    own scatter, so it covers noise between cycles, not a disturbance locked to them (leakage, stray light). One cycle
    alone has no such scatter: then noise and uncertainty come from its residuals about mean and three harmonics.
    Raises ValidityError for buffers that are not whole cycles; `buffers` gives such a status instead.

    Source: [PARKER04] eq. 5.5 and 5.6, the same as 5.1 and 5.2; uncertainty as the standard deviation of a mean. Exact
    but for rounding, 1e-15 of the amplitude.

    >>> j = np.arange(128)
    >>> shot = detect(np.round(1000 * np.cos(2 * np.pi * j / 64 - 2.0)).astype(np.int16), 64, 0.001)
    >>> round(float(shot.amplitude), 3), round(float(shot.phase), 3)
    (1.0, 2.0)
    """
    array = np.asarray(samples)
    n, m = _checked(array, samples_per_cycle, volts_per_code)
    orders = tuple(harmonics)
    if any(not np.isfinite(k) or k != int(k) or k < 2 for k in orders):
        raise ValidityError(f"harmonics {list(orders)} are not whole numbers of at least 2")
    if converter_ends is None and array.dtype.kind in "iu":
        limits = np.iinfo(array.dtype)
        converter_ends = (limits.min, limits.max)
    fast = _compiled(array, m, compiled)
    buffers = array.reshape(-1, m * n)
    codes = _Codes.of(len(buffers), len(orders))
    step = max(1, (16 if fast else 1) * BLOCK_SAMPLES // (m * n))
    with np.errstate(invalid="ignore", over="ignore"):  # NaN, infinity and 1e300 V give NaN or infinity
        for start in range(0, len(buffers), step):
            block = buffers[start : start + step].reshape(-1, m, n)
            part = codes.rows(start, len(block))
            (_fast_block if fast else _plain_block)(block, orders, part)
            part.count_clipped(block, converter_ends)
    return codes.in_volts(volts_per_code, array.shape[:-1], m, n)


def phasors(
    samples: ArrayLike, samples_per_cycle: int, volts_per_code: float = 1.0, *, compiled: bool | None = None
) -> NDArray[np.complex128]:
    """Phasors (...) of buffers, V; limited by memory speed.

    Arguments as for `detect`.

    Source: [PARKER04] eq. 5.5 and 5.6.

    >>> seen = phasors(np.cos(2 * np.pi * np.arange(32) / 16 - 0.25), 16)
    >>> round(float(np.abs(seen)), 12), round(float(np.angle(seen)), 12)
    (1.0, 0.25)
    """
    array = np.asarray(samples)
    n, m = _checked(array, samples_per_cycle, volts_per_code)
    buffers = array.reshape(-1, m * n)
    out = np.empty(len(buffers), dtype=complex)
    wave = exponentials(n, (1,))[:, 0]
    fast = _compiled(array, m, compiled)
    if fast:
        from catseye.signal.detection import phase_kernel

        cosine, sine = np.ascontiguousarray(wave.real), np.ascontiguousarray(wave.imag)
    step = max(1, (128 if fast else 1) * BLOCK_SAMPLES // (m * n))
    for start in range(0, len(buffers), step):
        block, rows = buffers[start : start + step], slice(start, start + step)
        if fast:
            phase_kernel.phasors(np.ascontiguousarray(block), n, cosine, sine, out[rows])
        else:
            out[rows] = fold(block.reshape(-1, m, n)) @ wave
    out *= 2.0 * volts_per_code / (m * n)
    return out.reshape(array.shape[:-1])


@dataclass(frozen=True, eq=False)
class _Codes:
    """Detections of some buffers, in codes; see Detection."""

    phasor: NDArray[np.complex128]
    offset: NDArray[np.float64]
    overtones: NDArray[np.complex128]
    squares: NDArray[np.float64]  # about the mean cycle; for a single cycle the square of its noise
    ends: NDArray[np.float64]  # (b, 2)
    clipped: NDArray[np.int64]
    total: NDArray[np.float64]
    between: NDArray[np.float64]
    dropped: NDArray[np.int64]

    @classmethod
    def of(cls, count: int, harmonics: int) -> "_Codes":
        return cls(
            phasor=np.empty(count, dtype=complex),
            offset=np.empty(count),
            overtones=np.empty((count, harmonics), dtype=complex),
            squares=np.empty(count),
            ends=np.empty((count, 2)),
            clipped=np.zeros(count, dtype=np.int64),
            total=np.empty((count, 3)),
            between=np.empty((count, 3)),
            dropped=np.zeros(count, dtype=np.int64),
        )

    def rows(self, start: int, count: int) -> "_Codes":
        """Detections of some rows, as views."""
        return _Codes(**{f.name: getattr(self, f.name)[start : start + count] for f in fields(self)})

    def count_clipped(self, block: NDArray[np.generic], ends: tuple[float, float] | None) -> None:
        if ends is None:
            return
        for suspect in np.flatnonzero((self.ends[:, 0] <= ends[0]) | (self.ends[:, 1] >= ends[1])):
            buffer = block[suspect]
            self.clipped[suspect] = np.count_nonzero((buffer <= ends[0]) | (buffer >= ends[1]))

    def spectrum(self, means: NDArray[np.complex128], n: int, harmonics: tuple[int, ...]) -> None:
        """Store offset, phasor and overtones from the means of s exp(2 pi i k j/n), k = 0, 1 and harmonics."""
        self.offset[:] = means[:, 0].real
        self.phasor[:] = 2.0 * means[:, 1]
        for i, k in enumerate(harmonics):
            factor = 2.0 if 2 * k < n else 1.0 if 2 * k == n else np.nan  # at and beyond half the sampling frequency
            self.overtones[:, i] = factor * means[:, 2 + i]

    def in_volts(self, volts: float, shape: tuple[int, ...], m: int, n: int) -> Detection:
        if m > 1:
            noise = np.sqrt(self.squares / (n * (m - 1)))
            u = np.sqrt((self.total[:, 0] + self.total[:, 1]) / (2.0 * (m - 1) * m))
        else:
            noise = np.sqrt(self.squares)
            u = noise * np.sqrt(2.0 / n)
        return Detection(
            phasor=(self.phasor * volts).reshape(shape),
            u_phasor=(u * volts).reshape(shape),
            offset=(self.offset * volts).reshape(shape),
            overtones=(self.overtones * volts).reshape((*shape, self.overtones.shape[-1])),
            noise=(noise * volts).reshape(shape),
            largest=(np.maximum(-self.ends[:, 0], self.ends[:, 1]) * volts).reshape(shape),
            clipped=self.clipped.reshape(shape),
            scatter=CycleScatter(
                cycles=np.full(shape, m, dtype=np.int64),
                total=(self.total * volts**2).reshape((*shape, 3)),
                between=(self.between * volts**2).reshape((*shape, 3)),
                dropped=self.dropped.reshape(shape),
            ),
        )


def _checked(array: NDArray[np.generic], samples_per_cycle: int, volts_per_code: float) -> tuple[int, int]:
    n, m = layout(array, samples_per_cycle)
    if not 0.0 < volts_per_code < np.inf:
        raise ValidityError(f"volts per code {volts_per_code} V is not above 0 and finite")
    return n, m


def _compiled(array: NDArray[np.generic], m: int, requested: bool | None) -> bool:
    serves = array.dtype == np.int16 and array.dtype.isnative and m > 1
    if requested and not serves:
        raise ValidityError(
            f"the compiled form serves native int16 buffers of two cycles and more, not {array.dtype} of {m}; "
            "leave `compiled` out"
        )
    return serves and (array.size >= COMPILED_FROM if requested is None else requested)


def _fast_block(block: NDArray[np.generic], harmonics: tuple[int, ...], into: _Codes) -> None:
    """Fill `into` from a block (b, m, n) of int16, compiled."""
    from catseye.signal.detection import phase_kernel

    b, m, n = block.shape
    waves = exponentials(n, (0, 1, *harmonics)).T
    means, ends = np.empty((b, len(waves)), dtype=complex), np.empty((b, 2), dtype=np.int16)
    sums = np.empty((b, 7))
    phase_kernel.statistics(
        np.ascontiguousarray(block).reshape(b, m * n),
        np.ascontiguousarray(np.stack([waves.real, waves.imag], axis=1)),
        means,
        ends,
        sums,
        into.dropped,
    )
    into.spectrum(means, n, harmonics)
    into.ends[:] = ends
    into.squares[:], into.total[:], into.between[:] = sums[:, 0], sums[:, 1:4], sums[:, 4:]


def _plain_block(block: NDArray[np.generic], harmonics: tuple[int, ...], into: _Codes) -> None:
    """Fill `into` from a block (b, m, n)."""
    _, m, n = block.shape
    into.ends[:, 0], into.ends[:, 1] = block.min(axis=(1, 2)), block.max(axis=(1, 2))
    mean = fold(block) / m
    into.spectrum(mean @ exponentials(n, (0, 1, *harmonics)) / n, n, harmonics)
    if m == 1:
        into.squares[:], into.total[:], into.between[:] = _square_of_one_cycle(mean), np.nan, np.nan
        return
    residual = block - mean[:, None, :]
    into.squares[:] = np.einsum("bmn,bmn->b", residual, residual)
    departures = weighed(residual)
    into.total[:], into.between[:] = moments(departures)
    into.dropped[:] = dropped_cycles(departures, into.phasor, into.total)


def _square_of_one_cycle(cycle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean square of single cycles (b, n) about mean and three harmonics; NaN without redundancy."""
    n = cycle.shape[-1]
    fitted = 1 + 2 * 3
    if n <= fitted:
        return np.full(len(cycle), np.nan)
    spectrum = np.fft.rfft(cycle, axis=-1)
    spectrum[:, :4] = 0.0
    return np.sum(np.fft.irfft(spectrum, n, axis=-1) ** 2, axis=-1) / (n - fitted)


def _over(numerator: NDArray[np.float64], amplitude: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.divide(numerator, amplitude, out=np.full_like(numerator, np.inf), where=amplitude != 0.0)
