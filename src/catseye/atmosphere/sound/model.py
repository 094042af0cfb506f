"""Model of the speed of sound in air: formula, derivatives, limits, uncertainty."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.limit import ValidInterval


class SoundPartials(NamedTuple):
    """Derivatives of the speed of sound at constant vapour pressure.

    temperature_c         m/s per °C
    pressure_hpa          m/s per hPa of total pressure
    vapour_pressure_hpa   m/s per hPa of vapour pressure
    co2_ppm               m/s per ppm of carbon dioxide; zero in a model whose carbon dioxide is fixed
    """

    temperature_c: Any
    pressure_hpa: Any
    vapour_pressure_hpa: Any
    co2_ppm: Any

    def at_constant_humidity(self, saturation, humidity_percent) -> "SoundSensitivity":
        """Convert to constant relative humidity by the chain rule, with `saturation` and its slopes."""
        fraction = np.asarray(humidity_percent, float) / 100.0
        return SoundSensitivity(
            self.temperature_c + self.vapour_pressure_hpa * fraction * saturation.per_c,
            self.pressure_hpa + self.vapour_pressure_hpa * fraction * saturation.per_hpa,
            self.vapour_pressure_hpa * saturation.pressure_hpa / 100.0,
            self.vapour_pressure_hpa,
            self.co2_ppm,
        )


class SoundSensitivity(NamedTuple):
    """Derivatives of the speed of sound at constant relative humidity.

    The one by vapour pressure is at constant temperature and total pressure.

    temperature_c         m/s per °C
    pressure_hpa          m/s per hPa
    humidity_percent      m/s per % of relative humidity
    vapour_pressure_hpa   m/s per hPa of vapour pressure, temperature and total pressure held
    co2_ppm               m/s per ppm of carbon dioxide
    """

    temperature_c: Any
    pressure_hpa: Any
    humidity_percent: Any
    vapour_pressure_hpa: Any
    co2_ppm: Any


@dataclass(frozen=True)
class SoundModel:
    """Model of the speed of sound at zero frequency.

    Its functions take (temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm), nothing checked.

    name                   as users write it
    source                 the bibliography's keys
    speed                  function giving m/s
    partials               function giving SoundPartials
    vapour_formula         the saturation formula it goes with, a name in `atmosphere.weather.humidity.FORMULAS`
    standard_uncertainty   of the formula, m/s, exact weather; the minimum
    limits                 argument's name -> Limit
    has_co2                carbon dioxide enters
    departure              function giving (m/s, the formula's error in this weather, m/s, uncertainty of the
                           reference for that), or None where it is constant; see `uncertainty`
    """

    name: str
    source: str
    speed: Callable[..., Any]
    partials: Callable[..., SoundPartials]
    vapour_formula: str
    standard_uncertainty: float
    limits: dict[str, ValidInterval]
    has_co2: bool
    departure: Callable[..., tuple[Any, Any]] | None = None

    def uncertainty(self, temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm=450.0):
        """Standard uncertainty of the formula, m/s, exact weather; nothing is checked.

        Its error here and the uncertainty of that in squares, but never less than `standard_uncertainty`: a crossing of
        two formulas proves nothing.
        """
        if self.departure is None:
            return self.standard_uncertainty
        off, u = self.departure(temperature_c, pressure_hpa, vapour_pressure_hpa, co2_ppm)
        return np.maximum(self.standard_uncertainty, np.hypot(off, u))

    def check(self, **arguments) -> None:
        """Raise ValidityError for the first argument outside its limit."""
        for argument, value in arguments.items():
            self.limits[argument].check(value)


def limits(
    source: str,
    *,
    temperature_c: tuple[float, float],
    pressure_hpa: tuple[float, float],
    co2_ppm: tuple[float, float] = (0.0, 2000.0),
) -> dict[str, ValidInterval]:
    """Limits of a model, each given as (least, greatest)."""
    return {
        "temperature_c": _interval("temperature", "C", temperature_c, source),
        "pressure_hpa": _interval("pressure", "hPa", pressure_hpa, source),
        "humidity_percent": _interval("relative humidity", "%", (0.0, 100.0), source),
        "co2_ppm": _interval("carbon dioxide", "ppm", co2_ppm, source),
    }


def _interval(quantity: str, unit: str, span: tuple[float, float], source: str) -> ValidInterval:
    """Interval of one quantity, its span as (least, greatest)."""
    lower, upper = span
    return ValidInterval(quantity=quantity, unit=unit, lower=lower, upper=upper, source=source)
