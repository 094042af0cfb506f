"""The commands. What they need is imported when they run, so that `--help` answers at once."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catseye import __version__
from catseye.cli.terminal import ProgressLine, say, wrapped
from catseye.reduction.settings import Settings

if TYPE_CHECKING:
    from catseye.reduction.epoch import Reduction

MODELS = "ciddor_hill1999|rueger1990"  # as in catseye.atmosphere.air, whose import --help spares itself

app = typer.Typer(
    name="catseye",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def main() -> None:
    """The command line of this process; leaves with SystemExit."""
    from catseye.cli import baseline, calibrate, certificate, explain, link, networks, plot, point  # noqa: F401  their commands join the app

    typer.main.get_command(app)(prog_name="catseye")


def _version(wanted: bool) -> None:
    if wanted:
        say(f"catseye {__version__}")
        raise typer.Exit


def _known_model(name: str) -> str:
    from catseye.atmosphere.air import MODELS as known

    if name not in known:
        raise typer.BadParameter(f"{name!r} is not one of {', '.join(known)}.")
    return name


def _uncertainty(value: float) -> float:
    if not (math.isfinite(value) and value >= 0.0):
        raise typer.BadParameter(f"{value} is not a standard uncertainty (expected 0 or more).")
    return value


AirModel = Annotated[
    str, typer.Option("--air-model", metavar=MODELS, callback=_known_model, help="Formula for the index of air.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object for programs.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress, no text.")]


@app.callback(epilog="\b\nExample: catseye demo")
def catseye(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Laser metrology for large telescopes and structures: raw samples to coordinates, with uncertainty."""


@app.command(epilog="\b\nExample: catseye reduce examples/night-01 --out night-01-report")
def reduce(
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN", help="Directory of a campaign, laid out as examples/night-01.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Directory to write: new, empty, or an earlier output of catseye. Needed unless --json.",
        ),
    ] = None,
    air_model: AirModel = Settings.air_model,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A campaign's samples to coordinates, pose, surface and report."""
    if out is None and not json:
        raise typer.BadParameter("is needed unless --json is given.", param_hint="'--out'")
    reduction = _reduced(campaign, out, air_model, quiet)
    if json:
        _say_reduction(reduction)
    elif not quiet:
        _tell(reduction)
        say(
            wrapped(
                "Written to",
                f"{out}/: report.html, ranges.csv, coordinates.csv, coordinates.json, surface.csv, "
                "pose.json, provenance.json",
            )
        )


@app.command(epilog="\b\nExample: catseye demo my-first-night")
def demo(
    directory: Annotated[Path, typer.Argument(metavar="[DIR]", help="Where the report goes.")] = Path("demo-night-01"),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The bundled night of measurements, reduced and explained."""
    from catseye.gateways.example import example_campaign

    reduction = _reduced(example_campaign(), directory, Settings.air_model, quiet)
    if json:
        _say_reduction(reduction)
    elif not quiet:
        _tell(reduction)
        say(f"\nReport: {directory / 'report.html'}")


@app.command(epilog="\b\nExample: catseye air --temperature-c 20 --pressure-hpa 933 --humidity-percent 50")
def air(
    temperature_c: Annotated[float, typer.Option("--temperature-c", help="Temperature, °C.")],
    pressure_hpa: Annotated[float, typer.Option("--pressure-hpa", help="Total pressure, hPa.")],
    humidity_percent: Annotated[
        float, typer.Option("--humidity-percent", help="Relative humidity over liquid water, %.")
    ],
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Vacuum wavelength, µm.")] = 0.780,
    model: Annotated[
        str, typer.Option("--model", metavar=MODELS, callback=_known_model, help="Formula for the index of air.")
    ] = "ciddor_hill1999",
    co2_ppm: Annotated[float, typer.Option("--co2-ppm", help="Carbon dioxide, ppm.")] = 450.0,
    u_temperature_c: Annotated[
        float, typer.Option("--u-temperature-c", callback=_uncertainty, help="Its standard uncertainty, °C.")
    ] = 0.0,
    u_pressure_hpa: Annotated[
        float, typer.Option("--u-pressure-hpa", callback=_uncertainty, help="Its standard uncertainty, hPa.")
    ] = 0.0,
    u_humidity_percent: Annotated[
        float, typer.Option("--u-humidity-percent", callback=_uncertainty, help="Its standard uncertainty, %.")
    ] = 0.0,
    json: Json = False,
) -> None:
    """Index of air, its sensitivities and its uncertainty."""
    from catseye.atmosphere.air import air as air_of
    from catseye.gateways.objects import air_object, json_line

    state = air_of(
        temperature_c, pressure_hpa, humidity_percent, wavelength_um=wavelength_um, model=model, co2_ppm=co2_ppm
    )
    found = air_object(state, wavelength_um, (u_temperature_c, u_pressure_hpa, u_humidity_percent))
    if json:
        say(json_line(found))
        return
    slope = found["sensitivity"]
    dew_point = f"{found['dew_point_c']:.2f} °C" if math.isfinite(found["dew_point_c"]) else "none"
    for name, value in (
        ("group index", f"{found['group_index']:.9f}"),
        ("phase index", f"{found['phase_index']:.9f}"),
        ("uncertainty", f"{found['standard_uncertainty']:.2g} (of the group index, 1σ)"),
        ("per °C", f"{slope['temperature_c'] * 1e6:+.4f} ppm"),
        ("per hPa", f"{slope['pressure_hpa'] * 1e6:+.4f} ppm"),
        ("per %", f"{slope['humidity_percent'] * 1e6:+.4f} ppm of relative humidity"),
        ("vapour", f"{found['vapour_pressure_hpa']:.3f} hPa, dew point {dew_point}"),
        ("modulation", f"{found['group_wavelength']:.9f} m a wavelength at 1500 MHz"),
        ("formula", f"{found['model']}, {wavelength_um:g} µm"),
    ):
        say(f"{name:<14}{value}")


def _reduced(campaign: Path, out: Path | None, air_model: str, quiet: bool) -> "Reduction":
    """Read, reduce and, when there is an `out`, write it whole or not at all."""
    from catseye.gateways.output import refuse_output, whole_directory

    if out is not None:
        refuse_output(out, campaign)
    progress = ProgressLine(quiet)
    try:
        from catseye.records import read_campaign
        from catseye.reduction.epoch import reduce_epoch

        night = read_campaign(campaign)
        reduction = reduce_epoch(night, Settings(air_model=air_model), progress)
        if out is not None:
            from catseye.gateways.reduction_files import write_reduction

            with whole_directory(out, campaign) as directory:
                write_reduction(reduction, directory, progress)
        return reduction
    finally:
        progress.clear()


def _say_reduction(reduction: "Reduction") -> None:
    from catseye.gateways.objects import json_line, reduction_object

    say(json_line(reduction_object(reduction)))


def _tell(reduction: "Reduction") -> None:
    from catseye.gateways.summary import feed_arm_rows, passages

    for passage in passages(reduction):
        say(wrapped(passage.title, passage.text))
        if passage.title == "The feed arm":
            for name, x, u in feed_arm_rows(reduction):
                say(
                    f"{'':<14}{name}  x {x[0]:9.4f}  y {x[1]:9.4f}  z {x[2]:9.4f} m   "
                    f"u {u[0]:.3f}, {u[1]:.3f}, {u[2]:.3f} mm"
                )
