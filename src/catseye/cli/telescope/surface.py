"""The command of surface."""

import math
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from catseye.cli.commands import Json, Quiet, Threads, app
from catseye.cli.numbers import row_of
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import NUMBERINGS, PARABOLOID_PARTS, PRISM_FRAMES, TRAVELS, one_of

MOST_LINES = 22  # of Zernike terms on a terminal


def _free(value: str) -> str:
    known = PARABOLOID_PARTS.split("|")
    names = [name.strip() for name in value.split(",")] if value != "none" else []
    for name in names:
        if name not in known:
            raise typer.BadParameter(f"{name!r} is not one of {', '.join(known)} or none.")
    return ",".join(name for name in known if name in names)


def _frequencies(values: list[float] | None) -> list[float]:
    for value in values or []:
        if not (math.isfinite(value) and 0.01 <= value <= 1e4):
            raise typer.BadParameter(f"{value} GHz (expected 0.01 to 10000).")
    return values or []


def _angles(values: list[float] | None) -> list[float]:
    for value in values or []:
        if not -10.0 <= value <= 100.0:
            raise typer.BadParameter(f"{value} is no elevation (expected -10 to 100°).")
    return values or []


class _Design(NamedTuple):
    """Options of a dish without a site."""

    focal_length_m: Annotated[
        float | None,
        typer.Option(
            "--focal-length-m",
            min=0.05,
            max=1000.0,
            help="Focal length of a dish without a site, m; approximate if it is fitted.",
        ),
    ] = None
    radius_m: Annotated[
        float | None, typer.Option("--radius-m", min=0.02, max=500.0, help="Radius of its aperture, m.")
    ] = None
    diameter_m: Annotated[
        float | None, typer.Option("--diameter-m", min=0.04, max=1000.0, help="Diameter of its aperture, m.")
    ] = None
    centre: Annotated[
        str,
        typer.Option(
            "--centre",
            metavar="X,Y",
            callback=row_of(2, "x,y in metres"),
            help="Middle of an offset dish's aperture from the axis, m, along the dish's x and y.",
        ),
    ] = "0,0"
    vertex: Annotated[
        str,
        typer.Option(
            "--vertex", metavar="X,Y,Z", callback=row_of(3, "x,y,z in metres"), help="Its vertex, roughly, m."
        ),
    ] = "0,0,0"
    axis: Annotated[
        str,
        typer.Option(
            "--axis",
            metavar="X,Y,Z",
            callback=row_of(3, "x,y,z"),
            help="Direction from its vertex to its focus, roughly.",
        ),
    ] = "0,0,1"
    u_mm: Annotated[
        float | None,
        typer.Option("--u-mm", min=1e-6, max=100.0, help="u of each coordinate of tables without columns of u, mm."),
    ] = None


class _Shape(NamedTuple):
    """Options of the surface fit."""

    free: Annotated[
        str, typer.Option("--free", metavar="vertex,axis,focal-length|none", callback=_free, help="Fitted parts.")
    ] = "vertex,axis,focal-length"
    taper_db: Annotated[
        float, typer.Option("--taper-db", min=0.0, max=60.0, help="Edge taper of the illumination, dB.")
    ] = 0.0
    frequency_ghz: Annotated[
        list[float] | None,
        typer.Option("--frequency-ghz", callback=_frequencies, help="Frequency for the gain, GHz; may repeat."),
    ] = None
    zernike: Annotated[int, typer.Option("--zernike", min=1, max=500, help="Number of Zernike terms.")] = 15
    order: Annotated[
        str, typer.Option("--order", metavar=NUMBERINGS, callback=one_of(NUMBERINGS), help="Numbering of the terms.")
    ] = "noll"

    def options(self) -> dict[str, Any]:
        """The same for `catseye.surface`."""
        return {
            "free": tuple(name for name in self.free.split(",") if name),
            "taper_db": self.taper_db,
            "frequency_ghz": self.frequency_ghz or (),
            "zernike": self.zernike,
            "order": "noll" if self.order == "noll" else "ansi",
        }


class _Reading(NamedTuple):
    """Options of the input files."""

    frame: Annotated[
        str,
        typer.Option("--frame", metavar=PRISM_FRAMES, callback=one_of(PRISM_FRAMES), help="Frame of tables."),
    ] = "reflector"
    azimuth_deg: Annotated[
        float | None,
        typer.Option("--azimuth-deg", min=-540.0, max=540.0, help="Azimuth, for tables in the ground frame."),
    ] = None
    elevation_deg: Annotated[
        list[float] | None,
        typer.Option("--elevation-deg", callback=_angles, help="Elevation of a table, once for each input."),
    ] = None
    temperature_c: Annotated[
        list[float] | None,
        typer.Option("--temperature-c", help="Temperature of the structure, °C, once for each input."),
    ] = None

    def options(self) -> dict[str, Any]:
        """The same for `catseye.surface`."""
        return {
            "frame": "ground" if self.frame == "ground" else "reflector",
            "azimuth_deg": self.azimuth_deg,
            "elevation_deg": self.elevation_deg or (),
            "temperature_c": self.temperature_c or (),
        }


class _Corrections(NamedTuple):
    """The table of the actuators' corrections, where it is asked for."""

    actuators: Annotated[
        Path | None,
        typer.Option(
            "--actuators",
            metavar="FILE.csv|.fits",
            help="Table to write: corrections of all actuators, from the last input.",
        ),
    ] = None
    positions: Annotated[
        Path | None,
        typer.Option(
            "--positions",
            metavar="FILE.csv",
            help="Positions of the actuators, or actuators.csv whose steps were made; mid-travel if not given.",
        ),
    ] = None
    travel: Annotated[
        str,
        typer.Option("--travel", metavar=TRAVELS, callback=one_of(TRAVELS), help="Travel of an actuator."),
    ] = "normal"

    def options(self) -> dict[str, Any]:
        """The same for `catseye.surface`."""
        return {
            "actuators": self.actuators is not None,
            "positions": self.positions,
            "travel": "axis" if self.travel == "axis" else "normal",
        }


@app.command(
    epilog="\b\nExample: catseye surface night-01-report --taper-db 13 --frequency-ghz 86 --out surface\n"
    "         catseye surface before.csv after.csv --zernike 21\n"
    "         catseye surface points.csv --focal-length-m 9 --diameter-m 25 --frequency-ghz 86\n"
    "         catseye surface e10 e30 e50 e80 e50b e30b --actuators actuators.csv --out lookup\n"
    "One input: its shape; two: second less first as well; from three on: a look-up table by elevation. "
    "Tables: catseye help formats/surface"
)
@grouped
def surface(  # noqa: PLR0913 - its options are its command line
    *,
    inputs: Annotated[
        list[Path],
        typer.Argument(
            metavar="INPUT…", help="Directories of catseye reduce --out, or tables of points; in the order measured."
        ),
    ],
    site: Annotated[
        str | None,
        typer.Option("--site", metavar="SITE", help="Site of the telescope: gbt, or a folder.  [default: gbt]"),
    ] = None,
    design: _Design,
    shape: _Shape,
    reading: _Reading,
    wanted: _Corrections,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ] = None,
    threads: Threads = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """A dish's surface: best paraboloid, half-path errors, Zernike terms, gain, change, elevation, actuators."""
    from catseye.api.result import require_writable, save
    from catseye.api.surface import require_actuators_file
    from catseye.api.surface import surface as surface_of

    require_actuators_file(wanted.actuators, *inputs)
    require_writable(out, *inputs)
    progress = ProgressLine(quiet)
    try:
        result = surface_of(
            *inputs,
            site=site,
            **design._asdict(),
            **shape.options(),
            **reading.options(),
            **wanted.options(),
            progress=progress,
        )
        if wanted.actuators is not None:
            result.save_actuators(wanted.actuators)  # before the directory: no directory without it
        if out is not None:
            save(result, out, progress=progress)
    finally:
        progress.clear()
    rows = [f"{'':<14}{line}" for line in result.rows()[:MOST_LINES]]
    files = None if out is None else f"{out}/: report.html, surface.json, tables of prisms and Zernike terms"
    table = None if wanted.actuators is None else f"{wanted.actuators}: the actuators' corrections"
    written = [("Written to", files), ("Written to", table)]
    tell(result, json=json, quiet=quiet, strict=strict, rows=rows, written=written)
