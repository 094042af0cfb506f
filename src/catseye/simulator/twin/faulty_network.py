"""Faulty connections of one ranger: lines late or lost in both directions."""

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from catseye.ranger.network import ConnectionMaker, Listener, P


@dataclass
class Gate:
    """Present faults of a ranger's connections.

    hung      incoming data are taken and dropped, outgoing dropped
    delay     s, delay of every write
    open      the open connections
    """

    hung: bool = False
    delay: float = 0.0
    open: set[asyncio.Transport] = field(default_factory=set)

    def cut(self) -> None:
        """Break every connection at once."""
        for transport in tuple(self.open):
            transport.abort()


class FaultyNetwork:
    """Network whose connections to a server pass a gate.

    network   the underlying network
    gate      the present faults
    """

    def __init__(self, network: ConnectionMaker, gate: Gate):
        self._network, self._gate = network, gate

    async def serve(self, factory: Callable[[], asyncio.Protocol], host: str, port: int) -> Listener:
        return await self._network.serve(lambda: _Gated(factory(), self._gate), host, port)

    async def connect(self, factory: Callable[[], P], host: str, port: int) -> P:
        return await self._network.connect(factory, host, port)


class _Gated(asyncio.Protocol):
    """Filter in front of a server's protocol."""

    def __init__(self, inner: asyncio.Protocol, gate: Gate):
        self._inner, self._gate = inner, gate
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._gate.open.add(transport)
        self._inner.connection_made(_LateTransport(transport, self._gate))

    def data_received(self, data: bytes) -> None:
        if not self._gate.hung:
            self._inner.data_received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        if self._transport is not None:
            self._gate.open.discard(self._transport)
        self._inner.connection_lost(exc)


class _LateTransport(asyncio.Transport):
    """Transport that passes writes on after the gate's delay, in order."""

    def __init__(self, transport: asyncio.Transport, gate: Gate):
        super().__init__()
        self._transport, self._gate = transport, gate
        self._late: deque[bytes] = deque()
        self._last_due = 0.0
        self._closing = False

    def write(self, data: bytes | bytearray | memoryview) -> None:
        if self._gate.hung or self._closing:
            return
        if self._gate.delay <= 0.0 and not self._late:
            self._transport.write(data)
            return
        loop = asyncio.get_running_loop()
        self._last_due = max(self._last_due, loop.time() + self._gate.delay)
        self._late.append(bytes(data))
        loop.call_at(self._last_due, self._pass_on)

    def _pass_on(self) -> None:
        if self._late:
            self._transport.write(self._late.popleft())
        if self._closing and not self._late:
            self._transport.close()

    def close(self) -> None:
        self._closing = True
        if not self._late:
            self._transport.close()

    def abort(self) -> None:
        self._closing = True
        self._late.clear()
        self._transport.abort()

    def is_closing(self) -> bool:
        return self._closing or self._transport.is_closing()

    def pause_reading(self) -> None:
        self._transport.pause_reading()

    def resume_reading(self) -> None:
        self._transport.resume_reading()

    def is_reading(self) -> bool:
        return self._transport.is_reading()

    def get_write_buffer_size(self) -> int:
        return self._transport.get_write_buffer_size() + sum(map(len, self._late))

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        return self._transport.get_extra_info(name, default)
