"""One ZY: the loop that serves commands, schedule, scan, updates and status, around its state. No socket here.

A transport gives it lines of connections (`receive`), calls `turn` again and again, and sends what that returns.
Commands run in the order received, one at a time; one that waits for the hardware gives its turn back and is asked
again. In a turn: the running or next command, at most one scheduled one, a step of the scan or the stream, the Sun,
updates, the status word. `rest` says how long nothing will be due.
"""

from collections import deque
from dataclasses import replace
from pathlib import Path

from catseye.errors import CatseyeError, InputError
from catseye.geometry.sky.time_tag import PER_SECOND
from catseye.ranger.commands import COMMANDS
from catseye.ranger.handlers.table import HANDLERS, holder_of, scan_rounds, stream_shots, watch_sun
from catseye.ranger.head import RangerHead
from catseye.ranger.line import TICK_NS, Reply, Request, nanoseconds_of, nanoseconds_to_ticks, parse_request
from catseye.ranger.schedule import Scheduler
from catseye.ranger.state import VERSION, Outgoing, RangerState, Values, Work
from catseye.ranger.status import StatusWord, word_text
from catseye.ranger.sun_watch import SunSource

MOST_QUEUED = 256  # commands of all connections
REPLIES_A_TURN = 64
UPDATE_NS = PER_SECOND // 2
POLL_NS = 5_000_000  # while something is under way
FINE_NS, FINE_SPAN_NS = 1_000_000, 10_000_000  # when it is due, and for how long
WATCH_NS = 100_000_000  # the head's own changes
UNHEARD_NS = PER_SECOND  # the same where nobody listens
OF_A_SHOT = frozenset(["TRG", "MPC", "RAD", "MAG", "SEQ", "CMEAS", "BUF"])
WATCHED = (
    ("ACP", "0"),
    ("ACP", "1"),
    *((name,) for name in ("MOD", "CYC", "SFQ", "IFF", "D0", "NG", "BP", "ALPHA", "BETA", "MO", "EZ", "ENTEMP", "PS")),
)


class Ranger(RangerState):
    """A ZY behind its head.

    name      as it greets: ZY101
    head      the hardware
    limits    counts, lowest and highest azimuth that the stops allow
    files     folder of the initialisation files, None without
    mirror    name of its head, as in its initialisation file's
    sun       the ranger's own direction of the Sun for an MJD, None without
    turning   its frame turns, as on the feed arm: it moves only if SUN was told within 60 s, and has no own Sun
    """

    def __init__(
        self,
        name: str,
        head: RangerHead,
        *,
        limits: tuple[float, float],
        files: Path | None = None,
        mirror: str = "zp",
        sun: SunSource | None = None,
        turning: bool = False,
    ):
        super().__init__(name, head, HANDLERS, limits=limits, files=files, mirror=mirror, sun=sun, turning=turning)
        self._waiting: deque[tuple[int, Request]] = deque()
        self._running: tuple[int, Request, Work] | None = None
        self._ask_at: dict[str, int | None] = {}  # by what waits for the head: when to ask it again
        self._word: StatusWord | None = None
        self._pushed: dict[tuple[str, ...], Values] = {}
        self._next_update = 0
        self._told_lease: tuple[int, str] | None = None

    # What a transport calls -----------------------------------------------------------------------------------------

    def greeting(self, port: int) -> list[Outgoing]:
        """What a new connection hears: HELLO, CONNECT, STW."""
        greetings = [
            Reply("HELLO", None, (f"This is {self.name} ver. {VERSION}",)),
            Reply("CONNECT", True, (str(port),)),
            Reply("STW", True, (word_text(self.status()),)),
        ]
        return [Outgoing(replace(reply, ticks=self.now_ticks())) for reply in greetings]

    def receive(self, client: int, line: str) -> list[Outgoing]:
        """A line of a connection: queued, or refused at once; an empty one asks nothing."""
        try:
            request = parse_request(line)
            if request is None:
                return []
            if len(self._waiting) >= MOST_QUEUED:
                raise InputError(f"{MOST_QUEUED} commands wait already (expected fewer: send slower)")
        except InputError as problem:
            return [Outgoing(Reply("LINE", False, (plain_text(str(problem)),), 0, self.now_ticks()), client)]
        stranger = self._stranger(client, request)
        if stranger is not None and (client, "LEASE") not in ((each, queued.command) for each, queued in self._waiting):
            return [replace(self._refused(request, stranger), client=client)]
        self._waiting.append((client, request))
        return []

    def _stranger(self, client: int, request: Request) -> str | None:
        """Why a connection may not give a command, having no lease; None where it may."""
        if not self.guarded or request.command == "BYE" or (self.lease is not None and self.lease[0] == client):
            return None
        row = COMMANDS.get(request.command)
        if request.command != "AT" and (row is None or row.only_asks(request)):
            return None
        who = "nobody has it" if self.lease is None else f"{self.lease[1]} has it"
        return f"{request.command} needs the lease: {who} (expected LEASE and a name first)"

    def make_safe(self, why: str, *, free: bool = True) -> list[Outgoing]:
        """Laser and motors off, nothing under way or scheduled any more; what is to be told.

        free   the lease, too

        Nothing is told where all that was so already.
        """
        head = self.head
        if not (head.laser_on() or head.enabled(0) or head.enabled(1) or (free and self.lease is not None)):
            return []
        self._waiting.clear()
        self._running = None
        self.scheduler = Scheduler()
        self.end_scan()
        self.end_stream()
        head.switch_laser(False)
        for axis in (0, 1):
            head.enable(axis, False)
        self.aimed = self.heading = None
        self.lease = None if free else self.lease
        return [Outgoing(self._reply(Request("SAFE"), False, (plain_text(f"{why}: laser and motors are off"),)))]

    def disconnect(self, client: int) -> None:
        """A connection is gone, its lease with it: queued and scheduled commands are dropped; a scan goes on."""
        if self.lease is not None and self.lease[0] == client:
            self.lease = None
        self._waiting = deque(item for item in self._waiting if item[0] != client)
        self.scheduler.clear(client)
        if self.stream is not None and self.stream.client == client:
            self.end_stream()

    def turn(self) -> list[Outgoing]:
        """One pass of the loop; what is to be sent."""
        outgoing: list[Outgoing] = []
        if self._running is None and self._waiting:
            outgoing += self._begin(*self._waiting.popleft())
        elif self._running is not None:
            outgoing += self._go_on()
        if self._running is None and not self.scanning and self.scheduler.entries:
            entry = self.scheduler.take(self.now_ns())
            if entry is not None:
                outgoing += self._begin(entry.client, replace(entry.request, ticks=None))
        outgoing += self._scan_step()
        outgoing += self._stream_step()
        outgoing += [Outgoing(self._reply(Request("SUN"), False, (text,))) for text in watch_sun(self)]
        why = self.interlock()
        if why:
            outgoing += self.make_safe(f"the interlock is open ({why})", free=False)
        if self.lease != self._told_lease:
            self._told_lease = self.lease
            if not any(each.reply.command == "LEASE" for each in outgoing):  # which all heard
                outgoing.append(Outgoing(self._reply(Request("LEASE"), True, holder_of(self))))
        outgoing += self._updates()
        word = self.status()
        if word != self._word:
            if self._word is not None:
                outgoing.append(Outgoing(self._reply(Request("STW"), True, (word_text(word),))))
            self._word = word
        return outgoing

    def rest(self, *, heard: bool = True) -> float:
        """How long, s, nothing can be due if no line comes.

        heard   somebody listens; else only the Sun and what is under way count
        """
        if self.has_queued:
            return 0.0
        if self.idle and not self.updates and not self.scheduler.entries:
            return (WATCH_NS if heard else UNHEARD_NS) / PER_SECOND
        now = self.now_ns()
        due = [now + (WATCH_NS if heard else UNHEARD_NS)]
        for work, at in (
            (self._running, self._ask_at.get("command")),
            (self._scan_work, self._ask_at.get("scan")),
            (self._stream_work, self._ask_at.get("stream")),
        ):
            if work is not None:
                fine = at is not None and now < at + FINE_SPAN_NS
                due.append(now + POLL_NS if at is None else max(at, now + (FINE_NS if fine else POLL_NS)))
        if (self.scanning and self._scan_work is None) or (self.stream is not None and self._stream_work is None):
            return 0.0
        if self._running is None and not self.scanning and self.scheduler.due_ns is not None:
            due.append(self.scheduler.due_ns)
        if self.updates:
            due.append(self._next_update)
        return max(0, min(due) - now) / PER_SECOND

    def waiting(self, client: int) -> int:
        """Commands of a connection that have not begun."""
        return sum(each == client for each, _ in self._waiting)

    @property
    def has_queued(self) -> bool:
        """Whether the next turn can begin a command that waits."""
        return self._running is None and bool(self._waiting)

    @property
    def idle(self) -> bool:
        """Whether nothing runs, waits, scans or streams."""
        return self._running is None and not self._waiting and not self.scanning and self.stream is None

    # Inside ---------------------------------------------------------------------------------------------------------

    def _begin(self, client: int, request: Request) -> list[Outgoing]:
        stranger = self._stranger(client, request)
        if stranger is not None:  # behind a LEASE that was refused, or scheduled by one who has it no more
            return [replace(self._refused(request, stranger), client=client)]
        if request.command != "AT" and request.command not in COMMANDS:
            unknown = Reply("UNKNOWN", None, (f"command {request.command}",), request.tid, self.now_ticks())
            return [Outgoing(unknown)]
        try:
            if request.ticks is not None and request.ticks * TICK_NS > self.now_ns():
                COMMANDS[request.command].read(request)
                self.scheduler.add(client, request, request.ticks * TICK_NS)
                return []
            answer = self.work_of(client, request)
        except KeyError:
            return [self._refused(request, "a command that schedules takes no stamp (expected AT start, ...)")]
        except CatseyeError as problem:
            return [self._refused(request, str(problem))]
        if isinstance(answer, tuple):
            return [self._answer(client, request, answer)]
        self._running = (client, request, answer)
        return self._go_on()

    def _go_on(self) -> list[Outgoing]:
        if self._running is None:
            return []
        client, request, work = self._running
        outgoing: list[Outgoing] = []
        for _ in range(REPLIES_A_TURN):
            try:
                values = next(work)
            except StopIteration as end:
                self._running = None
                return outgoing if end.value is None else [*outgoing, self._answer(client, request, end.value)]
            except CatseyeError as problem:
                self._running = None
                return [*outgoing, self._refused(request, str(problem))]
            if values is None or isinstance(values, int):
                self._ask_at["command"] = values
                return outgoing
            if isinstance(values, Reply):  # of a command that this one runs
                outgoing.append(Outgoing(replace(values, tid=request.tid, ticks=self._stamp(values))))
            else:
                outgoing.append(self._answer(client, request, values))
        return outgoing

    def _answer(self, client: int, request: Request, values: Values) -> Outgoing:
        private = request.command in ("BUF", "BYE")
        return Outgoing(self._reply(request, True, values), client if private else None)

    def _refused(self, request: Request, text: str) -> Outgoing:
        return Outgoing(self._reply(request, False, (plain_text(text.removeprefix(f"{request.command}: ")),)))

    def _reply(self, request: Request, ok: bool, values: Values) -> Reply:
        reply = Reply(request.command, ok, values, request.tid)
        return replace(reply, ticks=self._stamp(reply))

    def _stamp(self, reply: Reply) -> int:
        """Just after the trigger for a measurement, completion for all else."""
        if reply.ok and reply.command in OF_A_SHOT and self.measured is not None:
            return nanoseconds_to_ticks(nanoseconds_of(self.measured.buffer.triggered))
        return self.now_ticks()

    def _scan_step(self) -> list[Outgoing]:
        if not self.scanning or self._running is not None:
            return []
        if self._scan_work is None:
            self._scan_work = scan_rounds(self)
        reply = next(self._scan_work, self)
        if reply is self:
            self.scanning, self._scan_work = False, None
            return []
        if isinstance(reply, Reply):
            self._ask_at["scan"] = self.now_ns()
            return [Outgoing(replace(reply, ticks=self._stamp(reply)))]
        self._ask_at["scan"] = reply if isinstance(reply, int) else None
        return []

    def _stream_step(self) -> list[Outgoing]:
        if self.stream is None:
            return []
        if self._stream_work is None:
            self._stream_work = stream_shots(self, self.stream)
        outgoing: list[Outgoing] = []
        for each in self._stream_work:
            if not isinstance(each, Outgoing):
                self._ask_at["stream"] = each
                return outgoing
            outgoing.append(replace(each, reply=replace(each.reply, ticks=self._stamp(each.reply))))
        self.end_stream()
        return outgoing

    def _updates(self) -> list[Outgoing]:
        if not self.updates:
            return []
        now = self.now_ns()
        if 0 < self._next_update - now <= UPDATE_NS:  # further off: the clock was set back
            return []
        self._next_update = now + UPDATE_NS
        outgoing = []
        for name, *rest in WATCHED:
            request = Request(name, tuple(rest))
            try:
                values = self.work_of(-1, request)
            except CatseyeError:
                continue  # not known now: there is nothing to push
            if isinstance(values, tuple) and self._pushed.get((name, *rest)) != values:
                self._pushed[name, *rest] = values
                outgoing.append(Outgoing(self._reply(request, True, values)))
        return outgoing


def plain_text(text: str) -> str:
    """Printable ASCII in one line."""
    return "".join(c if " " <= c <= "~" else "?" for c in text)[:500]
