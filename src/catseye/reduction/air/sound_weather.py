"""Weather of an acoustic path: of its sheet, of a logger's table, or one reading.

What the table of travel times has itself comes first; the others fill what it lacks.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from catseye.constants import SECONDS_PER_DAY
from catseye.errors import ArgumentError
from catseye.records.files.refusal import refusal
from catseye.records.laboratory.logger_table import read_logger_sheet, read_logger_table
from catseye.records.night.recording import AcousticSheet
from catseye.reduction.air.routes import HYGROMETERS, Moisture, air_by
from catseye.reduction.air.weather_series import GAP_STEPS, WeatherSeries, usual_step_s, weather_series

QUANTITIES = ("temperature_c", "pressure_hpa", "humidity_percent")
FARTHEST_S = 3600.0  # from the nearest reading: weather an hour away is another


@dataclass(frozen=True, eq=False)
class SoundWeather:
    """Weather near a path at n times.

    source               of the readings, for messages
    mjd_utc              (n,) ascending
    temperature_c, pressure_hpa, humidity_percent   (n,)
    u_pressure_hpa, u_humidity_percent   standard uncertainties, common to all; None: not stated
    checked              True: a shot far from any reading is doubted or refused
    doubts               on the readings
    hashes               SHA-256 of what was read
    """

    source: str
    mjd_utc: np.ndarray
    temperature_c: np.ndarray
    pressure_hpa: np.ndarray
    humidity_percent: np.ndarray
    u_pressure_hpa: float | None = None
    u_humidity_percent: float | None = None
    checked: bool = False
    doubts: tuple[str, ...] = ()
    hashes: Mapping[str, str] = field(default_factory=dict)

    def at(self, mjd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Temperature, pressure and humidity at k times, each (k,): linear, constant beyond the ends.

        mjd   (k,) UTC

        Raises InputError: checked readings, and the nearest one is over an hour away.
        """
        if self.checked:
            away = self._away_s(mjd)
            worst = int(np.argmax(away))
            if away[worst] > FARTHEST_S:
                raise refusal(
                    self.source,
                    f"no reading within an hour of the shot at MJD {mjd[worst]:.5f} (expected weather from "
                    f"{mjd.min():.5f} to {mjd.max():.5f}; it has {self.mjd_utc[0]:.5f} to {self.mjd_utc[-1]:.5f})",
                )
        first, second, third = (np.interp(mjd, self.mjd_utc, getattr(self, name)) for name in QUANTITIES)
        return first, second, third

    def doubts_at(self, mjd: np.ndarray) -> tuple[str, ...]:
        """Doubts on the readings, and on shots farther from them than one and a half usual steps."""
        if not self.checked or len(self.mjd_utc) < 2:
            return self.doubts
        away = self._away_s(mjd)
        far = int((away > GAP_STEPS * usual_step_s(self.mjd_utc)).sum())
        if not far:
            return self.doubts
        text = (
            f"{self.source} has no reading within {away.max() / 60.0:.3g} minutes of a shot ({far} in a gap or beyond)"
        )
        return (*self.doubts, text)

    def _away_s(self, mjd: np.ndarray) -> np.ndarray:
        """Time to the nearest reading, s, (k,)."""
        after = np.searchsorted(self.mjd_utc, mjd).clip(0, len(self.mjd_utc) - 1)
        before = (after - 1).clip(0)
        nearest = np.minimum(np.abs(self.mjd_utc[after] - mjd), np.abs(self.mjd_utc[before] - mjd))
        return np.asarray(nearest * SECONDS_PER_DAY)


def sheet_readings(sheet: AcousticSheet, sheet_file: str) -> SoundWeather | None:
    """Readings of an acoustic sheet; None without any."""
    if not sheet.weather:
        return None
    mjd, t, p, h = (np.array([getattr(r, name) for r in sheet.weather]) for name in ("mjd_utc", *QUANTITIES))
    return SoundWeather(sheet_file, mjd, temperature_c=t, pressure_hpa=p, humidity_percent=h)


def one_reading(
    temperature_c: float | None,
    pressure_hpa: float | None,
    humidity_percent: float | None,
) -> SoundWeather | None:
    """Weather of all shots as one reading; None without any of the three.

    Raises ArgumentError: some of the three without the others.
    """
    values = dict(zip(QUANTITIES, (temperature_c, pressure_hpa, humidity_percent), strict=True))
    absent = [name for name, value in values.items() if value is None]
    if len(absent) == len(values):
        return None
    if absent:
        raise ArgumentError(f"the weather lacks {', '.join(absent)}: all three belong together", *absent)
    t, p, h = (np.array([value], float) for value in values.values())
    return SoundWeather("one reading", np.zeros(1), temperature_c=t, pressure_hpa=p, humidity_percent=h)


def logger_readings(table: Path, station: str | None = None) -> SoundWeather:
    """Readings of a weather logger's table, its sheet beside it with the ending .toml, if there is one.

    table     as `weather` reads it
    station   one of its stations; None: it has one

    Raises InputError for a table that cannot be read, an unknown station, and several without a choice.
    """
    logger, hashes = read_logger_sheet(table.with_suffix(".toml"), {}, needed=False)
    series = weather_series(read_logger_table(table, logger, hashes))
    names = list(dict.fromkeys(series.station))
    if station is None and len(names) > 1:
        raise refusal(table.name, f"has {len(names)} stations: {', '.join(names)} (expected one, or station)")
    if station is not None and station not in names:
        raise refusal(table.name, f"has no station {station!r} (expected one of {', '.join(names)})")
    mine = np.array([name == (station or names[0]) for name in series.station])
    air = series.index.state
    u_p, u_h = float(series.u_pressure_hpa[mine].max()), float(_u_humidity(series)[mine].max())
    return SoundWeather(
        source=table.name,
        mjd_utc=series.mjd_utc[mine],
        temperature_c=np.asarray(air.temperature_c)[mine],
        pressure_hpa=series.pressure_hpa[mine],
        humidity_percent=np.asarray(air.humidity_percent)[mine],
        u_pressure_hpa=u_p or None,
        u_humidity_percent=u_h or None,
        checked=True,
        doubts=tuple(f"{table.name}: {text}" for text in series.doubts),
        hashes=series.table.hashes,
    )


def _u_humidity(series: WeatherSeries) -> np.ndarray:
    """Standard uncertainty of the relative humidity, %, (m,), by the hygrometer and the thermometer."""
    table = series.table
    kind, sheet = next(item for item in HYGROMETERS if item in table.readings), table.sheet
    u = getattr(sheet, f"u_{kind}")
    if kind == "humidity_percent":
        return np.full(len(series.rows), u)
    value, t = (table.readings[name][series.rows] for name in (kind, "temperature_c"))

    def relative(of_value: np.ndarray, of_t: np.ndarray) -> np.ndarray:
        state, _ = air_by(of_t, series.pressure_hpa, Moisture(kind, of_value))
        return np.asarray(state.humidity_percent)

    # half a step down, away from saturation, where the reading would be refused
    here, u_t = relative(value, t), sheet.u_temperature_c
    return np.hypot(2.0 * (here - relative(value - 0.5 * u, t)), 2.0 * (here - relative(value, t + 0.5 * u_t)))
