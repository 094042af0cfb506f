"""`air`, `sound`: the index of air and the speed of sound, from weather."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.atmosphere.index.model import Gases, IndexSensitivity
from catseye.names import AIR_MODEL

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.atmosphere.index.air import AirState
    from catseye.atmosphere.sound.model import SoundSensitivity
    from catseye.atmosphere.sound.speed import Sound
    from catseye.atmosphere.weather.condensation import Condensation
    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.air.routes import MercuryColumn
    from catseye.reduction.air.sound_speed import SoundSpeed
    from catseye.reduction.air.weather_index import WeatherIndex


@dataclass(frozen=True, eq=False, repr=False)
class AirResult(Result):
    """Index of air; arrays have the inputs' shape, broadcast together.

    temperature_c, pressure_hpa, humidity_percent, wavelength_um   the state; relative humidity over liquid water
    group_index, phase_index     n_g and n
    vapour_pressure_hpa          partial pressure of water vapour
    dew_point_c                  over liquid water; nan in perfectly dry air, which has none
    frost_point_c                nan where dew forms first
    humidity_over_ice_percent    relative humidity over ice; nan above 0.01 °C
    density_factors              of dry air and vapour, hPa/K; of ciddor_hill1999 Pa/K; rueger1990 has D_s and D_w
    group_coefficients           group refractivity of each gas per unit of its density factor
    group_wavelength             of 1500 MHz in this air, m
    sensitivity                  derivatives of the group index by weather, relative humidity held
    standard_uncertainty         of the group index: the formula's, and the instruments' as far as they were given
    formula_uncertainty          the formula's own part
    model                        name of the formula
    uncertainty_of               inputs whose uncertainty the standard uncertainty has
    condensation                 on a surface in this air; None: no surface
    radiative_depression_k       cooling of the surface below the air by a clear sky; None: not asked
    mercury                      corrections of a mercury barometer, with the gravity; None: another instrument
    found                        everything else
    """

    temperature_c: Any
    pressure_hpa: Any
    humidity_percent: Any
    wavelength_um: Any
    group_index: Any
    phase_index: Any
    vapour_pressure_hpa: Any
    dew_point_c: Any
    frost_point_c: Any
    humidity_over_ice_percent: Any
    density_factors: Gases
    group_coefficients: Gases
    group_wavelength: Any
    sensitivity: IndexSensitivity
    standard_uncertainty: Any
    formula_uncertainty: Any
    model: str
    state: "AirState"
    uncertainty_of: tuple[str, ...]
    condensation: "Condensation | None"
    radiative_depression_k: Any
    mercury: "MercuryColumn | None"
    found: "WeatherIndex"

    def passages(self) -> "Sequence[Passage]":
        """Index with uncertainty and slopes; dew or frost on the surface."""
        from catseye.gateways.air.objects import air_passages

        return air_passages(self.found)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye air --json`."""
        from catseye.gateways.air.objects import air_object

        return air_object(self.found)

    def tables(self) -> "dict[str, QTable]":
        """One table, a row for each state."""
        columns = {
            "temperature": (self.temperature_c, "deg_C"),
            "pressure": (self.pressure_hpa, "hPa"),
            "humidity": (self.humidity_percent, "%"),
            "group_index": (self.group_index, ""),
            "phase_index": (self.phase_index, ""),
            "u_group_index": (self.standard_uncertainty, ""),
            "vapour_pressure": (self.vapour_pressure_hpa, "hPa"),
            "dew_point": (self.dew_point_c, "deg_C"),
            "group_wavelength": (self.group_wavelength, "m"),
        }
        same = np.broadcast_arrays(*(value for value, _ in columns.values()))
        rows = {n: (v.ravel(), unit) for (n, (_, unit)), v in zip(columns.items(), same, strict=True)}
        return {"air": quantities(rows, model=self.model)}


@with_units
def air(
    temperature_c: Annotated[Any, In("deg_C")],
    pressure_hpa: Annotated[Any, In("hPa")] = None,
    humidity_percent: Annotated[Any, In("percent")] = None,
    *,
    humidity_over_ice_percent: Annotated[Any, In("percent")] = None,
    dew_point_c: Annotated[Any, In("deg_C")] = None,
    frost_point_c: Annotated[Any, In("deg_C")] = None,
    wet_bulb_c: Annotated[Any, In("deg_C")] = None,
    ice_bulb_c: Annotated[Any, In("deg_C")] = None,
    vapour_pressure_hpa: Annotated[Any, In("hPa")] = None,
    barometer_mmhg: Annotated[Any, In("mmHg")] = None,
    mercury_c: Annotated[Any, In("deg_C")] = None,
    gravity: Annotated[Any, In("m / s2")] = None,
    gravity_station: str | None = None,
    latitude_deg: Annotated[Any, In("deg")] = None,
    elevation_m: Annotated[Any, In("m")] = None,
    above_barometer_m: Annotated[Any, In("m")] = 0.0,
    wavelength_um: Annotated[Any, In("um")] = 0.780,
    model: str = AIR_MODEL,
    co2_ppm: Annotated[Any, In("ppm")] = 450.0,
    u_temperature_c: Annotated[Any, In("deg_C", difference=True)] = 0.0,
    u_pressure_hpa: Annotated[Any, In("hPa")] = 0.0,
    u_barometer_mmhg: Annotated[Any, In("mmHg")] = 0.0,
    u_mercury_c: Annotated[Any, In("deg_C", difference=True)] = 0.0,
    u_humidity_percent: Annotated[Any, In("percent")] = 0.0,
    u_dew_point_c: Annotated[Any, In("deg_C", difference=True)] = 0.0,
    u_wet_bulb_c: Annotated[Any, In("deg_C", difference=True)] = 0.0,
    u_vapour_pressure_hpa: Annotated[Any, In("hPa")] = 0.0,
    u_co2_ppm: Annotated[Any, In("ppm")] = 0.0,
    surface_c: Annotated[Any, In("deg_C")] = None,
    u_surface_c: Annotated[Any, In("deg_C", difference=True)] = 0.0,
    clear_sky: bool = False,
    wind: Annotated[Any, In("m / s")] = None,
    emissivity: Annotated[Any, In("")] = None,
    sky_view: Annotated[Any, In("")] = None,
) -> AirResult:
    """Index of air from any instruments, with sensitivities and uncertainty.

    temperature_c      air temperature, °C; as all others a number or an array, broadcast together
    pressure_hpa       total pressure, hPa; or a mercury barometer:
    barometer_mmhg, mercury_c   mercury as read, mm, and its temperature, °C, with
    gravity            there, m/s², or latitude_deg (degrees) and elevation_m (m above the sea), or
    gravity_station    AA, B or AB of Green Bank, measured in 1988; elevation_m carries its gravity up to 50 m through
                       free air, latitude_deg gives its anomaly
    above_barometer_m  height of this air above the barometer, m
    humidity_percent   relative humidity over liquid water, %; or one of
    humidity_over_ice_percent   relative humidity over ice, %, of air at most 0.01 °C warm; its u is u_humidity_percent
    dew_point_c, frost_point_c, wet_bulb_c, ice_bulb_c   of a mirror, or of a psychrometer with water or ice, °C
    vapour_pressure_hpa   partial pressure of the vapour, hPa
    wavelength_um      of the carrier in vacuum, µm
    model              ciddor_hill1999, rueger1990, iag1999_closed or barrell_sears1963
    co2_ppm            carbon dioxide, ppm, where the model has it
    u_...              standard uncertainties of the inputs; with none the result's is the formula's alone
    surface_c          temperature of a retroreflector, °C: will it dew or frost over? Or
    clear_sky          True: cooled by a clear night sky below the air, an estimate good to a third, with
    wind, emissivity, sky_view   along the surface, m/s (1); of the surface (0.9, glass); share of the hemisphere (1)

    Raises ValidityError: a value outside the range of the formula; ArgumentError: arguments that do not fit together.
    Source: the model's own file in `catseye.atmosphere.index`; `catseye.reduction.air.routes` for the instruments.

    >>> round(float(air(20.0, 933.0, 50.0).group_index), 9)
    1.000253319
    """
    from catseye.reduction.air.routes import IndexFormula, moisture_of, pressure_of
    from catseye.reduction.air.weather_index import clear_night, index_by_weather

    moisture = moisture_of(
        {"humidity_percent": humidity_percent, "humidity_over_ice_percent": humidity_over_ice_percent,
         "dew_point_c": dew_point_c, "frost_point_c": frost_point_c, "wet_bulb_c": wet_bulb_c, "ice_bulb_c": ice_bulb_c,
         "vapour_pressure_hpa": vapour_pressure_hpa},
        {"u_humidity_percent": u_humidity_percent, "u_dew_point_c": u_dew_point_c, "u_wet_bulb_c": u_wet_bulb_c,
         "u_vapour_pressure_hpa": u_vapour_pressure_hpa},
    )  # fmt: skip
    pressure = pressure_of(
        pressure_hpa, barometer_mmhg, mercury_c=mercury_c, gravity=gravity, gravity_station=gravity_station,
        latitude_deg=latitude_deg, elevation_m=elevation_m, u_pressure_hpa=u_pressure_hpa,
        u_barometer_mmhg=u_barometer_mmhg, u_mercury_c=u_mercury_c,
    )  # fmt: skip
    formula = IndexFormula(wavelength_um=wavelength_um, model=model, co2_ppm=co2_ppm)
    sky = clear_night(clear_sky, wind=wind, emissivity=emissivity, sky_view=sky_view)
    return _air_result(index_by_weather(
        temperature_c, pressure, moisture, above_barometer=above_barometer_m, u_temperature_c=u_temperature_c,
        u_co2_ppm=u_co2_ppm, surface_c=surface_c, u_surface_c=u_surface_c, sky=sky, formula=formula,
    ))  # fmt: skip


def _air_result(found: "WeatherIndex") -> AirResult:
    state = found.state
    return AirResult(
        verdict=found.verdict,
        temperature_c=state.temperature_c,
        pressure_hpa=state.pressure_hpa,
        humidity_percent=state.humidity_percent,
        wavelength_um=found.wavelength_um,
        group_index=state.group_index,
        phase_index=state.phase_index,
        vapour_pressure_hpa=state.vapour_pressure_hpa,
        dew_point_c=state.dew_point_c,
        frost_point_c=found.frost_point_c,
        humidity_over_ice_percent=found.humidity_over_ice_percent,
        density_factors=found.density_factors,
        group_coefficients=found.group_coefficients,
        group_wavelength=state.group_wavelength,
        sensitivity=state.sensitivity,
        standard_uncertainty=found.u,
        formula_uncertainty=found.u_formula,
        model=state.model,
        state=state,
        uncertainty_of=found.stated,
        condensation=found.condensation,
        radiative_depression_k=found.depression_k,
        mercury=found.mercury,
        found=found,
    )


@dataclass(frozen=True, eq=False, repr=False)
class SoundResult(Result):
    """Speed of sound; arrays have the inputs' shape, broadcast together.

    temperature_c, pressure_hpa, humidity_percent   the state; relative humidity over liquid water
    speed, dry_speed       m/s
    vapour_pressure_hpa    partial pressure of water vapour
    sensitivity            derivatives of the speed
    standard_uncertainty   of the speed, m/s: the formula's, and the instruments' as far as they were given
    formula_uncertainty    the formula's own part
    u_temperature_c        standard uncertainty of a temperature by the speed, °C; None: the temperature is an input
    model                  name of the formula
    uncertainty_of         inputs whose uncertainty the standard uncertainty has
    found                  everything else
    """

    temperature_c: Any
    pressure_hpa: Any
    humidity_percent: Any
    speed: Any
    dry_speed: Any
    vapour_pressure_hpa: Any
    sensitivity: "SoundSensitivity"
    standard_uncertainty: Any
    formula_uncertainty: Any
    u_temperature_c: Any
    model: str
    state: "Sound"
    co2_ppm: Any
    uncertainty_of: tuple[str, ...]
    found: "SoundSpeed"

    def passages(self) -> "Sequence[Passage]":
        """Speed, slopes and other formulas; of an array, the extremes."""
        from catseye.gateways.air.sound_objects import sound_passages

        return sound_passages(self.found)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye sound --json`."""
        from catseye.gateways.air.sound_objects import sound_object

        return sound_object(self.found)

    def tables(self) -> "dict[str, QTable]":
        """One table, a row for each state."""
        columns = {
            "temperature": (self.temperature_c, "deg_C"),
            "pressure": (self.pressure_hpa, "hPa"),
            "humidity": (self.humidity_percent, "%"),
            "speed": (self.speed, "m / s"),
            "u_speed": (self.standard_uncertainty, "m / s"),
            "dry_speed": (self.dry_speed, "m / s"),
        }
        same = np.broadcast_arrays(*(value for value, _ in columns.values()))
        rows = {n: (v.ravel(), unit) for (n, (_, unit)), v in zip(columns.items(), same, strict=True)}
        return {"sound": quantities(rows, model=self.model)}


@with_units
def sound(
    temperature_c: Annotated[Any, In("deg_C")] = None,
    pressure_hpa: Annotated[Any, In("hPa")] = None,
    humidity_percent: Annotated[Any, In("percent")] = None,
    *,
    speed: Annotated[Any, In("m / s")] = None,
    frequency_hz: Annotated[Any, In("Hz")] = 0.0,
    vapour_pressure_hpa: Annotated[Any, In("hPa")] = None,
    model: str = "parker2004",
    co2_ppm: Annotated[Any, In("ppm")] = 450.0,
    u_temperature_c: Annotated[Any, In("deg_C", difference=True)] = 0.0,
    u_pressure_hpa: Annotated[Any, In("hPa")] = 0.0,
    u_humidity_percent: Annotated[Any, In("percent")] = 0.0,
    u_co2_ppm: Annotated[Any, In("ppm")] = 0.0,
    u_speed: Annotated[Any, In("m / s")] = 0.0,
    u_vapour_pressure_hpa: Annotated[Any, In("hPa")] = 0.0,
) -> SoundResult:
    """Speed of sound in air, or temperature by it, with sensitivities and uncertainty.

    temperature_c, pressure_hpa, humidity_percent   as for `air`
    speed     m/s, in place of the temperature, which is the answer; of sound of frequency_hz, Hz (0: without
              dispersion); the humidity may be vapour_pressure_hpa, hPa
    model     parker2004, the notes' as printed, or real_gas, which measures temperature
    co2_ppm   carbon dioxide, ppm; parker2004 has none
    u_...     standard uncertainties of the inputs; with none the result's is the formula's alone

    Raises ValidityError where a value is outside the range of the formula; ArgumentError: arguments that do not fit.
    Source: [PARKER04] eqs. 4.1 to 4.14, or the model's own file in `catseye.atmosphere.sound`.

    >>> round(float(sound(20.0, 933.0, 50.0).speed), 3)
    343.577
    >>> round(float(sound(None, 933.0, 50.0, speed=343.576743).temperature_c), 4)
    20.0
    """
    from catseye.reduction.air.sound_speed import MeasuredSound, air_by_sound, require_weather, sound_by_weather

    by_speed = {"frequency_hz": frequency_hz, "vapour_pressure_hpa": vapour_pressure_hpa, "u_speed": u_speed,
                "u_vapour_pressure_hpa": u_vapour_pressure_hpa}  # fmt: skip
    require_weather(temperature_c, pressure_hpa, humidity_percent, speed, u_temperature_c, by_speed)
    others = {"co2_ppm": co2_ppm, "u_pressure_hpa": u_pressure_hpa, "u_humidity_percent": u_humidity_percent,
              "u_co2_ppm": u_co2_ppm}  # fmt: skip
    if speed is None:
        found = sound_by_weather(
            temperature_c, pressure_hpa, humidity_percent, model=model, u_temperature_c=u_temperature_c, **others
        )
    else:
        measured = MeasuredSound(
            speed=speed, pressure_hpa=pressure_hpa, humidity_percent=humidity_percent, **by_speed, **others
        )
        found = air_by_sound(measured, model)
    return SoundResult(
        verdict=found.verdict,
        temperature_c=found.temperature_c,
        pressure_hpa=pressure_hpa,
        humidity_percent=found.humidity_percent,
        speed=found.state.speed,
        dry_speed=found.state.dry_speed,
        vapour_pressure_hpa=found.state.vapour_pressure_hpa,
        sensitivity=found.state.sensitivity,
        standard_uncertainty=found.u,
        formula_uncertainty=found.state.standard_uncertainty,
        u_temperature_c=found.u_temperature_c,
        model=model,
        state=found.state,
        co2_ppm=co2_ppm,
        uncertainty_of=found.stated,
        found=found,
    )
