"""Clocks: a steady UTC count, the machine's UTC, and the kernel's error estimate."""

import ctypes
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

PER_SECOND = 1_000_000_000
PER_DAY = 86_400 * PER_SECOND
UNIX_EPOCH_DAY = 40_587  # MJD of 1970-01-01
SLEW = 2000  # ns in which a slewed count gains or loses 1 ns: 0.5 ms per second, as in kernels
READ_WINDOW = 20_000  # ns within which UTC and the steady counter count as read together
TRIES = 8  # attempts; then the closest pair is used


class Clock(Protocol):
    """Clock that gives the true UTC of a world."""

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0; decreasing only by `SystemClock.correct`."""
        ...


class SystemClock:
    """UTC read once from this machine and continued with its steady counter, so that stamps do not jump.

    Two processes agree to a ms. `departure` is the difference from the machine's UTC; the count follows it only by
    `slew` or `correct`.

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
        self._course = (self._machine_zero(), 0, 0)  # count at counter 0; counter at a slew's start, and its ns

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0."""
        return self._count(self._monotonic())

    def departure(self) -> float:
        """Lead of the machine's UTC over this count, s."""
        zero = self._machine_zero()
        counter = self._monotonic()
        return (zero + counter - self._count(counter)) / PER_SECOND

    def slew(self) -> None:
        """Bring the count to the machine's UTC by 0.5 ms per second, never backwards."""
        zero = self._machine_zero()
        counter = self._monotonic()
        base = self._count(counter) - counter
        self._course = (base, counter, zero - base)

    def correct(self) -> float:
        """Set the count to the machine's UTC at once; seconds gained."""
        gained = self.departure()
        self._course = (self._machine_zero(), 0, 0)
        return gained

    @staticmethod
    def starting_at(mjd: float) -> "SystemClock":
        """Clock that reads an MJD now."""
        today = UNIX_EPOCH_DAY + time.time_ns() / PER_DAY
        return SystemClock((mjd - today) * (PER_DAY / PER_SECOND))

    def _count(self, counter: int) -> int:
        zero, since, slew = self._course
        applied = min(abs(slew), max(0, counter - since) // SLEW)
        return zero + counter + (applied if slew > 0 else -applied)

    def _machine_zero(self) -> int:
        """UTC of the machine, ns since MJD 0 with the offset, at counter 0."""
        closest, zero = -1, 0
        for _ in range(TRIES):
            before, realtime, after = self._monotonic(), self._realtime(), self._monotonic()
            if closest < 0 or after - before < closest:
                closest, zero = after - before, realtime - (before + after) // 2
            if closest <= READ_WINDOW:
                break
        return UNIX_EPOCH_DAY * PER_DAY + zero + round(self.offset * PER_SECOND)


# Kernel state ----------------------------------------------------------------------------------------------------

FAILED, ERROR = -1, 5  # of adjtimex: refused; TIME_ERROR, not synchronised
PLL, PPS_TIME, FLL, UNSYNCHRONISED, NANOSECONDS = 0x0001, 0x0004, 0x0008, 0x0040, 0x2000  # STA_... of <sys/timex.h>
MICROSECOND = 1e-6  # s


class Timex(ctypes.Structure):
    """Structure `struct timex` of adjtimex(2); offset in us, or ns if STA_NANO is set, errors in us."""

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
    """Kernel's estimate of its UTC error when synchronised, s.

    source   "PPS"; "NTP", by the kernel's own loop; "PTP or NTP", by an external program
    offset   last offset of the kernel's loop
    error    estimated error
    most     bound of the error, growing until the next correction
    """

    source: str
    offset: float
    error: float
    most: float


def kernel_sync(adjtimex: Callable[[Timex], int] | None = None) -> KernelSync | None:
    """Synchronisation of the kernel, read without changing it.

    None if unknown: no adjtimex, no permission, or not synchronised, as in containers, even if the host is.

    adjtimex   function from a `Timex` to the clock's state; the C library's if None
    """
    ask = adjtimex or _adjtimex()
    timex = Timex()
    state = FAILED if ask is None else ask(timex)
    if state in (FAILED, ERROR) or timex.status & UNSYNCHRONISED:
        return None
    source = "PPS" if timex.status & PPS_TIME else "NTP" if timex.status & (PLL | FLL) else "PTP or NTP"
    unit = 1.0 / PER_SECOND if timex.status & NANOSECONDS else MICROSECOND
    return KernelSync(source, timex.offset * unit, timex.esterror * MICROSECOND, timex.maxerror * MICROSECOND)


def _adjtimex() -> Callable[[Timex], int] | None:
    """adjtimex of the C library; None if it has none."""
    if sys.platform != "linux":
        return None
    call = getattr(ctypes.CDLL(None), "adjtimex", None)
    return None if call is None else lambda timex: int(call(ctypes.byref(timex)))
