"""The command of the coordinator."""

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from catseye.cli.commands import Quiet, app
from catseye.cli.live.groups import CoordinatorOptions
from catseye.cli.live.options import Site, leave, say_now, site_of, tell_people, within
from catseye.cli.option_groups import grouped

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine

    from catseye.records.site.folder import SiteFolder
    from catseye.service.coordinator import LiveCoordinator, Orders, Peers
    from catseye.service.logs import LiveLog

LogJson = Annotated[bool, typer.Option("--log-json", help="The log as one JSON object a line.")]
Screen = Annotated[bool, typer.Option("--screen", help="A screen for an operator instead of the log; 80 x 24 or more.")]


@app.command(
    epilog="\b\nExample: catseye ziy gbt --journal night.db\n"
    "Its rangers: catseye zy gbt --twin\n"
    "Then ask it: nc 127.0.0.1 5260"
)
@grouped
def ziy(
    *,
    site: Site,
    asked: CoordinatorOptions,
    clock_offset_s: Annotated[
        float, typer.Option("--clock-offset-s", callback=within(-1e11, 1e11, " s"), help="As the twin's.")
    ] = 0.0,
    log_json: LogJson = False,
    screen: Screen = False,
    quiet: Quiet = False,
) -> None:
    """Run a site's coordinator until Ctrl-C: plan, shoot, reduce, keep a journal, tell whoever asks."""
    records = site_of(site)
    peers = asked.peers(records)
    told = Told(log_json, screen, quiet)
    run_coordinator(records, asked.orders(), peers, offset=clock_offset_s, told=told)


@dataclass(frozen=True)
class Told:
    """Choice of what a command shows of a running site.

    log_json   the log as JSON
    screen     a screen instead of the log, where stderr is a terminal
    quiet      nothing
    """

    log_json: bool = False
    screen: bool = False
    quiet: bool = False


def run_coordinator(
    site: "SiteFolder",
    orders: "Orders",
    peers: "Peers",
    *,
    offset: float = 0.0,
    seed: int | None = None,
    told: Told = Told(),
    beside: "Callable[[LiveLog], Coroutine[Any, Any, None]] | None" = None,
) -> None:
    """Run a coordinator with its log, or its screen, on stderr, until a signal.

    peers    rangers and feed
    offset   s, of its clock against this machine's
    seed     of a simulated site, for the journal
    told     what stderr shows of it
    beside   a coroutine function that runs beside it, told the log: its children
    """
    from catseye.clock import SystemClock
    from catseye.errors import CatseyeError
    from catseye.service.book import RunSummary
    from catseye.service.coordinator import LiveCoordinator
    from catseye.service.logs import LiveLog, logging_to
    from catseye.service.running import LiveRun
    from catseye.service.screen import ScreenView, SilentView
    from catseye.service.watchdog import live

    clock = SystemClock(offset)
    coloured = not told.log_json and sys.stderr is not None and sys.stderr.isatty()
    terminal = sys.stderr is not None and sys.stderr.isatty()
    shown = told.screen and terminal and not told.log_json and not told.quiet
    silent = told.quiet or shown
    log = LiveLog(lambda line: None if silent else tell_people(line), clock=clock, json=told.log_json, colour=coloured)
    view, book = ScreenView() if shown else SilentView(), RunSummary()

    ran: list[LiveCoordinator] = []

    async def work() -> None:
        import asyncio

        running = LiveCoordinator(
            site,
            orders,
            peers,
            clock=clock,
            seed=seed,
            tell=lambda kind, text, severity: log.tell("journal", kind, text, severity),
        )
        ran.append(running)
        running.ziy.listeners.append(log.entry)
        if shown:
            running.ziy.listeners += [book.entry, view.entry]
            view.begin(book, running)

        def started() -> None:
            log.tell("coordinator", "listens", f"its clients connect to {orders.host} port {running.server.port}")

        parts = [asyncio.ensure_future(running.run(started)), asyncio.ensure_future(live())]
        if beside is not None:
            parts.append(asyncio.ensure_future(beside(log)))
        try:
            done, _ = await asyncio.wait(parts, return_when=asyncio.FIRST_COMPLETED)
            for part in done:
                part.result()
        finally:
            for part in parts:  # the coordinator first: it switches lasers off at rangers that are there still
                part.cancel()
                await asyncio.gather(part, return_exceptions=True)
            view.end()

    run: LiveRun[None] = LiveRun(work)
    try:
        with logging_to(log):
            run.result()
    except CatseyeError as problem:
        if not told.log_json:
            raise
        log.tell("coordinator", "failed", str(problem), "alarm")
        raise SystemExit(1) from None
    if not told.quiet:
        _say_journal_end(orders, ran)
    leave(run, terminated=0)


def _say_journal_end(orders: "Orders", ran: "list[LiveCoordinator]") -> None:
    """The last head of the journal's chain, on stdout."""
    end = ran[0].journal_end if ran else None
    if end is not None:
        say_now(f"journal {orders.journal}: {end}")
