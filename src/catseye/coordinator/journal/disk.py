"""Watch of the journal's disk: prediction of its end, and stop before it."""

import shutil
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from catseye.coordinator.event_log import EventLog

CHECK_PERIOD = 10.0  # s between two checks
SPAN = 300.0  # s, span for the rate
LEAST_SPAN = 30.0  # s, shortest span for a rate
RESERVE = 256 * 2**20  # bytes kept free: for shots under way when measuring stops, and the checkpoint of the log
RESUME_SHARE = 1.5  # reserves that must be free before measuring resumes
AN_HOUR, A_DAY = 3600.0, 86_400.0  # s until measuring stops


@dataclass(frozen=True)
class DiskState:
    """Free space of a disk and its prediction.

    free      bytes
    rate      bytes a second by which it fills; 0 if it does not, or is unknown yet
    seconds   until only the reserve is left; inf if never
    """

    free: int
    rate: float
    seconds: float


class DiskWatch:
    """Predict the end of a disk from its loss of free space.

    event_log   gets warnings a day before and an hour before, and when measuring stops and resumes
    hold        called with the reason why no more shots may be taken, or None
    free_of     free bytes of a path's disk
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
        self._samples: deque[tuple[float, int]] = deque()
        self._stopped = False

    def look(self, path: Path, time_s: float) -> DiskState:
        """Check the disk of a path at a time in s; log and hold as needed.

        Raises OSError if the path is missing.
        """
        free = self._free_of(path)
        self._samples.append((time_s, free))
        while time_s - self._samples[0][0] > SPAN:
            self._samples.popleft()
        since, before = self._samples[0]
        rate = max(0.0, (before - free) / (time_s - since)) if time_s - since >= LEAST_SPAN else 0.0
        available = max(0, free - self._reserve)
        state = DiskState(free, rate, available / rate if rate > 0.0 else float("inf"))
        self._predict(state)
        self._stop(state)
        return state

    def _predict(self, state: DiskState) -> None:
        text = (
            f"the journal's disk has {state.free / 1e9:.1f} GB left and fills by {state.rate / 1e6:.2f} MB/s: "
            f"measuring stops in {span_text(state.seconds)} (free space, or put the journal on another disk)"
        )
        soon = not self._stopped and state.seconds < AN_HOUR
        later = not self._stopped and not soon and state.seconds < A_DAY
        self._event_log.standing("disk-full-in-an-hour", text if soon else None, "alarm", rate=state.rate)
        self._event_log.standing("disk-full-in-a-day", text if later else None, "warning", rate=state.rate)

    def _stop(self, state: DiskState) -> None:
        limit = self._reserve * (RESUME_SHARE if self._stopped else 1.0)
        stopped = state.free < limit
        if stopped != self._stopped:
            self._stopped = stopped
            least = self._reserve / 1e6
            why = f"the journal's disk has {state.free / 1e6:.0f} MB left (expected at least {least:.0f} MB)"
            self._hold(why if stopped else None)
            text = f"{why}: no more shots; measured data are written" if stopped else None
            self._event_log.standing("disk-full", text, "alarm", over="the journal's disk has space: measuring resumes")


def span_text(seconds: float) -> str:
    """A duration in words.

    >>> span_text(5400.0), span_text(50.0), span_text(200_000.0)
    ('1.5 h', '50 s', '2.3 days')
    """
    for unit, size, least in (("days", 86_400.0, 172_800.0), ("h", 3600.0, 3600.0), ("min", 60.0, 120.0)):
        if seconds >= least:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.0f} s"
