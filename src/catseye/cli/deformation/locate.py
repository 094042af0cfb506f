"""The command of positions: locate."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.numbers import row_of
from catseye.cli.results import Strict, tell
from catseye.cli.vocabularies import LOCATE_METHODS, one_of


@app.command(
    epilog="\b\nExamples: catseye locate positions/stations.csv positions/ranges.csv\n"
    "          catseye locate positions/stations.csv positions/three-ranges.csv --both\n"
    "          catseye locate positions/stations.csv positions/three-ranges.csv --method averaging --near=0,0,30"
)
def locate(  # noqa: PLR0913 - its options are its command line
    *,
    stations: Annotated[Path, typer.Argument(metavar="STATIONS.csv", help="point,x,y,z; u_x,u_y,u_z if known.")],
    ranges: Annotated[Path, typer.Argument(metavar="RANGES.csv", help="from,to,distance,sigma: station to target.")],
    near: Annotated[
        str | None,
        typer.Option(
            "--near",
            metavar="X,Y,Z",
            callback=row_of(3, "x,y,z in metres"),
            help="Point on the targets' side of the stations' plane, m; the iteration begins there.",
        ),
    ] = None,
    both: Annotated[
        bool, typer.Option("--both", help="The second solution, too: the mirror image in the stations' plane.")
    ] = False,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            metavar=LOCATE_METHODS,
            callback=one_of(LOCATE_METHODS),
            help="Least squares, or the notes' iteration by averages for targets of three ranges.",
        ),
    ] = "least_squares",
    sigma_mm: Annotated[
        float | None,
        typer.Option("--sigma-mm", help="Standard uncertainty a + b D of ranges that have none: a, mm."),
    ] = None,
    sigma_ppm: Annotated[
        float | None, typer.Option("--sigma-ppm", help="Standard uncertainty a + b D of ranges that have none: b, ppm.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Positions of targets from ranges to known stations, with their agreement."""
    from catseye.api.positions import locate as located
    from catseye.api.result import require_writable, save

    require_writable(out, stations, ranges)
    result = located(stations, ranges, near=near, both=both, method=method, sigma_mm=sigma_mm, sigma_ppm=sigma_ppm)
    if out is not None:
        save(result, out)
    files = [] if out is None else [("Written to", f"{out}/: report.html, result.json, positions.csv, ranges.csv, ...")]
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=files)
