"""Greeting of a ranger, HELLO, CONNECT, STW: identity, and free port."""

import asyncio
from typing import Literal

from catseye.ranger.line import Reply

LINES = frozenset(["HELLO", "CONNECT", "STW"])


class Handshake:
    """Greeting on a new connection.

    `wrong_ranger` is True if another ranger answered.
    """

    def __init__(self) -> None:
        self._replies: dict[str, Reply] = {}
        self._whole = asyncio.Event()
        self.wrong_ranger = False

    def hear(self, reply: Reply) -> None:
        """Take in an unsolicited line."""
        if self._whole.is_set() or reply.command not in LINES:
            return
        self._replies[reply.command] = reply
        if set(self._replies) == LINES or (reply.command == "CONNECT" and reply.ok is not True):
            self._whole.set()

    async def rejection_reason(self, ranger: str, port: int, closed: "asyncio.Future[str]", limit: float) -> str | None:
        """Reason why a connection is unusable, None if usable.

        closed   done when the connection is over
        limit    s
        """
        await first_of(closed, self._whole, limit)
        if not self._whole.is_set():
            return (
                f"port {port}: {closed.result()}"
                if closed.done()
                else f"hung: port {port} did not greet within {limit:g} s"
            )
        if self._replies["CONNECT"].ok is not True:
            return f"port {port} is taken"
        hello = self._replies["HELLO"].text
        self.wrong_ranger = hello.split()[2:3] != [ranger]
        return f"port {port} greets with {hello[:60]!a} (expected {ranger})" if self.wrong_ranger else None


async def first_of(closed: "asyncio.Future[str]", event: asyncio.Event, seconds: float) -> None:
    """Wait for a connection's end, an event, or a timeout."""
    waiting = asyncio.ensure_future(event.wait())
    ends: list[asyncio.Future[str] | asyncio.Future[Literal[True]]] = [closed, waiting]
    try:
        await asyncio.wait(ends, timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
    finally:
        waiting.cancel()
