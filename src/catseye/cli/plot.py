"""The figures that no other command draws: `catseye plot KIND`, each kind a command with its own options."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from catseye.cli.commands import Json, Quiet, app, uncertainty
from catseye.cli.terminal import say, wrapped
from catseye.cli.vocabularies import AIR_MODELS, one_of
from catseye.constants import DEGREE
from catseye.errors import InputError, ValidityError

if TYPE_CHECKING:
    from catseye.gateways.writers.drawing import Svg

MARK = "catseye plot"

plots = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    epilog="\b\nExample: catseye plot air --temperature-c 20 --u-temperature-c 0.2 --out air.svg\n"
    "Example: catseye plot sky --help",
    help="A figure: of a ranger's sky, a servo's move, the air, retroreflectors, coatings, polarization, a beam.",
)
app.add_typer(plots, name="plot")

Out = Annotated[
    Path, typer.Option("--out", metavar="FIGURE", help="Figure to write, .svg, .pdf or .png: new, or an earlier one.")
]
U = {"callback": uncertainty}


def time_text(text: str) -> str:
    """Validate a time; returns it unchanged."""
    from catseye.geometry.sky.time_tag import mjd_of

    try:
        mjd_of(text)
    except ValidityError as problem:
        raise typer.BadParameter(f"{problem}.") from problem
    return text


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
    at: Annotated[str, typer.Option("--at", metavar="TIME", callback=time_text, help="UTC or MJD.")],
    latitude_deg: Annotated[float | None, typer.Option("--latitude-deg", help="If the record has none.")] = None,
    longitude_deg: Annotated[float | None, typer.Option("--longitude-deg", help="If the record has none.")] = None,
    keep_out: Annotated[
        Path | None, typer.Option("--keep-out", metavar="BOXES.toml", help="Boxes that no beam may enter.")
    ] = None,
    start: Annotated[
        str | None, typer.Option("--from", metavar="AZ,EL", callback=_pair, help="A slew from these counts ...")
    ] = None,
    end: Annotated[
        str | None, typer.Option("--to", metavar="AZ,EL", callback=_pair, help="... to these, and the way round.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A ranger's sky with Sun, boxes and a slew."""
    from catseye.gateways.steering.plots import sky_plot
    from catseye.geometry.sky.time_tag import mjd_of

    if (start is None) != (end is None):
        raise typer.BadParameter("go together: --from and --to.", param_hint="'--from'")
    way = None if start is None or end is None else (_counts(start), _counts(end))
    place = {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg}
    drawn = sky_plot(monument, mirror, mjd_of(at), way=way, keep_out=keep_out, **place)
    _finish("sky", drawn, out, json, quiet, inputs=(monument, mirror, keep_out))


@plots.command(epilog="\b\nExample: catseye plot servo --counts 10000 --out servo.svg")
def servo(
    out: Out,
    mirror: Annotated[Path | None, typer.Option("--mirror", metavar="Z.toml", help="Whose settings to take.")] = None,
    counts: Annotated[int, typer.Option("--counts", min=1, max=1_000_000, help="Length of the move.")] = 10_000,
    axis: Annotated[int, typer.Option("--axis", min=0, max=1, help="0 azimuth, 1 elevation.")] = 0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A move of a mirror's servo."""
    from catseye.gateways.steering.plots import servo_plot

    _finish("servo", servo_plot(mirror, axis, counts), out, json, quiet, inputs=(mirror,))


@plots.command(
    epilog="\b\nExample: catseye plot air --temperature-c 20 --pressure-hpa 933 --u-temperature-c 0.2 --out air.svg"
)
def air(  # noqa: PLR0913 - its options are its command line
    out: Out,
    temperature_c: Annotated[float, typer.Option("--temperature-c", help="°C.")] = 20.0,
    pressure_hpa: Annotated[float, typer.Option("--pressure-hpa", help="hPa.")] = 1013.25,
    humidity_percent: Annotated[float, typer.Option("--humidity-percent", help="Over liquid water, %.")] = 50.0,
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Of vacuum, µm.")] = 0.780,
    model: Annotated[
        str, typer.Option("--model", metavar=AIR_MODELS, callback=one_of(AIR_MODELS), help="Formula of the index.")
    ] = "ciddor_hill1999",
    co2_ppm: Annotated[float, typer.Option("--co2-ppm", help="Carbon dioxide, ppm.")] = 450.0,
    u_temperature_c: Annotated[float, typer.Option(help="Standard uncertainty of the temperature, °C.", **U)] = 0.0,
    u_pressure_hpa: Annotated[float, typer.Option(help="Of the pressure, hPa.", **U)] = 0.0,
    u_humidity_percent: Annotated[float, typer.Option(help="Of the humidity, %.", **U)] = 0.0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The index of air against each variable, with its uncertainty and the other models."""
    from catseye.gateways.air.air_figures import StateUncertainty, air_plot

    drawn = air_plot(
        temperature_c,
        pressure_hpa,
        humidity_percent,
        wavelength_um=wavelength_um,
        model=model,
        co2_ppm=co2_ppm,
        uncertainty=StateUncertainty(u_temperature_c, u_pressure_hpa, u_humidity_percent),
    )
    _finish("air", drawn, out, json, quiet)


@plots.command("return", epilog="\b\nExample: catseye plot return --out return.svg")
def return_(out: Out, json: Json = False, quiet: Quiet = False) -> None:
    """Return and range change of each kind of retroreflector against the incidence."""
    from catseye.gateways.optics.retroreflector_figures import return_plot

    _finish("return", return_plot(), out, json, quiet)


@plots.command(epilog="\b\nExample: catseye plot aberration --beam-radius-mm 10 --out aberration.svg")
def aberration(
    out: Out,
    beam_radius_mm: Annotated[
        float, typer.Option("--beam-radius-mm", help="Of the beam at the ball, 1/e², mm.")
    ] = 10.0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The ball's spherical aberration: range, deviation and light against the ray's height."""
    from catseye.gateways.optics.retroreflector_figures import aberration_plot

    _finish("aberration", aberration_plot(beam_radius=beam_radius_mm * 1e-3), out, json, quiet)


@plots.command(
    epilog="\b\nExample: catseye plot coating --name gold --name silver --incidence-deg 45 --out coating.svg"
)
def coating(
    out: Out,
    names: Annotated[
        list[str] | None, typer.Option("--name", help="A coating; again for more. Usual ones if none.")
    ] = None,
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Of vacuum, µm.")] = 0.780,
    incidence_deg: Annotated[float, typer.Option("--incidence-deg", help="For which films are made, degrees.")] = 0.0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Coatings against angle and wavelength: reflectance, and what a range reads too long."""
    from catseye.gateways.optics.beam_figures import DRAWN, coating_plot

    if not (math.isfinite(incidence_deg) and 0.0 <= incidence_deg < 90.0):
        raise typer.BadParameter(f"{incidence_deg} is not within 0 to 90 degrees.", param_hint="'--incidence-deg'")
    chosen = tuple(names) if names else DRAWN
    _finish("coating", coating_plot(chosen, wavelength_um, incidence_deg * DEGREE), out, json, quiet)


@plots.command(epilog="\b\nExample: catseye plot polarization --glass BK7-old --out polarization.svg")
def polarization(
    out: Out,
    glass: Annotated[str, typer.Option("--glass", help="Of the solid corner.")] = "BK7-old",
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Of air, µm.")] = 0.780,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Polarization of cube corners: six sectors, and the return through an analyser."""
    from catseye.gateways.optics.polarization_figures import polarization_plot

    _finish("polarization", polarization_plot(wavelength_um, glass), out, json, quiet)


@plots.command(epilog="\b\nExample: catseye plot beam examples/beams/head.toml --out beam.svg")
def beam(
    train: Annotated[Path, typer.Argument(metavar="TRAIN.toml", help="A train of elements: docs/formats/beam.md.")],
    out: Out,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A beam along its path from the diode to the detector."""
    from catseye.gateways.optics.beam_figures import beam_plot

    _finish("beam", beam_plot(train), out, json, quiet, inputs=(train,))


def _finish(
    kind: str,
    drawn: "tuple[Svg, dict[str, Any]]",
    out: Path,
    json: bool,
    quiet: bool,
    *,
    inputs: Sequence[Path | None] = (),
) -> None:
    """Write the figure whole or not at all, and say what it says."""
    from catseye.gateways.writers.drawing import picture_file
    from catseye.gateways.writers.objects import json_line
    from catseye.gateways.writers.output import write_atomically

    text, summary = drawn
    for given in inputs:
        if given is not None and given.resolve() == out.resolve():
            raise InputError(f"--out {out}: is an input of this figure (expected another name)")
    content = picture_file(text, out, "--out", mark=f"{MARK} {kind}")
    write_atomically(out, content, option="--out", ours=lambda there: MARK.encode() in there)
    if json:
        verdict = {"word": "good", "why": "the figure is drawn from these inputs"}
        say(json_line({"verdict": verdict, "kind": kind, "written": str(out), **summary}))
    elif not quiet:
        from catseye.gateways.plots import plot_passages

        for passage in plot_passages(kind, summary):
            say(wrapped(passage.title, passage.text))
        say(wrapped("Written to", str(out)))
