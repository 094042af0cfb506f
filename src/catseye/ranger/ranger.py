"""One ZY: the loop that serves commands, schedule, scan, updates and status, around its state. No socket here.

A transport gives it lines of connections (`receive`), calls `turn` again and again, and sends what that returns.
Each connection's commands run in the order received, one at a time; one that waits for the hardware gives its turn
back and is asked again, and a long answer comes in slices. What makes dark or stops passes all queues: it is carried
out when it is received. In a turn: interlock and laser, the holder's command, then the others', at most one scheduled
one, a step of the scan or the stream, the Sun, updates, the status word. `rest` says how long nothing will be due.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from catseye.errors import CatseyeError, InputError
from catseye.geometry.sky.time_tag import PER_SECOND
from catseye.ranger.commands import COMMANDS, stops, undoes
from catseye.ranger.handlers.table import HANDLERS, holder_of, latch_of, scan_rounds, stream_shots, watch_sun
from catseye.ranger.head import RangerHead
from catseye.ranger.lanes import SCHEDULE, Lane, Lanes, Running, acts
from catseye.ranger.latch import Latch
from catseye.ranger.line import TICK_NS, Reply, Request, nanoseconds_of, nanoseconds_to_ticks, parse_request
from catseye.ranger.schedule import Scheduler
from catseye.ranger.state import VERSION, Lease, Outgoing, RangerState, Values
from catseye.ranger.status import StatusWord, word_text
from catseye.ranger.sun_watch import SunSource

MOST_QUEUED = 256  # commands of one connection
REPLIES_A_TURN = 16  # of a long answer: what else is due waits no longer
UPDATE_NS = PER_SECOND // 2
POLL_NS = 5_000_000  # while something is under way
FINE_NS, FINE_SPAN_NS = 1_000_000, 10_000_000  # when it is due, and for how long
WATCH_NS = 100_000_000  # the head's own changes
UNHEARD_NS = PER_SECOND  # the same where nobody listens
SLOW_NS = 20_000_000  # a long answer that waits for its reader
LIVE_NS = 50_000_000  # an interlock, while there is light or an amplifier is on
BY_HAND = frozenset(["LEASE", "UNLATCH"])  # a person's word of now: no stamp to come
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
    laser_at_boot   as the notes' rangers: at boot the laser is as its hardware has it, homed or not

    `room` says whether a connection can be given more of a long answer now; `orders` counts what the holder of the
    lease has ordered.
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
        laser_at_boot: bool = False,
    ):
        self.laser_at_boot = laser_at_boot
        super().__init__(name, head, HANDLERS, limits=limits, files=files, mirror=mirror, sun=sun, turning=turning)
        self.room: Callable[[int], bool] = lambda client: True
        self.orders = 0
        self._lanes = Lanes()
        self._ask_at: dict[str, int | None] = {}  # by what waits for the head: when to ask it again
        self._word: StatusWord | None = None
        self._pushed: dict[tuple[str, ...], Values] = {}
        self._next_update = 0
        self._told_lease: Lease | None = None
        self._told_latch: Latch | None = self.latch

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
        """A line of a connection: queued, refused or, where it cannot wait, done at once; an empty one asks nothing."""
        try:
            request = parse_request(line)
            if request is None:
                return []
            lane = self._lanes.of(client)
            if len(lane.waiting) >= MOST_QUEUED:
                raise InputError(f"{MOST_QUEUED} commands wait already (expected fewer: send slower)")
        except InputError as problem:
            return [Outgoing(Reply("LINE", False, (plain_text(str(problem)),), 0, self.now_ticks()), client)]
        due = request.ticks is None or request.ticks * TICK_NS <= self.now_ns()
        if stops(request) and due:
            return self._stop(client, request)
        if request.command in BY_HAND and not due:
            return [self._refused(request, "it is for now (expected it without a stamp)", client)]
        if request.command == "LEASE" and self._leases_at_once(client, request):
            return self._leased(client, request)
        stranger = self._stranger(client, request)
        if stranger is not None:
            return [self._refused(request, stranger, client)]
        if self._holds(client) and acts(request):
            self.orders += 1
        lane.waiting.append(request)
        return []

    def _holds(self, client: int) -> bool:
        return self.lease is not None and self.lease.client == client

    def _stranger(self, client: int, request: Request) -> str | None:
        """Why a connection may not give a command, having no lease; None where it may."""
        if not self.guarded or not acts(request) or self._holds(client):
            return None
        who = "nobody has it" if self.lease is None else f"{self.lease.name} has it"
        return f"{request.command} needs the lease: {who} (expected LEASE and a name first)"

    def _leases_at_once(self, client: int, request: Request) -> bool:
        """True for a request that renews or takes the lease: it waits for nothing."""
        words = request.parameters
        return len(words) == 2 or (len(words) == 1 and words[0].lower() != "none")

    def _leased(self, client: int, request: Request) -> list[Outgoing]:
        """Take or renew the lease; what the holder before it had ordered is dropped."""
        before = self.lease
        try:
            values = self.work_of(client, request)
        except CatseyeError as problem:
            return [self._refused(request, str(problem), client)]
        assert isinstance(values, tuple)
        self.orders += 1
        outgoing = [self._answer(client, request, values)]
        if before is not None and self.lease is not None and before.client != client:
            outgoing += self._dropped(f"{self.lease.name} has the lease now", before.client)
        return outgoing

    # Dark and still -------------------------------------------------------------------------------------------------

    def _stop(self, client: int, request: Request) -> list[Outgoing]:
        """Make dark, or stop, before all that waits; from outside the lease it holds until it is cleared."""
        outside = self.guarded and not self._holds(client)
        outgoing: list[Outgoing] = []
        try:
            COMMANDS[request.command].read(request)
            if request.command == "STOP":
                outgoing += self._all_stopped(f"STOP of {self.peer(client)}")
            answer = self.work_of(client, request)
        except CatseyeError as problem:
            return [self._refused(request, str(problem), client)]
        assert isinstance(answer, tuple)
        for whose, undoing in self._lanes.take_out(lambda waiting: undoes(waiting, request)):
            outgoing.append(self._refused(undoing, f"{request.command} came after it", whose))
        self.scheduler.entries = [e for e in self.scheduler.entries if not undoes(e.request, request)]
        if outside and request.command in ("PS", "AXIS", "STOP"):
            order = f"{request.command} from {self.peer(client)} which has not the lease"
            light, moves = request.command != "AXIS", request.command != "PS"
            self.set_latch(Latch(light, moves, order).joined(self.latch))
        return [self._answer(client, request, answer), *outgoing, *self._latch_told()]

    def _all_stopped(self, why: str) -> list[Outgoing]:
        outgoing = self.make_safe(why, free=False)
        self.scheduler = Scheduler()
        return [*outgoing, *self._dropped(why)]

    def _latch_told(self) -> list[Outgoing]:
        """Tell all that a dark order holds now, or is cleared."""
        if self.latch == self._told_latch:
            return []
        self._told_latch = self.latch
        if self.latch is None:
            cleared = f"cleared by {self.cleared_by or 'a person'}"
            return [Outgoing(self._reply(Request("LATCH"), True, ("none", cleared)))]
        return [Outgoing(self._reply(Request("LATCH"), True, latch_of(self)))]

    def make_safe(self, why: str, *, free: bool = True) -> list[Outgoing]:
        """Laser and motors off, nothing under way or scheduled any more; what is to be told.

        free   the lease, too

        Nothing is told where all that was so already.
        """
        head = self.head
        if not (head.laser_on() or head.enabled(0) or head.enabled(1) or (free and self.lease is not None)):
            return []
        self.scheduler = Scheduler()
        self.end_scan()
        self.end_stream()
        self.switch_laser(False)
        for axis in (0, 1):
            head.enable(axis, False)
        self.aimed = self.heading = None
        self.lease = None if free else self.lease
        safe = Outgoing(self._reply(Request("SAFE"), False, (plain_text(f"{why}: laser and motors are off"),)))
        return [safe, *self._dropped("laser and motors are off")]

    def _dropped(self, why: str, client: int | None = None) -> list[Outgoing]:
        """Drop what changes the ranger, under way or waiting; those who asked are answered."""
        taken = self._lanes.take_out(acts, client, running=True)
        return [self._refused(request, f"dropped: {why}", whose) for whose, request in taken]

    def _watch(self) -> list[Outgoing]:
        """The interlock, and light that nobody switched on or whose direction nobody knows."""
        why = self.interlock()
        outgoing = self.make_safe(f"the interlock is open ({why})", free=False) if why else []
        if not self.head.laser_on():
            self.lit = False
            return outgoing
        why = "" if self.lit else "the laser came on by itself"
        if not self.homed and not self.laser_at_boot:
            why = "an axis is not homed"
        if why:
            self.switch_laser(False)
            outgoing.append(Outgoing(self._reply(Request("SAFE"), False, (f"{why}: laser off",))))
        return outgoing

    # Turns ----------------------------------------------------------------------------------------------------------

    def disconnect(self, client: int) -> None:
        """A connection is gone, its lease with it: its commands are dropped, also scheduled ones; a scan goes on."""
        if self._holds(client):
            self.lease = None
        self._lanes.drop(client)
        self.peers.pop(client, None)
        self.scheduler.clear(client)
        if self.stream is not None and self.stream.client == client:
            self.end_stream()

    def turn(self) -> list[Outgoing]:
        """One pass of the loop; what is to be sent."""
        outgoing = self._watch()
        for lane in self._lanes.in_turn(None if self.lease is None else self.lease.client):
            outgoing += self._lane_step(lane)
        if self._lanes.acting is None and not self.scanning and self.scheduler.entries:
            entry = self.scheduler.take(self.now_ns())
            if entry is not None:
                outgoing += self._begin(self._lanes.of(SCHEDULE), entry.client, replace(entry.request, ticks=None))
        outgoing += self._scan_step()
        outgoing += self._stream_step()
        outgoing += [Outgoing(self._reply(Request("SUN"), False, (text,))) for text in watch_sun(self)]
        if self.lease != self._told_lease:
            self._told_lease = self.lease
            but = None if self.lease is None else self.lease.client  # who has been answered
            outgoing.append(Outgoing(self._reply(Request("LEASE"), True, holder_of(self)), but=but))
        outgoing += self._latch_told()
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
            return self._watch_ns(heard) / PER_SECOND
        now = self.now_ns()
        due = [now + self._watch_ns(heard)]
        waits = [(each.ask_at, each.more) for each in self._lanes.running]
        if self._scan_work is not None:
            waits.append((self._ask_at.get("scan"), False))
        if self._stream_work is not None:
            waits.append((self._ask_at.get("stream"), False))
        for at, more in waits:
            if more:  # a long answer whose reader takes no more for now
                due.append(now + SLOW_NS)
                continue
            fine = at is not None and now < at + FINE_SPAN_NS
            due.append(now + POLL_NS if at is None else max(at, now + (FINE_NS if fine else POLL_NS)))
        if (self.scanning and self._scan_work is None) or (self.stream is not None and self._stream_work is None):
            return 0.0
        if self._lanes.acting is None and not self.scanning and self.scheduler.due_ns is not None:
            due.append(self.scheduler.due_ns)
        if self.updates:
            due.append(self._next_update)
        return max(0, min(due) - now) / PER_SECOND

    def _watch_ns(self, heard: bool) -> int:
        """ns after which the head is looked at again, when nothing is under way."""
        head = self.head
        if self._head_interlock is not None and (head.laser_on() or head.enabled(0) or head.enabled(1)):
            return LIVE_NS
        return WATCH_NS if heard else UNHEARD_NS

    def waiting(self, client: int) -> int:
        """Commands of a connection that have not begun."""
        return len(self._lanes.of(client).waiting)

    @property
    def has_queued(self) -> bool:
        """True where the next turn can begin a command, or go on with a long answer."""
        lanes = self._lanes
        return any(lanes.can_begin(lane) for lane in lanes.in_turn(None)) or any(
            each.more and self.room(each.client) for each in lanes.running
        )

    @property
    def busy(self) -> bool:
        """True while a command runs or waits."""
        return self._lanes.busy

    @property
    def idle(self) -> bool:
        """Whether nothing runs, waits, scans or streams."""
        return not self._lanes.busy and not self.scanning and self.stream is None

    # Inside ---------------------------------------------------------------------------------------------------------

    def _lane_step(self, lane: Lane) -> list[Outgoing]:
        """Go on with a connection's command, or begin its next."""
        if lane.running is not None:
            return self._go_on(lane, lane.running)
        if not self._lanes.can_begin(lane):
            return []
        request = lane.waiting.popleft()
        return self._begin(lane, lane.client, request)

    def _begin(self, lane: Lane, client: int, request: Request) -> list[Outgoing]:
        if stops(request) and (request.ticks is None or request.ticks * TICK_NS <= self.now_ns()):
            return self._stop(client, request)  # it was scheduled
        stranger = self._stranger(client, request)
        if stranger is not None:  # the lease went elsewhere meanwhile
            return [self._refused(request, stranger, client)]
        if request.command != "AT" and request.command not in COMMANDS:
            unknown = Reply("UNKNOWN", None, (f"command {request.command}",), request.tid, self.now_ticks())
            return [Outgoing(unknown, client)]
        try:
            if request.ticks is not None and request.ticks * TICK_NS > self.now_ns():
                COMMANDS[request.command].read(request)
                self.scheduler.add(client, request, request.ticks * TICK_NS)
                return []
            answer = self.work_of(client, request)
        except KeyError:
            text = "a command that schedules takes no stamp (expected AT start, ...)"
            return [self._refused(request, text, client)]
        except CatseyeError as problem:
            return [self._refused(request, str(problem), client)]
        if isinstance(answer, tuple):
            return [self._answer(client, request, answer)]
        lane.running = Running(client, request, answer, acts(request))
        return self._go_on(lane, lane.running)

    def _go_on(self, lane: Lane, running: Running) -> list[Outgoing]:
        client, request = running.client, running.request
        outgoing: list[Outgoing] = []
        running.more = False
        if not running.acts and not self.room(client):
            running.more = True
            return []
        for _ in range(REPLIES_A_TURN):
            try:
                values = next(running.work)
            except StopIteration as end:
                lane.running = None
                return outgoing if end.value is None else [*outgoing, self._answer(client, request, end.value)]
            except CatseyeError as problem:
                lane.running = None
                return [*outgoing, self._refused(request, str(problem), client)]
            if values is None or isinstance(values, int):
                running.ask_at = values
                return outgoing
            if isinstance(values, Reply):  # of a command that this one runs
                outgoing.append(Outgoing(replace(values, tid=request.tid, ticks=self._stamp(values))))
            else:
                outgoing.append(self._answer(client, request, values))
        running.more = True
        return outgoing

    def _answer(self, client: int, request: Request, values: Values) -> Outgoing:
        """To who asked; what was done all hear."""
        return Outgoing(self._reply(request, True, values), None if acts(request) else client)

    def _refused(self, request: Request, text: str, client: int) -> Outgoing:
        """To who asked; of what would have changed the ranger all hear."""
        reply = self._reply(request, False, (plain_text(text.removeprefix(f"{request.command}: ")),))
        return Outgoing(reply, None if acts(request) and self._may(client) else client)

    def _may(self, client: int) -> bool:
        return not self.guarded or self._holds(client)

    def _reply(self, request: Request, ok: bool, values: Values) -> Reply:
        reply = Reply(request.command, ok, values, request.tid)
        return replace(reply, ticks=self._stamp(reply))

    def _stamp(self, reply: Reply) -> int:
        """Just after the trigger for a measurement, completion for all else."""
        if reply.ok and reply.command in OF_A_SHOT and self.measured is not None:
            return nanoseconds_to_ticks(nanoseconds_of(self.measured.buffer.triggered))
        return self.now_ticks()

    def _scan_step(self) -> list[Outgoing]:
        if not self.scanning or self._lanes.acting is not None:
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
