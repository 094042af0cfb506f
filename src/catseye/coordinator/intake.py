"""Ordered intake: number each item, reduce, journal, publish once durable.

The journal's order is that of the reduction's input. While the journal fails, weather and postures are dropped, shots
already taken are queued, and nothing is acknowledged until the journal works again.
"""

import asyncio
import json
from collections import deque
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from dataclasses import replace
from functools import partial

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.journal.entries import (
    CLOCK_CORRECTED,
    EPOCH_START,
    LIVE_CHANGED,
    AnsweredShot,
    Document,
    Entry,
    EpochSolution,
    SentCommand,
    ranges_document,
)
from catseye.coordinator.journal.protocol import JournalWriter, NotDurable
from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, ticks_now
from catseye.errors import CatseyeError, InputError
from catseye.records.night.live import Happening, LivePosture, LiveShot, LiveWeather
from catseye.reduction.epoch.reason import ShotStatus
from catseye.reduction.live.changes import LiveChange
from catseye.reduction.live.epoch import Epoch
from catseye.reduction.live.live import EpochAnswer, EpochJob, Live

TOGETHER = 0.001  # s in which items are gathered; the journal's commit gathers more
OLDEST, FUTURE = 120.0, 0.5  # s, limits of a shot's stamp from now: it arrives after its samples
RETRY = 0.5  # s between two attempts to write the journal
LARGEST_BACKLOG = 2000  # events kept while the journal fails
Solver = Callable[[EpochJob], Awaitable[Epoch | str]]  # the epoch, or the reason why there is none
Incoming = LiveShot | LiveWeather | LivePosture | Happening | SentCommand


class Intake:
    """The only path into reduction and journal.

    judged     called with each shot and its answer, at once
    publish    called with each entry when it is durable
    event_log  reports journal problems; those are journalled when possible
    doubted    called with each weather reading and the reason for its rejection, "" if accepted
    solver     solves an epoch beside the loop; None: in a thread
    clock      UTC: a shot stamped in the future, or long ago, is rejected; None: none is

    `broken` gets the exception if processing failed by a bug: then measuring stops.
    """

    def __init__(
        self,
        live: Live,
        journal: JournalWriter,
        *,
        judged: Callable[[AnsweredShot], None],
        publish: Callable[[Entry], None],
        event_log: EventLog,
        doubted: Callable[[LiveWeather, str], None] = lambda read, why: None,
        solver: Solver | None = None,
        clock: Clock | None = None,
    ):
        self._clock = clock
        self._solver = solver or _in_a_thread
        self.broken: asyncio.Future[None] | None = None
        self._live, self._journal, self._event_log = live, journal, event_log
        self._judged, self._publish, self._doubted = judged, publish, doubted
        self._arrived: list[Incoming] = []
        self._timer: asyncio.TimerHandle | None = None
        self._last: dict[str, int] = {}  # stamp of each ranger's last shot
        self._across: tuple[int, int | None] | None = None  # ticks of a jump of our clock, None: not over yet
        self._corrections = 0  # of our clock
        self._backlog: deque[tuple[Entry, ...]] = deque()  # backlog: fed to the reduction, not yet in the journal
        self._late: list[tuple[Entry, ...]] = []  # in the journal, but not durable in time
        self._fresh = 0  # shots since the last solution
        self._retrying = self._solving = False
        self.numbered = self.acknowledged = self.dropped = 0

    @property
    def trouble(self) -> str | None:
        """Reason why nothing may be measured (journal failing); else None."""
        if self._journal.trouble is not None:
            return self._journal.trouble
        return "measured data are not durable yet" if self._backlog or self._late else None

    def take(self, item: Incoming) -> None:
        """Add an item; items within `TOGETHER` are processed together."""
        if self.trouble is not None:
            self._see_to_journal()
            if isinstance(item, LiveWeather | LivePosture) or (
                isinstance(item, Happening | SentCommand) and len(self._backlog) + len(self._arrived) > LARGEST_BACKLOG
            ):
                self.dropped += 1
                return
        self._arrived.append(item)
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(TOGETHER, self._gathered)

    def _gathered(self) -> None:
        """Process items from the loop's timer; an exception ends the coordinator.

        The loop itself would only log it.
        """
        try:
            self.flush()
        except Exception as problem:
            if self.broken is None or self.broken.done():
                raise
            self.broken.set_exception(problem)

    def flush(self) -> None:
        """Process all items received."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        while self._arrived:
            arrived, self._arrived = self._arrived, []
            entries = [entry for item in arrived if (entry := self._fed(item)) is not None]
            if entries:
                self._write(tuple(entries))

    async def solve(self, ticks: int) -> EpochAnswer | None:
        """Solve an epoch of all shots since the last; None if there is none.

        The journal has both instants, when its shots were taken out and when its answer was accepted: shots fed between
        belong to the next epoch, in a replay too.
        """
        self.flush()
        if not self._fresh or self.trouble is not None or self._solving:
            return None
        job = self._live.begin(ticks)
        if job is None:
            self._event_log.tell("not-solved", f"the epoch was not solved: {self._live.failed}", "warning")
            return None
        self._fresh, self._solving = 0, True
        self._write((Document(ticks, EPOCH_START, ""),))
        corrections = self._corrections
        try:
            epoch = await self._solver(job)
        finally:
            self._solving = False
        self.flush()
        stale = corrections != self._corrections
        answer = None if stale else self._live.accept(job, epoch)
        ranges = ranges_document(ticks, answer)
        self._write((EpochSolution.of(ticks, answer), *(() if ranges is None else (ranges,))))
        if answer is None:
            why = "the clock was corrected meanwhile" if stale else self._live.failed
            self._event_log.tell("not-solved", f"the epoch was not solved: {why}", "warning" if stale else "alarm")
        return answer

    def change(self, ticks: int, change: LiveChange) -> None:
        """Change the reduction at this place of its input, and journal it: a replay changes there, too.

        Raises InputError: impossible; nothing is changed.
        """
        self.flush()
        self._live.change(change)
        self._write((Document(ticks, LIVE_CHANGED, change.text),))

    def clock_jumped(self, since: int, until: int | None) -> None:
        """Reject shots overlapping two ticks; all later ones if the second is None."""
        self.flush()
        self._across = since, until

    def clock_corrected(self, seconds: float) -> None:
        """Discard everything stamped later than now after a clock correction.

        seconds   gain of the clock

        A replay does the same.
        """
        if self._clock is None:
            return
        self.flush()
        now_ticks = ticks_now(self._clock)
        self._corrections += 1
        self._last = {ranger: ticks for ranger, ticks in self._last.items() if ticks <= now_ticks}
        self._live.clock_corrected(now_ticks)
        self._write((Document(now_ticks, CLOCK_CORRECTED, json.dumps({"gained_s": seconds})),))

    def _fed(self, item: Incoming) -> Entry | None:
        """Feed an item to the reduction; the entry for the journal."""
        if isinstance(item, LiveWeather):
            self._doubted(item, self._live.weather(item) or "")
        elif isinstance(item, LivePosture):
            self._live.posture(item)
        elif isinstance(item, LiveShot):
            return self._answered(item)
        return item

    def _answered(self, shot: LiveShot) -> AnsweredShot | None:
        if self._clock is not None:
            off = (shot.ticks - ticks_now(self._clock)) / TICKS_PER_SECOND
            if not -OLDEST <= off <= FUTURE:
                text = f"{shot.ranger}: a shot's stamp is {off:+.1f} s from now: its clock, or ours, is wrong; rejected"
                self._event_log.tell("stamp-off", text, "alarm", about=shot.ranger, offset_s=off)
                return None
        if self._across is not None:
            since, until = self._across
            end = shot.ticks + round(shot.cycles / shot.if_hz * TICKS_PER_SECOND)
            if end >= since and (until is None or shot.ticks <= until):
                text = f"{shot.ranger}: a shot overlaps a jump of this machine's clock; rejected"
                self._event_log.tell("stamp-across-jump", text, "warning", about=shot.ranger)
                return None
        last = self._last.get(shot.ranger, -1)
        if shot.ticks <= last:  # a clock was set back; a journal has each shot once
            text = f"{shot.ranger}: a shot's stamp is {last - shot.ticks} ticks before the last one's; rejected"
            self._event_log.tell("stamp-not-later", text, "warning", about=shot.ranger)
            return None
        self._last[shot.ranger] = shot.ticks
        self.numbered += 1
        shot = replace(shot, number=self.numbered)
        try:
            answered = AnsweredShot.of(shot, self._live.shot(shot))
        except CatseyeError as problem:
            answered = AnsweredShot(shot, str(ShotStatus.REFUSED), str(problem))
        self._fresh += 1
        self._judged(answered)
        return answered

    def _write(self, entries: tuple[Entry, ...]) -> None:
        self._backlog.append(entries)
        self._send()

    def _send(self) -> None:
        """Append queued entries to the journal, in order."""
        while self._backlog:
            try:
                future = self._journal.append(*self._backlog[0])
            except InputError as problem:
                self._away(str(problem))
                return
            entries = self._backlog.popleft()
            loop = asyncio.get_running_loop()
            future.add_done_callback(partial(_later, loop, partial(self._settled, entries)))

    def _settled(self, entries: tuple[Entry, ...], outcome: "Future[int]") -> None:
        """Publish entries that are durable, or report the failure."""
        problem = outcome.exception()
        if problem is None:
            self._acknowledge_late()  # the journal keeps the order: earlier entries are durable, too
            self._acknowledge(entries)
        elif isinstance(problem, NotDurable) or self._journal.trouble is not None or self._late:
            self._late.append(entries)
            self._away(str(problem))
        else:
            self._event_log.tell("not-journalled", f"the journal refused {len(entries)} entries: {problem}", "alarm")

    def _acknowledge(self, entries: tuple[Entry, ...]) -> None:
        for entry in entries:
            self.acknowledged += isinstance(entry, AnsweredShot)
            self._publish(entry)

    def _acknowledge_late(self) -> None:
        late, self._late = self._late, []
        for entries in late:
            self._acknowledge(entries)

    def _away(self, why: str) -> None:
        self._event_log.standing("journal-away", f"{why}: measuring suspended", "alarm")
        self._see_to_journal()

    def _see_to_journal(self) -> None:
        if not self._retrying:
            self._retrying = True
            asyncio.get_running_loop().call_later(RETRY, self._retry)

    def _retry(self) -> None:
        """Append nothing: it succeeds once all entries before are durable."""
        self._retrying = False
        try:
            future = self._journal.append()
        except InputError:
            self._see_to_journal()
            return
        loop = asyncio.get_running_loop()
        future.add_done_callback(partial(_later, loop, self._retried))

    def _retried(self, outcome: "Future[int]") -> None:
        if outcome.exception() is not None or self._journal.trouble is not None:
            self._see_to_journal()
            return
        self._acknowledge_late()
        self._send()
        if self.trouble is None:
            self._event_log.standing("journal-away", None, over="the journal is writable again: measuring resumes")
        else:
            self._see_to_journal()


async def _in_a_thread(job: EpochJob) -> Epoch | str:
    return await asyncio.get_running_loop().run_in_executor(None, job.solve)


def _later(loop: asyncio.AbstractEventLoop, call: Callable[["Future[int]"], None], outcome: "Future[int]") -> None:
    """Call from the journal's thread into the loop, if it is open."""
    if not loop.is_closed():
        loop.call_soon_threadsafe(call, outcome)
