"""Pressure and humidity of a refractometer path from a mercury barometer and a psychrometer or mirror."""

from typing import NamedTuple

import numpy as np

from catseye.atmosphere.index import hygrometer
from catseye.atmosphere.index.air import MODELS
from catseye.atmosphere.limit import ValidInterval
from catseye.atmosphere.weather import barometer, humidity
from catseye.errors import ValidityError
from catseye.records.files.columns import TextColumns
from catseye.records.files.refusal import refusal

PRESSURES = ("pressure_hpa", "barometer_mmhg")
MOISTURES = ("humidity_percent", "wet_bulb_c", "dew_point_c")
COLUMNS = (*PRESSURES, *MOISTURES, "mercury_c", "dry_bulb_c")


class PathHumidity(NamedTuple):
    """Relative humidity at the path's mean temperature.

    percent    (m,) %; nan where not read
    per_unit   (m,) its derivative by the reading, % per °C; 1 where it was read itself
    """

    percent: np.ndarray
    per_unit: np.ndarray


def refuse_columns(table: TextColumns) -> None:
    """Raise InputError unless pressure and humidity have one instrument each, with what it needs."""
    for names in (PRESSURES, MOISTURES):
        present = [name for name in names if name in table.cells]
        if not present:
            raise refusal(table.file, f"line 1, column {names[0]!r} is missing (or {', '.join(names[1:])})")
        if len(present) > 1:
            raise refusal(
                table.file, f"line 1, columns {' and '.join(present)} give one quantity (expected one of them)"
            )
    for name, other in (("mercury_c", "barometer_mmhg"), ("dry_bulb_c", "wet_bulb_c")):
        if name in table.cells and other not in table.cells:
            raise refusal(table.file, f"line 1, column {name!r} belongs to {other!r}, which is missing")
    if "barometer_mmhg" in table.cells and "mercury_c" not in table.cells:
        raise refusal(table.file, "line 1, column 'mercury_c' is missing (the temperature of barometer_mmhg)")


def path_pressure(table: TextColumns, gravity: float | None, sheet_file: str) -> np.ndarray:
    """Pressure of each reading, (m,) hPa; nan where not read.

    gravity   at the barometer, m/s²; needed for mercury

    Raises InputError with the line of an impossible reading.
    Source: [PARKER04] eqs. 1.8, 1.12, 1.20.
    """
    if "pressure_hpa" in table.cells:
        return table.numbers("pressure_hpa", blank=np.nan)
    if gravity is None:
        raise refusal(sheet_file, "gravity_m_per_s2 is missing (expected it for barometer_mmhg)")
    reading, mercury = (table.numbers(name, blank=np.nan) for name in ("barometer_mmhg", "mercury_c"))
    read = np.isfinite(reading) & np.isfinite(mercury)
    for name, values, limit in (
        ("barometer_mmhg", reading, barometer.READING),
        ("mercury_c", mercury, barometer.MERCURY),
    ):
        _refuse_outside(table, name, values, limit)
    pressure = np.full(len(table), np.nan)
    pressure[read] = barometer.station_pressure_hpa(reading[read], mercury[read], gravity)
    return pressure


def path_humidity(table: TextColumns, temperature: np.ndarray, pressure: np.ndarray, model: str) -> PathHumidity:
    """Relative humidity at the path's mean temperature, from what the table has.

    temperature   (m,) °C, mean of the thermometers
    pressure      (m,) hPa
    model         of the index, with its own saturation formula

    A psychrometer's dry bulb is `dry_bulb_c`, or the mean of the thermometers.
    Raises InputError with the line of an impossible reading.
    Source: [RUEGER90] eq. 5.23; [PARKER04] eq. 1.6.
    """
    kind = next(name for name in MOISTURES if name in table.cells)
    reading = table.numbers(kind, blank=np.nan)
    if kind == "humidity_percent":
        return PathHumidity(reading, np.ones(len(table)))
    dry = table.numbers("dry_bulb_c", blank=np.nan) if "dry_bulb_c" in table.cells else temperature
    rows = np.flatnonzero(np.isfinite(reading) & np.isfinite(dry) & np.isfinite(temperature) & np.isfinite(pressure))
    percent, per_unit = np.full(len(table), np.nan), np.full(len(table), np.nan)
    formula = MODELS[model].vapour_formula
    try:
        if kind == "wet_bulb_c":
            vapour = hygrometer.of_wet_bulb(dry[rows], reading[rows], pressure[rows])
        else:
            vapour = hygrometer.of_mirror(reading[rows], pressure[rows], formula, deposit="dew")
    except ValidityError as problem:
        row = int(rows[np.flatnonzero(problem.mask)[0]]) if problem.mask is not None else int(rows[0])
        raise table.refuse(row, f"{kind} = {table.cells[kind][row]}: {problem}") from problem
    saturated = humidity.saturation(temperature[rows], pressure[rows], formula).pressure_hpa
    percent[rows], per_unit[rows] = (
        100.0 * vapour.vapour_pressure_hpa / saturated,
        100.0 * vapour.per_reading / saturated,
    )
    above = percent[rows] > 100.2
    if above.any():
        row = int(rows[int(np.argmax(above))])
        raise table.refuse(
            row,
            f"{kind} = {table.cells[kind][row]} is a relative humidity of {percent[row]:.1f} % (expected at most 100)",
        )
    return PathHumidity(np.minimum(percent, np.where(np.isnan(percent), np.nan, 100.0)), per_unit)


def _refuse_outside(table: TextColumns, name: str, values: np.ndarray, limit: ValidInterval) -> None:
    good = ~((values < limit.lower) | (values > limit.upper))
    table.check(name, good, f"{limit.lower:g} to {limit.upper:g} {limit.unit}, where {limit.source} holds")
