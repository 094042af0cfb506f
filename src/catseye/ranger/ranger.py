"""A ZY: its loop of commands, schedule, scan, updates and status. No socket here.

A transport gives it lines of connections (`receive`), calls `turn` repeatedly, and sends what that returns.
Each connection's commands run in the order received, one at a time; one that waits for the hardware yields and is
polled later, and a long answer is sent in parts. Commands that switch light off or stop pass all queues: they are
executed on receipt. In a turn: interlock and laser, the holder's command, then the others', at most one scheduled
one, a step of the scan or the stream, the Sun, updates, the status word. `rest` is the time until something is due.
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
REPLIES_A_TURN = 16  # of a long answer: everything else waits no longer
UPDATE_NS = PER_SECOND // 2
POLL_NS = 5_000_000  # poll interval while something is under way
FINE_NS, FINE_SPAN_NS = 1_000_000, 10_000_000  # poll interval once it is due, and its duration
WATCH_NS = 100_000_000  # poll interval for the head's own changes
UNHEARD_NS = PER_SECOND  # the same without clients
SLOW_NS = 20_000_000  # poll interval of a long answer that waits for its reader
LIVE_NS = 50_000_000  # poll interval of an interlock, while the laser or an amplifier is on
IMMEDIATE = frozenset(["LEASE", "UNLATCH"])  # commands that take no future stamp
OF_A_SHOT = frozenset(["TRG", "MPC", "RAD", "MAG", "SEQ", "CMEAS", "BUF"])
WATCHED = (
    ("ACP", "0"),
    ("ACP", "1"),
    *((name,) for name in ("MOD", "CYC", "SFQ", "IFF", "D0", "NG", "BP", "ALPHA", "BETA", "MO", "EZ", "ENTEMP", "PS")),
)


class Ranger(RangerState):
    """A ZY behind its head.

    name      as in its greeting: ZY101
    head      the hardware
    limits    counts, lowest and highest azimuth that the stops allow
    files     folder of the initialisation files, None without
    mirror    name of its head, as in its initialisation file's
    sun       the ranger's own direction of the Sun for an MJD, None without
    turning   True if its frame turns, as on the feed arm: it needs SUN within 60 s to move, and has no Sun of its own
    laser_at_boot   True as for the notes' rangers: at boot the laser is as its hardware has it, homed or not

    `room` is True if a connection can take more of a long answer now; `orders` counts commands of the lease's holder.
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
        self._ask_at: dict[str, int | None] = {}  # work waiting for the head: time of the next poll
        self._word: StatusWord | None = None
        self._pushed: dict[tuple[str, ...], Values] = {}
        self._next_update = 0
        self._published_lease: Lease | None = None
        self._published_latch: Latch | None = self.latch

    # Interface of a transport -----------------------------------------------------------------------------------------

    def greeting(self, port: int) -> list[Outgoing]:
        """Greeting of a new connection: HELLO, CONNECT, STW."""
        greetings = [
            Reply("HELLO", None, (f"This is {self.name} ver. {VERSION}",)),
            Reply("CONNECT", True, (str(port),)),
            Reply("STW", True, (word_text(self.status()),)),
        ]
        return [Outgoing(replace(reply, ticks=self.now_ticks())) for reply in greetings]

    def receive(self, client: int, line: str) -> list[Outgoing]:
        """Queue, refuse or at once execute a line; ignore an empty one."""
        try:
            request = parse_request(line)
            if request is None:
                return []
            lane = self._lanes.of(client)
            if len(lane.waiting) >= MOST_QUEUED:
                raise InputError(f"{MOST_QUEUED} commands are queued already (send more slowly)")
        except InputError as problem:
            return [Outgoing(Reply("LINE", False, (plain_text(str(problem)),), 0, self.now_ticks()), client)]
        due = request.ticks is None or request.ticks * TICK_NS <= self.now_ns()
        if stops(request) and due:
            return self._stop(client, request)
        if request.command in IMMEDIATE and not due:
            return [self._refused(request, "it is for now (expected it without a stamp)", client)]
        if request.command == "LEASE" and self._leases_at_once(client, request):
            return self._leased(client, request)
        refusal = self._lease_refusal(client, request)
        if refusal is not None:
            return [self._refused(request, refusal, client)]
        if self._holds(client) and acts(request):
            self.orders += 1
        lane.waiting.append(request)
        return []

    def _holds(self, client: int) -> bool:
        return self.lease is not None and self.lease.client == client

    def _lease_refusal(self, client: int, request: Request) -> str | None:
        """Reason why a connection without the lease may not command; else None."""
        if not self.guarded or not acts(request) or self._holds(client):
            return None
        who = "nobody has it" if self.lease is None else f"{self.lease.name} has it"
        return f"{request.command} needs the lease: {who} (expected LEASE and a name first)"

    def _leases_at_once(self, client: int, request: Request) -> bool:
        """True for a request that takes or renews the lease."""
        words = request.parameters
        return len(words) == 2 or (len(words) == 1 and words[0].lower() != "none")

    def _leased(self, client: int, request: Request) -> list[Outgoing]:
        """Take or renew the lease; the former holder's commands are dropped."""
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

    # Stops -------------------------------------------------------------------------------------------------

    def _stop(self, client: int, request: Request) -> list[Outgoing]:
        """Execute a stop before all waiting commands.

        From outside the lease it is latched until it is cleared.
        """
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
        return [self._answer(client, request, answer), *outgoing, *self._latch_notices()]

    def _all_stopped(self, why: str) -> list[Outgoing]:
        outgoing = self.make_safe(why, free=False)
        self.scheduler = Scheduler()
        return [*outgoing, *self._dropped(why)]

    def _latch_notices(self) -> list[Outgoing]:
        """Notify all that a stop order is latched, or cleared."""
        if self.latch == self._published_latch:
            return []
        self._published_latch = self.latch
        if self.latch is None:
            cleared = f"cleared by {self.cleared_by or 'a person'}"
            return [Outgoing(self._reply(Request("LATCH"), True, ("none", cleared)))]
        return [Outgoing(self._reply(Request("LATCH"), True, latch_of(self)))]

    def make_safe(self, why: str, *, free: bool = True) -> list[Outgoing]:
        """Switch laser and motors off and drop all commands; notifications.

        free   True to free the lease, too

        Nothing is reported if all that was so already.
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
        """Drop commands that change the ranger; refusals for their clients."""
        removed = self._lanes.take_out(acts, client, running=True)
        return [self._refused(request, f"dropped: {why}", whose) for whose, request in removed]

    def _watch(self) -> list[Outgoing]:
        """Check the interlock, and light without a command or direction."""
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
        """Forget a closed connection, its lease and its commands; a scan goes on."""
        if self._holds(client):
            self.lease = None
        self._lanes.drop(client)
        self.peers.pop(client, None)
        self.scheduler.clear(client)
        if self.stream is not None and self.stream.client == client:
            self.end_stream()

    def turn(self) -> list[Outgoing]:
        """One pass of the loop; lines to be sent."""
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
        if self.lease != self._published_lease:
            self._published_lease = self.lease
            but = None if self.lease is None else self.lease.client  # already answered
            outgoing.append(Outgoing(self._reply(Request("LEASE"), True, holder_of(self)), but=but))
        outgoing += self._latch_notices()
        outgoing += self._updates()
        word = self.status()
        if word != self._word:
            if self._word is not None:
                outgoing.append(Outgoing(self._reply(Request("STW"), True, (word_text(word),))))
            self._word = word
        return outgoing

    def rest(self, *, heard: bool = True) -> float:
        """Time until something can be due without a new line, s.

        heard   True if a client is connected; otherwise only the Sun and what is under way count
        """
        if self.has_queued:
            return 0.0
        if self.idle and not self.updates and not self.scheduler.entries:
            return self._watch_ns(heard) / PER_SECOND
        now_ns = self.now_ns()
        due = [now_ns + self._watch_ns(heard)]
        waits = [(command.ask_at, command.more) for command in self._lanes.running]
        if self._scan_work is not None:
            waits.append((self._ask_at.get("scan"), False))
        if self._stream_work is not None:
            waits.append((self._ask_at.get("stream"), False))
        for at, more in waits:
            if more:  # a long answer whose reader is full
                due.append(now_ns + SLOW_NS)
                continue
            fine = at is not None and now_ns < at + FINE_SPAN_NS
            due.append(now_ns + POLL_NS if at is None else max(at, now_ns + (FINE_NS if fine else POLL_NS)))
        if (self.scanning and self._scan_work is None) or (self.stream is not None and self._stream_work is None):
            return 0.0
        if self._lanes.acting is None and not self.scanning and self.scheduler.due_ns is not None:
            due.append(self.scheduler.due_ns)
        if self.updates:
            due.append(self._next_update)
        return max(0, min(due) - now_ns) / PER_SECOND

    def _watch_ns(self, heard: bool) -> int:
        """Poll interval of an idle head, ns."""
        head = self.head
        if self._head_interlock is not None and (head.laser_on() or head.enabled(0) or head.enabled(1)):
            return LIVE_NS
        return WATCH_NS if heard else UNHEARD_NS

    def waiting(self, client: int) -> int:
        """Number of a connection's commands that have not started."""
        return len(self._lanes.of(client).waiting)

    @property
    def has_queued(self) -> bool:
        """True if the next turn can start a command or continue an answer."""
        lanes = self._lanes
        return any(lanes.can_begin(lane) for lane in lanes.in_turn(None)) or any(
            command.more and self.room(command.client) for command in lanes.running
        )

    @property
    def busy(self) -> bool:
        """True while a command runs or waits."""
        return self._lanes.busy

    @property
    def idle(self) -> bool:
        """True if nothing runs, waits, scans or streams."""
        return not self._lanes.busy and not self.scanning and self.stream is None

    # Inside ---------------------------------------------------------------------------------------------------------

    def _lane_step(self, lane: Lane) -> list[Outgoing]:
        """Continue a connection's command, or start its next."""
        if lane.running is not None:
            return self._go_on(lane, lane.running)
        if not self._lanes.can_begin(lane):
            return []
        request = lane.waiting.popleft()
        return self._begin(lane, lane.client, request)

    def _begin(self, lane: Lane, client: int, request: Request) -> list[Outgoing]:
        if stops(request) and (request.ticks is None or request.ticks * TICK_NS <= self.now_ns()):
            return self._stop(client, request)  # scheduled before
        refusal = self._lease_refusal(client, request)
        if refusal is not None:  # the lease was taken meanwhile
            return [self._refused(request, refusal, client)]
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
            if isinstance(values, Reply):  # reply of a command run by this one
                outgoing.append(Outgoing(replace(values, tid=request.tid, ticks=self._stamp(values))))
            else:
                outgoing.append(self._answer(client, request, values))
        running.more = True
        return outgoing

    def _answer(self, client: int, request: Request, values: Values) -> Outgoing:
        """Answer for its client, or for all if the ranger changed."""
        return Outgoing(self._reply(request, True, values), None if acts(request) else client)

    def _refused(self, request: Request, text: str, client: int) -> Outgoing:
        """Refusal for its client, or for all if it would change the ranger."""
        reply = self._reply(request, False, (plain_text(text.removeprefix(f"{request.command}: ")),))
        return Outgoing(reply, None if acts(request) and self._may(client) else client)

    def _may(self, client: int) -> bool:
        return not self.guarded or self._holds(client)

    def _reply(self, request: Request, ok: bool, values: Values) -> Reply:
        reply = Reply(request.command, ok, values, request.tid)
        return replace(reply, ticks=self._stamp(reply))

    def _stamp(self, reply: Reply) -> int:
        """Time just after the trigger for a measurement, else of completion."""
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
        for item in self._stream_work:
            if not isinstance(item, Outgoing):
                self._ask_at["stream"] = item
                return outgoing
            outgoing.append(replace(item, reply=replace(item.reply, ticks=self._stamp(item.reply))))
        self.end_stream()
        return outgoing

    def _updates(self) -> list[Outgoing]:
        if not self.updates:
            return []
        now_ns = self.now_ns()
        if 0 < self._next_update - now_ns <= UPDATE_NS:  # later: the clock was set back
            return []
        self._next_update = now_ns + UPDATE_NS
        outgoing = []
        for name, *arguments in WATCHED:
            request = Request(name, tuple(arguments))
            try:
                values = self.work_of(-1, request)
            except CatseyeError:
                continue  # unknown now: nothing to push
            if isinstance(values, tuple) and self._pushed.get((name, *arguments)) != values:
                self._pushed[name, *arguments] = values
                outgoing.append(Outgoing(self._reply(request, True, values)))
        return outgoing


def plain_text(text: str) -> str:
    """Text as printable ASCII in one line."""
    return "".join(c if " " <= c <= "~" else "?" for c in text)[:500]
