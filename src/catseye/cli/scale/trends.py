"""The command of an archive's trends."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, Threads, app
from catseye.cli.networks import Out
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine

FILES = "report.html, alarms.csv, coefficients.csv, points.csv, instruments.csv, figures, result.json, provenance.json"


@app.command(
    epilog="\b\nExample: catseye trends years --out trends\n"
    "         catseye trends years --body 'dish*' --harmonics 2 --since 61041\n"
    "years: catseye archive years night-01 night-02 ..."
)
def trends(  # noqa: PLR0913 - its options are its command line
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="Directory of the archive.")],
    bodies: Annotated[
        list[str] | None,
        typer.Option("--body", metavar="NAME", help="Kind of points or body with a pose, or pattern; repeats."),
    ] = None,
    since: Annotated[float | None, typer.Option("--since", metavar="MJD", help="First time, UTC.")] = None,
    until: Annotated[float | None, typer.Option("--until", metavar="MJD", help="Last time, UTC, excluded.")] = None,
    harmonics: Annotated[int, typer.Option("--harmonics", min=1, max=2, help="Number of harmonics of elevation.")] = 1,
    annual: Annotated[bool, typer.Option("--annual/--no-annual", help="Annual wave beside temperature.")] = True,
    false_alarm: Annotated[
        float, typer.Option("--false-alarm", help="Probability of any step or drift without cause, for all series.")
    ] = 0.01,
    out: Out = None,
    threads: Threads = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Changes over years of nights: structural models, steps, drifts, calibrations that age, as alarms."""
    from catseye.api.result import require_writable, save
    from catseye.api.scale.trends import trends as trends_of

    progress = ProgressLine(quiet)
    try:
        require_writable(out, directory)
        result = trends_of(
            directory,
            bodies=bodies,
            since=since,
            until=until,
            harmonics=harmonics,
            annual=annual,
            false_alarm=false_alarm,
            progress=progress,
        )
        if out is not None:
            save(result, out, progress=progress)
    finally:
        progress.clear()
    written = [("Written to", None if out is None else f"{out}/: {FILES}")]
    rows = [f"{'':<14}{line}" for line in result.rows()]
    tell(result, json=json, quiet=quiet, strict=strict, rows=rows, written=written)
