"""The commands of calibrations from tables of readings."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Certificate, Job, Json, Laboratory, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.vocabularies import CALIBRATION_KINDS, one_of


@app.command(
    epilog="\b\nExample: catseye calibrate linearity examples/calibrations/linearity.csv --certificate zp103.html\n"
    "Columns and keys of every KIND: catseye help formats/calibrations"
)
def calibrate(  # noqa: PLR0913 - its options are its command line
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            callback=one_of(CALIBRATION_KINDS),
            help=f"Kind of calibration: {CALIBRATION_KINDS.replace('|', ', ')}.",
        ),
    ],
    readings: Annotated[Path, typer.Argument(metavar="READINGS.csv", help="Table of readings.")],
    sheet: Annotated[
        Path | None,
        typer.Option("--sheet", metavar="SHEET.toml", help="Person, day, instruments; READINGS.toml if not given."),
    ] = None,
    reject: Annotated[
        bool, typer.Option("--reject", help="Reject readings that fail the tests, one at a time.")
    ] = False,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="RECORD.toml", help="Record to write: new, or an earlier one.")
    ] = None,
    certificate: Certificate = None,
    laboratory: Laboratory = None,
    job: Job = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Calibration from a table of readings: record, tests and certificate."""
    from catseye.api.laboratory import calibrate as calibrated
    from catseye.api.result import require_writable

    read = (readings, sheet or readings.with_suffix(".toml"), laboratory, job)
    require_writable(None, *read, record=write, certificate=certificate)
    result = calibrated(kind, readings, sheet, reject=reject, laboratory=laboratory, job=job)
    result.save_pages(record=write, certificate=certificate)
    written = [("Record", write), ("Certificate", certificate)]
    tell(result, json=json, quiet=quiet, strict=strict, written=written)
