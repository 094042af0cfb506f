"""Leakage phasor inside the instrument: subtraction, centre of a circle, remaining range error.

A leakage is one phasor, added to that of the light: its real and imaginary part are two parameters common to all shots
of a ranger, reference shots included. Covariances (2, 2) are of real and imaginary part, V^2.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import EstimationError, ValidityError

ITERATIONS = 50  # of the circle fit; it needs three to six
SETTLED = 1e-10  # of the radius: the last step of the circle fit
WORST_CONDITION = 1e7  # of the circle fit: that of an arc of two milliradians

Phasors = NDArray[np.complex128]


def subtract_leakage(phasor: ArrayLike, leakage_amplitude: ArrayLike, leakage_phase: ArrayLike) -> Phasors:
    """Phasor of the light alone, V.

    phasor               V, complex, as detected: light plus leakage
    leakage_amplitude    V, at least 0, measured with the beam blocked
    leakage_phase        rad, any, in the phase frame of the converter

    Source: [PARKER04] sec. 5.2.1 and figure 2.4 (the report's "leakage signal"). As good as the leakage is known.

    >>> complex(subtract_leakage(1.0 + 0.5j, 0.5, np.pi / 2)).real
    1.0
    """
    leakage = np.asarray(leakage_amplitude, dtype=float) * np.exp(1j * np.asarray(leakage_phase, dtype=float))
    return np.asarray(phasor, dtype=complex) - leakage


def polar_covariance(phasor: ArrayLike, covariance: ArrayLike) -> Array:
    """Covariance of amplitude and phase, (..., 2, 2): V^2, V rad, rad^2.

    phasor       (...) V, complex, not 0
    covariance   (..., 2, 2) V^2, of its real and imaginary part

    First order: valid where the uncertainty is a small part of the amplitude (at a fifth u_phase is 2 % more).

    >>> polar_covariance(2.0j, np.diag([4e-4, 1e-4])).round(9).tolist()
    [[0.0001, 0.0], [0.0, 0.0001]]
    """
    z = np.asarray(phasor, dtype=complex)
    amplitude = np.abs(z)
    c, s = z.real / amplitude, z.imag / amplitude
    turn = np.stack([np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1) / amplitude[..., None]], axis=-2)
    return turn @ np.asarray(covariance, dtype=float) @ np.swapaxes(turn, -1, -2)


def phase_by_leakage(light: ArrayLike, reference: ArrayLike | None = None) -> Array:
    """Derivatives of light phase by leakage parts, (..., 2) rad/V.

    light       V, complex, after the subtraction, not 0
    reference   V, complex: if given, of the phase relative to the reference's, with the same leakage

    More leakage taken out along the real axis turns a phasor A exp(i phi) by sin(phi)/A, along the imaginary axis by
    -cos(phi)/A. Where target and reference have one amplitude and phase the two cancel.

    Source: [PARKER04] sec. 5.2.1; derivative of arg(m - leakage). Exact, to first order in a change of the leakage.

    >>> phase_by_leakage(2.0j).round(12).tolist()
    [0.5, -0.0]
    """
    z = np.asarray(light, dtype=complex)
    slope = np.stack([z.imag, -z.real], axis=-1) / (np.abs(z) ** 2)[..., None]
    return slope if reference is None else slope - phase_by_leakage(reference)


def circle_leakage(phasor: ArrayLike) -> complex:
    """Leakage, V, as the centre of a circle of phasors.

    The phasors have constant amplitude and any phase.

    phasor     (n,) V, complex, of a retroreflector moved over a half wavelength or more, all as good

    The phases need not be known. An amplitude that varies with the phase by e cos(x - a) cannot be separated from a
    leakage: the rail must be aligned. The bias is of second order (a few u^2/radius on a quarter of the circle).

    Raises EstimationError where the phasors do not form a circle.

    Source: least squares of the distances from a circle, by Gauss and Newton from the algebraic fit of Kasa.

    >>> z = 0.03j + np.exp(1j * np.linspace(0.0, 5.0, 12))
    >>> round(circle_leakage(z).imag, 9)
    0.03
    """
    z = np.asarray(phasor, dtype=complex)
    if len(z) < 4:
        raise EstimationError(f"{len(z)} phasors do not determine a circle (expected at least 4)")
    point = _algebraic_circle(z)
    for _ in range(ITERATIONS):
        arm = z - complex(point[0], point[1])
        away = np.abs(arm)
        if not np.all(away > 0.0):
            break
        design = np.stack([arm.real / away, arm.imag / away, np.ones(len(z))], axis=1)
        if np.linalg.cond(design) > WORST_CONDITION:
            break
        step = np.linalg.lstsq(design, away - point[2], rcond=None)[0]
        point = point + step
        if np.max(np.abs(step)) < SETTLED * abs(point[2]):
            return complex(point[0], point[1])
    raise EstimationError("the phasors do not form a circle: move the retroreflector over more of a half wavelength")


def quadrature_range_error(noise_to_signal: ArrayLike, wavelength: ArrayLike) -> Array:
    """Range error from a disturbance in quadrature, m.

    The disturbance has the signal's own frequency.

    noise_to_signal    amplitude of the disturbance over that of the signal, 0 to 1
    wavelength         m, the modulation's group wavelength in air

    Source: [PARKER04] eq. 5.7 and 5.8, exact in quadrature. The worst of all directions is arcsin, not arctan: higher
    by one part in two million at 1:1000, by half a percent at 1:10; see `worst_range_error`.

    >>> round(float(quadrature_range_error(0.001, 0.199811)), 7)
    1.59e-05
    """
    return np.arctan(np.asarray(noise_to_signal, dtype=float)) * np.asarray(wavelength, dtype=float) / (4.0 * np.pi)


def worst_range_error(noise_to_signal: ArrayLike, wavelength: ArrayLike) -> Array:
    """Largest range error from a disturbance at any phase, m.

    The disturbance has the signal's own frequency.

    noise_to_signal    amplitude of the disturbance over that of the undisturbed signal, 0 to 1
    wavelength         m, the modulation's group wavelength in air

    The sum is turned most where it is at right angles to the disturbance: arcsin(r), the notes' 5.7 has
    arctan(r). Raises ValidityError outside 0 to 1, where the disturbance dominates the phase.

    Source: [PARKER04] eqs. 5.7 and 5.8, corrected. Exact.

    >>> round(float(worst_range_error(0.1, 0.2) / quadrature_range_error(0.1, 0.2)), 5)
    1.005
    """
    ratio = _share(noise_to_signal)
    return np.arcsin(ratio) * np.asarray(wavelength, dtype=float) / (2.0 * TWO_PI)


def rms_range_error(noise_to_signal: ArrayLike, wavelength: ArrayLike) -> Array:
    """Root mean square range error for random disturbance phase, m.

    noise_to_signal    amplitude of the disturbance over that of the undisturbed signal, 0 to 1
    wavelength         m, the modulation's group wavelength in air

    The phase error is a Fourier series with coefficients r^k/k, so that its mean square is half the dilogarithm of r^2:
    r/sqrt(2) for small r, 0.907 rad at r = 1. Raises ValidityError outside 0 to 1.

    Source: derived here; the mean is zero. Exact.

    >>> round(float(rms_range_error(0.001, 0.199811)) * 1e6, 3)
    11.243
    """
    from scipy.special import spence  # spence(1 - x) is the dilogarithm of x

    ratio = _share(noise_to_signal)
    return np.sqrt(0.5 * spence(1.0 - ratio**2)) * np.asarray(wavelength, dtype=float) / (2.0 * TWO_PI)


def _share(noise_to_signal: ArrayLike) -> Array:
    ratio = np.asarray(noise_to_signal, dtype=float)
    if np.any((ratio < 0.0) | (ratio > 1.0)):
        raise ValidityError(f"noise over signal {ratio.min():.3g} to {ratio.max():.3g} is not within 0 to 1")
    return ratio


def _algebraic_circle(z: Phasors) -> Array:
    """Centre and radius by linear least squares of |z|^2 = 2 x a + 2 y b + c, from the mean."""
    middle = z.mean()
    w = z - middle
    design = np.stack([2.0 * w.real, 2.0 * w.imag, np.ones(len(w))], axis=1)
    a, b, c = np.linalg.lstsq(design, np.abs(w) ** 2, rcond=None)[0]
    return np.array([a + middle.real, b + middle.imag, np.sqrt(max(c + a**2 + b**2, 0.0))])
