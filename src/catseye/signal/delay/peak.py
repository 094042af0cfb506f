"""Peak of a cross-correlation between samples, with its quality flags.

Plain form of `kernel`; the theory is in `arrival`.

"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NEWTON_STEPS = 6  # near a symmetric peak each step cubes the error
SETTLED = 1e-5  # samples: after a smaller step the error is below double precision
RIVAL = 0.9  # of the highest: a second peak above it is refined too, as it may be higher between samples
FINE = 16  # steps a sample in the table of the autocorrelation
HANN = 8.0 / 3.0  # over the mean square of a Hann window
TOLD_APART = 3.0  # sigma between the two highest peaks, below which they are ambiguous
SECOND = 0.7  # of the arrival's amplitude: another arrival above it may be the direct one
AUDIBLE, CERTAIN = 0.1, 6.0  # of the arrival's amplitude, and sigma: another arrival above both is an echo
CLIPPED_FROM = 3  # samples at the converter's ends: fewer may be wave crests


class DelayStatus(IntEnum):
    """Status of one recording, worse ones higher.

    u_delay exists up to ECHO, a delay up to CLIPPED.
    """

    GOOD = 0
    ECHO = 1
    THRESHOLD = 2
    AMBIGUOUS = 3
    EDGE = 4
    CLIPPED = 5
    SILENT = 6
    NOT_FINITE = 7


class PeakSearch(NamedTuple):
    """Signal, spectral lines and window of a search.

    omega             (l,) rad a sample, of the lines used
    template          (l,) spectrum of the signal
    weight            (l,) W; for the phase transform 1 for lines used, else 0
    phases            True for the weights of the phase transform
    autocorrelation   of the signal, 1 in its middle, by steps of 1/FINE sample
    first             number of the first line used
    stretch           samples of a segment
    half              the window has 2 half + 1 lags
    least_snr         below it an arrival is in the threshold region
    """

    omega: NDArray[np.float64]
    template: NDArray[np.complex128]
    weight: NDArray[np.float64]
    phases: bool
    autocorrelation: NDArray[np.float64]
    first: int
    stretch: int
    half: int
    least_snr: float


def find(
    piece: NDArray, low: NDArray[np.int64], search: PeakSearch, ends: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Locate the arrivals in b segments.

    piece    (b, up to stretch) samples, any real type
    low      (b,) first lag of the window, samples
    search   signal, lines and window
    ends     of the converter

    Returns (b, 5): lag in the stretch, samples; its variance, samples^2; amplitude; snr; rival, all as measured;
    and the status (b,).
    """
    damage = damaged(piece, ends)
    spectrum, scale = transformed(piece, search)
    cross, weight = cross_spectrum(spectrum, search)
    correlation = windowed(cross, low, search)
    measures = measured(spectrum, cross, weight, correlation=correlation, low=low, search=search, scale=scale)
    return judged(measures, damage, search.least_snr)


def transformed(piece: NDArray, search: PeakSearch) -> tuple[NDArray, float]:
    """Spectra (b, l) of the lines used, and noise scale.

    The scale converts a Hann-windowed residual's power to noise power of a segment.
    """
    n = piece.shape[1]
    if n < search.stretch:  # zeros follow, so the mean is removed
        piece = piece - piece.mean(axis=1, keepdims=True)
    spectrum = np.fft.rfft(piece, search.stretch)
    return spectrum[:, search.first : search.first + len(search.omega)], HANN * search.stretch / n


def measured(
    spectrum: NDArray,
    cross: NDArray,
    weight: NDArray,
    *,
    correlation: NDArray,
    low: NDArray,
    search: PeakSearch,
    scale: float,
) -> NDArray[np.float64]:
    """Measures (7, b) of the peaks.

    lag, NaN at the window's edge; variance; amplitude; snr; height of the second peak over the highest, and how many
    sigma it is below; amplitude of the strongest other arrival over this one's.
    """
    omega, template = search.omega, search.template
    at, second_at, second = peaks(correlation)
    lag = refined(cross, omega, at + low)
    close = np.flatnonzero((second > RIVAL) & ~np.isnan(lag))
    if len(close):
        second_lag = refined(cross[close], omega, (second_at + low)[close])
        taller = heights(cross[close], omega, second_lag) > heights(cross[close], omega, lag[close])
        lag[close[taller]], second_at[close[taller]] = second_lag[taller], at[close[taller]]
    inside = np.where(np.isnan(lag), at + low, lag)
    turned = np.exp(1j * inside[:, None] * omega)
    z = cross * turned
    height, curvature = z.real.sum(axis=1), z.real @ omega**2
    power, used = np.abs(template) ** 2, search.weight > 0.0
    amplitude = ((spectrum * turned) @ (np.conj(template) * used)).real / np.sum(power * used)
    noise = scale * hann_power(spectrum * turned - amplitude[:, None] * template)
    lines = weight**2 * power * noise
    variance = 0.5 * (lines @ omega**2) / curvature**2
    snr = height**2 / (0.5 * lines.sum(axis=1))
    second = second * correlation[np.arange(len(at)), at] / height
    rho = autocorrelation_at(search.autocorrelation, second_at + low - inside)
    apart = np.where(second > 0.0, np.sqrt(snr) * (1.0 - second) / np.sqrt(2.0 * np.maximum(1.0 - rho, 1e-12)), np.inf)
    lags = low[:, None] + np.arange(correlation.shape[1]) - inside[:, None]
    strongest = np.abs(correlation / height[:, None] - autocorrelation_at(search.autocorrelation, lags)).max(axis=1)
    return np.stack([lag, variance, amplitude, snr, second, apart, strongest])


def judged(
    measures: NDArray[np.float64], damage: NDArray[np.int8], least_snr: float
) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Columns of `find` from the measures, and the worst status."""
    lag, variance, amplitude, snr, second, apart, strongest = measures
    status = np.zeros(len(lag), np.int8)
    echo = (strongest > AUDIBLE) & (strongest**2 * snr > CERTAIN**2)
    near = apart < TOLD_APART
    status[echo] = DelayStatus.ECHO
    status[near | (echo & (strongest > SECOND))] = DelayStatus.AMBIGUOUS
    status[~(snr >= least_snr)] = DelayStatus.THRESHOLD
    status[np.isnan(lag)] = DelayStatus.EDGE
    rival = np.where(near & (second > strongest), second, strongest)
    return np.stack([lag, variance, amplitude, snr, rival], axis=1), np.maximum(status, damage)


def damaged(piece: NDArray, ends: tuple[float, float]) -> NDArray[np.int8]:
    """Status of the samples themselves, GOOD where nothing is wrong."""
    high, low = piece.max(axis=1), piece.min(axis=1)
    clipped = np.count_nonzero((piece >= ends[1]) | (piece <= ends[0]), axis=1) >= CLIPPED_FROM
    status = np.where(clipped, DelayStatus.CLIPPED, DelayStatus.GOOD).astype(np.int8)
    status[high == low] = DelayStatus.SILENT
    status[~(np.isfinite(high) & np.isfinite(low))] = DelayStatus.NOT_FINITE
    return status


def cross_spectrum(spectrum: NDArray, search: PeakSearch) -> tuple[NDArray, NDArray]:
    """Weighted cross-spectrum W X conj(S), (b, l), and W, (l,) or (b, l)."""
    if not search.phases:
        return spectrum * (search.weight * np.conj(search.template)), search.weight
    size = np.abs(spectrum) * np.abs(search.template)
    weight = np.where(size > 0.0, search.weight / np.where(size > 0.0, size, 1.0), 0.0)
    return spectrum * np.conj(search.template) * weight, weight


def windowed(cross: NDArray, low: NDArray, search: PeakSearch) -> NDArray:
    """J at the whole lags of the window, (b, 2 half + 1)."""
    padded = np.zeros((len(cross), search.stretch // 2 + 1), complex)
    padded[:, search.first : search.first + cross.shape[1]] = cross
    all_lags = np.fft.irfft(padded, search.stretch)
    return np.take_along_axis(all_lags, low[:, None] + np.arange(2 * search.half + 1), axis=1) * (0.5 * search.stretch)


def peaks(correlation: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Places of the two highest peaks, and their height ratio (0: no second).

    Heights are those of parabolas through three samples, which is enough to choose.
    """
    rows = np.arange(len(correlation))
    previous, current, following = correlation[:, :-2], correlation[:, 1:-1], correlation[:, 2:]
    top = (current >= previous) & (current > following)
    bend = np.where(top, previous - 2.0 * current + following, -1.0)
    height = np.where(top, current - 0.125 * (previous - following) ** 2 / bend, -np.inf)
    at = np.argmax(correlation, axis=1)
    inner = np.clip(at - 1, 0, height.shape[1] - 1)
    best = np.where(top[rows, inner] & (inner == at - 1), height[rows, inner], correlation[rows, at])
    height[rows, inner] = -np.inf
    second_at = np.argmax(height, axis=1)
    second = height[rows, second_at]
    return at, second_at + 1, np.where(np.isfinite(second), np.maximum(second / best, 0.0), 0.0)


def refined(cross: NDArray, omega: NDArray, lag: NDArray) -> NDArray:
    """Lags of the peaks near whole lags, by Newton steps on J.

    NaN where they go beyond a sample.
    """
    tau = lag.astype(float)
    moments = np.stack([omega, omega**2], axis=1)
    for _ in range(NEWTON_STEPS):
        z = cross * np.exp(1j * tau[:, None] * omega)
        slope, bend = -(z.imag @ moments[:, 0]), -(z.real @ moments[:, 1])
        step = np.where(bend < 0.0, -slope / bend, np.inf)
        tau = tau + step
        if not np.any(np.abs(step) > SETTLED):
            break
    return np.where(np.abs(tau - lag) <= 1.0, tau, np.nan)


def heights(cross: NDArray, omega: NDArray, tau: NDArray) -> NDArray:
    """J at lags (b,); NaN is passed on."""
    return (cross * np.exp(1j * tau[:, None] * omega)).real.sum(axis=1)


def hann_power(residual: NDArray) -> NDArray:
    """Power by line (b, l) under a Hann window, without leakage of strong lines.

    residual   spectra without a window
    """
    wide = np.pad(residual, ((0, 0), (1, 1)), mode="edge")
    return np.abs(0.5 * wide[:, 1:-1] - 0.25 * (wide[:, :-2] + wide[:, 2:])) ** 2


def autocorrelation_at(autocorrelation: NDArray, lag: NDArray) -> NDArray:
    """Autocorrelation of the signal at lags (...), samples, by linear interpolation."""
    place = np.clip(lag * FINE + len(autocorrelation) // 2, 0.0, len(autocorrelation) - 1.001)
    index = place.astype(np.int64)
    share = place - index
    return autocorrelation[index] * (1.0 - share) + autocorrelation[index + 1] * share
