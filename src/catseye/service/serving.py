"""A site's coordinator with its log or screen, run in this process."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import TYPE_CHECKING, Any

from catseye.clock import SystemClock
from catseye.records.site.folder import SiteFolder
from catseye.service.book import RunSummary
from catseye.service.coordinator import LiveCoordinator, Orders, Peers
from catseye.service.display import LogOptions
from catseye.service.logs import LiveLog, logging_to
from catseye.service.views import RunControls
from catseye.service.watchdog import live

if TYPE_CHECKING:
    from catseye.service.twin_process import TwinProcess

Beside = Callable[[LiveLog, "asyncio.Future[int]"], Coroutine[Any, Any, None]]


class ServedSite:
    """A coordinator that runs with its log or screen until it is cancelled.

    peers         rangers and feed
    offset        s, of its clock against this machine's
    seed          of a simulated site, for the journal
    log_options   of its display
    beside        coroutine function that runs beside it with the log and the port of its clients: its page
    """

    def __init__(
        self,
        site: SiteFolder,
        orders: Orders,
        peers: Peers,
        *,
        offset: float = 0.0,
        seed: int | None = None,
        log_options: LogOptions,
        beside: Beside | None = None,
    ):
        self._site, self._orders, self._peers, self._seed = site, orders, peers, seed
        self._clock, self._view, self._shown = SystemClock(offset), log_options.view, log_options.shown
        tell = log_options.tell if log_options.tell is not None and not log_options.shown else lambda line: None
        coloured = log_options.terminal and not log_options.json
        self.log = LiveLog(tell, clock=self._clock, json=log_options.json, colour=coloured)
        self._beside, self._book, self._ended = beside, RunSummary(), asyncio.Event()
        self._running: LiveCoordinator | None = None

    @property
    def journal_end(self) -> str | None:
        """Journal, last head of its chain and run, in a line; None without a journal."""
        end = None if self._running is None else self._running.journal_end
        return None if end is None else f"journal {self._orders.journal}: {end}"

    async def run(self, twin: "TwinProcess | None" = None) -> None:
        """Run until cancelled, or ended at the screen.

        twin   process of its rangers, waited for at the start

        Raises CatseyeError where it cannot run.
        """
        with logging_to(self.log):
            await self._run(twin)

    async def _run(self, twin: "TwinProcess | None") -> None:
        if twin is not None:
            twin.report(listens=self._twin_listens, warned=lambda line: self.log.tell("twin", "child", line, "warning"))
        self._running = running = LiveCoordinator(
            self._site, self._orders, self._peers, clock=self._clock, seed=self._seed, tell=self._told
        )
        running.ziy.listeners += [self.log.entry, *([self._entry] if self._shown else [])]

        port: asyncio.Future[int] = asyncio.get_running_loop().create_future()

        def started() -> None:
            port.set_result(running.server.port)
            text = f"its clients connect to {self._orders.host} port {running.server.port}"
            self.log.tell("coordinator", "listens", text)

        began = asyncio.get_running_loop().time()
        controls = RunControls(
            stop=self._ended.set,
            span=lambda: (asyncio.get_running_loop().time() - began, None),
            is_service=True,
            starting=lambda: twin is not None and twin.starting,
        )
        measuring = running.run(started, None if twin is None else twin.settled)
        parts = [asyncio.ensure_future(measuring), asyncio.ensure_future(live())]
        if self._beside is not None:
            parts.append(asyncio.ensure_future(self._beside(self.log, port)))
        ended = asyncio.ensure_future(self._ended.wait())
        watched = [ended, *parts, *([] if twin is None else [twin.task])]
        try:
            self._view.begin(self._book, running, controls)
            done, _ = await asyncio.wait(watched, return_when=asyncio.FIRST_COMPLETED)
            for part in done:
                part.result()
        finally:
            self._view.end()
            for part in (*parts, ended):  # the coordinator first: it switches lasers off at rangers that are there
                part.cancel()
                await asyncio.gather(part, return_exceptions=True)

    def _entry(self, entry: Any) -> None:
        self._book.entry(entry)
        self._view.entry(entry)

    def _told(self, kind: str, text: str, severity: Any) -> None:
        self.log.tell("journal", kind, text, severity)

    def _twin_listens(self) -> None:
        self.log.tell("twin", "listens", f"{len(self._peers.rangers)} rangers and the feed listen")
