"""Compiled form of `ciddor_hill1999`, for many states at one wavelength.

Import it only when a problem is large.

The plain form, `ciddor_hill1999.MODEL.refractivity` with Ciddor's vapour, is its test. One division a state: with
P and E the total and the vapour's pressure in Pa, x = E/P in [CIDDOR96]'s compressibility gives

    Z T = T - (a P + b E + c E²/P) + (d P² + e E²)/T,   n - 1 = (dry (P - E) + vapour E) / Z T,

and both sides of the fraction are multiplied by T P.
"""

import numpy as np

from catseye.atmosphere.index.air_kernel import (
    BLOCK,
    compiled,
    inlined,
    limits_of,
    over_states,
    part,
    saturation_polynomial,
    saturation_value,
)
from catseye.atmosphere.index.ciddor_hill1999 import A0, A1, A2, B0, B1, C0, C1, MODEL, D, E
from catseye.atmosphere.weather.humidity import (
    ENHANCEMENT_0,
    ENHANCEMENT_P,
    ENHANCEMENT_T2,
    PA_PER_HPA,
    enhancement_factor,
)
from catseye.constants import ZERO_CELSIUS_K

SATURATION = saturation_polynomial(MODEL, enhancement_factor)
COMPRESSIBILITY = (A0, A1, A2, B0, B1, C0, C1, D, E)
ENHANCEMENT = (ENHANCEMENT_0, ENHANCEMENT_P, ENHANCEMENT_T2)
ROOM = 1.0 - 1e-9  # largest vapour share of the pressure here; above it the plain form decides


@inlined
def _block(temperature_c, pressure_hpa, humidity_percent, values, coefficients, limits, saturation, moist):
    dry, vapour = coefficients
    t_low, t_high, p_low, p_high, h_low, h_high = limits
    middle, per_c, even, odd = saturation
    (a0, a1, a2, b0, b1, c0, c1, d, e2), (f0, fp, ft2) = moist
    outside = 0
    for i in range(len(values)):
        t, p, h = temperature_c[i], pressure_hpa[i], humidity_percent[i]
        x = PA_PER_HPA * p
        # h in % times pressure in hPa is pressure in Pa
        e = h * (f0 + fp * x + ft2 * t * t) * saturation_value(t, middle, per_c, even, odd)
        # written so that NaN is outside
        inside = (t >= t_low) & (t <= t_high) & (p >= p_low) & (p <= p_high) & (h >= h_low) & (h <= h_high)
        outside |= not (inside & (e <= ROOM * x))
        kelvin = t + ZERO_CELSIUS_K
        a, b, c = a0 + (a1 + a2 * t) * t, b0 + b1 * t, c0 + c1 * t
        linear = a * x * x + (b * x + c * e) * e
        square = (d * x * x + e2 * e * e) * x
        values[i] = (dry * (x - e) + vapour * e) * kelvin * x / (kelvin * (kelvin * x - linear) + square)
    return outside == 0


@compiled
def _fill(temperature_c, pressure_hpa, humidity_percent, values, coefficients, limits, saturation, moist):
    t, p, h = np.full(BLOCK, temperature_c[0]), np.full(BLOCK, pressure_hpa[0]), np.full(BLOCK, humidity_percent[0])
    for first in range(0, len(values), BLOCK):
        last = min(first + BLOCK, len(values))
        weather = (
            part(temperature_c, first, last, t),
            part(pressure_hpa, first, last, p),
            part(humidity_percent, first, last, h),
        )
        if not _block(*weather, values[first:last], coefficients, limits, saturation, moist):
            return False
    return True


def refractivity(temperature_c, pressure_hpa, humidity_percent, dry, vapour) -> tuple[np.ndarray, bool]:
    """Index of air minus one, (n,); True if all are within limits.

    If not, the values are invalid.

    temperature_c      (n,) or (1,), °C
    pressure_hpa       (n,) or (1,), hPa
    humidity_percent   (n,) or (1,), over liquid water, %
    dry                refractivity times K/Pa that a partial pressure of dry air adds: `MODEL.coefficients`
    vapour             the same for vapour

    Source: [CIDDOR96] eqs. 4, 5 and appendix A. Equal to the plain form within 1e-16. Also outside: more vapour than
    air has room for.

    Raises ValidityError for arrays of other lengths.

    >>> dry, vapour = MODEL.coefficients(0.780, 450.0, "group")
    >>> values, inside = refractivity([20.0, 15.0], [1013.25], [50.0, 0.0], dry, vapour)
    >>> [round(float(value) * 1e8, 3) for value in values], inside
    ([27515.137, 28036.156], True)
    """
    constants = ((float(dry), float(vapour)), limits_of(MODEL), tuple(SATURATION), (COMPRESSIBILITY, ENHANCEMENT))
    return over_states(_fill, (temperature_c, pressure_hpa, humidity_percent), constants)
