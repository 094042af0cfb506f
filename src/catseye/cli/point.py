"""The command of pointing."""

from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from catseye.cli.commands import Json, app
from catseye.cli.numbers import numbers_of, row_of
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell
from catseye.cli.vocabularies import REFLECTORS, one_of

PLACE = "x,y,z in metres"


def _points(texts: list[str] | None) -> list[list[float]]:
    return [numbers_of(text, 3, PLACE) for text in texts or []]


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
            help="Posture of the telescope, deg, for its solids.",
        ),
    ] = None


@app.command(
    epilog="\b\nExample: catseye point --monument examples/night-01/monuments/ZY103.toml "
    "--mirror examples/night-01/mirrors/ZP103.toml --to=0,0,50\n"
    "With the Sun: add --at 2003-09-10T14:00:00Z --longitude-deg=-79.84"
)
@grouped
def point(  # noqa: PLR0913 - its options are its command line
    *,
    monument: Annotated[Path, typer.Option("--monument", metavar="M.toml", help="Record of the monument.")],
    mirror: Annotated[Path, typer.Option("--mirror", metavar="Z.toml", help="Record of the mirror on it.")],
    to: Annotated[
        list[str] | None,
        typer.Option("--to", metavar="X,Y,Z", callback=_points, help="Point, ground, m; may repeat."),
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
    result = pointed(monument, mirror, to if file is None else file, **forbidden._asdict(), **view._asdict())
    if write is not None:
        result.save_counts(write)
    tell(result, json=json, strict=strict, rows=result.lines())
