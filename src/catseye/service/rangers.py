"""Serve a site's rangers from this process, with a twin's feed."""

import asyncio
import gc
import importlib
import logging
import os
import sys
from collections.abc import Callable, Coroutine, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from catseye.aliases import Progress
from catseye.clock import Clock
from catseye.errors import CatseyeError, InputError
from catseye.memory import uncollected
from catseye.ranger.addresses import PORT_BASE, Addresses, feed_address
from catseye.ranger.door import DEFAULT_ACCESS, Door
from catseye.ranger.head import RangerHead
from catseye.ranger.network import NO_TLS, ConnectionMaker, SocketListener, Sockets, TlsFiles
from catseye.ranger.ranger import Ranger
from catseye.records.site.folder import SiteFolder
from catseye.service.listening import Listening
from catseye.service.running import LiveRun, SiteEnd
from catseye.service.warm import WarmingClock, warm
from catseye.service.watchdog import live
from catseye.simulator.twin.faults import FaultBoard
from catseye.simulator.twin.feed import SiteFeed
from catseye.simulator.twin.servers import TwinSite
from catseye.simulator.twin.site import Twin

LOG = logging.getLogger(__name__)


class DeferredSockets(Sockets):
    """TCP listeners whose ports are bound at once and answer after `open`.

    Nobody can connect to rangers that are not ready.
    """

    def __init__(self, tls: TlsFiles = NO_TLS) -> None:
        super().__init__(tls)
        self._closed: list[asyncio.Server] | None = []

    async def serve(self, factory: Callable[[], asyncio.Protocol], host: str, port: int) -> SocketListener:
        if self._closed is None:
            return await super().serve(factory, host, port)
        listener = await self.listen(factory, host, port, at_once=False)
        self._closed.append(listener.server)
        return listener

    async def open(self) -> None:
        """Start accepting connections.

        Raises InputError if another process has taken a port meanwhile.
        """
        servers, self._closed = self._closed, None
        for server in servers or ():
            try:
                await server.start_serving()
            except OSError as problem:
                at = server.sockets[0].getsockname()
                where = at if isinstance(at, str) else f"{at[0]} port {at[1]}"
                raise InputError(f"{where} is not available: {problem.strerror} (expected a free one)") from problem


@dataclass(frozen=True)
class ListenAddresses:
    """Addresses for rangers to listen at.

    addresses   "loopback", a port base, 0 for any free ports
    host        of all ports; None: by `addresses`
    ports       of the only ranger served; None: by `addresses`
    door        access policy of all ports
    """

    addresses: Addresses = PORT_BASE
    host: str | None = None
    ports: tuple[int, int] | None = None
    door: Door = DEFAULT_ACCESS


USUAL_PORTS = ListenAddresses()


class RangersServed:
    """Rangers on TCP, with the twin's feed if there is a twin.

    site        its records
    heads       by ranger; only these are served
    clock       of the twin, or of the machine
    twin        source of faults and feed; None: real heads, no feed
    at          where they listen
    files       folder of initialisation files; None: a temporary one
    warming     the heads' clock: with it the rangers are ready before anybody connects
    """

    def __init__(
        self,
        site: SiteFolder,
        heads: Mapping[str, RangerHead],
        *,
        clock: Clock,
        twin: Twin | None = None,
        at: ListenAddresses = USUAL_PORTS,
        files: Path | None = None,
        network: ConnectionMaker | None = None,
        warming: WarmingClock | None = None,
    ):
        self._site, self._twin, self._warming = site, twin, warming
        self._late = DeferredSockets(at.door.tls) if network is None else None
        network = network or self._late
        start_ns = clock.now_ns()
        self._served = TwinSite(
            site,
            heads,
            world_faults=FaultBoard() if twin is None else twin.faults,
            seconds=lambda: (clock.now_ns() - start_ns) * 1e-9 if twin is None else twin.seconds(clock.now_ns()),
            addresses=at.addresses,
            files=files,
            network=network,
            door=at.door,
        )
        for name, (usual, *base_ports) in list(self._served.addresses.items()):
            first, second = at.ports or base_ports
            self._served.addresses[name] = (at.host or usual, first, second)
        self.warned: Callable[[str], None] = LOG.warning  # called with rangers that could not be made ready
        self._feed: SiteFeed | None = None
        self._feed_at = feed_address(at.addresses) if at.addresses else (feed_address()[0], 0)
        if at.host is not None:
            self._feed_at = (at.host, self._feed_at[1])
        if twin is not None:
            stations = tuple(station.name for station in site.site.weather_station)
            self._feed = SiteFeed(site.site.campaign.name, stations, twin, clock, network=network, door=at.door)

    @property
    def rangers(self) -> Mapping[str, Ranger]:
        """Rangers served, by name."""
        return self._served.rangers

    async def serve(
        self,
        listening: Callable[[Listening], None],
        *,
        bound: Callable[[Listening], None] = lambda at: None,
        progress: Progress = lambda what, done, total: None,
    ) -> None:
        """Listen, report the addresses, and serve until cancelled.

        listening   called with the addresses when they answer
        bound       called with them when the ports are taken, before the rangers are made ready
        progress    called with the number of rangers that are ready

        Raises InputError if a port or a folder is not available.
        """
        try:
            with uncollected():
                at = await self._made_ready(bound, progress)
            gc.collect()
            gc.freeze()  # thousands of cubes a ranger: a full collection takes 100 ms without answers
            listening(at)
            await asyncio.gather(self._served.serve(), *([] if self._feed is None else [self._feed.serve()]))
        finally:
            if self._feed is not None:
                await self._feed.stop()
            await self._served.stop()
            gc.unfreeze()

    async def _made_ready(self, bound: Callable[[Listening], None], progress: Progress) -> Listening:
        """Addresses of ports that answer, of rangers that are ready."""
        await self._served.start()
        feed = None
        if self._feed is not None:
            await self._feed.start(*self._feed_at)
            feed = (self._feed_at[0], self._feed.port)
        at = Listening(dict(self._served.addresses), feed)
        bound(at)
        if self._warming is not None and self._twin is not None:
            posture, rangers = self._twin.live_posture, self._served.rangers
            for text in await warm(self._site, rangers, self._warming, posture=posture, progress=progress):
                self.warned(text)
        self._served.rearm()  # the warm-up does not count for the dead-man switch
        if self._late is not None:
            await self._late.open()
        return at


def heads_of(factory: str, rangers: tuple[str, ...]) -> dict[str, RangerHead]:
    """Real heads by ranger: `package.module:factory` is called with each name.

    The current directory is searched, too. Raises InputError: no such module or factory, or it returns no head.
    """
    module, _, name = factory.partition(":")
    if not module or not name:
        raise InputError(f"head {factory!r}: expected package.module:factory")
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        head_of = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, SyntaxError) as problem:
        raise InputError(
            f"head {factory}: cannot be imported: {problem} (expected package.module:factory)"
        ) from problem
    if not callable(head_of):
        raise InputError(f"head {factory}: {name} is not callable (expected a function of a ranger's name)")
    heads: dict[str, RangerHead] = {}
    for ranger in rangers:
        try:
            head = head_of(ranger)
        except (CatseyeError, OSError) as problem:
            raise InputError(f"head {factory}: no head for {ranger}: {problem}") from problem
        missing = [
            attribute for attribute in dir(RangerHead) if not attribute.startswith("_") and not hasattr(head, attribute)
        ]
        if missing:
            raise InputError(f"head {factory}: the object for {ranger} has no {missing[0]} (expected a Head)")
        heads[ranger] = head
    return heads


def serve_rangers(
    served: RangersServed,
    listening: Callable[[Listening], None],
    *,
    leave_with_stdin: bool,
    bound: Callable[[Listening], None] = lambda at: None,
    progress: Progress = lambda what, done, total: None,
) -> SiteEnd:
    """Serve rangers until a signal.

    listening, bound, progress   as of `RangersServed.serve`
    leave_with_stdin             True to end when standard input does, as a child of `LiveChild`
    """

    def serve() -> Coroutine[Any, Any, None]:
        return _served(served.serve(listening, bound=bound, progress=progress), leave_with_stdin)

    run: LiveRun[None] = LiveRun(serve)
    run.result()
    return SiteEnd(run.signal)


async def _served(serving: Coroutine[Any, Any, None], with_stdin: bool) -> None:
    work = asyncio.ensure_future(serving)
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
