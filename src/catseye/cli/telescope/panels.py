"""The command of the panel setting instrument."""

import math
from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine


def _focal(value: float) -> float:
    if not (math.isfinite(value) and 0.1 <= value <= 1000.0):
        raise typer.BadParameter(f"{value} is not a focal length (expected 0.1 to 1000 m).")
    return value


@app.command(
    epilog="\b\nExample: catseye panels examples/panels/as-found.csv --instrument examples/panels/tool.toml "
    "--layout gbt\n         --survey examples/panels/survey.csv --as-left examples/panels/as-left.csv --out panels\n"
    "Layouts of all files: catseye help formats/panels"
)
def panels(  # noqa: PLR0913 - its options are its command line
    readings: Annotated[Path, typer.Argument(metavar="READINGS.csv", help="Placements of the tool, as found.")],
    instrument: Annotated[Path, typer.Option("--instrument", metavar="SHEET.toml", help="Data sheet of the tool.")],
    layout: Annotated[
        str, typer.Option("--layout", metavar="LAYOUT.csv|SITE", help="Panels and corners, or a site with its prisms.")
    ] = "gbt",
    survey: Annotated[
        Path | None, typer.Option("--survey", metavar="SURVEY.csv", help="Heights of actuators by their prisms.")
    ] = None,
    cmm: Annotated[
        Path | None, typer.Option("--cmm", metavar="DIR", help="Maps PANEL.csv of a coordinate measuring machine.")
    ] = None,
    as_left: Annotated[
        Path | None, typer.Option("--as-left", metavar="READINGS.csv", help="Placements after the screws were turned.")
    ] = None,
    survey_left: Annotated[
        Path | None, typer.Option("--survey-left", metavar="SURVEY.csv", help="Survey as left; --survey if not given.")
    ] = None,
    focal_length_m: Annotated[
        float, typer.Option("--focal-length-m", callback=_focal, help="Focal length of a LAYOUT.csv's paraboloid.")
    ] = 60.0,
    reject: Annotated[
        bool, typer.Option("--reject", help="Leave out rejected readings; otherwise they are only named.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Directory to write: report, list of screws, tables.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Panel corners from the panel setting instrument: heights, turns of screws, a crew's statistics."""
    from catseye.api.panels import panels as panels_of
    from catseye.api.result import require_writable, save

    require_writable(out, *(each for each in (readings, instrument, survey, cmm, as_left, survey_left) if each))
    progress = ProgressLine(quiet)
    try:
        result = panels_of(
            readings,
            instrument,
            layout=layout,
            survey=survey,
            cmm=cmm,
            as_left=as_left,
            survey_left=survey_left,
            focal_length_m=focal_length_m,
            reject=reject,
            progress=progress,
        )
        if out is not None:
            save(result, out, progress=progress)
    finally:
        progress.clear()
    files = "report.html, screws.csv, actuators.csv, panels.csv, readings.csv, crew.csv, panels.json"
    written = [("Written to", None if out is None else f"{out}/: {files}")]
    tell(result, json=json, quiet=quiet, strict=strict, written=written)
