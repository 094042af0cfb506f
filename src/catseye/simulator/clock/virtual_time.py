"""Virtual time: an event loop whose clock jumps to the next timer.

The same servers, clients and coordinator run in it as in real time, without sockets (`MemoryNetwork`) and
deterministically: callbacks run in the order of their requests, and no time passes while they run.

    loop = VirtualLoop()
    clock = VirtualClock(loop, start_mjd=52889.125)
    loop.run_until_complete(story(clock, MemoryNetwork()))

Work outside (a thread, a process, a real socket) takes no virtual time. Jobs of `run_in_executor` are awaited
before time jumps; for any other work outside use: `with loop.outside(): await asyncio.wrap_future(f)`.
"""

import asyncio
import selectors
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from catseye.errors import CatseyeError
from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND

RESOLUTION = 5e-10  # s
P = TypeVar("P", bound=asyncio.BaseProtocol)


class _Jumping(selectors.DefaultSelector):
    """Selector that jumps instead of waiting; holds the loop's time, ns from 0."""

    def __init__(self) -> None:
        super().__init__()
        self.now_ns = 0
        self.outside = 0
        self.due: Callable[[], float | None] = lambda: None  # when the next timer is, None where something is ready

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = super().select(0)
        due = self.due()
        if ready or (timeout is not None and due is None):
            return ready
        if self.outside:
            return super().select(None)  # a finished thread writes to the loop's pipe
        if timeout is None or due is None:
            raise CatseyeError("deadlock: no timer is set and nothing is ready (expected either)")
        self.now_ns = max(self.now_ns, round(due * PER_SECOND))
        while self.now_ns / PER_SECOND + RESOLUTION <= due:  # a double's steps are longer than 1 ns after three months
            self.now_ns += 1
        return []


class VirtualLoop(asyncio.SelectorEventLoop):
    """Event loop in virtual time, which begins at 0."""

    def __init__(self) -> None:
        self._jumping = _Jumping()
        super().__init__(self._jumping)
        self._clock_resolution = RESOLUTION  # no timer is early, not even by a nanosecond
        self._jumping.due = self._due

    def _due(self) -> float | None:
        """Time of the next timer; None where time must not move.

        asyncio caps the timeout of its selector at a day.
        """
        if self._ready or self._stopping or not self._scheduled:  # type: ignore[attr-defined]
            return None
        return float(self._scheduled[0]._when)  # type: ignore[attr-defined]

    def time(self) -> float:
        """Seconds of virtual time since the start."""
        return self._jumping.now_ns / PER_SECOND

    @property
    def now_ns(self) -> int:
        """Virtual time in whole nanoseconds."""
        return self._jumping.now_ns

    @contextmanager
    def outside(self) -> Iterator[None]:
        """Stop virtual time while something outside the loop is awaited."""
        self._jumping.outside += 1
        try:
            yield
        finally:
            self._jumping.outside -= 1

    def run_in_executor(  # type: ignore[override]
        self, executor: Any, func: Callable[..., Any], *args: Any
    ) -> "asyncio.Future[Any]":
        """Run in an executor; virtual time stops until it is done."""
        future = super().run_in_executor(executor, func, *args)
        self._jumping.outside += 1
        future.add_done_callback(self._came_back)
        return future

    def _came_back(self, _: "asyncio.Future[Any]") -> None:
        self._jumping.outside -= 1


class VirtualClock:
    """UTC of a simulated world in virtual time.

    loop        source of the time
    start_mjd   MJD when the loop's time is 0
    """

    def __init__(self, loop: VirtualLoop, start_mjd: float):
        self._loop, self._start = loop, round(start_mjd * PER_DAY)

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0."""
        return self._start + self._loop.now_ns


class MemoryNetwork:
    """Network connections without sockets, delivered in order after `latency` s.

    latency   s, one way
    """

    def __init__(self, latency: float = 0.0):
        self.latency = latency
        self._listeners: dict[tuple[str, int], Callable[[], asyncio.Protocol]] = {}
        self._next_port = 49_152

    async def serve(self, factory: Callable[[], asyncio.Protocol], host: str, port: int) -> "MemoryListener":
        """Listen; port 0 takes a free one. Raises OSError if taken."""
        if port == 0:
            port, self._next_port = self._next_port, self._next_port + 1
        if (host, port) in self._listeners:
            raise OSError(98, "address already in use")
        self._listeners[host, port] = factory
        return MemoryListener(self, host, port)

    async def connect(self, factory: Callable[[], P], host: str, port: int) -> P:
        """Connected near end. Raises ConnectionRefusedError if nobody listens."""
        accepting = self._listeners.get((host, port))
        if accepting is None:
            raise ConnectionRefusedError(111, "connection refused")
        loop = asyncio.get_running_loop()
        near, far = factory(), accepting()
        local, remote = MemoryTransport(loop, near, self.latency), MemoryTransport(loop, far, self.latency)
        local.peer, remote.peer = remote, local
        near.connection_made(local)
        far.connection_made(remote)
        await asyncio.sleep(0)
        return near

    def forget(self, host: str, port: int) -> None:
        """Stop listening at an address."""
        self._listeners.pop((host, port), None)


class MemoryListener:
    """Listening port of a `MemoryNetwork`."""

    def __init__(self, network: MemoryNetwork, host: str, port: int):
        self._network, self._host, self.port = network, host, port

    async def close(self) -> None:
        self._network.forget(self._host, self.port)


class MemoryTransport(asyncio.Transport):
    """One end of a connection: `write` queues for the peer.

    Bytes not taken by a paused peer count as unsent.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, protocol: asyncio.BaseProtocol, latency: float):
        super().__init__()
        self._loop, self._protocol, self._latency = loop, protocol, latency
        self.peer: MemoryTransport | None = None
        self._sent: deque[bytes] = deque()  # on the way to the peer
        self._unsent = 0  # bytes of them
        self._arrived = 0  # of them that have reached the peer, which may be paused
        self._reading, self._closing, self._lost = True, False, False

    def write(self, data: bytes | bytearray | memoryview) -> None:
        if self._closing or not data:
            return
        self._sent.append(bytes(data))
        self._unsent += len(data)
        self._later(self._arrive)

    def close(self) -> None:
        """Close once all written data has arrived."""
        if not self._closing:
            self._closing = True
            self._later(self._finish)

    def abort(self) -> None:
        """Close immediately; data in transit is lost."""
        if not self._lost:
            self._forget()
            self._closing = True
            self._loop.call_soon(self._lose)
            if self.peer is not None:
                self._later(self.peer._lose)

    def is_closing(self) -> bool:
        return self._closing

    def pause_reading(self) -> None:
        self._reading = False

    def resume_reading(self) -> None:
        self._reading = True
        if self.peer is not None:
            self._loop.call_soon(self.peer._deliver)

    def is_reading(self) -> bool:
        return self._reading and not self._closing

    def get_write_buffer_size(self) -> int:
        """Number of bytes the peer has not taken."""
        return self._unsent

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        return ("memory", 0) if name in ("peername", "sockname") else default

    def _later(self, call: Callable[[], None]) -> None:
        if self._latency > 0.0:
            self._loop.call_later(self._latency, call)
        else:
            self._loop.call_soon(call)

    def _arrive(self) -> None:
        self._arrived += 1
        self._deliver()

    def _deliver(self) -> None:
        peer = self.peer
        while peer is not None and self._arrived and self._sent and peer._reading and not peer._lost:
            self._arrived -= 1
            data = self._sent.popleft()
            self._unsent -= len(data)
            if not peer._closing and isinstance(peer._protocol, asyncio.Protocol):
                peer._protocol.data_received(data)
        if self._closing and not self._sent:
            self._finish()

    def _finish(self) -> None:
        """Deliver the end of the stream."""
        if self._lost or (self._sent and self.peer is not None and not self.peer._lost):
            return
        self._lose()
        if self.peer is not None:
            self.peer._lose()

    def _lose(self) -> None:
        if not self._lost:
            self._lost = self._closing = True
            self._forget()
            self._protocol.connection_lost(None)

    def _forget(self) -> None:
        self._sent.clear()
        self._unsent = 0
