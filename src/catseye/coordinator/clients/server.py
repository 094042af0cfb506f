"""The coordinator's own port, for displays and for monitor and control, in the ZY grammar: a person on `nc` can use it.

What one client may cost is bounded as at a ranger: a line of 1024 bytes, 200 lines a second (what comes faster is left
unread), 1 MiB that it does not take (then it is cut off), 64 clients; long answers come in slices.
docs/formats/ziy.md is the reference.
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
from catseye.coordinator.clients.samplers import plain
from catseye.coordinator.journal.entries import Entry
from catseye.coordinator.parts import ticks_now
from catseye.coordinator.ziy import Coordinator
from catseye.errors import CatseyeError, InputError
from catseye.ranger.door import USUAL_DOOR, Door, notice_death, refuse_open
from catseye.ranger.entrance import Doorway, Entrance
from catseye.ranger.first_line import peer_of
from catseye.ranger.line import LONGEST_REQUEST, Reply, Request, parse_request, stamp_text
from catseye.ranger.network import ConnectionMaker, Listener, Sockets

PORT = 5260
LOOPBACK = "127.0.0.1"
KEEP_ALIVE = 60.0  # s
LINES_A_SECOND = 200.0
MOST_AT_ONCE = 400.0  # lines
MOST_UNSENT = 2**20  # bytes
MOST_CLIENTS = 64
MUTE = 10.0  # s, after which a client that never said a line gives its place to another
AGAIN = 0.1  # s until a client that came too fast is read on
LINES_A_SLICE, SLICE_EVERY = 32, 0.005  # of a long answer; s between two
LOOK = 0.5  # s between two looks for silent clients
TOKEN_BYTES = 16
WORDS = frozenset([*HELP, *ALIASES, "KEY"])  # that a first line may begin with
KINDS = {"SHOT": "RANGES", "EPOCH": "EPOCHS", "EVENT": "EVENTS", "POSTURE": "POSTURE", "WEATHER": "WEATHER"}
PUSHED = {sampler: kind for kind, sampler in KINDS.items()}
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,15}")
SETTING = ("SET", "PREPARE", "START", "DROP", "TAKE", "STREAM")
LOG = logging.getLogger(__name__)


def commands(request: Request) -> bool:
    """Whether a request is more than a question: those need the lease."""
    return request.command in SETTING or (request.command in ("MODE", "CLOCK") and bool(request.parameters))


class Client(asyncio.Protocol):
    """One connection; `wants` are the kinds that it has subscribed."""

    def __init__(self, server: "ZiyServer"):
        self.server = server
        self.transport: asyncio.Transport | None = None
        self.wants: set[str] = set()
        self._entrance: Entrance | None = None
        self._unread = bytearray()
        self._rows: deque[tuple[int, Iterator[str]]] = deque()  # answers under way: TID, and lines without stamp
        self.name = ""  # under which it has the lease
        self.token = ""  # of that lease
        self.heard = self._since = asyncio.get_running_loop().time()
        self.spoke = False  # it has said a line
        self._left = MOST_AT_ONCE
        self._timer: asyncio.TimerHandle | None = None

    @property
    def peer(self) -> str:
        """Address of the other end, in words."""
        return peer_of(self.transport)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        notice_death(transport)
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
            return  # turned away: what else it sends is not looked at
        self.heard, was_in = asyncio.get_running_loop().time(), self._entrance.admitted
        more = self._entrance.take(data)
        if more is None:
            return
        self.spoke = True
        if not was_in:
            self.server.joined(self)
        self._unread += more
        self._read_on()

    def answer(self, tid: int, lines: Iterable[str]) -> None:
        """Give an answer of many lines, in slices: other clients, and links, are served between them."""
        self._rows.append((tid, iter(lines)))
        self._give()
        if self._rows and self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(SLICE_EVERY, self._go_on)

    def _give(self) -> None:
        """Send the next slice of the answers under way."""
        left = LINES_A_SLICE
        told: list[str] = []
        while self._rows and left > 0:
            tid, lines = self._rows[0]
            taken = [f"{tid}\t{stamp_text(self.server.now_ticks())}\t{body}\n" for body in islice(lines, left)]
            told += taken
            if len(taken) < left:
                self._rows.popleft()
            left -= len(taken)
        self.write("".join(told).encode("ascii", "replace"))

    def _go_on(self) -> None:
        """The next slice; behind the last, what was sent meanwhile."""
        self._timer = None
        if self.transport is None or self.transport.is_closing():
            self._rows.clear()
            return
        self._give()
        if self._rows:
            self._timer = asyncio.get_running_loop().call_later(SLICE_EVERY, self._go_on)
        else:
            self._resume()

    def _read_on(self) -> None:
        """Answer whole lines as far as the rate allows; otherwise stop reading from the peer for a while."""
        if self.transport is None or self.transport.is_closing():
            return
        now = asyncio.get_running_loop().time()
        self._left, self._since = min(MOST_AT_ONCE, self._left + (now - self._since) * LINES_A_SECOND), now
        while self._left >= 1.0 and not self._rows and not self.transport.is_closing():
            end = self._unread.find(b"\n", 0, LONGEST_REQUEST + 3)
            if end < 0:
                if len(self._unread) > LONGEST_REQUEST + 2:
                    self._unread.clear()
                    self.tell(0, f"LINE 0, line is longer than {LONGEST_REQUEST} bytes")
                    self.transport.close()
                break
            line = bytes(self._unread[:end]).removesuffix(b"\r")
            del self._unread[: end + 1]
            self._left -= 1.0
            self.server.answer(self, line.decode("ascii", "replace"))
        if b"\n" in self._unread and not self.transport.is_closing():
            self.transport.pause_reading()
        if b"\n" in self._unread and self._timer is None and not self.transport.is_closing():
            self._timer = asyncio.get_running_loop().call_later(AGAIN, self._resume)

    def _resume(self) -> None:
        self._timer = None
        if self.transport is not None and not self.transport.is_closing():
            self.transport.resume_reading()
            self._read_on()

    def _say(self, reply: Reply) -> None:
        flag = "1" if reply.ok else "0"
        self.tell(0, ", ".join([f"{reply.command} {flag}", *reply.values]))

    def tell(self, tid: int, body: str) -> None:
        """A line with TID and the stamp of now."""
        self.write(f"{tid}\t{stamp_text(self.server.now_ticks())}\t{body}\n".encode("ascii", "replace"))

    def write(self, data: bytes) -> None:
        """Send; who does not take what it is sent is cut off, and costs nobody else anything."""
        if not data:
            return
        if self.transport is None or self.transport.is_closing():
            return
        self.transport.write(data)
        if self.transport.get_write_buffer_size() > MOST_UNSENT:
            LOG.warning("a client of the ZIY is cut off: more than %d bytes not taken", MOST_UNSENT)
            self.transport.abort()


class ZiyServer:
    """A coordinator behind a port.

    host    address to listen at; only this machine unless told otherwise
    port    0 takes any free one; `port` says which after `start`
    """

    def __init__(
        self,
        coordinator: Coordinator,
        host: str = LOOPBACK,
        port: int = PORT,
        *,
        network: ConnectionMaker | None = None,
        door: Door = USUAL_DOOR,
    ):
        self.coordinator, self.host, self.port, self.door = coordinator, host, port, door
        self.holder: Client | None = None  # who may set and command
        self.board = Board(coordinator)
        self.clients: set[Client] = set()
        self.gate = Doorway(lambda: f"ZIY: port {self.port}", door, WORDS, _loop_time)
        self._network: ConnectionMaker = network or Sockets(door.tls)
        self._listener: Listener | None = None
        self._keeping: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Listen. Raises InputError where the port cannot be had, or would be open to others without a key."""
        refuse_open("ZIY", self.host, self.door)
        try:
            self._listener = await self._network.serve(partial(Client, self), self.host, self.port)
        except OSError as problem:
            raise InputError(
                f"ZIY: {self.host} port {self.port} cannot be had: {problem.strerror or problem}"
            ) from problem
        self.port = self._listener.port
        self.coordinator.listeners.append(self.publish)
        self._keeping = asyncio.get_running_loop().create_task(self._keep_alive())

    async def stop(self) -> None:
        """Close the connections and listen no more."""
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

    def now_ticks(self) -> int:
        """Ticks of the clock at this instant."""
        return ticks_now(self.coordinator.clock)

    def joined(self, client: Client) -> None:
        """Greet; one too many has the place of a client that never said a line, or is turned away."""
        if len(self.clients) >= MOST_CLIENTS:
            self._give_up_mute()
        if len(self.clients) >= MOST_CLIENTS:
            client.tell(0, f"CONNECT 0, {MOST_CLIENTS} clients are connected (expected fewer)")
            if client.transport is not None:
                client.transport.close()
            return
        self.clients.add(client)
        self.greet(client)

    def _give_up_mute(self) -> None:
        """Close the client that has been there longest without ever saying a line."""
        mute = [each for each in self.clients if not each.spoke and _loop_time() - each.heard >= MUTE]
        if not mute:
            return
        first = min(mute, key=lambda each: each.heard)
        first.tell(0, f"LINE 0, nothing was said for {MUTE:g} s, and another wants this place")
        if first.transport is not None:
            first.transport.close()
        self.left(first)

    def greet(self, client: Client) -> None:
        """Who this is, and that the client is connected."""
        client.tell(0, f"HELLO This is ZIY {plain(self.coordinator.site.site.campaign.name)} ver. {VERSION}")
        client.tell(0, f"CONNECT 1, {self.port}")

    def left(self, client: Client) -> None:
        """Forget a connection that is over; its lease goes with it."""
        self.clients.discard(client)
        if self.holder is client:
            self._lease(None, "")

    def publish(self, entry: Entry) -> None:
        """Something is durable: kept in the samplers, and pushed to those who want it."""
        for sampler, (stamp, *values) in self.board.samplers.add(entry):
            kind = PUSHED.get(sampler)
            wanting = [] if kind is None else [client for client in self.clients if kind in client.wants]
            if wanting:
                line = f"0\t{stamp}\t{kind} 1, {', '.join(values)}\n".encode("ascii", "replace")
                for client in wanting:
                    client.write(line)

    def answer(self, client: Client, line: str) -> None:
        """Answer a line that a client sent."""
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
                raise InputError("commands here take no stamp (expected TID and command alone)")
            if self.door.lease and self.holder is not client and commands(request):
                who = "nobody has it" if self.holder is None else f"{self.holder.name} has it"
                raise InputError(f"{request.command} needs the lease: {who} (expected LEASE and a name first)")
            if request.command == "LEASE":
                values = self._leased(client, request)
                client.tell(request.tid, ", ".join(["LEASE 1", *values]))
                return
            found = self._subscribed(client, request) if request.command == "SUBSCRIBE" else self.board.rows(request)
            rows = None if found is None else list(found)
        except CatseyeError as problem:
            client.tell(request.tid, f"{request.command} 0, {plain(str(problem))}")
            return
        if rows is None:
            client.tell(request.tid, f"UNKNOWN command {request.command}")
            return
        client.answer(request.tid, (", ".join([f"{request.command} 1", *row]) for row in rows))

    def _leased(self, client: Client, request: Request) -> tuple[str, ...]:
        """LEASE asks who has it, LEASE name takes it, with its token renews it, LEASE none gives it back.

        Name and address of who has it then; who takes it is told its token, too.
        """
        words = request.parameters
        if len(words) > 2 or not all(NAME.fullmatch(word) for word in words[:1]):
            raise InputError("that is no name (expected LEASE, or LEASE and a letter with up to 15 letters and digits)")
        if not words:
            return self._holder()
        if len(words) == 2:
            self._renewed(client, *words)
            return self._holder()
        if words[0].lower() != "none":
            self._lease(client, words[0], secrets.token_hex(TOKEN_BYTES))
            return *self._holder(), client.token
        if self.holder is not client:
            raise InputError("it is not yours to give back (expected LEASE to see whose)")
        self._lease(None, "")
        return self._holder()

    def _renewed(self, client: Client, name: str, token: str) -> None:
        """Keep the lease of who shows its token; it goes along to another connection of the same program."""
        holder = self.holder
        if holder is None or not hmac.compare_digest(token.encode(), holder.token.encode()):
            raise InputError("that is not the token of the lease (expected LEASE and a name to take it)")
        if holder is not client:
            self._lease(client, name, token)

    def _holder(self) -> tuple[str, ...]:
        return ("none",) if self.holder is None else (self.holder.name, self.holder.peer)

    def _lease(self, client: Client | None, name: str, token: str = "") -> None:
        """Give the lease to another: told to all other clients, and in the journal, with their addresses."""
        before = "nobody" if self.holder is None else f"{self.holder.name} ({self.holder.peer})"
        if self.holder is not None:
            self.holder.token = ""
        self.holder = client
        if client is not None:
            client.name, client.token = name, token
        self.coordinator.leased(before, "nobody" if client is None else f"{name} ({client.peer})")
        line = ", ".join(["LEASE 1", *self._holder()])
        for each in self.clients:
            if each is not client:
                each.tell(0, line)

    def _subscribed(self, client: Client, request: Request) -> Iterable[tuple[str, ...]]:
        """SUBSCRIBE [what ...], commas or blanks between: the three usual kinds where none is named; NONE ends it."""
        asked = [word.upper() for part in request.parameters for word in part.split()] or ["SHOT", "EPOCH", "EVENT"]
        strange = [word for word in asked if word not in KINDS and word != "NONE"]
        if strange:
            raise InputError(f"{strange[0][:20]!a} cannot be subscribed (expected {' '.join(KINDS)} or NONE)")
        client.wants = set() if "NONE" in asked else client.wants | set(asked)
        return [(" ".join(sorted(client.wants)) or "NONE",)]

    async def _keep_alive(self) -> None:
        """An empty line to each client once a minute; meanwhile close the silent, and count wrong keys."""
        told = _loop_time()
        while True:
            await asyncio.sleep(LOOK)
            now = _loop_time()
            self.gate.check()
            for client in list(self.clients):
                if now - client.heard > self.door.idle and client.transport is not None:
                    client.tell(0, f"LINE 0, nothing was said for {self.door.idle:g} s")
                    client.transport.close()
                elif now - told >= KEEP_ALIVE:
                    client.write(b"\n")
            if now - told >= KEEP_ALIVE:
                told = now


def _loop_time() -> float:
    """Time of the running loop, s."""
    return asyncio.get_running_loop().time()
