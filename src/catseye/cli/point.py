"""The command of pointing."""

from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from catseye.cli.commands import Json, app
from catseye.cli.numbers import row_of
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell
from catseye.cli.telescope.ranger import PLACE, RangerOptions, points_of
from catseye.cli.vocabularies import REFLECTORS, TELESCOPE_FRAMES, one_of


class _Forbidden(NamedTuple):
    """Time and place of the mirror, and its keep-out regions."""

    at_mjd: Annotated[
        str | None, typer.Option("--at", metavar="TIME", help="Time, UTC or MJD, for a check against the Sun.")
    ] = None
    latitude_deg: Annotated[
        float | None, typer.Option("--latitude-deg", help="Latitude of the site; the monument record's if not given.")
    ] = None
    longitude_deg: Annotated[
        float | None,
        typer.Option(
            "--longitude-deg", help="Longitude of the site, east positive; the monument record's if not given."
        ),
    ] = None
    sun_cone_deg: Annotated[
        float | None, typer.Option("--sun-cone-deg", help="Half angle of the closed cone around the Sun.  [default: 5]")
    ] = None
    keep_out: Annotated[
        Path | None, typer.Option("--keep-out", metavar="BOXES.toml", help="Boxes that no beam may enter.")
    ] = None


class _View(NamedTuple):
    """Retroreflectors at the points, and obstacles."""

    reflector: Annotated[
        str | None,
        typer.Option(
            "--reflector",
            metavar=REFLECTORS,
            callback=one_of(REFLECTORS),
            help="Retroreflector at the points, to check visibility.",
        ),
    ] = None
    facing: Annotated[
        str | None,
        typer.Option(
            "--facing", metavar="X,Y,Z", callback=row_of(3, PLACE), help="Outward axis of the reflectors, ground."
        ),
    ] = None
    solids: Annotated[
        Path | None, typer.Option("--solids", metavar="SOLIDS.toml", help="Obstacles that may block the beam.")
    ] = None
    posture_deg: Annotated[
        str | None,
        typer.Option(
            "--posture",
            metavar="AZ,EL",
            callback=row_of(2, "AZ,EL in degrees"),
            help="Posture of the telescope, deg, for points, rangers and solids that it carries; the site's if not "
            "given.",
        ),
    ] = None


@app.command(
    epilog="\b\nExample: catseye point --monument examples/night-01/monuments/ZY103.toml "
    "--mirror examples/night-01/mirrors/ZP103.toml --to=0,0,50\n"
    "         catseye point --site gbt --ranger ZY115 --frame reflector --posture 145.3,30 --to=0,54,12.2\n"
    "With the Sun: add --at 2003-09-10T14:00:00Z --longitude-deg=-79.84"
)
@grouped
def point(  # noqa: PLR0913 - its options are its command line
    *,
    mounted: RangerOptions,
    frame: Annotated[
        str,
        typer.Option(
            "--frame", metavar=TELESCOPE_FRAMES, callback=one_of(TELESCOPE_FRAMES), help="Frame of the points."
        ),
    ] = "ground",
    to: Annotated[
        list[str] | None,
        typer.Option("--to", metavar="X,Y,Z", callback=points_of, help="Point, m, in --frame; may repeat."),
    ] = None,
    file: Annotated[
        Path | None, typer.Option("--file", metavar="coord.dat", help="Points, a line each: x y z in mm, # comments.")
    ] = None,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="output.dat", help="Table of counts to write, as CAL.EQ did.")
    ] = None,
    forbidden: _Forbidden,
    view: _View,
    json: Json = False,
    strict: Strict = False,
) -> None:
    """Encoder counts of a mirror for points: CAL.EQ, both pointings, stops, Sun, keep-out boxes, visibility."""
    from catseye.api.steering import point as pointed

    if bool(to) == (file is not None):
        raise typer.BadParameter("give points by --to or by --file, one of the two.", param_hint="'--to'")
    points = to if file is None else file
    result = pointed(to=points, frame=frame, **mounted._asdict(), **forbidden._asdict(), **view._asdict())
    if write is not None:
        result.save_counts(write)
    tell(result, json=json, strict=strict, rows=result.lines())
