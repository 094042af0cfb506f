"""Psychrometer: vapour pressure from dry and wet bulb, and back.

The bulb's film may be water or ice.

The notes' listing REFRACT.EQ has both formulas as eq523 and eq524, with saturation at the *wet* bulb's temperature
`tp`. Further down it sets tp = t for the relative humidity: evaluating eq523 after that line gives (t - tp) = 0
and saturated air for any readings. Here the two temperatures are two arguments.

Below 0 °C a wick may hold supercooled water or ice, and the thermometers do not show which: bulbs at
-5 °C and -6 °C mean 0.15 hPa less with ice, 3.5 % of relative humidity. The observer checks and sets `over_ice`.
"""

from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.limit import ValidInterval
from catseye.atmosphere.weather.humidity import (
    DRY_BELOW_HPA,
    ICE_FORMULAS,
    MELTING_C,
    PRESSURE,
    VAPOUR_PRESSURE,
    Saturation,
    ice_saturation,
    saturation,
)
from catseye.errors import ValidityError

# [RUEGER90] eqs. 5.23, 5.24: for a bulb ventilated at 3 m/s or more, 1/°C
WATER_PER_C, ICE_PER_C = 0.000662, 0.000583
U_COEFFICIENT = 0.01  # of itself: [WMO18] has as much at 15 °C, 1.4 % less at 0 °C and over ice
STEPS = 30
ROUNDING = 2e-3  # tolerance for the crossing of the formulas over water and ice at 0 °C

DRY_BULB = ValidInterval("dry bulb", "°C", -40.0, 60.0, "[RUEGER90] eq. 5.23")
WET_BULB = ValidInterval("wet bulb", "°C", -40.0, 60.0, "[RUEGER90] eq. 5.23")
ICE_BULB = ValidInterval("wet bulb with ice", "°C", -40.0, MELTING_C, "[RUEGER90] eq. 5.24", places=2)


class WetBulbPartials(NamedTuple):
    """Derivatives of the vapour pressure from a psychrometer.

    temperature_c   per °C of the dry bulb, hPa
    wet_bulb_c      per °C of the wet bulb, hPa
    pressure_hpa    per hPa of total pressure
    """

    temperature_c: Any
    wet_bulb_c: Any
    pressure_hpa: Any


def vapour_pressure_of_wet_bulb_hpa(temperature_c, wet_bulb_c, pressure_hpa, *, over_ice=False, formula="buck"):
    """Vapour pressure from a ventilated psychrometer, hPa.

    temperature_c   dry bulb, -40 to 60 °C
    wet_bulb_c      wet bulb, at most the dry one; -40 to 0.01 °C with ice on it. Over an ice bulb air may be
                    supersaturated: then the bulb may read above the dry one, as long as the air is not saturated over
                    water
    pressure_hpa    total pressure, 100 to 1400 hPa
    over_ice        the wick is frozen
    formula         of saturation: `buck` as printed, or `iapws`, or over water `ciddor`

    Raises ValidityError outside these limits, and where the readings imply a negative vapour pressure.
    Source: [RUEGER90] eqs. 5.23, 5.24. As good as the ventilation: 1 % of p A (t - t_wet).

    >>> round(float(vapour_pressure_of_wet_bulb_hpa(20.0, 14.0, 933.0)), 3)
    12.336
    """
    t, wet, p = (np.asarray(value, float) for value in (temperature_c, wet_bulb_c, pressure_hpa))
    DRY_BULB.check(t)
    (ICE_BULB if over_ice else WET_BULB).check(wet)
    PRESSURE.check(p)
    if not over_ice:
        _refuse(wet > t, "wet bulb {0:g} °C is above the dry bulb, {1:g} °C; are the two exchanged?", wet, t)
    e = _saturated(wet, p, over_ice, formula).pressure_hpa - _coefficient(over_ice) * p * (t - wet)
    _refuse(
        e < -DRY_BELOW_HPA,
        "dry bulb {0:g} °C, wet bulb {1:g} °C at {2:g} hPa give a negative vapour pressure, {3:.2f} hPa; "
        "is a thermometer wrong?",
        *(t, wet, p, e),
    )
    e = np.where(np.abs(e) <= DRY_BELOW_HPA, 0.0, e)[()]  # rounding in perfectly dry air
    if over_ice:
        most = saturation(t, p, formula).pressure_hpa
        _refuse(
            e > most * (1.0 + ROUNDING),
            "wet bulb {0:g} °C with ice needs {1:.3f} hPa of vapour, more than water at the dry bulb's {2:g} °C "
            "allows, {3:.3f} hPa; are the two exchanged?",
            *(wet, e, t, most),
        )
    return e


def wet_bulb_partials(temperature_c, wet_bulb_c, pressure_hpa, *, over_ice=False, formula="buck") -> WetBulbPartials:
    """Derivatives of `vapour_pressure_of_wet_bulb_hpa`, without checks.

    Arguments as there.

    Source: [RUEGER90] eqs. 5.23, 5.24 differentiated.

    >>> [round(float(slope), 4) for slope in wet_bulb_partials(20.0, 14.0, 933.0)]
    [-0.6176, 1.6583, -0.0039]
    """
    t, wet, p = (np.asarray(value, float) for value in (temperature_c, wet_bulb_c, pressure_hpa))
    at, a = _saturated(wet, p, over_ice, formula), _coefficient(over_ice)
    return WetBulbPartials(-a * p, at.per_c + a * p, at.per_hpa - a * (t - wet))


def wet_bulb_c(temperature_c, vapour_pressure_hpa, pressure_hpa, *, over_ice=False, formula="buck"):
    """Wet bulb temperature of a ventilated psychrometer in this air, °C.

    temperature_c         dry bulb, -40 to 60 °C
    vapour_pressure_hpa   partial pressure of water vapour, from 0 to saturation over water
    pressure_hpa          total pressure, 100 to 1400 hPa
    over_ice              the wick is frozen; nan where its ice would melt
    formula               as in `vapour_pressure_of_wet_bulb_hpa`

    Raises ValidityError outside these limits. Newton's method, at most 30 steps: the balance rises and bends upwards
    with the wet bulb, so that it comes down on the root; nan where a step still exceeds 1e-9 °C.
    Source: [RUEGER90] eqs. 5.23, 5.24 inverted. Exact to 1e-9 °C.

    >>> round(float(wet_bulb_c(20.0, 12.336, 933.0)), 3)
    14.0
    """
    t, e, p = (np.asarray(value, float) for value in (temperature_c, vapour_pressure_hpa, pressure_hpa))
    DRY_BULB.check(t)
    VAPOUR_PRESSURE.check(e)
    PRESSURE.check(p)
    most = saturation(t, p, formula).pressure_hpa
    _refuse(
        e > most * (1.0 + ROUNDING),
        "vapour pressure {0:.3f} hPa is above saturation over water at {1:g} °C, {2:.3f} hPa; no wet bulb can show it",
        *(e, t, most),
    )
    _saturated(0.0, p, over_ice, formula)  # refuses an unknown formula
    a = _coefficient(over_ice)
    wet, step = np.where(over_ice, np.minimum(t, 0.0), t) + 0.0 * (e + p), np.inf
    for _ in range(STEPS):
        at = ICE_FORMULAS[formula](wet, p) if over_ice else saturation(wet, p, formula)  # on its way it may pass 0 °C
        step = (at.pressure_hpa - a * p * (t - wet) - e) / (at.per_c + a * p)
        wet = wet - step
    settled = (np.abs(step) < 1e-9) & ((wet <= MELTING_C) | (not over_ice))
    return np.where(settled, wet, np.nan)[()]


def _coefficient(over_ice):
    return ICE_PER_C if over_ice else WATER_PER_C


def _saturated(wet, p, over_ice, formula) -> Saturation:
    return (ice_saturation if over_ice else saturation)(wet, p, formula)


def _refuse(bad, text, *values) -> None:
    """Raise ValidityError with the mask of bad places, text filled with the first."""
    if not np.any(bad):
        return
    bad, *columns = np.broadcast_arrays(bad, *values)
    at = int(np.flatnonzero(bad)[0])
    where = f"element {at} of {bad.size}: " if bad.ndim else ""
    message = where + text.format(*(float(column.flat[at]) for column in columns))
    raise ValidityError(message, bad if bad.ndim else None)
