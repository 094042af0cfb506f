"""Rüeger's 1990 air with Owens' density factors, as in the notes.

For reproducing the notes.

It lies up to 0.1 ppm below `ciddor_hill1999` in ordinary weather, 0.3 ppm when hot and saturated, 0.5 ppm at 45 °C
(`tests/atmosphere/index/test_models_agree.py` measures it): for new work use that one.
"""

import numpy as np

from catseye.atmosphere.index.model import DensitySlopes, Gases, IndexModel, RefractiveDispersion
from catseye.atmosphere.limit import ValidInterval
from catseye.constants import ZERO_CELSIUS_K

# [RUEGER90] eq. A.10 ([PARKER04] eq. 1.25) prints the group forms. Phase refractivity per unit density factor: the dry
# air's is [PECK72]'s scaled; the vapour's is [OWENS67]'s, which the group form multiplies by 1, 3, 5, 7. um^-2
DRY = RefractiveDispersion(poles=((1646386.0, 238.0185), (47729.9, 57.362)), scale=1e-8)
VAPOUR = RefractiveDispersion(powers=(6487.31, 58.058, -0.71150, 0.08851), scale=1e-8)
# [PARKER04] eq. 1.23: dry air's departure from the ideal gas, 1/hPa, K/hPa, K²/hPa
DRY_DENSITY = (57.90e-8, -9.3250e-4, 0.25844)
# [PARKER04] eq. 1.24: vapour's, in 1/T^0 to 1/T^3, 1/hPa; then the coefficient of P_w²
VAPOUR_DENSITY, VAPOUR_SQUARE = (-2.37321e-3, 2.23366, -710.792, 7.75141e4), 3.7e-4


def density_factors(temperature_c, pressure_hpa, vapour_pressure_hpa) -> Gases:
    """Owens' density factors D_s of dry air, D_w of vapour, hPa/K.

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
    return Gases(dry, vapour)


def density_slopes(temperature_c, pressure_hpa, vapour_pressure_hpa) -> Gases:
    """Derivatives of both density factors by temperature and pressures.

    By temperature, total pressure and vapour pressure; arguments as of `density_factors`.

    Source: [PARKER04] eqs. 1.23, 1.24 differentiated.

    >>> [round(float(slope), 6) for slope in density_slopes(20.0, 933.0, 11.7323).dry]
    [-0.010752, 0.003414, -0.003414]
    """
    kelvin = np.asarray(temperature_c, float) + ZERO_CELSIUS_K
    p_w = np.asarray(vapour_pressure_hpa, float)
    p_s = np.asarray(pressure_hpa, float) - p_w
    b, b_t = _inverse_powers(DRY_DENSITY, kelvin), _inverse_powers_slope(DRY_DENSITY, kelvin)
    q, q_t = _inverse_powers(VAPOUR_DENSITY, kelvin), _inverse_powers_slope(VAPOUR_DENSITY, kelvin)
    square = p_w + VAPOUR_SQUARE * p_w**2
    factor = density_factors(temperature_c, pressure_hpa, p_w)
    dry_p = (1.0 + 2.0 * p_s * b) / kelvin
    vapour_e = (1.0 + (2.0 * p_w + 3.0 * VAPOUR_SQUARE * p_w**2) * q) / kelvin
    return Gases(
        DensitySlopes((p_s**2 * b_t - factor.dry) / kelvin, dry_p, -dry_p),
        DensitySlopes((p_w * square * q_t - factor.vapour) / kelvin, 0.0, vapour_e),
    )


def group_coefficients(wavelength_um) -> Gases:
    """Group refractivity per unit of each density factor, K/hPa.

    wavelength_um   vacuum wavelength, 0.36 to 1.69 um

    Source: [PARKER04] eqs. 1.25, 1.26 ([RUEGER90] eq. A.10). Good to 3e-8 in the index of sea-level air.

    >>> round(float(group_coefficients(0.780).dry) * 1e5, 6)
    7.969183
    """
    return Gases(DRY.group(wavelength_um), VAPOUR.group(wavelength_um))


def _inverse_powers(coefficients, kelvin):
    return sum(c / kelvin**i for i, c in enumerate(coefficients))


def _inverse_powers_slope(coefficients, kelvin):
    return sum(-i * c / kelvin ** (i + 1) for i, c in enumerate(coefficients))


# [PARKER04] eqs. 1.50-1.53 print the slopes of the example, -0.895e-6 /°C, 0.272e-6 /hPa, -0.0096e-6 /%, -4.09e-8 /hPa
MODEL = IndexModel(
    name="rueger1990",
    label="Rüeger 1990 (the notes)",
    is_compiled=True,
    source="[RUEGER90], [OWENS67]",
    dispersion=Gases(DRY, VAPOUR),
    densities=density_factors,
    density_slopes=density_slopes,
    vapour_formula="buck",
    # the notes say two parts in 1e8; but it lies below [CIDDOR99] by 5.2e-9 for each hPa of vapour, to 3e-8 at most
    standard_uncertainty=5e-8,
    limits={
        "temperature_c": ValidInterval("temperature", "C", -40.0, 50.0, "[RUEGER90]"),
        "pressure_hpa": ValidInterval("pressure", "hPa", 500.0, 1100.0, "[RUEGER90]"),
        "humidity_percent": ValidInterval("relative humidity", "%", 0.0, 100.0, "[RUEGER90]"),
        "wavelength_um": ValidInterval("wavelength", "um", 0.36, 1.69, "[OWENS67]", places=2),
        "co2_ppm": ValidInterval("carbon dioxide", "ppm", 0.0, 2000.0, "[RUEGER90]"),
    },
    co2_ppm=300.0,
    vapour_uncertainty=5.2e-9,
)
