"""Runs of a journal as tables: CSV, and FITS binary tables like a telescope's samplers.

One file per quantity: shots, weather, postures, commands, happenings, solutions, coordinates. Columns are defined once:
CSV has the unit in the name, FITS in TUNIT. Text in FITS is ASCII, other characters are escaped.
"""

import csv
import hashlib
import io
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np

from catseye.aliases import Progress
from catseye.constants import DEGREE, MILLIMETRE, ZERO_CELSIUS_K
from catseye.coordinator.journal.check import ChainReport
from catseye.coordinator.journal.entries import Entry, EpochSolution
from catseye.coordinator.journal.reader import JournalReader, Kind
from catseye.errors import InputError
from catseye.gateways.journal.chain import chain_object
from catseye.gateways.writers.cells import harmless
from catseye.gateways.writers.objects import json_page, plain
from catseye.gateways.writers.output import PROVENANCE, atomic_directory
from catseye.gateways.writers.written import origin
from catseye.ranger.line import stamp_text
from catseye.records.files.verdicts import EXPORT
from catseye.records.night.live import TICKS_PER_DAY

FORMAT = EXPORT
Form = Literal["csv", "fits"]
Cells = tuple[Any, ...]


@dataclass(frozen=True)
class TableColumn:
    """Column of a table.

    name      name in CSV, with the unit at its end
    fits      name in FITS
    unit      unit in FITS; "" for none
    kind      "f" double, "i" integer, "s" text
    factor, shift   FITS value = factor × CSV value + shift
    """

    name: str
    fits: str
    kind: Literal["f", "i", "s"] = "f"
    unit: str = ""
    factor: float = 1.0
    shift: float = 0.0


RUN = (TableColumn("run", "RUN", "i"), TableColumn("seq", "SEQ", "i"), TableColumn("mjd_utc", "DMJD", "s", "d"))


@dataclass(frozen=True)
class ExportTable:
    """Quantity: its source, its columns after run, seq and time, and the rows of one entry."""

    kind: Kind
    fields: tuple[TableColumn, ...]
    rows: Callable[[Any], Iterable[Cells]]


def _shot(entry: Any) -> Iterable[Cells]:
    shot = entry.shot
    fields = (shot.number, shot.ranger, shot.target, shot.cycles, shot.samples_per_cycle, shot.if_hz)
    lengths = (entry.range_, entry.u_range / MILLIMETRE, entry.misfit / MILLIMETRE)
    yield (*fields, shot.amplitude, shot.phase, entry.status, entry.text, *lengths)


def _solution(entry: EpochSolution) -> Iterable[Cells]:
    answer = entry.answer
    numbers = (answer.get("variance_factor"), answer.get("degrees_of_freedom"), answer.get("refractivity_ppm"))
    pose = answer.get("pose")
    yield (
        answer.get("number") or 0,
        *(float("nan") if number is None else number for number in numbers),
        len(answer.get("names") or ()),
        "" if pose is None else json.dumps(pose),
    )


def _coordinates(entry: EpochSolution) -> Iterable[Cells]:
    names, x = entry.answer.get("names"), entry.answer.get("x")
    if not isinstance(names, list) or not isinstance(x, list) or len(names) != len(x):
        return
    matrix = entry.covariance
    complete = matrix is not None and matrix.shape == (3 * len(names),) * 2
    for row, name in enumerate(names):
        at = slice(3 * row, 3 * row + 3)
        c = (matrix[at, at] if complete and matrix is not None else np.full((3, 3), np.nan)) / MILLIMETRE**2
        place = (float("nan") if value is None else value for value in x[row])
        yield (name, *place, *np.sqrt(np.diag(c)).tolist(), *c[(0, 0, 1), (1, 2, 2)].tolist())


TABLES: dict[str, ExportTable] = {
    "shots": ExportTable(
        "shots",
        (
            TableColumn("number", "NUMBER", "i"),
            TableColumn("ranger", "RANGER", "s"),
            TableColumn("target", "TARGET", "s"),
            TableColumn("cycles", "CYCLES", "i"),
            TableColumn("samples_per_cycle", "SAMPLES", "i"),
            TableColumn("if_hz", "IFFREQ", "i", "Hz"),
            TableColumn("amplitude_v", "AMPLITUDE", "f", "V"),
            TableColumn("phase_rad", "PHASE", "f", "rad"),
            TableColumn("status", "STATUS", "s"),
            TableColumn("text", "TEXT", "s"),
            TableColumn("range_m", "RANGE", "f", "m"),
            TableColumn("u_range_mm", "U_RANGE", "f", "mm"),
            TableColumn("misfit_mm", "MISFIT", "f", "mm"),
        ),
        _shot,
    ),
    "weather": ExportTable(
        "weather",
        (
            TableColumn("station", "STATION", "s"),
            TableColumn("temperature_c", "TEMPERATURE", "f", "K", shift=ZERO_CELSIUS_K),  # FITS has no degree Celsius
            TableColumn("pressure_hpa", "PRESSURE", "f", "hPa"),
            TableColumn("humidity_percent", "HUMIDITY", "f", factor=0.01),
        ),
        lambda read: [(read.station, read.temperature_c, read.pressure_hpa, read.humidity_percent)],
    ),
    "postures": ExportTable(
        "postures",
        (
            TableColumn("azimuth_deg", "AZIMUTH", "f", "deg"),
            TableColumn("elevation_deg", "ELEVATION", "f", "deg"),
            TableColumn("azimuth_rate_deg_s", "AZRATE", "f", "deg / s"),
            TableColumn("elevation_rate_deg_s", "ELRATE", "f", "deg / s"),
        ),
        lambda read: [
            tuple(v / DEGREE for v in (read.azimuth, read.elevation, read.azimuth_rate, read.elevation_rate))
        ],
    ),
    "commands": ExportTable(
        "commands",
        (
            TableColumn("ranger", "RANGER", "s"),
            TableColumn("tid", "TID", "i"),
            TableColumn("line", "LINE", "s"),
            TableColumn("reply", "REPLY", "s"),
            TableColumn("ok", "OK", "s"),
        ),
        lambda sent: [(sent.ranger, sent.tid, sent.line, sent.reply, "" if sent.ok is None else str(int(sent.ok)))],
    ),
    "happenings": ExportTable(
        "happenings",
        tuple(TableColumn(name, name.upper(), "s") for name in ("severity", "who", "kind", "text", "details")),
        lambda what: [
            (what.severity, what.who, what.kind, what.text, json.dumps(what.details) if what.details else "")
        ],
    ),
    "solutions": ExportTable(
        "solutions",
        (
            TableColumn("number", "NUMBER", "i"),
            TableColumn("variance_factor", "VARFACTOR"),
            TableColumn("degrees_of_freedom", "FREEDOM"),
            TableColumn("refractivity_ppm", "REFRACTIVITY", factor=1e-6),
            TableColumn("points", "POINTS", "i"),
            TableColumn("pose", "POSE", "s"),
        ),
        _solution,
    ),
    "coordinates": ExportTable(
        "solutions",
        (
            TableColumn("point", "POINT", "s"),
            *(TableColumn(f"{axis}_m", axis.upper(), "f", "m") for axis in "xyz"),
            *(TableColumn(f"u_{axis}_mm", f"U_{axis.upper()}", "f", "mm") for axis in "xyz"),
            *(TableColumn(f"cov_{pair}_mm2", f"COV_{pair.upper()}", "f", "mm2") for pair in ("xy", "xz", "yz")),
        ),
        _coordinates,
    ),
}


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
                counts[name] = writer(directory / f"{name}.{form}", name, table, rows)
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
) -> Iterator[Cells]:
    """Rows of a quantity: run, seq, time stamp with eight decimals, then its columns."""
    for run in runs:
        for seq, entry in reader.events(run, kinds=[table.kind], buffers=False):
            ticks = ticks_of(entry)
            if span is None or span[0] <= ticks < span[1]:
                for row in table.rows(entry):
                    yield run, seq, stamp_text(ticks), *row


def ticks_of(entry: Entry) -> int:
    """Time of an entry, ticks."""
    return entry.shot.ticks if hasattr(entry, "shot") else entry.ticks


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


def _csv(path: Path, name: str, table: ExportTable, rows: Iterable[Cells]) -> int:
    """Write numbers as Python's repr, which is exact; empty cells where missing.

    Text that a spreadsheet would evaluate as a formula gets a leading apostrophe.
    """
    count = 0
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([field.name for field in RUN + table.fields])
        for row in rows:
            writer.writerow([_csv_cell(cell) for cell in row])
            count += 1
    return count


def _csv_cell(cell: Any) -> Any:
    if isinstance(cell, str):
        return harmless(cell)
    return "" if isinstance(cell, float) and cell != cell else cell


def _fits(path: Path, name: str, table: ExportTable, rows: Iterable[Cells]) -> int:
    """Write one binary table; times are doubles (0.6 us) in DMJD and exact in TICKS."""
    from astropy.io import fits

    columns = list(zip(*rows, strict=True)) or [() for _ in RUN + table.fields]
    fits_columns = []
    for field, cells in zip(RUN + table.fields, columns, strict=True):
        if field.name == "mjd_utc":
            ticks = np.array([int(cell.replace(".", "")) for cell in cells], dtype=np.int64)
            fits_columns.append(fits.Column("DMJD", "D", unit="d", array=np.array(cells, dtype=np.float64)))
            fits_columns.append(fits.Column("TICKS", "K", array=ticks))
        elif field.kind == "s":
            text = np.array([str(cell).encode("ascii", "backslashreplace") for cell in cells] or [b""])
            width = max(1, text.dtype.itemsize)
            fits_columns.append(fits.Column(field.fits, f"{width}A", array=text[: len(cells)]))
        elif field.kind == "i":
            fits_columns.append(
                fits.Column(field.fits, "K", unit=field.unit or None, array=np.array(cells, dtype=np.int64))
            )
        else:
            values = np.array(cells, dtype=np.float64) * field.factor + field.shift
            fits_columns.append(fits.Column(field.fits, "D", unit=field.unit or None, array=values))
    page = fits.BinTableHDU.from_columns(fits_columns, name=name.upper())
    page.header["TIMESYS"] = ("UTC", "time scale of DMJD")
    page.header["TICKDAY"] = (TICKS_PER_DAY, "TICKS in a day, since MJD 0")
    page.header["ORIGIN"] = "catseye"
    stream = io.BytesIO()
    fits.HDUList([fits.PrimaryHDU(), page]).writeto(stream, checksum=True)
    path.write_bytes(stream.getvalue())
    return len(columns[0])
