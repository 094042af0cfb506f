"""Client of a ZY: outstanding requests, unsolicited lines, keep-alive.

Each request has a future or a callback. Both clients of a ranger hear state changes, so their TIDs must differ: give
the second another `first_tid`. Network errors raise nothing here: a lost connection answers outstanding requests with f
= 0 and the reason.
"""

import asyncio
import time
from collections.abc import Callable
from functools import partial

from catseye.errors import InputError
from catseye.ranger.commands import LONGEST_PAGE
from catseye.ranger.door import answer_to, enable_keep_alive_probes
from catseye.ranger.line import (
    FIRST_CLIENT_TID,
    LAST_TID,
    LONGEST_REPLY,
    Reply,
    Request,
    format_request,
    next_tid,
    parse_reply,
)
from catseye.ranger.network import ConnectionMaker, Sockets

SECOND_CLIENT_TID = 2**31 + FIRST_CLIENT_TID  # for the client on 5241
MOST_OUTSTANDING = 4096
KEEP_ALIVE = 60.0  # s
STREAMED = ("CMEAS", "BUF")  # replies under the TID of STM
SILENCE = 150.0  # s without a line: two keep-alives missed, the peer is lost
Listener = Callable[[Reply], None]


class ZyClient(asyncio.Protocol):
    """One connection to one ranger.

    first_tid   TID of the first request, 1000 to 4 294 967 295
    heard       called with every line that is not a reply to this client: unsolicited, and the other client's
    clock       s, monotonic
    key         of the site, to answer a server's nonce; with one, requests wait for the server's first line

    `bad_lines` counts unreadable lines; the last error is in `last_bad`.
    """

    def __init__(
        self,
        *,
        first_tid: int = FIRST_CLIENT_TID,
        heard: Listener | None = None,
        clock: Callable[[], float] = time.monotonic,
        key: str | None = None,
    ):
        if not FIRST_CLIENT_TID <= first_tid <= LAST_TID:
            raise InputError(f"first TID {first_tid} is outside {FIRST_CLIENT_TID} to {LAST_TID}")
        self._tid, self._heard, self._clock, self._key = first_tid, heard, clock, key
        self._outstanding: dict[int, tuple[str, asyncio.Future[Reply], Listener | None]] = {}
        self._transport: asyncio.Transport | None = None
        self._unread = bytearray()
        self._held: list[str] | None = None if key is None else []  # lines held until the server's first line
        self._last_sent = self._last_heard = clock()
        self.closed: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self.bad_lines, self.last_bad = 0, ""

    @classmethod
    async def connect(
        cls,
        host: str,
        port: int,
        *,
        first_tid: int = FIRST_CLIENT_TID,
        heard: Listener | None = None,
        clock: Callable[[], float] = time.monotonic,
        network: ConnectionMaker | None = None,
        key: str | None = None,
        peer: str = "ranger",
    ) -> "ZyClient":
        """A connected client, by sockets unless stated otherwise.

        peer   word for what listens, in messages

        Raises InputError if nothing listens there.
        """
        factory = partial(cls, first_tid=first_tid, heard=heard, clock=clock, key=key)
        try:
            return await (network or Sockets()).connect(factory, host, port)
        except OSError as problem:
            raise InputError(f"no {peer} answers at {host} port {port}: {problem.strerror or problem}") from problem

    def request(
        self, command: str, *parameters: object, ticks: int | None = None, then: Listener | None = None
    ) -> tuple[int, "asyncio.Future[Reply]"]:
        """Send a command at once; its TID, and a future of its first reply.

        command      name
        parameters   as sent; floats by their shortest text
        ticks        not before this time, None at once
        then         called with each reply to it, also those after the first, until `forget`

        Raises InputError: a request that cannot be a line, or too many outstanding.
        """
        if len(self._outstanding) >= MOST_OUTSTANDING:
            raise InputError(f"{MOST_OUTSTANDING} requests are outstanding (expected replies to be awaited)")
        tid = self._tid
        while tid in self._outstanding:
            tid = next_tid(tid)
        line = format_request(Request(command.upper(), tuple(str(p) for p in parameters), tid, ticks))
        future: asyncio.Future[Reply] = asyncio.get_running_loop().create_future()
        self._tid = next_tid(tid)
        self._outstanding[tid] = (command.upper(), future, then)
        if self.closed.done():
            self._answer(Reply(command.upper(), False, (self.closed.result(),), tid, None))
        else:
            self._write(line)
        return tid, future

    async def ask(self, command: str, *parameters: object, ticks: int | None = None) -> Reply:
        """First reply to a command."""
        return await self.request(command, *parameters, ticks=ticks)[1]

    async def ask_all(self, command: str, *parameters: object) -> list[Reply]:
        """All replies to a command with many, page by page.

        A VER sent after it marks the end, since replies come in order.
        """
        collected: list[Reply] = []
        while True:
            replies: list[Reply] = []
            tid, first = self.request(command, *parameters, then=replies.append)
            await self.ask("VER")
            self.forget(tid)
            collected += replies or [await first]
            if not (collected[-1].ok is True and collected[-1].values[:1] == ("more",)):
                return collected
            parameters = (collected.pop().values[1], LONGEST_PAGE)

    def forget(self, tid: int) -> None:
        """Stop waiting for further replies to a request with `then`."""
        self._outstanding.pop(tid, None)

    @property
    def outstanding(self) -> int:
        """Number of requests without an answer, or waiting for more replies."""
        return len(self._outstanding)

    def check(self) -> None:
        """Send keep-alive and detect silence; call it every few seconds."""
        time_s = self._clock()
        if time_s - self._last_heard > SILENCE:
            self.close(f"nothing heard for {SILENCE:g} s")
        elif time_s - self._last_sent >= KEEP_ALIVE:
            self._write("")

    def close(self, why: str = "closed by this client") -> None:
        """Close the connection; outstanding requests are answered with f = 0."""
        if not self.closed.done():
            self.closed.set_result(why)
        if self._transport is not None:
            self._transport.abort()
        for tid, (command, _, _) in list(self._outstanding.items()):
            self._answer(Reply(command, False, (why,), tid, None))
        self._outstanding.clear()

    # asyncio's side -------------------------------------------------------------------------------------------------

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        enable_keep_alive_probes(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        self.close("connection lost" if exc is None else f"connection lost: {exc}")

    def data_received(self, data: bytes) -> None:
        self._last_heard = self._clock()
        self._unread += data
        *lines, remainder = self._unread.split(b"\n")
        self._unread = bytearray(remainder)
        for line in lines:
            self._line(line.removesuffix(b"\r").decode("ascii", "replace"))
        if len(self._unread) > LONGEST_REPLY:
            self.close(f"received a line longer than {LONGEST_REPLY} bytes")

    def _line(self, line: str) -> None:
        try:
            reply = parse_reply(line)
        except InputError as problem:
            self.bad_lines, self.last_bad = self.bad_lines + 1, str(problem)
            return
        if reply is None:
            return
        if reply.command == "NONCE" and reply.ok and len(reply.values) == 1:
            if self._key is None:
                self.close("the port asks for the site's key (expected CATSEYE_KEY or CATSEYE_KEY_FILE)")
                return
            self._send(f"KEY {answer_to(reply.values[0], self._key)}")
        waiting, self._held = self._held or [], None
        for waiting_line in waiting:
            self._send(waiting_line)
        self._answer(reply)

    def _answer(self, reply: Reply) -> None:
        command, future, callback = self._outstanding.get(reply.tid, ("", None, None))
        expected = reply.command in (command, "UNKNOWN") or (command == "STM" and reply.command in STREAMED)
        if future is None or not expected:
            if self._heard is not None:
                self._heard(reply)
            return
        if callback is None:
            del self._outstanding[reply.tid]
        else:
            callback(reply)
        if not future.done():
            future.set_result(reply)

    def _write(self, line: str) -> None:
        if self._held is None:
            self._send(line)
        else:
            self._held.append(line)

    def _send(self, line: str) -> None:
        self._last_sent = self._clock()
        if self._transport is not None and not self._transport.is_closing():
            self._transport.write(line.encode("ascii") + b"\n")
