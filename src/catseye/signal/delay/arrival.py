"""Arrival time of a known signal, at the Cramer-Rao bound.

    x(t) = a s(t - tau) + noise,   J(tau) = sum over k of Re W_k X_k conj(S_k) exp(i w_k tau)

A segment of the recording around the predicted arrival is transformed, the cross-spectrum transformed back gives J at
whole samples, and Newton steps on the cross-spectrum itself find its maximum between them. So there is no error floor:
a parabola through three samples of J is biased by a few hundredths of a sample at any signal level.

Weights. `plain`, W = 1: maximum likelihood in white noise. `whitened`, W = 1/N_k with the noise's spectrum: maximum
likelihood in coloured noise. `phat`, the phase transform, W = 1/|X_k conj S_k|: only phases count, which keeps the peak
sharp where echoes or the loudspeaker colour the signal; it costs noise, as weak frequencies count like strong ones.

Uncertainty. To first order the error of tau is Im(sum w W S* n exp) / (a sum w^2 W |S|^2), whose variance is

    u^2 = (1/2) sum w^2 W^2 |S|^2 N / (a sum w^2 W |S|^2)^2

for noise of spectrum N, estimated from the residual in the same segment. With W = 1 and white noise it is the bound,
1/(snr beta^2), snr = a^2 sum s^2/sigma^2 (twice energy over noise density), beta^2 = sum s'^2/sum s^2; with W = 1/N it
is the bound in coloured noise. The amplitude is unknown, but it costs nothing: sum s s' = 0.

Threshold. Below some snr another lag is sometimes highest, and the scatter exceeds the bound: side peaks of the
signal's own correlation rho win with probability Q(sqrt(snr (1 - rho)/2)), noise somewhere in the window of width T
with at most (T beta/2 pi) exp(-snr/4)/sqrt 2 (`risk`). Where these exceed 1e-4 the status is THRESHOLD and no u is
given.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from math import erfc

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import TWO_PI
from catseye.errors import ValidityError
from catseye.signal.delay.peak import FINE, HANN, DelayStatus, PeakSearch, cross_spectrum, find, transformed, windowed

WEIGHTINGS = ("plain", "whitened", "phat")
GUARD = 32  # samples added to the window: the effect of cutting a segment fades within them
FAINTEST = 1e-6  # of the signal's strongest line: weaker lines are not used
FAINTEST_PHASE = 1e-2  # the same for the phase transform, where all lines have equal weight
LOWEST = 0.3  # of the signal's autocorrelation: lower side peaks are treated as noise
RISK = 1e-4  # probability of a wrong peak above which an arrival is in the threshold region
BLOCK_SAMPLES = 2**18  # samples processed at a time
COMPILED_FROM = 2000  # recordings: loading numba takes about as long as the plain form for these

ECHO, SILENT = int(DelayStatus.ECHO), int(DelayStatus.SILENT)  # numpy is slow to compare with members

TEXTS = {
    DelayStatus.GOOD: "good",
    DelayStatus.ECHO: "another arrival has {rival:.0%} of its amplitude: the delay may be biased",
    DelayStatus.THRESHOLD: "too weak: signal to noise {decibel:.0f} dB, where noise can exceed the peak elsewhere; "
    "send louder or longer, or narrow the window",
    DelayStatus.AMBIGUOUS: "two peaks are nearly as high ({rival:.0%}): the arrival is ambiguous; "
    "narrow the window, or send a wider band",
    DelayStatus.EDGE: "the highest correlation is at the window's edge; "
    "widen the window, or correct the expected delay",
    DelayStatus.CLIPPED: "clipped: samples at the converter's ends; lower the gain",
    DelayStatus.SILENT: "silent: all samples are equal; is the microphone on?",
    DelayStatus.NOT_FINITE: "not finite: a sample is NaN or infinite",
}


@dataclass(frozen=True, eq=False)
class Delays:
    """Arrival times of the signal, one element a recording.

    delay      s from the recording's first sample to the signal's first; NaN where there is none
    u_delay    s, standard uncertainty; NaN where the status is worse than ECHO, as the bound does not hold there
    amplitude  of the signal, the template being 1
    snr        of the peak, its height over the noise's standard deviation there, squared: a^2 sum s^2/sigma^2 with
               plain weights in white noise, the ratio of powers times the samples of the template
    rival      highest other peak or arrival, over the amplitude
    status     int8 of DelayStatus; `text` says it in words
    """

    delay: NDArray[np.float64]
    u_delay: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    snr: NDArray[np.float64]
    rival: NDArray[np.float64]
    status: NDArray[np.int8]

    def text(self, *place: int) -> str:
        """Status text of one recording: fault and remedy."""
        with np.errstate(divide="ignore"):
            decibel = float(10.0 * np.log10(self.snr[place]))
        return TEXTS[DelayStatus(int(self.status[place]))].format(decibel=decibel, rival=float(self.rival[place]))


class DelayPlan:
    """Signal with its spectra, ready to search recordings.

    template      (m,) samples of the signal from its start, at least 8
    sampling_hz   Hz, of template and recordings
    window        s, half width of the search on both sides of the expected arrival
    weighting     "plain", "whitened" or "phat"
    band_hz       lowest and highest frequency used; by default the signal's band
    noise         (..., k) samples of the noise alone, for "whitened": at least twice as long as a segment
    full_scale    magnitude of a sample at the converter's ends; by default the integer type's, none for floats
    compiled      True for the compiled form; None: for many recordings, and where numba is loaded already

    Raises ValidityError for a template without signal, values out of range, or "whitened" without noise.

    Source: [KAY93] section 3.11 (bound), [KNAPP76] (weights, their variance). Exact but for rounding, 1e-11 s.

    >>> t = np.arange(100) / 8e3
    >>> tone = np.sin(2 * np.pi * 1e3 * t) * np.sin(np.pi * t / t[-1]) ** 2
    >>> plan = DelayPlan(tone, sampling_hz=8e3, window=2e-3)
    >>> heard = np.concatenate([np.zeros(400), tone, np.zeros(300)])
    >>> round(float(plan(heard, 0.0505).delay), 9)
    0.05
    """

    def __init__(
        self,
        template: ArrayLike,
        *,
        sampling_hz: float,
        window: float,
        weighting: str = "plain",
        band_hz: tuple[float, float] | None = None,
        noise: ArrayLike | None = None,
        full_scale: float | None = None,
        compiled: bool | None = None,
    ) -> None:
        samples = _template(template)
        if not (np.isfinite(sampling_hz) and sampling_hz > 0.0):
            raise ValidityError(f"sampling {sampling_hz} Hz is not a positive number")
        if not (np.isfinite(window) and window * sampling_hz >= 1.0):
            raise ValidityError(f"window {window} s is not above one sample, {1.0 / sampling_hz:g} s, on either side")
        if weighting not in WEIGHTINGS:
            raise ValidityError(f"weighting {weighting!r} is not one of {', '.join(WEIGHTINGS)}")
        self.weighting, self.full_scale, self.compiled = weighting, full_scale, compiled
        self.sampling_hz, self.length = float(sampling_hz), len(samples)
        self.half = int(np.ceil(window * sampling_hz))
        self.stretch = fast_length(self.length + 2 * self.half + 1 + 2 * GUARD)
        spectrum = np.fft.rfft(samples, self.stretch)
        self._choose_lines(spectrum, band_hz, noise)

    def _choose_lines(self, spectrum: NDArray, band_hz: tuple[float, float] | None, noise: ArrayLike | None) -> None:
        """Choose one run of spectral lines and their weights."""
        power = np.abs(spectrum) ** 2
        power[0] = power[-1] = 0.0  # the constant and the highest line contain no delay
        used = power > (FAINTEST_PHASE if self.weighting == "phat" else FAINTEST) * power.max()
        if band_hz is not None:
            hertz = np.arange(len(power)) * self.sampling_hz / self.stretch
            used &= (hertz >= band_hz[0]) & (hertz <= band_hz[1])
        if np.count_nonzero(used) < 2:
            raise ValidityError(f"the template has no signal in the band {band_hz} Hz (expected at least two lines)")
        self.first, self.stop = int(np.argmax(used)), int(len(used) - np.argmax(used[::-1]))
        run = slice(self.first, self.stop)
        weight = used[run].astype(float)
        if self.weighting == "whitened":
            if noise is None:
                raise ValidityError("weighting 'whitened' needs the noise alone: give `noise`")
            weight /= noise_spectrum(noise, self.stretch)[run]
        expected = weight / np.maximum(power[run], 1e-300) if self.weighting == "phat" else weight
        line_weight = expected * power[run]
        total = float(np.sum(line_weight))
        omega = TWO_PI * np.arange(self.first, self.stop) / self.stretch
        self.bandwidth = float(np.sqrt(np.sum(line_weight * omega**2) / total)) * self.sampling_hz
        fine = np.zeros(FINE * self.stretch // 2 + 1)
        fine[run] = line_weight
        side = np.fft.irfft(fine)[: FINE * (2 * self.half + 2) + 1] * (0.5 * FINE * self.stretch / total)
        autocorrelation = np.concatenate([side[:0:-1], side])
        self.search = PeakSearch(omega, spectrum[run], weight, self.weighting == "phat", autocorrelation, self.first,
                             self.stretch, self.half, self._least_snr(side))  # fmt: skip

    def _least_snr(self, side: NDArray) -> float:
        """Signal to noise where a wrong peak has probability RISK; infinite for a tone."""
        top = np.flatnonzero((side[1:-1] > side[:-2]) & (side[1:-1] >= side[2:])) + 1
        height = np.clip(side[top[top <= FINE * self.half]], 0.0, 1.0)
        self._side_peaks = height[height > LOWEST]
        snr = np.logspace(0.0, 7.0, 351)
        chance = self.risk(snr)
        return float(snr[np.argmax(chance < RISK)]) if chance[-1] < RISK else np.inf

    def risk(self, snr: ArrayLike) -> NDArray[np.float64]:
        """Probability that another lag has the highest correlation; snr as in `Delays`.

        The sum over the side peaks, two of each height, and noise anywhere in the window: it exceeds a level u with
        probability 1 - exp(-T beta/2 pi exp(-u^2/2)), u being the arrival's own height with its noise. Source: [RICE44]
        section 3.6 for the rate. Good to 35 % below 0.2.
        """
        ratio = np.asarray(snr, float)
        lags = 2.0 * self.half * self.bandwidth / (self.sampling_hz * TWO_PI)
        argument = 0.5 * np.sqrt(ratio[..., None] * (1.0 - self._side_peaks))
        side_peak_risk = np.vectorize(erfc, otypes=[float])(argument).sum(axis=-1) if len(self._side_peaks) else 0.0
        xi = np.linspace(-8.0, 8.0, 161)  # sigma: noise of the arrival's height
        level = np.maximum(np.sqrt(ratio)[..., None] + xi, 0.0)
        share = np.exp(-0.5 * xi**2) / np.exp(-0.5 * xi**2).sum()
        return -np.expm1(-lags * np.exp(-0.5 * level**2)) @ share + side_peak_risk

    def bound(self, snr: ArrayLike) -> NDArray[np.float64]:
        """Cramer-Rao bound of the delay in white noise, s.

        1/(beta sqrt(snr)), snr as in `Delays`.
        """
        return 1.0 / (self.bandwidth * np.sqrt(np.asarray(snr, float)))

    def __call__(self, recordings: ArrayLike, expected: ArrayLike) -> Delays:
        """Arrival times in recordings.

        recordings   (..., n), integers or floats, n at least template and window together
        expected     s, expected delay, (...,) or one for all: centre of the window

        The worst status is returned; a recording never raises. Raises ValidityError for recordings that are too short,
        and for an expected delay whose window extends past the recording.
        """
        array = np.asarray(recordings)
        self._check(array)
        batch, rows = array.shape[:-1], array.reshape(-1, array.shape[-1])
        centre = np.asarray(expected, float)
        centre = np.broadcast_to(centre, batch).reshape(-1) if centre.ndim or len(rows) > 1 else centre.reshape(1)
        start, low = self._placed(centre, rows.shape[1])
        form = self._form(len(rows))
        step = max(1, BLOCK_SAMPLES // self.stretch)
        arrivals, status = np.empty((len(rows), 5)), np.empty(len(rows), np.int8)
        with np.errstate(all="ignore"):  # a recording that is not finite, or silent, gives NaN
            for begin in range(0, len(rows), step):
                part = slice(begin, begin + step)
                piece = self._cut(rows[part], start[part])
                arrivals[part], status[part] = form(piece, low[part], self.search, self._ends(piece))
        arrivals[:, 0] = (arrivals[:, 0] + start) / self.sampling_hz
        arrivals[:, 1] = np.sqrt(arrivals[:, 1]) / self.sampling_hz
        if status.any():
            arrivals[status > ECHO, 1] = np.nan
            arrivals[status >= SILENT] = np.nan
        delay, u, amplitude, snr, rival = (column.reshape(batch) for column in arrivals.T)
        return Delays(delay=delay, u_delay=u, amplitude=amplitude, snr=snr, rival=rival, status=status.reshape(batch))

    def correlation(self, recording: ArrayLike, expected: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Correlation J over the window, for a figure.

        Returns delays, s, and J as signal amplitude.

        recording   (n,) as for a call
        expected    s
        """
        rows = np.asarray(recording)[None]
        self._check(rows)
        start, low = self._placed(np.array([expected], float), rows.shape[1])
        spectrum, _ = transformed(self._cut(rows, start), self.search)
        cross, weight = cross_spectrum(spectrum, self.search)
        height = windowed(cross, low, self.search)[0] / np.sum(weight * np.abs(self.search.template) ** 2)
        return (start + low + np.arange(len(height))) / self.sampling_hz, height

    def _check(self, array: NDArray) -> None:
        if array.ndim == 0 or array.dtype.kind not in "iuf":
            raise ValidityError(f"a recording is not a row of integers or floats ({array.dtype}, {array.ndim} axes)")
        if array.shape[-1] < self.length + 2 * self.half:
            raise ValidityError(
                f"a recording of {array.shape[-1]} samples is shorter than template and window, "
                f"{self.length} + {2 * self.half}; record longer, or narrow the window"
            )

    def _placed(self, expected: NDArray, n: int) -> tuple[NDArray, NDArray]:
        """Start of each segment and first lag in it, samples."""
        lag = np.rint(expected * self.sampling_hz)
        good = (lag >= self.half) & (lag <= n - self.length - self.half)
        if not good.all():
            latest = (n - self.length - self.half) / self.sampling_hz
            raise ValidityError(
                f"expected delay {expected[np.argmin(good)]:.6g} s: its window extends past the recording "
                f"(expected {self.half / self.sampling_hz:.6g} to {latest:.6g} s)"
            )
        low = lag.astype(np.int64) - self.half
        before = (self.stretch - self.length - 2 * self.half) // 2
        start = np.minimum(np.maximum(low - before, 0), max(0, n - self.stretch))
        return start, low - start

    def _cut(self, rows: NDArray, start: NDArray) -> NDArray:
        if rows.shape[1] <= self.stretch:
            return rows
        if len(rows) == 1 or np.all(start == start[0]):
            return rows[:, start[0] : start[0] + self.stretch]
        return np.take_along_axis(rows, start[:, None] + np.arange(self.stretch), axis=1)

    def _ends(self, piece: NDArray) -> tuple[float, float]:
        if self.full_scale is not None:
            return -self.full_scale, self.full_scale
        if piece.dtype.kind == "f":
            return -np.inf, np.inf
        return float(np.iinfo(piece.dtype).min), float(np.iinfo(piece.dtype).max)

    def _form(self, count: int) -> Callable[..., tuple[NDArray, NDArray]]:
        """Compiled form where it is faster, else the plain one."""
        loaded = sys.modules.get("catseye.signal.delay.kernel")
        if self.compiled is not False and loaded is not None and hasattr(loaded, "find"):
            return loaded.find
        if self.compiled or (self.compiled is None and count >= COMPILED_FROM):
            from catseye.signal.delay.kernel import find as compiled_find

            return compiled_find
        return find


def fast_length(least: int) -> int:
    """Smallest even product of 2, 3, 5 not below a length.

    Fourier transforms of that length are fast.

    >>> fast_length(2049)
    2160
    """
    best = 2 ** int(np.ceil(np.log2(max(least, 2))))
    for five in range(int(np.log(best) / np.log(5.0)) + 1):
        for three in range(int(np.log(best) / np.log(3.0)) + 1):
            odd = 5**five * 3**three
            two = max(1, int(np.ceil(np.log2(max(least / odd, 1.0)))))
            best = min(best, odd * 2**two)
    return best


def noise_spectrum(noise: ArrayLike, stretch: int) -> NDArray[np.float64]:
    """Noise power by line, (stretch/2 + 1,): E|n_k|^2 of a segment.

    noise     (..., k) samples, k at least 2 stretches
    stretch   samples, even

    Raises ValidityError for noise that is too short, or without any power. Source: [WELCH67].

    >>> white = np.random.default_rng(1).standard_normal(200_000)
    >>> round(float(np.mean(noise_spectrum(white, 64)[4:])) / 64, 2)
    1.0
    """
    samples = np.atleast_2d(np.asarray(noise, float))
    if samples.shape[-1] < 2 * stretch:
        raise ValidityError(
            f"{samples.shape[-1]} samples of noise are too few (expected {2 * stretch}, two stretches); record longer"
        )
    hann = np.sin(np.pi * np.arange(stretch) / stretch) ** 2
    blocks = np.lib.stride_tricks.sliding_window_view(samples, stretch, axis=-1)[..., :: stretch // 2, :]
    lines = np.fft.rfft((blocks - blocks.mean(axis=-1, keepdims=True)) * hann)
    power = HANN * np.mean(np.abs(lines) ** 2, axis=tuple(range(lines.ndim - 1)))
    if not (np.isfinite(power).all() and power.max() > 0.0):
        raise ValidityError("the noise is silent or not finite: it has no spectrum for weighting")
    return np.maximum(power, 1e-12 * power.max())


def _template(template: ArrayLike) -> NDArray[np.float64]:
    samples = np.asarray(template, float)
    if samples.ndim != 1 or len(samples) < 8:
        raise ValidityError(f"a template of shape {samples.shape} is not a row of at least 8 samples")
    if not np.isfinite(samples).all() or np.ptp(samples) == 0.0:
        raise ValidityError("the template is constant or not finite: it has no arrival")
    return samples
