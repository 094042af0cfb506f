"""`air`, `sound`, `refractometer`: the index of air and the speed of sound, from weather or from a path itself."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.atmosphere.index.model import IndexSensitivity
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.atmosphere.index.air import AirState
    from catseye.atmosphere.sound.model import SoundSensitivity
    from catseye.atmosphere.sound.speed import Sound
    from catseye.atmosphere.weather.condensation import Condensation
    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.air.refractometer_calibration import PathCalibration


@dataclass(frozen=True, eq=False, repr=False)
class AirResult(Result):
    """The index of air; arrays have the shape of the inputs, broadcast together.

    temperature_c, pressure_hpa, humidity_percent, wavelength_um   the state; relative humidity over liquid water
    group_index, phase_index     n_g and n
    vapour_pressure_hpa          partial pressure of water vapour
    dew_point_c                  over liquid water; nan in perfectly dry air, which has none
    group_wavelength             of 1500 MHz in this air, m
    sensitivity                  derivatives of the group index by weather, relative humidity held
    standard_uncertainty         of the group index: the formula's, and the instruments' as far as they were given
    formula_uncertainty          the formula's own part
    model                        name of the formula
    uncertainty_of               inputs whose uncertainty the standard uncertainty has
    condensation                 on a surface in this air; None: no surface was given
    """

    temperature_c: Any
    pressure_hpa: Any
    humidity_percent: Any
    wavelength_um: Any
    group_index: Any
    phase_index: Any
    vapour_pressure_hpa: Any
    dew_point_c: Any
    group_wavelength: Any
    sensitivity: IndexSensitivity
    standard_uncertainty: Any
    formula_uncertainty: Any
    model: str
    state: "AirState"
    uncertainty_of: tuple[str, ...]
    condensation: "Condensation | None" = None

    def passages(self) -> "Sequence[Passage]":
        """The index, its uncertainty and its slopes; dew or frost on the surface."""
        from catseye.gateways.air.objects import air_passages
        from catseye.gateways.writers.passage import Passage

        surface = () if self.condensation is None else (Passage("surface", self.condensation.lines()[0]),)
        return [*air_passages(self.to_object()), *surface]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye air --json`."""
        from catseye.gateways.air.objects import air_object

        answer = air_object(
            self.state,
            self.wavelength_um,
            self.standard_uncertainty,
            verdict=self.verdict,
            stated=self.uncertainty_of,
            u_formula=self.formula_uncertainty,
        )
        surface = {} if self.condensation is None else {"condensation": self.condensation._asdict()}
        return {**answer, **surface}

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
    dew_point_c: Annotated[Any, In("deg_C")] = None,
    frost_point_c: Annotated[Any, In("deg_C")] = None,
    wet_bulb_c: Annotated[Any, In("deg_C")] = None,
    ice_bulb_c: Annotated[Any, In("deg_C")] = None,
    vapour_pressure_hpa: Annotated[Any, In("hPa")] = None,
    barometer_mmhg: Annotated[Any, In("mmHg")] = None,
    mercury_c: Annotated[Any, In("deg_C")] = None,
    gravity: Annotated[Any, In("m / s2")] = None,
    latitude_deg: Annotated[Any, In("deg")] = None,
    elevation_m: Annotated[Any, In("m")] = None,
    above_barometer_m: Annotated[Any, In("m")] = 0.0,
    wavelength_um: Annotated[Any, In("um")] = 0.780,
    model: str = "ciddor_hill1999",
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
) -> AirResult:
    """Index of air from any instruments, with sensitivities and uncertainty.

    temperature_c      air temperature, °C; as all others a number or an array, broadcast together
    pressure_hpa       total pressure, hPa; or a mercury barometer:
    barometer_mmhg, mercury_c   mercury as read, mm, and its temperature, °C, with
    gravity            there, m/s², or latitude_deg (degrees) and elevation_m (m above the sea)
    above_barometer_m  height of this air above the barometer, m
    humidity_percent   relative humidity over liquid water, %; or one of
    dew_point_c, frost_point_c, wet_bulb_c, ice_bulb_c   of a mirror, or of a psychrometer with water or ice, °C
    vapour_pressure_hpa   partial pressure of the vapour, hPa
    wavelength_um      of the carrier in vacuum, µm
    model              ciddor_hill1999, rueger1990, iag1999_closed or barrell_sears1963
    co2_ppm            carbon dioxide, ppm, where the model has it
    u_...              standard uncertainties of the inputs; with none the result's is the formula's alone
    surface_c          temperature of a retroreflector, °C: will it dew or frost over?

    Raises ValidityError: a value outside the range of the formula; ArgumentError: arguments that do not fit together.
    Source: the model's own file in `catseye.atmosphere.index`; `catseye.reduction.air.routes` for the instruments.

    >>> round(float(air(20.0, 933.0, 50.0).group_index), 9)
    1.000253319
    """
    from catseye.gateways.air.objects import air_verdict, stated_inputs
    from catseye.reduction.air.routes import (
        IndexFormula,
        air_by,
        formula_uncertainty,
        moisture_of,
        pressure_of,
        surface_of,
    )

    moisture = moisture_of(
        {
            "humidity_percent": humidity_percent,
            "dew_point_c": dew_point_c,
            "frost_point_c": frost_point_c,
            "wet_bulb_c": wet_bulb_c,
            "ice_bulb_c": ice_bulb_c,
            "vapour_pressure_hpa": vapour_pressure_hpa,
        },
        {
            "u_humidity_percent": u_humidity_percent,
            "u_dew_point_c": u_dew_point_c,
            "u_wet_bulb_c": u_wet_bulb_c,
            "u_vapour_pressure_hpa": u_vapour_pressure_hpa,
        },
    )
    if surface_c is None and np.any(np.asarray(u_surface_c) > 0.0):
        raise ArgumentError("u_surface_c belongs to surface_c", "u_surface_c", "surface_c")
    pressure = pressure_of(
        pressure_hpa,
        barometer_mmhg,
        mercury_c=mercury_c,
        gravity=gravity,
        latitude_deg=latitude_deg,
        elevation_m=elevation_m,
        u_pressure_hpa=u_pressure_hpa,
        u_barometer_mmhg=u_barometer_mmhg,
        u_mercury_c=u_mercury_c,
    )
    stated = stated_inputs(
        temperature=u_temperature_c,
        pressure=max(np.max(u_pressure_hpa), np.max(u_barometer_mmhg), np.max(u_mercury_c)),
        humidity=moisture.u,
        carbon_dioxide=u_co2_ppm,
    )
    formula = IndexFormula(wavelength_um=wavelength_um, model=model, co2_ppm=co2_ppm)
    state, u = air_by(
        temperature_c,
        pressure.value,
        moisture,
        above_barometer=above_barometer_m,
        u_temperature_c=u_temperature_c,
        u_pressure_hpa=pressure.u,
        u_co2_ppm=u_co2_ppm,
        formula=formula,
    )
    condensation = None
    if surface_c is not None:
        u_weather = {"u_temperature_c": u_temperature_c, "u_pressure_hpa": pressure.u}
        condensation = surface_of(state, moisture, surface_c, u_surface_c=u_surface_c, **u_weather)
    return AirResult(
        verdict=air_verdict(state, u, stated),
        temperature_c=state.temperature_c,
        pressure_hpa=state.pressure_hpa,
        humidity_percent=state.humidity_percent,
        wavelength_um=wavelength_um,
        group_index=state.group_index,
        phase_index=state.phase_index,
        vapour_pressure_hpa=state.vapour_pressure_hpa,
        dew_point_c=state.dew_point_c,
        group_wavelength=state.group_wavelength,
        sensitivity=state.sensitivity,
        standard_uncertainty=u,
        formula_uncertainty=formula_uncertainty(
            temperature_c,
            pressure.value,
            moisture,
            above_barometer=above_barometer_m,
            u_pressure_hpa=pressure.u_formula,
            formula=formula,
        ),
        model=model,
        state=state,
        uncertainty_of=stated,
        condensation=condensation,
    )


@dataclass(frozen=True, eq=False, repr=False)
class SoundResult(Result):
    """The speed of sound; arrays have the shape of the inputs, broadcast together.

    temperature_c, pressure_hpa, humidity_percent   the state; relative humidity over liquid water
    speed, dry_speed       m/s
    vapour_pressure_hpa    partial pressure of water vapour
    sensitivity            derivatives of the speed
    standard_uncertainty   of the speed, m/s: the formula's, and the instruments' as far as they were given
    formula_uncertainty    the formula's own part
    model                  name of the formula
    uncertainty_of         inputs whose uncertainty the standard uncertainty has
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
    model: str
    state: "Sound"
    co2_ppm: Any
    uncertainty_of: tuple[str, ...]

    def passages(self) -> "Sequence[Passage]":
        """The speed, its slopes and what other formulas say; of an array, how far it goes."""
        from catseye.gateways.air.sound_objects import sound_passages

        return sound_passages(self.to_object())

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye sound --json`."""
        from catseye.gateways.air.sound_objects import sound_object

        weather = (self.temperature_c, self.pressure_hpa, self.humidity_percent)
        return sound_object(self.state, weather, self.co2_ppm, u=self.standard_uncertainty, stated=self.uncertainty_of)

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
    temperature_c: Annotated[Any, In("deg_C")],
    pressure_hpa: Annotated[Any, In("hPa")],
    humidity_percent: Annotated[Any, In("percent")],
    *,
    model: str = "parker2004",
    co2_ppm: Annotated[Any, In("ppm")] = 450.0,
    u_temperature_c: Annotated[Any, In("deg_C", difference=True)] = 0.0,
    u_pressure_hpa: Annotated[Any, In("hPa")] = 0.0,
    u_humidity_percent: Annotated[Any, In("percent")] = 0.0,
    u_co2_ppm: Annotated[Any, In("ppm")] = 0.0,
) -> SoundResult:
    """Speed of sound in air, with sensitivities and uncertainty.

    temperature_c, pressure_hpa, humidity_percent   as for `air`
    model     parker2004, the notes' as printed, or real_gas, which measures temperature
    co2_ppm   carbon dioxide, ppm; parker2004 has none
    u_...     standard uncertainties of the inputs; with none the result's is the formula's alone

    Raises ValidityError where a value is outside the range of the formula.

    >>> round(float(sound(20.0, 933.0, 50.0).speed), 3)
    343.577
    """
    from catseye.atmosphere.sound.speed import sound as state_of
    from catseye.gateways.air.objects import stated_inputs
    from catseye.gateways.air.sound_objects import sound_verdict

    state = state_of(temperature_c, pressure_hpa, humidity_percent, model=model, co2_ppm=co2_ppm)
    u = state.combined_uncertainty(u_temperature_c, u_pressure_hpa, u_humidity_percent, u_co2_ppm)
    stated = stated_inputs(
        temperature=u_temperature_c, pressure=u_pressure_hpa, humidity=u_humidity_percent, carbon_dioxide=u_co2_ppm
    )
    return SoundResult(
        sound_verdict(state, humidity_percent, u, stated),
        temperature_c,
        pressure_hpa,
        humidity_percent,
        state.speed,
        state.dry_speed,
        state.vapour_pressure_hpa,
        state.sensitivity,
        u,
        state.standard_uncertainty,
        model,
        state,
        co2_ppm,
        stated,
    )


@dataclass(frozen=True, eq=False, repr=False)
class RefractometerResult(Result):
    """A fixed path calibrated by a night of phases and weather: n readings.

    mjd                        (n,) UTC
    group_refractivity, u_group_refractivity   (n,) n_g - 1 along the path, from each phase
    temperature_c, u_temperature_c             (n,) what the path's air would have to be
    group_index, u_group_index   at the reference phase
    calibration                everything else
    path                       that was read
    """

    mjd: np.ndarray
    group_refractivity: np.ndarray
    u_group_refractivity: np.ndarray
    temperature_c: np.ndarray
    u_temperature_c: np.ndarray
    group_index: float
    u_group_index: float
    calibration: "PathCalibration"
    path: Path

    def passages(self) -> "Sequence[Passage]":
        """The readings, the index, the slope, the thermometers, what an absolute length would give."""
        from catseye.gateways.air.refractometer_report import passages

        return passages(self.calibration)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye refractometer --json`."""
        from catseye.gateways.air.refractometer_report import refractometer_object

        return refractometer_object(self.calibration)

    def tables(self) -> "dict[str, QTable]":
        """`index`: a row a reading."""
        columns = {
            "mjd": (self.mjd, "d"),
            "group_refractivity": (1e6 * self.group_refractivity, ""),
            "u_group_refractivity": (1e6 * self.u_group_refractivity, ""),
            "temperature": (self.temperature_c, "deg_C"),
            "u_temperature": (self.u_temperature_c, "K"),
            "status": (self.calibration.status, ""),
        }
        return {"index": quantities(columns, refractivity="ppm")}

    def figures(self) -> "dict[str, Figure]":
        """The night with its residuals, and phase against weather."""
        from catseye.gateways.air.refractometer_report import refractometer_figures

        return refractometer_figures(self.calibration)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye refractometer --out`."""
        from catseye.gateways.air.refractometer_report import write_refractometer

        write_refractometer(self.calibration, directory, progress)

    def sources(self) -> tuple[Path, ...]:
        """The table that was read."""
        return (self.path,)


@with_units
def refractometer(
    readings: "str | os.PathLike[str]",
    sheet: "str | os.PathLike[str] | None" = None,
    **known: Annotated[Any, In("name")],
) -> RefractometerResult:
    """The group index along a fixed path: calibrated by a night of phases and weather, then from each phase.

    readings   table (docs/formats/refractometer.md)
    sheet      what is known of the path; the file beside the table with the ending .toml without
    known      keys of the sheet, in its place: path_length_m, air_model and so on

    Raises InputError for files that cannot be used.

    >>> refractometer("refractometer/path-a.csv").verdict.word
    'good'
    """
    from catseye.gateways.air.refractometer_report import refractometer_verdict
    from catseye.reduction.air.refractometer_calibration import calibrate_path
    from catseye.reduction.air.refractometer_night import read_path_readings, read_path_sheet

    table = place_of(readings)
    beside = table.with_suffix(".toml") if sheet is None else place_of(sheet)
    path_sheet, hashes = read_path_sheet(beside, known, needed=sheet is not None)
    found = calibrate_path(read_path_readings(table, path_sheet, hashes))
    return RefractometerResult(
        refractometer_verdict(found),
        found.readings.mjd_utc,
        found.refractivity,
        found.u_refractivity,
        found.temperature_c,
        found.u_temperature_c,
        1.0 + found.index_0,
        found.u_index_0,
        found,
        table,
    )
