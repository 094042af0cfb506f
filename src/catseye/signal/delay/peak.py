"""The peak of a cross-correlation between the samples, and what is to be thought of it.

This is the plain form of `kernel`; the physics is in `arrival`.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NEWTON_STEPS = 6  # about a symmetric peak each step cubes what is left
SETTLED = 1e-5  # samples: after a step below it nothing is left that a double would show
RIVAL = 0.9  # of the highest: a second peak above it is refined, too, as it may be the higher one between the samples
FINE = 16  # steps a sample in the table of the signal's own correlation
HANN = 8.0 / 3.0  # over the mean square of a Hann window
TOLD_APART = 3.0  # sigma between the two highest peaks, below which they are not told apart
SECOND = 0.7  # of the arrival's amplitude: another arrival above it may be the direct one
AUDIBLE, CERTAIN = 0.1, 6.0  # of the arrival's amplitude, and sigma: another arrival above both is an echo
CLIPPED_FROM = 3  # samples at the converter's ends: fewer are crests


class DelayStatus(IntEnum):
    """What became of one recording, graver ones higher; up to ECHO there is an uncertainty, up to CLIPPED a delay."""

    GOOD = 0
    ECHO = 1
    THRESHOLD = 2
    AMBIGUOUS = 3
    EDGE = 4
    CLIPPED = 5
    SILENT = 6
    NOT_FINITE = 7


class PeakSearch(NamedTuple):
    """What is sought, in which lines of the spectrum, and where.

    omega       (l,) rad a sample, of the lines in work
    template    (l,) spectrum of the signal
    weight      (l,) W, for the phase transform 1 where a line is used and 0 where not
    phases      whether the weights are those of the phase transform
    own         the signal's own correlation, 1 in its middle, by steps of 1/FINE sample
    first       number of the first line in work
    stretch     samples that are transformed
    half        the window has 2 half + 1 lags
    least_snr   below it an arrival is in the threshold region
    """

    omega: NDArray[np.float64]
    template: NDArray[np.complex128]
    weight: NDArray[np.float64]
    phases: bool
    own: NDArray[np.float64]
    first: int
    stretch: int
    half: int
    least_snr: float


def find(
    piece: NDArray, low: NDArray[np.int64], search: PeakSearch, ends: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Arrivals in b stretches.

    piece    (b, up to stretch) samples, any real type
    low      (b,) first lag of the window, samples
    search   what is sought
    ends     of the converter

    The answer is (b, 5): lag in the stretch, samples; its variance, samples^2; amplitude; snr; rival, all as measured;
    and the status (b,).
    """
    damage = damaged(piece, ends)
    spectrum, scale = transformed(piece, search)
    cross, weight = cross_spectrum(spectrum, search)
    correlation = windowed(cross, low, search)
    measures = measured(spectrum, cross, weight, correlation=correlation, low=low, search=search, scale=scale)
    return judged(measures, damage, search.least_snr)


def transformed(piece: NDArray, search: PeakSearch) -> tuple[NDArray, float]:
    """The lines in work (b, l), and what makes a Hann-windowed residual's power that of the noise in a stretch."""
    n = piece.shape[1]
    if n < search.stretch:  # zeros follow, so a constant must go
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
    """(7, b): lag, NaN at the window's edge; variance; amplitude; snr; height of the second peak over the highest, and
    how many sigma it is below; amplitude of the strongest other arrival over this one's."""
    omega, template = search.omega, search.template
    at, second_at, second = peaks(correlation)
    lag = refined(cross, omega, at + low)
    close = np.flatnonzero((second > RIVAL) & ~np.isnan(lag))
    if len(close):
        again = refined(cross[close], omega, (second_at + low)[close])
        taller = heights(cross[close], omega, again) > heights(cross[close], omega, lag[close])
        lag[close[taller]], second_at[close[taller]] = again[taller], at[close[taller]]
    inside = np.where(np.isnan(lag), at + low, lag)
    turned = np.exp(1j * inside[:, None] * omega)
    z = cross * turned
    height, curvature = z.real.sum(axis=1), z.real @ omega**2
    power, used = np.abs(template) ** 2, search.weight > 0.0
    amplitude = ((spectrum * turned) @ (np.conj(template) * used)).real / np.sum(power * used)
    noise = scale * hann_power(spectrum * turned - amplitude[:, None] * template)
    each = weight**2 * power * noise
    variance = 0.5 * (each @ omega**2) / curvature**2
    snr = height**2 / (0.5 * each.sum(axis=1))
    second = second * correlation[np.arange(len(at)), at] / height
    rho = own_at(search.own, second_at + low - inside)
    apart = np.where(second > 0.0, np.sqrt(snr) * (1.0 - second) / np.sqrt(2.0 * np.maximum(1.0 - rho, 1e-12)), np.inf)
    lags = low[:, None] + np.arange(correlation.shape[1]) - inside[:, None]
    other = np.abs(correlation / height[:, None] - own_at(search.own, lags)).max(axis=1)
    return np.stack([lag, variance, amplitude, snr, second, apart, other])


def judged(
    measures: NDArray[np.float64], damage: NDArray[np.int8], least_snr: float
) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """The answer of `find`: what is measured, and the gravest status."""
    lag, variance, amplitude, snr, second, apart, other = measures
    status = np.zeros(len(lag), np.int8)
    echo = (other > AUDIBLE) & (other**2 * snr > CERTAIN**2)
    near = apart < TOLD_APART
    status[echo] = DelayStatus.ECHO
    status[near | (echo & (other > SECOND))] = DelayStatus.AMBIGUOUS
    status[~(snr >= least_snr)] = DelayStatus.THRESHOLD
    status[np.isnan(lag)] = DelayStatus.EDGE
    rival = np.where(near & (second > other), second, other)
    return np.stack([lag, variance, amplitude, snr, rival], axis=1), np.maximum(status, damage)


def damaged(piece: NDArray, ends: tuple[float, float]) -> NDArray[np.int8]:
    """What is wrong with the samples, GOOD where nothing is."""
    high, low = piece.max(axis=1), piece.min(axis=1)
    clipped = np.count_nonzero((piece >= ends[1]) | (piece <= ends[0]), axis=1) >= CLIPPED_FROM
    status = np.where(clipped, DelayStatus.CLIPPED, DelayStatus.GOOD).astype(np.int8)
    status[high == low] = DelayStatus.SILENT
    status[~(np.isfinite(high) & np.isfinite(low))] = DelayStatus.NOT_FINITE
    return status


def cross_spectrum(spectrum: NDArray, search: PeakSearch) -> tuple[NDArray, NDArray]:
    """W X conj(S), (b, l), and W, (l,) or (b, l)."""
    if not search.phases:
        return spectrum * (search.weight * np.conj(search.template)), search.weight
    size = np.abs(spectrum) * np.abs(search.template)
    weight = np.where(size > 0.0, search.weight / np.where(size > 0.0, size, 1.0), 0.0)
    return spectrum * np.conj(search.template) * weight, weight


def windowed(cross: NDArray, low: NDArray, search: PeakSearch) -> NDArray:
    """J at the whole lags of the window, (b, 2 half + 1)."""
    padded = np.zeros((len(cross), search.stretch // 2 + 1), complex)
    padded[:, search.first : search.first + cross.shape[1]] = cross
    whole = np.fft.irfft(padded, search.stretch)
    return np.take_along_axis(whole, low[:, None] + np.arange(2 * search.half + 1), axis=1) * (0.5 * search.stretch)


def peaks(correlation: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Places of the highest and of the second highest peak, and the second's height over the first's (0: none).

    Heights are those of parabolas through three samples, which is enough to choose.
    """
    rows = np.arange(len(correlation))
    before, here, after = correlation[:, :-2], correlation[:, 1:-1], correlation[:, 2:]
    top = (here >= before) & (here > after)
    bend = np.where(top, before - 2.0 * here + after, -1.0)
    height = np.where(top, here - 0.125 * (before - after) ** 2 / bend, -np.inf)
    at = np.argmax(correlation, axis=1)
    inner = np.clip(at - 1, 0, height.shape[1] - 1)
    best = np.where(top[rows, inner] & (inner == at - 1), height[rows, inner], correlation[rows, at])
    height[rows, inner] = -np.inf
    second_at = np.argmax(height, axis=1)
    second = height[rows, second_at]
    return at, second_at + 1, np.where(np.isfinite(second), np.maximum(second / best, 0.0), 0.0)


def refined(cross: NDArray, omega: NDArray, lag: NDArray) -> NDArray:
    """Lags of the peaks near whole ones, by Newton steps on J; NaN where they lead away by more than a sample."""
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
    """J at lags (b,); NaN stays."""
    return (cross * np.exp(1j * tau[:, None] * omega)).real.sum(axis=1)


def hann_power(residual: NDArray) -> NDArray:
    """Power by line (b, l) under a Hann window, which loud lines do not leak through, from spectra without one."""
    wide = np.pad(residual, ((0, 0), (1, 1)), mode="edge")
    return np.abs(0.5 * wide[:, 1:-1] - 0.25 * (wide[:, :-2] + wide[:, 2:])) ** 2


def own_at(own: NDArray, lag: NDArray) -> NDArray:
    """The signal's own correlation at lags (...), samples, between the steps of its table."""
    place = np.clip(lag * FINE + len(own) // 2, 0.0, len(own) - 1.001)
    whole = place.astype(np.int64)
    share = place - whole
    return own[whole] * (1.0 - share) + own[whole + 1] * share
