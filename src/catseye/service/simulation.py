"""A whole site, simulated: the twin beside, the coordinator here, and each epoch held against the truth."""

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
from catseye.service.book import LiveBook
from catseye.service.child import LiveChild
from catseye.service.comparison import TwinComparison
from catseye.service.coordinator import LiveCoordinator, Orders, Peers
from catseye.service.found import FaultFinder
from catseye.service.rangers import Listening, RangersServed
from catseye.service.running import FastLoop
from catseye.service.warm import WarmingClock
from catseye.service.world import TwinWords, twin_heads
from catseye.simulator.clock.virtual_time import MemoryNetwork, VirtualClock

LONGEST_QUIET = 120.0  # s until the first round: rangers that were not warmed take half a minute
LOOK = 0.1  # s


class View(Protocol):
    """What somebody sees of it."""

    def tell(self, text: str) -> None:
        """How the start goes, in a word."""
        ...

    def begin(self, book: LiveBook, running: LiveCoordinator) -> None:
        """The coordinator is there."""
        ...

    def entry(self, entry: Any) -> None:
        """Something was made durable; the book has it."""
        ...

    def end(self) -> None:
        """Note that nothing more comes."""
        ...


@dataclass
class Simulation:
    """One run; what it came to is in `book`, `seconds`, `told`, `journal` afterwards.

    site, name   its records, and what the user called it
    world        of the twin
    orders       of the coordinator
    minutes      of measuring; 0: for ever
    port_base    of rangers and feed; 0: any free ports
    warm         the rangers are initialised and homed before anybody connects
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
    told: int = 0  # shots that rangers told of, durable or not
    head: Head | None = None  # of the journal's chain, at the end

    def __post_init__(self) -> None:
        self._twin = self.world.twin(self.site)
        self.book = LiveBook()

    @property
    def totals(self) -> dict[str, Any]:
        """Seconds measured, rangers that were not left out, shots told of: what a summary needs beside the book."""
        rangers = set(self.site.rangers) - set(self.orders.drop)
        return {"seconds": self.seconds, "rangers": len(rangers), "told": self.told, "head": self.head}

    async def run(self) -> None:
        """In real time, the twin in a process of its own; until the minutes are over, or cancelled.

        Raises InputError: a port or a journal that cannot be had.
        """
        heard: asyncio.Queue[Listening] = asyncio.Queue()
        child = LiveChild(
            "twin",
            [*twin_arguments(self.name, self.world, self.port_base), *([] if self.warm else ["--cold"])],
            said=lambda line: heard.put_nowait(listening_of(line)),
            warned=lambda line: self.view.tell(f"twin: {line}"),
        )
        self.view.tell("starting the twin")
        twin = asyncio.create_task(child.keep())
        try:
            at = await _first(heard.get(), twin)
            self.view.tell("starting the coordinator")
            await self._measure(peers_of(at), self.world.clock(), None, twin)
        finally:
            await _ended(twin)

    async def run_fast(self) -> None:
        """In virtual time, all in this process: the loop must be a `FastLoop`.

        Raises InputError: a journal that cannot be had.
        """
        loop = asyncio.get_running_loop()
        if not isinstance(loop, FastLoop):
            raise InputError("virtual time needs its own loop (expected FastLoop)")
        clock, network = VirtualClock(loop, self.world.start_mjd), MemoryNetwork()
        warming = WarmingClock(clock)
        names = self.site.rangers
        heard: asyncio.Queue[Listening] = asyncio.Queue()
        self.view.tell("starting the twin")
        served = RangersServed(
            self.site,
            twin_heads(self._twin, names, warming if self.warm else clock),
            clock=clock,
            twin=self._twin,
            network=network,
            warming=warming if self.warm else None,
        )
        twin = asyncio.create_task(served.serve(heard.put_nowait))
        try:
            at = await _first(heard.get(), twin)
            self.view.tell("starting the coordinator")
            await self._measure(peers_of(at), clock, network, twin)
        finally:
            await _ended(twin)

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
        self.book = LiveBook(TwinComparison(self.site, self._twin, reference_after=after), finder)
        running.ziy.listeners.append(self._entry)
        self.view.begin(self.book, running)
        coordinator = asyncio.create_task(running.run())
        try:
            await _first(self._time(running), twin, coordinator)
        finally:
            await _ended(coordinator)
            self.told = running.ziy.intake.numbered
            self.head = running.journal_head
            self.view.end()

    async def _time(self, running: LiveCoordinator) -> None:
        """Until the minutes are over, counted from the first round on."""
        loop = asyncio.get_running_loop()
        began = loop.time()
        while not running.ziy.round_number and running.orders.mode == "active":
            if loop.time() - began > LONGEST_QUIET:
                raise InputError(f"no round could be planned for {LONGEST_QUIET:g} s (see what the rangers say)")
            await asyncio.sleep(LOOK)
        began = loop.time()
        try:
            while not self.minutes or loop.time() - began < 60.0 * self.minutes:
                await asyncio.sleep(LOOK)
        finally:
            self.seconds = loop.time() - began

    def _entry(self, entry: Any) -> None:
        self.book.entry(entry)
        self.view.entry(entry)


def twin_arguments(name: str, world: TwinWords, port_base: int) -> list[str]:
    """Of `catseye`, for a child that serves all rangers of a twin and says where in one JSON line."""
    return ["zy", name, *world.options(), f"--port-base={port_base}", "--json", "--leave-with-stdin"]


def listening_of(line: str) -> Listening:
    """Where a child says that it listens. Raises InputError for any other line."""
    try:
        stored = json.loads(line)
        rangers = {str(name): (str(host), int(a), int(b)) for name, (host, a, b) in stored["rangers"].items()}
        feed = None if stored["feed"] is None else (str(stored["feed"][0]), int(stored["feed"][1]))
    except (ValueError, KeyError, TypeError) as problem:
        raise InputError(f"the twin said {line[:80]!a} (expected where it listens)") from problem
    return Listening(rangers, feed)


def peers_of(at: Listening) -> Peers:
    """Whom a coordinator connects to: rangers as they listen, and the feed."""
    return Peers({name: Address(host, (first, second)) for name, (host, first, second) in at.rangers.items()}, at.feed)


async def _first(work: Coroutine[Any, Any, Any], *others: "asyncio.Task[Any]") -> Any:
    """What a coroutine gives, unless one of some tasks ends before: then its exception."""
    task = asyncio.ensure_future(work)
    try:
        await asyncio.wait([task, *others], return_when=asyncio.FIRST_COMPLETED)
        for other in others:
            if other.done():
                other.result()
                raise InputError("a part of the site ended by itself (see what it said)")
        return task.result()
    finally:
        await _ended(task)


async def _ended(task: "asyncio.Task[Any]") -> None:
    """Cancelled, and over; what it raised has been seen, or is seen by who waits for it."""
    task.cancel()
    with suppress(asyncio.CancelledError, InputError):
        await task
