"""Amplitude-to-phase coupling of the electronics.

[PARKER04] chapter 6, item 5, warns of it (non-linear capacitors). The model is a line in the logarithm of amplitude: a
capacitance that follows the signal's level by a power law, or a limiter's delay, does so over a decade or two. The
model is tested, not assumed: see `reduction.calibrations.ranging.amplitude`.
"""

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import ValidityError


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

    Source: [PARKER04] chapter 6, item 5, names the effect without a formula; a model.

    >>> round(float(amplitude_phase(np.e, 1.0, 1e-3)), 12)
    0.001
    """
    level = _log_level(amplitude, reference_amplitude)
    return np.asarray(coefficient, dtype=float) * level + np.asarray(quadratic, dtype=float) * level**2


def amplitude_by_coefficient(amplitude: ArrayLike, reference_amplitude: ArrayLike) -> Array:
    """Derivatives (..., 2) of `amplitude_phase` by coefficient and by quadratic.

    amplitude, reference_amplitude   V, above 0

    >>> amplitude_by_coefficient(1.0, 1.0).tolist()
    [0.0, 0.0]
    """
    level = _log_level(amplitude, reference_amplitude)
    return np.stack([level, level**2], axis=-1)


def _log_level(amplitude: ArrayLike, reference_amplitude: ArrayLike) -> Array:
    a, reference = np.asarray(amplitude, dtype=float), np.asarray(reference_amplitude, dtype=float)
    for name, value in (("amplitude", a), ("reference amplitude", reference)):
        if np.any(value <= 0.0):
            raise ValidityError(f"{name} {float(np.min(value))} V is not above 0: a shot without return has no phase")
    return np.log(a / reference)
