"""The notes' air: Rüeger's 1990 book, with Owens' density factors. The model of record for reproducing the notes.

It lies up to 0.1 ppm below `ciddor_hill1999` in ordinary weather and 0.3 ppm when hot and saturated
(`tests/atmosphere/test_models_agree.py` measures it): for new work take that one.
"""

from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.humidity import saturation, vapour_pressure_hpa
from catseye.atmosphere.model import Limit, Model, Partials
from catseye.constants import ZERO_CELSIUS_K

# [RUEGER90] eq. A.10 ([PARKER04] eq. 1.25): 1e8 refractivity per unit density factor; um^-2 in the resonances
DRY_TERMS = ((1646386.0, 238.0185), (47729.9, 57.362))
# [OWENS67]: phase terms in 1, sigma², sigma^4, sigma^6; the group form multiplies them by 1, 3, 5, 7 (printed in 1.25)
VAPOUR_TERMS = (6487.31, 58.058, -0.71150, 0.08851)
# [PARKER04] eq. 1.23: dry air's departure from the ideal gas, 1/hPa, K/hPa, K²/hPa
DRY_DENSITY = (57.90e-8, -9.3250e-4, 0.25844)
# [PARKER04] eq. 1.24: vapour's, in 1/T^0 to 1/T^3, 1/hPa; then the coefficient of P_w²
VAPOUR_DENSITY, VAPOUR_SQUARE = (-2.37321e-3, 2.23366, -710.792, 7.75141e4), 3.7e-4


class DensityFactors(NamedTuple):
    """Owens' density factors in hPa/K.

    dry      D_s
    vapour   D_w
    """

    dry: Any
    vapour: Any


def density_factors(temperature_c, pressure_hpa, vapour_pressure_hpa) -> DensityFactors:
    """Density factors of the dry air and of the vapour, in hPa/K.

    temperature_c         air temperature, -40 to 50 °C
    pressure_hpa          total pressure, 500 to 1100 hPa
    vapour_pressure_hpa   partial pressure of water vapour, 0 to 100 hPa

    Source: [PARKER04] eqs. 1.23, 1.24 ([RUEGER90] eqs. A.4, A.5, after [OWENS67]). Good to 1e-5 of themselves.

    >>> round(float(density_factors(15.0, 1013.25, 0.0).dry), 3)
    3.518
    """
    kelvin = np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    p_w = np.asarray(vapour_pressure_hpa, float)
    p_s = np.asarray(pressure_hpa, float) - p_w
    dry = p_s / kelvin * (1.0 + p_s * _inverse_powers(DRY_DENSITY, kelvin))
    vapour = p_w / kelvin * (1.0 + (p_w + VAPOUR_SQUARE * p_w**2) * _inverse_powers(VAPOUR_DENSITY, kelvin))
    return DensityFactors(dry, vapour)


def group_coefficients(wavelength_um) -> DensityFactors:
    """Group refractivity per unit of each density factor, in K/hPa.

    wavelength_um   vacuum wavelength, 0.36 to 1.69 um

    Source: [PARKER04] eqs. 1.25, 1.26 ([RUEGER90] eq. A.10). Good to 3e-8 in the index of sea-level air.

    >>> round(float(group_coefficients(0.780).dry) * 1e5, 6)
    7.969183
    """
    s = 1.0 / np.asarray(wavelength_um, float) ** 2
    dry = sum(k * (a + s) / (a - s) ** 2 for k, a in DRY_TERMS)
    vapour = sum((2 * i + 1) * w * s**i for i, w in enumerate(VAPOUR_TERMS))
    return DensityFactors(1e-8 * dry, 1e-8 * vapour)


def phase_coefficients(wavelength_um) -> DensityFactors:
    """Phase refractivity per unit of each density factor, in K/hPa.

    wavelength_um   vacuum wavelength, 0.36 to 1.69 um

    Source: [OWENS67] for the vapour, [PECK72] scaled for the dry air: what [PARKER04] eq. 1.25 is the group form of
    (n_g = n + sigma dn/dsigma). Good to 3e-8 in the index of sea-level air.

    >>> round(float(phase_coefficients(0.780).dry) * 1e5, 6)
    7.821777
    """
    s = 1.0 / np.asarray(wavelength_um, float) ** 2
    dry = sum(k / (a - s) for k, a in DRY_TERMS)
    vapour = sum(w * s**i for i, w in enumerate(VAPOUR_TERMS))
    return DensityFactors(1e-8 * dry, 1e-8 * vapour)


def group_refractivity(temperature_c, pressure_hpa, humidity_percent, *, wavelength_um=0.780, co2_ppm=None):
    """Group index of air minus one, by the notes' formula.

    temperature_c      air temperature, -40 to 50 °C
    pressure_hpa       total pressure, 500 to 1100 hPa
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    wavelength_um      vacuum wavelength, 0.36 to 1.69 um
    co2_ppm            ignored: the formula's air is fixed, with 0.03 % of carbon dioxide

    Source: [PARKER04] eq. 1.25 ([RUEGER90] eq. A.10), vapour by eqs. 1.3, 1.5. The notes print 1.000 253 24 for the
    example. Good to 1e-7; 2e-7 below [CIDDOR99] at 30 °C and 80 %.

    >>> round(float(group_refractivity(20.0, 933.0, 50.0)) * 1e6, 6)
    253.246815
    """
    return _refractivity(temperature_c, pressure_hpa, humidity_percent, group_coefficients(wavelength_um))


def phase_refractivity(temperature_c, pressure_hpa, humidity_percent, *, wavelength_um=0.780, co2_ppm=None):
    """Phase index of air minus one, the companion of the notes' group formula.

    temperature_c      air temperature, -40 to 50 °C
    pressure_hpa       total pressure, 500 to 1100 hPa
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    wavelength_um      vacuum wavelength, 0.36 to 1.69 um
    co2_ppm            ignored: the formula's air is fixed, with 0.03 % of carbon dioxide

    Source: [OWENS67] with the coefficients that [PARKER04] eq. 1.25 implies. Good to 1e-7.

    >>> round(float(phase_refractivity(20.0, 933.0, 50.0)) * 1e6, 3)
    248.538
    """
    return _refractivity(temperature_c, pressure_hpa, humidity_percent, phase_coefficients(wavelength_um))


def group_partials(temperature_c, pressure_hpa, vapour_pressure_hpa, *, wavelength_um=0.780) -> Partials:
    """Derivatives of the group index by temperature, total pressure and vapour pressure, each with the others held.

    temperature_c         air temperature, -40 to 50 °C
    pressure_hpa          total pressure, 500 to 1100 hPa
    vapour_pressure_hpa   partial pressure of water vapour, 0 to 100 hPa
    wavelength_um         vacuum wavelength, 0.36 to 1.69 um

    Source: [PARKER04] eqs. 1.23-1.25 differentiated; the last is eq. 1.53. Exact derivatives of the formula.

    >>> round(float(group_partials(20.0, 933.0, 11.7323).vapour_pressure_hpa) * 1e8, 3)
    -4.094
    """
    kelvin = np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    p_w = np.asarray(vapour_pressure_hpa, float)
    p_s = np.asarray(pressure_hpa, float) - p_w
    dry, vapour = group_coefficients(wavelength_um)
    b, b_t = _inverse_powers(DRY_DENSITY, kelvin), _inverse_powers_slope(DRY_DENSITY, kelvin)
    q, q_t = _inverse_powers(VAPOUR_DENSITY, kelvin), _inverse_powers_slope(VAPOUR_DENSITY, kelvin)
    square = p_w + VAPOUR_SQUARE * p_w**2
    d = density_factors(temperature_c, pressure_hpa, p_w)
    dry_p = (1.0 + 2.0 * p_s * b) / kelvin
    vapour_p = (1.0 + (2.0 * p_w + 3.0 * VAPOUR_SQUARE * p_w**2) * q) / kelvin
    return Partials(
        dry * (p_s**2 * b_t - d.dry) / kelvin + vapour * (p_w * square * q_t - d.vapour) / kelvin,
        dry * dry_p,
        vapour * vapour_p - dry * dry_p,
    )


def group_sensitivity(temperature_c, pressure_hpa, humidity_percent, *, wavelength_um=0.780, co2_ppm=None):
    """Derivatives of the group index by temperature, pressure and relative humidity, the last held in the others.

    temperature_c      air temperature, -40 to 50 °C
    pressure_hpa       total pressure, 500 to 1100 hPa
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    wavelength_um      vacuum wavelength, 0.36 to 1.69 um
    co2_ppm            ignored

    Source: [PARKER04] eqs. 1.50-1.52, which print -0.895e-6, 0.272e-6, -0.0096e-6. Exact derivatives of the formula.

    >>> [round(float(slope) * 1e6, 6) for slope in group_sensitivity(20.0, 933.0, 50.0)]
    [-0.895887, 0.272048, -0.009606]
    """
    e = vapour_pressure_hpa(temperature_c, pressure_hpa, humidity_percent, "buck")
    partials = group_partials(temperature_c, pressure_hpa, e, wavelength_um=wavelength_um)
    return partials.with_humidity_held(saturation(temperature_c, pressure_hpa, "buck"), humidity_percent)


def _refractivity(temperature_c, pressure_hpa, humidity_percent, coefficients):
    e = vapour_pressure_hpa(temperature_c, pressure_hpa, humidity_percent, "buck")
    density = density_factors(temperature_c, pressure_hpa, e)
    return coefficients.dry * density.dry + coefficients.vapour * density.vapour


def _inverse_powers(coefficients, kelvin):
    return sum(c / kelvin**i for i, c in enumerate(coefficients))


def _inverse_powers_slope(coefficients, kelvin):
    return sum(-i * c / kelvin ** (i + 1) for i, c in enumerate(coefficients))


MODEL = Model(
    name="rueger1990",
    source="[RUEGER90], [OWENS67]",
    group_refractivity=group_refractivity,
    phase_refractivity=phase_refractivity,
    group_sensitivity=group_sensitivity,
    vapour_formula="buck",
    # the notes say two parts in 1e8; but it departs from [CIDDOR99] by 7.4e-8 rms over Green Bank's weather
    standard_uncertainty=1e-7,
    limits={
        "temperature_c": Limit("temperature", "C", -40.0, 50.0, "[RUEGER90]"),
        "pressure_hpa": Limit("pressure", "hPa", 500.0, 1100.0, "[RUEGER90]"),
        "humidity_percent": Limit("relative humidity", "%", 0.0, 100.0, "[RUEGER90]"),
        "wavelength_um": Limit("wavelength", "um", 0.36, 1.69, "[OWENS67]", places=2),
        "co2_ppm": Limit("carbon dioxide", "ppm", 0.0, 2000.0, "[RUEGER90]"),
    },
)
