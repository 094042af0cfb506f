"""The part of the signal that never left the instrument, and what is left of it as a range error."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def subtract_leakage(
    phasor: ArrayLike, leakage_amplitude: ArrayLike, leakage_phase: ArrayLike
) -> NDArray[np.complex128]:
    """Phasor of the light alone.

    phasor               V, complex, as detected: light plus leakage
    leakage_amplitude    V, at least 0, measured with the beam blocked
    leakage_phase        rad, any, in the phase frame of the converter

    Source: [PARKER04] sec. 5.2.1 and figure 2.4 (the report's "leakage signal"). As good as the leakage is known.

    >>> complex(subtract_leakage(1.0 + 0.5j, 0.5, np.pi / 2)).real
    1.0
    """
    leakage = np.asarray(leakage_amplitude, dtype=float) * np.exp(1j * np.asarray(leakage_phase, dtype=float))
    return np.asarray(phasor, dtype=complex) - leakage


def quadrature_range_error(noise_to_signal: ArrayLike, wavelength: ArrayLike) -> NDArray[np.float64]:
    """Largest range error, in metres, from a disturbance of the signal's own frequency: the one in quadrature.

    noise_to_signal    amplitude of the disturbance over that of the signal, 0 to 1
    wavelength         m, the modulation's group wavelength in air

    Source: [PARKER04] eq. 5.7 and 5.8, exact in quadrature. The worst of all directions is arcsin, not arctan: higher
    by one part in two million at 1:1000, by half a percent at 1:10.

    >>> round(float(quadrature_range_error(0.001, 0.199811)), 7)
    1.59e-05
    """
    return np.arctan(np.asarray(noise_to_signal, dtype=float)) * np.asarray(wavelength, dtype=float) / (4.0 * np.pi)
