"""The commands of calibrations from tables of readings."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.vocabularies import CALIBRATION_KINDS, one_of
from catseye.errors import InputError

if TYPE_CHECKING:
    from catseye.reduction.calibrations.calibration import Calibration


@app.command(
    epilog="\b\nExample: catseye calibrate linearity examples/calibrations/linearity.csv --certificate zp103.html\n"
    "Columns and keys of every KIND: docs/formats/calibrations.md"
)
def calibrate(  # noqa: PLR0913 - its options are its command line
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            callback=one_of(CALIBRATION_KINDS),
            help=f"What is calibrated: {CALIBRATION_KINDS.replace('|', ', ')}.",
        ),
    ],
    readings: Annotated[Path, typer.Argument(metavar="READINGS.csv", help="Table of readings.")],
    sheet: Annotated[
        Path | None,
        typer.Option("--sheet", metavar="SHEET.toml", help="Who, when, with what; READINGS.toml if not given."),
    ] = None,
    reject: Annotated[
        bool, typer.Option("--reject", help="Leave out readings that the tests reject, one by one.")
    ] = False,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="RECORD.toml", help="Record to write: new, or an earlier one.")
    ] = None,
    certificate: Annotated[
        Path | None,
        typer.Option("--certificate", metavar="PAGE.html", help="Page to sign: new, or an earlier one."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """A calibration from a table of readings: record with uncertainties, residuals, tests and a certificate."""
    from catseye.api.laboratory import calibrate as calibrated

    _refuse_outputs(readings, sheet, write, certificate)
    result = calibrated(kind, readings, sheet, reject=reject)
    _write(result.calibration, write, certificate)
    tell(
        result,
        json=json,
        quiet=quiet,
        strict=strict,
        written=[("Record", write), ("Certificate", certificate)],
    )


def _refuse_outputs(readings: Path, sheet: Path | None, write: Path | None, certificate: Path | None) -> None:
    """Nothing that is read may be written, and two outputs need two names."""
    inputs = [readings.resolve(), (sheet or readings.with_suffix(".toml")).resolve()]
    for option, path in (("--write", write), ("--certificate", certificate)):
        if path is not None and path.resolve() in inputs:
            raise InputError(f"{option} {path}: is an input of this calibration (expected another name)")
    if write is not None and certificate is not None and write.resolve() == certificate.resolve():
        raise InputError(f"--write {write}: is the --certificate too (expected two names)")


def _write(calibration: "Calibration", write: Path | None, certificate: Path | None) -> None:
    """Both files whole; neither is begun when one of them may not be written."""
    from contextlib import ExitStack
    from datetime import UTC, datetime

    from catseye.gateways.writers.output import atomic_file, refuse_suffix

    pages = []
    if write is not None:
        from catseye.gateways.calibrations.certificate_record import MARK, calibration_toml

        pages.append((write, "--write", MARK, calibration_toml(calibration)))
    if certificate is not None:
        from catseye.gateways.calibrations.certificate import MARK as PAGE_MARK
        from catseye.gateways.calibrations.certificate import certificate as drawn

        refuse_suffix(certificate, "--certificate")
        pages.append((certificate, "--certificate", PAGE_MARK, drawn(calibration, datetime.now(UTC))))
    with ExitStack() as files:
        for path, option, mark, text in pages:
            files.enter_context(atomic_file(path, option, mark)).append(text)
