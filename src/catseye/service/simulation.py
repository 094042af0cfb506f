"""Simulated site: twin and coordinator, epochs compared with the truth."""

import asyncio
from collections.abc import Coroutine
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from catseye.coordinator.journal.chain import Head
from catseye.coordinator.link.settings import Address
from catseye.errors import InputError
from catseye.memory import uncollected
from catseye.records.site.folder import SiteFolder
from catseye.service.book import RunSummary
from catseye.service.comparison import TwinComparison
from catseye.service.coordinator import LiveCoordinator, Orders, Peers
from catseye.service.found import FaultFinder
from catseye.service.listening import Listening
from catseye.service.rangers import RangersServed
from catseye.service.running import FastLoop
from catseye.service.twin_process import TwinProcess
from catseye.service.views import RunControls, View
from catseye.service.warm import WarmingClock
from catseye.service.world import TwinWords, twin_heads
from catseye.simulator.clock.virtual_time import MemoryNetwork, VirtualClock

LONGEST_QUIET = 120.0  # s until the first round: cold rangers take half a minute
LOOK = 0.1  # s


@dataclass
class Simulation:
    """One simulation; afterwards results are in `book`, `seconds`, `told`, `head`.

    site         its records
    world        of the twin
    orders       of the coordinator
    minutes      of measuring; 0: for ever
    view         where it is shown
    warm         True to initialise and home the rangers before anybody connects; in virtual time
    """

    site: SiteFolder
    world: TwinWords
    orders: Orders
    minutes: float
    view: View
    warm: bool = True
    seconds: float = 0.0
    told: int = 0  # shots reported by rangers, durable or not
    head: Head | None = None  # of the journal's chain, at the end

    def __post_init__(self) -> None:
        self._twin = self.world.twin(self.site)
        self._start: float | None = None  # of measuring, by the loop's clock
        self._ended = asyncio.Event()  # by a person
        self.book = RunSummary()

    @property
    def totals(self) -> dict[str, Any]:
        """Seconds, rangers, shots and journal head for a summary."""
        rangers = set(self.site.rangers) - set(self.orders.drop)
        return {"seconds": self.seconds, "rangers": len(rangers), "told": self.told, "head": self.head}

    async def run(self, twin: TwinProcess) -> None:
        """Run in real time, the twin in its own process, until finished or cancelled.

        Raises InputError if a port or a journal is not available.
        """
        at = await _first(twin.bound(), twin.task)
        self.view.tell("starting the coordinator")
        await self._measure(peers_of(at), self.world.clock(), None, twin.task, twin)

    async def run_fast(self) -> None:
        """Run in virtual time, all in this process; needs a `FastLoop`.

        Raises InputError if a journal is not available.
        """
        loop = asyncio.get_running_loop()
        if not isinstance(loop, FastLoop):
            raise InputError("virtual time needs its own loop (expected FastLoop)")
        clock, network = VirtualClock(loop, self.world.start_mjd), MemoryNetwork()
        warming = WarmingClock(clock)
        names = self.site.rangers
        addresses: asyncio.Queue[Listening] = asyncio.Queue()
        served = RangersServed(
            self.site,
            twin_heads(self._twin, names, warming if self.warm else clock),
            clock=clock,
            twin=self._twin,
            network=network,
            warming=warming if self.warm else None,
        )
        twin = asyncio.create_task(served.serve(addresses.put_nowait, progress=self.view.progress))
        try:
            at = await _first(addresses.get(), twin)
            self.view.tell("starting the coordinator")
            await self._measure(peers_of(at), clock, network, twin, None)
        finally:
            await _cancelled(twin)

    async def _measure(
        self,
        peers: Peers,
        clock: Any,
        network: MemoryNetwork | None,
        twin: "asyncio.Task[None]",
        process: TwinProcess | None,
    ) -> None:
        with uncollected():
            running = LiveCoordinator(
                self.site,
                self.orders,
                peers,
                clock=clock,
                seed=self.world.seed,
                network=network,
                virtual=network is not None,
                tell=lambda kind, text, severity: self.view.tell(text) if kind == "journal" else None,
            )
        after = running.settings.reference_after
        finder = FaultFinder(self.world.faults, self.world.start_mjd)
        self.book = RunSummary(TwinComparison(self.site, self._twin, reference_after=after), finder)
        running.ziy.listeners.append(self._entry)
        controls = RunControls(
            stop=self._ended.set,
            span=self._span,
            may_pause=network is None,
            starting=lambda: process is not None and process.starting,
        )
        coordinator = asyncio.create_task(running.run(ready=None if process is None else process.settled))
        try:
            self.view.begin(self.book, running, controls)
            await _first(self._time(running), twin, coordinator)
        finally:
            self.view.end()  # with the picture of a site that measures
            await _cancelled(coordinator)
            self.told = running.ziy.intake.numbered
            self.head = running.journal_head

    async def _time(self, running: LiveCoordinator) -> None:
        """Wait until the minutes are over, counted from the first round, or a person ends it."""
        loop = asyncio.get_running_loop()
        start = loop.time()
        while not running.ziy.round_number and running.ziy.mode == "active" and not self._ended.is_set():
            if loop.time() - start > LONGEST_QUIET:
                raise InputError(f"no round could be planned for {LONGEST_QUIET:g} s (see the rangers' messages)")
            await asyncio.sleep(LOOK)
        self._start = loop.time()
        try:
            while not self._ended.is_set() and (not self.minutes or loop.time() - self._start < 60.0 * self.minutes):
                await asyncio.sleep(LOOK)
        finally:
            self.seconds = loop.time() - self._start

    def _span(self) -> tuple[float, float | None]:
        """Time of measuring so far, and to come, s; None: without end."""
        passed = 0.0 if self._start is None else asyncio.get_running_loop().time() - self._start
        return passed, 60.0 * self.minutes - passed if self.minutes else None

    def _entry(self, entry: Any) -> None:
        self.book.entry(entry)
        self.view.entry(entry)


def peers_of(at: Listening) -> Peers:
    """Peers of a coordinator: the rangers and the feed."""
    return Peers({name: Address(host, (first, second)) for name, (host, first, second) in at.rangers.items()}, at.feed)


async def _first(work: Coroutine[Any, Any, Any], *tasks: "asyncio.Task[Any]") -> Any:
    """Result of a coroutine, or the exception of a task that ends first."""
    task = asyncio.ensure_future(work)
    try:
        await asyncio.wait([task, *tasks], return_when=asyncio.FIRST_COMPLETED)
        for ended_task in tasks:
            if ended_task.done():
                ended_task.result()
                raise InputError("a process of the site ended unexpectedly (see its messages)")
        return task.result()
    finally:
        await _cancelled(task)


async def _cancelled(task: "asyncio.Task[Any]") -> None:
    """Cancel a task and wait for it; its exceptions are handled elsewhere."""
    task.cancel()
    with suppress(asyncio.CancelledError, InputError):
        await task
