"""Readers from files to records; errors in one line.

Rows of a table count from 1 without the header; a number in brackets counts from 0.
"""

import csv
import hashlib
import io
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import ValidationError

from catseye.records.files.record import Record
from catseye.records.files.refusal import NUMBER, explained, refusal, shown, unreadable

R = TypeVar("R", bound=Record)

INTEGER = re.compile(r"[+-]?[0-9]{1,18}")


@dataclass(frozen=True)
class Folder:
    """Directory of input files; `hashes` collects the SHA-256 of each file read, by relative path."""

    directory: Path
    hashes: dict[str, str] = field(default_factory=dict)

    def path(self, file: str) -> Path:
        """Path of the file; InputError if missing."""
        path = self.directory / file
        try:
            if path.is_file():
                return path
            state = "is not a file" if path.exists() else "missing"
        except OSError as problem:
            raise unreadable(file, problem) from problem
        if not file:  # a path such as . or /
            raise refusal(str(path), f"{state} (expected one)")
        raise refusal(file, f"{state} in {self.directory}")

    def records_in(self, file: str) -> list[str]:
        """TOML files of a subdirectory, sorted; InputError if missing."""
        try:
            if not (self.directory / file).is_dir():
                raise refusal(file, f"missing in {self.directory} (expected a directory)")
            names = sorted(path.name for path in (self.directory / file).iterdir())
        except OSError as problem:
            raise unreadable(file, problem) from problem
        return [f"{file}/{name}" for name in names if name.endswith(".toml") and not name.startswith(".")]

    def text(self, file: str) -> str:
        try:
            raw = self.path(file).read_bytes()
        except OSError as problem:
            raise unreadable(file, problem) from problem
        self.hashes[file] = hashlib.sha256(raw).hexdigest()
        try:
            text = raw.decode("utf-8").removeprefix("\ufeff")
        except UnicodeDecodeError as problem:
            byte = f"byte {problem.start} = 0x{raw[problem.start]:02x}"
            raise refusal(file, f"{byte} is not UTF-8 (expected UTF-8 text)") from problem
        if not text.strip():
            raise refusal(file, f"holds {len(raw)} bytes and no text: empty")
        return text

    def record(self, file: str, kind: type[R]) -> R:
        """Record of a complete TOML file."""
        return record_of_text(self.text(file), file, kind)

    def table(self, file: str, kind: type[R]) -> list[R]:
        """Rows of a CSV file with a header, as records."""
        header, rows = cells_of(self.text(file), file)
        columns = list(kind.model_fields)
        refuse_header(file, header, columns)
        readers = [NUMBERS.get(kind.model_fields[name].annotation) for name in header]
        records = []
        for number, row in enumerate(rows, start=1):
            if len(row) != len(header):
                fields = f"{len(row)} fields = {shown(','.join(row))}"
                raise refusal(file, f"row {number}, {fields} (expected {len(header)})")
            values = {
                name: reader[1](cell) if reader and reader[0].fullmatch(cell) else cell
                for name, cell, reader in zip(header, row, readers, strict=True)
            }
            try:
                records.append(kind.model_validate(values))
            except ValidationError as problem:
                cells = dict(zip(header, row, strict=True))
                raise refusal(file, f"row {number}, {explained(problem, cells, kind)}") from problem
        return records


NUMBERS: dict[Any, tuple[re.Pattern[str], Any]] = {int: (INTEGER, int), float: (NUMBER, float)}


def read_record(path: Path | str, kind: type[R]) -> R:
    """Record of one TOML file at any path."""
    path = Path(path)
    return Folder(path.parent).record(path.name, kind)


def record_of_text(text: str, file: str, kind: type[R]) -> R:
    """Record of a TOML text; the file's name is for the refusal."""
    document = toml_of(text, file)
    try:
        return kind.model_validate(document)
    except ValidationError as problem:
        raise refusal(file, explained(problem, document, kind)) from problem


def column(values: Sequence[float], kind: type[np.number]) -> np.ndarray:
    """Column of a table as a read-only array."""
    array = np.array(values, dtype=kind)
    array.setflags(write=False)
    return array


def toml_of(text: str, file: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        message, _, where = str(problem).rpartition(" (at ")
        place = re.fullmatch(r"line ([0-9]+), column ([0-9]+)\)", where)
        lines = text.replace("\r\n", "\n").split("\n")
        line, at = (int(place[1]), int(place[2])) if place else (len(lines), len(lines[-1]) + 1)
        written = shown(lines[line - 1]) if line <= len(lines) else "''"
        raise refusal(file, f"line {line}, column {at}, {written} is not TOML: {message}") from problem
    except (ValueError, RecursionError) as problem:
        raise refusal(file, f"cannot be read as TOML: {problem}") from problem


def cells_of(text: str, file: str) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a table; empty lines at the end are ignored."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    rows: list[list[str]] = []
    try:
        rows.extend(reader)
    except csv.Error as problem:
        raise refusal(file, f"line {reader.line_num} is not CSV: {problem}") from problem
    while rows and not rows[-1]:
        rows.pop()
    return rows[0], rows[1:]


def refuse_header(file: str, header: list[str], columns: list[str]) -> None:
    expected = f"(expected the header {','.join(columns)})"
    for name in header:
        if name not in columns:
            raise refusal(file, f"header, column {shown(name)} is unknown {expected}")
        if header.count(name) > 1:
            raise refusal(file, f"header, column {shown(name)} occurs {header.count(name)} times {expected}")
    for name in columns:
        if name not in header:
            raise refusal(file, f"header, column {name!r} is missing {expected}")
