"""Power and cross spectra of displacements, with alias tests.

Sampling may be uneven. One-sided densities: the integral of S(f) over f > 0 is the variance. Each channel has its own
times (each ranger its own rate); a segment is tapered and transformed at its true times, and segments that overlap by
half are averaged. Evenly sampled channels give Welch's estimate to the last digit.

A ranger that measures 7.8 times a second shows all waves below 3.9 Hz: a wave of 5 Hz appears at 2.8 Hz, and its own
data cannot show that. Rangers that measure at other instants can: at the true frequency their amplitudes have
one phase (or its opposite), at an alias they do not.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import ValidityError

LEAST = 8  # samples of a channel in a segment
LEAST_GAIN = 0.2  # of a buffer's mean: below it a wave is not corrected for averaging
EVEN = 1e-6  # of the interval, rms: times this even have a strict Nyquist frequency
PIECE = 4_000_000  # numbers processed at a time


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Densities of A channels at F frequencies.

    frequency_hz   (F,)
    cross          (F, A, A) complex, m^2/Hz, one-sided: conj(X_a) X_b; the diagonal is the density of each channel
    degrees        equivalent degrees of freedom of each density
    bandwidth_hz   of the taper: a wave of variance v shows as v / bandwidth_hz at its frequency
    rate_hz        (A,) samples a second, mean
    """

    frequency_hz: Array
    cross: NDArray[np.complex128]
    degrees: float
    bandwidth_hz: float
    rate_hz: Array

    @property
    def density(self) -> Array:
        """Power density of each channel, (F, A) m^2/Hz."""
        return np.einsum("faa->fa", self.cross).real.copy()

    @property
    def nyquist_hz(self) -> Array:
        """Half the sampling rate, (A,) Hz; higher frequencies are aliased below it."""
        return 0.5 * self.rate_hz

    def interval(self, probability: float = 0.95) -> Array:
        """Limits (F, A, 2), m^2/Hz, that hold the true density with a probability, chi-square with `degrees`."""
        from scipy.stats import chi2

        tail = 0.5 * (1.0 - probability)
        quantiles = chi2.ppf(np.array([1.0 - tail, tail]), self.degrees)
        return self.density[..., None] * self.degrees / quantiles

    def coherence(self, a: int, b: int) -> Array:
        """Squared coherence (F,) of two channels, 0 to 1."""
        product = self.cross[:, a, a].real * self.cross[:, b, b].real
        return np.abs(self.cross[:, a, b]) ** 2 / np.maximum(product, np.finfo(float).tiny)

    def without_averaging(self, window: float) -> "Spectrum":
        """Spectrum corrected for samples that are means over a window.

        window    s: 0.128 of a ranger's buffer

        Divided by (sin x / x)^2, x = pi f window; NaN where that gain is below LEAST_GAIN, 0.2. Noise of the samples
        themselves, which the window did not attenuate, is amplified.
        """
        gain = np.sinc(self.frequency_hz * window)
        factor = np.where(np.abs(gain) >= LEAST_GAIN, 1.0 / np.maximum(np.abs(gain), LEAST_GAIN) ** 2, np.nan)
        return replace(self, cross=self.cross * factor[:, None, None])


def spectrum(
    times: Sequence[ArrayLike],
    samples: Sequence[ArrayLike],
    *,
    stretch: float | None = None,
    highest_hz: float | None = None,
    tapered: bool = True,
) -> Spectrum:
    """Densities and cross densities of channels with separate times.

    times        A of (N_a,) s, rising, any gaps; one clock
    samples      A of (N_a,) m
    stretch      s, segment length; None: the full series
    highest_hz   highest frequency; None: half the highest mean rate
    tapered      with Hann's window; without it neighbouring frequencies leak

    Frequencies are multiples of 1 / stretch. Each segment's mean is removed; one with fewer than 8 samples of a
    channel is skipped. With K segments overlapping by half there are 2 K / (1 + (K - 1)/(18 K)) degrees of freedom.
    Unevenly sampled noise spreads a floor over all frequencies; its integral up to half the mean rate is the variance.

    Raises ValidityError for times that do not increase, numbers that are not finite, or no segment with enough samples.

    Source: [WELCH67] (averaging, degrees of freedom), [SCARGLE82] eq. 6 (uneven times). Checked against scipy's.

    >>> t = np.arange(512) / 8.0
    >>> densities = spectrum([t], [np.cos(2 * np.pi * 1.0 * t) * 1e-3], stretch=16.0)
    >>> float(densities.frequency_hz[np.argmax(densities.density[:, 0])])
    1.0
    """
    t = [np.asarray(x, dtype=float) for x in times]
    y = [np.asarray(x, dtype=float) for x in samples]
    _refuse(t, y)
    first, last = min(x[0] for x in t), max(x[-1] for x in t)
    interval = [float(np.median(np.diff(x))) for x in t]
    total = last - first + min(interval)  # a sample stands for the interval after it
    length = total if stretch is None else float(stretch)
    if not 0.0 < length <= total * (1.0 + 1e-9):
        raise ValidityError(f"a segment of {length:.6g} s of {total:.6g} s (expected above 0 and no longer)")
    starts = first + 0.5 * length * np.arange(int(np.floor(2.0 * (total / length - 1.0) + 1e-6)) + 1)
    rate = np.array([(len(x) - 1) / (x[-1] - x[0]) for x in t])
    top = 0.5 * float(rate.max()) if highest_hz is None else float(highest_hz)
    frequency = np.arange(1, int(np.floor(top * length + 1e-6)) + 1) / length
    if not len(frequency):
        raise ValidityError(f"no frequency up to {top:.6g} Hz in segments of {length:.6g} s (expected longer ones)")
    cross, used = np.zeros((len(frequency), len(t), len(t)), dtype=complex), 0
    for start in starts:
        waves = _waves(start, length, frequency, t, y, tapered)
        if waves is not None:
            cross += waves.conj()[:, :, None] * waves[:, None, :]
            used += 1
    if not used:
        raise ValidityError(f"no segment of {length:.6g} s holds {LEAST} samples of each channel: take longer ones")
    sides = np.ones_like(frequency)
    if len({len(x) for x in t}) == 1 and all(np.std(np.diff(x)) < EVEN * np.mean(np.diff(x)) for x in t):
        sides = np.where(np.abs(frequency - 0.5 * rate[0]) < 1e-6 * rate[0], 0.5, 1.0)  # Nyquist: one side
    shared = 1.0 / 18.0 if tapered else 0.5  # twice the squared correlation of neighbours that overlap by half
    degrees = 2.0 * used / (1.0 + shared * (used - 1.0) / used)
    width = (1.5 if tapered else 1.0) / length
    scaled: NDArray[np.complex128] = cross * (2.0 / used * sides)[:, None, None].astype(complex)
    return Spectrum(frequency, scaled, degrees, width, rate)


def _waves(
    start: float, length: float, frequency: Array, t: Sequence[Array], y: Sequence[Array], tapered: bool
) -> NDArray[np.complex128] | None:
    """Waves (F, A) of one segment, with twice |wave|^2 the density; None with too few samples."""
    waves = np.empty((len(frequency), len(t)), dtype=complex)
    for a, (when, values) in enumerate(zip(t, y, strict=True)):
        low, high = np.searchsorted(when, [start - 1e-9 * length, start + length * (1.0 - 1e-9)])
        if high - low < LEAST:
            return None
        x, part = (when[low:high] - start) / length, values[low:high]
        taper = 0.5 - 0.5 * np.cos(TWO_PI * x) if tapered else np.ones_like(x)
        weighted = taper * (part - part.mean())
        for at in np.array_split(np.arange(len(frequency)), max(1, len(frequency) * len(x) // PIECE)):
            waves[at, a] = np.exp(-1j * TWO_PI * np.outer(frequency[at] * length, x)) @ weighted
        waves[:, a] *= np.sqrt(length / len(x) / np.sum(taper**2))
    return waves


def _refuse(t: Sequence[Array], y: Sequence[Array]) -> None:
    if not t or len(t) != len(y):
        raise ValidityError(f"{len(t)} channels of times and {len(y)} of samples (expected as many, one up)")
    for a, (when, values) in enumerate(zip(t, y, strict=True)):
        if when.ndim != 1 or when.shape != values.shape or len(when) < LEAST:
            raise ValidityError(
                f"channel {a}: times {when.shape}, samples {values.shape} (expected both (n,), {LEAST} at least)"
            )
        if not (np.isfinite(values).all() and np.all(np.diff(when) > 0.0)):
            raise ValidityError(f"channel {a}: times do not increase, or a sample is not finite (leave lost ones out)")


@dataclass(frozen=True)
class Peak:
    """Peak of the density summed over channels.

    frequency_hz   of its top, a parabola through the logarithms of three densities
    density        m^2/Hz, there
    over           times the background: the median about it
    """

    frequency_hz: float
    density: float
    over: float


def peaks(spectrum: Spectrum, *, probability: float = 0.999, about_hz: float | None = None) -> tuple[Peak, ...]:
    """Peaks of the density above the level of chance, highest first.

    spectrum         a spectrum
    probability   that no frequency of a smooth spectrum is taken for a peak
    about_hz      half width of the surroundings; None: 12 bandwidths

    The background is the local median; of a band broader than the surroundings only the edges are found.
    """
    from scipy.ndimage import median_filter
    from scipy.stats import chi2

    total = spectrum.density.sum(axis=1)
    step = spectrum.frequency_hz[0]
    half = max(3, round((12.0 * spectrum.bandwidth_hz if about_hz is None else about_hz) / step))
    degrees = spectrum.degrees * _effective(spectrum)
    background = median_filter(total, size=2 * half + 1, mode="nearest") * degrees / chi2.ppf(0.5, degrees)
    limit = chi2.ppf(probability ** (1.0 / max(len(total), 1)), degrees) / degrees
    # the median of independent frequencies is uncertain too: pi/2 times the variance of a mean
    limit *= 1.0 + 2.0 * np.sqrt(np.pi / degrees * spectrum.bandwidth_hz / ((2 * half + 1) * step))
    inner = np.arange(1, len(total) - 1)
    tops = inner[(total[inner] > total[inner - 1]) & (total[inner] >= total[inner + 1])]
    tops = tops[total[tops] > limit * background[tops]]
    tall = []
    for k in tops:
        low, mid, high = np.log(np.maximum(total[k - 1 : k + 2], np.finfo(float).tiny))
        bend = low - 2.0 * mid + high
        shift = float(0.5 * (low - high) / bend) if bend < 0.0 else 0.0
        tall.append(
            Peak(float(spectrum.frequency_hz[k] + shift * step), float(total[k]), float(total[k] / background[k]))
        )
    return tuple(sorted(tall, key=lambda peak: -peak.density))


def _effective(spectrum: Spectrum) -> float:
    """Effective number of independent channels in the summed density: (sum)^2 / sum of squares; 1 if one dominates."""
    mean = spectrum.density.mean(axis=0)
    return float(mean.sum() ** 2 / np.sum(mean**2))


def aliases(frequency_hz: float, rate_hz: float, highest_hz: float) -> tuple[float, ...]:
    """All frequencies up to the highest that are aliases at a channel's rate, lowest first.

    >>> aliases(2.8, 7.8, 12.0)
    (2.8, 5.0, 10.6)
    """
    folded = abs(frequency_hz - rate_hz * round(frequency_hz / rate_hz))
    alike = {round(abs(k * rate_hz + s * folded), 9) for k in range(int(highest_hz / rate_hz) + 2) for s in (-1, 1)}
    return tuple(sorted(f for f in alike if 0.0 < f <= highest_hz))


def likely_alias(
    times: Sequence[ArrayLike], samples: Sequence[ArrayLike], candidates_hz: Sequence[float], *, stretch: float
) -> tuple[float, Array]:
    """Most likely frequency among aliases, with each candidate's fit.

    The wave is seen by several channels.

    times, samples   as for `spectrum`
    candidates_hz    such as `aliases` gives
    stretch          s, segment over which the wave keeps its phase

    One mode moves all points in phase or in antiphase: the largest eigenvalue of the cross densities then comes from
    their real part alone. At an alias each channel's phase is wrong by 2 pi times the difference of frequencies times
    the offset of its sampling. Returns the first of the best and the share (C,), 1 at most, of the summed density
    that real shapes hold; where two shares are nearly equal (one channel, one rate), the result is undetermined.
    """
    t = [np.asarray(x, dtype=float) for x in times]
    y = [np.asarray(x, dtype=float) for x in samples]
    _refuse(t, y)
    first, last = min(x[0] for x in t), max(x[-1] for x in t)
    candidates = np.asarray(candidates_hz, dtype=float)
    total = np.zeros((len(candidates), len(t), len(t)), dtype=complex)
    for start in np.arange(first, max(last - stretch, first) + 1e-9, 0.5 * stretch):
        waves = _waves(start, stretch, candidates, t, y, True)
        if waves is not None:
            total += waves.conj()[:, :, None] * waves[:, None, :]
    scale = np.maximum(np.einsum("faa->f", total).real, np.finfo(float).tiny)
    share = np.linalg.eigvalsh(total.real)[:, -1] / scale
    return float(candidates[int(np.argmax(share))]), share


@dataclass(frozen=True, eq=False)
class ModeShape:
    """Relative motion of channels at a frequency.

    frequency_hz   the middle of the band
    rms            (A,) m, of each channel in the band, noise included
    shape          (A,) complex, of the first singular vector; its largest entry is 1
    u_shape        (A,) standard uncertainty of its size, from coherence with that channel
    first_share    of the summed variance that this shape holds: near 1 is one mode
    """

    frequency_hz: float
    rms: Array
    shape: NDArray[np.complex128]
    u_shape: Array
    first_share: float


def shape_at(spectrum: Spectrum, frequency_hz: float, *, half_width_hz: float | None = None) -> ModeShape:
    """Mode shape from the cross densities about a frequency.

    spectrum           a spectrum of two channels or more
    frequency_hz    of the mode
    half_width_hz   of the band; None: 2 bandwidths

    Source: [BRINCKER01] (singular vectors of the spectral matrix are mode shapes); u of a ratio from its coherence
    c, averaged over K: sqrt((1 - c) / (2 K c)) of it, [BENDAT10] chapter 9; NaN where the coherence is below 0.05.
    """
    half = 2.0 * spectrum.bandwidth_hz if half_width_hz is None else half_width_hz
    at = np.abs(spectrum.frequency_hz - frequency_hz) <= half
    if not at.any():
        raise ValidityError(f"no frequency of the spectrum within {half:.6g} Hz of {frequency_hz:.6g} Hz")
    step = float(spectrum.frequency_hz[0])
    matrix = spectrum.cross[at].sum(axis=0) * step
    values, vectors = np.linalg.eigh(matrix)
    # matrix = conj(x) x': its eigenvector is the conjugate of the shape
    shape = vectors[:, -1].conj()
    top = int(np.argmax(np.abs(shape)))
    shape = shape / shape[top]
    power = np.diag(matrix).real
    coherence = np.abs(matrix[top]) ** 2 / np.maximum(power[top] * power, np.finfo(float).tiny)
    averages = 0.5 * spectrum.degrees * max(1.0, at.sum() * step / spectrum.bandwidth_hz)
    safe = np.where(coherence > 0.05, np.minimum(coherence, 1.0), np.nan)
    u = np.abs(shape) * np.sqrt((1.0 - safe) / (2.0 * averages * safe))
    return ModeShape(float(frequency_hz), np.sqrt(np.maximum(power, 0.0)), shape, u, float(values[-1] / values.sum()))
