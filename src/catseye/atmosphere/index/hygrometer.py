"""Hygrometer readings to vapour pressure and index of air, with uncertainty.

One reading, four instruments: relative humidity, dew point or frost point of a chilled mirror, wet bulb. Each has its
own derivatives by the air's temperature and pressure: a capacitive sensor needs the temperature to give a vapour
pressure, a mirror does not. An error of the thermometer therefore enters the index twice with the first, once with
the second, and `index_uncertainty` adds both effects before it squares.
"""

from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.index.model import Partials
from catseye.atmosphere.limit import ValidInterval, check_spreads
from catseye.atmosphere.weather import humidity, psychrometer
from catseye.errors import ValidityError

# relative standard uncertainty of the saturation formulas: the span of their disagreement over root three
U_OVER_WATER = {"buck": 6e-4, "ciddor": 6e-4, "iapws": 2e-4}
U_OVER_ICE = {"buck": 1e-3, "iapws": 4e-4}

MIRROR = ValidInterval("mirror", "°C", -100.0, 100.0, "saturation")
DEPOSITS = ("dew", "frost")


class VapourReading(NamedTuple):
    """Vapour pressure from a reading, with its derivatives.

    vapour_pressure_hpa   hPa
    per_temperature_c     derivative by the air's temperature, the reading held, hPa/°C
    per_pressure_hpa      derivative by total pressure, the reading held
    per_reading           derivative by the reading, hPa per % or per °C
    u_formula_hpa         standard uncertainty of the formula itself, hPa
    """

    vapour_pressure_hpa: Any
    per_temperature_c: Any
    per_pressure_hpa: Any
    per_reading: Any
    u_formula_hpa: Any

    def standard_uncertainty_hpa(self, u_reading, *, u_temperature_c=0.0, u_pressure_hpa=0.0):
        """Standard uncertainty of the vapour pressure from uncorrelated inputs, hPa.

        Inputs are 1 sigma each; the formula's is included.

        u_reading         of the humidity in %, or of the mirror or wet bulb in °C
        u_temperature_c   of the air's temperature, °C
        u_pressure_hpa    of the total pressure, hPa

        Source: [JCGM100] eq. 10.

        >>> round(float(of_relative_humidity(20.0, 933.0, 50.0).standard_uncertainty_hpa(2.0)), 3)
        0.469
        """
        check_spreads(u_reading=u_reading, u_temperature_c=u_temperature_c, u_pressure_hpa=u_pressure_hpa)
        return _root_sum(
            self.per_reading * u_reading,
            self.per_temperature_c * u_temperature_c,
            self.per_pressure_hpa * u_pressure_hpa,
            self.u_formula_hpa,
        )

    def index_uncertainty(self, partials: Partials, u_reading, *, u_temperature_c=0.0, u_pressure_hpa=0.0, u_model=0.0):
        """Standard uncertainty of the index of air from this reading.

        partials          derivatives of the index with vapour pressure held, as `air.group_partials` gives
        u_reading         of the humidity in %, or of the mirror or wet bulb in °C
        u_temperature_c   of the air's temperature, °C: it affects the air's density and the vapour together
        u_pressure_hpa    of the total pressure, hPa, likewise
        u_model           of the model of the index itself

        Source: [JCGM100] eq. 10, with the chain rule through the vapour pressure.
        """
        check_spreads(
            u_reading=u_reading, u_temperature_c=u_temperature_c, u_pressure_hpa=u_pressure_hpa, u_model=u_model
        )
        by_vapour = partials.vapour_pressure_hpa
        return _root_sum(
            by_vapour * self.per_reading * u_reading,
            (partials.temperature_c + by_vapour * self.per_temperature_c) * u_temperature_c,
            (partials.pressure_hpa + by_vapour * self.per_pressure_hpa) * u_pressure_hpa,
            by_vapour * self.u_formula_hpa,
            u_model,
        )


def of_relative_humidity(
    temperature_c, pressure_hpa, humidity_percent, *, formula="buck", over_ice=False
) -> VapourReading:
    """Vapour pressure from relative humidity, over liquid water by default.

    temperature_c      air temperature, -100 to 100 °C
    pressure_hpa       total pressure, 100 to 1400 hPa
    humidity_percent   0 to 100 %; over ice to 300 %, since air in clouds is supersaturated over ice
    formula            `buck`, `ciddor` or `iapws`; over ice `buck` or `iapws`
    over_ice           the humidity is stated over ice

    Raises ValidityError outside these limits.
    Source: [RUEGER90] eq. 5.29.

    >>> round(float(of_relative_humidity(20.0, 933.0, 50.0).vapour_pressure_hpa), 4)
    11.7323
    """
    humidity.AIR_TEMPERATURE.check(temperature_c)
    humidity.PRESSURE.check(pressure_hpa)
    (humidity.OVER_ICE_HUMIDITY if over_ice else humidity.HUMIDITY).check(humidity_percent)
    share = np.asarray(humidity_percent, float) / 100.0
    at = _saturated(temperature_c, pressure_hpa, formula, over_ice)
    e = share * at.pressure_hpa
    u = _u_formula(formula, over_ice) * e
    return VapourReading(e, share * at.per_c, share * at.per_hpa, at.pressure_hpa / 100.0, u)


def of_mirror(mirror_c, pressure_hpa, formula="buck", *, deposit=None) -> VapourReading:
    """Vapour pressure from the deposit temperature of a chilled mirror.

    mirror_c       dew or frost point, -100 to 100 °C; with frost at most 0.01 °C
    pressure_hpa   total pressure, 100 to 1400 hPa
    formula        `buck`, `ciddor` or `iapws`; over ice `buck` or `iapws`
    deposit        `dew` or `frost`; optional where no reading is below 0 °C

    Raises ValidityError outside these limits, and where the deposit of a reading below 0 °C is not given: at
    -10 °C frost means 9 % less vapour than dew.
    Source: [PARKER04] eq. 1.6.

    >>> round(float(of_mirror(-10.0, 933.0, deposit="frost").vapour_pressure_hpa), 4)
    2.6096
    """
    MIRROR.check(mirror_c)
    humidity.PRESSURE.check(pressure_hpa)
    if deposit not in (None, *DEPOSITS):
        raise ValidityError(f"deposit {deposit!r} is unknown; choose one of {', '.join(DEPOSITS)}")
    open_question = np.asarray(mirror_c, float) < 0.0
    if deposit is None and np.any(open_question):
        coldest = float(np.min(mirror_c))
        raise ValidityError(
            f"a mirror at {coldest:g} °C may carry dew or frost; give deposit",
            open_question if open_question.ndim else None,
        )
    frost = deposit == "frost"
    at = _saturated(mirror_c, pressure_hpa, formula, frost)
    u = _u_formula(formula, frost) * at.pressure_hpa
    return VapourReading(at.pressure_hpa, np.zeros_like(at.pressure_hpa), at.per_hpa, at.per_c, u)


def of_wet_bulb(temperature_c, wet_bulb_c, pressure_hpa, *, formula="buck", over_ice=False) -> VapourReading:
    """Vapour pressure from a ventilated psychrometer.

    Limits and errors as of `vapour_pressure_of_wet_bulb_hpa`.

    temperature_c   dry bulb, °C, which is the air's temperature
    wet_bulb_c      wet bulb, °C
    pressure_hpa    total pressure, hPa
    formula         of saturation, `buck` as printed
    over_ice        the wick is frozen

    Source: [RUEGER90] eqs. 5.23, 5.24. Its own uncertainty is that of saturation and 1 % of the coefficient.

    >>> round(float(of_wet_bulb(20.0, 14.0, 933.0).u_formula_hpa), 3)
    0.038
    """
    e = psychrometer.vapour_pressure_of_wet_bulb_hpa(
        temperature_c, wet_bulb_c, pressure_hpa, over_ice=over_ice, formula=formula
    )
    slopes = psychrometer.wet_bulb_partials(temperature_c, wet_bulb_c, pressure_hpa, over_ice=over_ice, formula=formula)
    saturated = _saturated(wet_bulb_c, pressure_hpa, formula, over_ice).pressure_hpa
    u = _root_sum(_u_formula(formula, over_ice) * saturated, psychrometer.U_COEFFICIENT * (saturated - e))
    return VapourReading(e, slopes.temperature_c, slopes.pressure_hpa, slopes.wet_bulb_c, u)


def _saturated(temperature_c, pressure_hpa, formula, over_ice):
    return (humidity.ice_saturation if over_ice else humidity.saturation)(temperature_c, pressure_hpa, formula)


def _u_formula(formula, over_ice):
    return (U_OVER_ICE if over_ice else U_OVER_WATER)[formula]


def _root_sum(*terms):
    return np.sqrt(sum(np.square(np.asarray(term, float)) for term in terms))
