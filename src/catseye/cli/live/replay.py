"""The command that gives a journal to the reduction again."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
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
    epilog="\b\nExample: catseye replay night.db\nCalibrated anew: catseye replay night.db --calibrations sites/ours"
)
def replay(
    journal: JournalArgument,
    run: RunName = None,
    calibrations: Annotated[
        Path | None,
        typer.Option(
            "--calibrations", metavar="SITE_DIR", help="Records of the site to reduce with, in place of its own."
        ),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A run again: the same to the last bit, or how far this version or other calibrations move each point."""
    from catseye.api.living import replay as replayed

    progress = ProgressLine(quiet)
    try:
        result = replayed(journal, run=run, calibrations=calibrations, progress=progress)
    finally:
        progress.clear()
    tell(result, json=json, quiet=quiet)
    if calibrations is None and not result.same:
        raise SystemExit(1)
