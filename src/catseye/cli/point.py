"""The command of pointing."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from catseye.cli.commands import Json, app
from catseye.cli.option_groups import grouped
from catseye.cli.terminal import say
from catseye.cli.vocabularies import REFLECTORS, one_of
from catseye.constants import DEGREE
from catseye.errors import ValidityError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from catseye.geometry.mirror.pointing import MirrorStation
    from catseye.records.site.keep_out import KeepOut
    from catseye.records.site.monument import MonumentGeometry
    from catseye.reduction.site.stations import Pointings
    from catseye.reduction.steering.visibility import Visibility


def time_text(text: str | None) -> str | None:
    """As given, if it is a time."""
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
    """Azimuth and elevation, rad, of "AZ,EL" in degrees."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 2 or not (abs(numbers[0]) <= 540.0 and -5.0 <= numbers[1] <= 95.0):
        raise typer.BadParameter(f"{text!r} is not AZ,EL in degrees, elevation -5 to 95.")
    return numbers[0] * DEGREE, numbers[1] * DEGREE


def _cone(value: float | None) -> float | None:
    if value is not None and not 0.5 <= value <= 60.0:
        raise typer.BadParameter(f"{value} is not 0.5 to 60 degrees.")
    return value


def _refuse_alone(values: Mapping[str, Any], needed: str) -> None:
    for option, value in values.items():
        if value is not None:
            raise typer.BadParameter(f"says nothing without {needed}.", param_hint=f"'{option}'")


class _Forbidden(NamedTuple):
    """When and where the mirror stands, and what its beam must not meet."""

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
        """Where no beam may go: the boxes of the file, and the Sun's cone."""
        from catseye.records.files.reading import read_record
        from catseye.records.site.keep_out import KeepOut

        zones = KeepOut() if self.keep_out is None else read_record(self.keep_out, KeepOut)
        if self.sun_cone_deg is None:
            return zones
        return zones.model_copy(update={"sun": zones.sun.model_copy(update={"half_angle_deg": self.sun_cone_deg})})


class _View(NamedTuple):
    """What stands at the points, and what may hide it."""

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

    def seen(
        self, station: "MirrorStation", stands: "MonumentGeometry", where: "NDArray[np.float64]", pointings: "Pointings"
    ) -> "Visibility | None":
        """Whether the mirror sees each point's reflector; None where nobody asked."""
        if not (self.reflector or self.facing or self.solids):
            return None
        import numpy as np

        from catseye.records.files.reading import read_record
        from catseye.records.site.solids import Solids
        from catseye.reduction.steering.sighting import seen_from

        return seen_from(
            station,
            stands.monument,
            where,
            kind=self.reflector or "prism",
            facing=None if self.facing is None else np.array(_triple(self.facing)),
            solids=Solids() if self.solids is None else read_record(self.solids, Solids),
            posture=None if self.posture is None else _angles(self.posture),
            reachable=pointings.allowed | pointings.prime_allowed,
        )


@app.command(
    epilog="\b\nExample: catseye point --monument examples/night-01/monuments/ZY103.toml "
    "--mirror examples/night-01/mirrors/ZP103.toml --to=0,0,50\n"
    "With the Sun: add --at 2003-09-10T14:00:00Z --longitude-deg=-79.84"
)
@grouped
def point(
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
) -> None:
    """Encoder counts of a mirror for points: CAL.EQ, both pointings, stops, Sun, keep-out boxes, visibility."""
    import numpy as np

    from catseye.gateways.steering.pointing_objects import pointing_objects, pointing_remarks, pointing_table
    from catseye.gateways.writers.objects import json_line
    from catseye.geometry.sky.time_tag import mjd_of
    from catseye.records.files.reading import read_record
    from catseye.records.laboratory.coordinate_list import read_coordinates
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.records.site.monument import MonumentGeometry
    from catseye.reduction.site.stations import point as pointed
    from catseye.reduction.site.stations import station_of
    from catseye.reduction.steering.sighting import place_of_monument, sightings

    if bool(to) == (file is not None):
        raise typer.BadParameter("give points by --to or by --file, one of the two.", param_hint="'--to'")
    forbidden.refuse()
    view.refuse()
    stands, mirrors = read_record(monument, MonumentGeometry), read_record(mirror, MirrorGeometry)
    where = np.array([_triple(text) for text in to or []]) if file is None else read_coordinates(file)
    zones = forbidden.zones()
    mjd = None if forbidden.at is None else mjd_of(forbidden.at)
    place = None if mjd is None else place_of_monument(stands, forbidden.longitude_deg, forbidden.latitude_deg)
    pointings = pointed(stands, mirrors, where)
    station = station_of(stands, mirrors)
    sights = []
    if mjd is not None or zones.box:
        sights = sightings(
            station, mirrors, pointings.counts, name=stands.monument, mjd=mjd, place=place, keep_out=zones
        )
    visible = view.seen(station, stands, where, pointings)
    if write is not None:
        from catseye.gateways.steering.pointing_objects import MARK, output_dat
        from catseye.gateways.writers.output import whole_file

        with whole_file(write, "--write", MARK) as page:
            page.append(output_dat(pointings, f"{mirrors.zp} on {stands.monument}"))
    if json:
        names = {"monument": stands.monument, "mirror": mirrors.zp, "mirror_of_monument": stands.zp}
        say(json_line([{**item, **names} for item in pointing_objects(pointings, sights, visible)]))
        return
    say(pointing_table(pointings))
    if stands.zp is not None and stands.zp != mirrors.zp:
        say(f"{mirrors.zp} is not the mirror that the record of {stands.monument} names, {stands.zp}")
    for remark in pointing_remarks(pointings, sights, visible):
        say(remark)
