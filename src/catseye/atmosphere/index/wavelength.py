"""Wavelengths in air of light and modulation, and the index of sidebands.

The notes' 1.2 takes a sideband on either side of the carrier; the modulation is their difference. With
f the carrier, m the modulation and n(f) the phase index, the two phases over a length d differ by
2 pi d/c [n(f + m)(f + m) - n(f - m)(f - m)], which is that of a wave of 2m in the index

    n_m = [n(f + m)(f + m) - n(f - m)(f - m)] / 2m = n_g + (m²/6) d²n_g/df² + ...,    n_g = d(n f)/df

and d(n f)/df is eq. 1.1, n - lambda dn/dlambda. At 780 nm and 1.5 GHz the second term is 4.0e-17: the group index is
the index of the modulation, whatever the length; at 1 THz it would be 1.8e-11.

The notes print the carrier of 780 nm as 384 615.3 GHz. That is 3e8/780e-9; with c it is 384 349.3 GHz. The sidebands,
384 616.8 and 384 613.8, have the same error; their distance of 3 GHz is right.
"""

from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.index.air import phase_refractivity
from catseye.atmosphere.limit import ValidInterval
from catseye.constants import SPEED_OF_LIGHT

INDEX = ValidInterval("index of air", "(ratio)", 1.0, 1.001, "air", places=3)
MODULATION = ValidInterval("modulation frequency", "Hz", 1e6, 1e12, "the definition of a group index")
MICROMETRE = 1e-6  # m
ROUNDS = 20  # of the search for a vacuum wavelength; each gains five decimals


class Sidebands(NamedTuple):
    """Carrier, sidebands and the index of their beat.

    carrier_hz, lower_hz, upper_hz   frequencies, Hz
    lower, upper                     phase refractivity n - 1 of each sideband
    refractivity                     n_m - 1 of the modulation
    """

    carrier_hz: Any
    lower_hz: Any
    upper_hz: Any
    lower: Any
    upper: Any
    refractivity: Any


def modulation_wavelength(modulation_hz, group_index):
    """Wavelength of the modulation in air, m.

    modulation_hz   modulation frequency, 1e6 to 1e12 Hz
    group_index     n_g, 1 to 1.001

    Source: [PARKER04] eqs. 1.27 to 1.29. Exact. Raises ValidityError for a value outside its limits.

    >>> round(float(modulation_wavelength(1500e6, 1.000253246815)), 9)
    0.199811037
    """
    MODULATION.check(modulation_hz)
    INDEX.check(group_index)
    return SPEED_OF_LIGHT / (np.asarray(modulation_hz, float) * np.asarray(group_index, float))


def vacuum_wavelength_of_frequency_um(frequency_hz):
    """Wavelength in vacuum, um.

    frequency_hz   of the light, Hz, above zero

    Source: c / f. Exact.

    >>> round(float(vacuum_wavelength_of_frequency_um(384_349.305e9)), 9)
    0.78
    """
    return SPEED_OF_LIGHT / np.asarray(frequency_hz, float) / MICROMETRE


def sidebands(vacuum_um, modulation_hz, temperature_c, pressure_hpa, humidity_percent, **air) -> Sidebands:
    """Index of the modulation from its two sidebands, without a derivative.

    vacuum_um          carrier's wavelength in vacuum, um
    modulation_hz      modulation frequency, 1e6 to 1e12 Hz
    temperature_c      air temperature, °C
    pressure_hpa       total pressure, hPa
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    air                `model` and `co2_ppm` of `air.phase_refractivity`

    Source: [PARKER04] section 1.2, derived at the top of this file. The beat divides a difference of two products by
    their frequencies' difference: at 1.5 GHz the rounding of n - 1 grows to 3e-14 of the index, at 1 MHz to 3e-11.
    Raises ValidityError for a value outside its limits.

    >>> beat = sidebands(0.780, 1500e6, 20.0, 933.0, 50.0)
    >>> [round(float(f) / 1e9, 1) for f in (beat.carrier_hz, beat.upper_hz, beat.lower_hz)]
    [384349.3, 384350.8, 384347.8]
    """
    MODULATION.check(modulation_hz)
    carrier = SPEED_OF_LIGHT / (np.asarray(vacuum_um, float) * MICROMETRE)
    modulation = np.asarray(modulation_hz, float)
    lower_hz, upper_hz = carrier - modulation, carrier + modulation
    lower, upper = (
        phase_refractivity(
            temperature_c,
            pressure_hpa,
            humidity_percent,
            wavelength_um=vacuum_wavelength_of_frequency_um(frequency),
            **air,
        )
        for frequency in (lower_hz, upper_hz)
    )
    beat = (upper * upper_hz - lower * lower_hz) / (upper_hz - lower_hz)
    return Sidebands(carrier, lower_hz, upper_hz, lower, upper, beat)
