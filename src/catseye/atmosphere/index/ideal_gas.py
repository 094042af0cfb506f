"""Densities of the closed formulas: pressures over temperature, ideal gases.

A closed formula takes the total pressure as dry air and subtracts, with a negative coefficient of the vapour
pressure, the lower refraction of vapour against the air it displaces.
"""

import numpy as np

from catseye.atmosphere.index.model import DensitySlopes, Gases
from catseye.atmosphere.limit import ValidInterval
from catseye.constants import ZERO_CELSIUS_K


def densities(temperature_c, pressure_hpa, vapour_pressure_hpa) -> Gases:
    """Total pressure and vapour pressure over absolute temperature, hPa/K.

    temperature_c         air temperature, -40 to 50 °C
    pressure_hpa          total pressure, 500 to 1100 hPa
    vapour_pressure_hpa   partial pressure of water vapour, 0 to 100 hPa

    Source: [IAG99], closed formula.

    >>> round(float(densities(0.0, 1013.25, 0.0).dry), 6)
    3.7095
    """
    kelvin = np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    return Gases(np.asarray(pressure_hpa, float) / kelvin, np.asarray(vapour_pressure_hpa, float) / kelvin)


def density_slopes(temperature_c, pressure_hpa, vapour_pressure_hpa) -> Gases:
    """Derivatives of both by temperature, total pressure and vapour pressure.

    Arguments as of `densities`.

    >>> round(float(density_slopes(0.0, 1013.25, 0.0).dry.temperature_c), 5)
    -0.01358
    """
    kelvin = np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    dry, vapour = densities(temperature_c, pressure_hpa, vapour_pressure_hpa)
    zero = np.zeros_like(kelvin)
    return Gases(
        DensitySlopes(-dry / kelvin, 1.0 / kelvin, zero),
        DensitySlopes(-vapour / kelvin, zero, 1.0 / kelvin),
    )


def limits(source: str) -> dict[str, ValidInterval]:
    """Limits common to both closed formulas."""
    return {
        "temperature_c": ValidInterval("temperature", "C", -40.0, 50.0, source),
        "pressure_hpa": ValidInterval("pressure", "hPa", 500.0, 1100.0, source),
        "humidity_percent": ValidInterval("relative humidity", "%", 0.0, 100.0, source),
        "wavelength_um": ValidInterval("wavelength", "um", 0.36, 1.70, source, places=2),
        "co2_ppm": ValidInterval("carbon dioxide", "ppm", 0.0, 2000.0, source),
    }
