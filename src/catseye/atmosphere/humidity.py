"""Water vapour in air: saturation, vapour pressure from relative humidity, dew point.

Relative humidity is over liquid water at all temperatures (the meteorologists' convention); ice is never chosen
silently. Three formulas for saturated moist air are registered by name: `buck` (the notes'), `ciddor` (the one that
reproduces Ciddor's tables) and `iapws` (today's reference for pure water, with Ciddor's enhancement factor).
They agree within 0.1 % from -20 to 50 °C, which is 2e-9 in the index of saturated air at 30 °C.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from catseye.constants import ZERO_CELSIUS_K
from catseye.errors import ValidityError

PA_PER_HPA = 100.0
DRY_BELOW_HPA = 1e-9  # air with less vapour (a dew point below -135 °C) counts as perfectly dry

# [PARKER04] eq. 1.3, over liquid water: hPa, 1, 1/hPa, 1, °C
BUCK_E0, BUCK_F0, BUCK_FP, BUCK_A, BUCK_B = 6.1121, 1.0007, 3.46e-6, 17.502, 240.97
# [PARKER04] eq. 1.4, over ice
ICE_E0, ICE_F0, ICE_FP, ICE_A, ICE_B = 6.1115, 1.0003, 4.18e-6, 22.452, 272.55
# [CIDDOR96] appendix A, saturation over liquid water in Pa: K^-2, K^-1, 1, K
CIDDOR_A, CIDDOR_B, CIDDOR_C, CIDDOR_D = 1.2378847e-5, -1.9121316e-2, 33.93711047, -6.3431645e3
# [CIDDOR96] appendix A, enhancement of saturation by air: 1, 1/Pa, °C^-2
ENHANCEMENT_0, ENHANCEMENT_P, ENHANCEMENT_T2 = 1.00062, 3.14e-8, 5.6e-7
# [IAPWS97] table 34, n1 to n10, for eq. 30 in MPa and K
IF97_N = (
    0.11670521452767e4,
    -0.72421316703206e6,
    -0.17073846940092e2,
    0.12020824702470e5,
    -0.32325550322333e7,
    0.14915108613530e2,
    -0.48232657361591e4,
    0.40511340542057e6,
    -0.23855557567849,
    0.65017534844798e3,
)


class Saturation(NamedTuple):
    """Saturation vapour pressure of moist air and its slopes.

    pressure_hpa   hPa
    per_c          derivative by temperature, hPa/°C
    per_hpa        derivative by total pressure, hPa/hPa
    """

    pressure_hpa: Any
    per_c: Any
    per_hpa: Any


def saturation_pressure_hpa(temperature_c, pressure_hpa):
    """Saturation vapour pressure over liquid water, in hPa, by Buck's formula.

    temperature_c   air temperature, -40 to 50 °C
    pressure_hpa    total pressure, 500 to 1100 hPa (enters through the enhancement factor)

    Source: [RUEGER90] eq. 5.27 ([PARKER04] eq. 1.3). Good to 0.1 % from -20 to 50 °C, 0.8 % low at -40 °C.

    >>> round(float(saturation_pressure_hpa(20.0, 933.0)), 4)
    23.4646
    """
    return saturation(temperature_c, pressure_hpa, "buck").pressure_hpa


def ice_saturation_pressure_hpa(temperature_c, pressure_hpa):
    """Saturation vapour pressure over ice, in hPa; never used unless asked for.

    temperature_c   air temperature, -50 to 0 °C
    pressure_hpa    total pressure, 500 to 1100 hPa

    Source: [RUEGER90] eq. 5.28 ([PARKER04] eq. 1.4). Good to 0.3 %.

    >>> round(float(ice_saturation_pressure_hpa(-10.0, 933.0)), 4)
    2.6096
    """
    t, p = np.asarray(temperature_c, float), np.asarray(pressure_hpa, float)
    return ICE_E0 * (ICE_F0 + ICE_FP * p) * np.exp(ICE_A * t / (ICE_B + t))


def iapws_saturation_pressure_hpa(temperature_c):
    """Saturation pressure of pure water over its liquid, no air present, in hPa.

    temperature_c   temperature, 0 to 370 °C; extrapolated to supercooled water down to -40 °C

    Source: [IAPWS97] eq. 30. Good to 0.025 % above 0 °C; below, 0.04 % above [MURPHY05] at -20 °C and 0.24 % at -40 °C.

    >>> round(float(iapws_saturation_pressure_hpa(300.0 - 273.15)), 5)
    35.36589
    """
    return _if97(np.asarray(temperature_c, float) + ZERO_CELSIUS_K)[0] / PA_PER_HPA


def enhancement_factor(temperature_c, pressure_hpa):
    """Saturation pressure in moist air over that of pure water, dimensionless.

    temperature_c   air temperature, -40 to 100 °C
    pressure_hpa    total pressure, 100 to 1400 hPa

    Source: [CIDDOR96] appendix A (f = alpha + beta p + gamma t²). Good to 1e-4 from 0 to 30 °C near 1000 hPa.

    >>> round(float(enhancement_factor(20.0, 1013.25)), 6)
    1.004026
    """
    t, p = np.asarray(temperature_c, float), np.asarray(pressure_hpa, float)
    return ENHANCEMENT_0 + ENHANCEMENT_P * PA_PER_HPA * p + ENHANCEMENT_T2 * t**2


def saturation(temperature_c, pressure_hpa, formula="buck") -> Saturation:
    """Saturation vapour pressure of moist air over liquid water with its slopes, by a named formula.

    temperature_c   air temperature, -40 to 50 °C (`ciddor` and `iapws`: to 100 °C)
    pressure_hpa    total pressure, 500 to 1100 hPa
    formula         `buck`, `ciddor` or `iapws`

    Source: [RUEGER90] eq. 5.27; [CIDDOR96] appendix A; [IAPWS97] eq. 30. Good to 0.1 %; the slopes are analytic.

    >>> round(float(saturation(20.0, 1013.25, "ciddor").pressure_hpa), 4)
    23.4858
    """
    if formula not in FORMULAS:
        raise ValidityError(f"saturation formula {formula!r} is unknown; choose one of {', '.join(FORMULAS)}")
    return FORMULAS[formula](np.asarray(temperature_c, float), np.asarray(pressure_hpa, float))


def vapour_pressure_hpa(temperature_c, pressure_hpa, humidity_percent, formula="buck"):
    """Partial pressure of water vapour from relative humidity over liquid water, in hPa.

    temperature_c      air temperature, -40 to 50 °C
    pressure_hpa       total pressure, 500 to 1100 hPa
    humidity_percent   relative humidity over liquid water, 0 to 100 %
    formula            `buck`, `ciddor` or `iapws`

    Source: [RUEGER90] eq. 5.29 ([PARKER04] eq. 1.5). Good to 0.1 % of itself, the formula's part.

    >>> round(float(vapour_pressure_hpa(20.0, 933.0, 50.0)), 4)
    11.7323
    """
    return saturation(temperature_c, pressure_hpa, formula).pressure_hpa * np.asarray(humidity_percent, float) / 100.0


def dew_point_c(vapour_pressure_hpa, pressure_hpa, formula="buck"):
    """Temperature at which this air, cooled at constant pressure, is saturated over liquid water, in °C.

    vapour_pressure_hpa   partial pressure of water vapour, 1e-9 to 1000 hPa; drier air has no dew point: nan
    pressure_hpa          total pressure, 500 to 1100 hPa
    formula               the one that gave the vapour pressure: then saturated air's dew point is its temperature

    Source: [PARKER04] eq. 1.7 for `buck`; the others are inverted by Newton's method in 1/T from there, at most
    eight steps, nan where a step still exceeds 1e-9 of T (`iapws` below -100 °C). The inversion is exact to 1e-9 °C.

    >>> round(float(dew_point_c(11.7323, 933.0)), 3)
    9.267
    """
    e, p = np.asarray(vapour_pressure_hpa, float), np.asarray(pressure_hpa, float)
    e = np.where(e >= DRY_BELOW_HPA, e, np.nan)
    log_ratio = np.log(e / (BUCK_E0 * (BUCK_F0 + BUCK_FP * p)))
    buck = BUCK_B * log_ratio / (BUCK_A - log_ratio)
    return buck if formula == "buck" else _newton_dew_point_c(e, p, formula, buck)


def _newton_dew_point_c(e, p, formula, start_c):
    kelvin, step = start_c + ZERO_CELSIUS_K, np.inf
    for _ in range(8):
        at = saturation(kelvin - ZERO_CELSIUS_K, p, formula)
        # ln E is nearly straight in 1/T, so that Newton's step is taken there
        step = np.log(e / at.pressure_hpa) * at.pressure_hpa / (at.per_c * kelvin)
        kelvin = kelvin / (1.0 - step)
    return np.where(np.abs(step) < 1e-9, kelvin - ZERO_CELSIUS_K, np.nan)[()]


def _buck(t, p) -> Saturation:
    factor = BUCK_F0 + BUCK_FP * p
    e = BUCK_E0 * factor * np.exp(BUCK_A * t / (BUCK_B + t))
    return Saturation(e, e * BUCK_A * BUCK_B / (BUCK_B + t) ** 2, e * BUCK_FP / factor)


def _ciddor(t, p) -> Saturation:
    kelvin = t + ZERO_CELSIUS_K
    pure = np.exp(CIDDOR_A * kelvin**2 + CIDDOR_B * kelvin + CIDDOR_C + CIDDOR_D / kelvin)
    return _enhanced(t, p, pure, pure * (2.0 * CIDDOR_A * kelvin + CIDDOR_B - CIDDOR_D / kelvin**2))


def _iapws(t, p) -> Saturation:
    return _enhanced(t, p, *_if97(t + ZERO_CELSIUS_K))


def _enhanced(t, p, pure_pa, pure_pa_per_c) -> Saturation:
    """Moist-air saturation from that of pure water: both Ciddor's and IAPWS's carry the same factor."""
    factor = enhancement_factor(t, p)
    pure, slope = pure_pa / PA_PER_HPA, pure_pa_per_c / PA_PER_HPA
    return Saturation(
        factor * pure, factor * slope + 2.0 * ENHANCEMENT_T2 * t * pure, ENHANCEMENT_P * PA_PER_HPA * pure
    )


def _if97(kelvin):
    """[IAPWS97] eq. 30 in Pa and its slope in Pa/K; the paper's theta, A, B, C."""
    n = IF97_N
    theta = kelvin + n[8] / (kelvin - n[9])
    theta_t = 1.0 - n[8] / (kelvin - n[9]) ** 2
    a, a_t = (theta + n[0]) * theta + n[1], (2.0 * theta + n[0]) * theta_t
    b, b_t = (n[2] * theta + n[3]) * theta + n[4], (2.0 * n[2] * theta + n[3]) * theta_t
    c, c_t = (n[5] * theta + n[6]) * theta + n[7], (2.0 * n[5] * theta + n[6]) * theta_t
    root = np.sqrt(b**2 - 4.0 * a * c)
    below = root - b
    below_t = (b * b_t - 2.0 * (a_t * c + a * c_t)) / root - b_t
    q = 2.0 * c / below
    return 1e6 * q**4, 4e6 * q**3 * 2.0 * (c_t * below - c * below_t) / below**2


FORMULAS: dict[str, Callable[..., Saturation]] = {"buck": _buck, "ciddor": _ciddor, "iapws": _iapws}
