"""Index of air from instruments, with its uncertainty, verdict, and dew or frost on a surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.atmosphere.index.air import AirState
from catseye.atmosphere.weather.condensation import Condensation
from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.errors import ArgumentError
from catseye.reduction.air.routes import (
    IndexFormula,
    Moisture,
    Pressure,
    air_by,
    formula_uncertainty,
    surface_of,
)
from catseye.reduction.air.stated import stated_inputs, uncertainty_words
from catseye.verdict import Verdict


@dataclass(frozen=True, eq=False)
class WeatherIndex:
    """Index of air by instruments; arrays have the inputs' broadcast shape.

    state           of the air
    wavelength_um   in vacuum
    u               standard uncertainty of the group index, of formula and instruments
    u_formula       its part from exact readings
    stated          inputs whose uncertainty u includes, of `stated_inputs`
    condensation    on a surface in this air; None: no surface
    """

    state: AirState
    wavelength_um: ArrayLike
    u: ArrayLike
    u_formula: ArrayLike
    stated: tuple[str, ...]
    condensation: Condensation | None = None

    @property
    def verdict(self) -> Verdict:
        """Verdict on the formula's limits, humidity and contributions of the uncertainty."""
        within = Verdict("good", f"within the limits of {self.state.model}; {uncertainty_words(self.stated)}")
        return within.hearing(humidity_doubts(self.state.humidity_percent))


def index_by_weather(  # noqa: PLR0913 - instruments, a surface and their uncertainties
    temperature_c: ArrayLike,
    pressure: Pressure,
    moisture: Moisture,
    *,
    above_barometer: ArrayLike = 0.0,
    u_temperature_c: ArrayLike = 0.0,
    u_co2_ppm: ArrayLike = 0.0,
    surface_c: ArrayLike | None = None,
    u_surface_c: ArrayLike = 0.0,
    formula: IndexFormula | None = None,
) -> WeatherIndex:
    """Index of air by weather instruments.

    temperature_c     of the air, °C
    pressure          of `routes.pressure_of`
    moisture          of `routes.moisture_of`
    above_barometer   height of this air above the barometer, m
    u_temperature_c, u_co2_ppm   standard uncertainties, °C and ppm
    surface_c, u_surface_c       temperature of a surface, °C; None: no surface
    formula           of the index, with its light; None: the defaults

    Raises ValidityError: a value outside the range of the formula; ArgumentError: u_surface_c without surface_c.
    Source: `catseye.reduction.air.routes`.

    >>> round(float(index_by_weather(20.0, Pressure(933.0), Moisture("humidity_percent", 50.0)).state.group_index), 9)
    1.000253319
    """
    if surface_c is None and np.any(np.asarray(u_surface_c) > 0.0):
        raise ArgumentError("u_surface_c belongs to surface_c", "u_surface_c", "surface_c")
    of = formula or IndexFormula()
    stated = stated_inputs(
        temperature=u_temperature_c, pressure=pressure.stated, humidity=moisture.u, carbon_dioxide=u_co2_ppm
    )
    state, u = air_by(
        temperature_c,
        pressure.value,
        moisture,
        above_barometer=above_barometer,
        u_temperature_c=u_temperature_c,
        u_pressure_hpa=pressure.u,
        u_co2_ppm=u_co2_ppm,
        formula=of,
    )
    condensation = None
    if surface_c is not None:
        u_weather = {"u_temperature_c": u_temperature_c, "u_pressure_hpa": pressure.u}
        condensation = surface_of(state, moisture, surface_c, u_surface_c=u_surface_c, **u_weather)
    u_formula = formula_uncertainty(
        temperature_c,
        pressure.value,
        moisture,
        above_barometer=above_barometer,
        u_pressure_hpa=pressure.u_formula,
        formula=of,
    )
    return WeatherIndex(
        state=state,
        wavelength_um=of.wavelength_um,
        u=u,
        u_formula=u_formula,
        stated=stated,
        condensation=condensation,
    )
