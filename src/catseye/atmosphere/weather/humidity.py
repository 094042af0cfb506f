"""Humidity: saturation over water and ice, vapour pressure, dew and frost point.

Relative humidity is over liquid water at all temperatures (the meteorologists' convention); ice is never a
default. Three formulas for moist air saturated over water are registered by name: `buck` (the notes'), `ciddor` (the
one that reproduces Ciddor's tables) and `iapws` (today's reference for pure water, with Ciddor's enhancement factor).
They agree within 0.1 % from -20 to 50 °C, which is 2e-9 in the index of saturated air at 30 °C. Over ice there are
`buck` (the notes') and `iapws` (today's sublimation pressure with Greenspan's enhancement factor for ice), within
0.1 % of each other from -40 to 0 °C.

Below 0 °C the same vapour has a dew point and, nearer to the air's temperature, a frost point: at a dew point of
-10 °C the frost point is -8.9 °C. Which of them an instrument shows is not in its reading (see
`atmosphere.index.hygrometer`).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.limit import ValidInterval
from catseye.constants import ZERO_CELSIUS_K
from catseye.errors import ValidityError

PA_PER_HPA = 100.0
MELTING_C = 0.01  # the triple point: no ice above it
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
# [IAPWS11] eq. 6: ln(p/p_t) = (1/theta) sum a theta^b, theta = T/T_t
SUBLIMATION = (
    (-0.212144006e2, 0.333333333e-2),
    (0.273203819e2, 0.120666667e1),
    (-0.610598130e1, 0.170333333e1),
)
TRIPLE_K, TRIPLE_PA = 273.16, 611.657
# [GREENSPAN76] over ice: polynomials in °C of alpha and of ln beta in ln f = alpha (1 - e/p) + beta (p/e - 1)
GREENSPAN_ALPHA = (3.64449e-4, 2.93631e-5, 4.88635e-7, 4.36543e-9)
GREENSPAN_LN_BETA = (-1.07271e1, 7.61989e-2, -1.74771e-4, 2.46721e-6)

# a chilled mirror reads far below the air's limits; docstrings give the quality of the extrapolation
PRESSURE = ValidInterval("pressure", "hPa", 100.0, 1400.0, "[CIDDOR96]'s enhancement of saturation")
OVER_ICE = ValidInterval("temperature of ice", "°C", -100.0, MELTING_C, "ice", places=2)
AIR_TEMPERATURE = ValidInterval("temperature", "°C", -100.0, 100.0, "saturation over water")
HUMIDITY = ValidInterval("relative humidity", "%", 0.0, 100.0, "unsaturated air")
OVER_ICE_HUMIDITY = ValidInterval(
    "relative humidity over ice", "%", 0.0, 300.0, "supersaturation over ice"
)  # 265 % at -100 °C
VAPOUR_PRESSURE = ValidInterval("vapour pressure", "hPa", 0.0, 1400.0, "the definition of a pressure")


class Saturation(NamedTuple):
    """Saturation vapour pressure of moist air and its slopes.

    pressure_hpa   hPa
    per_c          derivative by temperature, hPa/°C
    per_hpa        derivative by total pressure, hPa/hPa
    """

    pressure_hpa: Any
    per_c: Any
    per_hpa: Any


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
    """Saturation pressure of moist air over liquid water, by a named formula.

    With its slopes.

    temperature_c   air temperature, -40 to 50 °C (`ciddor` and `iapws`: to 100 °C)
    pressure_hpa    total pressure, 500 to 1100 hPa
    formula         `buck`, `ciddor` or `iapws`

    Only the formula's name is checked, as solvers iterate here.
    Source: [RUEGER90] eq. 5.27 ([PARKER04] eq. 1.3; at a dew point eq. 1.6); [CIDDOR96] appendix A; [IAPWS97] eq. 30.
    Good to 0.1 % from -20 to 50 °C; `buck` is 0.8 % low at -40 °C, `iapws` for pure water 0.04 % above [MURPHY05] at
    -20 °C and 0.24 % at -40 °C. The slopes are analytic.

    >>> round(float(saturation(20.0, 1013.25, "ciddor").pressure_hpa), 4)
    23.4858
    """
    _refuse_unknown(formula, FORMULAS)
    return FORMULAS[formula](np.asarray(temperature_c, float), np.asarray(pressure_hpa, float))


def ice_saturation(temperature_c, pressure_hpa, formula="buck") -> Saturation:
    """Saturation pressure of moist air over ice, by a named formula.

    With its slopes.

    temperature_c   temperature of the ice, -100 to 0.01 °C
    pressure_hpa    total pressure, 100 to 1400 hPa
    formula         `buck` or `iapws` (Ciddor gives none over ice)

    Raises ValidityError outside these limits: there is no ice above 0.01 °C.
    Source: [RUEGER90] eq. 5.28 ([PARKER04] eq. 1.4; at a frost point eq. 1.6); [IAPWS11] eq. 6 with the enhancement
    factor over ice of [GREENSPAN76]. `iapws` is good to 0.06 % from -40 to 0 °C: the sublimation pressure lies within
    0.024 % of [MURPHY05] eq. 7, the enhancement factor 2e-4 (0 °C) to 6e-4 (-40 °C) below the one of the IAPWS virial
    coefficients of moist air. `buck` lies within 0.1 % of it from -40 to 0 °C and 1 % low at -80 °C. The slopes are
    analytic.

    >>> round(float(ice_saturation(-10.0, 1013.25, "iapws").pressure_hpa), 4)
    2.6092
    """
    _refuse_unknown(formula, ICE_FORMULAS, " over ice")
    OVER_ICE.check(temperature_c)
    PRESSURE.check(pressure_hpa)
    return ICE_FORMULAS[formula](np.asarray(temperature_c, float), np.asarray(pressure_hpa, float))


def vapour_pressure_hpa(temperature_c, pressure_hpa, humidity_percent, formula="buck", *, over_ice=False):
    """Vapour pressure from relative humidity, hPa, over liquid water by default.

    temperature_c      air temperature, -40 to 50 °C
    pressure_hpa       total pressure, 500 to 1100 hPa
    humidity_percent   relative humidity, 0 to 100 %; air in clouds exceeds 100 % over ice
    formula            `buck`, `ciddor` or `iapws`; over ice `buck` or `iapws`
    over_ice           the humidity is stated over ice, which few instruments and no weather service does

    Raises ValidityError outside -100 to 100 °C (over ice, 0.01 °C), 100 to 1400 hPa, and 0 to 100 % (300 %).
    Source: [RUEGER90] eq. 5.29 ([PARKER04] eq. 1.5). Good to 0.1 % of itself, for the formula.

    >>> round(float(vapour_pressure_hpa(20.0, 933.0, 50.0)), 4)
    11.7323
    """
    AIR_TEMPERATURE.check(temperature_c)
    PRESSURE.check(pressure_hpa)
    (OVER_ICE_HUMIDITY if over_ice else HUMIDITY).check(humidity_percent)
    saturated = (ice_saturation if over_ice else saturation)(temperature_c, pressure_hpa, formula)
    return saturated.pressure_hpa * np.asarray(humidity_percent, float) / 100.0


def relative_humidity_percent(vapour_pressure_hpa, temperature_c, pressure_hpa, *, formula="buck", over_ice=False):
    """Relative humidity from vapour pressure, %, over liquid water by default.

    vapour_pressure_hpa   partial pressure of water vapour, 0 to 1400 hPa; above saturation the result is above 100 %
    temperature_c         air temperature, -100 to 100 °C
    pressure_hpa          total pressure, 100 to 1400 hPa
    formula               the one that gave the vapour pressure
    over_ice              relative to saturation over ice, at most 0.01 °C

    Raises ValidityError outside these limits.
    Source: [RUEGER90] eq. 5.29, inverted. Exact.

    >>> round(float(relative_humidity_percent(11.7323, 20.0, 933.0)), 3)
    50.0
    """
    VAPOUR_PRESSURE.check(vapour_pressure_hpa)
    AIR_TEMPERATURE.check(temperature_c)
    PRESSURE.check(pressure_hpa)
    saturated = (ice_saturation if over_ice else saturation)(temperature_c, pressure_hpa, formula)
    return 100.0 * np.asarray(vapour_pressure_hpa, float) / saturated.pressure_hpa


def dew_point_c(vapour_pressure_hpa, pressure_hpa, formula="buck"):
    """Dew point of air, °C.

    The temperature at which this air, cooled at constant pressure, is saturated over liquid water.

    vapour_pressure_hpa   partial pressure of water vapour, 1e-9 to 1000 hPa; drier air has no dew point: nan
    pressure_hpa          total pressure, 500 to 1100 hPa
    formula               the one that gave the vapour pressure: then saturated air's dew point is its temperature

    Raises ValidityError for a vapour pressure outside 0 to 1400 hPa or a pressure outside 100 to 1400 hPa.
    Source: [PARKER04] eq. 1.7 for `buck`; the others are inverted by Newton's method in 1/T from there, at most
    eight steps, nan where a step still exceeds 1e-9 of T (`iapws` below -100 °C). The inversion is exact to 1e-9 °C.

    >>> round(float(dew_point_c(11.7323, 933.0)), 3)
    9.267
    """
    _refuse_unknown(formula, FORMULAS)
    VAPOUR_PRESSURE.check(vapour_pressure_hpa)
    PRESSURE.check(pressure_hpa)
    e, p = _with_vapour(vapour_pressure_hpa), np.asarray(pressure_hpa, float)
    buck = _buck_inverse(np.log(e / (BUCK_E0 * (BUCK_F0 + BUCK_FP * p))), BUCK_A, BUCK_B)
    return buck if formula == "buck" else _newton_c(e, p, FORMULAS[formula], buck)


def frost_point_c(vapour_pressure_hpa, pressure_hpa, formula="buck"):
    """Frost point of air, °C.

    The temperature at which this air, cooled at constant pressure, is saturated over ice.

    vapour_pressure_hpa   partial pressure of water vapour, hPa; nan where it has no frost point: drier than 1e-9 hPa,
                          or so moist (6.14 hPa) that dew forms above 0.01 °C
    pressure_hpa          total pressure, 500 to 1100 hPa
    formula               `buck` or `iapws`, the one that gave the vapour pressure

    Raises ValidityError as `dew_point_c`.
    Source: [PARKER04] eqs. 1.4, 1.6 solved as 1.7 is; `iapws` by Newton's method from there, at most eight steps, nan
    where a step still exceeds 1e-9 of T. The inversion is exact to 1e-9 °C.

    >>> round(float(frost_point_c(2.6096, 933.0)), 3)
    -10.0
    """
    _refuse_unknown(formula, ICE_FORMULAS, " over ice")
    VAPOUR_PRESSURE.check(vapour_pressure_hpa)
    PRESSURE.check(pressure_hpa)
    e, p = _with_vapour(vapour_pressure_hpa), np.asarray(pressure_hpa, float)
    buck = _buck_inverse(np.log(e / (ICE_E0 * (ICE_F0 + ICE_FP * p))), ICE_A, ICE_B)
    frost = buck if formula == "buck" else _newton_c(e, p, ICE_FORMULAS[formula], buck)
    return np.where(frost <= MELTING_C + 1e-9, frost, np.nan)[()]


def _refuse_unknown(formula, formulas, where=""):
    if formula not in formulas:
        raise ValidityError(f"saturation formula {formula!r} is unknown{where}; choose one of {', '.join(formulas)}")


def _with_vapour(vapour_pressure_hpa):
    e = np.asarray(vapour_pressure_hpa, float)
    return np.where(e >= DRY_BELOW_HPA, e, np.nan)


def _buck_inverse(log_ratio, a, b):
    return b * log_ratio / (a - log_ratio)


def _newton_c(e, p, saturated, start_c):
    kelvin, step = start_c + ZERO_CELSIUS_K, np.inf
    for _ in range(8):
        at = saturated(kelvin - ZERO_CELSIUS_K, p)
        # ln E is nearly straight in 1/T, so that Newton's step is taken there
        step = np.log(e / at.pressure_hpa) * at.pressure_hpa / (at.per_c * kelvin)
        kelvin = kelvin / (1.0 - step)
    return np.where(np.abs(step) < 1e-9, kelvin - ZERO_CELSIUS_K, np.nan)[()]


def _buck(t, p) -> Saturation:
    factor = BUCK_F0 + BUCK_FP * p
    e = BUCK_E0 * factor * np.exp(BUCK_A * t / (BUCK_B + t))
    return Saturation(e, e * BUCK_A * BUCK_B / (BUCK_B + t) ** 2, e * BUCK_FP / factor)


def _buck_ice(t, p) -> Saturation:
    factor = ICE_F0 + ICE_FP * p
    e = ICE_E0 * factor * np.exp(ICE_A * t / (ICE_B + t))
    return Saturation(e, e * ICE_A * ICE_B / (ICE_B + t) ** 2, e * ICE_FP / factor)


def _ciddor(t, p) -> Saturation:
    kelvin = t + ZERO_CELSIUS_K
    pure = np.exp(CIDDOR_A * kelvin**2 + CIDDOR_B * kelvin + CIDDOR_C + CIDDOR_D / kelvin)
    return _enhanced(t, p, pure, pure * (2.0 * CIDDOR_A * kelvin + CIDDOR_B - CIDDOR_D / kelvin**2))


def _iapws(t, p) -> Saturation:
    return _enhanced(t, p, *_if97(t + ZERO_CELSIUS_K))


def _iapws_ice(t, p) -> Saturation:
    """Sublimation pressure times Greenspan's factor f.

    ln f = alpha (1 - e/p) + beta (p/e - 1), e that of pure ice.
    """
    e, e_t = (value / PA_PER_HPA for value in _sublimation(t + ZERO_CELSIUS_K))
    alpha, alpha_t = _polynomial(GREENSPAN_ALPHA, t)
    ln_beta, ln_beta_t = _polynomial(GREENSPAN_LN_BETA, t)
    beta = np.exp(ln_beta)
    factor = np.exp(alpha * (1.0 - e / p) + beta * (p / e - 1.0))
    by_e = -alpha / p - beta * p / e**2
    ln_f_t = alpha_t * (1.0 - e / p) + beta * ln_beta_t * (p / e - 1.0) + by_e * e_t
    ln_f_p = alpha * e / p**2 + beta / e
    return Saturation(factor * e, factor * (e_t + e * ln_f_t), factor * e * ln_f_p)


def _sublimation(kelvin):
    """[IAPWS11] eq. 6, Pa, and slope, Pa/K: terms of ln(p/p_t) are a theta^(b - 1)."""
    theta = kelvin / TRIPLE_K
    pressure = TRIPLE_PA * np.exp(sum(a * theta ** (b - 1.0) for a, b in SUBLIMATION))
    return pressure, pressure * sum(a * (b - 1.0) * theta ** (b - 2.0) for a, b in SUBLIMATION) / TRIPLE_K


def _polynomial(coefficients, t):
    value = sum(c * t**i for i, c in enumerate(coefficients))
    return value, sum(i * c * t ** (i - 1) for i, c in enumerate(coefficients) if i)


def _enhanced(t, p, pure_pa, pure_pa_per_c) -> Saturation:
    """Moist-air saturation from that of pure water, with the common enhancement factor."""
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
ICE_FORMULAS: dict[str, Callable[..., Saturation]] = {"buck": _buck_ice, "iapws": _iapws_ice}


LEAST_RESOLVED = 1.0  # %: hygrometers have u of 1 to 3 %, so that values between 0 and this are not plausible


def likely_fraction(humidity_percent) -> bool:
    """True where all humidities are above 0 and at most 1 %: likely fractions.

    humidity_percent   relative humidity, %; NaN where not read

    >>> likely_fraction(0.5), likely_fraction(0.0), likely_fraction([0.5, 40.0])
    (True, False, False)
    """
    values = _read(humidity_percent)
    return bool(values.size and np.all((values > 0.0) & (values <= LEAST_RESOLVED)))


def fraction_words(humidity_percent) -> str:
    """Text with both interpretations of a humidity that is likely a fraction."""
    first = float(_read(humidity_percent)[0])
    return f"a humidity of {first:g} % is below hygrometers' resolution; as a fraction it would be {100.0 * first:g} %"


def _read(humidity_percent) -> np.ndarray:
    values = np.ravel(np.asarray(humidity_percent, float))
    return values[np.isfinite(values)]


def humidity_doubts(humidity_percent) -> tuple[str, ...]:
    """Texts for humidities that are likely fractions of 1; empty if percent.

    humidity_percent   relative humidity, %

    >>> humidity_doubts([0.41, 0.43])
    ("a humidity of 0.41 % is below hygrometers' resolution; as a fraction it would be 41 %",)
    >>> humidity_doubts([41.0, 43.0])
    ()
    """
    return (fraction_words(humidity_percent),) if likely_fraction(humidity_percent) else ()
