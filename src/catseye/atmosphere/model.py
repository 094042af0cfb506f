"""What a model of the index of air is: three formulas, the limits within which they hold, and how good they are."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from catseye.errors import ValidityError


class Sensitivity(NamedTuple):
    """Derivatives of the group index with relative humidity held.

    temperature_c      per °C
    pressure_hpa       per hPa
    humidity_percent   per % of relative humidity
    """

    temperature_c: Any
    pressure_hpa: Any
    humidity_percent: Any


class Partials(NamedTuple):
    """Derivatives of the group index with vapour pressure held: what a dew-point or wet-bulb instrument needs.

    temperature_c         per °C
    pressure_hpa          per hPa of total pressure
    vapour_pressure_hpa   per hPa of vapour pressure
    """

    temperature_c: Any
    pressure_hpa: Any
    vapour_pressure_hpa: Any

    def with_humidity_held(self, saturation, humidity_percent) -> Sensitivity:
        """The chain rule from vapour pressure to relative humidity, by a `humidity.Saturation` and its slopes."""
        fraction = np.asarray(humidity_percent, float) / 100.0
        return Sensitivity(
            self.temperature_c + self.vapour_pressure_hpa * fraction * saturation.per_c,
            self.pressure_hpa + self.vapour_pressure_hpa * fraction * saturation.per_hpa,
            self.vapour_pressure_hpa * saturation.pressure_hpa / 100.0,
        )


@dataclass(frozen=True)
class Limit:
    """The closed interval in which a formula holds for one quantity.

    quantity   the word for it in messages
    unit       its unit in messages
    lower      least legal value
    upper      greatest legal value
    source     the bibliography's key of who says so, or what the limit follows from
    places     decimals to print the limits with
    """

    quantity: str
    unit: str
    lower: float
    upper: float
    source: str
    places: int = 0

    def check(self, value) -> None:
        """Raise ValidityError naming the first value that is outside or not a number."""
        values = np.asarray(value, float)
        bad = np.flatnonzero(~((values >= self.lower) & (values <= self.upper)))
        if bad.size == 0:
            return
        first = float(values.flat[bad[0]])
        where = f" (element {bad[0]} of {values.size})" if values.ndim else ""
        span = f"{self.lower:.{self.places}f}{'-' if self.lower >= 0 else ' to '}{self.upper:.{self.places}f}"
        if np.isnan(first):
            raise ValidityError(f"{self.quantity} is not a number{where}; give a value in {span} {self.unit}")
        raise ValidityError(
            f"{self.quantity} {first:g} {self.unit}{where} is outside {span} {self.unit}, where {self.source} holds"
        )


@dataclass(frozen=True)
class Model:
    """One model of the index of air; each function takes (temperature_c, pressure_hpa, humidity_percent, *,
    wavelength_um, co2_ppm).

    name                   as users write it
    source                 the bibliography's keys
    group_refractivity     function giving n_g - 1
    phase_refractivity     function giving n - 1
    group_sensitivity      function giving a Sensitivity
    vapour_formula         the saturation formula it goes with, a name in `humidity.FORMULAS`
    standard_uncertainty   of the formula itself in the group index, perfect weather given
    limits                 argument's name -> Limit
    """

    name: str
    source: str
    group_refractivity: Callable[..., Any]
    phase_refractivity: Callable[..., Any]
    group_sensitivity: Callable[..., Sensitivity]
    vapour_formula: str
    standard_uncertainty: float
    limits: dict[str, Limit]

    def check(self, **arguments) -> None:
        """Raise ValidityError for the first argument outside its limit."""
        for argument, value in arguments.items():
            self.limits[argument].check(value)
