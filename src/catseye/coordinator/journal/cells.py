"""Check that a stored cell is what its column holds: SQLite keeps bytes in a column of text without a word."""

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
    """Python's types that each column may hold; a number's column takes a whole number, too."""
    kinds = []
    for column in table.columns:
        kind = column.type.python_type
        wider = (int, float) if kind is float else (int,) if kind is bool else (kind,)
        kinds.append((*wider, type(None)) if column.nullable else wider)
    return tuple(kinds)


def check_cells(table: JournalTable, row: "sqlalchemy.Row[tuple[object, ...]]", place: str) -> None:
    """Raise InputError naming the first cell of a whole row that its column cannot hold.

    place   for the refusal: journal, run and event
    """
    kinds = cell_kinds(table)
    if all(map(isinstance, row, kinds)):
        return
    at = next(k for k, (cell, kind) in enumerate(zip(row, kinds, strict=True)) if not isinstance(cell, kind))
    column = table.columns.values()[at]
    expected = WORDS[column.type.python_type]
    raise damaged(f"{place}: column {column.name!r} of {table.name!r}", f"{_shown(row[at])} (expected {expected})")


def json_object(text: str):  # what a key holds is the caller's to know
    """The JSON object of a cell. Raises ValueError: it holds something else."""
    found = json.loads(text)
    if not isinstance(found, dict):
        raise ValueError("no JSON object")
    return found


def damaged(place: str, what: str) -> InputError:
    """The refusal of a journal that holds what was never written."""
    return InputError(f"{place} holds {what}: {REMEDY}")


def _shown(cell: object) -> str:
    if isinstance(cell, Sequence) and len(cell) > 12:
        return f"{cell[:12]!r}..."
    return repr(cell)
