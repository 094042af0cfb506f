"""The commands. What they need is imported when they run, so that `--help` answers at once."""

import math
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from catseye.cli.inputs import prepare
from catseye.cli.many_options import NOTHING_SAID, Several, progress_of_many, refuse_several, tell_many
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine, say, wrapped
from catseye.cli.vocabularies import AIR_MODEL, AIR_MODELS, one_of
from catseye.version import __version__

if TYPE_CHECKING:
    from catseye.api.night import NightResult

ROOMS = (
    *("air.air", "air.sound", "air.refractometer", "air.acoustic", "networks", "explain", "calibrate", "certificate"),
    *("air.weather", "air.path", "air.acoustic_field", "baseline", "night", "point", "triplet", "plot"),
    *("optics.link", "optics.glass", "optics.beam", "optics.safety", "optics.stray"),
    *("live.zy", "live.ziy", "live.simulate", "live.serve", "live.view", "live.replay", "live.export", "live.journal"),
    *("telescope.pose", "telescope.surface", "telescope.pointing", "telescope.structure", "telescope.panels"),
    *("telescope.frames", "telescope.tracking", "telescope.vibration", "telescope.model", "telescope.triplets"),
    "telescope.subreflector",
    *("scale.archive", "scale.design", "scale.query", "scale.trends", "help"),
    *("deformation.locate", "deformation.movements"),
    *("detection.phase", "detection.frequencies", "detection.cycles"),
    *("scans.scan", "scans.servo", "scans.plots"),
)
SUBJECTS = {  # as `catseye --help` groups the commands
    "Begin here": ("demo", "examples", "help"),
    "A night of ranges": ("reduce", "explain", "budget", "night"),
    "Networks": ("adjust", "locate", "movements", "plan", "design", "baseline"),
    "The telescope": (
        "convert",
        "pose",
        "subreflector",
        "surface",
        "pointing",
        "structure",
        "model",
        "follow",
        "panels",
    ),
    "Laboratory": ("calibrate", "certificate", "triplet", "triplets"),
    "Air": ("air", "sound", "weather", "path", "refractometer", "acoustic", "acoustic-field"),
    "Light": ("point", "track", "link", "beam", "stray", "glass", "safety", "scan", "servo"),
    "The signal": ("phase", "frequencies", "cycles"),
    "A living site": ("simulate", "serve", "view", "zy", "ziy", "replay", "export", "journal"),
    "Years of nights": ("archive", "restore", "query", "trends"),
    "Figures": ("plot",),
}


class SubjectGroup(TyperGroup):
    """The commands of `catseye --help`, by subject."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a section a subject, a line a command; what has no subject comes last."""
        told = {name for names in SUBJECTS.values() for name in names}
        rest = tuple(name for name in self.list_commands(ctx) if name not in told)
        for subject, names in (*SUBJECTS.items(), ("More", rest)):
            commands = [(name, self.get_command(ctx, name)) for name in names]
            lines = [(name, c.get_short_help_str(200)) for name, c in commands if c is not None]
            if lines:
                with formatter.section(subject):
                    formatter.write_dl(lines)


app = typer.Typer(
    name="catseye",
    cls=SubjectGroup,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def join_commands() -> None:
    """Import the modules whose commands join the app, and prepare what all commands share."""
    for name in ROOMS:
        import_module(f"catseye.cli.{name}")
    prepare(app)


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


def _with_threads(context: typer.Context, count: int | None) -> int | None:
    """Have so many threads until the command ends."""
    if count is not None:
        from catseye.processors import at_most

        context.with_resource(at_most(count))
    return count


Threads = Annotated[
    int | None,
    typer.Option(
        "--threads",
        metavar="N",
        min=1,
        callback=_with_threads,
        help="Threads for linear algebra; if not given OPENBLAS_NUM_THREADS, or the free cores.",
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress, no text.")]
Certificate = Annotated[
    Path | None, typer.Option("--certificate", metavar="FILE.pdf", help="Certificate to sign, .pdf or .html.")
]
Laboratory = Annotated[
    Path | None,
    typer.Option("--laboratory", metavar="LAB.toml", help="Laboratory of the certificate."),
]
Job = Annotated[
    Path | None,
    typer.Option("--job", metavar="JOB.toml", help="Number, customer, limits of the certificate."),
]


@app.callback(
    epilog="\b\nExample: catseye demo\n"
    "A path may be an example's name: night-01, gbt, networks/feed-arm.toml (catseye examples lists them)\n"
    "Documentation: catseye help lists its topics"
)
def catseye(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Laser metrology for large telescopes and structures: raw samples to coordinates, with uncertainty."""


@app.command(
    epilog="\b\nExample: catseye reduce examples/night-01 --out night-01-report\n"
    "By a structural model: catseye reduce bent --structure structural-model/telescope.toml --out bent-report\n"
    "Several nights go into a folder each, and --resume continues: catseye reduce night-* --out nights --resume"
)
@grouped
def reduce(  # noqa: PLR0913 - its options are its command line
    campaign: Annotated[
        list[Path],
        typer.Argument(metavar="NIGHT ...", help="Directories of campaigns, laid out as examples/night-01."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Directory to write: new, empty, or an earlier output of catseye; several nights get DIR/NAME each. "
            "Needed unless --json.",
        ),
    ] = None,
    air_model: AirModel = AIR_MODEL,
    structure: Annotated[
        Path | None,
        typer.Option(
            "--structure",
            metavar="MODEL.toml",
            help="Structural model of the telescope: places by it, and what was measured beyond it. Without: the "
            "night's own structural-model.toml, if any.",
        ),
    ] = None,
    threads: Threads = None,
    several: Several = NOTHING_SAID,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """A campaign's samples to coordinates, pose, surface and report; of several nights side by side."""
    if out is None and (len(campaign) > 1 or not json):
        needed = (
            "is needed for several nights."
            if len(campaign) > 1
            else "is needed unless --json is given: a directory for the report, such as --out night."
        )
        raise typer.BadParameter(needed, param_hint="'--out'")
    if out is not None and len(campaign) > 1:
        if threads is not None:
            raise typer.BadParameter("is for one night; several have one thread each.", param_hint="'--threads'")
        if structure is not None:
            text = "is for one night; each of several has its own structural-model.toml."
            raise typer.BadParameter(text, param_hint="'--structure'")
        from catseye.api.scale.many import reduce_nights

        with progress_of_many("night", quiet=quiet, resumable=True) as progress:
            nights = reduce_nights(campaign, out, air_model=air_model, **several._asdict(), progress=progress)
        tell_many(nights, f"{out}/NAME/ for each night", json=json, quiet=quiet, strict=strict)
        return
    refuse_several(several, "nights")
    night = _reduced(campaign[0], out, air_model, quiet, structure)
    tables = "ranges.csv, coordinates.csv, coordinates.json, surface.csv, pose.json, results.fits"
    bent = "" if night.reduction.third_order is None else "structure.csv, structure.json, "
    files = f"report.html, {tables}, {bent}provenance.json"
    _tell(night, f"{out}/: {files}", json=json, quiet=quiet, strict=strict)


@app.command(epilog="\b\nExample: catseye demo my-first-night")
def demo(
    directory: Annotated[Path, typer.Argument(metavar="[DIR]", help="Directory of the report.")] = Path(
        "demo-night-01"
    ),
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The bundled night of measurements, reduced and explained."""
    from catseye.api.reading import examples as bundled

    night = _reduced(bundled("night-01"), directory, AIR_MODEL, quiet)
    _tell(night, None, json=json, quiet=quiet)
    if not json and not quiet:
        say(f"\nReport: {directory / 'report.html'}")


@app.command(epilog="\b\nExample: catseye examples my-examples")
def examples(
    directory: Annotated[
        Path | None,
        typer.Argument(metavar="[DIR]", help="Directory to copy them to, new or empty; without it they are listed."),
    ] = None,
    json: Json = False,
) -> None:
    """List the bundled examples, or write them into a folder."""
    from catseye.api.reading import examples as bundled
    from catseye.api.result import json_text

    names = bundled()
    written = () if directory is None else bundled(directory=directory)
    if json:
        say(json_text({"examples": names, "written": None if directory is None else str(directory)}))
    elif directory is None:
        for folder in dict.fromkeys(name.rpartition("/")[0] for name in names):
            inside = [name.rpartition("/")[2] for name in names if name.rpartition("/")[0] == folder]
            say(wrapped(f"{folder}/" if folder else "", ", ".join(inside)))
        say("\nEach name stands wherever a path does: catseye reduce night-01 --out night")
    else:
        say(f"Written: {len(written)} files in {directory}/")
        say(f"Next:    catseye reduce {directory / 'night-01'} --out night")


def _reduced(
    campaign: Path, out: Path | None, air_model: str, quiet: bool, structure: Path | None = None
) -> "NightResult":
    """Read, reduce and, when there is an `out`, write it whole or not at all."""
    from catseye.api.result import require_writable, save

    require_writable(out, campaign)
    progress = ProgressLine(quiet)
    try:
        from catseye.api.night import reduce as reduced

        night = reduced(campaign, air_model=air_model, structure=structure, progress=progress)
        if out is not None:
            night = night.held()  # all else of the adjustment may go
            save(night, out, progress=progress)
        return night
    finally:
        progress.clear()


def _tell(night: "NightResult", files: str | None, *, json: bool, quiet: bool, strict: bool = False) -> None:
    """The night's sentences, the feed arm's rows after them, and where the rest is."""
    rows = [
        f"{'':<14}{name}  x {x[0]:9.4f}  y {x[1]:9.4f}  z {x[2]:9.4f} m   u {u[0]:.3f}, {u[1]:.3f}, {u[2]:.3f} mm"
        for name, x, u in night.feed_arm()
    ]
    tell(night, json=json, quiet=quiet, strict=strict, rows=rows, under="The feed arm", written=[("Written to", files)])
