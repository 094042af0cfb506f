"""The command that takes a journal to others' formats."""

from pathlib import Path
from typing import Annotated, Literal, NamedTuple, cast

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.live.options import time_of
from catseye.cli.live.replay import JournalArgument, RunName, run_of
from catseye.cli.option_groups import grouped
from catseye.cli.terminal import ProgressLine, say, wrapped
from catseye.cli.vocabularies import EXPORT_FORMATS, one_of
from catseye.errors import InputError


class ExportedPart(NamedTuple):
    """Selection of a journal; each field is the option of its name."""

    run: RunName = None
    since: Annotated[
        str | None, typer.Option("--from", metavar="TIME", callback=time_of, help="UTC or MJD; from the start if not.")
    ] = None
    until: Annotated[
        str | None, typer.Option("--until", metavar="TIME", callback=time_of, help="Not in it; to the end if not.")
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
        typer.Option("--damaged", help="Also of a journal that does not check: what is not as written is left out."),
    ] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A run as tables (CSV, FITS), or as a campaign that `catseye reduce` reads."""
    from catseye.gateways.writers.output import refuse_output
    from catseye.service.journals import exported

    span = _span(which.since, which.until)
    refuse_output(out, Path(journal))
    progress = ProgressLine(quiet)
    form = cast(Literal["csv", "fits", "campaign"], to)
    try:
        outcome = exported(journal, out, form, which=run_of(which.run), span=span, damaged=damaged, progress=progress)
    finally:
        progress.clear()
    from catseye.gateways.journal.chain import chain_object, chain_words

    if json:
        from catseye.gateways.writers.objects import json_line

        summary = {
            "verdict": outcome.verdict.to_object(),
            "chain": chain_object(outcome.chain),
            "run": outcome.run,
            "out": str(out),
            "format": to,
            "rows": outcome.rows,
            "notes": list(outcome.notes),
        }
        say(json_line(summary))
    elif not quiet:
        rows = ", ".join(f"{count} {name}" for name, count in outcome.rows.items())
        say(wrapped("Verdict", outcome.verdict.text))
        say(wrapped("Written to", f"{out}/: run {outcome.run}, {rows}."))
        for text in chain_words(outcome.chain) if outcome.chain.count or not outcome.chain.chained else ():
            say(wrapped("Chain", text))
        for note in outcome.notes:
            say(wrapped("Note", note))


def _span(since: str | None, until: str | None) -> tuple[int, int] | None:
    """First and last tick that are asked for; None for all."""
    if since is None and until is None:
        return None
    from catseye.geometry.sky.time_tag import mjd_of
    from catseye.records.night.live import TICKS_PER_DAY

    low = 0 if since is None else round(mjd_of(since) * TICKS_PER_DAY)
    high = 10**6 * TICKS_PER_DAY if until is None else round(mjd_of(until) * TICKS_PER_DAY)
    if not low < high:
        raise InputError(f"--from {since} is not before --until {until} (expected an earlier time)")
    return low, high
