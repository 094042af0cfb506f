"""A ZY on TCP: two ports, one connection each; what is done both hear, an answer who asked; who has the lease commands.

The server sleeps until a line comes or something is due; a ranger that rests costs next to nothing.
What one connection may cost is bounded: a line of 1024 bytes, 200 lines a second (what comes faster is left unread, not
dropped), 64 commands that wait, 2000 lines a second of long answers, 4 MiB not yet taken by a slow peer (which is then
cut off). What makes dark or stops is looked for in all that has come, also behind lines whose turn is far off.
"""

import asyncio
import logging
import re
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from catseye.errors import InputError
from catseye.ranger.commands import WORDS, stops
from catseye.ranger.door import USUAL_DOOR, Door, notice_death, refuse_open
from catseye.ranger.entrance import Doorway, Entrance
from catseye.ranger.first_line import peer_of
from catseye.ranger.line import LONGEST_REQUEST, Reply, format_reply, parse_request
from catseye.ranger.network import ConnectionMaker, Listener, Sockets
from catseye.ranger.ranger import Ranger
from catseye.ranger.state import Outgoing

PORTS = (5240, 5241)
LOOPBACK = "127.0.0.1"
KEEP_ALIVE = 60.0  # s
MUTE = 10.0  # s, after which a connection that never said a line gives its place to another
SILENT = 60.0  # s, the same of one that once did
LINES_A_SECOND = 200.0
MOST_AT_ONCE = 400.0  # lines
STOPS_A_SECOND = 50.0
MOST_STOPS = 50.0  # at once; what is more waits its turn
REPLIES_A_SECOND = 2000.0  # lines of long answers to one connection
MOST_REPLIES = 1000.0  # at once
MOST_WAITING = 64  # commands of one connection
MOST_UNREAD = 2**16  # bytes of one connection that are looked through before their turn; more stay with the peer
MOST_HELD = 2**18  # bytes not yet taken, from which on a long answer waits
MOST_UNSENT = 4 * 2**20  # bytes
STOPPING = re.compile(  # lines that may make dark or stop
    rb"^[ \t0-9]*(?:(?:PS|SCN) +[+-]?0+|(?:AXIS|STM) +[0-9A-Z_+-]+ *, *[+-]?0+|STOP) *\r?\n",
    re.IGNORECASE | re.MULTILINE,
)
LOG = logging.getLogger(__name__)


class ClientConnection(asyncio.Protocol):
    """One client; `number` is its place among the ports."""

    def __init__(self, server: "ZyServer", number: int):
        self.server, self.number = server, number
        self.transport: asyncio.Transport | None = None
        self.entrance: Entrance | None = None
        self.unread = bytearray()
        self.looked = 0  # bytes of it in which a stop was looked for
        self.lines_left, self.paused = MOST_AT_ONCE, False
        self.stops_left, self.replies_left = MOST_STOPS, MOST_REPLIES
        self.began = self.heard = server.clock()
        self.opened = False  # its first line was one of the language

    @property
    def admitted(self) -> bool:
        """True once it is in: it may hear."""
        return self.entrance is not None and self.entrance.admitted

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        notice_death(transport)
        self.entrance = Entrance(self.server.gates[self.number], transport, self.say)
        self.entrance.begin()
        if self.admitted:
            self.server.joined(self)

    def connection_lost(self, exc: Exception | None) -> None:
        if self.entrance is not None:
            self.entrance.over()
        self.server.left(self)

    def data_received(self, data: bytes) -> None:
        if self.entrance is None or self.transport is None or self.transport.is_closing():
            return  # turned away: what else it sends is not looked at
        was_in = self.admitted
        more = self.entrance.take(data)
        if more is not None:
            self.opened = True
            if not was_in:
                self.server.joined(self)
            self.unread += more
            self.look_ahead()
            self.read_on()
        self.server.wake()

    def look_ahead(self) -> None:
        """Carry out what makes dark or stops, wherever it stands in what has come."""
        while self.stops_left >= 1.0:
            found = STOPPING.search(self.unread, self.looked)
            if found is None:
                self.looked = self.unread.rfind(b"\n") + 1
                return
            self.stops_left -= 1.0
            line = found[0].decode("ascii").rstrip("\r\n")
            self.looked = found.end()
            if _stops(line):
                del self.unread[found.start() : found.end()]
                self.looked = found.start()
                self.heard = self.server.clock()
                self.server.send(self.server.ranger.receive(self.number, line))

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
            self.looked = max(0, self.looked - end - 1)
            self.lines_left -= 1.0
            self.heard = self.server.clock()
            self.server.send(ranger.receive(self.number, line.decode("ascii", "replace")))
        full = b"\n" in self.unread and len(self.unread) > MOST_UNREAD
        if self.transport is not None and full != self.paused and not self.transport.is_closing():
            (self.transport.pause_reading if full else self.transport.resume_reading)()
            self.paused = full

    def gain(self, seconds: float) -> None:
        """Let the budgets grow with time."""
        self.lines_left = min(MOST_AT_ONCE, self.lines_left + seconds * LINES_A_SECOND)
        self.stops_left = min(MOST_STOPS, self.stops_left + seconds * STOPS_A_SECOND)
        self.replies_left = min(MOST_REPLIES, self.replies_left + seconds * REPLIES_A_SECOND)

    @property
    def has_room(self) -> bool:
        """True where it can be given more of a long answer."""
        held = 0 if self.transport is None else self.transport.get_write_buffer_size()
        return self.replies_left >= 1.0 and held <= MOST_HELD

    def refuse(self, text: str) -> None:
        """Tell a client why not, and close its connection."""
        self.unread.clear()
        self.looked = 0
        self.say(Reply("LINE", False, (text,)))
        if self.transport is not None:
            self.transport.close()

    def say(self, reply: Reply) -> None:
        """Send a reply, stamped with this instant."""
        self.tell(replace(reply, ticks=self.server.ranger.now_ticks()))

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


def _stops(line: str) -> bool:
    """True for a line that makes dark or stops at once."""
    try:
        request = parse_request(line)
    except InputError:
        return False
    return request is not None and request.ticks is None and stops(request)


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
        self.host, self.ports, self.clock, self.door = host, ports, clock, door
        self._commanded = clock()  # when who has the lease last ordered anything, or renewed it
        self._orders = 0
        self.network: ConnectionMaker = network or Sockets(door.tls)
        self.connections: dict[int, ClientConnection] = {}
        self.gates = tuple(Doorway(partial(self._port_name, number), door, WORDS, clock) for number in (0, 1))
        self._listeners: list[Listener] = []
        self._waker: asyncio.Future[None] | None = None
        self._last_keep_alive = self._last_rate = clock()
        self.ranger = ranger

    @property
    def ranger(self) -> Ranger:
        """The ranger that is served; a new one after a loss of power."""
        return self._ranger

    @ranger.setter
    def ranger(self, ranger: Ranger) -> None:
        self._ranger = ranger
        ranger.room = self._room
        ranger.guarded = self.door.lease
        self._orders = ranger.orders

    def _room(self, client: int) -> bool:
        connection = self.connections.get(client)
        return connection is None or connection.has_room

    def _port_name(self, number: int) -> str:
        return f"{self.ranger.name}: port {self.ports[number]}"

    def rearm(self) -> None:
        """Count the dead man's time from now on: the ranger is ready, and nobody could command before."""
        self._commanded = self.clock()

    async def start(self) -> None:
        """Listen. Raises InputError where a port cannot be had, or would be open to others without a key."""
        refuse_open(self.ranger.name, self.host, self.door)
        self.rearm()
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
        passed, self._last_rate = now - self._last_rate, now
        for connection in list(self.connections.values()):
            connection.gain(passed)
            if connection.unread and connection.opened:
                connection.look_ahead()
                connection.read_on()
        self.send(self.ranger.turn())
        self._watch_dead_man(now)
        for gate in self.gates:
            gate.check()
        for connection in list(self.connections.values()):
            if now - max(connection.heard, connection.began) > self.door.idle:
                connection.refuse(f"nothing was said for {self.door.idle:g} s")
        if now - self._last_keep_alive >= KEEP_ALIVE:
            self._last_keep_alive = now
            for connection in list(self.connections.values()):
                if connection.admitted:
                    connection.write(b"\n")

    def _watch_dead_man(self, now: float) -> None:
        """Laser and motors off where nobody who has the lease has ordered anything for so long."""
        if not self.door.lease:
            return
        lease = self.ranger.lease
        if self._orders != self.ranger.orders:
            self._orders, self._commanded = self.ranger.orders, now
        if now - self._commanded > self.door.dead_man:
            who = "nobody had the lease" if lease is None else f"nothing was ordered by {lease.name}"
            said = self.ranger.make_safe(f"{who} for {self.door.dead_man:g} s")
            if said:
                LOG.warning("%s: %s", self.ranger.name, said[0].reply.text)
            self.send(said)

    def send(self, outgoing: list[Outgoing]) -> None:
        """Give replies to those they are for, each connection's together."""
        lines: dict[int, bytearray] = {}
        byes = []
        for out in outgoing:
            reply = out.reply
            if reply.command == "LATCH" and reply.tid == 0 and out.client is None:
                LOG.warning("%s: dark order: %s", self.ranger.name, reply.text)
            if reply.command == "BYE" and reply.ok and out.client is not None:
                reply = replace(reply, values=(str(self.ports[out.client]), *reply.values))
                byes.append(out.client)
            line = format_reply(reply).encode("ascii") + b"\n"
            for number, connection in self.connections.items():
                if (out.client == number or (out.client is None and out.but != number)) and connection.admitted:
                    lines.setdefault(number, bytearray()).extend(line)
                    connection.replies_left -= out.client is not None
        for number, told in lines.items():
            self.connections[number].write(bytes(told))
        for number in byes:
            if number in self.connections and (transport := self.connections[number].transport) is not None:
                transport.close()

    def joined(self, connection: ClientConnection) -> None:
        """A connection is in; a second one on a port is turned away."""
        port = self.ports[connection.number]
        holder = self.connections.get(connection.number)
        if holder is not None:
            limit = SILENT if holder.opened else MUTE
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
        self.ranger.peers[connection.number] = peer_of(connection.transport)
        self.wake()
        self.greet(connection)

    def greet(self, connection: ClientConnection) -> None:
        """Who this is, that the port is had, the status word, who has the lease."""
        for out in self.ranger.greeting(self.ports[connection.number]):
            connection.tell(out.reply)

    def give_up(self, holder: ClientConnection, limit: float) -> None:
        """A connection that says nothing is closed: another one wants its place."""
        LOG.warning("%s: %s said nothing: closed", self._port_name(holder.number), peer_of(holder.transport))
        holder.refuse(f"nothing was said for {limit:g} s, and another wants this port")
        self.left(holder)

    def left(self, connection: ClientConnection) -> None:
        """A connection is over: what it had queued and scheduled is dropped, and its port is free."""
        if self.connections.get(connection.number) is connection:
            del self.connections[connection.number]
            self.ranger.disconnect(connection.number)
