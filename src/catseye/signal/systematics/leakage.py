"""Leakage phasor inside the instrument: subtraction, estimation, remaining range error.

A leakage is one phasor, added to that of the light: its real and imaginary part are two parameters common to all shots
of a ranger, reference shots included. Covariances (2, 2) are of real and imaginary part, V^2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import EstimationError, ValidityError

ITERATIONS = 50  # of the circle fit; it needs three to six
SETTLED = 1e-10  # of the radius: the last step of the circle fit

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


def light_covariance(u_phasor: ArrayLike, leakage_covariance: ArrayLike) -> Array:
    """Covariance of the light's phasor, (..., 2, 2) V^2.

    It combines detection and leakage.

    u_phasor             (...) V, standard uncertainty of each quadrature of the detected phasor
    leakage_covariance   (2, 2) V^2

    >>> light_covariance(3.0, np.diag([16.0, 0.0])).tolist()
    [[25.0, 0.0], [0.0, 9.0]]
    """
    variance = np.asarray(u_phasor, dtype=float) ** 2
    return variance[..., None, None] * np.eye(2) + np.asarray(leakage_covariance, dtype=float)


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


def phase_covariance(
    light: ArrayLike, u_phasor: ArrayLike, leakage_covariance: ArrayLike, *, reference: ArrayLike | None = None
) -> Array:
    """Phase covariance of n shots sharing one leakage, (n, n) rad^2.

    light                (n,) V, complex, after the subtraction
    u_phasor             (n,) V or one number, standard uncertainty of each quadrature
    leakage_covariance   (2, 2) V^2
    reference            (n,) V, complex: if given, of the phases relative to the references'; without the references'
                         noise (see `drift_at`)

    >>> phase_covariance([1.0, 2.0], 0.0, np.diag([0.0, 4e-6])).round(12).tolist()
    [[4e-06, 2e-06], [2e-06, 1e-06]]
    """
    z = np.asarray(light, dtype=complex)
    slope = phase_by_leakage(z, reference)
    shot_variance = np.broadcast_to((np.asarray(u_phasor, dtype=float) / np.abs(z)) ** 2, z.shape)
    return np.diag(shot_variance) + slope @ np.asarray(leakage_covariance, dtype=float) @ slope.T


@dataclass(frozen=True, eq=False)
class Leakage:
    """Estimated leakage, with covariance and residuals.

    phasor               V, complex
    covariance           (2, 2) V^2, of the estimate
    covariance_in_use    (2, 2) V^2, of the leakage at another time: with its scatter between sessions if estimated
    residual             V, (n,): complex, or from the circle (above 0 outside) for a circle fit
    variance_factor      of the residuals against the given uncertainties; NaN where none were given
    degrees_of_freedom   of the covariance
    drift                test of slow drift within the sessions against white noise, standard normal without drift
                         (at 3: take more sessions, or shorter ones); NaN with fewer than 4 in each
    """

    phasor: complex
    covariance: Array
    covariance_in_use: Array
    residual: NDArray[np.generic]
    variance_factor: float
    degrees_of_freedom: int
    drift: float = float("nan")


def blocked_leakage(phasor: ArrayLike, session: ArrayLike | None = None) -> Leakage:
    """Leakage from buffers with the beam blocked.

    Mean of the session means, with their scatter.

    phasor    (n,) V, complex, in order of time
    session   (n,) label of each buffer's session; by default one session

    With several sessions the uncertainty is their means' scatter, whatever drifts within or between them; a later
    leakage has that scatter in addition (slightly too much: it includes the noise of a session's mean). With one
    session it is the buffers' scatter, valid only where `drift` is insignificant, and not for other times.

    Raises ValidityError for a phasor that is not finite, EstimationError for fewer than 3 sessions, or 3 buffers in one
    session: a (2, 2) scatter needs that.

    Source: [JCGM100] 4.2.3, standard uncertainty of a mean; drift by the ratio of successive differences.
    Unbiased for sessions of any sizes.

    >>> complex(np.round(blocked_leakage([0.1 + 0.2j, 0.1 + 0.4j, 0.4 + 0.3j]).phasor, 3))
    (0.2+0.3j)
    """
    z = np.asarray(phasor, dtype=complex)
    _expect_readings(z, np.ones(()))
    labels = np.zeros(len(z), dtype=int) if session is None else np.unique(np.asarray(session), return_inverse=True)[1]
    count = int(labels.max()) + 1 if len(z) else 0
    means = np.array([z[labels == k].mean() for k in range(count)])
    units = means if count > 1 else z
    if len(units) < 3:
        what = f"{count} sessions" if count > 1 else f"{len(z)} buffers in one session"
        raise EstimationError(f"{what} do not determine the scatter of a leakage (expected at least 3)")
    scatter = np.cov(np.stack([units.real, units.imag]))
    covariance = scatter / len(units)
    return Leakage(
        phasor=complex(units.mean()),
        covariance=covariance,
        covariance_in_use=scatter + covariance if count > 1 else covariance,
        residual=z - units.mean(),
        variance_factor=float("nan"),
        degrees_of_freedom=len(units) - 1,
        drift=_drift(z, labels, count),
    )


def circle_leakage(phasor: ArrayLike, u_phasor: ArrayLike) -> Leakage:
    """Leakage as the centre of a circle of phasors.

    The phasors have constant amplitude and any phase.

    phasor     (n,) V, complex, of a retroreflector moved over a half wavelength or more
    u_phasor   V, standard uncertainty of each quadrature, (n,) or one number, above 0

    The phases need not be known. An amplitude that varies with the phase by e cos(x - a) cannot be separated from a
    leakage: the rail must be aligned. On a short arc centre and radius are correlated, as the covariance shows. It is
    of first order; the bias is of second order (a few u^2/radius on a quarter of the circle).

    Raises ValidityError for invalid phasors or uncertainties, EstimationError where the phasors do not form a circle.

    Source: least squares of the distances from a circle, by Gauss and Newton from the algebraic fit of Kasa.

    >>> z = 0.03j + np.exp(1j * np.linspace(0.0, 5.0, 12))
    >>> round(circle_leakage(z, 1e-3).phasor.imag, 9)
    0.03
    """
    z, u = np.asarray(phasor, dtype=complex), np.asarray(u_phasor, dtype=float)
    _expect_readings(z, u)
    if len(z) < 4:
        raise EstimationError(f"{len(z)} phasors do not determine a circle (expected at least 4)")
    u = np.broadcast_to(u, z.shape)
    point = _algebraic_circle(z)
    for _ in range(ITERATIONS):
        arm = z - complex(point[0], point[1])
        away = np.abs(arm)
        if not np.all(away > 0.0):
            break
        design = np.stack([arm.real / away, arm.imag / away, np.ones(len(z))], axis=1) / u[:, None]
        if np.linalg.cond(design) > 1e8:
            break
        step = np.linalg.lstsq(design, (away - point[2]) / u, rcond=None)[0]
        point = point + step
        if np.max(np.abs(step)) < SETTLED * abs(point[2]):
            covariance = np.linalg.inv(design.T @ design)
            if np.sqrt(np.trace(covariance[:2, :2])) > abs(point[2]):
                break
            residual = np.abs(z - complex(point[0], point[1])) - point[2]
            degrees = len(z) - 3
            factor = float(np.sum((residual / u) ** 2)) / degrees
            centre = covariance[:2, :2]
            return Leakage(
                phasor=complex(point[0], point[1]),
                covariance=centre,
                covariance_in_use=centre,
                residual=residual,
                variance_factor=factor,
                degrees_of_freedom=degrees,
            )
    raise EstimationError("the phasors do not form a circle: move the retroreflector over more of a half wavelength")


def rail_leakage(
    phasor: ArrayLike, phase: ArrayLike, u_phasor: ArrayLike, *, fading: ArrayLike | None = None
) -> Leakage:
    """Leakage from phasors on a rail measured by interferometer.

    The phase is known but for a constant.

    phasor     (n,) V, complex
    phase      (n,) rad, -4 pi n_g f D/c of the retroreflector, falling with distance; the constant is free
    u_phasor   V, standard uncertainty of each quadrature, (n,) or one number, above 0
    fading     (n,) along which the amplitude may vary in a line (the distance, the time); by default it is constant

    Solves phasor = leakage + (g + h fading) exp(i phase) for three complex numbers: linear, and unlike the circle not
    biased by a misaligned rail. A phase with the wrong sign gives a variance factor far from 1.

    Raises ValidityError for invalid phasors or uncertainties, EstimationError where the phases do not separate
    leakage from light.

    Source: complex least squares with circular noise, [FOERSTNER16] chapter 4. Exact for the model.

    >>> turn = -np.linspace(0.0, 5.0, 12)
    >>> round(rail_leakage(0.03j + 2.0 * np.exp(1j * (turn + 0.7)), turn, 1e-3).phasor.imag, 9)
    0.03
    """
    z, u = np.asarray(phasor, dtype=complex), np.asarray(u_phasor, dtype=float)
    _expect_readings(z, u)
    u = np.broadcast_to(u, z.shape)
    turning = np.exp(1j * np.asarray(phase, dtype=float))
    columns = [np.ones_like(z), turning]
    if fading is not None:
        along = np.asarray(fading, dtype=float)
        columns.append(turning * (along - along.mean()) / max(float(np.ptp(along)), np.finfo(float).tiny))
    design = np.stack(columns, axis=1) / u[:, None]
    if len(z) <= len(columns) or np.linalg.cond(design * u.mean()) > 1e6:
        raise EstimationError(f"{len(z)} phasors do not separate leakage from light: move the retroreflector further")
    inverse = np.linalg.pinv(design)
    residual = z - (design * u[:, None]) @ (inverse @ (z / u))
    covariance = float(np.sum(np.abs(inverse[0]) ** 2)) * np.eye(2)
    degrees = 2 * (len(z) - len(columns))
    factor = float(np.sum(np.abs(residual / u) ** 2)) / degrees
    return Leakage(
        phasor=complex(inverse[0] @ (z / u)),
        covariance=covariance,
        covariance_in_use=covariance,
        residual=residual,
        variance_factor=factor,
        degrees_of_freedom=degrees,
    )


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


def _expect_readings(z: Phasors, u: Array) -> None:
    if not np.all(np.isfinite(z)):
        where = int(np.flatnonzero(~np.isfinite(z))[0])
        raise ValidityError(f"phasor {where} is {z[where]} V (expected finite numbers: leave that buffer out)")
    if not (np.all(u > 0.0) and np.all(np.isfinite(u))):
        raise ValidityError(f"standard uncertainty {np.min(u)} V of a phasor is not above 0 and finite")


def _algebraic_circle(z: Phasors) -> Array:
    """Centre and radius by linear least squares of |z|^2 = 2 x a + 2 y b + c, from the mean."""
    middle = z.mean()
    w = z - middle
    design = np.stack([2.0 * w.real, 2.0 * w.imag, np.ones(len(w))], axis=1)
    a, b, c = np.linalg.lstsq(design, np.abs(w) ** 2, rcond=None)[0]
    return np.array([a + middle.real, b + middle.imag, np.sqrt(max(c + a**2 + b**2, 0.0))])


def _drift(z: Phasors, labels: NDArray[np.int64], count: int) -> float:
    """Drift test of all sessions: 1 less the von Neumann ratio, over its sigma for white circular noise."""
    steps = squares = variance = 0.0
    for k in range(count):
        phasors = z[labels == k]
        n = len(phasors)
        if n < 4:
            continue
        spread = float(np.sum(np.abs(phasors - phasors.mean()) ** 2))
        steps += 0.5 * float(np.sum(np.abs(np.diff(phasors)) ** 2))
        squares += spread
        variance += spread**2 * (n - 2.0) / (2.0 * (n**2 - 1.0))
    return (squares - steps) / np.sqrt(variance) if variance > 0.0 else float("nan")
