"""State of a ZY between commands: clock, mirror, Sun, settings."""

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
from catseye.ranger.latch import Latch, read_latch, store_latch
from catseye.ranger.line import TICK_NS, Reply, Request, nanoseconds_of, nanoseconds_to_ticks
from catseye.ranger.ranging import NOMINAL_INDEX
from catseye.ranger.schedule import Scheduler
from catseye.ranger.status import StatusWord
from catseye.ranger.sun_watch import SunSource, refusal

Values = tuple[str, ...]
# Yielded by a waiting command: values or a reply; or None (poll soon) or the time to poll, ns since MJD 0
Work = Generator[Values | Reply | int | None, None, Values | None]
VERSION = "2.20"
SUN_AGE = 60.0  # s of validity of the coordinator's vector, if the ranger's frame turns
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
    """A reply and its connection, None for all.

    but   connection excluded from all
    """

    reply: Reply
    client: int | None = None
    but: int | None = None


class Lease(NamedTuple):
    """Right to command.

    A connection, the name it gave, its secret token, its peer's address.
    """

    client: int
    name: str
    token: str
    peer: str


@dataclass(frozen=True)
class Stream:
    """Request of STM: `count` buffers of a cube.

    For a connection, under the TID of its request.
    """

    client: int
    tid: int
    cube: int
    count: int


@dataclass
class AxisSettings:
    """Settings of an axis's next move and filter, motion chip's integers."""

    velocity: int = 400_000
    acceleration: int = 2_000
    position: int = 0
    filter: tuple[int, int, int, int, int] = (0, 0, 0, 0, 0)
    error_limit: int = 5_000


@dataclass(frozen=True)
class MeasuredBuffer:
    """A buffer with its cube, amplitude in V and phase in rad.

    Both None before MPC.
    """

    buffer: Buffer
    cube: int | None
    amplitude: float | None = None
    phase: float | None = None
    clipped: bool = False


class RangerState:
    """A ZY behind its head, without the loop that serves it.

    name      as in its greeting: ZY101
    head      the hardware
    handlers  by command: functions of this, the client and the values, which return Values or Work
    limits    counts, lowest and highest azimuth that the stops allow
    files     folder of the initialisation files, None without
    mirror    name of its head, as in its initialisation file's
    sun       the ranger's own direction of the Sun for an MJD, None without
    turning   True if its frame turns, as on the feed arm: it needs SUN within 60 s to move, and has no Sun of its own

    `laser_at_boot`: True as for the notes' rangers: at boot the laser is as its hardware has it, homed or not.
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
        self.tid = 0  # of the running command
        self.guarded = False  # True if commands need the lease
        self.lease: Lease | None = None
        self.peers: dict[int, str] = {}  # peer of each connection, in words
        self.latch: Latch | None = read_latch(files)
        self.times_off = 0  # times that the laser was switched off
        self.cleared_by = ""  # person who cleared the last one, and address
        self._head_interlock: Callable[[], str] | None = getattr(head, "interlock", None)  # optional in a head
        self.scheduler = Scheduler()
        self.next_sun_ns = 0
        head_now_ns = getattr(head, "now_ns", None)  # optional in a head: as `now`, cheaper
        self._head_now_ns: Callable[[], int] = head_now_ns or (lambda: nanoseconds_of(head.now()))
        self._boot()

    def _boot(self) -> None:
        """Reset all but hardware and queues to power-on; laser off."""
        self.lit = self.laser_at_boot and self.head.laser_on()  # switched on by command
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
        self.heading: tuple[float, float] | None = None  # end of the last move, counts
        self.stream: Stream | None = None
        self.order: list[int] = []
        self.scan_start, self.scan_rounds, self.scanning = 0, 0, False
        for axis, settings in enumerate(self.axes):
            self.head.set_filter(axis, settings.filter)
            self.head.set_error_limit(axis, settings.error_limit)

    def reset(self) -> None:
        """Boot cold, as RST commands."""
        self._scan_work = self._stream_work = None
        self.scheduler = Scheduler()
        self.head.reset()
        self._boot()

    def interlock(self) -> str:
        """Reason why hardware forbids light and moves now; else ""."""
        return "" if self._head_interlock is None else self._head_interlock()

    def set_latch(self, latch: Latch | None) -> None:
        """Latch a stop order or clear it, also in the ranger's folder."""
        self.latch = latch
        store_latch(self.files, latch)

    def peer(self, client: int) -> str:
        """Address of a connection's other end, in words."""
        return self.peers.get(client, f"connection {client + 1}")

    def switch_laser(self, on: bool) -> None:
        """Switch the laser by command; light without a command is switched off."""
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
        """True if the geometry and D0 were given since boot."""
        return self.given.issuperset(NEEDED)

    @property
    def homed(self) -> bool:
        """True if counts are directions."""
        return self.head.homing(0) == "home" and self.head.homing(1) == "home"

    @property
    def here(self) -> tuple[float, float]:
        """Present counts of the mirror."""
        return float(self.head.actual(0)), float(self.head.actual(1))

    def suns(self) -> list[ArrayLike]:
        """Known directions of the Sun, each with its cone."""
        vectors: list[ArrayLike] = [] if self.sun_vector is None else [self.sun_vector]
        ranger_sun = None if self.sun is None else self.sun(self.now_ns() / PER_DAY)
        return vectors if ranger_sun is None else [*vectors, ranger_sun]

    def refuse_sun(self, end: ArrayLike, start: ArrayLike | None = None) -> None:
        """Raise InputError for a move that could look into the Sun.

        start   counts; None: the present ones

        The status word shows the refusal.
        """
        if self.turning and not 0 <= self.now_ns() - self.sun_told_ns <= SUN_AGE * PER_SECOND:
            reason: str | None = (
                f"no Sun vector received for {SUN_AGE:g} s (expected SUN x, y, z, as this ranger turns)"
            )
        else:
            reason = refusal(self.cubes.station, self.here if start is None else start, end, suns=self.suns())
        self.sun_refused = reason is not None
        if reason is not None:
            raise InputError(reason)

    def work_of(self, client: int, request: Request) -> Values | Work:
        """Result of a command's handler.

        Raises CatseyeError if refused, with the state unchanged.
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
        """Stop the stream; the buffer under way is not reported."""
        self.stream = self._stream_work = None
