"""Clocks: UTC as programs count it, this machine's own UTC beside it, and what the kernel knows of its error."""

import ctypes
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

PER_SECOND = 1_000_000_000
PER_DAY = 86_400 * PER_SECOND
UNIX_EPOCH_DAY = 40_587  # MJD of 1970-01-01
SLEW = 2000  # ns in which a slewed count gains or loses 1 ns: 0.5 ms a second, as kernels slew
AT_ONCE = 20_000  # ns within which UTC and the steady counter are read as one instant
TRIES = 8  # to read them so; then the closest pair counts


class Clock(Protocol):
    """A clock that tells the true UTC of a world."""

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0; backwards only where `SystemClock.correct` says so."""
        ...


class SystemClock:
    """UTC read once from this machine and counted on with its steady counter, so that no stamp jumps by itself.

    Two processes agree to a ms. What becomes of the machine's UTC meanwhile is `departure`; the count follows it only
    when `slew` or `correct` is called.

    offset      s, added to UTC: a night at noon
    realtime    ns since 1970, CLOCK_REALTIME
    monotonic   ns of a counter without steps, CLOCK_MONOTONIC
    """

    def __init__(
        self,
        offset: float = 0.0,
        *,
        realtime: Callable[[], int] = time.time_ns,
        monotonic: Callable[[], int] = time.monotonic_ns,
    ):
        self.offset = offset
        self._realtime, self._monotonic = realtime, monotonic
        self._course = (self._machine_zero(), 0, 0)  # count at counter 0; a slew's start on the counter, and its ns

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0."""
        return self._count(self._monotonic())

    def departure(self) -> float:
        """Seconds by which the machine's UTC is ahead of this count."""
        zero = self._machine_zero()
        counter = self._monotonic()
        return (zero + counter - self._count(counter)) / PER_SECOND

    def slew(self) -> None:
        """Bring the count to the machine's UTC by 0.5 ms a second, never backwards."""
        zero = self._machine_zero()
        counter = self._monotonic()
        here = self._count(counter) - counter
        self._course = (here, counter, zero - here)

    def correct(self) -> float:
        """Take over the machine's UTC at once; seconds that the count gained."""
        gained = self.departure()
        self._course = (self._machine_zero(), 0, 0)
        return gained

    @staticmethod
    def starting_at(mjd: float) -> "SystemClock":
        """A clock that reads an MJD now."""
        now = UNIX_EPOCH_DAY + time.time_ns() / PER_DAY
        return SystemClock((mjd - now) * (PER_DAY / PER_SECOND))

    def _count(self, counter: int) -> int:
        zero, since, slew = self._course
        done = min(abs(slew), max(0, counter - since) // SLEW)
        return zero + counter + (done if slew > 0 else -done)

    def _machine_zero(self) -> int:
        """The machine's UTC, ns since MJD 0 with the offset, when the counter was 0."""
        closest, zero = -1, 0
        for _ in range(TRIES):
            before, realtime, after = self._monotonic(), self._realtime(), self._monotonic()
            if closest < 0 or after - before < closest:
                closest, zero = after - before, realtime - (before + after) // 2
            if closest <= AT_ONCE:
                break
        return UNIX_EPOCH_DAY * PER_DAY + zero + round(self.offset * PER_SECOND)


# The kernel's word -------------------------------------------------------------------------------------------------

FAILED, ERROR = -1, 5  # of adjtimex: refused; TIME_ERROR, not synchronised
PLL, PPS_TIME, FLL, UNSYNCHRONISED, NANOSECONDS = 0x0001, 0x0004, 0x0008, 0x0040, 0x2000  # STA_... of <sys/timex.h>
MICROSECOND = 1e-6  # s


class Timex(ctypes.Structure):
    """The kernel's `struct timex` (adjtimex(2)); offset in us, or ns where STA_NANO is set, errors in us."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        *((name, ctypes.c_long) for name in ("offset", "freq", "maxerror", "esterror")),
        ("status", ctypes.c_int),
        *((name, ctypes.c_long) for name in ("constant", "precision", "tolerance", "seconds", "fraction", "tick")),
        *((name, ctypes.c_long) for name in ("ppsfreq", "jitter")),
        ("shift", ctypes.c_int),
        *((name, ctypes.c_long) for name in ("stabil", "jitcnt", "calcnt", "errcnt", "stbcnt")),
        ("tai", ctypes.c_int),
        ("reserved", ctypes.c_int * 11),
    )


@dataclass(frozen=True)
class KernelSync:
    """A synchronised kernel's word on its UTC, in s.

    source   "PPS"; "NTP", by the kernel's own loop; "PTP or NTP", by a program that steers the kernel from outside
    offset   last of the kernel's loop
    error    estimated
    most     bound of the error, which grows until the next correction
    """

    source: str
    offset: float
    error: float
    most: float


def kernel_sync(adjtimex: Callable[[Timex], int] | None = None) -> KernelSync | None:
    """The kernel's synchronisation, asked without changing it.

    None where it is unknown: no adjtimex, not allowed, or not synchronised, as in containers, where the host may be.

    adjtimex   takes a `Timex` and gives the clock's state; the C library's if None
    """
    ask = adjtimex or _adjtimex()
    told = Timex()
    state = FAILED if ask is None else ask(told)
    if state in (FAILED, ERROR) or told.status & UNSYNCHRONISED:
        return None
    source = "PPS" if told.status & PPS_TIME else "NTP" if told.status & (PLL | FLL) else "PTP or NTP"
    unit = 1.0 / PER_SECOND if told.status & NANOSECONDS else MICROSECOND
    return KernelSync(source, told.offset * unit, told.esterror * MICROSECOND, told.maxerror * MICROSECOND)


def _adjtimex() -> Callable[[Timex], int] | None:
    """The C library's, None where it has none."""
    if sys.platform != "linux":
        return None
    call = getattr(ctypes.CDLL(None), "adjtimex", None)
    return None if call is None else lambda told: int(call(ctypes.byref(told)))
