"""Table of readings READINGS.csv and its sheet READINGS.toml: who, when, with what.

A value may be a column or a key of the sheet: a constant temperature is a key, a varying one a column; a column takes
precedence. Every table may have the columns `mjd_utc` and `left_out`; a reading with a text in the second is excluded
and shown with that text.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from catseye.errors import InputError
from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.reading import Folder, column, toml_of
from catseye.records.files.record import EARLIEST_MJD, LATEST_MJD, Name, Record, Version, Within, broken_rule
from catseye.records.files.refusal import other_unit, refusal

Words = Annotated[str, Field(min_length=1)]
Share = Annotated[float, Within(0, 1, above=True)]
TIME = "mjd_utc"
LEFT_OUT = "left_out"
TEXT = None  # limits of a text column


class Sheet(Record):
    """Sheet common to all calibrations.

    kind          kind of calibration, by its name in the command
    instrument    calibrated instrument: "ZP103", "EDM 7"
    serial        serial number
    measured_on   day of the readings
    valid_until   last day of validity, after measured_on
    by            person who measured
    report        reference to the report
    level         significance level of the tests: probability of any false alarm among the readings
    """

    format: Annotated[int | str, Version("readings")] = 1
    kind: Name
    instrument: Words
    serial: int | Words
    measured_on: date
    valid_until: date
    by: Words
    report: Words
    level: Share = 0.05

    @field_validator("level")
    @classmethod
    def _is_a_level(cls, level: float, info: ValidationInfo) -> float:
        if level < 0.5:
            return level
        raise broken_rule(f"level = {level} is not a small probability (expected below 0.5, such as 0.05)")

    @model_validator(mode="after")
    def _is_valid_after_it_was_measured(self) -> "Sheet":
        if self.valid_until <= self.measured_on:
            raise broken_rule(
                f"valid_until = {self.valid_until} is not after measured_on = {self.measured_on} (expected a later day)"
            )
        return self


@dataclass(frozen=True)
class SheetLayout:
    """Columns and sheet of one kind of calibration.

    kind       name of the kind
    sheet      type of its sheet
    required   required columns: name -> limits of a number, TEXT for text
    optional   optional columns
    """

    kind: str
    sheet: type[Sheet]
    required: Mapping[str, Within | None]
    optional: Mapping[str, Within | None] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SheetReadings:
    """Table with its sheet; all numbers are finite and within their limits.

    file       name of the table
    sheet      its sheet; sheet_file is the sheet's name
    numbers    columns (m,)
    words      columns of text
    where      place of each reading in the file: "line 2"
    left_out   reason for excluding a reading, "" if used
    hashes     SHA-256 of both files
    """

    file: str
    sheet: Any
    sheet_file: str
    numbers: Mapping[str, np.ndarray]
    words: Mapping[str, tuple[str, ...]]
    where: tuple[str, ...]
    left_out: tuple[str, ...]
    hashes: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.where)

    @property
    def active(self) -> np.ndarray:
        """Mask of the readings in use, (m,) bool."""
        return np.array([not reason for reason in self.left_out])

    def has(self, name: str) -> bool:
        """True if a column or a key of this name is given."""
        return name in self.numbers or getattr(self.sheet, name, None) is not None

    def get(self, name: str) -> np.ndarray:
        """Column (m,), or the sheet's key repeated; InputError if neither is given."""
        if name in self.numbers:
            return self.numbers[name]
        value = getattr(self.sheet, name, None)
        if value is None:
            raise refusal(
                self.sheet_file, f"{name} is missing (expected a value, or a column of that name in {self.file})"
            )
        return np.full(len(self), float(value))

    def hours(self) -> np.ndarray:
        """Hours since the first reading, (m,); requires the column mjd_utc."""
        if TIME not in self.numbers:
            raise refusal(self.file, f"line 1, column {TIME!r} is missing (needed to follow the drift)")
        return (self.numbers[TIME] - self.numbers[TIME].min()) * 24.0

    def refuse(self, row: int, problem: str) -> InputError:
        """Error for one reading, counted from 0."""
        return refusal(self.file, f"{self.where[row]}, {problem}")


def read_readings(path: Path | str, layout: SheetLayout, sheet: Path | str | None = None) -> SheetReadings:
    """Read a table and its sheet.

    path      of the table, CSV with a header, columns in any order
    layout    expected columns and sheet
    sheet     path of the sheet; None for the table's with the suffix .toml

    Raises InputError, one line with file, place, value and expectation.
    """
    path = Path(path)
    sheet_path = path.with_suffix(".toml") if sheet is None else Path(sheet)
    if sheet_path.resolve() == path.resolve():
        raise refusal(path.name, "is given as the table and as its sheet (expected a table .csv and a sheet .toml)")
    page = Folder(sheet_path.parent)
    if path.is_file() and not sheet_path.exists():
        raise refusal(sheet_path.name, f"missing in {page.directory} (expected the sheet of {path.name}, TOML)")
    kind = toml_of(page.text(sheet_path.name), sheet_path.name).get("kind")
    if isinstance(kind, str) and kind != layout.kind:  # before its keys, which are another kind's
        raise refusal(
            sheet_path.name, f"kind = {kind!r} is the sheet of another calibration (expected {layout.kind!r})"
        )
    record = page.record(sheet_path.name, layout.sheet)
    folder = Folder(path.parent)
    text = folder.text(path.name)
    optional = {**layout.optional, TIME: Within(EARLIEST_MJD, LATEST_MJD), LEFT_OUT: TEXT}
    optional = {name: bounds for name, bounds in optional.items() if name not in layout.required}
    table = columns_of(text, path.name, list(layout.required), optional=list(optional))
    limits = {**optional, **layout.required}
    numbers, words = {}, {}
    for name, cells in table.cells.items():
        bounds = limits[name]
        if bounds is TEXT:
            words[name] = tuple(cells)
        else:
            numbers[name] = _within(table, name, bounds)
    reasons = words.pop(LEFT_OUT, ("",) * len(table))
    if all(reasons):
        raise refusal(path.name, f"every reading has a reason in {LEFT_OUT!r} (expected some without)")
    hashes = {**folder.hashes, **page.hashes}
    return SheetReadings(
        file=path.name,
        sheet=record,
        sheet_file=sheet_path.name,
        numbers=numbers,
        words=words,
        where=table.where(),
        left_out=reasons,
        hashes=hashes,
    )


def _within(table: TextColumns, name: str, bounds: Within) -> np.ndarray:
    values = table.numbers(name)
    good = (values >= bounds.low) & (values <= bounds.high) & ~(bounds.above & (values == bounds.low))
    if not good.all():
        row = int(np.argmin(good))
        context = {"low": bounds.low, "high": bounds.high, "size": float(values[row])}
        hint = other_unit(name, context) if math.isfinite(values[row]) else ""
        span = f"{'above ' if bounds.above else ''}{bounds.low:.10g} to {bounds.high:.10g}"
        raise table.refuse(row, f"{name} = {table.cells[name][row]}{hint} (expected {span})")
    return column(values.tolist(), np.float64)
