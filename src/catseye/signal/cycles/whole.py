"""Phase to length: fraction, whole cycles and their margin.

Phase falls as distance grows. The notes print eq. 5.14 and 5.17 with the wrong sign before 2 pi (n_i - n_0); eq. 5.12,
5.15 and 5.18, used here, are right.

The law of the nearest integer: no slip whenever the coarse length's error plus five standard uncertainties of the
phase, as a length, stay under a quarter wavelength, 49.95 mm at 1500 MHz (half of the half wavelength, 99.9 mm).
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import TWO_PI
from catseye.errors import ValidityError


def fraction(phase_target: ArrayLike, phase_reference: ArrayLike) -> NDArray[np.float64]:
    """Phase of a target relative to its reference, rad in [0, 2 pi).

    phase_target       rad, any
    phase_reference    rad, any: the phase of the internal reference (ZRG) at the same instant

    Source: [PARKER04] eq. 5.13. Exact; a difference just below zero that rounds to 2 pi becomes 0.

    >>> round(float(fraction(0.5, 1.0)), 6)
    5.783185
    """
    wrapped = np.mod(np.subtract(phase_target, phase_reference, dtype=float), TWO_PI)
    return np.where(wrapped >= TWO_PI, 0.0, wrapped)


def whole_cycles(
    coarse_optical: ArrayLike, phase_fraction: ArrayLike, half_wavelength: ArrayLike
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Whole half wavelengths N of a coarse length, with margin, m.

    coarse_optical     m, any: approximate distance - D0 - Pc - dPc, a length in the sense of (N - phi/2pi) lambda/2
    phase_fraction     rad, [0, 2 pi), from `fraction`
    half_wavelength    m, above 0: half the modulation's group wavelength in the air of the path

    The margin, 0 to a quarter wavelength, is the further error of the coarse length at which N changes: a quarter
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
    """Length of N whole half wavelengths less the phase fraction, m.

    D = this + D0 + Pc + dPc.

    whole_cycles       N, from the function of that name
    phase_fraction     rad, [0, 2 pi), from `fraction`
    half_wavelength    m, above 0: half the modulation's group wavelength in the air of the path

    Source: [PARKER04] eq. 5.18 (5.14 and 5.17 carry a wrong sign). Exact.

    >>> round(float(unwrapped_length(100, 0.5, 0.1)), 6)
    9.992042
    """
    cycles = np.asarray(whole_cycles) - np.asarray(phase_fraction, dtype=float) / TWO_PI
    return cycles * np.asarray(half_wavelength, dtype=float)


def glass_phase(range_constant: ArrayLike, half_wavelength: ArrayLike) -> NDArray[np.float64]:
    """Glass calibration offset phi_ic of the notes, rad, not wrapped.

    range_constant     Pc, m, negative or 0: added to the measured length
    half_wavelength    m, above 0: half the modulation's group wavelength in air

    5.19 takes phi_ic/2 pi from N - phi/2 pi, so that Pc = -phi_ic/2 pi half: light delayed by glass
    has a lower phase, and phi_ic is the deficit. The length Pc does not change with the air; phi_ic does.

    Source: [PARKER04] eq. 5.19. Exact.

    >>> round(float(glass_phase(-0.0334937, 0.099906)), 6)
    2.106451
    """
    half = np.asarray(half_wavelength, dtype=float)
    if np.any(half <= 0.0):
        raise ValidityError(f"half wavelength {float(half.min())} m is not above 0")
    return -TWO_PI * np.asarray(range_constant, dtype=float) / half


class CycleStatus(IntEnum):
    """Status of a shot's whole cycles.

    SURE; THIN: another number is possible; UNKNOWN: no input.
    """

    SURE = 0
    THIN = 1
    UNKNOWN = 2


@dataclass(frozen=True, eq=False)
class CycleDecision:
    """Whole cycles with margin and slip probability, one value a shot.

    cycles             N, the nearest integer; 0 where unknown
    margin             m, further error of the coarse length at which N changes
    misfit             m, coarse length minus the length that N gives
    u                  m, standard uncertainty of the misfit: coarse length and phase
    slip_probability   probability that N is another integer, see `slip_probability`
    status             int8 of `CycleStatus`
    """

    cycles: NDArray[np.int64]
    margin: NDArray[np.float64]
    misfit: NDArray[np.float64]
    u: NDArray[np.float64]
    slip_probability: NDArray[np.float64]
    status: NDArray[np.int8]

    @property
    def thin(self) -> NDArray[np.bool_]:
        """True where another number of cycles is possible."""
        return self.status == CycleStatus.THIN


def decision(
    coarse_optical: ArrayLike,
    phase_fraction: ArrayLike,
    half_wavelength: ArrayLike,
    *,
    u_coarse: ArrayLike,
    u_phase: ArrayLike,
    sigmas: float = 5.0,
) -> CycleDecision:
    """Whole cycles by the nearest integer, with margin status.

    coarse_optical     m, as for `whole_cycles`
    phase_fraction     rad, [0, 2 pi), from `fraction`
    half_wavelength    m, above 0
    u_coarse           m, standard uncertainty of the coarse length, not negative
    u_phase            rad, of the phase difference, not negative
    sigmas             standard uncertainties of the misfit that must fit into the margin

    With u combining both: SURE while |misfit| + 5 u stays under a quarter wavelength, else THIN. A coarse error e
    with |e| + 5 u_phase half / 2 pi under a quarter wavelength never slips, whatever u_coarse claims. A shot with an
    input that is not finite is UNKNOWN and affects no other. Raises ValidityError for a negative uncertainty or a half
    wavelength that is not above 0.

    Source: [PARKER04] eq. 5.18 solved for N; the two uncertainties combined by [JCGM100] eq. 10.

    >>> d = decision([10.02, 10.02], 0.5, 0.1, u_coarse=[0.004, 0.006], u_phase=0.001)
    >>> d.cycles.tolist(), d.thin.tolist(), round(float(d.misfit[0]), 6)
    ([100, 100], [False, True], 0.027958)
    """
    half = np.asarray(half_wavelength, dtype=float)
    u_length = np.asarray(u_phase, dtype=float) * half / TWO_PI
    for name, value in (("u_coarse", u_coarse), ("u_phase", u_phase)):
        if np.any(np.asarray(value) < 0.0):
            raise ValidityError(f"{name} = {float(np.min(value))} is negative: a standard uncertainty cannot be")
    cycles, margin = whole_cycles(coarse_optical, phase_fraction, half)
    misfit = np.asarray(coarse_optical, dtype=float) - unwrapped_length(cycles, phase_fraction, half)
    u = np.hypot(np.asarray(u_coarse, dtype=float), u_length)
    cycles, margin, misfit, u, quarter = np.broadcast_arrays(cycles, margin, misfit, u, 0.5 * half)
    finite = np.isfinite(misfit) & np.isfinite(u)
    with np.errstate(invalid="ignore"):
        thin = np.abs(misfit) + sigmas * u >= quarter
    status = np.where(finite, np.where(thin, CycleStatus.THIN, CycleStatus.SURE), CycleStatus.UNKNOWN)
    slip = np.where(
        finite, slip_probability(np.where(finite, misfit, 0.0), np.where(finite, u, 0.0), 2 * quarter), np.nan
    )
    return CycleDecision(
        cycles=cycles, margin=margin, misfit=misfit, u=u, slip_probability=slip, status=status.astype(np.int8)
    )


def slip_probability(misfit: ArrayLike, u: ArrayLike, half_wavelength: ArrayLike) -> NDArray[np.float64]:
    """Probability that the nearest integer is wrong, given the misfit.

    misfit             m, coarse minus unwrapped length, within half a `half_wavelength` of 0
    u                  m, standard uncertainty of the misfit, normal
    half_wavelength    m, above 0

    A priori all integers are equally likely: with L the half wavelength, the weights are exp(-(misfit + k L)^2 / 2 u^2)
    over all whole k, and all but k = 0 are a slip. Before a misfit is seen the probability is erfc(L / (2 sqrt 2 u)):
    the mean of this one. Beyond u = L the sum over k turns into its Fourier series (Poisson), which then needs two
    terms.

    Source: Bayes' theorem with the normal law; our own.

    >>> [float(f"{slip_probability(0.0, u, 0.1):.1e}") for u in (0.01, 0.02, 0.05)]
    [3.9e-22, 7.5e-06, 0.21]
    """
    m, s, period = (np.asarray(v, dtype=float) for v in (misfit, u, half_wavelength))
    m, s, period = np.broadcast_arrays(m, s, period)
    k = np.concatenate([np.arange(-8, 0), np.arange(1, 9)])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        narrow = np.minimum(s, period)[..., None]
        excess = k * period[..., None] * (2.0 * m[..., None] + k * period[..., None])  # (m + kL)^2 - m^2, never below 0
        alternatives = np.sum(np.where(narrow > 0.0, np.exp(-0.5 * excess / narrow**2), 1.0 * (excess <= 0.0)), axis=-1)
        few = alternatives / (1.0 + alternatives)
        turn = TWO_PI / period
        waves = sum(2.0 * np.exp(-0.5 * (j * turn * s) ** 2) * np.cos(j * turn * m) for j in (1, 2))
        many = 1.0 - period * np.exp(-0.5 * (m / s) ** 2) / (s * np.sqrt(TWO_PI) * (1.0 + waves))
    return np.where(s > period, many, few)


def memo_whole_cycles(
    coarse_optical: ArrayLike, phase_after_reference: ArrayLike, half_wavelength: ArrayLike
) -> NDArray[np.int64]:
    """Whole cycles by the triplet memo's rule, for comparison only.

    The rule slips.

    coarse_optical          m, at least 0: D_TOPPL - Pc
    phase_after_reference   rad, above -2 pi and below 2 pi: Phi - (Phi_ZRG + Phi_Cal), not taken modulo 2 pi
    half_wavelength         m, above 0

    N = INT(coarse / half), plus one where Phi is above Phi_ZRG + Phi_Cal; D = (N - Phi_after/2 pi) half + Pc, so this
    N may differ from ours by one without a slip where phase_after_reference is negative. The rule needs a coarse
    length on the same side of every multiple of the half wavelength as the true one: where D_TOPPL is shorter by d, a
    share d / half of all placements slips by one half wavelength, 2.8 % for the memo's 2.8 mm at 18 m. The memo's
    closed forms (3.11a, 3.15b, second 3.16) write the one as (1 - sgn)/2, which at equal phases is a half: 3.13a and
    3.16a, followed here, give none. Raises ValidityError for values outside those limits; an input that is not finite
    gives 0.

    Source: [GOLDMAN00] eqs. 3.13 and 3.16 (first of that number), with 3.4 and 3.5 for the limits.

    >>> memo_whole_cycles([10.02, 9.98], 2.0, 0.1).tolist()  # the same phase, the coarse length 40 mm shorter
    [101, 100]
    """
    half, phase, coarse = (np.asarray(v, dtype=float) for v in (half_wavelength, phase_after_reference, coarse_optical))
    if np.any(half <= 0.0):
        raise ValidityError(f"half wavelength {float(half.min())} m is not above 0")
    if np.any(np.abs(phase) >= TWO_PI):
        raise ValidityError(f"phase after reference {float(phase.flat[np.argmax(np.abs(phase))])} rad: -2 pi to 2 pi")
    if np.any(coarse < 0.0):
        raise ValidityError(f"coarse length {float(np.min(coarse))} m is negative: INT would round it upwards")
    cycles = np.trunc(coarse / half) + (phase > 0.0)
    return np.where(np.isfinite(cycles + phase), cycles, 0.0).astype(np.int64)
