"""The command that gives journals to the reduction again."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.many_options import NOTHING_SAID, Several, progress_of_many, refuse_several, tell_many
from catseye.cli.option_groups import grouped
from catseye.cli.results import tell
from catseye.cli.terminal import ProgressLine

JournalArgument = Annotated[str, typer.Argument(metavar="JOURNAL", help="File, or postgresql://USER@HOST/DATABASE.")]
RunName = Annotated[
    str | None, typer.Option("--run", metavar="RUN", help="Number, or the beginning of its uuid.  [default: the last]")
]


def run_of(text: str | None) -> int | str | None:
    """Run as the journal's reader takes it: a number, or the beginning of a uuid."""
    return int(text) if text is not None and text.isdecimal() else text


@app.command(
    epilog="\b\nExample: catseye replay night.db\nCalibrated anew: catseye replay night.db --calibrations sites/ours\n"
    "Several, a folder each: catseye replay nights/*.db --out replays --resume"
)
@grouped
def replay(
    journal: Annotated[
        list[str], typer.Argument(metavar="JOURNAL ...", help="Files, or postgresql://USER@HOST/DATABASE.")
    ],
    run: RunName = None,
    calibrations: Annotated[
        Path | None,
        typer.Option(
            "--calibrations", metavar="SITE_DIR", help="Records of the site to reduce with, in place of its own."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Directory to write, for several journals: DIR/NAME each, DIR/ledger what is done.",
        ),
    ] = None,
    several: Several = NOTHING_SAID,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A run again: the same to the last bit, or how far this version or other calibrations move each point."""
    if len(journal) > 1:
        from catseye.api.scale.many_runs import replay_journals

        with progress_of_many("journal", quiet=quiet, resumable=out is not None) as line:
            many = replay_journals(journal, out, run=run, calibrations=calibrations, **several._asdict(), progress=line)
        tell_many(many, None if out is None else f"{out}/NAME/ for each journal", json=json, quiet=quiet)
        if calibrations is None and not all(outcome.value and outcome.value["same"] for outcome in many.outcomes):
            raise SystemExit(1)
        return
    refuse_several(several, "journals")
    if out is not None:
        raise typer.BadParameter("is for several journals.", param_hint="'--out'")
    from catseye.api.living import replay as replayed

    progress = ProgressLine(quiet)
    try:
        result = replayed(journal[0], run=run, calibrations=calibrations, progress=progress)
    finally:
        progress.clear()
    tell(result, json=json, quiet=quiet)
    if calibrations is None and not result.same:
        raise SystemExit(1)
