"""The command of the structure: flexible models of groups of points, and vibration."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, Threads, app
from catseye.cli.live.replay import RunName, run_of
from catseye.cli.networks import Out
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import OWN_FUNCTIONS, SERIES_FRAMES, one_of

MODEL_FILES = "report.html, structure.json, coefficients.csv, residuals.csv, samplers.fits, provenance.json"
RANGE_FILES = "report.html, vibration.json, spectra.csv, samplers.fits"


def _pivot(text: str | None) -> str | None:
    if text is not None:
        try:
            good = len([float(v) for v in text.split(",")]) == 3
        except ValueError:
            good = False
        if not good:
            raise typer.BadParameter(f"{text!r} is not x,y,z in metres.")
    return text


@app.command(
    epilog="\b\nExample: catseye structure at-15 at-30 at-45 at-60 at-75 at-85 --points 'DP*' --predict 50 --out dish\n"
    "         catseye structure --epochs examples/structure/epochs.csv --points 'ZEG*' --predict 50 --out feed-arm\n"
    "         catseye structure --vibration night.db --points ZEG41040L --out shaking\n"
    "at-15: catseye night night-15 --elevation-deg 15; catseye reduce night-15 --out at-15; the others likewise"
)
def structure(  # noqa: PLR0913 - its options are its command line
    sources: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[REDUCTION]...", help="Directories of `catseye reduce`, or one that holds them."),
    ] = None,
    epochs: Annotated[
        Path | None,
        typer.Option(
            "--epochs",
            metavar="LIST.csv",
            help="Table reduction,azimuth_deg,elevation_deg[,temperature_c,mjd_utc]: reductions and their postures.",
        ),
    ] = None,
    journal: Annotated[
        str | None, typer.Option("--journal", metavar="JOURNAL", help="Journal whose solutions are the epochs.")
    ] = None,
    vibration: Annotated[
        str | None,
        typer.Option("--vibration", metavar="JOURNAL", help="Journal whose ranges give spectra and modes, instead."),
    ] = None,
    run: RunName = None,
    every_s: Annotated[float, typer.Option("--every-s", help="Least time between two epochs of a journal, s.")] = 0.0,
    points: Annotated[
        list[str] | None, typer.Option("--points", metavar="NAME", help="Point, or pattern such as 'ZEG*'; repeats.")
    ] = None,
    group: Annotated[str, typer.Option("--group", help="Name of the group, for the report.")] = "group",
    frame: Annotated[
        str,
        typer.Option(
            "--frame", metavar=SERIES_FRAMES, callback=one_of(SERIES_FRAMES), help="Frame that carries the points."
        ),
    ] = "reflector",
    pivot: Annotated[
        str | None,
        typer.Option(
            "--pivot", metavar="X,Y,Z", callback=_pivot, help="Pivot of rotations, m, in the frame.  [default: middle]"
        ),
    ] = None,
    harmonics: Annotated[int, typer.Option("--harmonics", min=1, max=2, help="Number of harmonics of elevation.")] = 1,
    temperature: Annotated[
        bool, typer.Option("--temperature/--no-temperature", help="Coefficient of temperature.")
    ] = True,
    hysteresis: Annotated[bool, typer.Option("--hysteresis", help="Term of the last move's direction.")] = False,
    own: Annotated[
        str,
        typer.Option(
            "--own",
            metavar=OWN_FUNCTIONS,
            callback=one_of(OWN_FUNCTIONS),
            help="Functions that each point has of its own: a constant offset, or all.",
        ),
    ] = "place",
    scatter: Annotated[
        bool, typer.Option("--scatter/--no-scatter", help="Estimate of the scatter between epochs (wind).")
    ] = True,
    independent: Annotated[
        bool, typer.Option("--independent", help="Ignore correlations between points (for several hundred points).")
    ] = False,
    folds: Annotated[
        int, typer.Option("--folds", min=0, help="Cross-validation folds of consecutive epochs; 0 for none.")
    ] = 5,
    predict_deg: Annotated[
        list[float] | None,
        typer.Option("--predict", metavar="ELEVATION", help="Elevation of a prediction, degrees; repeats."),
    ] = None,
    temperature_c: Annotated[
        float | None,
        typer.Option("--temperature-c", help="Temperature of the prediction; the epochs' mean if not given."),
    ] = None,
    way: Annotated[
        float,
        typer.Option(
            "--way", min=-1, max=1, help="Last elevation move before the prediction: 1 up, -1 down, 0 mean of both."
        ),
    ] = 0.0,
    stretch_s: Annotated[
        float | None, typer.Option("--stretch-s", help="Length of a spectrum segment, s; the resolution is 1.5/length.")
    ] = None,
    less: Annotated[
        str | None,
        typer.Option("--less", metavar="RANGER:TARGET", help="Series to subtract from the ranger's other series."),
    ] = None,
    out: Out = None,
    threads: Threads = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Motion of a group of points with gravity and temperature, predicted; and its vibration."""
    from catseye.api.result import require_writable, save
    from catseye.api.structure import structure as structure_of

    read = [*(sources or []), *(Path(each) for each in (epochs, journal, vibration) if each)]
    progress = ProgressLine(quiet)
    try:
        require_writable(out, *read)
        result = structure_of(
            *(sources or []),
            points=points or (),
            epochs=epochs,
            journal=journal,
            vibration=vibration,
            run=run_of(run),
            every_s=every_s,
            group=group,
            frame=frame,
            pivot=None if pivot is None else [float(part) for part in pivot.split(",")],
            harmonics=harmonics,
            temperature=temperature,
            hysteresis=hysteresis,
            own="each" if own == "each" else "place",
            scatter=scatter,
            independent=independent,
            folds=folds,
            predict_deg=predict_deg or (),
            temperature_c=temperature_c,
            way=way,
            stretch_s=stretch_s,
            less=less,
            progress=progress,
        )
        if out is not None:
            save(result, out, progress=progress)
    finally:
        progress.clear()
    written = [("Written to", None if out is None else f"{out}/: {MODEL_FILES if vibration is None else RANGE_FILES}")]
    rows = [f"{'':<14}{line}" for line in result.rows()]
    strict = strict and vibration is None  # a vibration's verdict never was an exit status
    tell(result, json=json, quiet=quiet, strict=strict, rows=rows, under="Structure", written=written)
