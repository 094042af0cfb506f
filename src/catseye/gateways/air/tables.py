"""Tables of acoustic paths, and of a refractometer path."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from catseye.constants import PPM
from catseye.gateways.writers.columns import Column, Table, each

if TYPE_CHECKING:
    from catseye.reduction.air.ray_path import AirPath
    from catseye.reduction.air.refractometer_calibration import PathCalibration
    from catseye.reduction.air.sound_path import AcousticPath
    from catseye.reduction.air.weather_series import WeatherSeries

PAGE = "acoustic.md"


class AcousticShot(NamedTuple):
    """Row of a table: shot k of a path."""

    path: "AcousticPath"
    k: int

    @property
    def mjd_utc(self) -> float:
        return float(self.path.shots.mjd[self.k])

    def time(self, direction: int) -> float:
        """Travel time, s: 0 from the ranger, 1 back; NaN where not measured."""
        times = (self.path.shots.time_ab, self.path.shots.time_ba)[direction]
        return float("nan") if times is None else float(times[self.k])

    def u_time(self, direction: int) -> float:
        """Standard uncertainty of a travel time, s."""
        return (
            float("nan")
            if direction and self.path.shots.time_ba is None
            else float(self.path.shots.u_time[direction, self.k])
        )

    def decibel(self, direction: int) -> float:
        """Signal to noise ratio of the correlation, dB."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return float(10.0 * np.log10(self.path.shots.snr[direction, self.k]))


Shots = Sequence[AcousticShot]
TIME = Column[Shots]("mjd_utc", "d", "time, Modified Julian Date", each(lambda s: s.mjd_utc), ".8f")
RANGER = Column[Shots]("ranger", "", "end of the line", each(lambda s: s.path.sheet.ranger))
TARGET = Column[Shots]("target", "", "other end of the line", each(lambda s: s.path.sheet.target))
TEMPERATURE = Column[Shots](
    "temperature_c",
    "deg_C",
    "mean air temperature along the line",
    each(lambda s: s.path.temperatures.temperature_c[s.k]),
    ".4f",
)
U_TEMPERATURE = Column[Shots](
    "u_temperature_c",
    "deg_C",
    "standard uncertainty of the temperature",
    each(lambda s: s.path.temperatures.u_temperature_c[s.k]),
    ".4f",
)

PATH_TEMPERATURES = Table[Shots]("path_temperatures.csv", PAGE, (TIME, RANGER, TARGET, TEMPERATURE, U_TEMPERATURE))
MARK = PATH_TEMPERATURES.header  # identifies a file of catseye


def _air(name: str, unit: str, doc: str, value: Callable[[AcousticShot], float], form: str) -> Column[Shots]:
    """Column of the air along the line."""
    return Column(name, unit, doc, each(value), form)


SHOTS = Table[Shots](
    "shots.csv",
    PAGE,
    (
        TIME,
        RANGER,
        TARGET,
        Column("file", "", "recording, or table of travel times", each(lambda s: s.path.shots.file[s.k])),
        Column("time_ab_s", "s", "travel time from the ranger to the target", each(lambda s: s.time(0)), ".9f"),
        Column("time_ba_s", "s", "travel time back; empty if not measured", each(lambda s: s.time(1)), ".9f"),
        Column("u_time_ab_us", "us", "standard uncertainty of `time_ab_s`", each(lambda s: s.u_time(0) * 1e6), ".3f"),
        Column("u_time_ba_us", "us", "standard uncertainty of `time_ba_s`", each(lambda s: s.u_time(1) * 1e6), ".3f"),
        Column("snr_ab_db", "dB", "signal to noise ratio of `time_ab_s`", each(lambda s: s.decibel(0)), ".1f"),
        Column("snr_ba_db", "dB", "signal to noise ratio of `time_ba_s`", each(lambda s: s.decibel(1)), ".1f"),
        TEMPERATURE,
        U_TEMPERATURE,
        _air(
            "wind_m_per_s",
            "m / s",
            "wind along the line, positive from ranger to target; empty without `time_ba_s`",
            lambda s: s.path.temperatures.wind[s.k],
            ".3f",
        ),
        _air(
            "u_wind_m_per_s",
            "m / s",
            "standard uncertainty of the wind",
            lambda s: s.path.temperatures.u_wind[s.k],
            ".3f",
        ),
        _air(
            "group_refractivity_ppm",
            "ppm",
            "group refractivity of the air at that temperature",
            lambda s: s.path.temperatures.group_refractivity[s.k] / PPM,
            ".4f",
        ),
        _air(
            "u_group_refractivity_ppm",
            "ppm",
            "standard uncertainty of the refractivity",
            lambda s: s.path.temperatures.u_group_refractivity[s.k] / PPM,
            ".4f",
        ),
        Column(
            "status", "", "of each direction `good`, or what the table below says", each(lambda s: s.path.status(s.k))
        ),
    ),
)


def _ppm(name: str, doc: str, value: "Callable[[PathCalibration], np.ndarray]") -> "Column[PathCalibration]":
    """Column in ppm of a refractivity."""
    return Column(f"{name}_ppm", "ppm", doc, lambda c: value(c) / PPM, ".4f")


GROUP_INDEX = Table["PathCalibration"](
    "group_index.csv",
    "refractometer.md",
    (
        Column("mjd_utc", "d", "time, Modified Julian Date", lambda c: np.asarray(c.readings.mjd_utc), ".8f"),
        Column(
            "section", "", "section without a loss of the phase, from 1", lambda c: np.asarray(c.followed.section) + 1
        ),
        Column("phase_rad", "rad", "phase, continuous within its section", lambda c: c.followed.phase, ".6f"),
        _ppm("group_refractivity", "group refractivity by the phase", lambda c: c.refractivity),
        _ppm("u_group_refractivity", "standard uncertainty of the group refractivity", lambda c: c.u_refractivity),
        Column(
            "temperature_c", "deg_C", "mean air temperature of the path by the phase", lambda c: c.temperature_c, ".4f"
        ),
        Column(
            "u_temperature_c", "deg_C", "standard uncertainty of the temperature", lambda c: c.u_temperature_c, ".4f"
        ),
        _ppm(
            "weather_refractivity",
            "group refractivity by the weather, mean of the thermometers",
            lambda c: c.weather.mean,
        ),
        _ppm("residual", "weather less path", lambda c: c.residual),
        Column("standardised", "", "standardised residual of the reading, w", lambda c: c.standardised, ".4f"),
        Column(
            "status",
            "",
            "`good`, `stray`, `left out`, `weather off`, `no weather` or `uncalibrated`",
            lambda c: c.status,
        ),
    ),
)


WEATHER_INDEX = Table["WeatherSeries"](
    "weather_index.csv",
    "weather.md",
    (
        Column("mjd_utc", "d", "time, Modified Julian Date", lambda w: w.mjd_utc, ".8f"),
        Column("station", "", "weather station", lambda w: w.station),
        Column("line", "", "line of the reading in the logger's table", lambda w: w.table.lines[w.rows]),
        Column("temperature_c", "deg_C", "air temperature", lambda w: np.asarray(w.index.state.temperature_c), ".4f"),
        Column("pressure_hpa", "hPa", "pressure at the station", lambda w: w.pressure_hpa, ".4f"),
        Column(
            "humidity_percent",
            "percent",
            "relative humidity over liquid water",
            lambda w: np.asarray(w.index.state.humidity_percent),
            ".3f",
        ),
        Column(
            "vapour_pressure_hpa",
            "hPa",
            "partial pressure of the vapour",
            lambda w: np.asarray(w.index.state.vapour_pressure_hpa),
            ".4f",
        ),
        Column(
            "group_refractivity_ppm",
            "ppm",
            "group refractivity, n_g - 1",
            lambda w: np.asarray(w.index.state.group_refractivity) / PPM,
            ".4f",
        ),
        Column(
            "u_group_refractivity_ppm",
            "ppm",
            "standard uncertainty of the group refractivity",
            lambda w: np.broadcast_to(w.index.u, w.rows.shape) / PPM,
            ".4f",
        ),
    ),
)


AIR_PROFILE = Table["AirPath"](
    "air_profile.csv",
    "weather.md",
    (
        Column("z_m", "m", "height", lambda p: p.levels.z, ".3f"),
        Column("temperature_c", "deg_C", "air temperature", lambda p: p.levels.temperature_c, ".4f"),
        Column(
            "u_temperature_c",
            "deg_C",
            "standard uncertainty of the temperature",
            lambda p: p.levels.u_temperature_c,
            ".4f",
        ),
        Column("pressure_hpa", "hPa", "pressure", lambda p: p.levels.pressure_hpa, ".4f"),
        Column(
            "humidity_percent",
            "percent",
            "relative humidity over liquid water",
            lambda p: p.levels.humidity_percent,
            ".3f",
        ),
        Column(
            "group_refractivity_ppm",
            "ppm",
            "group refractivity, n_g - 1",
            lambda p: p.levels.group_refractivity / PPM,
            ".4f",
        ),
        Column(
            "u_group_refractivity_ppm",
            "ppm",
            "its standard uncertainty by the weather",
            lambda p: p.levels.u_group_refractivity / PPM,
            ".4f",
        ),
    ),
)


def air_profile_csv(path: "AirPath") -> str:
    """Table of the smooth air over height."""
    return AIR_PROFILE.csv(path)


def weather_index_csv(series: "WeatherSeries") -> str:
    """Table of a logger's usable rows with their index."""
    return WEATHER_INDEX.csv(series)


def path_temperatures_csv(paths: Sequence["AcousticPath"]) -> str:
    """Table that a campaign reads: one row per shot with a temperature, in time order."""
    rows = [AcousticShot(path, int(k)) for path in paths for k in np.flatnonzero(path.used)]
    return PATH_TEMPERATURES.csv(sorted(rows, key=lambda shot: shot.mjd_utc))


def shots_csv(paths: Sequence["AcousticPath"]) -> str:
    """Table of all shots, used or not."""
    return SHOTS.csv([AcousticShot(path, k) for path in paths for k in range(len(path.shots.mjd))])


def series_csv(calibration: "PathCalibration") -> str:
    """Table of readings as CSV; empty cells for missing numbers."""
    return GROUP_INDEX.csv(calibration)
