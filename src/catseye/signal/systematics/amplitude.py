"""Amplitude-to-phase coupling of the electronics.

[PARKER04] chapter 6, item 5, warns of it (non-linear capacitors). The model is a line in the logarithm of amplitude: a
capacitance that follows the signal's level by a power law, or a limiter's delay, does so over a decade or two. The
model is tested, not assumed: see `AmplitudeFit.probability`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import EstimationError, ValidityError
from catseye.signal.systematics.columns import LinearFit, fit_columns


def amplitude_phase(
    amplitude: ArrayLike, reference_amplitude: ArrayLike, coefficient: ArrayLike, *, quadratic: ArrayLike = 0.0
) -> Array:
    """Phase added by the electronics at an amplitude, rad.

    It is coefficient ln(a) + quadratic ln(a)^2.

    amplitude             V, above 0; a = amplitude / reference_amplitude
    reference_amplitude   V, above 0: where the phase added is 0
    coefficient           rad a factor e of amplitude
    quadratic             rad a factor e squared

    A phase read too high is a range read too short. Raises ValidityError for an amplitude that is not above 0.

    Source: [PARKER04] chapter 6, item 5, names the effect without a formula; a model. The inverse is exact.

    >>> round(float(amplitude_phase(np.e, 1.0, 1e-3)), 12)
    0.001
    """
    level = _log_level(amplitude, reference_amplitude)
    return np.asarray(coefficient, dtype=float) * level + np.asarray(quadratic, dtype=float) * level**2


def remove_amplitude_phase(
    phase: ArrayLike,
    amplitude: ArrayLike,
    reference_amplitude: ArrayLike,
    *,
    coefficient: ArrayLike,
    quadratic: ArrayLike = 0.0,
) -> Array:
    """Phase corrected to the reference amplitude, rad; not wrapped.

    phase   rad, as measured; the others as for `amplitude_phase`

    >>> round(float(remove_amplitude_phase(1.0, np.e, 1.0, coefficient=1e-3)), 12)
    0.999
    """
    added = amplitude_phase(amplitude, reference_amplitude, coefficient, quadratic=quadratic)
    return np.asarray(phase, dtype=float) - added


def amplitude_by_coefficient(amplitude: ArrayLike, reference_amplitude: ArrayLike) -> Array:
    """Derivatives (..., 2) of `amplitude_phase` by coefficient and by quadratic.

    amplitude, reference_amplitude   V, above 0

    >>> amplitude_by_coefficient(1.0, 1.0).tolist()
    [0.0, 0.0]
    """
    level = _log_level(amplitude, reference_amplitude)
    return np.stack([level, level**2], axis=-1)


@dataclass(frozen=True, eq=False)
class AmplitudeFit:
    """Coupling from readings of one target at several attenuations.

    coefficient   rad a factor e, with u_coefficient
    quadratic     rad a factor e squared, with u_quadratic; both 0 where it was not estimated
    phase         rad in [0, 2 pi), of the target at the reference amplitude
    covariance    (2, 2), or (3, 3) with the quadratic term: coefficient, phase, quadratic
    fit           the least-squares fit: residuals (rad), variance factor, degrees of freedom
    curvature     t of the next power of ln(amplitude), left out of the fit, with the given uncertainties
    probability   of such a t, or a larger one, where the model holds; NaN without redundancy
    """

    coefficient: float
    u_coefficient: float
    quadratic: float
    u_quadratic: float
    phase: float
    covariance: Array
    fit: LinearFit
    curvature: float
    probability: float

    def suffices(self, level: float = 0.05) -> bool | None:
        """True if no further power is significant; None if undetermined."""
        return None if np.isnan(self.probability) else bool(self.probability >= level)


def fit_amplitude_phase(
    amplitude: ArrayLike,
    phase: ArrayLike,
    u_phase: ArrayLike,
    *,
    reference_amplitude: float,
    quadratic: bool = False,
    others: ArrayLike | None = None,
) -> AmplitudeFit:
    """Fit the coupling to readings at several attenuations.

    All readings are of one fixed target.

    amplitude             (n,) V
    phase                 (n,) rad, any turn, after the electronics' drift and the leakage
    u_phase               rad, standard uncertainty: (n,), or their covariance (n, n), rad^2
    reference_amplitude   V, to which coefficient and phase refer
    quadratic             True to solve for the term in ln^2 as well
    others                (n, q) further columns (time, for a drift; the phase that a filter's glass adds)

    Phases are counted from that of the strongest reading, the shorter way round. The leakage must be subtracted
    first: a residual turns a weak phasor more and looks like coupling.

    Raises ValidityError for amplitudes not above 0, EstimationError where the attenuations do not separate the terms.

    Source: [FOERSTNER16] chapter 4; the test of one more power of the same. Exact for the model.

    >>> a = np.array([0.5, 1.0, 2.0, 4.0])
    >>> f = fit_amplitude_phase(a, 1.0 + 2e-3 * np.log(a), 1e-4, reference_amplitude=1.0)
    >>> round(f.coefficient, 9), round(f.phase, 9)
    (0.002, 1.0)
    """
    level = _log_level(amplitude, reference_amplitude)
    measured = np.asarray(phase, dtype=float)
    start = float(measured[int(np.argmax(level))])
    turned = np.angle(np.exp(1j * (measured - start)))
    columns = [level, np.ones_like(level)] + ([level**2] if quadratic else [])
    further = np.empty((len(level), 0)) if others is None else np.asarray(others, dtype=float)
    design = np.concatenate([np.stack(columns, axis=1), further], axis=1)
    fit = fit_columns(design, turned, u_phase)
    used = len(columns)
    curvature, probability = _next_power(design, level ** (3 if quadratic else 2), turned, u_phase)
    return AmplitudeFit(
        coefficient=float(fit.coefficient[0]),
        u_coefficient=float(fit.u[0]),
        quadratic=float(fit.coefficient[2]) if quadratic else 0.0,
        u_quadratic=float(fit.u[2]) if quadratic else 0.0,
        phase=float(np.mod(start + fit.coefficient[1], TWO_PI)),
        covariance=fit.covariance[:used, :used],
        fit=fit,
        curvature=curvature,
        probability=probability,
    )


def _next_power(design: Array, power: Array, turned: Array, u_phase: ArrayLike) -> tuple[float, float]:
    """Standardised coefficient t of one more column, with its two-sided normal probability.

    NaN where undefined.
    """
    from scipy.stats import norm

    try:
        longer = fit_columns(np.concatenate([design, power[:, None]], axis=1), turned, u_phase)
    except EstimationError:
        return float("nan"), float("nan")
    t = float(longer.coefficient[-1] / longer.u[-1])
    return t, float(2.0 * norm.sf(abs(t)))


def _log_level(amplitude: ArrayLike, reference_amplitude: ArrayLike) -> Array:
    a, reference = np.asarray(amplitude, dtype=float), np.asarray(reference_amplitude, dtype=float)
    for name, value in (("amplitude", a), ("reference amplitude", reference)):
        if np.any(value <= 0.0):
            raise ValidityError(f"{name} {float(np.min(value))} V is not above 0: a shot without return has no phase")
    return np.log(a / reference)
