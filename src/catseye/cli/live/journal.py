"""The commands that look after a journal: whether it is as it was written, and a copy of it."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.live.replay import JournalArgument
from catseye.cli.results import tell
from catseye.cli.terminal import ProgressLine

journal = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Look after a journal: check it, copy it.",
    epilog="\b\nExample: catseye journal check night.db",
)
app.add_typer(journal, name="journal")


@journal.command(
    epilog="\b\nExample: catseye journal check night.db --head 8123:5f0c3b1e9a7d2c44\n"
    "Heads are in the coordinator's log, at each epoch and at the end"
)
def check(
    journal: JournalArgument,
    run: Annotated[
        str | None,
        typer.Option("--run", metavar="RUN", help="Number, or the beginning of its uuid.  [default: all runs]"),
    ] = None,
    head: Annotated[
        list[str] | None,
        typer.Option("--head", metavar="EVENT:HASH", help="Head of the run from the coordinator's log; may repeat."),
    ] = None,
    against: Annotated[
        str | None,
        typer.Option("--against", metavar="JOURNAL", help="Copy to compare, up to where its history differs."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Check each event against the chain of hashes: changed, missing, inserted, rewritten, and from where on."""
    from catseye.api.journal import check_journal

    progress = ProgressLine(quiet)
    try:
        result = check_journal(journal, run=run, head=head or (), against=against, progress=progress)
    finally:
        progress.clear()
    tell(result, json=json, quiet=quiet)
    if not result.unaltered:
        raise SystemExit(1)


@journal.command(epilog="\b\nExample: catseye journal backup night.db /backup/night.db\nWhile it is written, too")
def backup(
    journal: JournalArgument,
    copy: Annotated[Path, typer.Argument(metavar="COPY", help="A new file.")],
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Copy a journal, also one that is being written, whole or not at all; the copy is checked."""
    from catseye.api.journal import backup_journal

    progress = ProgressLine(quiet)
    try:
        result = backup_journal(journal, copy, progress=progress)
    finally:
        progress.clear()
    tell(result, json=json, quiet=quiet)
    if result.verdict.word == "failed":
        raise SystemExit(1)
