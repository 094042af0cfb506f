"""The command of the notes' calibration reports, filled or blank."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.terminal import say, wrapped
from catseye.cli.vocabularies import REPORT_KINDS, one_of
from catseye.errors import InputError

if TYPE_CHECKING:
    from catseye.gateways.calibrations.field_report_fields import Report


@app.command(
    epilog="\b\nExample: catseye certificate monument examples/monuments/ZY3.toml --out zy3.html\n"
    "For the field book: catseye certificate mirror --blank --out blank.html"
)
def certificate(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            callback=one_of(REPORT_KINDS),
            help=f"What the report is of: {REPORT_KINDS.replace('|', ' or ')}.",
        ),
    ],
    record: Annotated[
        Path | None, typer.Argument(metavar="[RECORD.toml]", help="Record that fills it; blank without one.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="PAGE.html", help="Page to write: new, or an earlier one. Needed unless --json."),
    ] = None,
    blank: Annotated[bool, typer.Option("--blank", help="A blank form for the field book.")] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The calibration report of a monument or a mirror, as a page to print and sign."""
    if blank and record is not None:
        raise typer.BadParameter("takes no RECORD.", param_hint="'--blank'")
    if out is None and not json:
        raise typer.BadParameter("is needed unless --json is given.", param_hint="'--out'")
    from catseye.gateways.calibrations.field_report_fields import blank_report, read_report, report_object

    report = blank_report(kind) if record is None else read_report(kind, record)
    if out is not None:
        _write(report, out, record)
    if json:
        from catseye.gateways.writers.objects import json_line

        say(json_line(report_object(report, None if out is None else str(out))))
    elif not quiet:
        _tell(report, out)


def _write(report: "Report", out: Path, record: Path | None) -> None:
    """The page, whole or not at all."""
    from datetime import UTC, datetime

    from catseye.gateways.calibrations.field_report import field_report, mark
    from catseye.gateways.writers.output import atomic_file, refuse_suffix

    if record is not None and out.resolve() == record.resolve():
        raise InputError(f"--out {out}: is the record that fills the page (expected another name)")
    refuse_suffix(out, "--out")
    with atomic_file(out, "--out", mark(report.kind)) as pieces:
        pieces.append(field_report(report, datetime.now(UTC)))


def _tell(report: "Report", out: Path | None) -> None:
    from catseye.gateways.calibrations.field_report_fields import FORMS

    number = report.fields[0].value
    say(wrapped("Report", FORMS[report.kind].title + (f", {number}" if number else ", blank")))
    if report.missing:
        names = ", ".join(entry.key for entry in report.missing)
        say(wrapped("Left blank", f"{len(report.missing)} of {len(report.fields)}, not in {report.file}: {names}"))
    say(wrapped("Page", str(out)))
