"""Index of air over time from a weather logger's table.

Rows that repeat a time, go back in time, lack a sensor or hold a spike are left out, each with its line and reason;
gaps are named. What no air has is doubted with the words of a campaign's weather.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from catseye.atmosphere.weather.barometer import U_NORMAL_GRAVITY, carried_pressure
from catseye.constants import SECONDS_PER_DAY
from catseye.errors import ArgumentError, ValidityError
from catseye.records.files.refusal import refusal
from catseye.records.laboratory.logger_table import LoggerTable
from catseye.reduction.air.routes import HYGROMETERS, IndexFormula, Moisture, Pressure
from catseye.reduction.air.stated import uncertainty_words
from catseye.reduction.air.weather_index import WeatherIndex, index_by_weather
from catseye.reduction.site.plausible.readings import HUMIDITY, PRESSURE, TEMPERATURE, spikes, stuck
from catseye.reduction.site.plausible.weather import humidity_doubt, pressure_doubt
from catseye.verdict import Verdict

USED = "used"
GAP_STEPS = 1.5  # of the usual step: a row is missing
LEAST_USED = 0.9  # share of the rows below which a series is doubtful
LAPSE_C_PER_M = 0.0065  # of the air that services put below a station
U_SERVICE_C = 3.0  # °C: services reduce by the mean of twelve hours, which departs so much from the reading
STANDARD_K, STANDARD_HPA = 288.15, 1013.25  # [ICAO93] at sea level
STANDARD_POWER = 5.255_88  # g M/(R lapse) with [ICAO93]'s own constants
SENSORS = {"temperature_c": TEMPERATURE, "pressure_hpa": PRESSURE, "humidity_percent": HUMIDITY}


class SeriesGap(NamedTuple):
    """Time without readings of a station.

    station      its name
    first_line   last line before
    last_line    first line after
    mjd_utc      time of the first
    minutes      to the second
    """

    station: str
    first_line: int
    last_line: int
    mjd_utc: float
    minutes: float


@dataclass(frozen=True, eq=False)
class WeatherSeries:
    """Index of air at each usable row of a logger: n rows, m of them usable, in order of time by station.

    table     rows as read
    status    (n,) USED, or why a row is left out
    rows      (m,) int, the usable ones, in order of time
    pressure_hpa, u_pressure_hpa   (m,) at the station, a reduction to sea level taken back
    index     state of the air with its uncertainty, (m,)
    gaps      times without readings, by station
    doubts    on sensors, a sentence each
    """

    table: LoggerTable
    status: tuple[str, ...]
    rows: np.ndarray
    pressure_hpa: np.ndarray
    u_pressure_hpa: np.ndarray
    index: WeatherIndex
    gaps: tuple[SeriesGap, ...]
    doubts: tuple[str, ...]

    @property
    def mjd_utc(self) -> np.ndarray:
        """Times of the usable rows, (m,)."""
        return self.table.mjd_utc[self.rows]

    @property
    def station(self) -> tuple[str, ...]:
        """Stations of the usable rows."""
        return tuple(self.table.station[row] for row in self.rows)

    @property
    def left_out(self) -> Mapping[str, tuple[int, ...]]:
        """Reason -> lines that are left out for it."""
        reasons: dict[str, list[int]] = {}
        for line, text in zip(self.table.lines.tolist(), self.status, strict=True):
            if text != USED:
                reasons.setdefault(text, []).append(line)
        return {text: tuple(lines) for text, lines in reasons.items()}

    @property
    def verdict(self) -> Verdict:
        """Verdict on sensors, rows that are left out, and the clock."""
        count = len(self.status)
        doubts = list(self.doubts)
        backwards = [line for text, lines in self.left_out.items() if text.startswith("clock") for line in lines]
        if backwards:
            doubts.append(f"the clock goes back at line {backwards[0]}: times before or after it are wrong")
        if len(self.rows) < LEAST_USED * count:
            doubts.append(f"only {len(self.rows)} of {count} rows are usable")
        good = Verdict("good", f"{len(self.rows)} of {count} rows are usable; {uncertainty_words(self.index.stated)}")
        return good.hearing(doubts)


def weather_series(table: LoggerTable, formula: IndexFormula | None = None) -> WeatherSeries:
    """Index of air over time from a logger's rows.

    table     of `read_logger_table`
    formula   of the index, with its light; None: the defaults

    Raises InputError without a usable row, or for a row that is outside the formula; ArgumentError for a reduction to
    sea level without the elevation.
    """
    if table.sheet.pressure_at != "station" and table.sheet.elevation_m is None:
        raise ArgumentError(
            f"pressure_at = {table.sheet.pressure_at!r} needs elevation_m, of the barometer",
            "pressure_at",
            "elevation_m",
        )
    status, doubts = _statuses(table), []
    doubts += _left_out_spikes(table, status)
    rows = np.array([k for k, text in enumerate(status) if text == USED], dtype=int)
    if not len(rows):
        raise refusal(table.file, f"no row is usable: line {table.lines[0]}: {status[0]}")
    rows = rows[np.argsort(table.mjd_utc[rows], kind="stable")]
    doubts += _sensor_doubts(table, rows)
    readings = {name: values[rows] for name, values in table.readings.items()}
    pressure, u_pressure = _at_station(table, readings)
    index = _indices(
        table, rows, readings, Pressure(pressure, u_pressure, stated=bool(np.any(u_pressure > 0.0))), formula
    )
    if table.sheet.elevation_m is not None:
        text = pressure_doubt(float(np.median(pressure)), table.sheet.elevation_m)
        doubts += [f"the barometer {text}"] if text else []
    return WeatherSeries(
        table=table,
        status=tuple(status),
        rows=rows,
        pressure_hpa=pressure,
        u_pressure_hpa=u_pressure,
        index=index,
        gaps=tuple(_gaps(table, rows)),
        doubts=tuple(doubts),
    )


def _statuses(table: LoggerTable) -> list[str]:
    """Status of each row by its order and its empty cells."""
    latest: dict[str, int] = {}
    at: dict[tuple[str, float], int] = {}
    result = []
    for row, (name, mjd) in enumerate(zip(table.station, table.mjd_utc.tolist(), strict=True)):
        earlier, before = at.get((name, mjd)), latest.get(name)
        if earlier is not None:
            same = all(
                values[row] == values[earlier] or np.isnan([values[row], values[earlier]]).all()
                for values in table.readings.values()
            )
            result.append(f"repeats the time of line {table.lines[earlier]}{'' if same else ' with other readings'}")
            continue
        if before is not None and mjd < table.mjd_utc[before]:
            result.append(f"clock is before that of line {table.lines[before]}")
            continue
        at[name, mjd] = latest[name] = row
        empty = [quantity for quantity, values in table.readings.items() if np.isnan(values[row])]
        result.append(f"lacks {', '.join(empty)}" if empty else USED)
    return result


def _stations(table: LoggerTable, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Rows by station, in order of time."""
    names = np.array(table.station)[rows]
    return {str(name): rows[names == name] for name in dict.fromkeys(names.tolist())}


def _left_out_spikes(table: LoggerTable, status: list[str]) -> list[str]:
    """Doubts on spikes, whose rows get their status."""
    used = np.array([k for k, text in enumerate(status) if text == USED], dtype=int)
    doubts = []
    for name, rows in _stations(table, used).items():
        seconds = table.mjd_utc[rows] * SECONDS_PER_DAY
        for quantity, sensor in SENSORS.items():
            if quantity not in table.readings:
                continue
            wild = rows[spikes(seconds, table.readings[quantity][rows], sensor)]
            for row in wild.tolist():
                status[row] = f"spike of the {sensor.instrument}"
            if len(wild):
                more = f" (and {len(wild) - 1} more)" if len(wild) > 1 else ""
                doubts.append(
                    f"{name}'s {sensor.instrument} reads {table.readings[quantity][wild[0]]:g} {sensor.unit} at line "
                    f"{table.lines[wild[0]]}{more}: a spike, left out"
                )
    return doubts


def _sensor_doubts(table: LoggerTable, rows: np.ndarray) -> list[str]:
    """Doubts on stuck sensors and on humidities that are fractions or zero."""
    doubts = []
    for name, local in _stations(table, rows).items():
        seconds = table.mjd_utc[local] * SECONDS_PER_DAY
        for quantity, sensor in SENSORS.items():
            if quantity not in table.readings:
                continue
            values = table.readings[quantity][local]
            for run in stuck(seconds, values, sensor):
                first, last = table.lines[local[run.first]], table.lines[local[run.last]]
                doubts.append(
                    f"{name}'s {sensor.instrument} reads {values[run.first]:g} {sensor.unit} from line {first} to "
                    f"{last}, longer than its own scatter allows: stuck"
                )
        if "humidity_percent" in table.readings:
            text = humidity_doubt(table.readings["humidity_percent"][local])
            doubts += [f"{name}'s hygrometer {text}"] if text else []
    return doubts


def _gaps(table: LoggerTable, rows: np.ndarray) -> list[SeriesGap]:
    gaps = []
    for name, local in _stations(table, rows).items():
        steps = np.diff(table.mjd_utc[local])
        if not len(steps):
            continue
        for k in np.flatnonzero(steps > GAP_STEPS * np.median(steps)).tolist():
            first, last = local[k], local[k + 1]
            gaps.append(
                SeriesGap(
                    station=name,
                    first_line=int(table.lines[first]),
                    last_line=int(table.lines[last]),
                    mjd_utc=float(table.mjd_utc[first]),
                    minutes=float(steps[k] * 1440.0),
                )
            )
    return gaps


def _at_station(table: LoggerTable, readings: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Pressure at the station and its u, hPa."""
    sheet, pressure = table.sheet, readings["pressure_hpa"]
    u = np.full(len(pressure), sheet.u_pressure_hpa)
    if sheet.pressure_at == "station":
        return pressure, u
    assert sheet.elevation_m is not None
    if sheet.pressure_at == "altimeter":
        at = station_pressure_of_altimeter_hpa(pressure, sheet.elevation_m)
        return at, u * at / pressure
    below = readings["temperature_c"] + LAPSE_C_PER_M * sheet.elevation_m
    carried = carried_pressure(pressure, below, 0.0, z_to=sheet.elevation_m, lapse_c_per_m=LAPSE_C_PER_M)
    u_carried = carried.standard_uncertainty_hpa(u, u_temperature_c=U_SERVICE_C, u_gravity=U_NORMAL_GRAVITY)
    return np.asarray(carried.pressure_hpa), np.asarray(u_carried)


def station_pressure_of_altimeter_hpa(altimeter_hpa: np.ndarray, elevation_m: float) -> np.ndarray:
    """Station pressure from an altimeter setting (QNH), hPa.

    altimeter_hpa   setting with which an altimeter at the station reads its elevation
    elevation_m     of the barometer, m

    Source: [ICAO93], the standard atmosphere's lowest layer: heights of both pressures differ by the elevation. Exact
    but for the rounding of the setting.

    >>> round(float(station_pressure_of_altimeter_hpa(np.array(1013.25), 1000.0)), 2)
    898.75
    """
    setting = (np.asarray(altimeter_hpa, float) / STANDARD_HPA) ** (1.0 / STANDARD_POWER)
    return np.asarray(STANDARD_HPA * (setting - LAPSE_C_PER_M * elevation_m / STANDARD_K) ** STANDARD_POWER)


def _indices(
    table: LoggerTable,
    rows: np.ndarray,
    readings: Mapping[str, np.ndarray],
    pressure: Pressure,
    formula: IndexFormula | None,
) -> WeatherIndex:
    kind = next(item for item in HYGROMETERS if item in readings)
    moisture = Moisture(kind, readings[kind], getattr(table.sheet, f"u_{kind}"))
    try:
        return index_by_weather(
            readings["temperature_c"],
            pressure,
            moisture,
            u_temperature_c=table.sheet.u_temperature_c,
            formula=formula,
        )
    except ValidityError as problem:
        where = ""
        if problem.mask is not None and np.any(problem.mask):
            where = f"line {table.lines[rows[int(np.argmax(problem.mask))]]}, "
        raise refusal(table.file, f"{where}{problem}") from problem


def usual_step_s(mjd: Sequence[float] | np.ndarray) -> float:
    """Median time between readings, s; nan of one."""
    steps = np.diff(np.asarray(mjd, float)) * SECONDS_PER_DAY
    return float(np.median(steps)) if len(steps) else float("nan")
