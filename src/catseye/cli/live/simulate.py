"""The command that shows it all: a whole site, simulated, its epochs held against the truth."""

import sys
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.live.options import (
    MOTION,
    PORT_BASE,
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
    leave,
    within,
)
from catseye.cli.results import tell
from catseye.cli.terminal import say


@app.command(
    epilog="\b\nExample: catseye simulate gbt\n"
    'With a fault: catseye simulate gbt --minutes 2 --fault "lying-station WX2 30 90 5"'
)
def simulate(  # noqa: PLR0913 - its options are its command line
    site: Site = "gbt",
    minutes: Annotated[
        float, typer.Option("--minutes", callback=within(0, 1e6, ""), help="Minutes of measuring; 0: until Ctrl-C.")
    ] = 1.0,
    seed: Seed = 1,
    motion: MotionText = MOTION,
    faults: Faults = None,
    start_mjd: Start = None,
    conditions: Conditions = "night",
    cold: Annotated[bool, typer.Option("--cold", help="Rangers are just powered on: half a minute more.")] = False,
    drop: Drop = None,
    round_s: RoundS = 10.0,
    filter_: FilterName = "random_walk",
    journal: JournalPlace = None,
    keep_buffers: KeepBuffers = True,
    port_base: PortBase = PORT_BASE,
    port: Port = None,
    fast: Annotated[
        bool, typer.Option("--fast", help="Virtual time: as fast as it goes, the same each time, no ports.")
    ] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A whole site for a minute: twin, rangers, coordinator, and how far its epochs are from the truth."""
    from catseye.api.living import simulate as simulated

    result = simulated(
        site,
        minutes=minutes,
        seed=seed,
        motion=motion,
        faults=faults or (),
        start_mjd=start_mjd,
        conditions=conditions,
        cold=cold,
        drop=drop or (),
        round_s=round_s,
        filter_=filter_,
        journal=journal,
        keep_buffers=keep_buffers,
        port_base=port_base,
        port=port,
        fast=fast,
        end_on_signals=True,
        tell=None if quiet or json else say,
        screen=not quiet and sys.stderr is not None and sys.stderr.isatty(),
    )
    tell(result, json=json, quiet=quiet)
    leave(result.signal)
