"""Compiled form of `rueger1990`, for many states at one wavelength.

Import it only when a problem is large.

The plain form, `rueger1990.MODEL.refractivity` with Buck's vapour, is its test. One division a state.
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
from catseye.atmosphere.index.rueger1990 import DRY_DENSITY, MODEL, VAPOUR_DENSITY, VAPOUR_SQUARE
from catseye.atmosphere.weather.humidity import BUCK_F0, BUCK_FP
from catseye.constants import ZERO_CELSIUS_K

SATURATION = saturation_polynomial(MODEL, lambda t, p: BUCK_F0 + BUCK_FP * p)
DENSITY = (*DRY_DENSITY, *VAPOUR_DENSITY, VAPOUR_SQUARE, ZERO_CELSIUS_K, 0.01 * BUCK_F0, 0.01 * BUCK_FP)


@inlined
def _block(temperature_c, pressure_hpa, humidity_percent, values, coefficients, limits, saturation, density):
    dry, vapour = coefficients
    t_low, t_high, p_low, p_high, h_low, h_high = limits
    middle, per_c, even, odd = saturation
    b0, b1, b2, q0, q1, q2, q3, square, zero, f0, fp = density
    outside = 0
    for i in range(len(values)):
        t, p, h = temperature_c[i], pressure_hpa[i], humidity_percent[i]
        # written so that NaN is outside
        inside = (t >= t_low) & (t <= t_high) & (p >= p_low) & (p <= p_high) & (h >= h_low) & (h <= h_high)
        outside |= not inside
        e = h * (f0 + fp * p) * saturation_value(t, middle, per_c, even, odd)
        s = p - e
        r = 1.0 / (t + zero)
        b = (b2 * r + b1) * r + b0
        q = ((q3 * r + q2) * r + q1) * r + q0
        values[i] = r * (dry * (s + s * s * b) + vapour * (e + e * e * (1.0 + square * e) * q))
    return outside == 0


@compiled
def _fill(temperature_c, pressure_hpa, humidity_percent, values, coefficients, limits, saturation, density):
    t, p, h = np.full(BLOCK, temperature_c[0]), np.full(BLOCK, pressure_hpa[0]), np.full(BLOCK, humidity_percent[0])
    for first in range(0, len(values), BLOCK):
        last = min(first + BLOCK, len(values))
        weather = (
            part(temperature_c, first, last, t),
            part(pressure_hpa, first, last, p),
            part(humidity_percent, first, last, h),
        )
        if not _block(*weather, values[first:last], coefficients, limits, saturation, density):
            return False
    return True


def refractivity(temperature_c, pressure_hpa, humidity_percent, dry, vapour) -> tuple[np.ndarray, bool]:
    """Index of air minus one, (n,); True if all are within limits.

    If not, the values are invalid.

    temperature_c      (n,) or (1,), °C
    pressure_hpa       (n,) or (1,), hPa
    humidity_percent   (n,) or (1,), over liquid water, %
    dry                refractivity per unit of the dry air's density factor, K/hPa: `MODEL.coefficients`
    vapour             of the vapour's

    Source: [PARKER04] eqs. 1.3, 1.5, 1.23-1.25. Equal to the plain form within 1e-17.

    Raises ValidityError for arrays of other lengths.

    >>> dry, vapour = MODEL.coefficients(0.780, 300.0, "group")
    >>> values, inside = refractivity([20.0, 20.0], [933.0], [50.0], dry, vapour)
    >>> round(float(values[1]) * 1e6, 6), inside
    (253.246815, True)
    """
    constants = ((float(dry), float(vapour)), limits_of(MODEL), tuple(SATURATION), DENSITY)
    return over_states(_fill, (temperature_c, pressure_hpa, humidity_percent), constants)
