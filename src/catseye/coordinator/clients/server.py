"""The coordinator's port for displays, and for monitor and control.

It uses the ZY grammar: a person on `nc` can use it. The cost of one client is bounded as at a ranger: a line of 1024
bytes, 200 lines a second (more are left unread), 1 MiB not yet read (then it is cut off), 64 clients; long answers are
sent in parts. docs/formats/ziy.md is the reference.
"""

import asyncio
import hmac
import logging
import re
import secrets
from collections import deque
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import islice

from catseye.coordinator.clients.board import ALIASES, HELP, VERSION, Board
from catseye.coordinator.control.bindings import SiteControl
from catseye.coordinator.journal.entries import Entry
from catseye.coordinator.parts import ticks_now
from catseye.coordinator.samplers.rings import plain
from catseye.coordinator.ziy import Coordinator
from catseye.errors import CatseyeError, InputError
from catseye.ranger.door import DEFAULT_ACCESS, Door, enable_keep_alive_probes, refuse_exposed_port
from catseye.ranger.entrance import Doorway, Entrance
from catseye.ranger.first_line import peer_of
from catseye.ranger.line import LONGEST_REQUEST, Reply, Request, parse_request, stamp_text
from catseye.ranger.network import ConnectionMaker, Listener, Sockets

PORT = 5260
LOOPBACK = "127.0.0.1"
KEEP_ALIVE = 60.0  # s
LINES_A_SECOND = 200.0
LINE_BURST = 400.0  # lines
MOST_UNSENT = 2**20  # bytes
MOST_CLIENTS = 64
MUTE = 10.0  # s, after which a client that has sent no line can lose its place
RESUME_AFTER = 0.1  # s until a client above the rate limit is read again
LINES_A_SLICE, SLICE_PERIOD = 32, 0.005  # lines of a part of a long answer; s between two parts
LOOK = 0.5  # s between two checks for silent clients
TOKEN_BYTES = 16
WORDS = frozenset([*HELP, *ALIASES, "KEY"])  # allowed first words
KINDS = {
    "SHOT": "RANGES",
    "EPOCH": "EPOCHS",
    "EVENT": "EVENTS",
    "POSTURE": "POSTURE",
    "WEATHER": "WEATHER",
    "CORRECTION": "CORRECTIONS",
}
PUSHED = {sampler: kind for kind, sampler in KINDS.items()}
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,15}")
ASKING = ("MODE", "CLOCK", "REFERENCE")  # without parameters
SETTING = ("SET", "PREPARE", "START", "DISCARD", "DROP", "TAKE", "STREAM")
LOG = logging.getLogger(__name__)


def commands(request: Request) -> bool:
    """True if a request changes something: those need the lease."""
    return request.command in SETTING or (request.command in ASKING and bool(request.parameters))


class Client(asyncio.Protocol):
    """One connection; `wants` are its subscribed kinds."""

    def __init__(self, server: "ZiyServer"):
        self.server = server
        self.transport: asyncio.Transport | None = None
        self.wants: set[str] = set()
        self._entrance: Entrance | None = None
        self._unread = bytearray()
        self._rows: deque[tuple[int, Iterator[str]]] = deque()  # answers under way: TID, and lines without stamp
        self.name = ""  # as holder of the lease
        self.token = ""  # of that lease
        self.heard = self._since = asyncio.get_running_loop().time()
        self.has_spoken = False
        self._lines_allowed = LINE_BURST
        self._timer: asyncio.TimerHandle | None = None

    @property
    def peer(self) -> str:
        """Address of the other end, in words."""
        return peer_of(self.transport)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        enable_keep_alive_probes(transport)
        self._entrance = Entrance(self.server.gate, transport, self._say)
        self._entrance.begin()
        if self._entrance.admitted:
            self.server.joined(self)

    def connection_lost(self, exc: Exception | None) -> None:
        if self._timer is not None:
            self._timer.cancel()
        if self._entrance is not None:
            self._entrance.over()
        self._rows.clear()
        self.server.left(self)

    def data_received(self, data: bytes) -> None:
        if self._entrance is None or self.transport is None or self.transport.is_closing():
            return  # refused: the rest of its input is ignored
        self.heard, was_in = asyncio.get_running_loop().time(), self._entrance.admitted
        more = self._entrance.take(data)
        if more is None:
            return
        self.has_spoken = True
        if not was_in:
            self.server.joined(self)
        self._unread += more
        self._read_on()

    def answer(self, tid: int, lines: Iterable[str]) -> None:
        """Send a long answer in parts.

        Other clients and links are served between them.
        """
        self._rows.append((tid, iter(lines)))
        self._give()
        if self._rows and self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(SLICE_PERIOD, self._go_on)

    def _give(self) -> None:
        """Send the next part of the answers under way."""
        free = LINES_A_SLICE
        content: list[str] = []
        while self._rows and free > 0:
            tid, lines = self._rows[0]
            part = [f"{tid}\t{stamp_text(self.server.now_ticks())}\t{body}\n" for body in islice(lines, free)]
            content += part
            if len(part) < free:
                self._rows.popleft()
            free -= len(part)
        self.write("".join(content).encode("ascii", "replace"))

    def _go_on(self) -> None:
        """Send the next part; after the last, process pending input."""
        self._timer = None
        if self.transport is None or self.transport.is_closing():
            self._rows.clear()
            return
        self._give()
        if self._rows:
            self._timer = asyncio.get_running_loop().call_later(SLICE_PERIOD, self._go_on)
        else:
            self._resume()

    def _read_on(self) -> None:
        """Answer complete lines as far as the rate allows.

        Beyond that, stop reading from the peer for a while.
        """
        if self.transport is None or self.transport.is_closing():
            return
        time_s = asyncio.get_running_loop().time()
        self._lines_allowed, self._since = (
            min(LINE_BURST, self._lines_allowed + (time_s - self._since) * LINES_A_SECOND),
            time_s,
        )
        while self._lines_allowed >= 1.0 and not self._rows and not self.transport.is_closing():
            end = self._unread.find(b"\n", 0, LONGEST_REQUEST + 3)
            if end < 0:
                if len(self._unread) > LONGEST_REQUEST + 2:
                    self._unread.clear()
                    self.tell(0, f"LINE 0, line is longer than {LONGEST_REQUEST} bytes")
                    self.transport.close()
                break
            line = bytes(self._unread[:end]).removesuffix(b"\r")
            del self._unread[: end + 1]
            self._lines_allowed -= 1.0
            self.server.answer(self, line.decode("ascii", "replace"))
        if b"\n" in self._unread and not self.transport.is_closing():
            self.transport.pause_reading()
        if b"\n" in self._unread and self._timer is None and not self.transport.is_closing():
            self._timer = asyncio.get_running_loop().call_later(RESUME_AFTER, self._resume)

    def _resume(self) -> None:
        self._timer = None
        if self.transport is not None and not self.transport.is_closing():
            self.transport.resume_reading()
            self._read_on()

    def _say(self, reply: Reply) -> None:
        flag = "1" if reply.ok else "0"
        self.tell(0, ", ".join([f"{reply.command} {flag}", *reply.values]))

    def tell(self, tid: int, body: str) -> None:
        """Send a line with TID and present stamp."""
        self.write(f"{tid}\t{stamp_text(self.server.now_ticks())}\t{body}\n".encode("ascii", "replace"))

    def write(self, data: bytes) -> None:
        """Send; a peer that does not read is cut off."""
        if not data:
            return
        if self.transport is None or self.transport.is_closing():
            return
        self.transport.write(data)
        if self.transport.get_write_buffer_size() > MOST_UNSENT:
            LOG.warning("a client of the ZIY is cut off: more than %d bytes not read", MOST_UNSENT)
            self.transport.abort()


class ZiyServer:
    """A coordinator behind a port.

    host    address to listen at; by default only this machine
    port    0 takes any free one; `port` is the actual one after `start`
    control parameters besides the coordinator's own two
    """

    def __init__(
        self,
        coordinator: Coordinator,
        host: str = LOOPBACK,
        port: int = PORT,
        *,
        network: ConnectionMaker | None = None,
        door: Door = DEFAULT_ACCESS,
        control: SiteControl | None = None,
    ):
        self.coordinator, self.host, self.port, self.door = coordinator, host, port, door
        self.holder: Client | None = None  # holder of the lease
        self.board = Board(coordinator, control)
        self.clients: set[Client] = set()
        self.gate = Doorway(lambda: f"ZIY: port {self.port}", door, WORDS, _loop_time)
        self._network: ConnectionMaker = network or Sockets(door.tls)
        self._listener: Listener | None = None
        self._keeping: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Listen.

        Raises InputError if the port is not available, or would be exposed without a key.
        """
        refuse_exposed_port("ZIY", self.host, self.door)
        try:
            self._listener = await self._network.serve(partial(Client, self), self.host, self.port)
        except OSError as problem:
            raise InputError(
                f"ZIY: {self.host} port {self.port} is not available: {problem.strerror or problem}"
            ) from problem
        self.port = self._listener.port
        self.coordinator.listeners.append(self.publish)
        self._keeping = asyncio.get_running_loop().create_task(self._keep_alive())

    async def stop(self) -> None:
        """Close the connections and stop listening."""
        if self._keeping is not None:
            self._keeping.cancel()
            await asyncio.gather(self._keeping, return_exceptions=True)
        if self.publish in self.coordinator.listeners:
            self.coordinator.listeners.remove(self.publish)
        for client in list(self.clients):
            if client.transport is not None:
                client.transport.close()
        if self._listener is not None:
            await self._listener.close()
        await self.board.surface.stop()

    def now_ticks(self) -> int:
        """Present time of the clock in ticks."""
        return ticks_now(self.coordinator.clock)

    def joined(self, client: Client) -> None:
        """Greet a client; with all places taken, replace one that has sent no line, or refuse."""
        if len(self.clients) >= MOST_CLIENTS:
            self._drop_mute_client()
        if len(self.clients) >= MOST_CLIENTS:
            client.tell(0, f"CONNECT 0, {MOST_CLIENTS} clients are connected (expected fewer)")
            if client.transport is not None:
                client.transport.close()
            return
        self.clients.add(client)
        self.greet(client)

    def _drop_mute_client(self) -> None:
        """Close the client that has been there longest without ever saying a line."""
        mute = [each for each in self.clients if not each.has_spoken and _loop_time() - each.heard >= MUTE]
        if not mute:
            return
        first = min(mute, key=lambda each: each.heard)
        first.tell(0, f"LINE 0, nothing was said for {MUTE:g} s, and another wants this place")
        if first.transport is not None:
            first.transport.close()
        self.left(first)

    def greet(self, client: Client) -> None:
        """Send the greeting: name and port."""
        client.tell(0, f"HELLO This is ZIY {plain(self.coordinator.site.site.campaign.name)} ver. {VERSION}")
        client.tell(0, f"CONNECT 1, {self.port}")

    def left(self, client: Client) -> None:
        """Forget a closed connection and its lease."""
        self.clients.discard(client)
        if self.holder is client:
            self._lease(None, "")

    def publish(self, entry: Entry) -> None:
        """Store a durable entry in the samplers, push it to subscribers."""
        for sampler, (stamp, *values) in self.board.entry(entry):
            kind = PUSHED.get(sampler)
            wanting = [] if kind is None else [client for client in self.clients if kind in client.wants]
            if wanting:
                line = f"0\t{stamp}\t{kind} 1, {', '.join(values)}\n".encode("ascii", "replace")
                for client in wanting:
                    client.write(line)

    def answer(self, client: Client, line: str) -> None:
        """Process a client's line and answer it."""
        try:
            request = parse_request(line)
        except InputError as problem:
            client.tell(0, f"LINE 0, {plain(str(problem))}")
            return
        if request is None:
            return
        if request.command == "BYE":
            client.tell(request.tid, f"BYE 1, {self.port}, Closing Connection")
            if client.transport is not None:
                client.transport.close()
            return
        try:
            if request.ticks is not None:
                raise InputError("commands here take no stamp (expected only TID and command)")
            if self.door.lease and self.holder is not client and commands(request):
                who = "nobody has it" if self.holder is None else f"{self.holder.name} has it"
                raise InputError(f"{request.command} needs the lease: {who} (expected LEASE and a name first)")
            if request.command == "LEASE":
                values = self._leased(client, request)
                client.tell(request.tid, ", ".join(["LEASE 1", *values]))
                return
            result_rows = (
                self._subscribed(client, request) if request.command == "SUBSCRIBE" else self.board.rows(request)
            )
            rows = None if result_rows is None else list(result_rows)
        except CatseyeError as problem:
            client.tell(request.tid, f"{request.command} 0, {plain(str(problem))}")
            return
        if rows is None:
            client.tell(request.tid, f"UNKNOWN command {request.command}")
            return
        client.answer(request.tid, (", ".join([f"{request.command} 1", *row]) for row in rows))

    def _leased(self, client: Client, request: Request) -> tuple[str, ...]:
        """Query, take, renew (with token) or give back (none) the lease.

        Name and address of the holder; its token for a client that takes it.
        """
        words = request.parameters
        if len(words) > 2 or not all(NAME.fullmatch(word) for word in words[:1]):
            raise InputError("invalid name (expected LEASE, or LEASE and a letter with up to 15 letters and digits)")
        if not words:
            return self._holder()
        if len(words) == 2:
            self._renewed(client, *words)
            return self._holder()
        if words[0].lower() != "none":
            self._lease(client, words[0], secrets.token_hex(TOKEN_BYTES))
            return *self._holder(), client.token
        if self.holder is not client:
            raise InputError("this client does not hold the lease (see LEASE for its holder)")
        self._lease(None, "")
        return self._holder()

    def _renewed(self, client: Client, name: str, token: str) -> None:
        """Renew the lease by its token, perhaps from another connection."""
        holder = self.holder
        if holder is None or not hmac.compare_digest(token.encode(), holder.token.encode()):
            raise InputError("invalid token of the lease (expected LEASE and a name to take it)")
        if holder is not client:
            self._lease(client, name, token)

    def _holder(self) -> tuple[str, ...]:
        return ("none",) if self.holder is None else (self.holder.name, self.holder.peer)

    def _lease(self, client: Client | None, name: str, token: str = "") -> None:
        """Pass the lease on; notify other clients and the journal."""
        before = "nobody" if self.holder is None else f"{self.holder.name} ({self.holder.peer})"
        if self.holder is not None:
            self.holder.token = ""
        self.holder = client
        if client is not None:
            client.name, client.token = name, token
        self.coordinator.leased(before, "nobody" if client is None else f"{name} ({client.peer})")
        line = ", ".join(["LEASE 1", *self._holder()])
        for other_client in self.clients:
            if other_client is not client:
                other_client.tell(0, line)

    def _subscribed(self, client: Client, request: Request) -> Iterable[tuple[str, ...]]:
        """SUBSCRIBE [kind ...], separated by commas or blanks.

        The three usual kinds without any; NONE ends it.
        """
        kinds = [word.upper() for part in request.parameters for word in part.split()] or ["SHOT", "EPOCH", "EVENT"]
        strange = [word for word in kinds if word not in KINDS and word != "NONE"]
        if strange:
            raise InputError(f"{strange[0][:20]!a} cannot be subscribed (expected {' '.join(KINDS)} or NONE)")
        client.wants = set() if "NONE" in kinds else client.wants | set(kinds)
        return [(" ".join(sorted(client.wants)) or "NONE",)]

    async def _keep_alive(self) -> None:
        """Send empty lines once a minute; close silent clients."""
        last_sent = _loop_time()
        while True:
            await asyncio.sleep(LOOK)
            time_s = _loop_time()
            self.gate.check()
            for client in list(self.clients):
                if time_s - client.heard > self.door.idle and client.transport is not None:
                    client.tell(0, f"LINE 0, no line received for {self.door.idle:g} s")
                    client.transport.close()
                elif time_s - last_sent >= KEEP_ALIVE:
                    client.write(b"\n")
            if time_s - last_sent >= KEEP_ALIVE:
                last_sent = time_s


def _loop_time() -> float:
    """Time of the running loop, s."""
    return asyncio.get_running_loop().time()
