"""The command that takes a journal to others' formats."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple, cast

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.live.replay import JournalArgument, RunName
from catseye.cli.option_groups import grouped
from catseye.cli.results import tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import EXPORT_FORMATS, one_of

if TYPE_CHECKING:
    from catseye.api.journal import ExportFormat


class ExportedPart(NamedTuple):
    """Selection of a journal; each field is the option of its name."""

    run: RunName = None
    since: Annotated[
        str | None, typer.Option("--from", metavar="TIME", help="First time, UTC or MJD.  [default: the start]")
    ] = None
    until: Annotated[
        str | None,
        typer.Option("--until", metavar="TIME", help="First excluded time, UTC or MJD.  [default: the end]"),
    ] = None


@app.command(
    epilog="\b\nExample: catseye export night.db --to campaign --out night\n"
    "The campaign is for: catseye reduce night --out report"
)
@grouped
def export(
    *,
    journal: JournalArgument,
    to: Annotated[
        str,
        typer.Option("--to", metavar=EXPORT_FORMATS, callback=one_of(EXPORT_FORMATS), help="Tables, or a campaign."),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ],
    which: ExportedPart,
    damaged: Annotated[
        bool,
        typer.Option("--damaged", help="Export a journal that fails verification, too, without its altered entries."),
    ] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A run as tables (CSV, FITS), or as a campaign that `catseye reduce` reads."""
    from catseye.api.journal import export as exported

    progress = ProgressLine(quiet)
    try:
        form = cast("ExportFormat", to)
        result = exported(journal, out, to=form, damaged=damaged, progress=progress, **which._asdict())
    finally:
        progress.clear()
    tell(result, json=json, quiet=quiet)
