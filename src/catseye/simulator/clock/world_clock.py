"""Manual clock that moves only on request."""

from catseye.clock import PER_DAY, PER_SECOND


class ManualClock:
    """Clock that stands still until advanced.

    >>> clock = ManualClock(52889.125)
    >>> clock.advance(0.5)
    >>> clock.now_ns() - round(52889.125 * PER_DAY)
    500000000
    """

    def __init__(self, mjd: float):
        self._now = round(mjd * PER_DAY)

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0."""
        return self._now

    def advance(self, seconds: float) -> None:
        """Advance the time by 0 or more s."""
        self._now += max(0, round(seconds * PER_SECOND))
