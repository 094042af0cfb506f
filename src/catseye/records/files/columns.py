"""Tables of many rows, read by column: fast if valid, with precise errors if not.

Lines count from 1; the header is line 1.
"""

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.errors import InputError
from catseye.records.files.refusal import NUMBER, refusal, shown

Check = Callable[[list[str]], None]


@dataclass(frozen=True)
class TextColumns:
    """CSV table by column; cells are text without surrounding spaces.

    file     file name, for messages
    cells    column name -> cells, one per row
    lines    line of each row in the file
    comma    True if cells are separated by semicolons, so that decimal commas are allowed
    place    word for a row's place: "line" of a file, "row" of arrays
    """

    file: str
    cells: dict[str, list[str]]
    lines: Sequence[int]
    comma: bool = False
    place: str = "line"

    def __len__(self) -> int:
        return len(self.lines)

    def refuse(self, row: int, problem: str) -> InputError:
        """Error for one row, counted from 0."""
        return refusal(self.file, f"{self.place} {self.lines[row]}, {problem}")

    def numbers(self, name: str, blank: float | None = None) -> np.ndarray:
        """Column as finite numbers (rows,); a blank cell is `blank`, or an error if None."""
        cells = self.cells[name]
        if self.comma:
            cells = list(map(pointed, cells))
        if blank is not None and "" in cells:
            cells = [cell or repr(blank) for cell in cells]
        try:
            values = np.array(list(map(float, cells)))
        except ValueError:
            values = np.array([float(cell) if NUMBER.fullmatch(cell) else np.nan for cell in cells])
        bad = ~np.isfinite(values)
        if blank is not None:
            bad &= [cell != "" for cell in self.cells[name]]
        if "_" in "".join(cells):  # a digit separator for Python's float
            bad |= ["_" in cell for cell in cells]
        if bad.any():
            row = int(np.argmax(bad))
            raise self.refuse(row, f"{name} = {shown(self.cells[name][row])} (expected a finite number)")
        return values

    def check(self, name: str, good: np.ndarray, expected: str) -> None:
        """Raise InputError for the first row with False in `good`, with its cell."""
        if not good.all():
            row = int(np.argmin(good))
            raise self.refuse(row, f"{name} = {shown(self.cells[name][row])} (expected {expected})")

    def where(self) -> tuple[str, ...]:
        """Place of every row, in words."""
        return tuple(map(f"{self.place} {{}}".format, self.lines))


def pointed(cell: str) -> str:
    """Cell with a decimal comma replaced by a point, unless it has a point.

    >>> pointed("1,5"), pointed("1,500.0")
    ('1.5', '1,500.0')
    """
    return cell.replace(",", ".") if cell.count(",") == 1 and "." not in cell else cell


def columns_of(text: str, file: str, required: Sequence[str], *, optional: Sequence[str] = ()) -> TextColumns:
    """Columns of a CSV text with header, in any order.

    text       content of the file; cells are separated by semicolons if its header has these and no comma
    file       file name, for messages
    required   required columns
    optional   optional columns

    Raises InputError for an unknown, missing or repeated column, a row of wrong width, a table without rows.

    >>> columns_of("to,from\\nT1,S1\\n", "r.csv", ["from", "to"]).cells["from"]
    ['S1']
    """
    text = text.replace("\r\n", "\n")
    head = text.partition("\n")[0]
    between = ";" if ";" in head and "," not in head else ","

    def check(header: list[str]) -> None:
        _check_header(file, header, required, optional)

    header, cells, lines = (_quoted if '"' in text else _plain)(text, file, check, between)
    if not lines:
        raise refusal(file, "holds a header and no rows (expected at least one)")
    width, strip = len(header), str.strip
    columns = {name: list(map(strip, cells[at::width])) for at, name in enumerate(header)}
    return TextColumns(file, columns, lines, comma=between == ";")


def columns_of_arrays(
    columns: Mapping[str, Sequence[object]], table: str, required: Sequence[str], *, optional: Sequence[str] = ()
) -> TextColumns:
    """Columns of one table as if they were read from a file.

    columns    texts and numbers by name, of equal lengths; a number that is nan is blank
    table      name for messages
    required   required columns
    optional   optional columns

    A number is written with all its digits and read back the same. Raises InputError as `columns_of`.

    >>> columns_of_arrays({"to": ["T1"], "d": [0.1]}, "ranges", ["to", "d"]).cells
    {'to': ['T1'], 'd': ['0.1']}
    """
    _check_header(table, list(columns), required, optional)
    cells = {name: [_cell(value) for value in values] for name, values in columns.items()}
    count = len(next(iter(cells.values())))
    if not count:
        raise refusal(table, "holds no rows (expected at least one)")
    return TextColumns(table, cells, range(count), place="row")


def _cell(value: object) -> str:
    if isinstance(value, float):
        return repr(value) if value == value else ""
    return str(value)


def _check_header(file: str, header: list[str], required: Sequence[str], optional: Sequence[str]) -> None:
    expected = f"(expected the header {','.join(required)}" + (
        f", optionally {','.join(optional)})" if optional else ")"
    )
    strange = [name for name in header if name not in required and name not in optional]
    if strange:
        verb = "is unknown" if len(strange) == 1 else "are unknown"
        raise refusal(file, f"line 1, column {', '.join(map(shown, strange))} {verb} {expected}")
    for name in header:
        if header.count(name) > 1:
            raise refusal(file, f"line 1, column {shown(name)} occurs {header.count(name)} times {expected}")
    for name in required:
        if name not in header:
            raise refusal(file, f"line 1, column {name!r} is missing {expected}")


def _plain(text: str, file: str, check: Check, between: str) -> tuple[list[str], list[str], Sequence[int]]:
    """Header, all cells row by row, and the rows' lines.

    One split of the complete text, since a list per row would be slow.
    """
    text = text.rstrip()
    if not text:
        raise refusal(file, "is empty")
    first, _, body = text.partition("\n")
    header = [cell.strip() for cell in first.split(between)]
    check(header)
    lines = body.split("\n") if body else []
    commas = len(header) - 1
    if any(line.count(between) != commas for line in lines):
        row = next(i for i, line in enumerate(lines) if line.count(between) != commas)
        raise _uneven(file, row + 2, lines[row].split(between), len(header))
    return header, body.replace("\n", between).split(between) if body else [], range(2, len(lines) + 2)


def _quoted(text: str, file: str, check: Check, between: str) -> tuple[list[str], list[str], Sequence[int]]:
    reader = csv.reader(io.StringIO(text.rstrip(), newline=""), strict=True, delimiter=between)
    cells: list[str] = []
    lines: list[int] = []
    try:
        header = [cell.strip() for cell in next(reader)]
        check(header)
        start = reader.line_num + 1
        for row in reader:
            if len(row) != len(header):
                raise _uneven(file, start, row, len(header))
            cells += row
            lines.append(start)
            start = reader.line_num + 1
    except csv.Error as problem:
        raise refusal(file, f"line {reader.line_num} is not CSV: {problem}") from problem
    return header, cells, lines


def _uneven(file: str, line: int, row: list[str], width: int) -> InputError:
    return refusal(file, f"line {line}, {len(row)} fields = {shown(','.join(row))} (expected {width})")
