"""The disk under a journal: when it will be full, told long before; no more shots before it is."""

import shutil
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from catseye.coordinator.event_log import EventLog

EVERY = 10.0  # s between two looks
SPAN = 300.0  # s over which the rate is taken
LEAST_SPAN = 30.0  # s, before which there is none
RESERVE = 256 * 2**20  # bytes that are left: what is under way when firing stops, and the log's folding
AGAIN = 1.5  # reserves that must be free before firing goes on
AN_HOUR, A_DAY = 3600.0, 86_400.0  # s until firing stops


@dataclass(frozen=True)
class DiskState:
    """What a disk has and what becomes of it.

    free      bytes
    rate      bytes a second by which it fills; 0 where it does not, or is not known yet
    seconds   until only the reserve is left; inf where that does not come
    """

    free: int
    rate: float
    seconds: float


class DiskWatch:
    """Foretells by how fast the free space shrinks, whoever fills it.

    event_log   is told a day before and an hour before, and when firing stops and goes on
    hold        called with why no more may be fired, or None
    free_of     gives the free bytes of a path's disk
    """

    def __init__(
        self,
        event_log: EventLog,
        hold: Callable[[str | None], None],
        *,
        reserve: int = RESERVE,
        free_of: Callable[[Path], int] = lambda path: shutil.disk_usage(path).free,
    ):
        self._event_log, self._hold, self._reserve, self._free_of = event_log, hold, reserve, free_of
        self._seen: deque[tuple[float, int]] = deque()
        self._stopped = False

    def look(self, path: Path, now: float) -> DiskState:
        """Look at the disk that a path is on, at a time in s; tell and hold as is due.

        Raises OSError: the path is not there.
        """
        free = self._free_of(path)
        self._seen.append((now, free))
        while now - self._seen[0][0] > SPAN:
            self._seen.popleft()
        since, before = self._seen[0]
        rate = max(0.0, (before - free) / (now - since)) if now - since >= LEAST_SPAN else 0.0
        left = max(0, free - self._reserve)
        state = DiskState(free, rate, left / rate if rate > 0.0 else float("inf"))
        self._foretell(state)
        self._stop(state)
        return state

    def _foretell(self, state: DiskState) -> None:
        text = (
            f"the journal's disk has {state.free / 1e9:.1f} GB left and fills by {state.rate / 1e6:.2f} MB/s: "
            f"measuring stops in {span_text(state.seconds)} (make room, or put the journal on another disk)"
        )
        soon = not self._stopped and state.seconds < AN_HOUR
        later = not self._stopped and not soon and state.seconds < A_DAY
        self._event_log.standing("disk-full-in-an-hour", text if soon else None, "alarm", rate=state.rate)
        self._event_log.standing("disk-full-in-a-day", text if later else None, "warning", rate=state.rate)

    def _stop(self, state: DiskState) -> None:
        limit = self._reserve * (AGAIN if self._stopped else 1.0)
        stopped = state.free < limit
        if stopped != self._stopped:
            self._stopped = stopped
            least = self._reserve / 1e6
            why = f"the journal's disk has {state.free / 1e6:.0f} MB left (expected {least:.0f} MB at least)"
            self._hold(why if stopped else None)
            text = f"{why}: no more shots; what was measured is written" if stopped else None
            self._event_log.standing("disk-full", text, "alarm", over="the journal's disk has room: measuring goes on")


def span_text(seconds: float) -> str:
    """A time to come in words.

    >>> span_text(5400.0), span_text(50.0), span_text(200_000.0)
    ('1.5 h', '50 s', '2.3 days')
    """
    for unit, size, least in (("days", 86_400.0, 172_800.0), ("h", 3600.0, 3600.0), ("min", 60.0, 120.0)):
        if seconds >= least:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.0f} s"
