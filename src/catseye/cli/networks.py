"""The commands of networks: adjust, plan."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from catseye.cli.commands import Json, Quiet, Threads, app
from catseye.cli.many_options import Several, progress_of_many
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine, say
from catseye.cli.vocabularies import COMPONENTS, DATUMS, NETWORK_WEIGHTS, one_of

if TYPE_CHECKING:
    from catseye.api.result import Result

ADJUSTED = "coordinates.csv, observations.csv, adjustment.json, and more"
COMPARED = "displacements.csv, comparison.json"
SUFFIXES = ".toml, .dat (STAR*NET), .gkf (GNU Gama), or a folder with points.csv and ranges.csv"


def _level(value: float) -> float:
    if not 0.0 < value < 1.0:
        raise typer.BadParameter(f"{value} is not a probability between 0 and 1.")
    return value


def _positive(value: float | None) -> float | None:
    if value is not None and not (0.0 < value < float("inf")):
        raise typer.BadParameter(f"{value} is not a time above zero.")
    return value


Datum = Annotated[
    str | None,
    typer.Option(
        "--datum",
        metavar=DATUMS,
        callback=one_of(DATUMS),
        help="Datum, free: nothing held, inner constraints on the marked points; fixed: marked points held. "
        "As the file marks it if not given.",
    ),
]
Scaled = Annotated[
    bool,
    typer.Option("--scale-by-variance-factor", help="Covariances times the variance factor; tau tests."),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
]


class _Claim(NamedTuple):
    """Standard uncertainties of ranges whose file states none."""

    sigma_mm: Annotated[
        float | None,
        typer.Option("--sigma-mm", help="Standard uncertainty a + b D of ranges that have none: a, mm."),
    ] = None
    sigma_ppm: Annotated[
        float | None, typer.Option("--sigma-ppm", help="Standard uncertainty a + b D of ranges that have none: b, ppm.")
    ] = None


class _Treatment(NamedTuple):
    """Treatment of the observations: weights, rejection, variance components."""

    datum: Datum = None
    scale_by_variance_factor: Scaled = False
    reject: Annotated[
        bool, typer.Option("--reject", help="Reject observations that fail the tests, one at a time.")
    ] = False
    robust: Annotated[
        str | None,
        typer.Option(
            "--robust",
            metavar=NETWORK_WEIGHTS,
            callback=one_of(NETWORK_WEIGHTS),
            help="Robust weights of the observations.",
        ),
    ] = None
    components: Annotated[
        str | None,
        typer.Option(
            "--components",
            metavar=COMPONENTS,
            callback=one_of(COMPONENTS),
            help="Estimate variance components: constant and ppm part of each ranger, or a factor per group.",
        ),
    ] = None
    level: Annotated[
        float,
        typer.Option(
            "--level", callback=_level, help="Significance level of the tests, for all single tests together."
        ),
    ] = 0.05
    power: Annotated[
        float,
        typer.Option(
            "--power", callback=_level, help="Power of the tests for the detectable errors and displacements."
        ),
    ] = 0.8
    mdb_level: Annotated[
        float,
        typer.Option("--mdb-level", callback=_level, help="Level of the single test for the detectable errors (mdb)."),
    ] = 0.001
    iterations: Annotated[
        int | None,
        typer.Option("--iterations", min=1, help="Cap of the Gauss-Newton steps of every solution; 50 if not given."),
    ] = None


def _template(directory: Path | None) -> None:
    """Write a folder to begin with, before all else, and end the command."""
    if directory is None:
        return
    from catseye.api.network import write_template

    write_template(directory)
    say(f"Written: {directory}/points.csv, ranges.csv and README.md, which says what they mean.")
    say(f"Next:    catseye adjust {directory} --out report")
    raise typer.Exit


@app.command(epilog="\b\nExamples: catseye adjust networks/feed-arm.toml --out feed-arm-report\n"
             "          catseye adjust --template mine\n"
             "          catseye adjust epoch-1.gkf epoch-2.gkf --points P1,P2,P3")  # fmt: skip
@grouped
def adjust(  # noqa: PLR0913 - its options are its command line
    *,
    network: Annotated[Path, typer.Argument(metavar="NETWORK", help=f"{SUFFIXES}.")],
    later: Annotated[
        Path | None, typer.Argument(metavar="[LATER]", help="The same network at a later epoch, to compare.")
    ] = None,
    treatment: _Treatment,
    claim: _Claim,
    relative: Annotated[
        list[str] | None,
        typer.Option("--relative", metavar="A,B", help="Relative ellipsoid of two points; may repeat."),
    ] = None,
    points: Annotated[
        str | None, typer.Option("--points", metavar="A,B,...", help="Points to compare between two epochs.")
    ] = None,
    template: Annotated[
        Path | None,
        typer.Option(
            "--template",
            metavar="DIR",
            is_eager=True,
            callback=_template,
            help="Write template tables to this folder and exit.",
        ),
    ] = None,
    out: Out = None,
    threads: Threads = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Least-squares adjustment of a network, or comparison of two epochs."""
    from catseye.api import network as face
    from catseye.api.result import require_writable

    require_writable(out, network, *(() if later is None else (later,)))
    progress = ProgressLine(quiet)
    try:
        options: dict[str, Any] = {**treatment._asdict(), **claim._asdict(), "progress": progress}
        pairs = [_pair(text) for text in relative or ()]
        result = face.adjust(network, later, points=_names(points), relative=pairs, **options)
        _save(result, out, progress)
    finally:
        progress.clear()
    files = _written(out, ADJUSTED if later is None else COMPARED)
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=files)


def _save(result: "Result", out: Path | None, progress: ProgressLine) -> None:
    if out is not None and result.answered:
        from catseye.api.result import save

        save(result, out, progress=progress)


def _written(out: Path | None, files: str) -> list[tuple[str, str]]:
    return [] if out is None else [("Written to", f"{out}/: report.html, {files}")]


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [part.strip() for part in text.split(",") if part.strip()]


def _pair(text: str) -> tuple[str, str]:
    names = tuple(part.strip() for part in text.split(","))
    if len(names) != 2 or not all(names) or names[0] == names[1]:
        raise typer.BadParameter(f"{text!r} is not two points with a comma between.", param_hint="'--relative'")
    return names[0], names[1]


class _Further(NamedTuple):
    """Points of interest, and the number of further ranges."""

    interest: Annotated[
        str | None,
        typer.Option("--interest", metavar="A,B,...", help="Points that matter; all that are not held if not given."),
    ] = None
    budget_s: Annotated[
        float | None,
        typer.Option("--budget-s", callback=_positive, help="Time of every ranger for further ranges, s."),
    ] = None
    shot_s: Annotated[float, typer.Option("--shot-s", callback=_positive, help="Time of one range, s.")] = 5.0
    most: Annotated[int, typer.Option("--most", min=1, help="Further ranges to list.")] = 20


class _MonteCarlo(NamedTuple):
    """Monte Carlo runs and their blunders."""

    runs: Annotated[int, typer.Option("--runs", min=0, help="Number of simulated measurements of the network.")] = 0
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the runs.")] = 1
    air_ppm: Annotated[
        float, typer.Option("--air-ppm", min=0.0, help="Scale error of all ranges together in the runs, ppm (1σ).")
    ] = 0.0
    station_ppm: Annotated[
        float, typer.Option("--station-ppm", min=0.0, help="Scale error of each station's ranges in the runs, ppm.")
    ] = 0.0
    refraction: Annotated[
        float,
        typer.Option("--refraction", min=0.0, help="Spread of the coefficient k of refraction in the runs (1σ)."),
    ] = 0.0
    blunders_percent: Annotated[
        float,
        typer.Option(
            "--blunders-percent", min=0.0, max=30.0, help="Share of gross errors in the runs, which are rejected."
        ),
    ] = 0.0


@app.command(epilog="\b\nExamples: catseye plan networks/feed-arm.toml --budget-s 600 --shot-s 5\n"
             "          catseye plan networks/feed-arm.toml --runs 10000 --out feed-arm-plan")  # fmt: skip
@grouped
def plan(  # noqa: PLR0913 - its options are its command line
    *,
    network: Annotated[Path, typer.Argument(metavar="NETWORK", help=f"{SUFFIXES}; observed values are not used.")],
    datum: Datum = None,
    further: _Further,
    monte_carlo: _MonteCarlo,
    several: Several,
    claim: _Claim,
    out: Out = None,
    threads: Threads = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Plan of a network: predicted quality, weak points, best further ranges."""
    from catseye.api.planning import plan as planned
    from catseye.api.result import require_writable

    if several.resume and out is None:
        raise typer.BadParameter("needs --out, beside which the earlier runs are.", param_hint="'--resume'")
    require_writable(out, network)
    ledger = None if out is None else out.with_name(f"{out.name}.ledger")
    options: dict[str, Any] = {
        **further._asdict(),
        **monte_carlo._asdict(),
        **several._asdict(),
        **claim._asdict(),
        "interest": _names(further.interest),
        "ledger": ledger,
    }
    with _progress_of(monte_carlo.runs, quiet=quiet, resumable=ledger is not None) as progress:
        result = planned(network, datum=datum, progress=progress, **options)
    try:
        _save(result, out, progress)
    finally:
        progress.clear()
    files = _written(out, "points.csv, candidates.csv, plan.json")
    tell(result, json=json, quiet=quiet, strict=strict, written=files)


@contextmanager
def _progress_of(runs: int, *, quiet: bool, resumable: bool) -> Iterator[ProgressLine]:
    """Progress line of a plan, which tells of its Monte Carlo runs when it is interrupted."""
    if runs:
        with progress_of_many("run", quiet=quiet, resumable=resumable) as line:
            yield line
        return
    line = ProgressLine(quiet)
    try:
        yield line
    finally:
        line.clear()
