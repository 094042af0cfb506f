"""Weather that no site has: spikes, stuck sensors, and pressures, temperatures and humidities in another unit.

What other readings or another station give is left out; the rest is fatal. Each limit is beyond what has been
observed anywhere, so that no climate is refused.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catseye.atmosphere.weather.barometer import FOOT, HPA_PER_MMHG, carried_pressure
from catseye.atmosphere.weather.humidity import LEAST_RESOLVED, dew_point_c, likely_fraction, vapour_pressure_hpa
from catseye.constants import SECONDS_PER_DAY
from catseye.records.night.campaign import Campaign
from catseye.records.night.doubt import LONGEST_GAP
from catseye.records.night.weather import Weather
from catseye.reduction.site.agreement import (
    SEA_LEVEL_HPA,
    SURE,
    StationSeries,
    barometers,
    sea_level_pressure,
    simultaneous,
    station_series,
)
from catseye.reduction.site.plausible.readings import (
    HUMIDITY,
    PRESSURE,
    TEMPERATURE,
    ConstantRun,
    Sensor,
    resolution_of,
    spikes,
    stuck,
)
from catseye.reduction.site.plausible.record import ImplausibleRecord

FILE = "weather.csv"
HOTTEST_C = 57.0  # of air in a screen: 56.7 °C at Furnace Creek, 1913, is the highest on record [WMOARC25]
HIGHEST_DEW_POINT_C = 38.0  # of air: no sea is warmer, and 35 °C at the Persian Gulf is the highest reported
APART_C, APART_C_PER_M = 12.0, 0.1  # chosen: two stations of a site, cold pools of deep valleys included
FAHRENHEIT_C = 4.0  # °C within which a temperature in °F fits another station's
COLUMN_PER_M = 1.1e-5  # of the pressure: a column of air 20 °C from the standard, g / (R T²) times 20 °C
REDUCED, REDUCED_HPA = 0.12, 5.0  # of the reduction, and hPa: within the larger a pressure is another's at sea level
LEAST_ELEVATION_M = 50.0  # from which a reduction to sea level is larger than that
SATURATED, DRY = 95.0, 5.0  # %: hygrometers end here and repeat themselves for hours, in fog and in a desert
NOTHING_ELSE = "nothing else gives the air's temperature then: measure again, or type readings of another sensor"
COLUMNS = {TEMPERATURE: "temperature_c", PRESSURE: "pressure_hpa", HUMIDITY: "humidity_percent"}


@dataclass(frozen=True, eq=False)
class _Station:
    """Rows of a station in `weather`, and its readings."""

    series: StationSeries
    rows: np.ndarray

    @property
    def name(self) -> str:
        return self.series.name

    @property
    def seconds(self) -> np.ndarray:
        return (self.series.mjd - self.series.mjd[0]) * SECONDS_PER_DAY

    def column(self, sensor: Sensor) -> np.ndarray:
        return np.asarray(getattr(self.series, COLUMNS[sensor]))


def plausible_weather(campaign: Campaign) -> tuple[Campaign, list[ImplausibleRecord]]:
    """Campaign without implausible readings, and these."""
    implausible: list[ImplausibleRecord] = []
    for check in (_single_readings, _stuck_sensors, _fahrenheit, _pressures, _humidities):
        campaign, more = check(campaign)
        implausible += more
    return campaign, implausible


def _stations(campaign: Campaign) -> list[_Station]:
    names = np.array(campaign.weather.station)
    by_name = {s.name: s for s in station_series(campaign)}
    return [_Station(series, np.flatnonzero(names == name)) for name, series in by_name.items()]


# Single readings and runs -------------------------------------------------------------------------------------


def _single_readings(campaign: Campaign) -> tuple[Campaign, list[ImplausibleRecord]]:
    implausible = []
    for sensor in COLUMNS:
        for station in _stations(campaign):
            values, mjd = station.column(sensor), station.series.mjd
            wrong = spikes(station.seconds, values, sensor)
            if not len(wrong):
                continue
            worst = int(wrong[np.argmax(np.abs(values[wrong] - np.median(values)))])
            around = _level(values[[worst - 2, worst - 1, worst + 1, worst + 2]])
            more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
            text = (
                f"{station.name}'s {sensor.instrument} reads {values[worst]:g} {sensor.unit} at MJD {mjd[worst]:.5f} "
                f"between readings of {around:.4g} {sensor.unit}{more}: a spike; left out"
            )
            implausible.append(_of(sensor, station.name, text))
            campaign, _ = _without(campaign, station, mjd[wrong], sensor)
    return campaign, implausible


def _stuck_sensors(campaign: Campaign) -> tuple[Campaign, list[ImplausibleRecord]]:
    implausible = []
    for sensor in COLUMNS:
        for station, run in _stuck_runs(_stations(campaign), sensor):
            mjd = station.series.mjd[run.first : run.last + 1]
            campaign, outcome = _without(campaign, station, mjd[1:], sensor)
            text = (
                f"{station.name}'s {sensor.instrument} reads {station.column(sensor)[run.first]:g} {sensor.unit} "
                f"{len(mjd)} times in "
                f"{(mjd[-1] - mjd[0]) * SECONDS_PER_DAY / 60.0:.0f} min from MJD {mjd[0]:.5f}, longer than its own "
                f"scatter or the other stations allow: the sensor was stuck; {outcome}"
            )
            implausible.append(_of(sensor, station.name, text, fatal=outcome == NOTHING_ELSE))
    return campaign, implausible


def _stuck_runs(stations: list[_Station], sensor: Sensor) -> Iterator[tuple[_Station, ConstantRun]]:
    for station in stations:
        references = [
            ((s.series.mjd - station.series.mjd[0]) * SECONDS_PER_DAY, s.column(sensor))
            for s in stations
            if s is not station and sensor is not HUMIDITY
        ]
        for run in stuck(station.seconds, station.column(sensor), sensor, references):
            if not _may_rest(station.series, run, sensor):
                yield station, run


def _may_rest(series: StationSeries, run: ConstantRun, sensor: Sensor) -> bool:
    """True in fog, which keeps its temperature for hours, and for a hygrometer at an end of its range."""
    if sensor is PRESSURE:
        return False
    humidity = _level(series.humidity_percent[run.first : run.last + 1])
    if sensor is HUMIDITY:
        return not DRY < humidity < SATURATED
    return humidity >= SATURATED and resolution_of(series.temperature_c) > sensor.fine


def _without(campaign: Campaign, station: _Station, times: np.ndarray, sensor: Sensor) -> tuple[Campaign, str]:
    """Campaign without a station's readings of one quantity at times, and what was done.

    Pressure and humidity are interpolated in time. A temperature's rows are removed, and the station where half an
    hour of shots lacks it, as `doubts.csv` does it.
    """
    weather = campaign.weather
    of_station = np.array(weather.station) == station.name
    wrong = of_station & np.isin(weather.mjd_utc, times)
    if sensor is not TEMPERATURE:
        name = COLUMNS[sensor]
        column, right = np.array(getattr(weather, name)), of_station & ~wrong
        column[wrong] = np.interp(weather.mjd_utc[wrong], weather.mjd_utc[right], column[right])
        return _with(campaign, sensor, column), "left out and interpolated"
    mjd = weather.mjd_utc[of_station & ~wrong]
    gap = np.abs(campaign.shots.mjd_utc[:, None] - mjd).min(axis=1).max() if len(mjd) else np.inf
    if gap <= LONGEST_GAP:
        return replace(campaign, weather=_picked(weather, np.flatnonzero(~wrong))), "left out"
    if len(_stations(campaign)) > 1:
        return _without_station(campaign, station.name), "the station is left out"
    return campaign, NOTHING_ELSE


def _without_station(campaign: Campaign, name: str) -> Campaign:
    stations = tuple(s for s in campaign.site.weather_station if s.name != name)
    references = np.flatnonzero(np.array(campaign.weather.station) != name)
    site = campaign.site.model_copy(update={"weather_station": stations})
    return replace(campaign, site=site, weather=_picked(campaign.weather, references))


def _picked(weather: Weather, rows: np.ndarray) -> Weather:
    return Weather(
        mjd_utc=weather.mjd_utc[rows],
        station=tuple(weather.station[k] for k in rows),
        temperature_c=weather.temperature_c[rows],
        pressure_hpa=weather.pressure_hpa[rows],
        humidity_percent=weather.humidity_percent[rows],
    )


def _with(campaign: Campaign, sensor: Sensor, column: np.ndarray) -> Campaign:
    columns: dict[str, Any] = {COLUMNS[sensor]: column}
    return replace(campaign, weather=replace(campaign.weather, **columns))


def _of(sensor: Sensor, station: str, text: str, *, fatal: bool = False) -> ImplausibleRecord:
    return ImplausibleRecord(f"{FILE}: {sensor.key}", text, sensor.name, (station,), fatal)


# Levels of a station -----------------------------------------------------------------------------------------------


def _fahrenheit(campaign: Campaign) -> tuple[Campaign, list[ImplausibleRecord]]:
    """Temperatures that no air has, or that fit another station in °F."""
    stations = _stations(campaign)
    hot = {s.name: text for s in stations if (text := _too_hot(s.series))}
    levels = {s.name: (_level(s.series.temperature_c), s.series.elevation_m) for s in stations}
    for name, (level, elevation) in levels.items():
        for reference, (right, height) in levels.items():
            limit = APART_C + APART_C_PER_M * abs(elevation - height)
            in_celsius = _celsius(level)
            if {name, reference} & set(hot) == {reference} or abs(level - right) <= limit:
                continue
            if abs(in_celsius - right) < FAHRENHEIT_C + 0.02 * abs(elevation - height) and name not in hot:
                hot[name] = (
                    f"reads {level:.1f} °C where {reference} reads {right:.1f} °C (at most {limit:.0f} °C apart)"
                )
    implausible, remaining = [], len(stations) - len(hot)
    for name, text in hot.items():
        level = levels[name][0]
        guess = f": looks like degrees Fahrenheit, {_celsius(level):.1f} °C" if _celsius(level) <= HOTTEST_C else ""
        treatment = (
            "the station is left out" if remaining else "type it in °C: nothing else gives the air's temperature"
        )
        implausible.append(
            _of(TEMPERATURE, name, f"{name}'s thermometer {text}{guess}; {treatment}", fatal=not remaining)
        )
        if remaining:
            campaign = _without_station(campaign, name)
    return campaign, implausible


def _level(values: np.ndarray) -> float:
    return float(np.median(values))


def _celsius(fahrenheit: float) -> float:
    return (fahrenheit - 32.0) / 1.8


def _too_hot(series: StationSeries) -> str:
    level, humidity = _level(series.temperature_c), _level(series.humidity_percent)
    if level > HOTTEST_C:
        return f"reads {level:.1f} °C, above {HOTTEST_C:.0f} °C, the hottest air on record"
    pressure = _level(series.pressure_hpa)
    if humidity <= 0.0 or level < HIGHEST_DEW_POINT_C:
        return ""
    dew = float(dew_point_c(vapour_pressure_hpa(level, pressure, humidity), pressure))
    if dew <= HIGHEST_DEW_POINT_C:
        return ""
    return (
        f"reads {level:.1f} °C at {humidity:.0f} % humidity, a dew point of {dew:.0f} °C (no air has above "
        f"{HIGHEST_DEW_POINT_C:.0f} °C)"
    )


def _pressures(campaign: Campaign) -> tuple[Campaign, list[ImplausibleRecord]]:
    """Pressures that do not fit the elevation, or fit another station's after a change of unit."""
    stations = _stations(campaign)
    doubts = {s.name: pressure_doubt(_level(s.series.pressure_hpa), s.series.elevation_m) for s in stations}
    wrong = {name: text for name, text in doubts.items() if text}
    sound = [s.series for s in stations if s.name not in wrong]
    for series in sound:
        references = [reference for reference in sound if reference is not series and reference.name not in wrong]
        if text := next((t for reference in references if (t := _not_as_other(series, reference))), ""):
            wrong[series.name] = text
    return _replaced(campaign, PRESSURE, wrong, _carried, "type the pressure at the station, in hPa")


def pressure_doubt(level: float, elevation: float) -> str:
    """Doubt on a pressure, hPa, that no weather makes at an elevation, m.

    "" for none; its subject, the station, is not in it.

    >>> pressure_doubt(930.9, 803.8), pressure_doubt(698.2, 803.8)[-28:]
    ('', ': looks like mmHg, 930.9 hPa')
    """
    low, high = _sea_level_limits(elevation)

    def fits(pressure: float, z: float) -> bool:
        least, most = _sea_level_limits(z)
        return least <= sea_level_pressure(pressure, z) <= most

    if fits(level, elevation):
        return ""
    causes = []
    if fits(level, 0.0) and elevation > LEAST_ELEVATION_M and sea_level_pressure(level, elevation) > high:
        causes.append("a pressure that is already reduced to sea level")
    if fits(level * HPA_PER_MMHG, elevation):
        causes.append(f"mmHg, {level * HPA_PER_MMHG:.1f} hPa")
    if elevation > LEAST_ELEVATION_M and fits(level, elevation * FOOT):
        causes.append(f"an elevation_m in feet, {elevation * FOOT:.0f} m")
    guess = f": looks like {' or '.join(causes)}" if causes else ""
    return (
        f"reads {level:.1f} hPa at {elevation:.0f} m, {sea_level_pressure(level, elevation):.0f} hPa at sea level by "
        f"the standard atmosphere (expected {low:.0f} to {high:.0f}){guess}"
    )


def _sea_level_limits(elevation_m: float) -> tuple[float, float]:
    """Lowest and highest plausible pressure at sea level by the standard atmosphere, hPa."""
    column = COLUMN_PER_M * max(elevation_m, 0.0)
    return SEA_LEVEL_HPA[0] * (1.0 - column), SEA_LEVEL_HPA[1] * (1.0 + column)


def _not_as_other(series: StationSeries, reference: StationSeries) -> str:
    """A pressure that is the other's at sea level; "" where both may be right."""
    pair = simultaneous(series, reference)
    conflict = None if pair is None else barometers(*pair)
    if conflict is None or abs(conflict.difference) < max(SURE * conflict.u, 2.0 * REDUCED_HPA):
        return ""
    level, right = _level(series.pressure_hpa), _level(reference.pressure_hpa)
    warm = _level(reference.temperature_c)
    at_sea = float(carried_pressure(right, warm, reference.elevation_m, z_to=0.0).pressure_hpa)
    if abs(level - at_sea) > max(REDUCED_HPA, REDUCED * (at_sea - right)):
        return ""
    return (
        f"reads {level:.1f} hPa at {series.elevation_m:.0f} m where {reference.name} reads {right:.1f} hPa at "
        f"{reference.elevation_m:.0f} m: looks like a pressure that is already reduced to sea level"
    )


def _carried(wrong: StationSeries, right: StationSeries) -> np.ndarray:
    pressure = carried_pressure(right.pressure_hpa, right.temperature_c, right.elevation_m, z_to=wrong.elevation_m)
    return np.asarray(np.interp(wrong.mjd, right.mjd, np.asarray(pressure.pressure_hpa)))


def _humidities(campaign: Campaign) -> tuple[Campaign, list[ImplausibleRecord]]:
    """Humidities of 0 % throughout, or typed as a fraction."""
    wrong = {s.name: text for s in _stations(campaign) if (text := humidity_doubt(s.series.humidity_percent))}
    return _replaced(campaign, HUMIDITY, wrong, _same_humidity, "type the relative humidity in percent")


def humidity_doubt(humidity: np.ndarray) -> str:
    """Doubt on humidities, %, of 0 throughout or typed as a fraction.

    "" for none; its subject, the station, is not in it.
    """
    if not np.any(humidity > 0.0):
        return "reads 0 % throughout, which no air has: the sensor is broken or not connected"
    if not likely_fraction(humidity):
        return ""
    level = _level(humidity)
    return (
        f"reads {level:.3g} %, at most {LEAST_RESOLVED:g} % throughout, drier than any air for so long: looks like a "
        f"fraction, as a fraction it would be {100.0 * level:.3g} %"
    )


def _same_humidity(wrong: StationSeries, right: StationSeries) -> np.ndarray:
    return np.asarray(np.interp(wrong.mjd, right.mjd, right.humidity_percent))


def _replaced(
    campaign: Campaign,
    sensor: Sensor,
    wrong: dict[str, str],
    by: Callable[[StationSeries, StationSeries], np.ndarray],
    advice: str,
) -> tuple[Campaign, list[ImplausibleRecord]]:
    """Campaign with a quantity of some stations by the nearest other in height."""
    stations = _stations(campaign)
    right = [s for s in stations if s.name not in wrong]
    column, implausible = np.array(getattr(campaign.weather, COLUMNS[sensor])), []
    for station in stations:
        if station.name not in wrong:
            continue
        if right:
            source = min(right, key=lambda s: abs(s.series.elevation_m - station.series.elevation_m))
            column[station.rows] = by(station.series, source.series)
            treatment = f"left out; {source.name}'s {sensor.name} is used for its air"
        else:
            treatment = f"{advice}: nothing else gives it"
        implausible.append(
            _of(
                sensor,
                station.name,
                f"{station.name}'s {sensor.instrument} {wrong[station.name]}; {treatment}",
                fatal=not right,
            )
        )
    return _with(campaign, sensor, column) if right and implausible else campaign, implausible
