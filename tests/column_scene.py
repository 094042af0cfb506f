"""A CSV table against what is in memory: each number must be the SI value over the unit that its column's name says.

A test says of every column how its value is got from what was written, in SI; the unit is read off the column's name
here, never off the code that writes. A column that the test does not know, or lacks, fails.
"""

import csv
import io
import math

DEGREE = math.pi / 180.0
# fmt: off
UNITS = {  # SI of one of them, by the last words of a column's name; the longest that fits counts
    "m": 1.0, "mm": 1e-3, "um": 1e-6, "mm2": 1e-6, "per_m": 1.0, "rad": 1.0, "urad": 1e-6, "deg": DEGREE,
    "arcsec": DEGREE / 3600.0, "s": 1.0, "us": 1e-6, "m_per_s": 1.0, "deg_s": DEGREE, "hz": 1.0, "m2_per_hz": 1.0,
    "ppm": 1e-6, "percent": 1e-2, "pct": 1e-2, "hpa": 100.0, "mb": 100.0, "v": 1.0, "w": 1.0, "db": 1.0,
    "c": 1.0, "utc": 1.0,  # °C and Modified Julian Days, as everywhere in catseye
}
# fmt: on


def unit_of(column):
    """SI of one in a column; 1 for a name that says no unit."""
    words = column.split("_")
    for first in range(1, len(words)):
        if "_".join(words[first:]) in UNITS:
            return UNITS["_".join(words[first:])]
    return 1.0


def last_digit(cell):
    """What one of a cell's last digit stands for: 1e-4 of "0.1230", 1e-7 of "1.20e-05"."""
    mantissa, _, power = cell.lower().partition("e")
    return 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


def cells_of(text):
    """The rows of a CSV, its header as keys."""
    return list(csv.DictReader(io.StringIO(text if isinstance(text, str) else "".join(text), newline="")))


def assert_columns(text, told, rows, silent=()):
    """Every cell of a table is what is told of it.

    text     of the CSV, or its pieces
    told     column -> function of a row of `rows`, which gives a number in SI, a text, or None or NaN for an empty cell
    rows     what the table's rows were made of, in their order
    silent   columns that say nothing in these rows

    Elsewhere a cell at least must have the digits to tell the number from its double.
    """
    found = cells_of(text)
    assert found, "no row: nothing is checked"
    assert list(found[0]) == list(told), f"columns differ: {set(found[0]) ^ set(told) or 'in their order'}"
    assert len(found) == len(rows)
    for column, value_of in told.items():
        unit, says = unit_of(column), False
        for line, (cells, row) in enumerate(zip(found, rows, strict=True), start=2):
            cell, value = cells[column], value_of(row)
            where = f"line {line}, {column} = {cell!r}: expected {value!r} SI in units of {unit:g}"
            if isinstance(value, str):
                assert cell == value, where
                says = says or bool(cell)
            elif value is None or not math.isfinite(value):
                assert cell == "", where
            else:
                # half of the cell's last digit, and what a double of the value rounds to
                size = abs(value / unit)
                assert abs(float(cell) - value / unit) <= 0.501 * last_digit(cell) + 1e-11 * size, where
                says = says or size >= last_digit(cell)
        assert says != (column in silent), f"{column}: {'says' if says else 'no cell says'} something"
