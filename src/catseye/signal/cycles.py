"""From a phase to a length: the fraction of a cycle, the whole cycles, and how near the wrong decision was.

Phase falls as distance grows. The notes print eq. 5.14 and 5.17 with the wrong sign before 2 pi (n_i - n_0); eq. 5.12,
5.15 and 5.18, used here, are right.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import TWO_PI
from catseye.errors import ValidityError


def fraction(phase_target: ArrayLike, phase_reference: ArrayLike) -> NDArray[np.float64]:
    """Phase of a target after its reference, in [0, 2 pi).

    phase_target       rad, any
    phase_reference    rad, any: the phase of the internal reference (ZRG) at the same instant

    Source: [PARKER04] eq. 5.13. Exact; a difference so little below zero that it rounds to 2 pi becomes 0.

    >>> round(float(fraction(0.5, 1.0)), 6)
    5.783185
    """
    wrapped = np.mod(np.subtract(phase_target, phase_reference, dtype=float), TWO_PI)
    return np.where(wrapped >= TWO_PI, 0.0, wrapped)


def whole_cycles(
    coarse_optical: ArrayLike, phase_fraction: ArrayLike, half_wavelength: ArrayLike
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Number of whole half wavelengths N in a coarse length, and the margin of that decision in metres.

    coarse_optical     m, any: approximate distance - D0 - Pc - dPc, a length in the sense of (N - phi/2pi) lambda/2
    phase_fraction     rad, [0, 2 pi), from `fraction`
    half_wavelength    m, above 0: half the modulation's group wavelength in the air of the path

    The margin, 0 to a quarter wavelength, is how much further the coarse length may be off before N changes: a quarter
    wavelength minus the misfit. Any coarse length within a quarter wavelength of the truth gives the right N. Where an
    input is not finite N is 0 and the margin NaN.

    Source: [PARKER04] eq. 5.18 solved for N (5.14 and 5.17 carry a wrong sign), rounded to the nearest integer.
    [GOLDMAN00] eq. 3.13 and 3.16 take INT of the coarse length and add one by the sign of the phase, which slips by one
    when truth and coarse length lie on two sides of an integer: 99.9 mm, in about 3 % of the memo's placements.

    >>> n, margin = whole_cycles(10.02, 0.5, 0.1)
    >>> int(n), round(float(margin), 6)
    (100, 0.022042)
    """
    half = np.asarray(half_wavelength, dtype=float)
    if np.any(half <= 0.0):
        raise ValidityError(f"half wavelength {float(half.min())} m is not above 0")
    cycles = np.asarray(coarse_optical, dtype=float) / half + np.asarray(phase_fraction, dtype=float) / TWO_PI
    finite = np.isfinite(cycles)
    nearest = np.rint(np.where(finite, cycles, 0.0))
    margin = (0.5 - np.abs(np.where(finite, cycles - nearest, np.nan))) * half
    return nearest.astype(np.int64), margin


def unwrapped_length(
    whole_cycles: ArrayLike, phase_fraction: ArrayLike, half_wavelength: ArrayLike
) -> NDArray[np.float64]:
    """Length of N whole half wavelengths less the phase's fraction, in metres; D = this + D0 + Pc + dPc.

    whole_cycles       N, from the function of that name
    phase_fraction     rad, [0, 2 pi), from `fraction`
    half_wavelength    m, above 0: half the modulation's group wavelength in the air of the path

    Source: [PARKER04] eq. 5.18 (5.14 and 5.17 carry a wrong sign). Exact.

    >>> round(float(unwrapped_length(100, 0.5, 0.1)), 6)
    9.992042
    """
    cycles = np.asarray(whole_cycles) - np.asarray(phase_fraction, dtype=float) / TWO_PI
    return cycles * np.asarray(half_wavelength, dtype=float)
