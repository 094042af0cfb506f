"""Simulated site: twin and coordinator, epochs compared with the truth."""

import asyncio
import json
from collections.abc import Coroutine
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Protocol

from catseye.coordinator.journal.chain import Head
from catseye.coordinator.link.settings import Address
from catseye.errors import InputError
from catseye.ranger.addresses import PORT_BASE
from catseye.records.site.folder import SiteFolder
from catseye.service.book import RunSummary
from catseye.service.child import LiveChild
from catseye.service.comparison import TwinComparison
from catseye.service.coordinator import LiveCoordinator, Orders, Peers
from catseye.service.found import FaultFinder
from catseye.service.rangers import Listening, RangersServed
from catseye.service.running import FastLoop
from catseye.service.warm import WarmingClock
from catseye.service.world import TwinWords, twin_heads
from catseye.simulator.clock.virtual_time import MemoryNetwork, VirtualClock

LONGEST_QUIET = 120.0  # s until the first round: cold rangers take half a minute
LOOK = 0.1  # s


class View(Protocol):
    """Display of a simulation."""

    def tell(self, text: str) -> None:
        """Show a message during the start."""
        ...

    def begin(self, book: RunSummary, running: LiveCoordinator) -> None:
        """Begin to show a coordinator."""
        ...

    def entry(self, entry: Any) -> None:
        """Show a durable entry that the book has."""
        ...

    def end(self) -> None:
        """Stop: no more entries will come."""
        ...


@dataclass
class Simulation:
    """One simulation; afterwards results are in `book`, `seconds`, `told`, `head`.

    site, name   its records, and the user's name of it
    world        of the twin
    orders       of the coordinator
    minutes      of measuring; 0: for ever
    port_base    of rangers and feed; 0: any free ports
    warm         True to initialise and home the rangers before anybody connects
    """

    site: SiteFolder
    name: str
    world: TwinWords
    orders: Orders
    minutes: float
    view: View
    port_base: int = PORT_BASE
    warm: bool = True
    seconds: float = 0.0
    told: int = 0  # shots reported by rangers, durable or not
    head: Head | None = None  # of the journal's chain, at the end

    def __post_init__(self) -> None:
        self._twin = self.world.twin(self.site)
        self.book = RunSummary()

    @property
    def totals(self) -> dict[str, Any]:
        """Seconds, rangers, shots and journal head for a summary."""
        rangers = set(self.site.rangers) - set(self.orders.drop)
        return {"seconds": self.seconds, "rangers": len(rangers), "told": self.told, "head": self.head}

    async def run(self) -> None:
        """Run in real time, the twin in its own process, until finished or cancelled.

        Raises InputError if a port or a journal is not available.
        """
        addresses: asyncio.Queue[Listening] = asyncio.Queue()
        child = LiveChild(
            "twin",
            [*twin_arguments(self.name, self.world, self.port_base), *([] if self.warm else ["--cold"])],
            said=lambda line: addresses.put_nowait(listening_of(line)),
            warned=lambda line: self.view.tell(f"twin: {line}"),
        )
        self.view.tell("starting the twin")
        twin = asyncio.create_task(child.keep())
        try:
            at = await _first(addresses.get(), twin)
            self.view.tell("starting the coordinator")
            await self._measure(peers_of(at), self.world.clock(), None, twin)
        finally:
            await _cancelled(twin)

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
        self.view.tell("starting the twin")
        served = RangersServed(
            self.site,
            twin_heads(self._twin, names, warming if self.warm else clock),
            clock=clock,
            twin=self._twin,
            network=network,
            warming=warming if self.warm else None,
        )
        twin = asyncio.create_task(served.serve(addresses.put_nowait))
        try:
            at = await _first(addresses.get(), twin)
            self.view.tell("starting the coordinator")
            await self._measure(peers_of(at), clock, network, twin)
        finally:
            await _cancelled(twin)

    async def _measure(
        self,
        peers: Peers,
        clock: Any,
        network: MemoryNetwork | None,
        twin: "asyncio.Task[None]",
    ) -> None:
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
        self.view.begin(self.book, running)
        coordinator = asyncio.create_task(running.run())
        try:
            await _first(self._time(running), twin, coordinator)
        finally:
            await _cancelled(coordinator)
            self.told = running.ziy.intake.numbered
            self.head = running.journal_head
            self.view.end()

    async def _time(self, running: LiveCoordinator) -> None:
        """Wait until the minutes are over, counted from the first round."""
        loop = asyncio.get_running_loop()
        start = loop.time()
        while not running.ziy.round_number and running.orders.mode == "active":
            if loop.time() - start > LONGEST_QUIET:
                raise InputError(f"no round could be planned for {LONGEST_QUIET:g} s (see the rangers' messages)")
            await asyncio.sleep(LOOK)
        start = loop.time()
        try:
            while not self.minutes or loop.time() - start < 60.0 * self.minutes:
                await asyncio.sleep(LOOK)
        finally:
            self.seconds = loop.time() - start

    def _entry(self, entry: Any) -> None:
        self.book.entry(entry)
        self.view.entry(entry)


def twin_arguments(name: str, world: TwinWords, port_base: int) -> list[str]:
    """Arguments of `catseye` for a child that serves a twin's rangers.

    It reports its addresses in one JSON line.
    """
    return ["zy", name, *world.options(), f"--port-base={port_base}", "--json", "--leave-with-stdin"]


def listening_of(line: str) -> Listening:
    """Addresses in a child's first line.

    Raises InputError for any other line.
    """
    try:
        stored = json.loads(line)
        rangers = {str(name): (str(host), int(a), int(b)) for name, (host, a, b) in stored["rangers"].items()}
        feed = None if stored["feed"] is None else (str(stored["feed"][0]), int(stored["feed"][1]))
    except (ValueError, KeyError, TypeError) as problem:
        raise InputError(f"the twin printed {line[:80]!a} (expected its addresses)") from problem
    return Listening(rangers, feed)


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
