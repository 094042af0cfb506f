"""Distortion of a locked signal: harmonics, their limit, and their effect on the phase.

The orders that n samples a cycle resolve do not enter the fundamental at all (`phase`): only those next to a multiple
of n do, and these cannot be seen apart from it. The resolved ones tell how far the waveform is from a sine, and from
that how large the others may be. A wave with kinks, as clipping makes, has harmonics that fall as 1/k^2, so that those
next to multiples of n turn the phase by at most about (4/n^2) max(4 h_2, 9 h_3), h_k = B_k/A. For one kink or two, at
any phase, with 16 samples a cycle or more, the bound holds where the clipping leaves a fifth of the amplitude and makes
one of the two larger than 0.3 %.

The limit of 2 %: such a wave then turns the phase by at most 0.18 mrad with 64 samples a cycle, 2.8 um of range, a
quarter of a usual shot's noise of 0.75 mrad. Beyond it, in a memoryless curve y = x + a x^2 + b x^3, a third harmonic
of 2 % means that the amplitude reads 6 % small (3 B_3/A): the head is not linear, and what was calibrated where it is,
leakage and coupling of amplitude to phase, no longer holds.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError

DISTORTED = 0.02  # of the fundamental: the reason stands above
NEWTON_STEPS = 12  # each squares the error
SURE = 4.0  # standard uncertainties by which a harmonic exceeds it: noise alone does so once in 3000, at no limit


def relative_harmonics(
    harmonics: ArrayLike, amplitude: ArrayLike, u_phasor: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Harmonics over the fundamental (..., h), and their standard uncertainty (...).

    harmonics   (..., h) V, amplitudes
    amplitude   (...) V, of the fundamental
    u_phasor    (...) V, of each quadrature; that of a harmonic is the same in white noise

    NaN without a fundamental.

    >>> relative, u = relative_harmonics([0.03, 0.06], 2.0, 0.002)
    >>> relative.tolist(), float(u)
    ([0.015, 0.03], 0.001)
    """
    size = np.asarray(amplitude, dtype=float)
    size = np.where(size > 0.0, size, np.nan)
    return np.asarray(harmonics, dtype=float) / size[..., None], np.asarray(u_phasor, dtype=float) / size


def distorted(relative: ArrayLike, u: ArrayLike) -> NDArray[np.bool_]:
    """True (...) where a harmonic exceeds DISTORTED by SURE standard uncertainties.

    relative   (..., h) and
    u          (...) from `relative_harmonics`; where one is not finite the answer is False

    >>> distorted([[0.03, 0.001], [0.022, 0.001]], [0.001, 0.001]).tolist()
    [True, False]
    """
    h, spread = np.asarray(relative, dtype=float), np.asarray(u, dtype=float)[..., None]
    with np.errstate(invalid="ignore"):
        return np.any(h - SURE * spread > DISTORTED, axis=-1)


def kinked_bound(second: ArrayLike, third: ArrayLike, samples_per_cycle: ArrayLike) -> NDArray[np.float64]:
    """Phase error of a clipped wave by harmonics that fold back, rad: a bound.

    second, third       harmonics over the fundamental
    samples_per_cycle   n, 16 or more

    Source: derived at the top of this file; compared with exact clipping in the tests.

    >>> f"{float(kinked_bound(0.0, 0.02, 64)):.2e}"
    '1.76e-04'
    """
    n = np.asarray(samples_per_cycle, dtype=float)
    steep = np.maximum(4.0 * np.asarray(second, dtype=float), 9.0 * np.asarray(third, dtype=float))
    return 4.0 * steep / n**2


def folded_error(order: int, relative: ArrayLike, samples_per_cycle: int) -> NDArray[np.float64]:
    """Largest phase error by one harmonic, rad, of synchronous detection.

    order               k, at least 2
    relative            amplitude over the fundamental
    samples_per_cycle   n

    Zero unless n divides k - 1 or k + 1; then arcsin of the ratio, pi where the harmonic is the stronger.

    Source: [PARKER04] eq. 5.1 and 5.2, summed over whole cycles. Exact.

    >>> [round(float(folded_error(k, 0.01, 64)), 6) for k in (2, 3, 63, 65)]
    [0.0, 0.0, 0.01, 0.01]
    """
    if order < 2 or samples_per_cycle < 3:
        raise ValidityError(
            f"harmonic {order} of {samples_per_cycle} samples a cycle: expected at least 2 of at least 3"
        )
    h = np.asarray(relative, dtype=float)
    if order % samples_per_cycle not in (1, samples_per_cycle - 1):
        return np.zeros_like(h)
    return np.where(h < 1.0, np.arcsin(np.minimum(h, 1.0)), np.pi)


def crossing_shift(phasor: complex, overtones: Sequence[complex], orders: Sequence[int]) -> tuple[float, float]:
    """Shift of a phase by zero crossings due to harmonics, rad, and its standard uncertainty.

    phasor      V, complex: the fundamental A exp(i phi)
    overtones   V, complex: B_k exp(i psi_k) of the orders k
    orders      k

    Each edge lies where fundamental and harmonics sum to zero, to first order the harmonics' sum at phi -+ pi/2 over
    the slope A away from there; the phase is the mean of both, in which even orders cancel to first order. Solved by
    Newton's method; the uncertainty is for orders left out, by the last two. NaN where an edge is not found within a
    quarter cycle: the wave has others.

    Source: [PARKER04] section 5.2, first paragraph; derived in `zero_crossing`. Exact for these orders.

    >>> shift, u = crossing_shift(1.0, [0.05j, 0.01j], [2, 3])  # sin 2x and sin 3x beside cos x
    >>> round(shift, 4), u < 0.03  # of sin 3x alone -0.01
    (-0.0101, True)
    """
    size, phase = abs(phasor), float(np.angle(phasor))
    if not size > 0.0:
        return float("nan"), float("nan")
    wave, k = np.asarray(overtones, dtype=complex), np.asarray(orders, dtype=float)
    finite = np.isfinite(wave)
    wave, k = np.append(wave[finite], phasor).conj() / size, np.append(k[finite], 1.0)
    starts = phase + np.array([-np.pi / 2, np.pi / 2])
    edges = starts.copy()
    for _ in range(NEWTON_STEPS):
        turned = wave * np.exp(1j * edges[:, None] * k)
        with np.errstate(divide="ignore", invalid="ignore"):
            edges = edges - np.sum(turned.real, axis=1) / np.sum(-k * turned.imag, axis=1)
    if not np.all(np.abs(edges - starts) < np.pi / 2):
        return float("nan"), float("nan")
    left_out = float(np.max(np.abs(wave[:-1][-2:]), initial=0.0))
    return float(np.mean(edges - starts)), left_out / float(np.sqrt(3.0))
