"""A client of a ZY: many requests outstanding, a future or a callback each, unsolicited lines, keep-alive.

Both clients of a ranger hear what is done, so their TIDs must differ: give the second another `first_tid`. Nothing here
raises for what the network does: a lost connection answers what is outstanding with f = 0 and says why.
"""

import asyncio
import time
from collections.abc import Callable
from functools import partial

from catseye.errors import InputError
from catseye.ranger.commands import LONGEST_PAGE
from catseye.ranger.door import answer_to, notice_death
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
STREAMED = ("CMEAS", "BUF")  # what comes under the TID of STM
SILENCE = 150.0  # s without a line: two keep-alives missed, the peer is gone
Listener = Callable[[Reply], None]


class ZyClient(asyncio.Protocol):
    """One connection to one ranger.

    first_tid   TID of the first request, 1000 to 4 294 967 295
    heard       called with every line that is no reply to this client: unsolicited, and the other client's
    clock       s, never backwards
    key         of the site, by which a server's nonce is answered; with one, requests wait for the server's first line

    `bad_lines` counts lines that could not be read; the last is in `last_bad`.
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
        self._held: list[str] | None = None if key is None else []  # lines until the server has said its first
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
    ) -> "ZyClient":
        """A client that is connected, by sockets unless told otherwise.

        Raises InputError where nobody listens there.
        """
        factory = partial(cls, first_tid=first_tid, heard=heard, clock=clock, key=key)
        try:
            return await (network or Sockets()).connect(factory, host, port)
        except OSError as problem:
            raise InputError(f"no ranger answers at {host} port {port}: {problem.strerror or problem}") from problem

    def request(
        self, command: str, *parameters: object, ticks: int | None = None, then: Listener | None = None
    ) -> tuple[int, "asyncio.Future[Reply]"]:
        """Send a command at once; its TID, and a future of its first reply.

        command      name
        parameters   as they are to travel; floats by their shortest text
        ticks        not before this time, None at once
        then         called with each reply of it, also those after the first, until `forget`

        Raises InputError: a request that has no line, or too many outstanding.
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
        """The first reply to a command."""
        return await self.request(command, *parameters, ticks=ticks)[1]

    async def ask_all(self, command: str, *parameters: object) -> list[Reply]:
        """All replies to a command that gives many, page by page: a VER behind it, in the order received, ends one."""
        whole: list[Reply] = []
        while True:
            replies: list[Reply] = []
            tid, first = self.request(command, *parameters, then=replies.append)
            await self.ask("VER")
            self.forget(tid)
            whole += replies or [await first]
            if not (whole[-1].ok is True and whole[-1].values[:1] == ("more",)):
                return whole
            parameters = (whole.pop().values[1], LONGEST_PAGE)

    def forget(self, tid: int) -> None:
        """No more replies of a request with `then` are expected."""
        self._outstanding.pop(tid, None)

    @property
    def outstanding(self) -> int:
        """Requests that have not been answered, and those kept for more replies."""
        return len(self._outstanding)

    def check(self) -> None:
        """Keep-alive and silence; call it every few seconds."""
        now = self._clock()
        if now - self._last_heard > SILENCE:
            self.close(f"nothing heard for {SILENCE:g} s")
        elif now - self._last_sent >= KEEP_ALIVE:
            self._write("")

    def close(self, why: str = "closed by this client") -> None:
        """End the connection; what is outstanding is answered with f = 0."""
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
        notice_death(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        self.close("connection lost" if exc is None else f"connection lost: {exc}")

    def data_received(self, data: bytes) -> None:
        self._last_heard = self._clock()
        self._unread += data
        *lines, rest = self._unread.split(b"\n")
        self._unread = bytearray(rest)
        for line in lines:
            self._line(line.removesuffix(b"\r").decode("ascii", "replace"))
        if len(self._unread) > LONGEST_REPLY:
            self.close(f"a line longer than {LONGEST_REPLY} bytes came")

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
        held, self._held = self._held or [], None
        for each in held:
            self._send(each)
        self._answer(reply)

    def _answer(self, reply: Reply) -> None:
        command, future, then = self._outstanding.get(reply.tid, ("", None, None))
        expected = reply.command in (command, "UNKNOWN") or (command == "STM" and reply.command in STREAMED)
        if future is None or not expected:
            if self._heard is not None:
                self._heard(reply)
            return
        if then is None:
            del self._outstanding[reply.tid]
        else:
            then(reply)
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
