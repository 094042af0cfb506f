"""A ZY on TCP: two ports, one connection each; both hear everything, each may command.

The server sleeps until a line comes or something is due; a ranger that rests costs next to nothing.
What one connection may cost is bounded: a line of 1024 bytes, 200 lines a second (what comes faster is left unread, not
dropped), 64 commands that wait, 4 MiB not yet taken by a slow peer (which is then cut off).
"""

import asyncio
import logging
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from catseye.errors import InputError
from catseye.ranger.door import USUAL_DOOR, Door, notice_death, opens, refuse_open
from catseye.ranger.first_line import BLANK, opening_of, peer_of
from catseye.ranger.line import LONGEST_REQUEST, Reply, format_reply
from catseye.ranger.network import ConnectionMaker, Listener, Sockets
from catseye.ranger.ranger import Ranger, plain_text
from catseye.ranger.state import Outgoing

PORTS = (5240, 5241)
LOOPBACK = "127.0.0.1"
KEEP_ALIVE = 60.0  # s
MUTE = 10.0  # s, after which a connection that never said a line gives its place to another
SILENT = 60.0  # s, the same of one that once did
LINES_A_SECOND = 200.0
MOST_AT_ONCE = 400.0  # lines
MOST_WAITING = 64  # commands of one connection
MOST_UNSENT = 4 * 2**20  # bytes
LOG = logging.getLogger(__name__)


class ClientConnection(asyncio.Protocol):
    """One client; `number` is its place among the ports."""

    def __init__(self, server: "ZyServer", number: int):
        self.server, self.number = server, number
        self.transport: asyncio.Transport | None = None
        self.unread = bytearray()
        self.lines_left, self.paused = MOST_AT_ONCE, False
        self.began = self.heard = server.clock()
        self.opened = False  # its first line was one of the language
        self.admitted = server.door.key is None  # it may hear

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        notice_death(transport)
        self.server.joined(self)

    def connection_lost(self, exc: Exception | None) -> None:
        self.server.left(self)

    def data_received(self, data: bytes) -> None:
        if self.transport is None or self.transport.is_closing():
            return  # turned away: what else it sends is not looked at
        self.unread += data
        if self.opened or self._opens():
            self.read_on()
        self.server.wake()

    def _opens(self) -> bool:
        """Whether the first line is one of the language; a connection that begins with anything else is closed."""
        opening, problem = opening_of(bytes(self.unread))
        self.opened = opening == "read"
        if opening == "waiting":
            self.unread = self.unread.lstrip(BLANK)
        if opening in ("foreign", "unreadable"):
            LOG.warning("%s: port %d: %s %s: closed", *self._named(), peer_of(self.transport), plain_text(problem))
        if opening == "foreign" and self.transport is not None:
            self.unread.clear()
            self.transport.abort()
        elif opening == "unreadable":
            self.refuse(plain_text(problem))
        elif self.opened and not self.admitted:
            self._admit()
        return self.opened and self.admitted

    def _admit(self) -> None:
        """Take the first line, which must be the site's key; who has it hears the greeting."""
        begun = bytes(self.unread.lstrip(BLANK))
        line, _, rest = begun.partition(b"\n")
        self.unread = bytearray(rest)
        self.admitted = opens(line, self.server.door.key or "")
        if not self.admitted:
            LOG.warning("%s: port %d: %s does not have the site's key: closed", *self._named(), peer_of(self.transport))
            self.refuse("the site's key is expected first (KEY and the key)")
            return
        self.tell(Reply("KEY", True, (), 0, self.server.ranger.now_ticks()))
        self.server.greet(self)

    def read_on(self) -> None:
        """Hand over whole lines as far as rate and queue allow; otherwise stop reading from the peer."""
        ranger = self.server.ranger
        while self.lines_left >= 1.0 and ranger.waiting(self.number) < MOST_WAITING:
            end = self.unread.find(b"\n", 0, LONGEST_REQUEST + 3)
            if end < 0:
                if len(self.unread) > LONGEST_REQUEST + 2:
                    self.refuse(f"line is longer than {LONGEST_REQUEST} bytes")
                break
            line = bytes(self.unread[:end]).removesuffix(b"\r")
            del self.unread[: end + 1]
            self.lines_left -= 1.0
            self.heard = self.server.clock()
            self.server.send(ranger.receive(self.number, line.decode("ascii", "replace")))
        full = b"\n" in self.unread
        if self.transport is not None and full != self.paused and not self.transport.is_closing():
            (self.transport.pause_reading if full else self.transport.resume_reading)()
            self.paused = full

    def refuse(self, text: str) -> None:
        """Tell a client why not, and close its connection."""
        self.unread.clear()
        self.tell(Reply("LINE", False, (text,), 0, self.server.ranger.now_ticks()))
        if self.transport is not None:
            self.transport.close()

    def tell(self, reply: Reply) -> None:
        self.write(format_reply(reply).encode("ascii") + b"\n")

    def write(self, data: bytes) -> None:
        """Send; a peer that does not take what it is sent is cut off."""
        if self.transport is None or self.transport.is_closing():
            return
        self.transport.write(data)
        if self.transport.get_write_buffer_size() > MOST_UNSENT:
            LOG.warning("%s: port %d cut off: more than %d bytes not taken", *self._named(), MOST_UNSENT)
            self.transport.abort()

    def _named(self) -> tuple[str, int]:
        return self.server.ranger.name, self.server.ports[self.number]


class ZyServer:
    """A ranger behind its two ports.

    ranger   with its head
    door     what its ports ask of those who come
    host     address to listen at; only this machine unless told otherwise
    ports    two; 0 takes any free one, `ports` says which after `start`
    clock    s, never backwards; for keep-alive and rates
    network  sockets unless told otherwise
    """

    def __init__(
        self,
        ranger: Ranger,
        host: str = LOOPBACK,
        ports: tuple[int, int] = PORTS,
        *,
        door: Door = USUAL_DOOR,
        clock: Callable[[], float] = time.monotonic,
        network: ConnectionMaker | None = None,
    ):
        self.ranger, self.host, self.ports, self.clock, self.door = ranger, host, ports, clock, door
        self._commanded = clock()  # when who has the lease was last heard, or there was one
        self.network: ConnectionMaker = network or Sockets()
        self.connections: dict[int, ClientConnection] = {}
        self._listeners: list[Listener] = []
        self._waker: asyncio.Future[None] | None = None
        self._last_keep_alive = self._last_rate = clock()

    async def start(self) -> None:
        """Listen. Raises InputError where a port cannot be had, or would be open to others without a key."""
        refuse_open(self.ranger.name, self.host, self.door.key)
        self._commanded = self.clock()
        for number, port in enumerate(self.ports):
            try:
                self._listeners.append(
                    await self.network.serve(partial(ClientConnection, self, number), self.host, port)
                )
            except OSError as problem:
                await self.stop()
                raise InputError(
                    f"{self.ranger.name}: {self.host} port {port} cannot be had: {problem.strerror or problem}"
                ) from problem
        self.ports = (self._listeners[0].port, self._listeners[1].port)

    async def stop(self) -> None:
        """Close the connections and listen no more."""
        for connection in list(self.connections.values()):
            if connection.transport is not None:
                connection.transport.close()
        listeners, self._listeners = self._listeners, []
        for listener in listeners:
            await listener.close()

    async def serve(self) -> None:
        """Turn when something comes or is due, until cancelled; `start` first."""
        loop = asyncio.get_running_loop()
        while True:
            self.turn()
            pause = self.ranger.rest(heard=bool(self.connections))
            if pause <= 0.0:
                await asyncio.sleep(0.0)
                continue
            waker = self._waker = loop.create_future()
            alarm = loop.call_later(pause, self.wake)
            try:
                await waker
            finally:
                self._waker = None
                alarm.cancel()

    def wake(self) -> None:
        """Turn now: a line came, or something is due."""
        if self._waker is not None and not self._waker.done():
            self._waker.set_result(None)

    def turn(self) -> None:
        """One pass: rates, the ranger's own pass, keep-alive."""
        now = self.clock()
        gained, self._last_rate = (now - self._last_rate) * LINES_A_SECOND, now
        for connection in list(self.connections.values()):
            connection.lines_left = min(MOST_AT_ONCE, connection.lines_left + gained)
            if connection.unread and connection.opened:
                connection.read_on()
        self.send(self.ranger.turn())
        self._watch_dead_man(now)
        for connection in list(self.connections.values()):
            if now - max(connection.heard, connection.began) > self.door.idle:
                connection.refuse(f"nothing was said for {self.door.idle:g} s")
        if now - self._last_keep_alive >= KEEP_ALIVE:
            self._last_keep_alive = now
            for connection in list(self.connections.values()):
                if connection.admitted:
                    connection.write(b"\n")

    def _watch_dead_man(self, now: float) -> None:
        """Laser and motors off where nobody who has the lease is heard for so long."""
        self.ranger.guarded = self.door.lease
        if not self.door.lease:
            return
        lease = self.ranger.lease
        holder = None if lease is None else self.connections.get(lease[0])
        if holder is not None:
            self._commanded = max(self._commanded, holder.heard)
        if now - self._commanded > self.door.dead_man:
            who = "nobody had the lease" if lease is None else f"nothing was heard of {lease[1]}"
            said = self.ranger.make_safe(f"{who} for {self.door.dead_man:g} s")
            if said:
                LOG.warning("%s: %s", self.ranger.name, said[0].reply.text)
            self.send(said)

    def send(self, outgoing: list[Outgoing]) -> None:
        """Give replies to those they are for."""
        for out in outgoing:
            reply = out.reply
            if reply.command == "BYE" and reply.ok and out.client is not None:
                reply = replace(reply, values=(str(self.ports[out.client]), *reply.values))
            line = format_reply(reply).encode("ascii") + b"\n"
            for number, connection in list(self.connections.items()):
                if out.client in (None, number) and connection.admitted:
                    connection.write(line)
                    if reply.command == "BYE" and reply.ok and connection.transport is not None:
                        connection.transport.close()

    def joined(self, connection: ClientConnection) -> None:
        """A connection begins; a second one on a port is turned away."""
        port = self.ports[connection.number]
        holder = self.connections.get(connection.number)
        if holder is not None:
            limit = SILENT if holder.admitted and holder.opened else MUTE
            if self.clock() - holder.heard >= limit:
                self.give_up(holder, limit)
                holder = None
        if holder is not None:
            who = peer_of(connection.transport)
            LOG.warning("%s: port %d: %s turned away: the port is taken", self.ranger.name, port, who)
            connection.tell(
                Reply(
                    "CONNECT", False, (f"port {port} is taken (expected the other port)",), 0, self.ranger.now_ticks()
                )
            )
            if connection.transport is not None:
                connection.transport.close()
            return
        self.connections[connection.number] = connection
        self.ranger.guarded = self.door.lease
        self.wake()
        if connection.admitted:
            self.greet(connection)

    def greet(self, connection: ClientConnection) -> None:
        """Who this is, that the port is had, the status word, who has the lease."""
        for out in self.ranger.greeting(self.ports[connection.number]):
            connection.tell(out.reply)

    def give_up(self, holder: ClientConnection, limit: float) -> None:
        """A connection that says nothing is closed: another one wants its place."""
        LOG.warning("%s: port %d: %s said nothing: closed", *holder._named(), peer_of(holder.transport))
        holder.refuse(f"nothing was said for {limit:g} s, and another wants this port")
        self.left(holder)

    def left(self, connection: ClientConnection) -> None:
        """A connection is over: what it had queued and scheduled is dropped, and its port is free."""
        if self.connections.get(connection.number) is connection:
            del self.connections[connection.number]
            self.ranger.disconnect(connection.number)
