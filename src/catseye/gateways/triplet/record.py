"""Record TRnn.toml of a unit on the telescope, with its sheet's results."""

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from catseye.errors import InputError
from catseye.gateways.writers.output import atomic_file
from catseye.records.files.reading import read_record, record_of_text
from catseye.records.files.toml_edit import edited_toml
from catseye.records.site.triplet import TripletRecord
from catseye.reduction.triplet.installed import laboratory_values, refuse_foreign_sheet, replacing_values
from catseye.reduction.triplet.result import TripletReduction

MARK = "h_corr_mm"  # identifies the record of a triplet, which may be replaced


def record_file(where: Path, reduction: TripletReduction) -> Path:
    """File of a unit's record.

    where       the file, or a directory, in which it has the unit's name
    reduction   of the sheet

    Raises InputError for a file that is no TOML.
    """
    name = f"{reduction.measurement.triplet}.toml"
    if where.is_dir():
        return where / name
    if where.suffix != ".toml":
        raise InputError(f"{where}: is neither a directory nor a .toml file (expected {name} or its directory)")
    return where


def record_text(path: Path, reduction: TripletReduction, *, sheet: str, digest: str, replaces: Path | None) -> str:
    """Text of a unit's record with the results of its sheet.

    path        of the record: read where nothing is replaced
    reduction   of the sheet
    sheet       name of the sheet, digest its SHA-256
    replaces    record of the unit whose place it takes; None: the record at `path` gets the heights alone

    Raises InputError for a unit not accepted, a missing record, one of another unit or of other glass.
    """
    values = laboratory_values(reduction, sheet, digest)
    base = path if replaces is None else replaces
    if not base.is_file():
        raise InputError(
            f"{base}: does not exist (expected the record of {reduction.measurement.triplet}, or that of the "
            "unit whose place it takes: --replaces)"
        )
    record = read_record(base, TripletRecord)
    if replaces is None:
        refuse_foreign_sheet(reduction, record, str(path))
    else:
        values = {**replacing_values(reduction, record), **values}
    text = edited_toml(base.read_text(encoding="utf-8"), values, str(base))
    record_of_text(text, str(path), TripletRecord)
    return text


def write_records(
    where: Path, units: Mapping[Path, TripletReduction], hashes: Mapping[Path, str], *, replaces: Path | None
) -> tuple[Path, ...]:
    """Write the records of units, all or none; their files in the sheets' order.

    where      a directory, or the file of a single record
    units      calibrations by the file of their sheet
    hashes     SHA-256 of each sheet
    replaces   record of the unit whose place a single one takes

    Raises InputError for several sheets in one file, or that replace one unit, and as `record_text`.
    """
    if len(units) > 1 and (replaces is not None or not where.is_dir()):
        expected = "a single sheet" if replaces is not None else "an existing directory"
        raise InputError(f"{where}: {len(units)} sheets were read (expected {expected})")
    texts: dict[Path, str] = {}
    for sheet, reduction in units.items():
        path = record_file(where, reduction)
        if path in texts:
            raise InputError(f"{path}: two sheets are of {reduction.measurement.triplet} (expected one for a record)")
        texts[path] = record_text(path, reduction, sheet=sheet.name, digest=hashes[sheet], replaces=replaces)
    with ExitStack() as files:
        for path, text in texts.items():
            files.enter_context(atomic_file(path, "record", MARK)).append(text)
    return tuple(texts)
