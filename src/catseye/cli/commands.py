"""The commands. What they need is imported when they run, so that `--help` answers at once."""

import math
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine, say
from catseye.cli.vocabularies import AIR_MODELS, one_of
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.version import __version__

if TYPE_CHECKING:
    from catseye.api.night import NightResult

ROOMS = (
    *("air.air", "air.sound", "air.refractometer", "air.acoustic", "networks", "explain", "calibrate", "certificate"),
    *("baseline", "optics.link", "point", "triplet", "optics.glass", "optics.beam", "optics.safety", "plot"),
    *("live.zy", "live.ziy", "live.simulate", "live.serve", "live.replay", "live.export"),
    *("telescope.pose", "telescope.surface", "telescope.pointing", "telescope.structure", "telescope.panels"),
)

app = typer.Typer(
    name="catseye",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def join_commands() -> None:
    """Import the modules whose commands join the app."""
    for name in ROOMS:
        import_module(f"catseye.cli.{name}")


def main() -> None:
    """The command line of this process; leaves with SystemExit."""
    join_commands()
    typer.main.get_command(app)(prog_name="catseye")


def _version(wanted: bool) -> None:
    if wanted:
        say(f"catseye {__version__}")
        raise typer.Exit


def uncertainty(value: float) -> float:
    """A standard uncertainty: 0 or more."""
    if not (math.isfinite(value) and value >= 0.0):
        raise typer.BadParameter(f"{value} is not a standard uncertainty (expected 0 or more).")
    return value


AirModel = Annotated[
    str,
    typer.Option("--air-model", metavar=AIR_MODELS, callback=one_of(AIR_MODELS), help="Formula for the index of air."),
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
    air_model: AirModel = ReductionSettings.air_model,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """A campaign's samples to coordinates, pose, surface and report."""
    if out is None and not json:
        raise typer.BadParameter("is needed unless --json is given.", param_hint="'--out'")
    night = _reduced(campaign, out, air_model, quiet)
    files = "report.html, ranges.csv, coordinates.csv, coordinates.json, surface.csv, pose.json, provenance.json"
    _tell(night, f"{out}/: {files}", json=json, quiet=quiet, strict=strict)


@app.command(epilog="\b\nExample: catseye demo my-first-night")
def demo(
    directory: Annotated[Path, typer.Argument(metavar="[DIR]", help="Where the report goes.")] = Path("demo-night-01"),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The bundled night of measurements, reduced and explained."""
    from catseye.gateways.examples import example_campaign

    night = _reduced(example_campaign(), directory, ReductionSettings.air_model, quiet)
    _tell(night, None, json=json, quiet=quiet)
    if not json and not quiet:
        say(f"\nReport: {directory / 'report.html'}")


def _reduced(campaign: Path, out: Path | None, air_model: str, quiet: bool) -> "NightResult":
    """Read, reduce and, when there is an `out`, write it whole or not at all."""
    from catseye.gateways.writers.output import refuse_output

    if out is not None:
        refuse_output(out, campaign)
    progress = ProgressLine(quiet)
    try:
        from catseye.api.night import reduce as reduced
        from catseye.api.result import save

        night = reduced(campaign, air_model=air_model, progress=progress)
        if out is not None:
            save(night, out, progress=progress)
        return night
    finally:
        progress.clear()


def _tell(night: "NightResult", files: str | None, *, json: bool, quiet: bool, strict: bool = False) -> None:
    """The night's sentences, the feed arm's rows after them, and where the rest is."""
    from catseye.gateways.epoch.summary import feed_arm_rows

    rows = [
        f"{'':<14}{name}  x {x[0]:9.4f}  y {x[1]:9.4f}  z {x[2]:9.4f} m   u {u[0]:.3f}, {u[1]:.3f}, {u[2]:.3f} mm"
        for name, x, u in feed_arm_rows(night.reduction)
    ]
    tell(night, json=json, quiet=quiet, strict=strict, rows=rows, under="The feed arm", written=[("Written to", files)])
