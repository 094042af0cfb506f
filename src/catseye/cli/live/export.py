"""The command that takes a journal to others' formats."""

from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.live.options import time_of
from catseye.cli.live.replay import JournalArgument, RunName, run_of
from catseye.cli.option_groups import grouped
from catseye.cli.terminal import ProgressLine, say, wrapped
from catseye.cli.vocabularies import EXPORT_FORMATS, one_of
from catseye.errors import InputError


class ExportedPart(NamedTuple):
    """What of a journal is taken; each field is the option of its name."""

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
    from catseye.coordinator.journal.check import check_whole
    from catseye.coordinator.journal.reader import JournalReader
    from catseye.gateways.journal.campaign import export_campaign
    from catseye.gateways.journal.export import export_tables
    from catseye.gateways.writers.output import refuse_output

    span = _span(which.since, which.until)
    refuse_output(out, Path(journal))
    progress = ProgressLine(quiet)
    notes: tuple[str, ...] = ()
    verdict = None
    with JournalReader(journal) as reader:
        number = reader.run(run_of(which.run)).run
        try:
            chain = check_whole(reader, number, progress=progress)
            if chain.count and not damaged:
                raise InputError(
                    f"journal {reader.place}: run {number} is not as it was written: {chain.problems[0]} (expected a "
                    "journal that checks: take its backup, or --damaged to leave out what does not)"
                )
            if to == "campaign":
                progress("writing the campaign", 0, 1)
                written = export_campaign(reader, out, run=number, span=span, chain=chain)
                counts, notes = {"shots": written.shots, "weather": written.readings}, written.notes
                verdict = written.verdict
            else:
                form: Literal["csv", "fits"] = "csv" if to == "csv" else "fits"
                counts = export_tables(
                    reader, out, runs=[number], forms=[form], span=span, progress=progress, chains=[chain]
                )
        finally:
            progress.clear()
    from catseye.gateways.journal.chain import chain_object, chain_words, export_verdict

    if json:
        from catseye.gateways.writers.objects import json_line

        summary = {
            "verdict": (verdict or export_verdict(chain, sum(counts.values()))).to_object(),
            "chain": chain_object(chain),
            "run": number,
            "out": str(out),
            "format": to,
            "rows": counts,
            "notes": list(notes),
        }
        say(json_line(summary))
    elif not quiet:
        rows = ", ".join(f"{count} {name}" for name, count in counts.items())
        say(wrapped("Written to", f"{out}/: run {number}, {rows}."))
        for text in chain_words(chain) if chain.count or not chain.chained else ():
            say(wrapped("Chain", text))
        for note in notes:
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
