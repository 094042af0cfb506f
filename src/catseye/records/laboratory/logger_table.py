"""Reader of a weather logger's table: any separator, decimal comma, units, local time.

Rows in the table's order; what is wrong with their order is judged in `reduction.air.weather_series`.
"""

import csv
import hashlib
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from pathlib import Path

import numpy as np

from catseye.constants import SECONDS_PER_DAY
from catseye.errors import InputError
from catseye.records.files.columns import pointed
from catseye.records.files.reading import Folder
from catseye.records.files.record import EARLIEST_MJD, LATEST_MJD, NAME
from catseye.records.files.refusal import NUMBER, refusal, shown, unreadable
from catseye.records.laboratory.logger_sheet import UNITS, LoggerColumns, LoggerSheet

OFFSET = re.compile(r"(?:UTC)?([+-])(\d\d):?(\d\d)")
MJD_ZERO = datetime(1858, 11, 17, tzinfo=UTC)
LIMITS = {  # plausible readings in catseye's units, as of weather.csv
    "temperature_c": (-60.0, 60.0),
    "pressure_hpa": (500.0, 1100.0),
    "humidity_percent": (0.0, 100.0),
    "dew_point_c": (-80.0, 60.0),
    "wet_bulb_c": (-40.0, 60.0),
}
SATURATED = 103.0  # %: capacitive hygrometers read so in fog; it is taken as 100 %


@dataclass(frozen=True, eq=False)
class LoggerTable:
    """Rows of a logger in the table's order; nan where a sensor gave nothing.

    file        name of the table
    sheet       how it was read
    lines       (n,) int, line of each row in the file
    mjd_utc     (n,)
    station     name of each row's station
    readings    quantity -> (n,) in catseye's units: temperature_c, pressure_hpa, and one of `MOISTURES`
    saturated   (n,) True where a humidity above 100 % was taken as 100 %
    hashes      SHA-256 of table and sheet
    """

    file: str
    sheet: LoggerSheet
    lines: np.ndarray
    mjd_utc: np.ndarray
    station: tuple[str, ...]
    readings: Mapping[str, np.ndarray]
    saturated: np.ndarray
    hashes: Mapping[str, str]

    @property
    def moisture(self) -> str:
        """Kind of the reading of humidity."""
        return next(name for name in self.readings if name not in ("temperature_c", "pressure_hpa"))


def read_logger_sheet(path: Path, changes: Mapping[str, object], *, needed: bool) -> tuple[LoggerSheet, dict[str, str]]:
    """Sheet of a table with changes, and its SHA-256 by name.

    path      of the sheet
    changes   values that replace the sheet's
    needed    False: the sheet may be missing

    Raises InputError, one line.
    """
    if not needed and not path.is_file():
        return _changed(LoggerSheet(), changes), {}
    folder = Folder(path.parent)
    return _changed(folder.record(path.name, LoggerSheet), changes), dict(folder.hashes)


def _changed(sheet: LoggerSheet, changes: Mapping[str, object]) -> LoggerSheet:
    from pydantic import ValidationError

    from catseye.records.files.refusal import explained

    values = {**sheet.model_dump(), **changes}
    try:
        return LoggerSheet.model_validate(values)
    except ValidationError as problem:
        raise InputError(explained(problem, values, LoggerSheet).strip()) from problem


def read_logger_table(path: Path, sheet: LoggerSheet, hashes: Mapping[str, str]) -> LoggerTable:
    """Rows of a logger's table.

    path     of the table
    sheet    its columns, separators and clock
    hashes   SHA-256 of what was read before, by name

    Raises InputError with line and column for a cell that is no number, no time, or no reading of any air.
    """
    try:
        raw = path.read_bytes()
    except OSError as problem:
        raise unreadable(path.name, problem) from problem
    cells = _Cells.of(_decoded(raw), path.name, sheet)
    columns = sheet.columns or _named_as_keys(cells)
    readings: dict[str, np.ndarray] = {}
    saturated = np.zeros(len(cells.lines), dtype=bool)
    for quantity, (key, heading) in columns.quantities.items():
        unit = UNITS[key]
        values = cells.numbers(heading) * unit.factor + unit.shift
        if quantity == "humidity_percent":
            saturated = (values > 100.0) & (values <= SATURATED)
            values = np.where(saturated, 100.0, values)
        cells.refuse_outside(heading, values, quantity)
        readings[quantity] = values
    return LoggerTable(
        file=path.name,
        sheet=sheet,
        lines=np.array(cells.lines),
        mjd_utc=cells.times(columns),
        station=cells.stations(columns),
        readings=readings,
        saturated=saturated,
        hashes={**hashes, path.name: hashlib.sha256(raw).hexdigest()},
    )


def _decoded(raw: bytes) -> str:
    """Text of UTF-8, or of Latin-1, in which many loggers write their degree signs."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _named_as_keys(cells: "_Cells") -> LoggerColumns:
    """Columns whose headings are the keys' own names."""
    from pydantic import ValidationError

    local = {name: name for name in LoggerColumns.model_fields if name in cells.headings}
    try:
        return LoggerColumns(**local)
    except ValidationError as problem:
        text = problem.errors(include_url=False)[0]["msg"]
        raise refusal(
            cells.file,
            f"line {cells.sheet.header_line}, {text}; the headings are {shown(', '.join(cells.headings))} (expected "
            "[columns] in a sheet, FILE.toml or --sheet, that says which is which)",
        ) from problem


@dataclass(frozen=True, eq=False)
class _Cells:
    """Cells of a table as text, by heading."""

    file: str
    sheet: LoggerSheet
    headings: tuple[str, ...]
    lines: list[int]
    rows: list[list[str]]
    delimiter: str

    @classmethod
    def of(cls, text: str, file: str, sheet: LoggerSheet) -> "_Cells":
        lines = text.splitlines()
        if len(lines) < sheet.header_line:
            raise refusal(file, f"has {len(lines)} lines (expected headings in line {sheet.header_line})")
        first = lines[sheet.header_line - 1]
        between = {"tab": "\t"}.get(sheet.delimiter or "", sheet.delimiter) or next(
            (sign for sign in (";", "\t") if sign in first), ","
        )
        headings = tuple(_split(first, between, file, sheet.header_line))
        for name in headings:
            if name and headings.count(name) > 1:
                raise refusal(
                    file, f"line {sheet.header_line}, column {shown(name)} occurs {headings.count(name)} times"
                )
        if sheet.columns is not None:
            _require(sheet.columns, headings, file, sheet.header_line)
        numbers: list[int] = []
        rows: list[list[str]] = []
        for number, line in enumerate(lines[sheet.header_line + sheet.skip_lines :], sheet.header_line + 1):
            line_number = number + sheet.skip_lines
            if not line.strip():
                continue
            row = _split(line, between, file, line_number)
            if len(row) != len(headings):
                raise refusal(file, f"line {line_number}, {len(row)} cells = {shown(line)} (expected {len(headings)})")
            numbers.append(line_number)
            rows.append(row)
        if not rows:
            raise refusal(file, "holds headings and no rows (expected at least one)")
        return cls(file=file, sheet=sheet, headings=headings, lines=numbers, rows=rows, delimiter=between)

    def column(self, heading: str) -> list[str]:
        at = self.headings.index(heading)
        return [row[at] for row in self.rows]

    def refuse(self, row: int, heading: str, problem: str) -> InputError:
        cell = self.rows[row][self.headings.index(heading)]
        return refusal(self.file, f"line {self.lines[row]}, column {shown(heading)} = {shown(cell)} {problem}")

    def numbers(self, heading: str) -> np.ndarray:
        """Column as numbers (n,); nan where the sensor gave nothing."""
        comma = self.sheet.decimal == "," or (self.sheet.decimal is None and self.delimiter != ",")
        values = np.full(len(self.rows), np.nan)
        for row, cell in enumerate(self.column(heading)):
            if not cell or cell in self.sheet.missing:
                continue
            plain = cell
            if self.sheet.decimal == ",":
                plain = cell.replace(".", "").replace(",", ".")  # 1.013,25
            elif comma:
                plain = pointed(cell)
            if not NUMBER.fullmatch(plain):
                raise self.refuse(row, heading, "(expected a number; a sensor's word for none belongs to `missing`)")
            values[row] = float(plain)
        return values

    def refuse_outside(self, heading: str, values: np.ndarray, quantity: str) -> None:
        low, high = LIMITS[quantity]
        wrong = (values < low) | (values > high)
        if wrong.any():
            row = int(np.argmax(wrong))
            name, _, unit = quantity.rpartition("_")
            sign = {"c": "°C", "hpa": "hPa", "percent": "%"}[unit]
            raise self.refuse(
                row,
                heading,
                f"is a {name.replace('_', ' ')} of {values[row]:.6g} {sign} (expected {low:g} to {high:g} {sign}; see "
                "its unit in [columns]; a sensor's number for none belongs to `missing`)",
            )

    def stations(self, columns: LoggerColumns) -> tuple[str, ...]:
        """Names of the rows' stations."""
        if columns.station is None:
            return (self.sheet.station,) * len(self.rows)
        names = self.column(columns.station)
        for row, name in enumerate(names):
            if not NAME.fullmatch(name) or ".." in name:
                raise self.refuse(row, columns.station, "(expected letters, digits, _ . - and no '..')")
        return tuple(names)

    def times(self, columns: LoggerColumns) -> np.ndarray:
        """Times (n,), Modified Julian Date, UTC."""
        if columns.mjd_utc is not None:
            mjd = self.numbers(columns.mjd_utc)
        else:
            assert columns.time is not None
            mjd = np.array(list(self._clock(columns.time, self.stations(columns))))
        heading = columns.mjd_utc or (columns.time if isinstance(columns.time, str) else (columns.time or ("",))[0])
        wrong = ~((mjd >= EARLIEST_MJD) & (mjd <= LATEST_MJD))
        if wrong.any():
            raise self.refuse(int(np.argmax(wrong)), heading, "(expected a time of 1968 to 2132)")
        return mjd

    def _clock(self, time: str | tuple[str, str], stations: Sequence[str]) -> Iterator[float]:
        """Times of the rows; a local hour that summer time repeats goes on from the row before."""
        zone = _zone(self.sheet.time_zone)
        parts = [self.column(name) for name in ((time,) if isinstance(time, str) else time)]
        heading = time if isinstance(time, str) else time[0]
        latest: dict[str, float] = {}
        for row, cells in enumerate(zip(*parts, strict=True)):
            try:
                when = _parsed(" ".join(cells), self.sheet.time_format)
            except ValueError:
                raise self.refuse(
                    row, heading, f"is no time (expected {self.sheet.time_format or 'ISO 8601'}; see time_format)"
                ) from None
            if when.tzinfo is None:
                local = when.replace(tzinfo=zone)
                mjd = _mjd(local)
                if (
                    _mjd(local.replace(fold=1)) != mjd
                    and local.astimezone(UTC).astimezone(zone).replace(tzinfo=None) != when
                ):
                    raise self.refuse(row, heading, f"is an hour that summer time leaves out in {self.sheet.time_zone}")
                if mjd <= latest.get(stations[row], -np.inf):
                    mjd = max(mjd, _mjd(local.replace(fold=1)))
            else:
                mjd = _mjd(when)
            latest[stations[row]] = max(mjd, latest.get(stations[row], -np.inf))
            yield mjd


def _require(columns: LoggerColumns, headings: Sequence[str], file: str, line: int) -> None:
    """Raise InputError for a heading that is not there."""
    for item in columns.model_dump().values():
        for heading in (item,) if isinstance(item, str) else item or ():
            if heading not in headings:
                raise refusal(
                    file,
                    f"line {line}, column {shown(heading)} is missing (the headings are {shown(', '.join(headings))})",
                )


def _split(line: str, delimiter: str, file: str, number: int) -> list[str]:
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader(io.StringIO(line), delimiter=delimiter, strict=True))]
    except (csv.Error, StopIteration) as problem:
        raise refusal(file, f"line {number} is no table: {problem}") from problem


def _parsed(text: str, form: str | None) -> datetime:
    return datetime.fromisoformat(text) if form is None else datetime.strptime(text, form)


def _mjd(when: datetime) -> float:
    return (when.astimezone(UTC) - MJD_ZERO) / timedelta(seconds=1) / SECONDS_PER_DAY


def _zone(name: str) -> tzinfo:
    """Time zone by name or offset; InputError if unknown."""
    if name.upper() in ("UTC", "Z"):
        return UTC
    if (parts := OFFSET.fullmatch(name)) is not None:
        size = timedelta(hours=int(parts[2]), minutes=int(parts[3]))
        if size < timedelta(days=1):
            return timezone(-size if parts[1] == "-" else size)
    from zoneinfo import ZoneInfo

    try:
        return ZoneInfo(name)
    except (KeyError, ValueError, OSError) as problem:
        raise InputError(
            f"time zone {name!r} is unknown (expected UTC, an offset such as -05:00, or a name such as Europe/Berlin)"
        ) from problem
