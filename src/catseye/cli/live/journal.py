"""The commands that look after a journal: whether it is as it was written, and a copy of it."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.live.replay import JournalArgument, run_of
from catseye.cli.terminal import ProgressLine, say, wrapped

journal = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Look after a journal: check it, copy it.",
    epilog="\b\nExample: catseye journal check night.db",
)
app.add_typer(journal, name="journal")


@journal.command(
    epilog="\b\nExample: catseye journal check night.db --head 8123:5f0c3b1e9a7d2c44\n"
    "Heads stand in the coordinator's log, at each epoch and at the end"
)
def check(
    journal: JournalArgument,
    run: Annotated[
        str | None,
        typer.Option("--run", metavar="RUN", help="Number, or the beginning of its uuid.  [default: all runs]"),
    ] = None,
    head: Annotated[
        list[str] | None,
        typer.Option("--head", metavar="EVENT:HASH", help="That was told at the time, of the run (again and again)."),
    ] = None,
    against: Annotated[
        str | None, typer.Option("--against", metavar="JOURNAL", help="A copy: where the two part, if they do.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Hold each event against the chain of hashes: changed, missing, put in, another history, and from where on."""
    from catseye.coordinator.journal.verdict import chain_verdict
    from catseye.gateways.journal.chain import chain_object, chain_words
    from catseye.service.journals import checked

    progress = ProgressLine(quiet)
    try:
        reports, parting = checked(journal, run_of(run), head or (), against, progress=progress)
    finally:
        progress.clear()
    verdict = chain_verdict(reports)
    if json:
        from catseye.gateways.writers.objects import json_line

        say(json_line({"verdict": verdict.to_object(), "runs": [chain_object(r) for r in reports], "against": parting}))
    elif not quiet:
        say(wrapped("Verdict", verdict.text))
        for report in reports:
            for text in chain_words(report):
                say(wrapped(f"Run {report.run}", text))
        for each in parting:
            say(wrapped(f"Run {each['run']}", str(each["text"])))
    if verdict.word == "failed" or any(each["parts_at_event"] is not None for each in parting):
        raise SystemExit(1)


@journal.command(epilog="\b\nExample: catseye journal backup night.db /backup/night.db\nWhile it is written, too")
def backup(
    journal: JournalArgument,
    copy: Annotated[Path, typer.Argument(metavar="COPY", help="A new file.")],
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Copy a journal, also one that is being written, whole or not at all; the copy is checked."""
    from catseye.coordinator.journal.verdict import chain_verdict
    from catseye.gateways.journal.chain import chain_object, chain_words
    from catseye.service.journals import copied

    progress = ProgressLine(quiet)
    try:
        reports = copied(journal, copy, progress=progress)
    finally:
        progress.clear()
    verdict = chain_verdict(reports)
    if json:
        from catseye.gateways.writers.objects import json_line

        runs = [chain_object(r) for r in reports]
        say(json_line({"verdict": verdict.to_object(), "copy": str(copy), "bytes": copy.stat().st_size, "runs": runs}))
    elif not quiet:
        say(wrapped("Verdict", verdict.text))
        say(wrapped("Written to", f"{copy}: {copy.stat().st_size / 1e6:.1f} MB."))
        for report in reports:
            for text in chain_words(report):
                say(wrapped(f"Run {report.run}", text))
    if verdict.word == "failed":
        raise SystemExit(1)
