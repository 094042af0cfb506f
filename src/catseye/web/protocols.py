"""Connections with limits of time, number and bytes, which uvicorn's own protocols lack.

A request is complete within 10 s of its connection's start or of the answer before; a client that takes nothing of an
answer, or of its events, for 20 s is cut off; there are 512 connections at most.
"""

import asyncio
import resource
import socket
import struct
from contextlib import suppress
from typing import Any

import h11
from uvicorn.config import Config
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import Server

from catseye.web.headers import HEADERS
from catseye.web.refusals import RefusalLog

REQUEST_SECONDS = 10.0  # s until a request is complete: headers and body
IDLE_SECONDS = 9  # s that a connection is open between two requests
STUCK_SECONDS = 20.0  # s in which a client takes nothing
HANDSHAKE_SECONDS = 5.0  # s of TLS
CLOSE_SECONDS = 3.0  # s until a client has answered the end of a WebSocket
PING_SECONDS = 20.0  # s between two pings of a WebSocket, and until the answer
MOST_CONNECTIONS = 512
MOST_FILES = 4096  # descriptors: connections, and what the interpreter needs
MOST_HEADER = 16_384  # bytes of headers that are not complete
LONGEST_MESSAGE = 65_536  # bytes of a client's WebSocket message
LONGEST_END = 1  # s from SIGTERM until answers under way are cut off
BACKLOG = 256  # connections not yet accepted
AT_ONCE = struct.pack("ii", 1, 0)  # struct linger: close sends a reset
INCOMPLETE = frozenset({h11.IDLE, h11.SEND_BODY})  # states of a client whose request is under way


class PageConfig(Config):
    """Configuration of uvicorn with the limits of this service.

    refusals   log of what is refused
    """

    def __init__(self, app: Any, refusals: RefusalLog, *, certificate: str | None = None, key: str | None = None):
        self.refusals = refusals
        super().__init__(
            app,
            http=LimitedHttp,
            ws=LimitedWebSocket,
            ws_max_size=LONGEST_MESSAGE,
            ws_ping_interval=PING_SECONDS,
            ws_ping_timeout=PING_SECONDS,
            ws_per_message_deflate=False,  # one encoding serves all clients
            lifespan="off",
            log_config=None,
            access_log=False,
            proxy_headers=False,
            server_header=False,
            backlog=BACKLOG,
            timeout_keep_alive=IDLE_SECONDS,
            timeout_graceful_shutdown=LONGEST_END,
            ssl_certfile=certificate,
            ssl_keyfile=key,
            h11_max_incomplete_event_size=MOST_HEADER,
        )


class _Unstuck:
    """Part of a protocol that cuts off a client which takes nothing for too long."""

    transport: Any
    loop: asyncio.AbstractEventLoop
    config: Any
    client: Any
    _stuck: asyncio.TimerHandle | None = None

    def watch_writing(self) -> None:
        """Pause as soon as the system takes no more, and resume when it has all."""
        self.transport.set_write_buffer_limits(high=1, low=0)

    def pause_writing(self) -> None:
        super().pause_writing()  # type: ignore[misc]
        self.end_stuck()
        self._stuck = self.loop.call_later(STUCK_SECONDS, self._cut_stuck)

    def resume_writing(self) -> None:
        self.end_stuck()
        super().resume_writing()  # type: ignore[misc]

    def end_stuck(self) -> None:
        """End the watch over a client that takes nothing."""
        if self._stuck is not None:
            self._stuck.cancel()
            self._stuck = None

    def _cut_stuck(self) -> None:
        self.config.refusals.refused("stuck", self.client, f"nothing taken for {STUCK_SECONDS:g} s")
        self.reset()

    def reset(self) -> None:
        """End the connection at once: what the client has not taken is thrown away by the kernel, too."""
        sock = self.transport.get_extra_info("socket")
        if sock is not None:
            with suppress(OSError):
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, AT_ONCE)
        self.transport.abort()


class LimitedHttp(_Unstuck, H11Protocol):
    """HTTP/1.1 connection whose requests and answers have a time limit."""

    config: PageConfig
    _deadline: asyncio.TimerHandle | None = None
    _begun = False  # part of a request has come

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            text = f"more than {MOST_CONNECTIONS} connections"
            self.config.refusals.refused("connections", self.client, text)
            self.reset()
            return
        self.watch_writing()
        self._wait_for_request()

    def connection_lost(self, exc: Exception | None) -> None:
        self._end_wait()
        self.end_stuck()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        self._begun = True
        super().data_received(data)
        if self.conn.their_state not in INCOMPLETE:
            self._end_wait()

    def handle_websocket_upgrade(self, event: Any) -> None:
        self._end_wait()
        super().handle_websocket_upgrade(event)

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._begun = bool(self.conn.trailing_data[0])
        if not self.transport.is_closing() and self.conn.their_state in INCOMPLETE:
            self._wait_for_request()

    def send_400_response(self, msg: str) -> None:
        self.config.refusals.refused("malformed", self.client, "no valid HTTP/1.1")
        if self.cycle is not None:
            self.cycle.disconnected = True  # an answer to the part before is not sent any more
        headers = [*HEADERS, (b"content-type", b"application/json"), (b"connection", b"close")]
        with suppress(h11.LocalProtocolError):  # an answer is under way: it ends here
            for part in (
                h11.Response(status_code=400, headers=headers, reason=b"Bad Request"),
                h11.Data(data=b'{"error": "the request is no valid HTTP/1.1"}'),
                h11.EndOfMessage(),
            ):
                self.transport.write(self.conn.send(part))
        self.transport.close()

    def _wait_for_request(self) -> None:
        self._end_wait()
        self._deadline = self.loop.call_later(REQUEST_SECONDS, self._cut_slow)

    def _end_wait(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _cut_slow(self) -> None:
        if self._begun:
            self.config.refusals.refused("slow", self.client, f"request not complete after {REQUEST_SECONDS:g} s")
        self.reset()


class LimitedWebSocket(_Unstuck, WebSocketsSansIOProtocol):
    """WebSocket whose client is cut off when it takes nothing."""

    config: PageConfig

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self.close_timeout = CLOSE_SECONDS
        self.watch_writing()

    def connection_lost(self, exc: Exception | None) -> None:
        self.end_stuck()
        super().connection_lost(exc)


class PageServer(Server):
    """uvicorn's server on one socket, which says when it listens.

    config      of this service
    listening   called once
    """

    config: PageConfig

    def __init__(self, config: PageConfig, listening: Any):
        super().__init__(config)
        self._listening = listening

    async def startup(self, sockets: Any = None) -> None:
        await self.lifespan.startup()
        allow_files(MOST_FILES)

        def protocol() -> asyncio.Protocol:
            return LimitedHttp(self.config, self.server_state, {}, asyncio.get_running_loop())

        handshake = HANDSHAKE_SECONDS if self.config.ssl is not None else None
        self.servers = [
            await asyncio.get_running_loop().create_server(
                protocol, sock=sock, ssl=self.config.ssl, backlog=BACKLOG, ssl_handshake_timeout=handshake
            )
            for sock in sockets
        ]
        self.started = True
        self._listening()


def allow_files(count: int) -> None:
    """Allow this process so many open files, as far as the system lets it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = count if hard == resource.RLIM_INFINITY else min(count, hard)
    if soft != resource.RLIM_INFINITY and soft < most:
        with suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
