"""The command of surface."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.option_groups import grouped
from catseye.cli.terminal import ProgressLine, say, wrapped
from catseye.cli.vocabularies import NUMBERINGS, PARABOLOID_PARTS, PRISM_FRAMES, TRAVELS, one_of
from catseye.errors import EstimationError, InputError

if TYPE_CHECKING:
    from catseye.gateways.surface.report import SurfaceResult
    from catseye.records.site.folder import SiteFolder
    from catseye.reduction.surface.actuators import Travel
    from catseye.reduction.surface.shape import Prisms, ShapeSettings

TERMS_TOLD = 22  # on a terminal


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


class _Shape(NamedTuple):
    """What is fitted to the prisms and told of the shape."""

    free: Annotated[
        str, typer.Option("--free", metavar="vertex,axis,focal-length|none", callback=_free, help="What is fitted.")
    ] = "vertex,axis,focal-length"
    taper_db: Annotated[
        float, typer.Option("--taper-db", min=0.0, max=60.0, help="Illumination's edge below its middle, dB.")
    ] = 0.0
    frequency_ghz: Annotated[
        list[float] | None,
        typer.Option("--frequency-ghz", callback=_frequencies, help="Gain there, GHz; may repeat."),
    ] = None
    zernike: Annotated[int, typer.Option("--zernike", min=1, max=500, help="How many terms.")] = 15
    order: Annotated[
        str, typer.Option("--order", metavar=NUMBERINGS, callback=one_of(NUMBERINGS), help="Their numbering.")
    ] = "noll"

    def settings(self) -> "ShapeSettings":
        """The same for the recipe, in its words."""
        from catseye.reduction.surface.shape import ShapeSettings

        return ShapeSettings(
            tuple(name for name in self.free.split(",") if name),
            self.taper_db,
            tuple(f * 1e9 for f in self.frequency_ghz or []),
            self.zernike,
            "noll" if self.order == "noll" else "ansi",
        )


class _Reading(NamedTuple):
    """How the command's input files are read."""

    frame: Annotated[
        str,
        typer.Option("--frame", metavar=PRISM_FRAMES, callback=one_of(PRISM_FRAMES), help="Of tables."),
    ] = "reflector"
    azimuth_deg: Annotated[
        float | None, typer.Option("--azimuth-deg", min=-540.0, max=540.0, help="Of tables in the ground frame.")
    ] = None
    elevation_deg: Annotated[
        list[float] | None,
        typer.Option("--elevation-deg", callback=_angles, help="Of each table, once for each input."),
    ] = None
    temperature_c: Annotated[
        list[float] | None, typer.Option("--temperature-c", help="Of the structure, °C, once for each input.")
    ] = None

    def of(self, inputs: list[Path], site: "SiteFolder") -> "tuple[list[Prisms], dict[str, str]]":
        """Each input's prisms, and the SHA-256 of each file read."""
        from catseye.gateways.surface.inputs import read_prisms

        epochs: list[Prisms] = []
        hashes: dict[str, str] = {}
        for k, source in enumerate(inputs):
            prisms, read = read_prisms(
                source,
                site,
                frame="ground" if self.frame == "ground" else "reflector",
                azimuth_deg=self.azimuth_deg,
                elevation_deg=self.elevation_deg[k] if self.elevation_deg else None,
                temperature_c=self.temperature_c[k] if self.temperature_c else None,
            )
            epochs.append(prisms)
            hashes |= read
        return epochs, hashes


class _Corrections(NamedTuple):
    """The table of the actuators' corrections, where it is asked for."""

    actuators: Annotated[
        Path | None,
        typer.Option("--actuators", metavar="FILE.csv|.fits", help="Corrections of all actuators, last input."),
    ] = None
    positions: Annotated[
        Path | None, typer.Option("--positions", metavar="FILE.csv", help="Where the actuators stand; middle without.")
    ] = None
    travel: Annotated[
        str,
        typer.Option("--travel", metavar=TRAVELS, callback=one_of(TRAVELS), help="Of an actuator."),
    ] = "normal"

    def refuse(self, inputs: list[Path]) -> None:
        """Raises InputError for files that cannot be what they are given as."""
        if self.actuators is not None and self.actuators.suffix.lower() not in (".csv", ".fits"):
            raise InputError(
                f"--actuators {self.actuators}: ends in {self.actuators.suffix!r} (expected .csv or .fits)"
            )
        for place in (self.actuators, self.positions):
            if place is not None and any(place.resolve() == source.resolve() for source in inputs):
                raise InputError(f"{place}: is an input, too (expected another file)")


@app.command(
    epilog="\b\nExample: catseye surface night-01-report --taper-db 13 --frequency-ghz 86 --out surface\n"
    "         catseye surface before.csv after.csv --zernike 21\n"
    "         catseye surface e10 e30 e50 e80 e50b e30b --actuators actuators.csv --out lookup\n"
    "One input: its shape; two: second less first as well; from three on: a look-up table by elevation. "
    "Tables: docs/formats/surface.md"
)
@grouped
def surface(
    *,
    inputs: Annotated[
        list[Path],
        typer.Argument(
            metavar="INPUT…", help="Directories of catseye reduce --out, or tables of prisms; in the order measured."
        ),
    ],
    site: Annotated[str, typer.Option("--site", metavar="SITE", help="The telescope: gbt, or a folder.")] = "gbt",
    shape: _Shape,
    reading: _Reading,
    wanted: _Corrections,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A dish's surface: best paraboloid, half-path errors, Zernike terms, gain, change, elevation, actuators."""
    if wanted.positions is not None and wanted.actuators is None:
        raise InputError(f"--positions {wanted.positions}: goes with --actuators only")
    for name, values in (("--elevation-deg", reading.elevation_deg), ("--temperature-c", reading.temperature_c)):
        if values and len(values) != len(inputs):
            raise InputError(f"{name} is given {len(values)} times for {len(inputs)} inputs (expected once for each)")
    wanted.refuse(inputs)
    if out is not None:
        from catseye.gateways.writers.output import refuse_output

        for source in inputs:
            refuse_output(out, source)
    progress = ProgressLine(quiet)
    try:
        result, hashes = _result(inputs, site, reading, shape.settings(), wanted, progress)
        if out is not None:
            from catseye.gateways.surface.files import write_surface
            from catseye.gateways.writers.output import whole_directory

            with whole_directory(out, inputs[0]) as directory:
                write_surface(result, directory, hashes, progress=progress)
                _keep(result, wanted.actuators)  # no directory without the table that was asked for, too
        else:
            _keep(result, wanted.actuators)
    finally:
        progress.clear()
    _tell(result, json, quiet, out, wanted.actuators)


def _keep(result: "SurfaceResult", actuators: Path | None) -> None:
    if actuators is not None:
        from catseye.gateways.surface.files import write_actuators

        write_actuators(result, actuators)


def _result(
    inputs: list[Path],
    telescope: str,
    reading: _Reading,
    settings: "ShapeSettings",
    wanted: _Corrections,
    progress: ProgressLine,
) -> "tuple[SurfaceResult, dict[str, str]]":
    """What the inputs say, and the SHA-256 of each file read."""
    from catseye.gateways.examples import located
    from catseye.gateways.surface.report import SurfaceResult
    from catseye.records.panels.actuators import read_positions
    from catseye.records.site.folder import read_site
    from catseye.reduction.surface.actuators import actuators_of, corrections
    from catseye.reduction.surface.change import change_between
    from catseye.reduction.surface.lookup import lookup_of
    from catseye.reduction.surface.shape import LitAperture, shape_of

    site = read_site(located(telescope))
    aperture = LitAperture.of(site.site.paraboloid)
    epochs, hashes = reading.of(inputs, site)
    shapes = []
    for k, prisms in enumerate(epochs):
        progress("fitting epochs", k, len(epochs))
        try:
            shapes.append(shape_of(prisms, aperture, settings))
        except EstimationError as problem:
            raise EstimationError(f"{prisms.source}: {problem}") from problem
    change = change_between(epochs[0], epochs[1], aperture, settings=settings) if len(epochs) == 2 else None
    lookup = lookup_of(shapes) if len(epochs) >= 3 else None
    table = None
    if wanted.actuators is not None:
        progress("actuators", 0, 1)
        known = None if wanted.positions is None else read_positions(wanted.positions)
        travel: Travel = "axis" if wanted.travel == "axis" else "normal"
        table = corrections(shapes[-1], *actuators_of(site), positions=known, travel=travel)
    return SurfaceResult(tuple(shapes), change, lookup, table), hashes


def _tell(result: "SurfaceResult", json: bool, quiet: bool, out: Path | None, actuators: Path | None) -> None:
    from catseye.gateways.surface.objects import (
        actuators_passage,
        change_passages,
        lookup_passages,
        shape_passages,
        term_lines,
    )

    if json:
        from catseye.gateways.surface.files import surface_object
        from catseye.gateways.writers.objects import json_line

        say(json_line(surface_object(result)))
        return
    if quiet:
        return
    passages = []
    if result.lookup is not None:
        passages += lookup_passages(result.lookup)
    else:
        for shape in result.shapes:
            passages += shape_passages(shape)
    if result.change is not None:
        passages += change_passages(result.change)
    if result.actuators is not None:
        passages.append(actuators_passage(result.actuators))
    for passage in passages:
        say(wrapped(passage.title, passage.text))
    for line in term_lines(result.shapes, result.change, result.lookup)[:TERMS_TOLD]:
        say(f"{'':<14}{line}")
    if out is not None:
        say(wrapped("Written to", f"{out}/: report.html, surface.json, tables of prisms and Zernike terms"))
    if actuators is not None:
        say(wrapped("Written to", f"{actuators}: the actuators' corrections"))
