"""The command of the panel setting instrument."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, judge
from catseye.cli.terminal import ProgressLine, say, wrapped

if TYPE_CHECKING:
    from catseye.records.panels.layout import PanelLayout


def _focal(value: float) -> float:
    if not (math.isfinite(value) and 0.1 <= value <= 1000.0):
        raise typer.BadParameter(f"{value} is not a focal length (expected 0.1 to 1000 m).")
    return value


@app.command(
    epilog="\b\nExample: catseye panels examples/panels/as-found.csv --instrument examples/panels/tool.toml "
    "--layout gbt\n         --survey examples/panels/survey.csv --as-left examples/panels/as-left.csv --out panels\n"
    "Layouts of all files: docs/formats/panels.md"
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
        float, typer.Option("--focal-length-m", callback=_focal, help="Of the paraboloid of a LAYOUT.csv.")
    ] = 60.0,
    reject: Annotated[
        bool, typer.Option("--reject", help="Leave out readings that the tests reject; only named without.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Directory to write: report, list of screws, tables.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Panel corners from the panel setting instrument: heights, turns of screws, a crew's statistics."""
    from catseye.gateways.panels.objects import panels_object, panels_verdict, passages
    from catseye.gateways.writers.output import atomic_directory, refuse_output
    from catseye.reduction.panels.job import PanelFiles, panel_work

    files = PanelFiles(readings, instrument, survey, cmm, as_left, survey_left)
    if out is not None:
        for source in files.all:
            refuse_output(out, source)
    progress = ProgressLine(quiet)
    try:
        work = panel_work(files, _layout(layout, focal_length_m), reject=reject, progress=progress)
        if out is not None:
            from catseye.gateways.panels.report import write_panels

            with atomic_directory(out, readings) as directory:
                write_panels(work, directory, progress)
    finally:
        progress.clear()
    if json:
        from catseye.gateways.writers.objects import json_line

        say(json_line(panels_object(work)))
    elif not quiet:
        say(wrapped("Verdict", panels_verdict(work).text))
        for title, text in passages(work):
            say(wrapped(title, text))
        if out is not None:
            files_written = "report.html, screws.csv, actuators.csv, panels.csv, readings.csv, crew.csv, panels.json"
            say(wrapped("Written to", f"{out}/: {files_written}"))
    judge(panels_verdict(work), strict=strict)


def _layout(given: str, focal_length: float) -> "PanelLayout":
    """The layout of a table, or of a site's prisms."""
    from catseye.gateways.examples import located
    from catseye.records.panels.layout import layout_of_site, read_layout
    from catseye.records.site.folder import read_site

    if given.endswith(".csv"):
        return read_layout(located(given), focal_length)
    return layout_of_site(read_site(located(given)))
