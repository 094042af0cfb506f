"""Compiled form of `peak`, with phase rotation by recurrence."""

import numpy as np
from numba import njit

from catseye.signal.delay.peak import (
    AUDIBLE,
    CERTAIN,
    CLIPPED_FROM,
    FINE,
    NEWTON_STEPS,
    RIVAL,
    SECOND,
    SETTLED,
    TOLD_APART,
    DelayStatus,
    PeakSearch,
    cross_spectrum,
    transformed,
)

GOOD, ECHO, THRESHOLD, AMBIGUOUS = (
    int(s) for s in (DelayStatus.GOOD, DelayStatus.ECHO, DelayStatus.THRESHOLD, DelayStatus.AMBIGUOUS)
)
EDGE, CLIPPED, SILENT, NOT_FINITE = (
    int(s) for s in (DelayStatus.EDGE, DelayStatus.CLIPPED, DelayStatus.SILENT, DelayStatus.NOT_FINITE)
)

# Numba's cache refers to `PeakSearch` and finds a compiled kernel by its line number.
_compiled = njit(cache=True, error_model="numpy", nogil=True)
_inlined = njit(error_model="numpy")  # cached with their caller


def find(piece, low, search: PeakSearch, ends):
    """Compiled form of `peak.find`."""
    arrivals, status = np.empty((len(piece), 5)), np.empty(len(piece), np.int8)
    spectrum, scale = transformed(piece, search)
    padded = np.zeros((len(piece), search.stretch // 2 + 1), np.complex128)
    if search.phases:
        cross, weights = cross_spectrum(spectrum, search)
        padded[:, search.first : search.first + cross.shape[1]] = cross
    else:
        weights = search.weight[None]
        _weigh(spectrum, search.template, search.weight, padded, search.first)
    correlation = np.fft.irfft(padded, search.stretch)
    spectra = spectrum, padded, correlation, weights
    _rows(piece, (ends[0], ends[1]), spectra, low, search, scale, (arrivals, status))
    return arrivals, status


@_compiled
def _weigh(spectrum, template, weight, padded, first):
    for b in range(len(spectrum)):
        for k in range(len(template)):
            padded[b, first + k] = spectrum[b, k] * template[k].conjugate() * weight[k]


@_inlined
def _damage(samples, bottom, top):
    high, low, count = samples[0], samples[0], 0
    finite = True
    for x in samples:
        high, low = max(high, x), min(low, x)
        finite &= abs(float(x)) < np.inf
        count += (x >= top) | (x <= bottom)
    if not finite:
        return NOT_FINITE
    if high == low:
        return SILENT
    return CLIPPED if count >= CLIPPED_FROM else GOOD


@_inlined
def _judged(lag, snr, apart, strongest, least_snr):
    if np.isnan(lag):
        return EDGE
    echo = strongest > AUDIBLE and strongest**2 * snr > CERTAIN**2
    if not snr >= least_snr:
        return THRESHOLD
    if apart < TOLD_APART or (echo and strongest > SECOND):
        return AMBIGUOUS
    return ECHO if echo else GOOD


@_inlined
def _sums(cross, tau, omega, step):
    """J, its slope and its curvature at a lag, samples."""
    turn, on = complex(np.cos(omega * tau), np.sin(omega * tau)), complex(np.cos(step * tau), np.sin(step * tau))
    height, slope, bend = 0.0, 0.0, 0.0
    for k in range(len(cross)):
        z = cross[k] * turn
        w = omega + k * step
        height += z.real
        slope -= w * z.imag
        bend -= w * w * z.real
        turn *= on
    return height, slope, bend


@_inlined
def _refined(cross, lag, omega, step):
    """Lag and height of the peak near a whole lag.

    NaN where Newton's steps go beyond a sample.
    """
    tau = float(lag)
    for _ in range(NEWTON_STEPS):
        _, slope, bend = _sums(cross, tau, omega, step)
        if not bend < 0.0:
            return np.nan, np.nan
        move = -slope / bend
        tau += move
        if not abs(tau - lag) <= 1.0:
            return np.nan, np.nan
        if abs(move) <= SETTLED:
            break
    return tau, _sums(cross, tau, omega, step)[0]


@_inlined
def _two_peaks(c):
    """Places of the two highest peaks, and their height ratio."""
    at = 0
    for i in range(len(c)):
        if c[i] > c[at]:
            at = i
    best, second, second_at = c[at], -np.inf, 1
    for i in range(1, len(c) - 1):
        if c[i] >= c[i - 1] and c[i] > c[i + 1]:
            height = c[i] - 0.125 * (c[i - 1] - c[i + 1]) ** 2 / (c[i - 1] - 2.0 * c[i] + c[i + 1])
            if i == at:
                best = height
            elif height > second:
                second, second_at = height, i
    if second == -np.inf:
        return at, 1, 0.0
    return at, second_at, max(second / best, 0.0)


@_inlined
def _autocorrelation(autocorrelation, lag):
    place = min(max(lag * FINE + len(autocorrelation) // 2, 0.0), len(autocorrelation) - 1.001)
    index = int(place)
    return autocorrelation[index] + (autocorrelation[index + 1] - autocorrelation[index]) * (place - index)


@_inlined
def _noise(spectrum, tau, amplitude, template, weight, omega, step, scale):
    """Sums of W^2 |S|^2 N, plain and by omega squared: N of the residual under a Hann window, edges repeated."""
    turn, on = complex(np.cos(omega * tau), np.sin(omega * tau)), complex(np.cos(step * tau), np.sin(step * tau))
    count = len(template)
    current = spectrum[0] * turn - amplitude * template[0]
    previous = current
    plain, squared = 0.0, 0.0
    for k in range(count):
        following = current
        if k + 1 < count:
            turn *= on
            following = spectrum[k + 1] * turn - amplitude * template[k + 1]
        r = 0.5 * current - 0.25 * (previous + following)
        s = template[k]
        line = weight[k] ** 2 * (s.real**2 + s.imag**2) * scale * (r.real**2 + r.imag**2)
        w = omega + k * step
        plain += line
        squared += line * w * w
        previous, current = current, following
    return plain, squared


@_inlined
def _amplitude(spectrum, tau, template, used, omega, step):
    turn, on = complex(np.cos(omega * tau), np.sin(omega * tau)), complex(np.cos(step * tau), np.sin(step * tau))
    product, power = 0.0, 0.0
    for k in range(len(template)):
        if used[k] > 0.0:
            x, s = spectrum[k] * turn, template[k]
            product += x.real * s.real + x.imag * s.imag
            power += s.real**2 + s.imag**2
        turn *= on
    return product / power


@_inlined
def _strongest_arrival(c, autocorrelation, start, height):
    """Amplitude of the strongest other arrival.

    It is J less the signal's autocorrelation.
    """
    place = start * FINE + len(autocorrelation) // 2
    first = int(place)
    share, strongest = place - first, 0.0
    for i in range(len(c)):
        j = first + i * FINE
        strongest = max(
            strongest, abs(c[i] / height - autocorrelation[j] - (autocorrelation[j + 1] - autocorrelation[j]) * share)
        )
    return strongest


@_compiled
def _rows(piece, ends, spectra, low, search, scale, out):
    spectrum, padded, correlation, weights = spectra
    arrivals, status = out
    omega, step, lines = (
        search.omega[0],
        search.omega[1] - search.omega[0],
        slice(search.first, search.first + len(search.omega)),
    )
    template, autocorrelation = search.template, search.autocorrelation
    for b in range(len(spectrum)):
        cross = padded[b, lines]
        c = correlation[b, low[b] : low[b] + 2 * search.half + 1] * (0.5 * search.stretch)
        at, second_at, second = _two_peaks(c)
        lag, height = _refined(cross, at + low[b], omega, step)
        if second > RIVAL and not np.isnan(lag):
            second_lag, taller = _refined(cross, second_at + low[b], omega, step)
            if taller > height:
                lag, second_at = second_lag, at
        inside = lag if not np.isnan(lag) else float(at + low[b])
        height, _, bend = _sums(cross, inside, omega, step)
        amplitude = _amplitude(spectrum[b], inside, template, search.weight, omega, step)
        plain, squared = _noise(spectrum[b], inside, amplitude, template, weights[b % len(weights)], omega, step, scale)
        snr = height**2 / (0.5 * plain)
        second = second * c[at] / height
        apart = np.inf
        if second > 0.0:
            rho = _autocorrelation(autocorrelation, second_at + low[b] - inside)
            apart = np.sqrt(snr) * (1.0 - second) / np.sqrt(2.0 * max(1.0 - rho, 1e-12))
        strongest = _strongest_arrival(c, autocorrelation, low[b] - inside, height)
        damage = _damage(piece[b], ends[0], ends[1])
        status[b] = max(damage, _judged(lag, snr, apart, strongest, search.least_snr))
        rival = second if apart < TOLD_APART and second > strongest else strongest
        arrivals[b, 0], arrivals[b, 1], arrivals[b, 2], arrivals[b, 3], arrivals[b, 4] = (
            lag,
            0.5 * squared / bend**2,
            amplitude,
            snr,
            rival,
        )
