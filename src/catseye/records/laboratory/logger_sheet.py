"""Sheet of a weather logger's table: its columns with their units, separators, clock and barometer."""

from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from catseye.constants import ZERO_CELSIUS_K
from catseye.records.files.record import Elevation, Name, Record, Version, Within, broken_rule

Heading = Annotated[str, Field(min_length=1)]
Spread = Annotated[float, Within(0, 50)]
PressureAt = Literal["station", "sea-level", "altimeter"]


class LoggerUnit(NamedTuple):
    """Conversion of a logger's unit.

    quantity   temperature_c, pressure_hpa, humidity_percent, dew_point_c or wet_bulb_c
    factor     catseye's unit per unit of the logger
    shift      added after it
    """

    quantity: str
    factor: float = 1.0
    shift: float = 0.0


FAHRENHEIT = (5.0 / 9.0, -160.0 / 9.0)
KELVIN = (1.0, -ZERO_CELSIUS_K)
UNITS = {  # key of `LoggerColumns` -> its quantity and unit
    "temperature_c": LoggerUnit("temperature_c"),
    "temperature_f": LoggerUnit("temperature_c", *FAHRENHEIT),
    "temperature_k": LoggerUnit("temperature_c", *KELVIN),
    "pressure_hpa": LoggerUnit("pressure_hpa"),
    "pressure_mb": LoggerUnit("pressure_hpa"),
    "pressure_pa": LoggerUnit("pressure_hpa", 0.01),
    "pressure_kpa": LoggerUnit("pressure_hpa", 10.0),
    "pressure_mmhg": LoggerUnit("pressure_hpa", 1.333_223_874_15),  # conventional, as `HPA_PER_MMHG`
    "pressure_inhg": LoggerUnit("pressure_hpa", 33.863_886_403),  # 25.4 of them
    "humidity_percent": LoggerUnit("humidity_percent"),
    "humidity_pct": LoggerUnit("humidity_percent"),
    "humidity_fraction": LoggerUnit("humidity_percent", 100.0),
    "dew_point_c": LoggerUnit("dew_point_c"),
    "dew_point_f": LoggerUnit("dew_point_c", *FAHRENHEIT),
    "dew_point_k": LoggerUnit("dew_point_c", *KELVIN),
    "wet_bulb_c": LoggerUnit("wet_bulb_c"),
    "wet_bulb_f": LoggerUnit("wet_bulb_c", *FAHRENHEIT),
}
MOISTURES = ("humidity_percent", "dew_point_c", "wet_bulb_c")


class LoggerColumns(Record):
    """Headings of a logger's columns; the key has the unit.

    time            date and time, in one column or in two
    mjd_utc         time as Modified Julian Date, UTC
    station         name of the station, in a table of several
    temperature_c, temperature_f, temperature_k   air temperature: °C, °F, K
    pressure_hpa, pressure_mb, pressure_pa, pressure_kpa, pressure_mmhg, pressure_inhg   pressure
    humidity_percent, humidity_pct, humidity_fraction   relative humidity over liquid water: %, % or 0 to 1
    dew_point_c, dew_point_f, dew_point_k   dew point, over liquid water: °C, °F, K
    wet_bulb_c, wet_bulb_f   ventilated wet bulb, not frozen: °C, °F
    """

    time: Heading | Annotated[tuple[Heading, Heading], Field(strict=False)] | None = None
    mjd_utc: Heading | None = None
    station: Heading | None = None
    temperature_c: Heading | None = None
    temperature_f: Heading | None = None
    temperature_k: Heading | None = None
    pressure_hpa: Heading | None = None
    pressure_mb: Heading | None = None
    pressure_pa: Heading | None = None
    pressure_kpa: Heading | None = None
    pressure_mmhg: Heading | None = None
    pressure_inhg: Heading | None = None
    humidity_percent: Heading | None = None
    humidity_pct: Heading | None = None
    humidity_fraction: Heading | None = None
    dew_point_c: Heading | None = None
    dew_point_f: Heading | None = None
    dew_point_k: Heading | None = None
    wet_bulb_c: Heading | None = None
    wet_bulb_f: Heading | None = None

    @model_validator(mode="after")
    def _has_one_of_each(self) -> "LoggerColumns":
        problem = self.problem()
        if problem:
            raise broken_rule(problem)
        return self

    @property
    def quantities(self) -> dict[str, tuple[str, str]]:
        """Quantity -> its key and heading."""
        present = [(key, getattr(self, key)) for key in UNITS]
        return {UNITS[key].quantity: (key, heading) for key, heading in present if heading is not None}

    def problem(self) -> str:
        """Missing or repeated quantity, or ""."""
        if (self.time is None) == (self.mjd_utc is None):
            return "columns need time or mjd_utc, not both"
        for names in (("temperature_c",), ("pressure_hpa",), MOISTURES):
            keys = [key for key, unit in UNITS.items() if unit.quantity in names and getattr(self, key) is not None]
            choice = ", ".join(key for key, unit in UNITS.items() if unit.quantity in names)
            if not keys:
                return f"columns need one of {choice}"
            if len(keys) > 1:
                return f"columns {' and '.join(keys)} are given (expected one of {choice})"
        return ""


class LoggerSheet(Record):
    """Sheet of a weather logger's table.

    station         name of the station, where the table has no column of it
    columns         headings of the columns; without them the table has the keys' own names as headings
    header_line     line of the headings, from 1
    skip_lines      lines between the headings and the first row, such as units
    delimiter       between cells, tab for a tabulator; if missing ";" or a tab where the headings have one, else ","
    decimal         decimal sign; if missing a point, or a comma where cells are not separated by commas
    missing         cells of a sensor that gave nothing; an empty cell is always one
    time_format     of the time, such as %d.%m.%Y %H:%M; if missing ISO 8601
    time_zone       of times without an offset: UTC, +hh:mm, or a name such as Europe/Berlin with its summer time
    pressure_at     station as measured; sea-level as services reduce it, by the air's temperature; altimeter as
                    aviation does (QNH), by the standard atmosphere
    elevation_m     of the barometer above the sea: needed to take such a reduction back, and to test the pressure
    u_temperature_c, u_pressure_hpa   standard uncertainty of the instruments, common to all rows
    u_humidity_percent, u_dew_point_c, u_wet_bulb_c   standard uncertainty of the hygrometer, in its own unit
    """

    format: Annotated[int | str, Version("weather")] = 1
    station: Name = "WX1"
    columns: LoggerColumns | None = None
    header_line: Annotated[int, Within(1, 1000)] = 1
    skip_lines: Annotated[int, Within(0, 1000)] = 0
    delimiter: Literal[",", ";", "tab", "|"] | None = None
    decimal: Literal[".", ","] | None = None
    missing: Annotated[tuple[str, ...], Field(strict=False)] = ("NAN", "NaN", "nan", "-", "--", "---")
    time_format: Heading | None = None
    time_zone: Heading = "UTC"
    pressure_at: PressureAt = "station"
    elevation_m: Elevation | None = None
    u_temperature_c: Spread = 0.0
    u_pressure_hpa: Spread = 0.0
    u_humidity_percent: Spread = 0.0
    u_dew_point_c: Spread = 0.0
    u_wet_bulb_c: Spread = 0.0
