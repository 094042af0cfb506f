"""Tables of readings and their sheets, made in memory for the tests of lengths."""

from datetime import date

import numpy as np

from catseye.records.files.readings import SheetReadings

WHO = {
    "instrument": "G7",
    "serial": 7,
    "measured_on": date(2026, 3, 1),
    "valid_until": date(2027, 3, 1),
    "by": "A. Smith",
    "report": "book 4, p. 91",
}


def readings(sheet, kind, *, numbers=None, words=None, left_out=None, **keys):
    """Readings of a kind, as `read_readings` would give them."""
    numbers = {name: np.asarray(values, dtype=float) for name, values in (numbers or {}).items()}
    words = {name: tuple(values) for name, values in (words or {}).items()}
    m = len(next(iter({**numbers, **words}.values())))
    return SheetReadings(
        file="readings.csv",
        sheet=sheet(kind=kind, **WHO, **keys),
        sheet_file="readings.toml",
        numbers=numbers,
        words=words,
        where=tuple(f"line {k + 2}" for k in range(m)),
        left_out=left_out or ("",) * m,
    )
