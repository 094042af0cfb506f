"""Today's air: Ciddor's phase index and Ciddor and Hill's group index; refractivities add in proportion to density.

The default for new work, as geodesists resolved for work better than 1 ppm [IAG99].
A continuum formula does not hold inside absorption lines of water or oxygen: check a laser's line.
"""

from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.humidity import PA_PER_HPA, saturation, vapour_pressure_hpa
from catseye.atmosphere.model import Limit, Model, Partials
from catseye.constants import ZERO_CELSIUS_K

# [CIDDOR96] appendix A, k1/(k0 - sigma²) + k3/(k2 - sigma²): 1e8 refractivity of standard dry air; um^-2
DRY_TERMS = ((5792105.0, 238.0185), (167917.0, 57.362))
# [CIDDOR96] appendix A: 1e8 refractivity of standard vapour in 1, sigma², sigma^4, sigma^6, and its correction factor
VAPOUR_TERMS, VAPOUR_FACTOR = (295.235, 2.6422, -0.032380, 0.004028), 1.022
CO2_SLOPE, CO2_STANDARD_PPM = 0.534e-6, 450.0  # [CIDDOR96] eq. 2: per ppm
# [CIDDOR96] appendix A, compressibility: K/Pa, 1/Pa, 1/(K Pa); K/Pa, 1/Pa; K/Pa, 1/Pa; K²/Pa²; K²/Pa²
A0, A1, A2 = 1.58123e-6, -2.9331e-8, 1.1043e-10
B0, B1 = 5.707e-6, -2.051e-8
C0, C1 = 1.9898e-4, -2.376e-6
D, E = 1.83e-11, -0.765e-8
# [CIDDOR96]: where dry air and vapour have their standard refractivities, °C, Pa, mole fraction of vapour
STANDARD_DRY, STANDARD_VAPOUR = (15.0, 101_325.0, 0.0), (20.0, 1_333.0, 1.0)


class Compressibility(NamedTuple):
    """Compressibility Z of moist air and its partial derivatives (the others held).

    z                 dimensionless
    per_k             by temperature, 1/K
    per_pa            by pressure, 1/Pa
    per_fraction      by the mole fraction of vapour
    """

    z: Any
    per_k: Any
    per_pa: Any
    per_fraction: Any


class Coefficients(NamedTuple):
    """Refractivity times K/Pa that a partial pressure of each gas adds when divided by Z T.

    dry      of dry air
    vapour   of water vapour
    """

    dry: Any
    vapour: Any


def compressibility(temperature_c, pressure_hpa, vapour_fraction) -> Compressibility:
    """Compressibility of moist air with its slopes.

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


def group_coefficients(wavelength_um, co2_ppm=CO2_STANDARD_PPM) -> Coefficients:
    """Group refractivity that each gas adds per unit of its partial pressure over Z T, in K/Pa.

    wavelength_um   vacuum wavelength, 0.30 to 1.69 um
    co2_ppm         carbon dioxide, 0 to 2000 ppm

    Source: [CIDDOR99], each term differentiated by sigma; the sign of its eq. B2 is taken positive (erratum).
    Good to 3e-8 in the index of sea-level air.

    >>> round(float(group_coefficients(0.780).dry) * 1e7, 5)
    7.96973
    """
    s = 1.0 / np.asarray(wavelength_um, float) ** 2
    dry = sum(k * (a + s) / (a - s) ** 2 for k, a in DRY_TERMS)
    vapour = sum((2 * i + 1) * w * s**i for i, w in enumerate(VAPOUR_TERMS))
    return _per_unit_density(dry, vapour, co2_ppm)


def phase_coefficients(wavelength_um, co2_ppm=CO2_STANDARD_PPM) -> Coefficients:
    """Phase refractivity that each gas adds per unit of its partial pressure over Z T, in K/Pa.

    wavelength_um   vacuum wavelength, 0.30 to 1.69 um
    co2_ppm         carbon dioxide, 0 to 2000 ppm

    Source: [CIDDOR96] eqs. 1 to 3. Good to 3e-8 in the index of sea-level air.

    >>> round(float(phase_coefficients(0.780).dry) * 1e7, 5)
    7.82231
    """
    s = 1.0 / np.asarray(wavelength_um, float) ** 2
    dry = sum(k / (a - s) for k, a in DRY_TERMS)
    vapour = sum(w * s**i for i, w in enumerate(VAPOUR_TERMS))
    return _per_unit_density(dry, vapour, co2_ppm)


def group_refractivity(temperature_c, pressure_hpa, humidity_percent, *, wavelength_um=0.780, co2_ppm=450.0):
    """Group index of air minus one.

    temperature_c      air temperature, -40 to 100 °C
    pressure_hpa       total pressure, 100 to 1400 hPa
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    wavelength_um      vacuum wavelength, 0.30 to 1.69 um
    co2_ppm            carbon dioxide, 0 to 2000 ppm

    Source: [CIDDOR99] with [CIDDOR96] eq. 5 and its own saturation formula (today's [IAPWS97] changes the index of
    saturated air by less than 1e-10 up to 30 °C). Good to 5e-8.

    >>> round(float(group_refractivity(20.0, 1013.25, 50.0)) * 1e8, 3)
    27515.137
    """
    coefficients = group_coefficients(wavelength_um, co2_ppm)
    return _refractivity(temperature_c, pressure_hpa, humidity_percent, coefficients)


def phase_refractivity(temperature_c, pressure_hpa, humidity_percent, *, wavelength_um=0.780, co2_ppm=450.0):
    """Phase index of air minus one.

    temperature_c      air temperature, -40 to 100 °C
    pressure_hpa       total pressure, 100 to 1400 hPa
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    wavelength_um      vacuum wavelength, 0.30 to 1.69 um
    co2_ppm            carbon dioxide, 0 to 2000 ppm

    Source: [CIDDOR96] eq. 5. Good to 5e-8.

    >>> round(float(phase_refractivity(20.0, 800.0, 75.0, wavelength_um=0.633)) * 1e8, 1)
    21394.0
    """
    coefficients = phase_coefficients(wavelength_um, co2_ppm)
    return _refractivity(temperature_c, pressure_hpa, humidity_percent, coefficients)


def group_partials(
    temperature_c, pressure_hpa, vapour_pressure_hpa, *, wavelength_um=0.780, co2_ppm=CO2_STANDARD_PPM
) -> Partials:
    """Derivatives of the group index by temperature, total pressure and vapour pressure, each with the others held.

    temperature_c         air temperature, -40 to 100 °C
    pressure_hpa          total pressure, 100 to 1400 hPa
    vapour_pressure_hpa   partial pressure of water vapour, 0 to the total pressure
    wavelength_um         vacuum wavelength, 0.30 to 1.69 um
    co2_ppm               carbon dioxide, 0 to 2000 ppm

    Source: [CIDDOR96] eq. 5 differentiated. Exact derivatives of the formula.

    >>> round(float(group_partials(20.0, 1013.25, 11.7429).vapour_pressure_hpa) * 1e8, 2)
    -3.51
    """
    p, e = np.asarray(pressure_hpa, float), np.asarray(vapour_pressure_hpa, float)
    kelvin, x = np.asarray(temperature_c, float) + ZERO_CELSIUS_K, e / p
    dry, vapour = group_coefficients(wavelength_um, co2_ppm)
    z = compressibility(temperature_c, p, x)
    n = _mixed(temperature_c, p, e, (dry, vapour))
    # n = (dry (p - e) + vapour e) / (Z T); the vapour's fraction x = e/p moves Z
    per_pa = dry / (z.z * kelvin) - n / z.z * (z.per_pa - z.per_fraction * x / (p * PA_PER_HPA))
    vapour_per_pa = (vapour - dry) / (z.z * kelvin) - n / z.z * z.per_fraction / (p * PA_PER_HPA)
    return Partials(-n * (1.0 / kelvin + z.per_k / z.z), PA_PER_HPA * per_pa, PA_PER_HPA * vapour_per_pa)


def group_sensitivity(temperature_c, pressure_hpa, humidity_percent, *, wavelength_um=0.780, co2_ppm=450.0):
    """Derivatives of the group index by temperature, pressure and relative humidity, the last held in the others.

    temperature_c      air temperature, -40 to 100 °C
    pressure_hpa       total pressure, 100 to 1400 hPa
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    wavelength_um      vacuum wavelength, 0.30 to 1.69 um
    co2_ppm            carbon dioxide, 0 to 2000 ppm

    Source: [CIDDOR96] eq. 5 differentiated, vapour by its appendix A. Exact derivatives of the formula.

    >>> [round(float(slope) * 1e6, 5) for slope in group_sensitivity(20.0, 1013.25, 50.0)]
    [-0.96694, 0.27206, -0.00825]
    """
    e = vapour_pressure_hpa(temperature_c, pressure_hpa, humidity_percent, "ciddor")
    partials = group_partials(temperature_c, pressure_hpa, e, wavelength_um=wavelength_um, co2_ppm=co2_ppm)
    return partials.with_humidity_held(saturation(temperature_c, pressure_hpa, "ciddor"), humidity_percent)


def _per_unit_density(dry, vapour, co2_ppm) -> Coefficients:
    """Standard refractivities over standard p/(Z T): gas constant and molar masses cancel, carbon dioxide's too."""
    dry = 1e-8 * dry * (1.0 + CO2_SLOPE * (np.asarray(co2_ppm, float) - CO2_STANDARD_PPM))
    return Coefficients(
        dry * _standard_zt(*STANDARD_DRY), 1e-8 * VAPOUR_FACTOR * vapour * _standard_zt(*STANDARD_VAPOUR)
    )


def _standard_zt(temperature_c, pressure_pa, vapour_fraction):
    z = compressibility(temperature_c, pressure_pa / PA_PER_HPA, vapour_fraction).z
    return z * (temperature_c + ZERO_CELSIUS_K) / pressure_pa


def _refractivity(temperature_c, pressure_hpa, humidity_percent, coefficients):
    e = vapour_pressure_hpa(temperature_c, pressure_hpa, humidity_percent, "ciddor")
    return _mixed(temperature_c, np.asarray(pressure_hpa, float), e, coefficients)


def _mixed(temperature_c, p, e, coefficients):
    """[CIDDOR96] eq. 5: refractivities in proportion to density; the Lorentz-Lorenz sum differs by up to 3e-9."""
    dry, vapour = coefficients
    kelvin = np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    z = compressibility(temperature_c, p, e / p).z
    return PA_PER_HPA * (dry * (p - e) + vapour * e) / (z * kelvin)


MODEL = Model(
    name="ciddor_hill1999",
    source="[CIDDOR99], [CIDDOR96]",
    group_refractivity=group_refractivity,
    phase_refractivity=phase_refractivity,
    group_sensitivity=group_sensitivity,
    vapour_formula="ciddor",
    standard_uncertainty=5e-8,  # the upper end of the 2e-8 to 5e-8 that the author states
    limits={
        "temperature_c": Limit("temperature", "C", -40.0, 100.0, "[CIDDOR96]"),
        "pressure_hpa": Limit("pressure", "hPa", 100.0, 1400.0, "[CIDDOR96]"),
        "humidity_percent": Limit("relative humidity", "%", 0.0, 100.0, "[CIDDOR96]"),
        "wavelength_um": Limit("wavelength", "um", 0.30, 1.69, "[CIDDOR96]", places=2),
        "co2_ppm": Limit("carbon dioxide", "ppm", 0.0, 2000.0, "[CIDDOR96]"),
    },
)
