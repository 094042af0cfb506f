"""The twin's time: the machine's with an offset, or time that moves only when told."""

import time
from typing import Protocol

from catseye.constants import SECONDS_PER_DAY
from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND

UNIX_EPOCH_DAY = 40_587  # MJD of 1970-01-01


class Clock(Protocol):
    """A clock that tells the true UTC of a world."""

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0; never backwards."""
        ...


class SystemClock:
    """This machine's UTC, read once and then counted on without steps, plus an offset: two processes agree to a ms.

    offset   s, added to UTC: a night at noon
    """

    def __init__(self, offset: float = 0.0):
        self.offset = offset
        self._zero = UNIX_EPOCH_DAY * PER_DAY + time.time_ns() + round(offset * PER_SECOND) - time.monotonic_ns()

    def now_ns(self) -> int:
        return self._zero + time.monotonic_ns()

    @staticmethod
    def starting_at(mjd: float) -> "SystemClock":
        """A clock that reads an MJD now."""
        now = UNIX_EPOCH_DAY + time.time() / SECONDS_PER_DAY
        return SystemClock((mjd - now) * SECONDS_PER_DAY)


class ManualClock:
    """Time that moves only when told.

    >>> clock = ManualClock(52889.125)
    >>> clock.advance(0.5)
    >>> clock.now_ns() - round(52889.125 * PER_DAY)
    500000000
    """

    def __init__(self, mjd: float):
        self._now = round(mjd * PER_DAY)

    def now_ns(self) -> int:
        return self._now

    def advance(self, seconds: float) -> None:
        """Let time pass, 0 or more s."""
        self._now += max(0, round(seconds * PER_SECOND))
