"""How servers and clients reach each other: real sockets, or whatever a test or a fast run puts in their place."""

import asyncio
from collections.abc import Callable
from typing import Protocol, TypeVar

P = TypeVar("P", bound=asyncio.BaseProtocol)


class Listener(Protocol):
    """A port that is listened at; `port` is its number, also where any free one was asked for."""

    port: int

    async def close(self) -> None:
        """Listen no more; connections that stand are their owner's to close, before."""
        ...


class ConnectionMaker(Protocol):
    """Makes connections between protocols."""

    async def serve(self, factory: Callable[[], asyncio.Protocol], host: str, port: int) -> Listener:
        """Listen: a new protocol for each connection. Raises OSError: the port cannot be had."""
        ...

    async def connect(self, factory: Callable[[], P], host: str, port: int) -> P:
        """A protocol that is connected. Raises OSError: nobody listens there."""
        ...


class Sockets:
    """Connections over TCP sockets."""

    async def serve(self, factory: Callable[[], asyncio.Protocol], host: str, port: int) -> "SocketListener":
        loop = asyncio.get_running_loop()
        return SocketListener(await loop.create_server(factory, host, port))

    async def connect(self, factory: Callable[[], P], host: str, port: int) -> P:
        _, protocol = await asyncio.get_running_loop().create_connection(factory, host, port)
        return protocol


class SocketListener:
    """A TCP port that is listened at."""

    def __init__(self, server: asyncio.Server):
        self._server = server
        self.port: int = server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        self._server.close()
        await self._server.wait_closed()
