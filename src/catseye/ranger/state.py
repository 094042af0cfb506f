"""What a ZY is between two commands, and what a handler of commands may ask of it: clock, mirror, Sun, settings."""

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from numpy.typing import ArrayLike

from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND
from catseye.ranger.commands import COMMANDS, schedule_of
from catseye.ranger.cubes import Cubes
from catseye.ranger.head import Buffer, RangerHead, SamplingSettings
from catseye.ranger.latch import Latch, store_latch, stored_latch
from catseye.ranger.line import TICK_NS, Reply, Request, nanoseconds_of, nanoseconds_to_ticks
from catseye.ranger.ranging import NOMINAL_INDEX
from catseye.ranger.schedule import Scheduler
from catseye.ranger.status import StatusWord
from catseye.ranger.sun_watch import SunSource, refusal

Values = tuple[str, ...]
# What a command that waits gives: values or a reply; else its turn back: None (ask soon) or when to ask, ns since MJD 0
Work = Generator[Values | Reply | int | None, None, Values | None]
VERSION = "2.20"
SUN_AGE = 60.0  # s that a vector from the coordinator holds where the ranger's frame turns
NEEDED = ("BP", "ALPHA", "BETA", "MO", "EZ", "D0")
REFUSED_IN_A_SCAN = (
    *("STT", "FHM", "CIL", "CMEAS", "CWT", "TRG", "TRK", "RST"),
    *("INI", "INITZY", "CYC", "SFQ", "IFF", "ABP", "ORD", "NUM"),
)
REFUSED_IN_A_STREAM = tuple(name for name in REFUSED_IN_A_SCAN if name != "TRK")
PULLED = frozenset(["PS", "AXIS", "STT", "FHM", "CIL", "CMEAS", "TRG", "TRK", "SCN", "STM"])
BITS = tuple(int(bit) for bit in StatusWord)  # in the order of `RangerState.status`


@dataclass(frozen=True)
class Outgoing:
    """A reply and the one connection it is for, None for all; `but` is left out of all."""

    reply: Reply
    client: int | None = None
    but: int | None = None


class Lease(NamedTuple):
    """Right to command: a connection, the name it gave, the token that only it was told, its peer's address."""

    client: int
    name: str
    token: str
    peer: str


@dataclass(frozen=True)
class Stream:
    """What STM asked: `count` buffers of a cube, for a connection, under the TID of its request."""

    client: int
    tid: int
    cube: int
    count: int


@dataclass
class AxisSettings:
    """What an axis's next move and filter are, in the motion chip's integers."""

    velocity: int = 400_000
    acceleration: int = 2_000
    position: int = 0
    filter: tuple[int, int, int, int, int] = (0, 0, 0, 0, 0)
    error_limit: int = 5_000


@dataclass(frozen=True)
class MeasuredBuffer:
    """A buffer and what was computed from it: amplitude in V and phase in rad, None before MPC; whose it is."""

    buffer: Buffer
    cube: int | None
    amplitude: float | None = None
    phase: float | None = None
    clipped: bool = False


class RangerState:
    """A ZY behind its head, without the loop that serves it.

    name      as it greets: ZY101
    head      the hardware
    handlers  by command: functions of this, the client and the values, which give Values or Work
    limits    counts, lowest and highest azimuth that the stops allow
    files     folder of the initialisation files, None without
    mirror    name of its head, as in its initialisation file's
    sun       the ranger's own direction of the Sun for an MJD, None without
    turning   its frame turns, as on the feed arm: it moves only if SUN was told within 60 s, and has no own Sun

    `laser_at_boot`: as the notes' rangers, at boot the laser is as its hardware has it, homed or not.
    """

    laser_at_boot = False

    def __init__(
        self,
        name: str,
        head: RangerHead,
        handlers: Mapping[str, Callable[..., Any]],
        *,
        limits: tuple[float, float],
        files: Path | None = None,
        mirror: str = "zp",
        sun: SunSource | None = None,
        turning: bool = False,
    ):
        self._handlers = handlers
        self.name, self.head, self.limits, self.files, self.mirror, self.sun = name, head, limits, files, mirror, sun
        self.turning = turning
        self._scan_work: Generator[Reply | int | None, None, None] | None = None
        self._stream_work: Generator[Outgoing | int | None, None, None] | None = None
        self.tid = 0  # of the command that runs
        self.guarded = False  # whether commands need the lease
        self.lease: Lease | None = None
        self.peers: dict[int, str] = {}  # who is at the other end of a connection, in words
        self.latch: Latch | None = stored_latch(files)
        self.times_off = 0  # that the laser was switched off
        self.cleared_by = ""  # who cleared the last one, and from where
        self._head_interlock: Callable[[], str] | None = getattr(head, "interlock", None)  # a head may offer it
        self.scheduler = Scheduler()
        self.next_sun_ns = 0
        head_now = getattr(head, "now_ns", None)  # a head may offer it: the same as `now`, cheaper
        self._head_now_ns: Callable[[], int] = head_now or (lambda: nanoseconds_of(head.now()))
        self._boot()

    def _boot(self) -> None:
        """Everything but hardware and queues as when power comes on; the laser is off."""
        self.lit = self.laser_at_boot and self.head.laser_on()  # a command switched it on
        if not self.lit:
            self.head.switch_laser(False)
        self.cubes = Cubes(self.limits)
        self.axes = (AxisSettings(), AxisSettings())
        self.sampling = SamplingSettings()
        self.d0_mm, self.index = 0.0, NOMINAL_INDEX
        self.auto, self.updates = True, False
        self.given: set[str] = set()
        self.reads, self.tolerance, self.timeout, self.strict = 5, 5, 18.0, True
        self.measured: MeasuredBuffer | None = None
        self.aimed: int | None = None
        self.reference_phase: float | None = None
        self.sun_vector: tuple[float, ...] | None = None
        self.sun_told_ns = 0
        self.sun_refused = self.in_sun = False
        self.heading: tuple[float, float] | None = None  # counts where the last move ends
        self.stream: Stream | None = None
        self.order: list[int] = []
        self.scan_start, self.scan_rounds, self.scanning = 0, 0, False
        for axis, settings in enumerate(self.axes):
            self.head.set_filter(axis, settings.filter)
            self.head.set_error_limit(axis, settings.error_limit)

    def reset(self) -> None:
        """A cold boot, as RST asks for."""
        self._scan_work = self._stream_work = None
        self.scheduler = Scheduler()
        self.head.reset()
        self._boot()

    def interlock(self) -> str:
        """Why hardware forbids light and moves at this instant; empty where it does not, or there is none."""
        return "" if self._head_interlock is None else self._head_interlock()

    def set_latch(self, latch: Latch | None) -> None:
        """Hold a dark order, or clear it; also in the ranger's folder."""
        self.latch = latch
        store_latch(self.files, latch)

    def peer(self, client: int) -> str:
        """Address of a connection's other end, in words."""
        return self.peers.get(client, f"connection {client + 1}")

    def switch_laser(self, on: bool) -> None:
        """Switch the laser as a command asks, which is remembered: one that comes on by itself is switched off."""
        self.lit = on
        self.times_off += not on
        self.head.switch_laser(on)

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0."""
        return self._head_now_ns()

    def now_ticks(self) -> int:
        """Ticks of the ranger's clock at this instant."""
        return nanoseconds_to_ticks(self.now_ns())

    def status(self) -> StatusWord:
        """The status word at this instant."""
        head, measured = self.head, self.measured
        on = (
            self.auto,
            head.homing(0) == "home",
            head.homing(1) == "home",
            self.updates,
            self.scanning,
            bool(self.scheduler.entries),
            self.stream is not None,
            measured is not None and measured.clipped,
            head.motor_off(0),
            head.motor_off(1),
            not head.laser_on(),
            not head.clock_locked(),
            head.enabled(0),
            head.enabled(1),
            self.sun_refused or self.in_sun,
            self.latch is not None,
            self.initialised,
        )
        return StatusWord(sum(bit for bit, is_on in zip(BITS, on, strict=True) if is_on))

    @property
    def initialised(self) -> bool:
        """Whether the geometry and D0 have been given since boot."""
        return self.given.issuperset(NEEDED)

    @property
    def homed(self) -> bool:
        """Whether counts are directions."""
        return self.head.homing(0) == "home" and self.head.homing(1) == "home"

    @property
    def here(self) -> tuple[float, float]:
        """Counts where the mirror is."""
        return float(self.head.actual(0)), float(self.head.actual(1))

    def suns(self) -> list[ArrayLike]:
        """Directions of the Sun that are known, each with its cone."""
        known: list[ArrayLike] = [] if self.sun_vector is None else [self.sun_vector]
        own = None if self.sun is None else self.sun(self.now_ns() / PER_DAY)
        return known if own is None else [*known, own]

    def refuse_sun(self, end: ArrayLike, start: ArrayLike | None = None) -> None:
        """Raises InputError where a move, from here unless told, could look into the Sun; the status word says so."""
        if self.turning and not 0 <= self.now_ns() - self.sun_told_ns <= SUN_AGE * PER_SECOND:
            reason: str | None = (
                f"where the Sun is was not told for {SUN_AGE:g} s (expected SUN x, y, z, as this ranger turns)"
            )
        else:
            reason = refusal(self.cubes.station, self.here if start is None else start, end, suns=self.suns())
        self.sun_refused = reason is not None
        if reason is not None:
            raise InputError(reason)

    def work_of(self, client: int, request: Request) -> Values | Work:
        """What a command's handler gives.

        Raises CatseyeError: refused, the state as it was.
        """
        if request.command == "AT":
            start, repeats, interval, later = schedule_of(request.parameters)
            self.scheduler.add(client, replace(later, tid=request.tid), start * TICK_NS, repeats, interval)
            return (str(len(self.scheduler.entries)),)
        values = COMMANDS[request.command].read(request)
        if not COMMANDS[request.command].only_asks(request):
            off = request.command in ("PS", "AXIS", "SCN", "STM") and values[-1:] == (0,)
            if request.command in PULLED and not off and (why := self.interlock()):
                raise InputError(f"the interlock is open: {why} (expected it closed first)")
            if self.latch is not None and not off and self.latch.refuses(request.command):
                raise InputError(
                    f"no {self.latch.extent} by order: {self.latch.order} (expected UNLATCH and a name, of a person)"
                )
            if self.scanning and request.command in REFUSED_IN_A_SCAN:
                raise InputError("a scan is under way (expected SCN 0 first)")
            if self.stream is not None and request.command in REFUSED_IN_A_STREAM:
                raise InputError(f"a stream is under way (expected STM {self.stream.cube}, 0 first)")
        self.tid = request.tid
        return self._handlers[request.command](self, client, *values)

    def end_scan(self) -> None:
        """Stop the scan where it is."""
        self.scanning, self._scan_work = False, None
        self.head.stop()

    def end_stream(self) -> None:
        """No more buffers; the one being taken is not told."""
        self.stream = self._stream_work = None
