"""Commands of people to a coordinator and to rangers, with the lease that these need."""

import asyncio
import re
from collections.abc import Callable, Mapping, Sequence

from catseye.coordinator.parts import Clock, ticks_now
from catseye.errors import InputError
from catseye.ranger.client import SECOND_CLIENT_TID, ZyClient
from catseye.ranger.commands import COMMANDS, stops
from catseye.ranger.line import Reply, Request, format_request, parse_request
from catseye.ranger.network import ConnectionMaker
from catseye.records.night.live import TICKS_PER_DAY
from catseye.service.watch.entries import Object, mjd_of

COMMANDING = ("MODE", "DROP", "TAKE", "STREAM", "SET", "PREPARE", "START", "DISCARD", "CLOCK", "REFERENCE", "MOVED")
IDLE = 60.0  # s without a command after which a lease is given back, and a console closed
LOOK = 5.0  # s between two looks for idle ones
PATIENCE = 5.0  # s for a coordinator's answer
LONG_COMMAND = 40.0  # s for a ranger's: a mirror's initialisation takes half a minute
CONNECTING = 5.0  # s
MOST_LINES, LONGEST_LINE = 400, 1000  # of an answer of a console
PERSON = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,15}")
OWN = ("LEASE", "BYE")  # what the console itself says
LEASELESS = ("UNLATCH", "LATCH", "HLP", "HELP", "VER")


class CommandDesk:
    """Commands to the coordinator, one at a time, under the lease of who asks.

    client   gives the connection; raises InputError without one

    Another's lease is taken: whoever commands has said so, and the port tells all others. An idle minute gives it back.
    """

    def __init__(self, client: Callable[[], ZyClient], clock: Clock):
        self._client, self._clock = client, clock
        self._lock = asyncio.Lock()
        self._holder: tuple[ZyClient, str, str] | None = None  # connection, name and token of the lease
        self._used = 0.0

    async def command(self, name: str, parameters: Sequence[str], who: str) -> Object:
        """Command with its answer: values, and from whom the lease was taken.

        Raises InputError with the site's own words if it refuses.
        """
        require_person(who)
        command = name.strip().upper()
        if command not in COMMANDING:
            raise InputError(f"{name[:20]!r} is no command to the site (expected {', '.join(COMMANDING)})")
        async with self._lock:
            client = self._client()
            taken_from = await self._take(client, who)
            reply = await self._asked(client, command, *parameters)
            self._used = asyncio.get_running_loop().time()
        return {"command": command, "values": list(reply.values), "at": self._instant(reply), "lease_from": taken_from}

    async def alarm(self, command: str, *parameters: str) -> Object:
        """ACK, SHELVE or UNSHELVE, which need no lease."""
        reply = await self._asked(self._client(), command, *parameters)
        return {"command": command, "values": list(reply.values), "at": self._instant(reply), "lease_from": None}

    async def give_back(self) -> None:
        """Give back the lease if it is idle."""
        async with self._lock:
            if self._holder is None or asyncio.get_running_loop().time() - self._used < IDLE:
                return
            (client, *_), self._holder = self._holder, None
            if not client.closed.done():
                async with asyncio.timeout(PATIENCE):
                    await client.ask("LEASE", "none")

    async def _take(self, client: ZyClient, who: str) -> str | None:
        """Take the lease, or renew it by its token; the name of the holder before, None if nobody or oneself."""
        before = (await self._asked(client, "LEASE")).values[0]
        if self._holder is not None and self._holder[1] == who and before == who:
            renewed = await self._answer(client, "LEASE", who, self._holder[2])  # also from a new connection
            if renewed.ok is True:
                self._holder = client, who, self._holder[2]
                return None
        taken = await self._asked(client, "LEASE", who)
        own = self._holder is not None and self._holder[1] == before
        self._holder = client, who, taken.values[-1]
        return None if before == "none" or own else before

    async def _answer(self, client: ZyClient, command: str, *parameters: str) -> Reply:
        try:
            async with asyncio.timeout(PATIENCE):
                return await client.ask(command, *parameters)
        except TimeoutError:
            raise InputError(f"no answer to {command} within {PATIENCE:g} s: its outcome is not known") from None

    async def _asked(self, client: ZyClient, command: str, *parameters: str) -> Reply:
        reply = await self._answer(client, command, *parameters)
        if reply.ok is not True:
            raise InputError(reply.text or f"{command} was refused without a reason")
        return reply

    def _instant(self, reply: Reply) -> float | None:
        return mjd_of(reply.ticks) or ticks_now(self._clock) / TICKS_PER_DAY


class Consoles:
    """Lines of people to rangers: who asks takes a free lease for one command.

    addresses   host and port by ranger
    """

    def __init__(self, addresses: Mapping[str, tuple[str, int]], network: ConnectionMaker | None, key: str | None):
        self._addresses, self._network, self._key = dict(addresses), network, key
        self._clients: dict[str, tuple[ZyClient, float]] = {}
        self._locks: dict[str, asyncio.Lock] = {}

    async def say(self, ranger: str, line: str, who: str) -> Object:
        """Replies of a ranger to one line.

        Raises InputError: no such console, a line that is no command, no answer.
        """
        require_person(who)
        if ranger not in self._addresses:
            names = ", ".join(self._addresses) or "none"
            raise InputError(f"{ranger[:20]!r} has no console here (expected one of {names})")
        request = parse_request(line)
        if request is None or request.tid or request.ticks is not None:
            raise InputError("the line is no command (expected a command and its parameters, without TID and stamp)")
        if request.command in OWN and request.parameters:
            raise InputError(f"{request.command} belongs to the console (expected other commands: it takes the lease)")
        format_request(request)
        async with self._locks.setdefault(ranger, asyncio.Lock()):
            client = await self._connected(ranger)
            try:
                replies = await self._answered(client, request, who)
            finally:
                self._clients[ranger] = client, asyncio.get_running_loop().time()
        return {"replies": [_text(reply) for reply in replies[:MOST_LINES]]}

    async def _answered(self, client: ZyClient, request: Request, who: str) -> list[Reply]:
        if not needs_lease(request):
            return await self._all(client, request)
        holder = await self._reply(client, "LEASE")
        is_free = holder.ok is True and holder.values[:1] == ("none",)
        if is_free:
            await self._reply(client, "LEASE", who)
        try:
            return await self._all(client, request)
        finally:
            if is_free and not client.closed.done():
                await self._reply(client, "LEASE", "none")

    async def _connected(self, ranger: str) -> ZyClient:
        client = self._clients.get(ranger, (None, 0.0))[0]
        if client is not None and not client.closed.done():
            return client
        host, port = self._addresses[ranger]
        try:
            async with asyncio.timeout(CONNECTING):
                return await ZyClient.connect(
                    host,
                    port,
                    first_tid=SECOND_CLIENT_TID,
                    clock=asyncio.get_running_loop().time,
                    network=self._network,
                    key=self._key,
                )
        except TimeoutError:
            raise InputError(f"{ranger} does not answer at {host} port {port} within {CONNECTING:g} s") from None

    async def _reply(self, client: ZyClient, command: str, *parameters: str) -> Reply:
        try:
            async with asyncio.timeout(PATIENCE):
                return await client.ask(command, *parameters)
        except TimeoutError:
            raise InputError(f"no answer to {command} within {PATIENCE:g} s") from None

    async def _all(self, client: ZyClient, request: Request) -> list[Reply]:
        """All replies to a request: up to a VER that is sent when the first has come."""
        replies: list[Reply] = []
        tid, first = client.request(request.command, *request.parameters, then=replies.append)
        try:
            async with asyncio.timeout(LONG_COMMAND):
                await first
                await client.ask("VER")
        except TimeoutError:
            raise InputError(f"no answer to {request.command} in time: its outcome is not known") from None
        finally:
            client.forget(tid)
        return replies or [first.result()]

    def close_idle(self) -> None:
        """Close consoles that nobody used for a minute."""
        time_s = asyncio.get_running_loop().time()
        for ranger, (client, used) in list(self._clients.items()):
            lock = self._locks.get(ranger)
            if (client.closed.done() or time_s - used > IDLE) and (lock is None or not lock.locked()):
                client.close()
                del self._clients[ranger]

    def close(self) -> None:
        """Close all connections to rangers."""
        for client, _ in self._clients.values():
            client.close()
        self._clients.clear()


def needs_lease(request: Request) -> bool:
    """True if a ranger carries out a request only for its lease's holder."""
    row = COMMANDS.get(request.command)
    if row is None or request.command in (*OWN, *LEASELESS) or stops(request):
        return False
    return len(request.parameters) not in row.asks


def require_person(who: str) -> None:
    """Raise InputError for a name that the ports do not take."""
    if not PERSON.fullmatch(who):
        raise InputError(f"{who[:20]!r} is no name (expected a letter with up to 15 letters and digits)")


def _text(reply: Reply) -> str:
    """A reply as its line says it, without TID and stamp."""
    flag = "" if reply.ok is None else f" {int(reply.ok)}"
    text = f"{reply.command}{flag}" + (f", {reply.text}" if reply.values and reply.ok is not None else "")
    text = text if reply.ok is not None else f"{reply.command} {reply.text}".rstrip()
    return text if len(text) <= LONGEST_LINE else f"{text[:LONGEST_LINE]}..."
