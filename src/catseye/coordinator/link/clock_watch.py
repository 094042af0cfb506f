"""Whether a ranger's clock agrees with ours, by its stamps and the round trip."""

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, ticks_now

LONGEST_TRIP = 0.1  # s: a reply slower than this says too little
DRIFT_LIMIT = 1e-5  # s a second: a free quartz clock does ten times better
SOONEST = 5.0  # s between two settings, or a drift means nothing


class ClockWatch:
    """Compares stamps with UTC.

    limit   s, how far off a clock may be, beside half the round trip and half a stamp's step
    """

    def __init__(self, clock: Clock, event_log: EventLog, limit: float):
        self._clock, self._event_log, self._limit = clock, event_log, limit
        self._set_at: int | None = None
        self.offset = float("nan")

    def look(self, stamp: int, round_trip: float) -> int | None:
        """The stamp to set it to when it is off, None where it is right or cannot be told.

        stamp        ticks, of a reply that has just come
        round_trip   s; the stamp was made somewhere within
        """
        now = ticks_now(self._clock)
        middle = now - 0.5 * round_trip * TICKS_PER_SECOND
        self.offset = (stamp - middle) / TICKS_PER_SECOND
        unsure = 0.5 * round_trip + 0.5 / TICKS_PER_SECOND
        if round_trip > LONGEST_TRIP or abs(self.offset) <= self._limit + unsure:
            return None
        text = f"its clock is {self.offset * 1e3:+.1f} ms off (limit {self._limit * 1e3:g} ms); it is set"
        self._event_log.tell("clock-off", text, "warning", offset_s=self.offset, limit_s=self._limit)
        since = 0.0 if self._set_at is None else (now - self._set_at) / TICKS_PER_SECOND
        if since > SOONEST and abs(self.offset) / since > DRIFT_LIMIT:
            rate = self.offset / since
            text = f"its clock gains {rate * 1e6:+.0f} us a second (see to its time signal)"
            self._event_log.tell("clock-drift", text, "warning", rate=rate)
        self._set_at = now
        return now + round(0.5 * round_trip * TICKS_PER_SECOND)
