"""A table of readings and the sheet beside it: READINGS.csv holds numbers, READINGS.toml who, when, with what.

A column and a key of the sheet may stand for each other: a temperature that did not change is a key, one that did is a
column, and a column wins. Every table may have the columns `mjd_utc` and `left_out`; a reading with a text in the
second takes no part and is shown with that text.
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
from catseye.records.files.reading import Folder, column
from catseye.records.files.record import EARLIEST_MJD, LATEST_MJD, Name, Record, Version, Within, broken_rule
from catseye.records.files.refusal import other_unit, refusal

Words = Annotated[str, Field(min_length=1)]
Share = Annotated[float, Within(0, 1, above=True)]
TIME = "mjd_utc"
LEFT_OUT = "left_out"
TEXT = None  # the limits of a column of words


class Sheet(Record):
    """What every calibration says about its readings.

    kind                     of calibration, as the command calls it
    instrument               what was calibrated: "ZP103", "EDM 7"
    serial                   of it
    measured_on, valid_until dates
    by                       who measured
    report                   where it is written up
    level                    of the tests: chance of any false alarm among the readings
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
    """The columns and the sheet of one kind of calibration.

    kind       its name
    sheet      type of its sheet
    required   columns that must be there: name -> limits of a number, TEXT for words
    optional   columns that may be
    """

    kind: str
    sheet: type[Sheet]
    required: Mapping[str, Within | None]
    optional: Mapping[str, Within | None] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SheetReadings:
    """A table with its sheet, every number finite and within its limits.

    file       name of the table
    sheet      record beside it; sheet_file is its name
    numbers    columns (m,)
    words      columns of text
    where      place of each reading in the file: "line 2"
    left_out   why a reading takes no part, "" where it does
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
        """Whether each reading takes part, (m,) bool."""
        return np.array([not reason for reason in self.left_out])

    def has(self, name: str) -> bool:
        """A column or a key of that name is given."""
        return name in self.numbers or getattr(self.sheet, name, None) is not None

    def get(self, name: str) -> np.ndarray:
        """(m,) of a column, or of the key of the sheet repeated; InputError where neither is given."""
        if name in self.numbers:
            return self.numbers[name]
        value = getattr(self.sheet, name, None)
        if value is None:
            raise refusal(
                self.sheet_file, f"{name} is missing (expected a value, or a column of that name in {self.file})"
            )
        return np.full(len(self), float(value))

    def hours(self) -> np.ndarray:
        """(m,) h since the first reading; the column mjd_utc must be there."""
        if TIME not in self.numbers:
            raise refusal(self.file, f"line 1, column {TIME!r} is missing (needed to follow the drift)")
        return (self.numbers[TIME] - self.numbers[TIME].min()) * 24.0

    def refuse(self, row: int, problem: str) -> InputError:
        """The error of one reading, counted from 0."""
        return refusal(self.file, f"{self.where[row]}, {problem}")


def read_readings(path: Path | str, layout: SheetLayout, sheet: Path | str | None = None) -> SheetReadings:
    """A table and its sheet.

    path      of the table, CSV with a header, columns in any order
    layout    what is expected in both
    sheet     path of the sheet; the table's with the ending .toml if None

    Raises InputError, one line with file, place, value and what was expected.
    """
    path = Path(path)
    beside = path.with_suffix(".toml") if sheet is None else Path(sheet)
    if beside.resolve() == path.resolve():
        raise refusal(path.name, "is given as the table and as its sheet (expected a table .csv and a sheet .toml)")
    page = Folder(beside.parent)
    record = page.record(beside.name, layout.sheet)
    if record.kind != layout.kind:
        raise refusal(
            beside.name, f"kind = {record.kind!r} is a sheet of another calibration (expected {layout.kind!r})"
        )
    folder = Folder(path.parent)
    text = folder.text(path.name)
    optional = {**layout.optional, TIME: Within(EARLIEST_MJD, LATEST_MJD), LEFT_OUT: TEXT}
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
    return SheetReadings(path.name, record, beside.name, numbers, words, table.where(), reasons, hashes)


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
