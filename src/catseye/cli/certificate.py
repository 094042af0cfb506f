"""The command of the notes' calibration reports, filled or blank."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Certificate, Job, Json, Laboratory, Quiet, app
from catseye.cli.results import tell
from catseye.cli.vocabularies import REPORT_KINDS, one_of


@app.command(
    epilog="\b\nExample: catseye certificate monument examples/monuments/ZY3.toml --out zy3.html\n"
    "For the field book: catseye certificate mirror --blank --out blank.html"
)
def certificate(  # noqa: PLR0913 - its options are its command line
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            callback=one_of(REPORT_KINDS),
            help=f"Subject of the report: {REPORT_KINDS.replace('|', ' or ')}.",
        ),
    ],
    record: Annotated[
        Path | None, typer.Argument(metavar="[RECORD.toml]", help="Record that fills it; blank without one.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="PAGE.html", help="Form of the notes to write: new, or an earlier one."),
    ] = None,
    certificate: Certificate = None,
    blank: Annotated[bool, typer.Option("--blank", help="A blank form for the field book.")] = False,
    laboratory: Laboratory = None,
    job: Job = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Calibration report of a monument or a mirror, to print and sign."""
    if out is None and certificate is None and not json:
        raise typer.BadParameter("is needed unless --certificate or --json is given.", param_hint="'--out'")
    from catseye.api.laboratory import certificate as report_of

    result = report_of(kind, record, blank=blank, laboratory=laboratory, job=job)
    result = result.save_page(out, certificate)
    tell(result, json=json, quiet=quiet, written=[("Page", out), ("Certificate", certificate)])
