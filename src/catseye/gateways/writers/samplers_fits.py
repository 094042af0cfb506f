"""FITS binary tables in the style of a telescope's samplers: one table per quantity, time as MJD.

Each table is one extension, named after its quantity. Its first column is MJD (unit d, UTC, middle of the measurement)
where the quantity has a time; the others have their unit in TUNITn and a description in TCOMMn. The header holds
TIMESYS, MJDREF, ORIGIN, the version of catseye, and in words the frame and the pivot of the numbers.
Doubles, integers, booleans and ASCII text are stored unchanged: they are read back bit for bit.
"""

import csv
import hashlib
import io
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import PPM
from catseye.errors import InputError
from catseye.gateways.writers.columns import Table
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.output import PROVENANCE, write_atomically
from catseye.records.files.record import EARLIEST_MJD, LATEST_MJD
from catseye.version import __version__

Source = TypeVar("Source")
MARK = "CATSEYE"  # keyword of the version; identifies a file of catseye
TIME = "MJD"
SAMPLERS = "samplers.fits"
SUM = "ones' complement sum"  # comment of both checksums
UNITS = {"m", "mm", "um", "mm2", "rad", "urad", "deg", "arcsec", "s", "Hz", "V"}  # of CSV columns that become TUNIT
NOT_ASCII = {"°": " deg", "µ": "u", "″": " arcsec", "′": " arcmin", "·": "*", "–": "-", "−": "-", "±": "+-"}
STANDARD = {"XTENSION", "BITPIX", "NAXIS", "NAXIS1", "NAXIS2", "PCOUNT", "GCOUNT", "TFIELDS", "END", "EXTNAME"}
OURS = {"TIMESYS", "MJDREF", "ORIGIN", "FRAME", "PIVOT", "REMARK", "CHECKSUM", "DATASUM", MARK}
OF_COLUMNS = ("TTYPE", "TFORM", "TUNIT", "TCOMM", "TDIM")
FORMS = {"f": ("D", np.float64), "i": ("K", np.int64), "u": ("K", np.int64), "b": ("L", np.bool_)}


@dataclass(frozen=True, eq=False)
class SamplerColumn:
    """Column of a table.

    unit      as the FITS standard writes it ("m", "rad", "mm", "deg", "arcsec", "K", "m2 / Hz"); "" for none
    values    (n, ...) numbers, booleans, or (n,) text; the row shape of an array column is written as TDIMn
    comment   short description
    """

    unit: str
    values: ArrayLike
    comment: str = ""


@dataclass(frozen=True, eq=False)
class SamplerTable:
    """Table of one quantity.

    name      extension name: capital letters, digits and _
    columns   by name: capital letters, digits and _
    mjd       (n,) d, UTC; None for a quantity without time, such as coefficients
    comment   description, one sentence
    frame     frame of the numbers, in words: "ground", "reflector frame at rest"; "" for none
    pivot     pivot of rotations, in words or numbers with their unit; "" for none
    header    additional keywords, of at most 8 characters, with numbers or text
    """

    name: str
    columns: Mapping[str, SamplerColumn]
    mjd: ArrayLike | None = None
    comment: str = ""
    frame: str = ""
    pivot: str = ""
    header: Mapping[str, str | int | float | bool] = field(default_factory=dict)


def sampler_tables(
    tables: Mapping[str, SamplerTable], *, header: Mapping[str, str | int | float | bool] | None = None
) -> bytes:
    """FITS file of the tables, verified by astropy.

    tables   in order, by extension name
    header   additional keywords of the primary header

    The same tables give the same bytes: the file holds no time of writing.

    Raises InputError for names, units, lengths or values that FITS cannot hold.

    >>> height = SamplerColumn("m", [48.26, 48.27], "elevation axis")
    >>> len(sampler_tables({"AXIS": SamplerTable("AXIS", {"Z": height}, mjd=[60000.0, 60000.5])})) % 2880
    0
    """
    from astropy.io import fits

    if not tables:
        raise InputError("a FITS file of samplers needs at least one table")
    pages = [fits.PrimaryHDU()]
    pages[0].header["ORIGIN"] = "catseye"
    pages[0].header[MARK] = (__version__, "version of catseye")
    for key, value in (header or {}).items():
        pages[0].header[key] = value
    for name, table in tables.items():
        if name != table.name:
            raise InputError(f"table {table.name!r} has the key {name!r} (expected its name)")
        pages.append(_page(table))
    stream = io.BytesIO()
    hdus = fits.HDUList(pages)
    hdus.update_extend()
    hdus.verify("exception")
    for page in pages:
        page.add_checksum(when=SUM)  # without a comment of ours, astropy's is the time of writing
    hdus.writeto(stream, output_verify="exception")
    return stream.getvalue()


def write_samplers(path: Path, tables: Mapping[str, SamplerTable], *, option: str = "--fits") -> None:
    """Write the tables to a FITS file atomically.

    path     new, or an earlier file of catseye
    tables   as for `sampler_tables`
    option   command option that named the file, for messages

    Raises InputError where a foreign file would be overwritten, nothing can be written, or FITS cannot hold a value.
    """
    mark = f"{MARK:<8}=".encode()
    write_atomically(path, sampler_tables(tables), option=option, ours=lambda content: mark in content[:2880])


def join_samplers(directory: Path, name: str, tables: Mapping[str, SamplerTable]) -> None:
    """Add the tables as a file to an output directory and to its provenance.

    directory   from `output.atomic_directory`, filled by `written.write_files`
    name        file name, such as "samplers.fits"
    tables      as for `sampler_tables`
    """
    content = sampler_tables(tables)
    (directory / name).write_bytes(content)
    place = directory / PROVENANCE
    provenance = json.loads(place.read_text(encoding="utf-8"))
    provenance["outputs"] = {**provenance["outputs"], name: hashlib.sha256(content).hexdigest()}
    place.write_bytes(json_page(provenance).encode("utf-8"))


def join_tables(
    directory: Path,
    written: Iterable[Table[Any]],
    *,
    frame: str = "",
    pivot: str = "",
    tables: Mapping[str, SamplerTable] | None = None,
) -> None:
    """Add all CSV tables of an output directory as samplers.fits, with the same numbers.

    directory      as for `join_samplers`
    written        definitions of the tables
    frame, pivot   of the tables, as in `SamplerTable`
    tables         additional tables, written first
    """
    joined = dict(tables or {})
    units = {column.name: column.unit for table in written for column in table.columns}
    for path in sorted(directory.glob("*.csv")):
        name = path.stem.upper().replace("-", "_")
        joined[name] = _of_csv(name, path.read_text(encoding="utf-8"), units, (frame, pivot))
    join_samplers(directory, SAMPLERS, joined)


def _of_csv(name: str, text: str, units: Mapping[str, str], where: tuple[str, str]) -> SamplerTable:
    """Table of a CSV: NaN for blanks, text for non-numeric columns; `where`: frame and pivot."""
    header, *rows = csv.reader(io.StringIO(text))
    columns = {}
    for k, title in enumerate(header):
        cells = [row[k] for row in rows]
        try:
            values: ArrayLike = np.array([float(cell) if cell else np.nan for cell in cells])
            unit = units[title] if units[title] in UNITS else ""
        except ValueError:
            values, unit = np.array([ascii_text(cell) for cell in cells]), ""
        columns[title.upper()] = SamplerColumn(unit, values)
    return SamplerTable(name, columns, comment=f"as {name.lower()}.csv", frame=where[0], pivot=where[1])


def of_table(name: str, table: Table[Source], source: Source, *, frame: str = "") -> SamplerTable:
    """Table of a command with its numbers unrounded, columns under their names without unit.

    name     of the extension
    table    definition of the columns; a column `mjd_utc` becomes MJD, ppm a fraction
    source   of the rows
    frame    as in `SamplerTable`
    """
    columns, mjd = {}, None
    for column in table.columns:
        values = column.value(source)
        if column.unit == "d":
            mjd = np.asarray(values, dtype=float)
            continue
        array = np.asarray(values)
        if array.dtype.kind == "U":
            array = np.array([ascii_text(text).rstrip() for text in array.tolist()], dtype=str)
        scale, unit = (PPM, "") if column.unit == "ppm" else (None, column.unit)
        stored = array if scale is None else array * scale
        comment = ascii_text(column.doc.replace("`", ""))
        columns[column.label.upper()] = SamplerColumn(unit if unit in UNITS else "", stored, comment)
    return SamplerTable(name, columns, mjd=mjd, comment=f"as {table.file}, unrounded", frame=frame)


def ascii_text(text: str) -> str:
    """Text with plain ASCII in place of the signs that FITS cannot hold."""
    for sign, plain in NOT_ASCII.items():
        text = text.replace(sign, plain)
    return text.encode("ascii", "replace").decode("ascii")


def read_samplers(path: Path) -> dict[str, SamplerTable]:
    """Tables of a file written by `write_samplers`, bit for bit.

    Raises InputError for a file that is missing, damaged (checksums are verified) or not catseye's.
    """
    import warnings

    from astropy.io import fits

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # astropy warns of a wrong checksum
            with fits.open(io.BytesIO(path.read_bytes()), checksum=True) as pages:
                if MARK not in pages[0].header:
                    raise InputError(f"{path}: is not a samplers file of catseye (no keyword {MARK})")
                return {page.name: _read(page) for page in pages[1:]}
    except (OSError, TypeError, ValueError, Warning) as problem:
        reason = str(getattr(problem, "strerror", None) or problem).splitlines()[0]
        raise InputError(f"{path}: cannot be read as FITS: {reason}") from problem


def _page(table: SamplerTable) -> Any:
    """One extension of the FITS file."""
    from astropy.io import fits

    columns = dict(table.columns)
    if table.mjd is not None:
        columns = {TIME: SamplerColumn("d", np.asarray(table.mjd, dtype=float), "UTC, as MJD"), **columns}
        _refuse_times(table)
    _refuse_names(table, columns)
    fields = [_column(table.name, name, column) for name, column in columns.items()]
    lengths = {name: len(np.asarray(column.values)) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"table {table.name}: columns have different lengths {lengths} (expected one length)")
    page = fits.BinTableHDU.from_columns(fields, name=table.name)
    header = page.header
    header["TIMESYS"] = ("UTC", "time scale of MJD")
    header["MJDREF"] = (0.0, "[d] zero of the column MJD")
    header["ORIGIN"] = "catseye"
    header[MARK] = (__version__, "version of catseye")
    for key, text in (("FRAME", table.frame), ("PIVOT", table.pivot)):
        if text:
            header[key] = _ascii(table.name, text)
    for key, value in table.header.items():
        header[key] = _ascii(table.name, value) if isinstance(value, str) else value
    for number, column in enumerate(columns.values(), start=1):
        if column.comment:
            header[f"TCOMM{number}"] = _ascii(table.name, column.comment)
    if table.comment:
        header["REMARK"] = _ascii(table.name, table.comment)
    return page


def _column(table: str, name: str, column: SamplerColumn) -> Any:
    """FITS column, without loss of precision."""
    from astropy.io import fits

    values = np.asarray(column.values)
    where = f"table {table}, column {name}"
    unit = _unit(where, column.unit)
    if values.dtype.kind == "U" and values.ndim == 1:
        text = [str(v) for v in values]
        if any(v != v.rstrip(" \0") for v in text):
            raise InputError(f"{where}: a text ends in a blank, which FITS would drop (expected none)")
        raw = np.array([_ascii(where, v).encode("ascii") for v in text] or [b""])[: len(text)]
        return fits.Column(name, f"{max(1, raw.dtype.itemsize)}A", unit=unit, array=raw)
    if values.ndim < 1 or values.dtype.kind not in FORMS:
        raise InputError(
            f"{where}: {values.dtype} in {values.ndim} dimensions (expected rows of numbers, booleans or text)"
        )
    letter, dtype = FORMS[values.dtype.kind]
    stored: NDArray[Any] = values.astype(dtype)
    if values.dtype.kind == "u" and np.any(stored < 0):
        raise InputError(f"{where}: holds {values.max()} (expected integers below 2^63)")
    inner = values.shape[1:]
    count = int(np.prod(inner)) if inner else 1
    if count == 0:
        raise InputError(f"{where}: its rows are empty, shape {values.shape} (expected at least one value)")
    dims = "(" + ",".join(str(n) for n in inner[::-1]) + ")" if len(inner) > 1 else None
    return fits.Column(name, f"{count if inner else ''}{letter}", unit=unit, dim=dims, array=stored)


def _unit(where: str, unit: str) -> str | None:
    """Unit as given, if the FITS standard has it."""
    if not unit:
        return None
    from astropy import units

    try:
        units.Unit(unit, format="fits", parse_strict="raise")
    except ValueError as problem:
        hint = ": FITS has no degree Celsius, use K" if unit in ("degC", "deg_C", "Celsius") else ""
        raise InputError(f"{where}: unit {unit!r} is not in the FITS standard{hint}") from problem
    return unit


def _refuse_times(table: SamplerTable) -> None:
    mjd = np.asarray(table.mjd, dtype=float)
    bad = ~((mjd >= EARLIEST_MJD) & (mjd <= LATEST_MJD))
    if mjd.ndim != 1 or bad.any():
        first = f"{mjd[bad][0]!r}" if mjd.ndim == 1 else f"shape {mjd.shape}"
        expected = f"(n,), {EARLIEST_MJD:g} to {LATEST_MJD:g} d: no Julian Date"
        raise InputError(f"table {table.name}: MJD {first} (expected {expected})")


def _refuse_names(table: SamplerTable, columns: Mapping[str, SamplerColumn]) -> None:
    """Raise InputError for names not portable in FITS or keywords that would hide the file's own."""
    for name in (table.name, *columns):
        if not name or not name.isascii() or not name.replace("_", "A").isalnum() or name != name.upper():
            raise InputError(f"table {table.name!r}: the name {name!r} (expected capital letters, digits and _)")
    if not columns:
        raise InputError(f"table {table.name}: has no column (expected at least one)")
    if TIME in table.columns and table.mjd is not None:
        raise InputError(f"table {table.name}: the column {TIME} is reserved for `mjd` (expected another name)")
    for key in table.header:
        if len(key) > 8 or key != key.upper() or key in STANDARD | OURS or key.startswith(OF_COLUMNS):
            raise InputError(
                f"table {table.name}: the keyword {key!r} (expected up to 8 capitals, none reserved by FITS)"
            )


def _ascii(where: str, text: str) -> str:
    if text.isascii() and text.isprintable():
        return text
    raise InputError(f"{where}: {text!r} is not printable ASCII, as FITS requires")


def _read(page: Any) -> SamplerTable:
    """Table as it was passed to the writer."""
    header, columns, mjd = page.header, {}, None
    for number, column in enumerate(page.columns, start=1):
        values = np.array(page.data[column.name])
        values = values.astype(values.dtype.newbyteorder("=")) if values.dtype.kind in "fi" else values
        if column.name == TIME:
            mjd = values
        else:
            columns[column.name] = SamplerColumn(column.unit or "", values, header.get(f"TCOMM{number}", ""))
    comment, frame, pivot = (str(header.get(key, "")) for key in ("REMARK", "FRAME", "PIVOT"))
    return SamplerTable(
        name=page.name, columns=columns, mjd=mjd, comment=comment, frame=frame, pivot=pivot, header=_more(header)
    )


def _more(header: Any) -> dict[str, Any]:
    """Keywords specific to the table."""
    return {key: header[key] for key in header if key not in STANDARD | OURS and not key.startswith(OF_COLUMNS)}
