"""Check of a ranger's clock against ours, separating jumps from drift.

A stamp was made somewhere within its round trip, so each reply bounds the offset; the bound of the shortest round trip
among the last eight is used, as in NTP's clock filter: one long round trip on a busy machine tells nothing, and hides
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
SOONEST = 5.0  # s between two settings, below which a drift is meaningless
FAR = 0.05  # s: a larger offset is confirmed before the clock is set, so that all rangers' clocks are sampled first
FASTEST = 5e-3  # s a second: a faster change between two samples is a jump
SAMPLES = 8  # of which the shortest round trip counts, as in [MILLS10]
WANDER = 15e-6  # s a second, growth of an offset's error with age, as in [MILLS10]


class ClockSample(NamedTuple):
    """One sample: offset and its bound, s, and its time, our ticks."""

    offset: float
    half: float
    ticks: int

    def error(self, now_ticks: int) -> float:
        """Bound of the offset at a later time, s."""
        return self.half + WANDER * abs(now_ticks - self.ticks) / TICKS_PER_SECOND


class ClockWatch:
    """Comparison of a ranger's stamps with UTC.

    limit    s, tolerance of a clock, plus half the round trip and half a stamp's step
    may_set  True if our clock is trusted: if most rangers contradict it, none is set by it

    `offset` is the best estimate, s, `error` its bound, and `seen` the time of the last sample, in ticks.
    """

    def __init__(self, clock: Clock, event_log: EventLog, limit: float, may_set: Callable[[], bool] = lambda: True):
        self._clock, self._event_log, self._limit, self._may_set = clock, event_log, limit, may_set
        self._samples: deque[ClockSample] = deque(maxlen=SAMPLES)
        self.corrected()

    def corrected(self) -> None:
        """Forget all offsets: our own clock was corrected."""
        self._samples.clear()
        self._set_at: int | None = None
        self._right_at: int | None = None  # last time it was right
        self._far = False  # at the last sample
        self.offset, self.error, self.seen = float("nan"), float("inf"), 0

    def look(self, stamp: int, round_trip: float) -> int | None:
        """Stamp to set a wrong clock to; None if it is right or unknown.

        stamp        ticks, of a reply just received
        round_trip   s; the stamp was made somewhere within
        """
        now_ticks = ticks_now(self._clock)
        self._sample(now_ticks, stamp, round_trip)
        if abs(self.offset) <= self._limit + self.error:
            self._right_at, self._far = now_ticks, False
            return None
        far = abs(self.offset) > FAR and not self._far
        self._far = abs(self.offset) > FAR
        if far or not self._may_set():
            return None
        self._tell(now_ticks)
        self._set_at = self._right_at = now_ticks
        self._samples.clear()
        return now_ticks + round(0.5 * round_trip * TICKS_PER_SECOND)

    def _sample(self, now_ticks: int, stamp: int, round_trip: float) -> None:
        """Add a sample; samples that it contradicts precede a jump."""
        middle = now_ticks - 0.5 * round_trip * TICKS_PER_SECOND
        new = ClockSample((stamp - middle) / TICKS_PER_SECOND, 0.5 * round_trip + 0.5 / TICKS_PER_SECOND, now_ticks)
        agreeing = [old for old in self._samples if abs(old.offset - new.offset) <= old.error(now_ticks) + new.half]
        self._samples.clear()
        self._samples.extend([*agreeing, new])
        best = min(reversed(self._samples), key=lambda sample: sample.error(now_ticks))
        self.offset, self.error, self.seen = best.offset, best.error(now_ticks), now_ticks

    def _tell(self, now_ticks: int) -> None:
        off = self.offset
        text = f"its clock is {off * 1e3:+.1f} ms off (limit {self._limit * 1e3:g} ms); it is set"
        self._event_log.tell("clock-off", text, "warning", offset_s=off, limit_s=self._limit)
        right = None if self._right_at is None else (now_ticks - self._right_at) / TICKS_PER_SECOND
        since = 0.0 if self._set_at is None else (now_ticks - self._set_at) / TICKS_PER_SECOND
        if self._right_at is not None and right is not None and abs(off) > FASTEST * max(right, 0.0) + self._limit:
            at = utc_text(self._right_at / TICKS_PER_DAY)
            text = f"its clock jumped by {off:+.3f} s: shots since {at} may have stamps wrong by this amount"
            self._event_log.tell("clock-jump", text, "alarm", always=True, offset_s=off)
        elif since > SOONEST and abs(off) / since > DRIFT_LIMIT:
            rate = off / since
            text = f"its clock gains {rate * 1e6:+.0f} us a second (check its time signal)"
            self._event_log.tell("clock-drift", text, "warning", rate=rate)
