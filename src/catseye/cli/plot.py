"""The figures that no other command draws: `catseye plot KIND`, each kind a command with its own options."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import Json, Quiet, app, uncertainty
from catseye.cli.results import tell
from catseye.cli.vocabularies import AIR_MODELS, one_of
from catseye.names import AIR_MODEL

if TYPE_CHECKING:
    from catseye.api.figures import FigureResult

plots = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    epilog="\b\nExample: catseye plot air --temperature-c 20 --u-temperature-c 0.2 --out air.svg\n"
    "Example: catseye plot sky --help",
    help="A figure: of a ranger's sky, a servo's move, the air, retroreflectors, coatings, polarization, a beam.",
)
app.add_typer(plots, name="plot")


def _figure(path: Path) -> Path:
    from catseye.api.figures import require_figure

    return require_figure(path)


Out = Annotated[
    Path,
    typer.Option(
        "--out",
        metavar="FIGURE",
        callback=_figure,
        help="Figure to write, .svg, .pdf or .png: new, or an earlier one.",
    ),
]
U = {"callback": uncertainty}


def _pair(text: str | None) -> str | None:
    if text is not None:
        _counts(text)
    return text


def _counts(text: str) -> tuple[float, float]:
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError as problem:
        raise typer.BadParameter(f"{text!r} is not AZIMUTH,ELEVATION in counts.") from problem
    if not (abs(azimuth) <= 1e6 and abs(elevation) <= 1e6):
        raise typer.BadParameter(f"{text!r} is not within 1e6 counts.")
    return azimuth, elevation


@plots.command(
    epilog="\b\nExample: catseye plot sky --monument examples/night-01/monuments/ZY103.toml --mirror "
    "examples/night-01/mirrors/ZP103.toml --at 2003-09-10T18:00:00Z --longitude-deg=-79.84 "
    "--keep-out examples/keep-out.toml --from=18500,10000 --to=21500,12000 --out sky.svg"
)
def sky(  # noqa: PLR0913 - its options are its command line
    out: Out,
    monument: Annotated[Path, typer.Option("--monument", metavar="M.toml", help="The ranger's monument.")],
    mirror: Annotated[Path, typer.Option("--mirror", metavar="Z.toml", help="The mirror on it.")],
    at: Annotated[str, typer.Option("--at", metavar="TIME", help="UTC or MJD.")],
    latitude_deg: Annotated[float | None, typer.Option(help="Latitude, if the record has none.")] = None,
    longitude_deg: Annotated[float | None, typer.Option(help="Longitude, if the record has none.")] = None,
    keep_out: Annotated[
        Path | None, typer.Option("--keep-out", metavar="BOXES.toml", help="Boxes that no beam may enter.")
    ] = None,
    start: Annotated[
        str | None, typer.Option("--from", metavar="AZ,EL", callback=_pair, help="Counts at which a slew begins.")
    ] = None,
    end: Annotated[
        str | None,
        typer.Option("--to", metavar="AZ,EL", callback=_pair, help="Counts at its end; the detour is drawn."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A ranger's sky with Sun, boxes and a slew."""
    from catseye.api.figures import plot_sky

    result = plot_sky(
        monument,
        mirror,
        at,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        keep_out=keep_out,
        start=None if start is None else _counts(start),
        end=None if end is None else _counts(end),
    )
    finish(result, out, json, quiet)


@plots.command(epilog="\b\nExample: catseye plot servo --counts 10000 --out servo.svg")
def servo(
    out: Out,
    mirror: Annotated[Path | None, typer.Option("--mirror", metavar="Z.toml", help="Mirror with the settings.")] = None,
    counts: Annotated[int, typer.Option("--counts", min=1, max=1_000_000, help="Length of the move.")] = 10_000,
    axis: Annotated[int, typer.Option("--axis", min=0, max=1, help="0 azimuth, 1 elevation.")] = 0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A move of a mirror's servo."""
    from catseye.api.figures import plot_servo

    finish(plot_servo(mirror=mirror, counts=counts, axis=axis), out, json, quiet)


@plots.command(
    epilog="\b\nExample: catseye plot air --temperature-c 20 --pressure-hpa 933 --u-temperature-c 0.2 --out air.svg"
)
def air(  # noqa: PLR0913 - its options are its command line
    out: Out,
    temperature_c: Annotated[float, typer.Option("--temperature-c", help="Temperature, °C.")] = 20.0,
    pressure_hpa: Annotated[float, typer.Option("--pressure-hpa", help="Pressure, hPa.")] = 1013.25,
    humidity_percent: Annotated[float, typer.Option(help="Humidity over liquid water, %.")] = 50.0,
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Vacuum wavelength, µm.")] = 0.780,
    model: Annotated[
        str, typer.Option("--model", metavar=AIR_MODELS, callback=one_of(AIR_MODELS), help="Formula of the index.")
    ] = AIR_MODEL,
    co2_ppm: Annotated[float, typer.Option("--co2-ppm", help="Carbon dioxide, ppm.")] = 450.0,
    u_temperature_c: Annotated[float, typer.Option(help="Standard uncertainty of the temperature, °C.", **U)] = 0.0,
    u_pressure_hpa: Annotated[float, typer.Option(help="Standard uncertainty of the pressure, hPa.", **U)] = 0.0,
    u_humidity_percent: Annotated[float, typer.Option(help="Standard uncertainty of the humidity, %.", **U)] = 0.0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The index of air against each variable, with its uncertainty and the other models."""
    from catseye.api.figures import plot_air

    result = plot_air(
        temperature_c,
        pressure_hpa,
        humidity_percent,
        wavelength_um=wavelength_um,
        model=model,
        co2_ppm=co2_ppm,
        u_temperature_c=u_temperature_c,
        u_pressure_hpa=u_pressure_hpa,
        u_humidity_percent=u_humidity_percent,
    )
    finish(result, out, json, quiet)


@plots.command("return", epilog="\b\nExample: catseye plot return --out return.svg")
def return_(out: Out, json: Json = False, quiet: Quiet = False) -> None:
    """Return and range change of each kind of retroreflector against the incidence."""
    from catseye.api.figures import plot_return

    finish(plot_return(), out, json, quiet)


@plots.command(epilog="\b\nExample: catseye plot aberration --beam-radius-mm 10 --out aberration.svg")
def aberration(
    out: Out,
    beam_radius_mm: Annotated[
        float, typer.Option("--beam-radius-mm", help="Radius of the beam at the ball, 1/e², mm.")
    ] = 10.0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The ball's spherical aberration: range, deviation and light against the ray's height."""
    from catseye.api.figures import plot_aberration

    finish(plot_aberration(beam_radius_mm=beam_radius_mm), out, json, quiet)


@plots.command(
    epilog="\b\nExample: catseye plot coating --name gold --name silver --incidence-deg 45 --out coating.svg"
)
def coating(
    out: Out,
    names: Annotated[
        list[str] | None, typer.Option("--name", help="Coating; may repeat. The usual ones if not given.")
    ] = None,
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Vacuum wavelength, µm.")] = 0.780,
    incidence_deg: Annotated[float, typer.Option(help="Incidence for which films are made, degrees.")] = 0.0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Coatings against angle and wavelength: reflectance and range error."""
    from catseye.api.figures import plot_coating

    result = plot_coating(names or (), wavelength_um=wavelength_um, incidence_deg=incidence_deg)
    finish(result, out, json, quiet)


@plots.command(epilog="\b\nExample: catseye plot polarization --glass BK7-old --out polarization.svg")
def polarization(
    out: Out,
    glass: Annotated[str, typer.Option("--glass", help="Glass of the solid corner.")] = "BK7-old",
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Wavelength in air, µm.")] = 0.780,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Polarization of cube corners: six sectors, and the return through an analyser."""
    from catseye.api.figures import plot_polarization

    finish(plot_polarization(glass=glass, wavelength_um=wavelength_um), out, json, quiet)


@plots.command(epilog="\b\nExample: catseye plot beam examples/beams/head.toml --out beam.svg")
def beam(
    train: Annotated[
        Path, typer.Argument(metavar="TRAIN.toml", help="A train of elements: catseye help formats/beam.")
    ],
    out: Out,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A beam along its path from the diode to the detector."""
    from catseye.api.figures import plot_beam

    finish(plot_beam(train), out, json, quiet)


def finish(result: "FigureResult", out: Path, json: bool, quiet: bool) -> None:
    """Write the figure whole or not at all, and say its numbers."""
    written = result.save_figure(out)
    tell(replace(result, written=written), json=json, quiet=quiet, written=[("Written to", out)])
