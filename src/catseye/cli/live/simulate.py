"""The command that shows it all: a whole site, simulated, its epochs held against the truth."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.live.options import (
    MOTION,
    PORT_BASE,
    ArchiveDirectory,
    ArchiveEveryS,
    Conditions,
    Drop,
    Faults,
    FilterName,
    JournalPlace,
    KeepBuffers,
    MotionText,
    Port,
    PortBase,
    RoundS,
    Seed,
    Site,
    Start,
    Structure,
    leave,
    within,
)
from catseye.cli.many_options import NOTHING_SAID, Several, progress_of_many, refuse_several, tell_many
from catseye.cli.option_groups import grouped
from catseye.cli.results import tell
from catseye.cli.terminal import say


@app.command(
    epilog="\b\nExample: catseye simulate gbt\n"
    'With a fault: catseye simulate gbt --minutes 2 --fault "lying-station WX2 30 90 5"\n'
    "Many nights of it: catseye simulate gbt --fast --runs 20 --out runs"
)
@grouped
def simulate(  # noqa: PLR0913 - its options are its command line
    site: Site = "gbt",
    minutes: Annotated[
        float, typer.Option("--minutes", callback=within(0, 1e6, ""), help="Minutes of measuring; 0: until Ctrl-C.")
    ] = 1.0,
    seed: Seed = 1,
    motion: MotionText = MOTION,
    faults: Faults = None,
    structure: Structure = None,
    start_mjd: Start = None,
    conditions: Conditions = "night",
    cold: Annotated[bool, typer.Option("--cold", help="Start the rangers from power-on: half a minute more.")] = False,
    drop: Drop = None,
    round_s: RoundS = 10.0,
    filter_: FilterName = "random_walk",
    journal: JournalPlace = None,
    keep_buffers: KeepBuffers = True,
    archive_samplers: ArchiveDirectory = None,
    archive_every_s: ArchiveEveryS = 60.0,
    port_base: PortBase = PORT_BASE,
    port: Port = None,
    fast: Annotated[
        bool, typer.Option("--fast", help="Virtual time: as fast as possible, reproducible, no ports.")
    ] = False,
    runs: Annotated[
        int,
        typer.Option(
            "--runs", min=1, help="Number of runs with seeds from --seed on, side by side; more than one need --fast."
        ),
    ] = 1,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Directory to write, for several runs: DIR/seed-K each, DIR/ledger what is done.",
        ),
    ] = None,
    several: Several = NOTHING_SAID,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A whole site for a minute: twin, rangers, coordinator, and how far its epochs are from the truth."""
    options: dict[str, Any] = {
        "minutes": minutes,
        "seed": seed,
        "motion": motion,
        "faults": faults or (),
        "start_mjd": start_mjd,
        "conditions": conditions,
        "cold": cold,
        "drop": drop or (),
        "round_s": round_s,
        "filter_": filter_,
        "journal": journal,
        "keep_buffers": keep_buffers,
    }
    if runs > 1:
        if not fast:
            raise typer.BadParameter("more than 1 are simulated in virtual time: add --fast.", param_hint="'--runs'")
        if archive_samplers is not None:
            raise typer.BadParameter("is for one run.", param_hint="'--archive-samplers'")
        if structure is not None:
            text = "is for one run; several have the site's own structural-model.toml."
            raise typer.BadParameter(text, param_hint="'--structure'")
        _simulate_runs(site, runs, out, {**options, **several._asdict()}, json=json, quiet=quiet)
        return
    refuse_several(several, "runs")
    if out is not None:
        raise typer.BadParameter("is for several runs; one run keeps a --journal.", param_hint="'--out'")
    from catseye.api.living import simulate as simulated

    result = simulated(
        site,
        **options,
        structure=structure,
        archive_samplers=archive_samplers,
        archive_every_s=archive_every_s,
        port_base=port_base,
        port=port,
        fast=fast,
        end_on_signals=True,
        tell=None if quiet or json else say,
        screen=not quiet and sys.stderr is not None and sys.stderr.isatty(),
    )
    tell(result, json=json, quiet=quiet)
    leave(result.signal)


def _simulate_runs(site: str, runs: int, out: Path | None, options: dict[str, Any], *, json: bool, quiet: bool) -> None:
    """Simulate several runs and say their scatter."""
    from catseye.api.scale.many_runs import simulate_runs

    with progress_of_many("run", quiet=quiet, resumable=out is not None) as line:
        many = simulate_runs(site, runs=runs, directory=out, **options, progress=line)
    tell_many(many, None if out is None else f"{out}/NAME/ for each run", json=json, quiet=quiet)
