"""The command of triplet units measured in the laboratory."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from catseye.cli.commands import Certificate, Job, Json, Laboratory, Quiet, app
from catseye.cli.networks import Out
from catseye.cli.results import Strict, judge, tell
from catseye.cli.terminal import ProgressLine, say, wrapped

if TYPE_CHECKING:
    from catseye.api.laboratory import TripletsResult


@app.command(
    epilog="\b\nExample: catseye triplet examples/triplets/TR99.toml\n"
    "         catseye triplet examples/triplets/*.toml --out triplet-sheets\n"
    "         catseye triplet triplets/TR01.toml --write TR01.toml --replaces night-01/triplets/TR01.toml\n"
    "         catseye triplet --blank sheet.html"
)
def triplet(  # noqa: PLR0913 - its options are its command line
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="FILE.toml ...", help="Sheets of measured units: catseye help formats/triplet."),
    ] = None,
    blank: Annotated[
        Path | None, typer.Option("--blank", metavar="SHEET.html", help="Blank form to write, to print and fill in.")
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option(
            "--write",
            metavar="TRnn.toml|DIR",
            help="Record of the site to get H_corr, L_MPBC, their u and provenance; other keys stay.",
        ),
    ] = None,
    replaces: Annotated[
        Path | None,
        typer.Option(
            "--replaces",
            metavar="TRnn.toml",
            help="Record of the unit whose place it takes: --write writes a complete record.",
        ),
    ] = None,
    certificate: Certificate = None,
    laboratory: Laboratory = None,
    job: Job = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Triplet units from their laboratory sheets: H_corr with uncertainty, accepted or not."""
    if not files and blank is None:
        raise typer.BadParameter("at least one is needed, or --blank.", param_hint="'FILE.toml ...'")
    if not files and (out is not None or json or certificate is not None or write is not None):
        raise typer.BadParameter(
            "are needed with --out, --write, --certificate and --json.", param_hint="'FILE.toml ...'"
        )
    if replaces is not None and write is None:
        raise typer.BadParameter("is for --write.", param_hint="'--replaces'")
    from catseye.api.laboratory import save_triplet_form

    issue = _Issue(certificate, laboratory, job, replaces, write)
    result, records = _reduced(files, out, issue, quiet=quiet) if files else (None, ())
    if blank is not None:
        save_triplet_form(blank)
    blanks = None if blank is None else f"{blank}: the blank form"
    if result is None:
        if not quiet:
            say(wrapped("Written to", str(blanks)))
        return
    files_of = None if out is None else f"{out}/: NAME.txt, NAME.html, NAME.json for each sheet, triplets.csv"
    written = [("Written to", files_of), ("Certificate", certificate), ("Written to", blanks)]
    written += [("Record", str(record)) for record in records]
    if len(result.units) == 1 and not json and not quiet:
        say(result.sheet())
        for title, text in written:
            if text is not None:
                say(wrapped(title, str(text)))
        judge(result.verdict, strict=strict)
        return
    tell(result, json=json, quiet=quiet, strict=strict, written=written)


class _Issue(NamedTuple):
    """Certificate to write, its laboratory and its job; record of the replaced unit, and record to write."""

    certificate: Path | None
    laboratory: Path | None
    job: Path | None
    replaces: Path | None
    write: Path | None


def _reduced(
    files: list[Path], out: Path | None, issue: _Issue, *, quiet: bool
) -> "tuple[TripletsResult, tuple[Path, ...]]":
    """Sheets reduced, in order, and records written; with an `out`, written whole or not, after the records."""
    from catseye.api.laboratory import triplet as reduced
    from catseye.api.result import require_writable, save

    require_writable(out, *files, issue.laboratory, issue.job, certificate=issue.certificate)
    progress = ProgressLine(quiet)
    try:
        result = reduced(*files, laboratory=issue.laboratory, job=issue.job, replaces=issue.replaces, progress=progress)
        records = () if issue.write is None else result.save_records(issue.write)
        if out is not None:
            save(result, out, progress=progress, certificate=issue.certificate)
        else:
            result.save_pages(certificate=issue.certificate)
    finally:
        progress.clear()
    return result, records
