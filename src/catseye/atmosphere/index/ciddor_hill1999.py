"""Ciddor's phase index and Ciddor and Hill's group index, the default.

Refractivities add in proportion to density.

Recommended for new work, as resolved by the IAG for work better than 1 ppm [IAG99].
A continuum formula does not hold inside absorption lines of water or oxygen: check a laser's line.
"""

from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.index.model import (
    CO2_OF_TODAY_PPM,
    CO2_SLOPE,
    DensitySlopes,
    Gases,
    IndexModel,
    RefractiveDispersion,
)
from catseye.atmosphere.limit import ValidInterval
from catseye.atmosphere.weather.humidity import PA_PER_HPA
from catseye.constants import ZERO_CELSIUS_K

# [CIDDOR96] appendix A, k1/(k0 - sigma²) + k3/(k2 - sigma²): 1e8 refractivity of standard dry air; um^-2
DRY_TERMS = ((5792105.0, 238.0185), (167917.0, 57.362))
# [CIDDOR96] appendix A: 1e8 refractivity of standard vapour in 1, sigma², sigma^4, sigma^6, and its correction factor
VAPOUR_TERMS, VAPOUR_FACTOR = (295.235, 2.6422, -0.032380, 0.004028), 1.022
CO2_STANDARD_PPM = CO2_OF_TODAY_PPM  # [CIDDOR96] eq. 2
# [CIDDOR96] appendix A, compressibility: K/Pa, 1/Pa, 1/(K Pa); K/Pa, 1/Pa; K/Pa, 1/Pa; K²/Pa²; K²/Pa²
A0, A1, A2 = 1.58123e-6, -2.9331e-8, 1.1043e-10
B0, B1 = 5.707e-6, -2.051e-8
C0, C1 = 1.9898e-4, -2.376e-6
D, E = 1.83e-11, -0.765e-8
# [CIDDOR96]: where dry air and vapour have their standard refractivities, °C, Pa, mole fraction of vapour
STANDARD_DRY, STANDARD_VAPOUR = (15.0, 101_325.0, 0.0), (20.0, 1_333.0, 1.0)


class Compressibility(NamedTuple):
    """Compressibility Z of moist air and its partial derivatives.

    z                 dimensionless
    per_k             by temperature, 1/K
    per_pa            by pressure, 1/Pa
    per_fraction      by the mole fraction of vapour
    """

    z: Any
    per_k: Any
    per_pa: Any
    per_fraction: Any


def compressibility(temperature_c, pressure_hpa, vapour_fraction) -> Compressibility:
    """Compressibility of moist air with its derivatives.

    temperature_c     air temperature, -40 to 100 °C
    pressure_hpa      total pressure, 100 to 1400 hPa
    vapour_fraction   mole fraction of water vapour, 0 to 1

    Source: [CIDDOR96] appendix A (the 1991 international equation for the density of moist air). Good to 2e-5.

    >>> round(float(compressibility(15.0, 1013.25, 0.0).z), 10)
    0.9995922115
    """
    t, x = np.asarray(temperature_c, float), np.asarray(vapour_fraction, float)
    kelvin, p = t + ZERO_CELSIUS_K, np.asarray(pressure_hpa, float) * PA_PER_HPA
    r = p / kelvin
    linear = A0 + A1 * t + A2 * t**2 + (B0 + B1 * t) * x + (C0 + C1 * t) * x**2
    linear_t = A1 + 2.0 * A2 * t + B1 * x + C1 * x**2
    linear_x = B0 + B1 * t + 2.0 * (C0 + C1 * t) * x
    square = D + E * x**2
    return Compressibility(
        1.0 - r * linear + r**2 * square,
        r * (linear / kelvin - linear_t - 2.0 * r * square / kelvin),
        (2.0 * r * square - linear) / kelvin,
        r * (2.0 * r * E * x - linear_x),
    )


def densities(temperature_c, pressure_hpa, vapour_pressure_hpa) -> Gases:
    """Density factors: partial pressure over Z T of each gas, Pa/K.

    temperature_c         air temperature, -40 to 100 °C
    pressure_hpa          total pressure, 100 to 1400 hPa
    vapour_pressure_hpa   partial pressure of water vapour, 0 to the total pressure

    Source: [CIDDOR96] eq. 4; gas constant and molar masses cancel against the standard densities', carbon dioxide's
    too.

    >>> round(float(densities(20.0, 1013.25, 11.7429).vapour), 4)
    4.0073
    """
    p, e = np.asarray(pressure_hpa, float), np.asarray(vapour_pressure_hpa, float)
    z_kelvin = compressibility(temperature_c, p, e / p).z * (np.asarray(temperature_c, float) + ZERO_CELSIUS_K)
    return Gases(PA_PER_HPA * (p - e) / z_kelvin, PA_PER_HPA * e / z_kelvin)


def density_slopes(temperature_c, pressure_hpa, vapour_pressure_hpa) -> Gases:
    """Derivatives of both densities by temperature, pressure and vapour pressure.

    Arguments as of `densities`.

    Source: [CIDDOR96] eq. 4 and appendix A differentiated.

    >>> [round(float(slope), 4) for slope in density_slopes(20.0, 1013.25, 11.7429).dry]
    [-1.1693, 0.3414, -0.3402]
    """
    p, e = np.asarray(pressure_hpa, float), np.asarray(vapour_pressure_hpa, float)
    kelvin, x = np.asarray(temperature_c, float) + ZERO_CELSIUS_K, e / p
    z = compressibility(temperature_c, p, x)
    density = densities(temperature_c, p, e)
    # relative: of 1/(Z T), where the vapour's fraction x = e/p changes Z with both pressures
    by_t = -(1.0 / kelvin + z.per_k / z.z)
    by_p = -(z.per_pa * PA_PER_HPA - z.per_fraction * x / p) / z.z
    by_e = -z.per_fraction / (p * z.z)
    one = PA_PER_HPA / (z.z * kelvin)
    return Gases(
        DensitySlopes(density.dry * by_t, density.dry * by_p + one, density.dry * by_e - one),
        DensitySlopes(density.vapour * by_t, density.vapour * by_p, density.vapour * by_e + one),
    )


def group_coefficients(wavelength_um, co2_ppm=CO2_STANDARD_PPM) -> Gases:
    """Group refractivity of each gas per partial pressure over Z T, K/Pa.

    wavelength_um   vacuum wavelength, 0.30 to 1.69 um
    co2_ppm         carbon dioxide, 0 to 2000 ppm

    Source: [CIDDOR99], each term differentiated by sigma; the sign of its eq. B2 is taken positive (erratum).
    Good to 3e-8 in the index of sea-level air.

    >>> round(float(group_coefficients(0.780).dry) * 1e7, 5)
    7.96973
    """
    return MODEL.coefficients(wavelength_um, co2_ppm, "group")


def _standard_zt(temperature_c, pressure_pa, vapour_fraction):
    z = compressibility(temperature_c, pressure_pa / PA_PER_HPA, vapour_fraction).z
    return float(z * (temperature_c + ZERO_CELSIUS_K) / pressure_pa)


# Refractivities add in proportion to density ([CIDDOR96] eq. 5); the Lorentz-Lorenz sum differs by up to 4e-9 and does
# not reproduce the tables. Today's [IAPWS97] saturation changes the index of saturated air by less than 1e-10 to 30 °C.
MODEL = IndexModel(
    name="ciddor_hill1999",
    label="Ciddor, Hill 1999",
    is_compiled=True,
    source="[CIDDOR99], [CIDDOR96]",
    dispersion=Gases(
        RefractiveDispersion(poles=DRY_TERMS, scale=1e-8 * _standard_zt(*STANDARD_DRY)),
        RefractiveDispersion(powers=VAPOUR_TERMS, scale=1e-8 * VAPOUR_FACTOR * _standard_zt(*STANDARD_VAPOUR)),
    ),
    densities=densities,
    density_unit="Pa/K",
    density_slopes=density_slopes,
    vapour_formula="ciddor",
    standard_uncertainty=5e-8,  # upper end of the author's 2e-8 to 5e-8
    limits={
        "temperature_c": ValidInterval("temperature", "C", -40.0, 100.0, "[CIDDOR96]"),
        "pressure_hpa": ValidInterval("pressure", "hPa", 100.0, 1400.0, "[CIDDOR96]"),
        "humidity_percent": ValidInterval("relative humidity", "%", 0.0, 100.0, "[CIDDOR96]"),
        "wavelength_um": ValidInterval("wavelength", "um", 0.30, 1.69, "[CIDDOR96]", places=2),
        "co2_ppm": ValidInterval("carbon dioxide", "ppm", 0.0, 2000.0, "[CIDDOR96]"),
    },
    co2_ppm=CO2_STANDARD_PPM,
    co2_slope=CO2_SLOPE,
)
