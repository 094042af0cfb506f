"""The command of pointing."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from catseye.cli.commands import Json, app
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, judge
from catseye.cli.terminal import say
from catseye.cli.vocabularies import REFLECTORS, one_of
from catseye.errors import ValidityError

if TYPE_CHECKING:
    from catseye.api.steering import PointingResult
    from catseye.records.site.keep_out import KeepOut


def time_text(text: str | None) -> str | None:
    """Validate a time; returns it unchanged."""
    if text is not None:
        from catseye.geometry.sky.time_tag import mjd_of

        try:
            mjd_of(text)
        except ValidityError as problem:
            raise typer.BadParameter(f"{problem}.") from problem
    return text


def _points(texts: list[str] | None) -> list[str] | None:
    for text in texts or []:
        _triple(text)
    return texts


def _triple(text: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3 or not all(math.isfinite(v) for v in numbers):
        raise typer.BadParameter(f"{text!r} is not x,y,z in metres.")
    return numbers


def _vector(text: str | None) -> str | None:
    if text is not None and not any(_triple(text)):
        raise typer.BadParameter(f"{text!r} points nowhere.")
    return text


def _posture(text: str | None) -> str | None:
    if text is not None:
        _angles(text)
    return text


def _angles(text: str) -> tuple[float, float]:
    """Azimuth and elevation of "AZ,EL", degrees."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 2 or not (abs(numbers[0]) <= 540.0 and -5.0 <= numbers[1] <= 95.0):
        raise typer.BadParameter(f"{text!r} is not AZ,EL in degrees, elevation -5 to 95.")
    return numbers[0], numbers[1]


def _cone(value: float | None) -> float | None:
    if value is not None and not 0.5 <= value <= 60.0:
        raise typer.BadParameter(f"{value} is not 0.5 to 60 degrees.")
    return value


def _refuse_alone(values: Mapping[str, Any], needed: str) -> None:
    for option, value in values.items():
        if value is not None:
            raise typer.BadParameter(f"says nothing without {needed}.", param_hint=f"'{option}'")


class _Forbidden(NamedTuple):
    """Time and place of the mirror, and its keep-out regions."""

    at: Annotated[
        str | None,
        typer.Option("--at", metavar="TIME", callback=time_text, help="UTC or MJD: is the Sun in the way?"),
    ] = None
    latitude_deg: Annotated[
        float | None, typer.Option("--latitude-deg", help="Of the site; the monument's record if not given.")
    ] = None
    longitude_deg: Annotated[
        float | None, typer.Option("--longitude-deg", help="East positive; the monument's record if not given.")
    ] = None
    sun_cone_deg: Annotated[
        float | None, typer.Option("--sun-cone-deg", callback=_cone, help="Half angle kept from the Sun.  [default: 5]")
    ] = None
    keep_out: Annotated[
        Path | None, typer.Option("--keep-out", metavar="BOXES.toml", help="Boxes that no beam may enter.")
    ] = None

    def refuse(self) -> None:
        """Raises BadParameter for what says nothing without a time."""
        if self.at is None:
            _refuse_alone(
                {
                    "--sun-cone-deg": self.sun_cone_deg,
                    "--latitude-deg": self.latitude_deg,
                    "--longitude-deg": self.longitude_deg,
                },
                "--at",
            )

    def zones(self) -> "KeepOut":
        """Keep-out regions: the boxes of the file, and the Sun's cone."""
        from catseye.records.files.reading import read_record
        from catseye.records.site.keep_out import KeepOut

        zones = KeepOut() if self.keep_out is None else read_record(self.keep_out, KeepOut)
        if self.sun_cone_deg is None:
            return zones
        return zones.model_copy(update={"sun": zones.sun.model_copy(update={"half_angle_deg": self.sun_cone_deg})})


class _View(NamedTuple):
    """Retroreflectors at the points, and obstacles."""

    reflector: Annotated[
        str | None,
        typer.Option(
            "--reflector", metavar=REFLECTORS, callback=one_of(REFLECTORS), help="What stands there: is it visible?"
        ),
    ] = None
    facing: Annotated[
        str | None,
        typer.Option("--facing", metavar="X,Y,Z", callback=_vector, help="Outward axis of the reflectors, ground."),
    ] = None
    solids: Annotated[
        Path | None, typer.Option("--solids", metavar="SOLIDS.toml", help="What may stand in the way.")
    ] = None
    posture: Annotated[
        str | None,
        typer.Option("--posture", metavar="AZ,EL", callback=_posture, help="Of the telescope, deg, for its solids."),
    ] = None

    def refuse(self) -> None:
        """Raises BadParameter for what says nothing without solids."""
        if self.solids is None:
            _refuse_alone({"--posture": self.posture}, "--solids")


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
        typer.Option(
            "--to", metavar="X,Y,Z", callback=lambda v: _points(v or []), help="Point, ground, m; may repeat."
        ),
    ] = None,
    file: Annotated[
        Path | None, typer.Option("--file", metavar="coord.dat", help="Points, a line each: x y z in mm, # comments.")
    ] = None,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="output.dat", help="Table to write, as CAL.EQ did.")
    ] = None,
    forbidden: _Forbidden,
    view: _View,
    json: Json = False,
    strict: Strict = False,
) -> None:
    """Encoder counts of a mirror for points: CAL.EQ, both pointings, stops, Sun, keep-out boxes, visibility."""
    from catseye.api.steering import point as pointed
    from catseye.geometry.sky.time_tag import mjd_of

    if bool(to) == (file is not None):
        raise typer.BadParameter("give points by --to or by --file, one of the two.", param_hint="'--to'")
    forbidden.refuse()
    view.refuse()
    result = pointed(
        monument,
        mirror,
        [_triple(text) for text in to or []] if file is None else file,
        at_mjd=None if forbidden.at is None else mjd_of(forbidden.at),
        latitude_deg=forbidden.latitude_deg,
        longitude_deg=forbidden.longitude_deg,
        keep_out=forbidden.zones(),
        reflector=view.reflector,
        facing=None if view.facing is None else _triple(view.facing),
        solids=view.solids,
        posture_deg=None if view.posture is None else _angles(view.posture),
    )
    if write is not None:
        from catseye.gateways.steering.pointing_objects import MARK, output_dat
        from catseye.gateways.writers.output import atomic_file

        with atomic_file(write, "--write", MARK) as page:
            page.append(output_dat(result.pointings, f"{result.names['mirror']} on {result.names['monument']}"))
    if json:
        from catseye.gateways.writers.objects import json_line

        say(json_line(result.to_object()))
    else:
        _tell(result)
    judge(result.verdict, strict=strict)


def _tell(result: "PointingResult") -> None:
    """The verdict, the table of counts, and what it does not show."""
    from catseye.gateways.steering.pointing_objects import pointing_remarks, pointing_table

    say(f"{result.verdict.text}\n")
    say(pointing_table(result.pointings))
    named, used = result.names["mirror_of_monument"], result.names["mirror"]
    if named is not None and named != used:
        say(f"{used} is not the mirror that the record of {result.names['monument']} names, {named}")
    for remark in pointing_remarks(result.pointings, result.sightings, result.visibility):
        say(remark)
