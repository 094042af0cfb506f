"""From light on a photodiode to a signal of some amplitude, and the noise that comes with it."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

ELECTRON = 1.602176634e-19  # C, exact (SI)
BOLTZMANN = 1.380649e-23  # J/K, exact (SI)


def signal_current(power: ArrayLike, *, depth: ArrayLike, responsivity: ArrayLike) -> NDArray[np.float64]:
    """Amplitude of the photocurrent at the modulation frequency, in amperes.

    power          W, mean, on the detector
    depth          modulation depth of the light where it arrives, 0 to 1
    responsivity   A/W of the diode at that frequency

    Source: definition of the depth: P(t) = P (1 + depth cos wt). Exact.

    >>> float(signal_current(1e-3, depth=0.5, responsivity=0.5))
    0.00025
    """
    return np.asarray(power, float) * np.asarray(depth, float) * np.asarray(responsivity, float)


def noise_density(
    power: ArrayLike,
    *,
    responsivity: ArrayLike,
    background: ArrayLike = 0.0,
    dark_current: ArrayLike = 0.0,
    amplifier: ArrayLike = 0.0,
    load: ArrayLike = np.inf,
    temperature_k: ArrayLike = 293.15,
    intensity_noise_db_hz: ArrayLike = -np.inf,
) -> NDArray[np.float64]:
    """One-sided density of the detector's noise current about the modulation frequency, in A^2/Hz.

    power, background       W on the detector: the laser's, and daylight's
    responsivity            A/W
    dark_current            A
    amplifier               A/sqrt(Hz), input noise of the amplifier, referred to the diode
    load                    ohm, resistance whose thermal noise counts (infinite: in the amplifier's figure)
    temperature_k           K, of the load
    intensity_noise_db_hz   dB/Hz, the laser's relative intensity noise near the modulation

    Source: [YARIV97] ch. 10: shot noise 2 e I, thermal noise 4 k T / R, intensity noise RIN I^2. Independent parts.

    >>> float(noise_density(1e-3, responsivity=0.5)).__round__(25)
    1.602e-22
    """
    current = np.asarray(responsivity, float) * np.asarray(power, float)
    mean = current + np.asarray(responsivity, float) * np.asarray(background, float) + np.asarray(dark_current, float)
    intensity = 10.0 ** (np.asarray(intensity_noise_db_hz, float) / 10.0)
    thermal = 4.0 * BOLTZMANN * np.asarray(temperature_k, float) / np.asarray(load, float)
    return 2.0 * ELECTRON * mean + thermal + np.asarray(amplifier, float) ** 2 + intensity * current**2


def u_phase(amplitude: ArrayLike, density: ArrayLike, duration: ArrayLike) -> NDArray[np.float64]:
    """Standard uncertainty of the phase of a tone in white noise, in radians.

    amplitude   of the tone, any unit
    density     one-sided density of the noise, that unit squared per Hz
    duration    s that are averaged

    Source: the Cramér-Rao bound sqrt(2/N) sigma/A of [RIFE74] with sigma^2 = density * rate/2 and N = rate * duration.
    Exact for small u.

    >>> float(u_phase(1.0, 1e-6, 0.01))
    0.01
    """
    return np.sqrt(np.asarray(density, float) / np.asarray(duration, float)) / np.asarray(amplitude, float)
