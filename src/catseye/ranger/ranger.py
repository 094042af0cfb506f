"""One ZY: its state, and the loop that serves commands, schedule, scan, updates and status. No socket here.

A transport gives it lines of connections (`receive`), calls `turn` again and again, and sends what that returns.
Commands run in the order received, one at a time; one that waits for the hardware gives its turn back and is asked
again. In a turn: the running or next command, at most one scheduled one, a step of the scan, updates, the status word.
"""

from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from catseye.errors import CatseyeError, InputError
from catseye.geometry.time_tag import PER_DAY, PER_SECOND
from catseye.ranger.commands import COMMANDS, schedule_of
from catseye.ranger.cubes import Cubes
from catseye.ranger.head import Buffer, Head, Sampling
from catseye.ranger.line import TICK_NS, Reply, Request, nanoseconds_of, nanoseconds_to_ticks, parse_request
from catseye.ranger.ranging import NOMINAL_INDEX
from catseye.ranger.schedule import Scheduler
from catseye.ranger.status import Status, word_text
from catseye.ranger.sun_watch import SunSource, refusal

Values = tuple[str, ...]
Work = Generator[Values | Reply | None, None, Values | None]
VERSION = "2.20"
MOST_QUEUED = 256  # commands of all connections
REPLIES_A_TURN = 64
UPDATE_NS = PER_SECOND // 2
NEEDED = ("BP", "ALPHA", "BETA", "MO", "EZ", "D0")
REFUSED_IN_A_SCAN = (
    *("STT", "FHM", "CIL", "CMEAS", "CWT", "TRG", "TRK", "RST"),
    *("INI", "INITZY", "CYC", "SFQ", "IFF", "ABP", "ORD", "NUM"),
)
OF_A_SHOT = frozenset(["TRG", "MPC", "RAD", "MAG", "SEQ", "CMEAS", "BUF"])
WATCHED = (
    ("ACP", "0"),
    ("ACP", "1"),
    *((name,) for name in ("MOD", "CYC", "SFQ", "IFF", "D0", "NG", "BP", "ALPHA", "BETA", "MO", "EZ", "ENTEMP", "PS")),
)


@dataclass(frozen=True)
class Outgoing:
    """A reply and the one connection it is for, None for all."""

    reply: Reply
    client: int | None = None


@dataclass
class AxisSettings:
    """What an axis's next move and filter are, in the motion chip's integers."""

    velocity: int = 400_000
    acceleration: int = 2_000
    position: int = 0
    filter: tuple[int, int, int, int, int] = (0, 0, 0, 0, 0)
    error_limit: int = 5_000


@dataclass(frozen=True)
class Measured:
    """A buffer and what was computed from it: amplitude in V and phase in rad, None before MPC; whose it is."""

    buffer: Buffer
    cube: int | None
    amplitude: float | None = None
    phase: float | None = None
    clipped: bool = False


class Ranger:
    """A ZY behind its head.

    name      as it greets: ZY101
    head      the hardware
    limits    counts, lowest and highest azimuth that the stops allow
    files     folder of the initialisation files, None without
    mirror    name of its head, as in its initialisation file's
    sun       the ranger's own direction of the Sun for an MJD, None without
    """

    def __init__(
        self,
        name: str,
        head: Head,
        *,
        limits: tuple[float, float],
        files: Path | None = None,
        mirror: str = "zp",
        sun: SunSource | None = None,
    ):
        from catseye.ranger.handlers import HANDLERS, scan_rounds  # they know the ranger, so it asks late

        self._handlers: dict[str, Callable[..., Values | Work]] = HANDLERS
        self._scan_rounds = scan_rounds
        self.name, self.head, self.limits, self.files, self.mirror, self.sun = name, head, limits, files, mirror, sun
        self._waiting: deque[tuple[int, Request]] = deque()
        self._running: tuple[int, Request, Work] | None = None
        self._scan_work: Generator[Reply | None, None, None] | None = None
        self.scheduler = Scheduler()
        self._word: Status | None = None
        self._pushed: dict[tuple[str, ...], Values] = {}
        self._next_update = 0
        self._boot()

    def _boot(self) -> None:
        """Everything but hardware and queues as when power comes on."""
        self.cubes = Cubes(self.limits)
        self.axes = (AxisSettings(), AxisSettings())
        self.sampling = Sampling()
        self.d0_mm, self.index = 0.0, NOMINAL_INDEX
        self.auto, self.updates = True, False
        self.given: set[str] = set()
        self.reads, self.tolerance, self.timeout, self.strict = 5, 5, 18.0, True
        self.measured: Measured | None = None
        self.aimed: int | None = None
        self.reference_phase: float | None = None
        self.sun_vector: tuple[float, ...] | None = None
        self.sun_refused = False
        self.order: list[int] = []
        self.scan_start, self.scan_rounds, self.scanning = 0, 0, False
        for axis, settings in enumerate(self.axes):
            self.head.set_filter(axis, settings.filter)
            self.head.set_error_limit(axis, settings.error_limit)

    def reset(self) -> None:
        """Cold boot: RST."""
        self._scan_work = None
        self.scheduler = Scheduler()
        self.head.reset()
        self._boot()

    # What a transport calls -----------------------------------------------------------------------------------------

    def greeting(self, port: int) -> list[Outgoing]:
        """What a new connection hears: HELLO, CONNECT, STW."""
        told = [
            Reply("HELLO", None, (f"This is {self.name} ver. {VERSION}",)),
            Reply("CONNECT", True, (str(port),)),
            Reply("STW", True, (word_text(self.status()),)),
        ]
        return [Outgoing(replace(reply, ticks=self.now_ticks())) for reply in told]

    def receive(self, client: int, line: str) -> list[Outgoing]:
        """A line of a connection: queued, or refused at once; an empty one asks nothing."""
        try:
            request = parse_request(line)
            if request is None:
                return []
            if len(self._waiting) >= MOST_QUEUED:
                raise InputError(f"{MOST_QUEUED} commands wait already (expected fewer: send slower)")
        except InputError as problem:
            return [Outgoing(Reply("LINE", False, (_plain(str(problem)),), 0, self.now_ticks()), client)]
        self._waiting.append((client, request))
        return []

    def disconnect(self, client: int) -> None:
        """A connection is gone: its queued and scheduled commands are dropped; a scan goes on."""
        self._waiting = deque(item for item in self._waiting if item[0] != client)
        self.scheduler.clear(client)

    def turn(self) -> list[Outgoing]:
        """One pass of the loop; what is to be sent."""
        told: list[Outgoing] = []
        if self._running is None and self._waiting:
            told += self._begin(*self._waiting.popleft())
        elif self._running is not None:
            told += self._go_on()
        if self._running is None and not self.scanning:
            entry = self.scheduler.take(self.now_ns())
            if entry is not None:
                told += self._begin(entry.client, replace(entry.request, ticks=None))
        told += self._scan_step()
        told += self._updates()
        word = self.status()
        if word != self._word:
            if self._word is not None:
                told.append(Outgoing(self._reply(Request("STW"), True, (word_text(word),))))
            self._word = word
        return told

    def waiting(self, client: int) -> int:
        """Commands of a connection that have not begun."""
        return sum(each == client for each, _ in self._waiting)

    @property
    def has_queued(self) -> bool:
        """Whether the next turn can begin a command that waits."""
        return self._running is None and bool(self._waiting)

    @property
    def idle(self) -> bool:
        """Whether nothing runs, waits or scans."""
        return self._running is None and not self._waiting and not self.scanning

    # What the handlers use ------------------------------------------------------------------------------------------

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0."""
        return nanoseconds_of(self.head.now())

    def now_ticks(self) -> int:
        """The stamp of now."""
        return nanoseconds_to_ticks(self.now_ns())

    def status(self) -> Status:
        """The status word of now."""
        head, word = self.head, Status(0)
        measured = self.measured
        for bit, on in (
            (Status.AUTO, self.auto),
            (Status.AZIMUTH_HOMED, head.homing(0) == "home"),
            (Status.ELEVATION_HOMED, head.homing(1) == "home"),
            (Status.UPDATES, self.updates),
            (Status.SCANNING, self.scanning),
            (Status.SCHEDULED, bool(self.scheduler.entries)),
            (Status.CLIPPED, measured is not None and measured.clipped),
            (Status.AZIMUTH_OFF, head.motor_off(0)),
            (Status.ELEVATION_OFF, head.motor_off(1)),
            (Status.LASER_OFF, not head.laser_on()),
            (Status.CLOCK_FREE, not head.clock_locked()),
            (Status.AZIMUTH_ENABLED, head.enabled(0)),
            (Status.ELEVATION_ENABLED, head.enabled(1)),
            (Status.SUN_REFUSED, self.sun_refused),
            (Status.INITIALISED, self.initialised),
        ):
            word |= bit if on else Status(0)
        return word

    @property
    def initialised(self) -> bool:
        """Whether the geometry and D0 have been given since boot."""
        return self.given.issuperset(NEEDED)

    def refuse_sun(self, end: ArrayLike, start: ArrayLike | None = None) -> None:
        """Raises InputError where a move, from here unless told, could look into the Sun; the status word says so."""
        suns = [] if self.sun_vector is None else [self.sun_vector]
        own = None if self.sun is None else self.sun(self.now_ns() / PER_DAY)
        if own is not None:
            suns.append(tuple(float(v) for v in np.asarray(own)))
        here = [float(self.head.actual(axis)) for axis in (0, 1)] if start is None else start
        said = refusal(self.cubes.station, here, end, suns)
        self.sun_refused = said is not None
        if said is not None:
            raise InputError(said)

    def work_of(self, client: int, request: Request) -> Values | Work:
        """What a command's handler gives.

        Raises CatseyeError: refused, the state as it was.
        """
        if request.command == "AT":
            start, repeats, interval, later = schedule_of(request.parameters)
            self.scheduler.add(client, replace(later, tid=request.tid), start * TICK_NS, repeats, interval)
            return (str(len(self.scheduler.entries)),)
        values = COMMANDS[request.command].read(request)
        if self.scanning and request.command in REFUSED_IN_A_SCAN and not COMMANDS[request.command].only_asks(request):
            raise InputError("a scan is under way (expected SCN 0 first)")
        return self._handlers[request.command](self, client, *values)

    def end_scan(self) -> None:
        """Stop the scan where it is."""
        self.scanning, self._scan_work = False, None
        self.head.stop()

    # Inside ---------------------------------------------------------------------------------------------------------

    def _begin(self, client: int, request: Request) -> list[Outgoing]:
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
        told: list[Outgoing] = []
        for _ in range(REPLIES_A_TURN):
            try:
                values = next(work)
            except StopIteration as end:
                self._running = None
                return told if end.value is None else [*told, self._answer(client, request, end.value)]
            except CatseyeError as problem:
                self._running = None
                return [*told, self._refused(request, str(problem))]
            if values is None:
                return told
            if isinstance(values, Reply):  # of a command that this one runs
                told.append(Outgoing(replace(values, tid=request.tid, ticks=self._stamp(values))))
            else:
                told.append(self._answer(client, request, values))
        return told

    def _answer(self, client: int, request: Request, values: Values) -> Outgoing:
        private = request.command in ("BUF", "BYE")
        return Outgoing(self._reply(request, True, values), client if private else None)

    def _refused(self, request: Request, text: str) -> Outgoing:
        return Outgoing(self._reply(request, False, (_plain(text.removeprefix(f"{request.command}: ")),)))

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
            self._scan_work = self._scan_rounds(self)
        reply = next(self._scan_work, self)
        if reply is self:
            self.scanning, self._scan_work = False, None
            return []
        return [Outgoing(replace(reply, ticks=self._stamp(reply)))] if isinstance(reply, Reply) else []

    def _updates(self) -> list[Outgoing]:
        now = self.now_ns()
        if not self.updates or now < self._next_update:
            return []
        self._next_update = now + UPDATE_NS
        told = []
        for name, *rest in WATCHED:
            request = Request(name, tuple(rest))
            try:
                values = self.work_of(-1, request)
            except CatseyeError:
                continue  # not known now: there is nothing to push
            if isinstance(values, tuple) and self._pushed.get((name, *rest)) != values:
                self._pushed[name, *rest] = values
                told.append(Outgoing(self._reply(request, True, values)))
        return told


def _plain(text: str) -> str:
    """Printable ASCII in one line."""
    return "".join(c if " " <= c <= "~" else "?" for c in text)[:500]
