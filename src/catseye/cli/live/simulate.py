"""The command that shows it all: a whole site, simulated, its epochs held against the truth."""

import sys
from typing import TYPE_CHECKING, Annotated, Any

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
    mjd_start,
    orders_of,
    site_of,
    within,
)
from catseye.cli.terminal import say, wrapped

if TYPE_CHECKING:
    from catseye.service.simulation import Simulation, View

NIGHT = 60_635.125  # MJD: 22 h at Green Bank, no Sun and no Moon that matter
UNTIL_READY = 12.0  # s that a twin takes to start: its faults' times count from about the first round on


@app.command(
    epilog="\b\nExample: catseye simulate gbt\n"
    'With a fault: catseye simulate gbt --minutes 2 --fault "lying-station WX2 30 90 5"'
)
def simulate(  # noqa: PLR0913 - its options are its command line
    site: Site = "gbt",
    minutes: Annotated[
        float, typer.Option("--minutes", callback=within(0, 1e6, ""), help="Of measuring; 0: until Ctrl-C.")
    ] = 1.0,
    seed: Seed = 1,
    motion: MotionText = MOTION,
    fault: Faults = None,
    start: Start = None,
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
    records = site_of(site)
    from catseye.service.running import FastLoop, LiveRun
    from catseye.service.simulation import Simulation
    from catseye.service.world import TwinWords

    options: dict[str, Any] = {"seed": seed, "motion": motion, "conditions": conditions, "faults": tuple(fault or ())}
    begins = mjd_start(start, NIGHT)
    world = TwinWords(begins, **options) if fast else TwinWords.starting_now(begins, **options).late(UNTIL_READY)
    free = fast or port_base == 0
    orders = orders_of(
        drop=drop,
        round_s=round_s,
        filter=filter_,
        journal=journal,
        keep_buffers=keep_buffers,
        port=0 if port is None and free else port,
    )
    simulation = Simulation(
        records, site, world, orders, minutes, _view(json=json, quiet=quiet), port_base=port_base, warm=not cold
    )
    work = simulation.run_fast if fast else simulation.run
    run: LiveRun[None] = LiveRun(work, loop_factory=FastLoop if fast else None)
    run.result()
    _say(simulation, json=json, quiet=quiet)
    leave(run)


def _view(*, json: bool, quiet: bool) -> "View":
    """A screen on a terminal, lines where none is, nothing where none is wanted."""
    from catseye.service.screen import LinesView, ScreenView, SilentView

    if not quiet and sys.stderr is not None and sys.stderr.isatty():
        return ScreenView()
    return SilentView() if quiet or json else LinesView(say)


def _say(simulation: "Simulation", *, json: bool, quiet: bool) -> None:
    from catseye.service.objects import simulation_object, simulation_verdict, summary

    book, world, journal = simulation.book, simulation.world, simulation.orders.journal
    totals = simulation.totals
    if json:
        from catseye.gateways.writers.objects import json_line

        say(json_line(simulation_object(book, world, journal, **totals)))
    elif not quiet:
        say(wrapped("Verdict", simulation_verdict(book).text))
        for title, text in summary(book, world, journal, **totals):
            say(wrapped(title, text))
