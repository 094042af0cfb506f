"""`weather`: index of air over time, from a weather logger's table."""

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
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.air.weather_series import WeatherSeries


@dataclass(frozen=True, eq=False, repr=False)
class WeatherResult(Result):
    """Index of air at m usable rows of a logger, in order of time.

    mjd_utc                    (m,)
    station                    name of each row's station
    line                       (m,) int, its line in the table
    temperature_c              (m,)
    pressure_hpa               (m,) at the station
    humidity_percent           (m,) over liquid water
    vapour_pressure_hpa        (m,)
    group_refractivity, u_group_refractivity   (m,) n_g - 1, u of formula and instruments
    series                     everything else: rows that are left out with their lines, gaps, doubts
    path                       table that was read
    """

    mjd_utc: np.ndarray
    station: tuple[str, ...]
    line: np.ndarray
    temperature_c: np.ndarray
    pressure_hpa: np.ndarray
    humidity_percent: np.ndarray
    vapour_pressure_hpa: np.ndarray
    group_refractivity: np.ndarray
    u_group_refractivity: np.ndarray
    series: "WeatherSeries"
    path: Path

    def passages(self) -> "Sequence[Passage]":
        """Times, index, rows that are left out, gaps, doubts."""
        from catseye.gateways.air.weather_objects import weather_passages

        return weather_passages(self.series)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye weather --json`."""
        from catseye.gateways.air.weather_objects import weather_object

        return weather_object(self.series)

    def tables(self) -> "dict[str, QTable]":
        """`index`: a row for each usable row."""
        columns = {
            "mjd_utc": (self.mjd_utc, "d"),
            "station": (self.station, ""),
            "line": (self.line, ""),
            "temperature": (self.temperature_c, "deg_C"),
            "pressure": (self.pressure_hpa, "hPa"),
            "humidity": (self.humidity_percent, "%"),
            "vapour_pressure": (self.vapour_pressure_hpa, "hPa"),
            "group_refractivity": (self.group_refractivity / PPM, ""),
            "u_group_refractivity": (self.u_group_refractivity / PPM, ""),
        }
        return {"index": quantities(columns, refractivity="ppm", model=self.series.index.state.model)}

    def figures(self) -> "dict[str, Figure]":
        """Weather and index over time, with gaps."""
        from catseye.gateways.air.weather_figures import weather_figure

        return {"weather": weather_figure(self.series)}

    def pages(self) -> dict[str, SinglePage]:
        """`table`: weather.csv, as a campaign reads it."""
        from catseye.gateways.air.weather_objects import MARK, weather_csv

        return {"table": SinglePage(MARK, lambda now, path: weather_csv(self.series))}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye weather --out`."""
        from catseye.gateways.air.weather_figures import write_weather

        write_weather(self.series, directory, progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of table and sheet."""
        return dict(self.series.table.hashes)

    def sources(self) -> tuple[Path, ...]:
        """The table that was read."""
        return (self.path,)


@with_units
def weather(
    table: "str | os.PathLike[str]",
    sheet: "str | os.PathLike[str] | None" = None,
    *,
    station: str | None = None,
    time_zone: str | None = None,
    pressure_at: str | None = None,
    elevation_m: Annotated[Any, In("m", one=True)] = None,
    u_temperature_c: Annotated[Any, In("deg_C", difference=True, one=True)] = None,
    u_pressure_hpa: Annotated[Any, In("hPa", one=True)] = None,
    u_humidity_percent: Annotated[Any, In("percent", one=True)] = None,
    wavelength_um: Annotated[Any, In("um", one=True)] = 0.780,
    model: str = AIR_MODEL,
    co2_ppm: Annotated[Any, In("ppm", one=True)] = 450.0,
) -> WeatherResult:
    """Index of air over time, from a weather logger's table.

    table   CSV of a logger, with any separators, units and clock (docs/formats/weather.md)
    sheet   which column is what; the file beside the table with the ending .toml, if there is one

    In place of the sheet's, where they are not None:
    station       name, where the table has no column of it
    time_zone     of times without an offset: UTC, +hh:mm, or a name such as Europe/Berlin
    pressure_at   station, sea-level or altimeter: a reduction to sea level is taken back with
    elevation_m   of the barometer, m
    u_temperature_c, u_pressure_hpa, u_humidity_percent   standard uncertainties of the sensors

    wavelength_um, model, co2_ppm   of the index, as for `air`

    Rows that repeat a time, go back in time, lack a reading or hold a spike are left out, with line and reason.
    Raises InputError, with line and column, for a table that cannot be read; ArgumentError: no elevation.
    Source: the model's own file in `catseye.atmosphere.index`.

    >>> found = weather("weather/tower.dat")
    >>> len(found.mjd_utc), found.verdict.word
    (689, 'doubtful')
    """
    from catseye.records.laboratory.logger_table import read_logger_sheet, read_logger_table
    from catseye.reduction.air.routes import IndexFormula
    from catseye.reduction.air.weather_series import weather_series

    path = place_of(table)
    adjacent = path.with_suffix(".toml") if sheet is None else place_of(sheet)
    values = {
        "station": station,
        "time_zone": time_zone,
        "pressure_at": pressure_at,
        "elevation_m": elevation_m,
        "u_temperature_c": u_temperature_c,
        "u_pressure_hpa": u_pressure_hpa,
        "u_humidity_percent": u_humidity_percent,
    }
    changes = {name: value for name, value in values.items() if value is not None}
    logger, hashes = read_logger_sheet(adjacent, changes, needed=sheet is not None)
    formula = IndexFormula(wavelength_um=wavelength_um, model=model, co2_ppm=co2_ppm)
    result = weather_series(read_logger_table(path, logger, hashes), formula)
    state = result.index.state
    return WeatherResult(
        verdict=result.verdict,
        mjd_utc=result.mjd_utc,
        station=result.station,
        line=result.table.lines[result.rows],
        temperature_c=np.asarray(state.temperature_c),
        pressure_hpa=result.pressure_hpa,
        humidity_percent=np.asarray(state.humidity_percent),
        vapour_pressure_hpa=np.asarray(state.vapour_pressure_hpa),
        group_refractivity=np.asarray(state.group_refractivity),
        u_group_refractivity=np.broadcast_to(result.index.u, result.mjd_utc.shape),
        series=result,
        path=path,
    )
