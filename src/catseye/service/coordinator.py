"""Assemble a coordinator: reduction, planner, guard, journal, port; run it."""

import asyncio
import gc
import sys
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from catseye.coordinator.clients.server import ZiyServer
from catseye.coordinator.control.bindings import SiteControl
from catseye.coordinator.event_log import EventLog
from catseye.coordinator.feed import MotionScript
from catseye.coordinator.guard.guard import SafetyGuard
from catseye.coordinator.journal.chain import Head
from catseye.coordinator.journal.disk import CHECK_PERIOD, DiskWatch
from catseye.coordinator.journal.entries import Entry, EpochSolution, Run
from catseye.coordinator.journal.writer import Journal, JournalSettings
from catseye.coordinator.link.settings import Address
from catseye.coordinator.modes import Mode
from catseye.coordinator.parts import Clock, Environment, ticks_now
from catseye.coordinator.plan.round import RoundPlanner, RoundSettings
from catseye.coordinator.visibility.surroundings import KeepClear
from catseye.coordinator.ziy import Coordinator, CoordinatorParts
from catseye.errors import InputError
from catseye.memory import keep_heap_small
from catseye.ranger.addresses import COORDINATOR_PORT
from catseye.ranger.door import Door
from catseye.ranger.initialisation import SiteCommands
from catseye.ranger.network import NO_TLS, ConnectionMaker, Sockets, TlsFiles
from catseye.ranger.server import LOOPBACK
from catseye.records.files.reading import read_record
from catseye.records.files.record import Certificate
from catseye.records.night.live import TICKS_PER_DAY, Severity
from catseye.records.site.folder import SiteFolder
from catseye.records.site.interlock import Interlocks
from catseye.records.site.keep_out import KeepOut
from catseye.records.site.solids import Solids
from catseye.records.site.validity import expired, expired_of_site
from catseye.reduction.live.live import Live, LiveSettings
from catseye.service.archive.samplers import SamplerArchive
from catseye.service.settings import settings_object
from catseye.service.solver import SolverProcess

SWITCH = 0.0005  # s, thread switch interval: epochs are solved beside the loop, which must not wait for them
GROUP = 0.0005  # s that a commit waits for more entries; those received during a commit are in the next
SOLVER_AFTER = 4.0  # s
SETTLE = 0.35  # s from the end of a planned move to its buffer: settling time of a mirror that starts to track
Filter = Literal["random_walk", "constant_velocity"]
Feed = tuple[str, int] | MotionScript | None
JournalTell = Callable[[str, str, Severity], None]


@dataclass(frozen=True)
class Orders:
    """Options of a coordinator.

    mode           active, passive or hold
    drop           rangers excluded from the start
    round_s        duration of a round
    filter         motion model between epochs
    journal        file or URL; None for no journal
    keep_buffers   store samples: without them a replay is not bit for bit
    rotate_gb      size at which the journal continues in another file; 0: never
    rotate_night   True to rotate at noon UTC, too
    host, port     of its own clients; port 0: any free one
    key            of the site, required at its own port and sent to those of rangers and feed; None for none
    tls            files of TLS for addresses beyond this machine
    keep_out, interlocks, solids   files; None: only the Sun is avoided, nothing obstructs
    archive_samplers   directory for FITS files of all samplers; None for none
    archive_every_s    s, of a file
    """

    mode: Mode = "active"
    drop: tuple[str, ...] = ()
    round_s: float = 10.0
    filter: Filter = "random_walk"
    journal: str | None = None
    keep_buffers: bool = True
    rotate_gb: float = 0.0
    rotate_night: bool = False
    host: str = LOOPBACK
    port: int = COORDINATOR_PORT
    key: str | None = field(default=None, repr=False)
    tls: TlsFiles = NO_TLS
    keep_out: Path | None = None
    interlocks: Path | None = None
    solids: Path | None = None
    archive_samplers: Path | None = None
    archive_every_s: float = 60.0


@dataclass(frozen=True)
class Peers:
    """Peers that a coordinator connects to.

    rangers   their addresses by name; other rangers do not belong to this coordinator
    feed      host and port of weather and telescope, a motion script, or None
    """

    rangers: Mapping[str, Address]
    feed: Feed


class NoJournal:
    """Stand-in without storage: everything is acknowledged at once."""

    trouble: str | None = None
    head: Head | None = None

    def append(self, *items: Any) -> "Future[int]":
        future: Future[int] = Future()
        future.set_result(0)
        return future

    def close(self) -> None:
        """Do nothing: no journal is open."""


class WaitingJournal:
    """A journal whose `append` waits until entries are durable.

    In virtual time no time passes meanwhile.
    """

    def __init__(self, journal: Journal):
        self._journal = journal

    @property
    def trouble(self) -> str | None:
        """Reason why writing fails at present."""
        return self._journal.trouble

    @property
    def head(self) -> Head:
        """The last durable link of the chain."""
        return self._journal.head

    def append(self, *items: Any) -> "Future[int]":
        future = self._journal.append(*items)
        with suppress(InputError):  # the future has the reason
            future.result()
        return future

    def close(self) -> None:
        self._journal.close()


class LiveCoordinator:
    """A site's coordinator, ready to run.

    peers     rangers and feed
    seed      of a simulated site, for the journal
    virtual   True for virtual time; epochs are then solved in a thread while time stands still
    tell      called at once, by any thread, with journal messages: its trouble ("journal"), and its chain's last head
              at the end ("journal-head"); heads of epochs are ordinary events

    Raises InputError: a file or a journal that cannot be used, an unknown ranger.
    """

    def __init__(
        self,
        site: SiteFolder,
        orders: Orders,
        peers: Peers,
        *,
        clock: Clock,
        seed: int | None = None,
        network: ConnectionMaker | None = None,
        virtual: bool = False,
        tell: JournalTell = lambda kind, text, severity: None,
    ):
        strange = sorted(set(orders.drop) - set(peers.rangers))
        if strange:
            raise InputError(f"drop {strange[0]}: unknown ranger (expected one of {', '.join(peers.rangers)})")
        self.site, self.orders = site, orders
        self.settings = LiveSettings(filter=orders.filter)
        self.live = Live(site, self.settings)
        keep_clear = KeepClear(site, None if orders.keep_out is None else read_record(orders.keep_out, KeepOut))
        locks = None if orders.interlocks is None else read_record(orders.interlocks, Interlocks)
        solids = None if orders.solids is None else read_record(orders.solids, Solids)
        plan = replace(RoundSettings(), period=orders.round_s, settle=SETTLE)
        self.planner = RoundPlanner(site, keep_clear=keep_clear, solids=solids, settings=plan)
        self.guard = SafetyGuard(site, keep_clear=keep_clear, interlocks=locks)
        self._tell = tell
        self._run = 0  # number of the run in the journal
        self._journal = self._opened(clock, seed, virtual, tell)
        self._solver = None if virtual else SolverProcess(self.live.site)
        self.ziy = Coordinator(
            site,
            addresses=peers.rangers,
            parts=CoordinatorParts(
                self.live,
                self.planner,
                self.guard,
                self._journal,
                None if self._solver is None else self._solver.solve,
            ),
            environment=Environment(clock, network or Sockets(orders.tls), seed or 0, orders.key),
            feed=peers.feed,
            mode=orders.mode,
            commands=SiteCommands(site).of_ranger,
        )
        files = {orders.keep_out: keep_clear.keep_out, orders.interlocks: locks, orders.solids: solids}
        self._certificates: dict[str, Certificate] = {
            str(file): record for file, record in files.items() if file is not None and record is not None
        }
        self.ziy.listeners.append(self._tell_head)
        for name in orders.drop:
            self.ziy.firing.dropped.add(name)
            self.ziy.links[name].wanted = "hold"
        door = Door(key=orders.key, tls=orders.tls)
        self.control = SiteControl(self.ziy, planner=self.planner, guard=self.guard, live=self.live)
        self.server = ZiyServer(self.ziy, orders.host, orders.port, network=network, door=door, control=self.control)
        self.archive = self._archivist(clock)

    def _opened(
        self, clock: Clock, seed: int | None, virtual: bool, tell: JournalTell
    ) -> NoJournal | Journal | WaitingJournal:
        if self.orders.journal is None:
            return NoJournal()
        journal = Journal.open(
            self.orders.journal,
            run=Run(self.site, settings=settings_object(self.settings), seed=seed),
            clock=clock,
            settings=JournalSettings(
                group=0.0 if virtual else GROUP,
                keep_buffers=self.orders.keep_buffers,
                rotate_bytes=round(self.orders.rotate_gb * 1e9),
                rotate_nightly=self.orders.rotate_night,
            ),
            on_alarm=lambda text: tell("journal", text, "alarm"),
            on_recovery=lambda text: tell("journal", text, "note"),
        )
        self._run = journal.run
        return WaitingJournal(journal) if virtual else journal

    def _archivist(self, clock: Clock) -> SamplerArchive | None:
        """Archive of the samplers, if one is asked for."""
        if self.orders.archive_samplers is None:
            return None
        log = EventLog("archive", self.ziy.clock, self.ziy.tell)
        archive = SamplerArchive(
            self.orders.archive_samplers,
            every=self.orders.archive_every_s,
            clock=clock,
            site=self.site.site.campaign.name,
            report=lambda trouble: log.standing("archive-away", trouble, "alarm", over="samplers are archived again"),
        )
        self.server.board.samplers.listeners.append(archive.add)
        return archive

    async def _start_solver(self, solver: SolverProcess) -> None:
        """Start the solver before the first epoch, after the rangers' initialisation.

        Loading takes a second or two.
        """
        await asyncio.sleep(SOLVER_AFTER)
        await asyncio.to_thread(solver.start)

    @property
    def journal_head(self) -> Head | None:
        """Head of the journal's chain; None without a journal."""
        return self._journal.head

    @property
    def journal_end(self) -> str | None:
        """Chain head and run in a line; None without a journal."""
        head = self.journal_head
        return None if head is None else f"head {head} of run {self._run}"

    def _tell_head(self, entry: Entry) -> None:
        """Publish the chain's head after each epoch, to log and subscribers.

        A copy kept elsewhere authenticates everything before it.
        """
        if isinstance(entry, EpochSolution) and self.journal_end is not None:
            log = EventLog("journal", self.ziy.clock, self.ziy.tell)
            log.tell("journal-head", self.journal_end, head=str(self.journal_head), run=float(self._run))

    def _tell_expired(self) -> None:
        """Warn of certificates not valid today; they are used all the same."""
        mjd = ticks_now(self.ziy.clock) / TICKS_PER_DAY
        log = EventLog("records", self.ziy.clock, self.ziy.tell)
        for text in (*expired_of_site(self.site, mjd), *expired(self._certificates, mjd)):
            log.tell("certificate-expired", text, "warning", always=True)

    async def _watch_disk(self, journal: Journal) -> None:
        """Predict when the journal's disk will be full, until cancelled."""
        watch = DiskWatch(EventLog("journal", self.ziy.clock, self.ziy.tell), journal.hold)
        loop = asyncio.get_running_loop()
        while True:
            path = journal.address.path
            if path is None:  # a database server watches its own disk
                return
            with suppress(OSError):  # a missing journal is reported by the writer
                self.ziy.condition.disk = watch.look(path.absolute().parent, loop.time())
            await asyncio.sleep(CHECK_PERIOD)

    @property
    def solver_pid(self) -> int | None:
        """Process id of the solver."""
        return None if self._solver is None else self._solver.pid

    async def run(
        self, started: Callable[[], None] = lambda: None, ready: Callable[[], Awaitable[None]] | None = None
    ) -> None:
        """Measure until cancelled; then switch everything off within five seconds.

        started   called when its own port answers
        ready     awaited before it connects to the rangers: they start beside it

        Raises InputError if its own port is not available.
        """
        before, loading = sys.getswitchinterval(), None
        watching = archiving = None
        keep_heap_small()
        sys.setswitchinterval(SWITCH)
        try:
            await self.server.start()
            started()
            self._tell_expired()
            if self.archive is not None:
                archiving = asyncio.ensure_future(self.archive.run())
            if isinstance(self._journal, Journal):
                watching = asyncio.ensure_future(self._watch_disk(self._journal))
            if self._solver is not None:  # beside the loop, while the mirrors go to their first targets
                loading = asyncio.gather(self._start_solver(self._solver), asyncio.to_thread(_load_kernel))
                gc.collect()
                gc.freeze()  # a full collection of a site with thousands of records takes 40 ms
            if ready is not None:
                await ready()
            await self.ziy.run()
        finally:
            if watching is not None:
                watching.cancel()
                await asyncio.gather(watching, return_exceptions=True)
            if loading is not None:
                loading.cancel()
                await asyncio.gather(loading, return_exceptions=True)
            if self._solver is not None:
                self._solver.stop()
            gc.unfreeze()
            sys.setswitchinterval(before)
            await self.server.stop()
            if self.archive is not None:
                if archiving is not None:
                    archiving.cancel()
                    await asyncio.gather(archiving, return_exceptions=True)
                await asyncio.to_thread(self.archive.finish)
                if self.archive.trouble is not None:
                    self._tell("archive", self.archive.trouble, "alarm")
            if self._journal is not None:
                with suppress(InputError):  # unwritten entries have been reported
                    await asyncio.to_thread(self._journal.close)
            if self.journal_end is not None:
                self._tell("journal-head", f"{self.journal_end}, the last one", "note")


def _load_kernel() -> None:
    """Load compiled code for the first buffer from its cache.

    It takes 0.5 s, during which the event loop would not respond.
    """
    from catseye.signal.detection.buffer_kernel import one_buffer

    one_buffer(np.zeros(64, dtype=np.int16), 16, (-32768, 32767), 0.0, 0j, np.zeros(16), np.zeros(8))
