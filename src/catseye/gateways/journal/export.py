"""Runs of a journal as tables: CSV, and FITS binary tables like a telescope's samplers.

One file per quantity: shots, weather, postures, commands, happenings, solutions, coordinates. Columns are defined once:
CSV has the unit in the name, FITS in TUNIT. Text in FITS is ASCII, other characters are escaped.
"""

import hashlib
import io
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any, Literal

import numpy as np

from catseye.aliases import Progress
from catseye.coordinator.journal.check import ChainReport
from catseye.coordinator.journal.reader import JournalReader
from catseye.errors import InputError
from catseye.gateways.journal.chain import chain_object
from catseye.gateways.journal.tables import TABLES, ExportColumn, ExportRow, ExportTable, ticks_of
from catseye.gateways.writers.columns import Table
from catseye.gateways.writers.objects import json_page, plain
from catseye.gateways.writers.output import PROVENANCE, atomic_directory
from catseye.gateways.writers.written import origin
from catseye.records.files.verdicts import EXPORT
from catseye.records.night.live import TICKS_PER_DAY

FORMAT = EXPORT
Form = Literal["csv", "fits"]
BATCH = 500  # rows of a batch


def export_tables(
    reader: JournalReader,
    out: Path,
    *,
    runs: Sequence[int],
    forms: Sequence[Form] = ("csv", "fits"),
    span: tuple[int, int] | None = None,
    progress: Progress | None = None,
    chains: Sequence[ChainReport] = (),
) -> dict[str, int]:
    """Write every quantity of some runs into a directory, atomically; rows by quantity.

    runs    numbers of the runs
    forms   file formats
    span    ticks, end exclusive; None for all
    chains  results of the check; altered events are left out and listed in the provenance

    Raises InputError: unknown run, nothing to write, a directory that is not catseye's.
    """
    reader.left_out = {chain.run: chain.bad for chain in chains}
    if not runs or not forms:
        raise InputError(f"{out}: no run or no form given (expected at least one of each)")
    stored = [reader.run(run) for run in runs]
    counts = dict.fromkeys(TABLES, 0)
    with atomic_directory(out, Path(reader.place)) as directory:
        for count, (name, table) in enumerate(TABLES.items()):
            if progress is not None:
                progress(f"writing {name}", count, len(TABLES))
            for form in forms:
                rows = rows_of(reader, table, runs, span=span)
                writer = _csv if form == "csv" else _fits
                counts[name] = writer(directory / f"{name}.{form}", table.table, rows)
        inputs = {f"run {run.run}: {path}": digest for run in stored for path, digest in run.hashes.items()}
        summary = {
            "runs": {str(run.run): run.uuid for run in stored},
            "span_ticks": span,
            "rows": counts,
            "chains": [chain_object(chain) for chain in chains],
        }
        seal(directory, reader, {"made_by": "catseye export", **origin(datetime.now(UTC), inputs), **summary})
    return counts


def rows_of(
    reader: JournalReader, table: ExportTable, runs: Sequence[int], *, span: tuple[int, int] | None
) -> Iterator[ExportRow]:
    """Rows of a quantity, one after the other."""
    for run in runs:
        for seq, entry in reader.events(run, kinds=[table.kind], buffers=False):
            ticks = ticks_of(entry)
            if span is None or span[0] <= ticks < span[1]:
                for part in table.parts(entry):
                    yield ExportRow(run, seq, ticks, part)


def _batches(rows: Iterator[ExportRow]) -> Iterator[list[ExportRow]]:
    """Lists of rows: what an entry holds besides is not in memory for long."""
    while batch := list(islice(rows, BATCH)):
        yield batch


def seal(directory: Path, reader: JournalReader, provenance: dict[str, Any]) -> None:
    """Write the provenance with the journal's name and hashes; a directory under its own name."""
    outputs: dict[str, Any] = {}
    for path in sorted(directory.rglob("*")):
        if path.is_file():
            top, *inner = path.relative_to(directory).parts
            with path.open("rb") as stream:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
            if inner:
                outputs.setdefault(top, {})["/".join(inner)] = digest
            else:
                outputs[top] = digest
    name = reader.place if "://" in reader.place else Path(reader.place).name
    page = json_page(plain({"format": FORMAT, "journal": name, **provenance, "outputs": outputs}))
    (directory / PROVENANCE).write_bytes(page.encode("utf-8"))


def _csv(path: Path, table: Table[Sequence[ExportRow]], rows: Iterator[ExportRow]) -> int:
    """Write numbers as Python's repr, which is exact; empty cells where missing.

    Text that a spreadsheet would evaluate as a formula gets a leading apostrophe.
    """
    count = 0

    def counted() -> Iterator[list[ExportRow]]:
        nonlocal count
        for batch in _batches(rows):
            count += len(batch)
            yield batch

    with path.open("w", encoding="utf-8", newline="") as stream:
        stream.writelines(table.stream(counted()))
    return count


def _fits(path: Path, table: Table[Sequence[ExportRow]], rows: Iterator[ExportRow]) -> int:
    """Write one binary table; times are doubles (0.6 us) in DMJD and exact in TICKS."""
    from astropy.io import fits

    columns = [column for column in table.columns if isinstance(column, ExportColumn)]
    values: dict[str, list[Any]] = {column.name: [] for column in columns}
    for batch in _batches(rows):
        for column in columns:
            values[column.name].extend(column.value(batch) or ())
    fits_columns = [field for column in columns for field in _fits_columns(column, values[column.name])]
    page = fits.BinTableHDU.from_columns(fits_columns, name=path.stem.upper())
    page.header["TIMESYS"] = ("UTC", "time scale of DMJD")
    page.header["TICKDAY"] = (TICKS_PER_DAY, "TICKS in a day, since MJD 0")
    page.header["ORIGIN"] = "catseye"
    stream = io.BytesIO()
    fits.HDUList([fits.PrimaryHDU(), page]).writeto(stream, checksum=True)
    path.write_bytes(stream.getvalue())
    return len(values["run"])


def _fits_columns(column: ExportColumn, cells: list[Any]) -> "Iterator[Any]":
    """Columns of FITS: one, of the time two."""
    from astropy.io import fits

    unit = (column.unit if column.fits_unit is None else column.fits_unit) or None
    if column.name == "mjd_utc":
        ticks = np.array([int(cell.replace(".", "")) for cell in cells], dtype=np.int64)
        yield fits.Column("DMJD", "D", unit="d", array=np.array(cells, dtype=np.float64))
        yield fits.Column("TICKS", "K", array=ticks)
    elif column.kind == "s":
        text = np.array([str(cell).encode("ascii", "backslashreplace") for cell in cells] or [b""])
        width = max(1, text.dtype.itemsize)
        yield fits.Column(column.fits, f"{width}A", array=text[: len(cells)])
    elif column.kind == "i":
        yield fits.Column(column.fits, "K", unit=unit, array=np.array(cells, dtype=np.int64))
    else:
        values = np.array(cells, dtype=np.float64) * column.factor + column.shift
        yield fits.Column(column.fits, "D", unit=unit, array=values)
