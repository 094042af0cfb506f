"""Columns of the tables that commands write, each defined once: name, unit, meaning, values.

A `Table` at the top level of a module of `gateways` is all there is to say: its CSV file, the units of its FITS table,
the columns that a result in Python repeats, and the table on its page of `docs/formats`, which a test compares
(`tests/contracts/test_columns.py`; `python tests/contracts/table_scene.py` writes the pages anew).
"""

import csv
import io
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

Source = TypeVar("Source")
Row = TypeVar("Row")
Values = np.ndarray | Sequence[Any]

PIECE = 5_000  # rows of a piece
PRINTED = {"um": "µm", "urad": "µrad", "deg": "°", "arcsec": "″", "deg_C": "°C", "mm2": "mm²", "percent": "%"}
SUFFIXES = {"deg_C": "c", "deg / s": "deg_s", "m / s": "m_per_s", "1 / m": "per_m", "m2 / Hz": "m2_per_hz", "d": "utc"}


@dataclass(frozen=True)
class Column(Generic[Source]):
    """Column of a table.

    name     heading in CSV, which ends in the unit
    unit     as astropy spells it; "" for none
    doc      meaning, for the page
    value    function from the source to the values, one per row; None where this file lacks the column
    form     number format, which leaves a cell empty where a number is not finite; "" for text and for exact numbers
    """

    name: str
    unit: str
    doc: str
    value: Callable[[Source], Values | None]
    form: str = ""

    @property
    def suffix(self) -> str:
        """End of the name, which says the unit."""
        return f"_{SUFFIXES.get(self.unit, self.unit.lower())}" if self.unit else ""

    def cells(self, values: Values) -> list[str]:
        """Texts of a column's values."""
        return texts(values, self.form)

    @property
    def label(self) -> str:
        """Name without its unit, for tables whose columns carry units."""
        return self.name.removesuffix(self.suffix)


@dataclass(frozen=True)
class Table(Generic[Source]):
    """Table that a command writes.

    file      name of the file
    page      page of docs/formats that describes it, under a heading with the file's name
    columns   in the file's order
    also      other names of such files, as patterns
    """

    file: str
    page: str
    columns: tuple[Column[Source], ...]
    also: tuple[str, ...] = ()

    @property
    def header(self) -> str:
        """First line of a file that has every column."""
        return ",".join(column.name for column in self.columns)

    def csv(self, source: Source | None) -> str:
        """CSV text; None for no rows.

        >>> x = Column[dict]("x_m", "m", "along the line", lambda p: list(p.values()), ".2f")
        >>> Table("pillars.csv", "p.md", (Column("pillar", "", "name", list), x)).csv({"A": 0.0, "B": float("nan")})
        'pillar,x_m\\nA,0.00\\nB,\\n'
        """
        return "".join(self.pieces(source))

    def pieces(self, source: Source | None) -> Iterator[str]:
        """CSV text piece by piece, for tables of any length; None for no rows."""
        if source is None:
            yield self.header + "\n"
            return
        evaluated = [(column, column.value(source)) for column in self.columns]
        present = [(column, _sliceable(values)) for column, values in evaluated if values is not None]
        yield ",".join(column.name for column, _ in present) + "\n"
        lengths = {column.name: len(values) for column, values in present}
        if len(set(lengths.values())) > 1:
            raise ValueError(f"{self.file}: columns of different lengths {lengths}")
        for low in range(0, len(present[0][1]), PIECE):
            yield _lines(column.cells(values[low : low + PIECE]) for column, values in present)

    def stream(self, batches: Iterable[Source]) -> Iterator[str]:
        """CSV text of batches of rows, which need not be in memory together."""
        yield self.header + "\n"
        for batch in batches:
            yield _lines(column.cells(_sliceable(column.value(batch))) for column in self.columns)

    def quantities(
        self, source: Source, names: Iterable[str], rows: np.ndarray | None = None
    ) -> dict[str, tuple[Values, str]]:
        """Values and unit of some columns, under their names without unit.

        source   as for `csv`
        names    in CSV
        rows     indices of rows; None for all
        """
        columns = {column.name: column for column in self.columns}
        chosen = {}
        for name in names:
            values = columns[name].value(source)
            if values is not None:
                chosen[columns[name].label] = (values if rows is None else _at(values, rows), columns[name].unit)
        return chosen

    def markdown(self) -> str:
        """Table of the columns on the page."""
        units = {c.unit: f" {PRINTED.get(c.unit, c.unit)} " if c.unit else " " for c in self.columns}
        rows = (f"| `{c.name}` |{units[c.unit]}| {c.doc} |\n" for c in self.columns)
        return "| column | unit | meaning |\n|---|---|---|\n" + "".join(rows)


def each(value: Callable[[Row], Any]) -> Callable[[Sequence[Row]], list[Any]]:
    """Function of a sequence of rows from a function of one."""
    return lambda rows: [value(row) for row in rows]


def texts(values: Values, form: str) -> list[str]:
    """Cells of a column; empty for None and NaN, with a number format for infinity, too.

    >>> texts(np.array([0.5, np.nan]), ".3f"), texts(["A", None, 3], "")
    (['0.500', ''], ['A', '', '3'])
    """
    plain = values.tolist() if isinstance(values, np.ndarray) else values
    if not form:
        return ["" if value is None or value != value else str(value) for value in plain]
    code = f"%{form}"
    if isinstance(values, np.ndarray) and np.isfinite(values).all():
        return [code % value for value in plain]
    return ["" if value is None or not math.isfinite(value) else code % value for value in plain]


def _at(values: Values, rows: np.ndarray) -> Values:
    return values[rows] if isinstance(values, np.ndarray) else [values[k] for k in rows]


def _lines(columns: Iterable[Sequence[str]]) -> str:
    stream = io.StringIO(newline="")
    csv.writer(stream, lineterminator="\n").writerows(zip(*columns, strict=True))
    return stream.getvalue()


def _sliceable(values: Values | Iterable[Any] | None) -> Values:
    return values if isinstance(values, np.ndarray | list | tuple) else list(values or ())
