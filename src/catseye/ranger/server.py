"""A ZY on TCP: two ports, one connection each.

Both connections hear state changes; an answer goes to its client; the lease's holder commands. The server sleeps until
a line comes or something is due; an idle ranger costs next to nothing. The cost of one connection is bounded: a line of
1024 bytes, 200 lines a second (more are left unread, not dropped), 64 queued commands, 2000 lines a second of long
answers, 4 MiB not yet read by a slow peer (which is then cut off). Stops are searched for in all received input, also
behind lines that must wait.
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
from catseye.ranger.door import DEFAULT_ACCESS, Door, enable_keep_alive_probes, refuse_exposed_port
from catseye.ranger.entrance import Doorway, Entrance
from catseye.ranger.first_line import peer_of
from catseye.ranger.line import LONGEST_REQUEST, Reply, format_reply, parse_request
from catseye.ranger.network import ConnectionMaker, Listener, Sockets
from catseye.ranger.ranger import Ranger
from catseye.ranger.state import Outgoing

PORTS = (5240, 5241)
LOOPBACK = "127.0.0.1"
KEEP_ALIVE = 60.0  # s
MUTE = 10.0  # s, after which a connection without any line gives its port to another
SILENT = 60.0  # s, the same after its last line
LINES_A_SECOND = 200.0
LINE_BURST = 400.0  # lines
STOPS_A_SECOND = 50.0
MOST_STOPS = 50.0  # at once; more of them wait in the queue
REPLIES_A_SECOND = 2000.0  # lines of long answers to one connection
MOST_REPLIES = 1000.0  # at once
MOST_WAITING = 64  # commands of one connection
MOST_UNREAD = 2**16  # bytes of one connection that are searched for stops; more stay with the peer
MOST_PENDING_BYTES = 2**18  # bytes not yet read, above which a long answer waits
MOST_UNSENT = 4 * 2**20  # bytes
STOPPING = re.compile(  # lines that may stop or switch light off
    rb"^[ \t0-9]*(?:(?:PS|SCN) +[+-]?0+|(?:AXIS|STM) +[0-9A-Z_+-]+ *, *[+-]?0+|STOP) *\r?\n",
    re.IGNORECASE | re.MULTILINE,
)
LOG = logging.getLogger(__name__)


class ClientConnection(asyncio.Protocol):
    """One client; `number` is the index of its port."""

    def __init__(self, server: "ZyServer", number: int):
        self.server, self.number = server, number
        self.transport: asyncio.Transport | None = None
        self.entrance: Entrance | None = None
        self.unread = bytearray()
        self.searched = 0  # bytes already searched for a stop
        self.lines_left, self.paused = LINE_BURST, False
        self.stops_left, self.replies_left = MOST_STOPS, MOST_REPLIES
        self.began = self.heard = server.clock()
        self.opened = False  # its first line was valid

    @property
    def admitted(self) -> bool:
        """True once it is authenticated and may receive."""
        return self.entrance is not None and self.entrance.admitted

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        enable_keep_alive_probes(transport)
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
            return  # refused: the rest of its input is ignored
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
        """Execute stops anywhere in the received input."""
        while self.stops_left >= 1.0:
            match = STOPPING.search(self.unread, self.searched)
            if match is None:
                self.searched = self.unread.rfind(b"\n") + 1
                return
            self.stops_left -= 1.0
            line = match[0].decode("ascii").rstrip("\r\n")
            self.searched = match.end()
            if _stops(line):
                del self.unread[match.start() : match.end()]
                self.searched = match.start()
                self.heard = self.server.clock()
                self.server.send(self.server.ranger.receive(self.number, line))

    def read_on(self) -> None:
        """Process complete lines as far as rate and queue allow.

        Beyond that, stop reading from the peer.
        """
        ranger = self.server.ranger
        while self.lines_left >= 1.0 and ranger.waiting(self.number) < MOST_WAITING:
            end = self.unread.find(b"\n", 0, LONGEST_REQUEST + 3)
            if end < 0:
                if len(self.unread) > LONGEST_REQUEST + 2:
                    self.refuse(f"line is longer than {LONGEST_REQUEST} bytes")
                break
            line = bytes(self.unread[:end]).removesuffix(b"\r")
            del self.unread[: end + 1]
            self.searched = max(0, self.searched - end - 1)
            self.lines_left -= 1.0
            self.heard = self.server.clock()
            self.server.send(ranger.receive(self.number, line.decode("ascii", "replace")))
        full = b"\n" in self.unread and len(self.unread) > MOST_UNREAD
        if self.transport is not None and full != self.paused and not self.transport.is_closing():
            (self.transport.pause_reading if full else self.transport.resume_reading)()
            self.paused = full

    def gain(self, seconds: float) -> None:
        """Refill the rate limits after a time."""
        self.lines_left = min(LINE_BURST, self.lines_left + seconds * LINES_A_SECOND)
        self.stops_left = min(MOST_STOPS, self.stops_left + seconds * STOPS_A_SECOND)
        self.replies_left = min(MOST_REPLIES, self.replies_left + seconds * REPLIES_A_SECOND)

    @property
    def has_room(self) -> bool:
        """True if it can take more of a long answer."""
        unsent = 0 if self.transport is None else self.transport.get_write_buffer_size()
        return self.replies_left >= 1.0 and unsent <= MOST_PENDING_BYTES

    def refuse(self, text: str) -> None:
        """Send the reason and close the connection."""
        self.unread.clear()
        self.searched = 0
        self.say(Reply("LINE", False, (text,)))
        if self.transport is not None:
            self.transport.close()

    def say(self, reply: Reply) -> None:
        """Send a reply, stamped now."""
        self.tell(replace(reply, ticks=self.server.ranger.now_ticks()))

    def tell(self, reply: Reply) -> None:
        self.write(format_reply(reply).encode("ascii") + b"\n")

    def write(self, data: bytes) -> None:
        """Send; a peer that does not read is cut off."""
        if self.transport is None or self.transport.is_closing():
            return
        self.transport.write(data)
        if self.transport.get_write_buffer_size() > MOST_UNSENT:
            LOG.warning("%s: port %d cut off: more than %d bytes not read", *self._named(), MOST_UNSENT)
            self.transport.abort()

    def _named(self) -> tuple[str, int]:
        return self.server.ranger.name, self.server.ports[self.number]


def _stops(line: str) -> bool:
    """True for a line that stops or switches light off at once."""
    try:
        request = parse_request(line)
    except InputError:
        return False
    return request is not None and request.ticks is None and stops(request)


class ZyServer:
    """A ranger behind its two ports.

    ranger   with its head
    door     access policy of its ports
    host     address to listen at; by default only this machine
    ports    two; 0 takes any free one, `ports` has the actual ones after `start`
    clock    s, monotonic; for keep-alive and rates
    network  sockets by default
    """

    def __init__(
        self,
        ranger: Ranger,
        host: str = LOOPBACK,
        ports: tuple[int, int] = PORTS,
        *,
        door: Door = DEFAULT_ACCESS,
        clock: Callable[[], float] = time.monotonic,
        network: ConnectionMaker | None = None,
    ):
        self.host, self.ports, self.clock, self.door = host, ports, clock, door
        self._commanded = clock()  # time of the holder's last order or renewal
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
        """The served ranger; a new one after a loss of power."""
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
        """Restart the dead-man timer: the ranger is ready now."""
        self._commanded = self.clock()

    async def start(self) -> None:
        """Listen.

        Raises InputError if a port is not available, or would be exposed without a key.
        """
        refuse_exposed_port(self.ranger.name, self.host, self.door)
        self.rearm()
        for number, port in enumerate(self.ports):
            try:
                self._listeners.append(
                    await self.network.serve(partial(ClientConnection, self, number), self.host, port)
                )
            except OSError as problem:
                await self.stop()
                raise InputError(
                    f"{self.ranger.name}: {self.host} port {port} is not available: {problem.strerror or problem}"
                ) from problem
        self.ports = (self._listeners[0].port, self._listeners[1].port)

    async def stop(self) -> None:
        """Close the connections and stop listening."""
        for connection in list(self.connections.values()):
            if connection.transport is not None:
                connection.transport.close()
        listeners, self._listeners = self._listeners, []
        for listener in listeners:
            await listener.close()

    async def serve(self) -> None:
        """Run turns when something is due, until cancelled; `start` first."""
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
        """Run a turn now: a line came, or something is due."""
        if self._waker is not None and not self._waker.done():
            self._waker.set_result(None)

    def turn(self) -> None:
        """One pass: rates, the ranger's own pass, keep-alive."""
        time_s = self.clock()
        passed, self._last_rate = time_s - self._last_rate, time_s
        for connection in list(self.connections.values()):
            connection.gain(passed)
            if connection.unread and connection.opened:
                connection.look_ahead()
                connection.read_on()
        self.send(self.ranger.turn())
        self._watch_dead_man(time_s)
        for gate in self.gates:
            gate.check()
        for connection in list(self.connections.values()):
            if time_s - max(connection.heard, connection.began) > self.door.idle:
                connection.refuse(f"no line received for {self.door.idle:g} s")
        if time_s - self._last_keep_alive >= KEEP_ALIVE:
            self._last_keep_alive = time_s
            for connection in list(self.connections.values()):
                if connection.admitted:
                    connection.write(b"\n")

    def _watch_dead_man(self, time_s: float) -> None:
        """Dead-man switch: laser and motors off without orders for too long."""
        if not self.door.lease:
            return
        lease = self.ranger.lease
        if self._orders != self.ranger.orders:
            self._orders, self._commanded = self.ranger.orders, time_s
        if time_s - self._commanded > self.door.dead_man:
            who = "nobody had the lease" if lease is None else f"nothing was ordered by {lease.name}"
            notices = self.ranger.make_safe(f"{who} for {self.door.dead_man:g} s")
            if notices:
                LOG.warning("%s: %s", self.ranger.name, notices[0].reply.text)
            self.send(notices)

    def send(self, outgoing: list[Outgoing]) -> None:
        """Send replies to their connections, grouped."""
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
        for number, content in lines.items():
            self.connections[number].write(bytes(content))
        for number in byes:
            if number in self.connections and (transport := self.connections[number].transport) is not None:
                transport.close()

    def joined(self, connection: ClientConnection) -> None:
        """Admit a connection, or refuse a second one on a port."""
        port = self.ports[connection.number]
        holder = self.connections.get(connection.number)
        if holder is not None:
            limit = SILENT if holder.opened else MUTE
            if self.clock() - holder.heard >= limit:
                self.give_up(holder, limit)
                holder = None
        if holder is not None:
            who = peer_of(connection.transport)
            LOG.warning("%s: port %d: %s refused: the port is taken", self.ranger.name, port, who)
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
        """Send the greeting: name, port, status word, lease."""
        for out in self.ranger.greeting(self.ports[connection.number]):
            connection.tell(out.reply)

    def give_up(self, holder: ClientConnection, limit: float) -> None:
        """Close a silent connection whose port another one needs."""
        LOG.warning("%s: %s was silent: closed", self._port_name(holder.number), peer_of(holder.transport))
        holder.refuse(f"no line received for {limit:g} s, and another client needs this port")
        self.left(holder)

    def left(self, connection: ClientConnection) -> None:
        """Forget a closed connection: drop its commands, free its port."""
        if self.connections.get(connection.number) is connection:
            del self.connections[connection.number]
            self.ranger.disconnect(connection.number)
