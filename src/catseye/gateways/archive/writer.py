"""A night into an archive: its files, and then its entry in the index."""

from pathlib import Path
from typing import Any

from catseye.gateways.archive.content import NightContent
from catseye.gateways.archive.files import write_file
from catseye.gateways.archive.tables import write_table
from catseye.gateways.writers.objects import versions
from catseye.records.archive.index import ArchivedFile, ArchivedNight, entry_text, night_path
from catseye.records.archive.layout import TABLES, year_folder, year_of


def write_night(directory: Path, content: NightContent) -> ArchivedNight:
    """Write a night's files and, last, its entry in the index.

    Raises InputError: a full disk, an unknown table or column.
    """
    year = year_of(content.first)
    files = [
        _table(directory, year, content.night, kind, content.tables[kind]) for kind in TABLES if kind in content.tables
    ]
    entry = ArchivedNight(
        night=content.night,
        year=year,
        first=content.first,
        last=content.last,
        source=content.source,
        inputs_sha256=content.inputs_sha256,
        inputs=(),
        header="",
        versions=versions(),
        provenance=content.provenance,
        files=tuple(files),
    )
    write_entry(directory, entry)
    return entry


def write_entry(directory: Path, entry: ArchivedNight) -> None:
    """Write a night's entry in the index."""
    text = entry_text(entry)
    write_file(directory, night_path(entry.night), lambda path: path.write_text(text, encoding="utf-8"))


def _table(directory: Path, year: int, night: str, kind: str, columns: Any) -> ArchivedFile:
    rows = len(next(iter(columns.values()), ()))
    path = year_folder(kind, year) / f"{night}.parquet"
    return write_file(directory, path, lambda fresh: write_table(fresh, kind, columns), kind=kind, rows=rows)
