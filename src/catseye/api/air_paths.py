"""`acoustic`, `refractometer`: temperature and index of the air along a path, by sound and by light."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, SinglePage, quantities
from catseye.api.units import In, with_units
from catseye.constants import PPM
from catseye.names import AIR_MODEL

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.reduction.air.refractometer_calibration import PathCalibration
    from catseye.reduction.air.sound_path import AcousticReduction


@dataclass(frozen=True, eq=False, repr=False)
class AcousticResult(Result):
    """Temperatures of p acoustic paths, mean of the used shots of each.

    rangers, targets                           (p) names of their ends
    temperature_c, u_temperature_c             (p,) nan without a used shot
    wind                                       (p,) m/s from ranger to target
    group_refractivity, u_group_refractivity   (p,) n_g - 1
    reduction                                  everything else: each shot with its times and covariances
    read                                       files that were read
    """

    rangers: tuple[str, ...]
    targets: tuple[str, ...]
    temperature_c: np.ndarray
    u_temperature_c: np.ndarray
    wind: np.ndarray
    group_refractivity: np.ndarray
    u_group_refractivity: np.ndarray
    reduction: "AcousticReduction"
    read: tuple[Path, ...]

    def passages(self) -> "Sequence[Passage]":
        """Temperature, contributions, wind and index of each path; unused shots."""
        from catseye.gateways.air.acoustic_objects import passages

        return passages(self.reduction)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye acoustic --json`."""
        from catseye.gateways.air.acoustic_objects import acoustic_object

        return acoustic_object(self.reduction)

    def tables(self) -> "dict[str, QTable]":
        """`paths`: a row a path; `shots`: a row a shot."""
        paths = self.reduction.paths
        ends = {"ranger": (self.rangers, ""), "target": (self.targets, "")}
        means = {
            "temperature": (self.temperature_c, "deg_C"),
            "u_temperature": (self.u_temperature_c, "K"),
            "wind": (self.wind, "m / s"),
            "group_refractivity": (self.group_refractivity / PPM, ""),
            "u_group_refractivity": (self.u_group_refractivity / PPM, ""),
        }

        def each(name: str) -> np.ndarray:
            return np.concatenate([getattr(path.temperatures, name) for path in paths])

        shots = {
            "mjd": (np.concatenate([path.shots.mjd for path in paths]), "d"),
            "ranger": ([path.sheet.ranger for path in paths for _ in path.shots.mjd], ""),
            "target": ([path.sheet.target for path in paths for _ in path.shots.mjd], ""),
            "temperature": (each("temperature_c"), "deg_C"),
            "u_temperature": (each("u_temperature_c"), "K"),
            "wind": (each("wind"), "m / s"),
            "u_wind": (each("u_wind"), "m / s"),
            "group_refractivity": (each("group_refractivity") / PPM, ""),
            "u_group_refractivity": (each("u_group_refractivity") / PPM, ""),
            "status": ([path.status(k) for path in paths for k in range(len(path.shots.mjd))], ""),
        }
        return {
            "paths": quantities({**ends, **means}, refractivity="ppm"),
            "shots": quantities(shots, refractivity="ppm"),
        }

    def figures(self) -> "dict[str, Figure]":
        """Recording, correlation and temperature of each path, by its ends."""
        from catseye.gateways.air.acoustic_figures import acoustic_drawings

        return {
            f"{path.sheet.ranger} to {path.sheet.target}: {name}": figure
            for path in self.reduction.paths
            for name, figure in acoustic_drawings(path).items()
        }

    def pages(self) -> dict[str, SinglePage]:
        """`table`: path_temperatures.csv, as a campaign reads it."""
        from catseye.gateways.air.tables import MARK, path_temperatures_csv

        return {"table": SinglePage(MARK, lambda now, path: path_temperatures_csv(self.reduction.paths))}

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.air.acoustic_report import acoustic_report

        return acoustic_report(self.reduction, when)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye acoustic --out`."""
        from catseye.gateways.air.acoustic_report import write_acoustic

        write_acoustic(self.reduction, directory, progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.reduction.inputs

    def sources(self) -> tuple[Path, ...]:
        """Recordings, tables and sheets."""
        return self.read


@with_units
def acoustic(
    *files: "str | os.PathLike[str]",
    sheet: "str | os.PathLike[str] | None" = None,
    weather: "str | os.PathLike[str] | None" = None,
    station: str | None = None,
    temperature_c: Annotated[Any, In("deg_C", one=True)] = None,
    pressure_hpa: Annotated[Any, In("hPa", one=True)] = None,
    humidity_percent: Annotated[Any, In("percent", one=True)] = None,
    u_pressure_hpa: Annotated[Any, In("hPa", one=True)] = None,
    u_humidity_percent: Annotated[Any, In("percent", one=True)] = None,
    model: str = "real_gas",
    air_model: str = AIR_MODEL,
    progress: Progress | None = None,
) -> AcousticResult:
    """Temperature of the air along paths from the travel time of sound.

    files       recordings .wav or .csv, or travel times .csv (docs/formats/acoustic.md)
    sheet       path, signal and weather of all of them; None: each file's own, its name with .toml
    weather     table of a weather logger, as `weather` reads it with its sheet, in place of the sheet's readings
    station     of that table, where it has several
    temperature_c, pressure_hpa, humidity_percent   one reading for all shots, in place of the sheet's
    u_pressure_hpa, u_humidity_percent   standard uncertainties; None: the logger's, else the sheet's
    model       formula of the speed of sound: real_gas or cramer1993
    air_model   formula of the index: ciddor_hill1999, rueger1990, iag1999_closed or barrell_sears1963
    progress    called with (what, done, of how many)

    A shot without a temperature is a status. Raises InputError for files that cannot be used, without any, and for a
    shot over an hour from a logger's readings; ArgumentError: weather in two ways.

    >>> acoustic("acoustic/night.csv").verdict.word
    'good'
    >>> acoustic("acoustic/night.csv", weather="acoustic/station.csv").verdict.word
    'good'
    """
    from catseye.errors import ArgumentError, InputError
    from catseye.reduction.air.acoustic_recording import reduce_acoustic
    from catseye.reduction.air.sound_weather import logger_readings, one_reading

    if not files:
        raise InputError("acoustic needs a file (expected a recording or a table of travel times)")
    paths = [place_of(each) for each in files]
    beside = None if sheet is None else place_of(sheet)
    if progress is not None:
        progress("reducing", 0, 1)
    local = one_reading(temperature_c, pressure_hpa, humidity_percent)
    logger = None if weather is None else place_of(weather)
    if logger is not None and local is not None:
        raise ArgumentError("give weather, or one reading of temperature, pressure and humidity", "weather")
    if logger is None and station is not None:
        raise ArgumentError("station is one of the table weather", "station", "weather")
    found = reduce_acoustic(
        paths, beside, weather=local if logger is None else logger_readings(logger, station),
        u_pressure_hpa=u_pressure_hpa, u_humidity_percent=u_humidity_percent, model=model, air_model=air_model,
    )  # fmt: skip
    means = [path.mean for path in found.paths]
    sheets = [beside] if beside is not None else [path.with_suffix(".toml") for path in paths]
    return AcousticResult(
        verdict=found.verdict,
        rangers=tuple(path.sheet.ranger for path in found.paths),
        targets=tuple(path.sheet.target for path in found.paths),
        temperature_c=np.array([mean.temperature_c for mean in means]),
        u_temperature_c=np.array([mean.u_temperature_c for mean in means]),
        wind=np.array([mean.wind for mean in means]),
        group_refractivity=np.array([mean.refractivity for mean in means]),
        u_group_refractivity=np.array([mean.u_refractivity for mean in means]),
        reduction=found,
        read=(*paths, *dict.fromkeys(sheets), *([] if logger is None else [logger])),
    )


@dataclass(frozen=True, eq=False, repr=False)
class RefractometerResult(Result):
    """Path calibrated by a night of phases and weather: n readings.

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
        """Readings, index, slope, and the index by an absolute length."""
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
        from catseye.gateways.air.refractometer_figures import refractometer_figures

        return refractometer_figures(self.calibration)

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.air.refractometer_report import refractometer_report

        return refractometer_report(self.calibration, when)

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
    *,
    path_length_m: Annotated[Any, In("m", one=True)] = None,
    u_path_length_mm: Annotated[Any, In("mm", one=True)] = None,
    model: str | None = None,
    wavelength_um: Annotated[Any, In("um", one=True)] = None,
    modulation_hz: Annotated[Any, In("Hz", one=True)] = None,
    co2_ppm: Annotated[Any, In("ppm", one=True)] = None,
    u_temperature_c: Annotated[Any, In("deg_C", difference=True)] = None,
    u_pressure_hpa: Annotated[Any, In("hPa", one=True)] = None,
    u_humidity_percent: Annotated[Any, In("percent", one=True)] = None,
    drift_mrad_per_root_hour: Annotated[Any, In("mrad / h(1/2)", one=True)] = None,
    progress: Progress | None = None,
) -> RefractometerResult:
    """Group index along a fixed path, from phases and weather.

    readings   table (docs/formats/refractometer.md)
    sheet      what is known of the path; the file beside the table with the ending .toml without
    progress   called with (what, done, of how many)

    In place of the sheet's, where they are not None:
    path_length_m, u_path_length_mm   D - D0 of the path, m, and its standard uncertainty, mm
    model                             formula of the index, the sheet's `air_model`
    wavelength_um, modulation_hz      carrier in vacuum, µm, and modulation, Hz
    co2_ppm                           carbon dioxide, ppm
    u_temperature_c, u_pressure_hpa, u_humidity_percent   standard uncertainties of the sensors' offsets; the first
                                      may be a list, one a thermometer
    drift_mrad_per_root_hour          random walk of the phase's zero

    Raises InputError for files and values that cannot be used.

    >>> refractometer("refractometer/path-a.csv").verdict.word
    'good'
    """
    from catseye.reduction.air.refractometer_calibration import calibrate_path
    from catseye.reduction.air.refractometer_night import read_path_readings, read_path_sheet

    table = place_of(readings)
    beside = table.with_suffix(".toml") if sheet is None else place_of(sheet)
    values = {
        "path_length_m": path_length_m,
        "u_path_length_mm": u_path_length_mm,
        "air_model": model,
        "wavelength_um": wavelength_um,
        "modulation_hz": modulation_hz,
        "co2_ppm": co2_ppm,
        "u_temperature_c": tuple(u_temperature_c) if np.ndim(u_temperature_c) else u_temperature_c,
        "u_pressure_hpa": u_pressure_hpa,
        "u_humidity_percent": u_humidity_percent,
        "drift_mrad_per_root_hour": drift_mrad_per_root_hour,
    }
    if progress is not None:
        progress("calibration", 0, 1)
    changes = {key: value for key, value in values.items() if value is not None}
    path_sheet, hashes = read_path_sheet(beside, changes, needed=sheet is not None)
    return _refractometer_result(calibrate_path(read_path_readings(table, path_sheet, hashes)), table)


def _refractometer_result(found: "PathCalibration", table: Path) -> RefractometerResult:
    return RefractometerResult(
        verdict=found.verdict,
        mjd=found.readings.mjd_utc,
        group_refractivity=found.refractivity,
        u_group_refractivity=found.u_refractivity,
        temperature_c=found.temperature_c,
        u_temperature_c=found.u_temperature_c,
        group_index=1.0 + found.index_0,
        u_group_index=found.u_index_0,
        calibration=found,
        path=table,
    )
