"""Serve a site in this process until a signal: its rangers, or its coordinator."""

import asyncio
import os
import sys
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any

from catseye.clock import SystemClock
from catseye.errors import CatseyeError
from catseye.records.site.folder import SiteFolder
from catseye.service.book import RunSummary
from catseye.service.coordinator import LiveCoordinator, Orders, Peers
from catseye.service.logs import LiveLog, logging_to
from catseye.service.rangers import Listening, RangersServed
from catseye.service.running import LiveRun
from catseye.service.screen import ScreenView, SilentView
from catseye.service.watchdog import live


@dataclass(frozen=True)
class LogOptions:
    """Display of a running site on stderr.

    tell     takes each line of the log; None: no log
    json     True for a JSON object a line
    screen   True for a screen instead of the log, where stderr is a terminal
    """

    tell: Callable[[str], None] | None = None
    json: bool = False
    screen: bool = False


@dataclass(frozen=True)
class SiteEnd:
    """End of a site that was served.

    signal    number of the signal that ended it; 0 for none
    failed    True if an error ended it, which its log reported
    journal   last head of the journal's chain and its run; None without a journal
    """

    signal: int = 0
    failed: bool = False
    journal: str | None = None


def serve_coordinator(
    site: SiteFolder,
    orders: Orders,
    peers: Peers,
    *,
    offset: float = 0.0,
    seed: int | None = None,
    log_options: LogOptions = LogOptions(),
    beside: Callable[[LiveLog, asyncio.Future[int]], Coroutine[Any, Any, None]] | None = None,
) -> SiteEnd:
    """Run a coordinator with its log or screen until a signal.

    peers    rangers and feed
    offset   s, of its clock against this machine's
    seed     of a simulated site, for the journal
    beside   coroutine function that runs beside it with the log and the port of its clients: its children

    Raises CatseyeError where it cannot run; with a log in JSON, the log reports it.
    """
    clock = SystemClock(offset)
    terminal = sys.stderr is not None and sys.stderr.isatty()
    shown = log_options.screen and terminal and not log_options.json
    tell = log_options.tell if log_options.tell is not None and not shown else lambda line: None
    log = LiveLog(tell, clock=clock, json=log_options.json, colour=terminal and not log_options.json)
    view, book = ScreenView() if shown else SilentView(), RunSummary()
    ran: list[LiveCoordinator] = []

    async def work() -> None:
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

        port: asyncio.Future[int] = asyncio.get_running_loop().create_future()

        def started() -> None:
            port.set_result(running.server.port)
            log.tell("coordinator", "listens", f"its clients connect to {orders.host} port {running.server.port}")

        parts = [asyncio.ensure_future(running.run(started)), asyncio.ensure_future(live())]
        if beside is not None:
            parts.append(asyncio.ensure_future(beside(log, port)))
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
        if not log_options.json:
            raise
        log.tell("coordinator", "failed", str(problem), "alarm")
        return SiteEnd(failed=True)
    end = ran[0].journal_end if ran else None
    return SiteEnd(run.signal, journal=None if end is None else f"journal {orders.journal}: {end}")


def serve_rangers(served: RangersServed, listening: Callable[[Listening], None], *, leave_with_stdin: bool) -> SiteEnd:
    """Serve rangers until a signal.

    listening          called once with their addresses
    leave_with_stdin   True to end when standard input does, as a child of `LiveChild`
    """
    run: LiveRun[None] = LiveRun(lambda: _rangers(served, listening, leave_with_stdin))
    run.result()
    return SiteEnd(run.signal)


async def _rangers(served: RangersServed, listening: Callable[[Listening], None], with_stdin: bool) -> None:
    work = asyncio.ensure_future(served.serve(listening))
    living = None if with_stdin else asyncio.ensure_future(live())  # a child's parent notifies the service manager
    if with_stdin:
        loop = asyncio.get_running_loop()

        def readable() -> None:
            if not os.read(sys.stdin.fileno(), 4096):
                loop.remove_reader(sys.stdin)
                work.cancel()

        loop.add_reader(sys.stdin, readable)
    try:
        await work
    except asyncio.CancelledError:
        work.cancel()
        if living is not None:
            living.cancel()
        await asyncio.gather(work, return_exceptions=True)
        task = asyncio.current_task()
        if task is not None and task.cancelling():
            raise
