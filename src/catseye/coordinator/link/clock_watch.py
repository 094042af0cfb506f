"""Check of a ranger's clock against ours, by its stamps and the round trip; a jump told from a drift.

A stamp was made somewhere within its round trip, so each reply bounds the offset; what counts is the bound of the
shortest way among the last eight, as in NTP's clock filter: one long way on a busy machine says nothing, and hides
nothing either.

Source: [MILLS10] sec. 10, the clock filter.
"""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, ticks_now
from catseye.geometry.sky.time_tag import utc_text
from catseye.records.night.live import TICKS_PER_DAY

DRIFT_LIMIT = 1e-5  # s a second: a free quartz clock does ten times better
SOONEST = 5.0  # s between two settings, or a drift means nothing
FAR = 0.05  # s: it is set when it is seen to be so far off again, so that all rangers' clocks are heard before
FASTEST = 5e-3  # s a second: what goes away faster between two looks has jumped
SAMPLES = 8  # of which the shortest way counts, as in [MILLS10]
WANDER = 15e-6  # s a second by which an offset grows old, as in [MILLS10]


class ClockSample(NamedTuple):
    """One look: offset and its bound, s, and when, ticks of ours."""

    offset: float
    half: float
    ticks: int

    def error(self, now: int) -> float:
        """Bound of the offset at a later time, s."""
        return self.half + WANDER * abs(now - self.ticks) / TICKS_PER_SECOND


class ClockWatch:
    """Compares stamps with UTC.

    limit    s, how far off a clock may be, beside half the round trip and half a stamp's step
    may_set  whether ours is to be believed: where most rangers contradict it, none is set by it

    `offset` is the best one known, s, `error` its bound, and `seen` when it was last looked at, in ticks.
    """

    def __init__(self, clock: Clock, event_log: EventLog, limit: float, may_set: Callable[[], bool] = lambda: True):
        self._clock, self._event_log, self._limit, self._may_set = clock, event_log, limit, may_set
        self._samples: deque[ClockSample] = deque(maxlen=SAMPLES)
        self.corrected()

    def corrected(self) -> None:
        """Forget all offsets: our own clock was corrected."""
        self._samples.clear()
        self._set_at: int | None = None
        self._right_at: int | None = None  # when it was last right
        self._far = False  # when it was last looked at
        self.offset, self.error, self.seen = float("nan"), float("inf"), 0

    def look(self, stamp: int, round_trip: float) -> int | None:
        """The stamp to set it to when it is off, None where it is right or cannot be told.

        stamp        ticks, of a reply that has just come
        round_trip   s; the stamp was made somewhere within
        """
        now = ticks_now(self._clock)
        self._sample(now, stamp, round_trip)
        if abs(self.offset) <= self._limit + self.error:
            self._right_at, self._far = now, False
            return None
        far = abs(self.offset) > FAR and not self._far
        self._far = abs(self.offset) > FAR
        if far or not self._may_set():
            return None
        self._tell(now)
        self._set_at = self._right_at = now
        self._samples.clear()
        return now + round(0.5 * round_trip * TICKS_PER_SECOND)

    def _sample(self, now: int, stamp: int, round_trip: float) -> None:
        """Take in one more look; what it contradicts was before a jump."""
        middle = now - 0.5 * round_trip * TICKS_PER_SECOND
        new = ClockSample((stamp - middle) / TICKS_PER_SECOND, 0.5 * round_trip + 0.5 / TICKS_PER_SECOND, now)
        agreeing = [old for old in self._samples if abs(old.offset - new.offset) <= old.error(now) + new.half]
        self._samples.clear()
        self._samples.extend([*agreeing, new])
        best = min(reversed(self._samples), key=lambda sample: sample.error(now))
        self.offset, self.error, self.seen = best.offset, best.error(now), now

    def _tell(self, now: int) -> None:
        off = self.offset
        text = f"its clock is {off * 1e3:+.1f} ms off (limit {self._limit * 1e3:g} ms); it is set"
        self._event_log.tell("clock-off", text, "warning", offset_s=off, limit_s=self._limit)
        right = None if self._right_at is None else (now - self._right_at) / TICKS_PER_SECOND
        since = 0.0 if self._set_at is None else (now - self._set_at) / TICKS_PER_SECOND
        if self._right_at is not None and right is not None and abs(off) > FASTEST * max(right, 0.0) + self._limit:
            at = utc_text(self._right_at / TICKS_PER_DAY)
            text = f"its clock jumped by {off:+.3f} s: shots since {at} may be stamped so much wrong"
            self._event_log.tell("clock-jump", text, "alarm", always=True, offset_s=off)
        elif since > SOONEST and abs(off) / since > DRIFT_LIMIT:
            rate = off / since
            text = f"its clock gains {rate * 1e6:+.0f} us a second (see to its time signal)"
            self._event_log.tell("clock-drift", text, "warning", rate=rate)
