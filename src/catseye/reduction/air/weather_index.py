"""Index of air from instruments, with its uncertainty, verdict, and dew or frost on a surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.atmosphere.index.air import MODELS, AirState
from catseye.atmosphere.index.model import Gases
from catseye.atmosphere.weather import humidity
from catseye.atmosphere.weather.condensation import Condensation, radiative_depression_k
from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.errors import ArgumentError, ValidityError
from catseye.reduction.air.routes import (
    IndexFormula,
    MercuryColumn,
    Moisture,
    Pressure,
    air_by,
    formula_uncertainty,
    surface_of,
)
from catseye.reduction.air.stated import stated_inputs, uncertainty_words
from catseye.verdict import Verdict

U_DEPRESSION = 1.0 / 3.0  # of itself, at best: heat by the mount and the housing


@dataclass(frozen=True)
class ClearNight:
    """Clear night sky above a surface, for its radiative cooling.

    wind         along the surface, m/s
    emissivity   of the surface in the thermal infrared
    sky_view     share of the hemisphere that is sky
    """

    wind: ArrayLike = 1.0
    emissivity: ArrayLike = 0.9
    sky_view: ArrayLike = 1.0


def clear_night(
    clear_sky: bool,
    *,
    wind: ArrayLike | None = None,
    emissivity: ArrayLike | None = None,
    sky_view: ArrayLike | None = None,
) -> ClearNight | None:
    """Clear night sky if asked, with the defaults of `ClearNight`.

    Raises ArgumentError: a value without a sky.
    """
    values = {"wind": wind, "emissivity": emissivity, "sky_view": sky_view}
    stated = {name: value for name, value in values.items() if value is not None}
    if clear_sky:
        return ClearNight(**stated)
    for name in stated:
        raise ArgumentError(f"{name} belongs to clear_sky", name, "clear_sky")
    return None


@dataclass(frozen=True, eq=False)
class WeatherIndex:
    """Index of air by instruments; arrays have the inputs' broadcast shape.

    state           of the air
    wavelength_um   in vacuum
    u               standard uncertainty of the group index, of formula and instruments
    u_formula       its part from exact readings
    stated          inputs whose uncertainty u includes, of `stated_inputs`
    condensation    on a surface in this air; None: no surface
    doubts          on its inputs, beside the humidity
    mercury         corrections of a mercury barometer; None: another instrument
    depression_k    radiative cooling of the surface below the air; None: its temperature is an input
    """

    state: AirState
    wavelength_um: ArrayLike
    u: ArrayLike
    u_formula: ArrayLike
    stated: tuple[str, ...]
    condensation: Condensation | None = None
    doubts: tuple[str, ...] = ()
    mercury: MercuryColumn | None = None
    depression_k: ArrayLike | None = None

    @property
    def density_factors(self) -> Gases:
        """Densities of dry air and vapour, in `density_unit`: rueger1990 has D_s and D_w."""
        state = self.state
        return MODELS[state.model].densities(state.temperature_c, state.pressure_hpa, state.vapour_pressure_hpa)

    @property
    def density_unit(self) -> str:
        """Unit of the density factors."""
        return MODELS[self.state.model].density_unit

    @property
    def group_coefficients(self) -> Gases:
        """Group refractivity of each gas per unit of its density factor, [PARKER04] eqs. 1.25, 1.26."""
        return MODELS[self.state.model].coefficients(self.wavelength_um, self.state.co2_ppm)

    @property
    def humidity_over_ice_percent(self) -> np.ndarray:
        """Relative humidity over ice, by Buck's formula; nan above 0.01 °C."""
        t, p, e = np.broadcast_arrays(
            *(np.asarray(v, float) for v in (self.state.temperature_c, self.state.pressure_hpa)),
            np.asarray(self.state.vapour_pressure_hpa, float),
        )
        frozen = t <= humidity.MELTING_C
        relative = humidity.relative_humidity_percent(e, np.where(frozen, t, humidity.MELTING_C), p, over_ice=True)
        return np.where(frozen, relative, np.nan)[()]

    @property
    def frost_point_c(self) -> np.ndarray:
        """Frost point, by Buck's formula, °C; nan where dew forms first, and in dry air."""
        return humidity.frost_point_c(self.state.vapour_pressure_hpa, self.state.pressure_hpa)

    @property
    def verdict(self) -> Verdict:
        """Verdict on the formula's limits, humidity and contributions of the uncertainty."""
        within = Verdict("good", f"within the limits of {self.state.model}; {uncertainty_words(self.stated)}")
        return within.hearing((*self.doubts, *humidity_doubts(self.state.humidity_percent)))


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
    sky: ClearNight | None = None,
    formula: IndexFormula | None = None,
) -> WeatherIndex:
    """Index of air by weather instruments.

    temperature_c     of the air, °C
    pressure          of `routes.pressure_of`
    moisture          of `routes.moisture_of`
    above_barometer   height of this air above the barometer, m
    u_temperature_c, u_co2_ppm   standard uncertainties, °C and ppm
    surface_c, u_surface_c       temperature of a surface, °C; None: no surface
    sky               that cools a surface whose temperature is not known; its cooling is uncertain by a third of itself
    formula           of the index, with its light; None: the defaults

    Raises ValidityError: a value outside the range of the formula; ArgumentError: u_surface_c without surface_c, or
    surface_c and a sky.
    Source: `catseye.reduction.air.routes`.

    >>> round(float(index_by_weather(20.0, Pressure(933.0), Moisture("humidity_percent", 50.0)).state.group_index), 9)
    1.000253319
    """
    if surface_c is None and np.any(np.asarray(u_surface_c) > 0.0):
        raise ArgumentError("u_surface_c belongs to surface_c", "u_surface_c", "surface_c")
    if surface_c is not None and sky is not None:
        raise ArgumentError("give surface_c or clear_sky, not both", "surface_c", "clear_sky")
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
    condensation, depression = None, None
    if sky is not None:
        depression = _depression_k(state, sky)
        surface_c = np.asarray(temperature_c, float) - depression
        u_surface_c = np.hypot(U_DEPRESSION * depression, u_temperature_c)
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
        doubts=pressure.doubts,
        mercury=pressure.mercury,
        depression_k=depression,
    )


def _depression_k(state: AirState, sky: ClearNight) -> np.ndarray:
    dew = np.asarray(state.dew_point_c, float)
    if np.any(np.isnan(dew)):
        raise ValidityError("the sky's emissivity needs vapour in the air; this air is perfectly dry")
    # the formulas of saturation differ by 0.01 °C: saturated air must not have its dew point above itself
    dew = np.minimum(dew, np.asarray(state.temperature_c, float))
    return radiative_depression_k(
        state.temperature_c,
        dew,
        state.pressure_hpa,
        wind=sky.wind,
        emissivity=sky.emissivity,
        sky_view=sky.sky_view,
    )
