"""The commands of calibrations from tables of readings."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Certificate, Job, Json, Laboratory, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import say, wrapped
from catseye.cli.vocabularies import CALIBRATION_KINDS, one_of


@app.command(
    epilog="\b\nExample: catseye calibrate linearity examples/calibrations/linearity.csv --certificate zp103.html\n"
    "Example: catseye calibrate mounting-plate --template plate.csv\n"
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
    readings: Annotated[
        Path | None, typer.Argument(metavar="READINGS.csv", help="Table of readings; none with --template.")
    ] = None,
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
    template: Annotated[
        Path | None,
        typer.Option("--template", metavar="FILE.csv", help="Table to fill in, new, and its sheet FILE.toml."),
    ] = None,
    certificate: Certificate = None,
    laboratory: Laboratory = None,
    job: Job = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Calibration from a table of readings: record, tests and certificate."""
    if (readings is None) == (template is None):
        raise typer.BadParameter("is needed, or --template instead.", param_hint="'READINGS.csv'")
    if readings is None or template is not None:
        _write_template(kind, template, sheet, write, certificate, laboratory, job, quiet=quiet or json)
        return
    from catseye.api.laboratory import calibrate as calibrated
    from catseye.api.result import require_writable

    read = (readings, sheet or readings.with_suffix(".toml"), laboratory, job)
    require_writable(None, *read, record=write, certificate=certificate)
    result = calibrated(kind, readings, sheet, reject=reject, laboratory=laboratory, job=job)
    result.save_pages(record=write, certificate=certificate)
    written = [("Record", write), ("Certificate", certificate)]
    tell(result, json=json, quiet=quiet, strict=strict, written=written)


def _write_template(kind: str, template: Path | None, *others: Path | None, quiet: bool) -> None:
    """Write the template of a kind, for which there is nothing else to read or write."""
    if any(other is not None for other in others):
        raise typer.BadParameter("is alone with KIND.", param_hint="'--template'")
    from catseye.api.laboratory import save_calibration_template

    table, sheet = save_calibration_template(kind, str(template))
    if not quiet:
        say(wrapped("Written to", f"{table}, {sheet}: fill in both, then catseye calibrate {kind} {table}"))
