"""The commands of networks: adjust, plan."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.option_groups import grouped
from catseye.cli.terminal import ProgressLine, say, wrapped
from catseye.cli.vocabularies import COMPONENTS, DATUMS, NETWORK_WEIGHTS, one_of
from catseye.errors import EstimationError, InputError

if TYPE_CHECKING:
    from catseye.estimation.network.model import ObservationNetwork
    from catseye.estimation.network.monte_carlo import MonteCarloScatter
    from catseye.estimation.network.plan import Candidate, Plan
    from catseye.gateways.network.findings import Findings
    from catseye.gateways.network.plan import PlanFindings
    from catseye.reduction.network import AdjustedNetwork

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
        help="free: nothing held, inner constraints on the marked points; fixed: marked points held. "
        "As the file marks it if not given.",
    ),
]
Scaled = Annotated[
    bool,
    typer.Option("--scale-by-variance-factor", help="Multiply covariances by the variance factor; tau tests."),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
]


class _Treatment(NamedTuple):
    """How the observations are treated, and what the tests and variances rest on."""

    datum: Datum = None
    scaled: Scaled = False
    reject: Annotated[
        bool, typer.Option("--reject", help="Leave out observations that the tests reject, one by one.")
    ] = False
    robust: Annotated[
        str | None,
        typer.Option(
            "--robust", metavar=NETWORK_WEIGHTS, callback=one_of(NETWORK_WEIGHTS), help="Weigh observations robustly."
        ),
    ] = None
    components: Annotated[
        str | None,
        typer.Option(
            "--components",
            metavar=COMPONENTS,
            callback=one_of(COMPONENTS),
            help="Estimate the claims themselves: constant and ppm part of each ranger, or a factor a group.",
        ),
    ] = None
    level: Annotated[
        float, typer.Option("--level", callback=_level, help="Level of the tests, of all single ones together.")
    ] = 0.05

    def adjusted(self, network: "ObservationNetwork", progress: ProgressLine) -> "AdjustedNetwork":
        """The network by least squares, its observations treated so."""
        from catseye.reduction.network import adjusted

        return adjusted(
            network,
            datum=self.datum,
            reject=self.reject,
            robust=self.robust,
            level=self.level,
            components=self.components,
            progress=progress,
        )


@app.command(epilog="\b\nExamples: catseye adjust examples/networks/feed-arm.toml --out feed-arm-report\n"
             "          catseye adjust epoch-1.gkf epoch-2.gkf --points P1,P2,P3")  # fmt: skip
@grouped
def adjust(
    *,
    network: Annotated[Path, typer.Argument(metavar="NETWORK", help=f"{SUFFIXES}.")],
    later: Annotated[
        Path | None, typer.Argument(metavar="[LATER]", help="The same network at a later epoch: what moved?")
    ] = None,
    asked: _Treatment,
    relative: Annotated[
        list[str] | None,
        typer.Option("--relative", metavar="A,B", help="Relative ellipsoid of two points; may repeat."),
    ] = None,
    points: Annotated[
        str | None, typer.Option("--points", metavar="A,B,...", help="Points to compare between two epochs.")
    ] = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A network adjusted by least squares, or two epochs of it compared."""
    if asked.reject and asked.robust is not None:
        raise typer.BadParameter("cannot go with --reject: either weigh or leave out.", param_hint="'--robust'")
    if points is not None and later is None:
        raise typer.BadParameter("needs a second network to compare with.", param_hint="'--points'")
    pairs = [_pair(text) for text in relative or ()]
    progress = ProgressLine(quiet)
    sources = [network] if later is None else [network, later]
    if out is not None:
        from catseye.gateways.writers.output import refuse_output

        for source in sources:
            refuse_output(out, source)
    try:
        from catseye.gateways.network.findings import findings
        from catseye.records.network.any_file import read_network

        treated = [asked.adjusted(_read(read_network, source), progress) for source in sources]
        epochs = [findings(t.solution, scaled=asked.scaled, level=asked.level, pairs=pairs) for t in treated]
        if later is not None:
            _compared(epochs, sources, points, asked.level, out, json, quiet, progress)
            return
        if epochs[0].answered:
            _write_adjusted(treated[0], epochs[0], network, out, progress)
    finally:
        progress.clear()
    if json or epochs[0].answered:
        _tell_adjusted(treated[0], epochs[0], json, quiet, out)
    if not epochs[0].answered:
        raise EstimationError(f"{network}: {treated[0].solution.status}")


def _pair(text: str) -> tuple[str, str]:
    names = tuple(part.strip() for part in text.split(","))
    if len(names) != 2 or not all(names) or names[0] == names[1]:
        raise typer.BadParameter(f"{text!r} is not two points with a comma between.", param_hint="'--relative'")
    return names[0], names[1]


def _read(reader: "Callable[[Path], ObservationNetwork]", source: Path) -> "ObservationNetwork":
    if not source.exists():
        raise InputError(f"{source}: missing (expected {SUFFIXES})")
    return reader(source)


def _write_adjusted(
    treated: "AdjustedNetwork", epoch: "Findings", source: Path, out: Path | None, progress: ProgressLine
) -> None:
    if out is None:
        return
    from catseye.gateways.network.files import input_hashes, write_network
    from catseye.gateways.writers.output import whole_directory

    with whole_directory(out, source) as directory:
        write_network(epoch, directory, input_hashes(source), progress=progress, treated=treated)


def _tell_adjusted(treated: "AdjustedNetwork", epoch: "Findings", json: bool, quiet: bool, out: Path | None) -> None:
    if json:
        from catseye.gateways.network.objects import network_json

        say("".join(network_json(epoch, treated=treated)).rstrip("\n"))
        return
    if quiet:
        return
    from catseye.gateways.network.summary import passages, treatment_passages

    for passage in [*passages(epoch), *treatment_passages(treated, epoch)]:
        say(wrapped(passage.title, passage.text))
    if len(epoch.names) <= 40:
        for name, x, u in zip(epoch.names, epoch.x, epoch.u, strict=True):
            axes = zip(epoch.network.axis_names, x, strict=True)
            say(
                f"{'':<14}{name:<10} "
                + "  ".join(f"{axis} {value:12.5f}" for axis, value in axes)
                + "   u "
                + ", ".join(f"{v * 1e3:.3f}" for v in u)
                + " mm"
            )
    if out is not None:
        say(wrapped("Written to", f"{out}/: report.html, coordinates.csv, observations.csv, adjustment.json, and more"))


def _compared(
    epochs: "list[Findings]",
    sources: list[Path],
    points: str | None,
    level: float,
    out: Path | None,
    json: bool,
    quiet: bool,
    progress: ProgressLine,
) -> None:
    from catseye.estimation.deformation.comparison import ComparisonOptions, compare
    from catseye.gateways.network.comparison import ComparedEpochs, comparison_object
    from catseye.gateways.writers.objects import json_line

    for one, source in zip(epochs, sources, strict=True):
        if not one.answered:
            raise EstimationError(f"{source}: {one.solution.status}")
    names = None if points is None else [p.strip() for p in points.split(",") if p.strip()]
    moved = compare(epochs[0].solution, epochs[1].solution, points=names, options=ComparisonOptions(level=level))
    compared = ComparedEpochs(epochs[0], epochs[1], moved)
    if out is not None:
        from catseye.gateways.network.files import input_hashes, write_comparison
        from catseye.gateways.writers.output import whole_directory

        hashes = {f"{k + 1}: {name}": h for k, s in enumerate(sources) for name, h in input_hashes(s).items()}
        with whole_directory(out, sources[0]) as directory:
            write_comparison(compared, directory, hashes, progress=progress)
    progress.clear()
    if json:
        say(json_line(comparison_object(compared)))
    elif not quiet:
        from catseye.gateways.network.comparison import comparison_passages

        for passage in comparison_passages(compared):
            say(wrapped(passage.title, passage.text))
        if out is not None:
            say(wrapped("Written to", f"{out}/: report.html, displacements.csv, comparison.json, and both epochs"))


class _Further(NamedTuple):
    """Which points matter, and what further ranges may cost."""

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

    def plan(self, network: "ObservationNetwork", datum: str | None) -> "tuple[Plan, tuple[Candidate, ...]]":
        """What the network is worth, and the further ranges that are worth their time most."""
        from catseye.estimation.network.plan import plan, schedule

        names = None if self.interest is None else [p.strip() for p in self.interest.split(",") if p.strip()]
        worth = plan(network, datum=datum, interest=names, most=self.most)
        if self.budget_s is None:
            return worth, ()
        return worth, schedule(worth, budget_s=self.budget_s, shot_s=self.shot_s)


class _OnPaper(NamedTuple):
    """How often the network is measured on paper, and what is wrong with it then."""

    runs: Annotated[int, typer.Option("--runs", min=0, help="Times to measure the network on paper.")] = 0
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the runs.")] = 1
    air_ppm: Annotated[
        float, typer.Option("--air-ppm", min=0.0, help="In the runs: scale error of all ranges together, ppm (1σ).")
    ] = 0.0
    station_ppm: Annotated[
        float, typer.Option("--station-ppm", min=0.0, help="In the runs: scale error of each station's ranges, ppm.")
    ] = 0.0
    refraction: Annotated[
        float,
        typer.Option("--refraction", min=0.0, help="In the runs: spread of the coefficient k of refraction (1σ)."),
    ] = 0.0
    blunders_percent: Annotated[
        float,
        typer.Option("--blunders-percent", min=0.0, max=30.0, help="In the runs: share of gross errors, rejected."),
    ] = 0.0

    def scatter(self, network: "ObservationNetwork", progress: ProgressLine) -> "MonteCarloScatter | None":
        """How far the runs' coordinates scatter; None where no run was asked for."""
        from catseye.reduction.network import measured_on_paper

        if not self.runs:
            return None
        return measured_on_paper(
            network,
            runs=self.runs,
            seed=self.seed,
            air_ppm=self.air_ppm,
            station_ppm=self.station_ppm,
            refraction=self.refraction,
            blunders=self.blunders_percent / 100.0,
            progress=progress,
        )


@app.command(epilog="\b\nExample: catseye plan examples/networks/feed-arm.toml --budget-s 600 --shot-s 5")
@grouped
def plan(
    *,
    network: Annotated[Path, typer.Argument(metavar="NETWORK", help=f"{SUFFIXES}; observed values are not used.")],
    datum: Datum = None,
    asked: _Further,
    on_paper: _OnPaper,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A network before it is measured: what it will be worth, where it is weak, what to measure next."""
    progress = ProgressLine(quiet)
    if out is not None:
        from catseye.gateways.writers.output import refuse_output

        refuse_output(out, network)
    try:
        from catseye.gateways.network.findings import findings
        from catseye.gateways.network.plan import PlanFindings
        from catseye.records.network.any_file import read_network

        observed = _read(read_network, network)
        worth, picked = asked.plan(observed, datum)
        scatter = on_paper.scatter(worth.solution.network, progress)
        plan_findings = PlanFindings(findings(worth.solution), worth, picked, scatter)
        if out is not None:
            from catseye.gateways.network.files import input_hashes
            from catseye.gateways.network.plan import write_plan
            from catseye.gateways.writers.output import whole_directory

            with whole_directory(out, network) as directory:
                write_plan(plan_findings, directory, input_hashes(network), progress=progress)
    finally:
        progress.clear()
    _tell_plan(plan_findings, json, quiet, out)


def _tell_plan(plan_findings: "PlanFindings", json: bool, quiet: bool, out: Path | None) -> None:
    if json:
        from catseye.gateways.network.plan import plan_json

        say("".join(plan_json(plan_findings)).rstrip("\n"))
        return
    if quiet:
        return
    from catseye.gateways.network.plan import plan_passages

    for passage in plan_passages(plan_findings):
        say(wrapped(passage.title, passage.text))
    if out is not None:
        say(wrapped("Written to", f"{out}/: report.html, points.csv, candidates.csv, plan.json"))
