"""Type check of stored cells.

SQLite silently keeps bytes in a column of text.
"""

import json
from collections.abc import Sequence
from functools import cache

import sqlalchemy

from catseye.coordinator.journal.tables import JournalTable
from catseye.errors import InputError

WORDS = {str: "text", bytes: "bytes", int: "a whole number", float: "a number", bool: "yes or no"}
REMEDY = "the journal is damaged; restore it from a copy"


@cache
def cell_kinds(table: JournalTable) -> tuple[tuple[type, ...], ...]:
    """Python types allowed in each column; a float column allows int, too."""
    kinds = []
    for column in table.columns:
        kind = column.type.python_type
        wider = (int, float) if kind is float else (int,) if kind is bool else (kind,)
        kinds.append((*wider, type(None)) if column.nullable else wider)
    return tuple(kinds)


def check_cells(table: JournalTable, row: "sqlalchemy.Row[tuple[object, ...]]", place: str) -> None:
    """Raise InputError for the first cell of a wrong type.

    place   for the message: journal, run and event
    """
    kinds = cell_kinds(table)
    if all(map(isinstance, row, kinds)):
        return
    at = next(k for k, (cell, kind) in enumerate(zip(row, kinds, strict=True)) if not isinstance(cell, kind))
    column = table.columns.values()[at]
    expected = WORDS[column.type.python_type]
    raise damaged(
        f"{place}: column {column.name!r} of {table.name!r}", f"{_abbreviated(row[at])} (expected {expected})"
    )


def json_object(text: str):  # the caller knows the types of its values
    """JSON object of a cell.

    Raises ValueError: anything else.
    """
    content = json.loads(text)
    if not isinstance(content, dict):
        raise ValueError("no JSON object")
    return content


def damaged(place: str, what: str) -> InputError:
    """Error for a journal with content that was never written."""
    return InputError(f"{place} contains {what}: {REMEDY}")


def _abbreviated(cell: object) -> str:
    if isinstance(cell, Sequence) and len(cell) > 12:
        return f"{cell[:12]!r}..."
    return repr(cell)
