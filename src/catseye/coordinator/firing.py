"""Each ranger at its own list: shots of a round one after another, or one target again and again; and who rests."""

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from statistics import median

import numpy as np

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.intake import Intake
from catseye.coordinator.journal.entries import AnsweredShot
from catseye.coordinator.link.ranger import RangerLink
from catseye.coordinator.modes import Suspensions
from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, PlannedShot, Round, ticks_now
from catseye.errors import CatseyeError
from catseye.ranger.initialisation import frame_of
from catseye.records.night.live import TICKS_PER_DAY
from catseye.records.site.folder import REFERENCE, SiteFolder
from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.live.live import Live
from catseye.reduction.site.motion import frames_of

GOOD = frozenset([ShotStatus.USED, ShotStatus.REFERENCE])
OF_THE_LINE = frozenset(  # its own fault
    [ShotStatus.BLOCKED, ShotStatus.CLIPPED, ShotStatus.DEAD, ShotStatus.DROPOUT, ShotStatus.STUCK, ShotStatus.REFUSED]
)
WEAK = 0.1  # of the usual return, below which it is told
RETURNS, FEWEST_RETURNS = 31, 5  # whose median is usual
FAILURES = 3  # in a row, on whatever target, until a ranger counts as failing
STREAM_COUNT = 20  # buffers for each pointing of a stream
STREAM_LEAD = 0.1  # s that a track is told ahead; what rests is measured at once
AT_REST = 1e-6  # m/s: a target slower than this is pointed at, not followed


class Firing:
    """Who shoots what.

    allowed           whether anything may be fired
    telescope_known   whether targets that move can be followed

    `dropped` are left out on purpose; `streams` has a target by ranger; `since_reference` is by `references`, ticks;
    `broken` is done when a task ended by a mistake of ours.
    """

    def __init__(
        self,
        site: SiteFolder,
        links: Mapping[str, RangerLink],
        *,
        intake: Intake,
        live: Live,
        event_log: EventLog,
        clock: Clock,
        allowed: Callable[[], bool],
        telescope_known: Callable[[], bool],
    ):
        self._site, self._links, self._live, self._intake = site, links, live, intake
        self._event_log, self._clock = event_log, clock
        self._allowed, self._telescope_known = allowed, telescope_known
        self.dropped: set[str] = set()
        self.streams: dict[str, str] = {}
        self.suspensions, self._misfits = Suspensions(), Suspensions()
        self._unfitted: dict[int, tuple[str, str]] = {}  # lines of shots that no epoch has judged yet, by number
        self._frames = frames_of(site)
        self._returns: dict[str, deque[float]] = {}  # V, of each ranger's last good shots on targets
        self.last_status: dict[str, str] = {}
        self.references: dict[str, int] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self.broken: asyncio.Future[None] | None = None

    def ready(self, now: int) -> tuple[str, ...]:
        """Rangers that can have a list now."""
        return tuple(name for name in self._links if name not in self.streams and self._free(name, now))

    def begin(self, planned: Round) -> None:
        """Give each ranger its list."""
        for ranger, shots in planned.shots.items():
            if ranger in self._links and self._free(ranger, ticks_now(self._clock)):
                self._start(ranger, self._list(ranger, shots, planned.end_ticks))

    def begin_streams(self) -> None:
        """Streams that are asked for and do not run; spread over a buffer's length, or all would come in one moment."""
        for k, ranger in enumerate(self._links):
            if ranger in self.streams and self._free(ranger, ticks_now(self._clock)):
                late = self._links[ranger].sampling.duration * k / len(self._links)
                self._start(ranger, self._stream(ranger, self.streams[ranger], late))

    async def done(self, rangers: Sequence[str], seconds: float) -> None:
        """Wait until rangers are done with what they have, or so long."""
        tasks = [self._tasks[ranger] for ranger in rangers if ranger in self._tasks]
        if tasks:
            await asyncio.wait(tasks, timeout=seconds)

    async def stop(self) -> None:
        """Give up all that is under way."""
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def judged(self, answered: AnsweredShot) -> None:
        """What the reduction said of a shot: lines that are blocked again and again rest."""
        shot, now = answered.shot, answered.shot.ticks
        self.last_status[shot.ranger] = answered.status
        if answered.status in GOOD:
            self.suspensions.good(shot.ranger, shot.target)
            self.suspensions.good(shot.ranger, "")
            self._unfitted[shot.number] = shot.ranger, shot.target
            self._weigh(answered)
            if shot.target == REFERENCE:
                self.references[shot.ranger] = now
        elif answered.status in OF_THE_LINE:
            line = f"{shot.ranger} {shot.target}"
            text = f"{line}: {answered.text or answered.status}"
            self._event_log.tell(answered.status, text, "debug", about=line, ranger=shot.ranger, target=shot.target)
            self._line_failed(shot.ranger, shot.target, answered.status)

    def fitted(self, used: Iterable[int], rejected: Mapping[int, Reason]) -> None:
        """What an epoch said of shots that were good by themselves: one that does not fit is told, its line rests."""
        kept = frozenset(used)
        latest = max([*kept, *rejected], default=0)
        for number in [n for n in self._unfitted if n <= latest]:
            ranger, target = self._unfitted.pop(number)
            reason = rejected.get(number)
            if number in kept:
                self._misfits.good(ranger, target)
            elif reason is not None and reason.status is ShotStatus.REFLECTED:
                line = f"{ranger} {target}"
                text = f"{line}: {reason} (light from elsewhere, or one of them has moved)"
                self._event_log.tell("wrong-range", text, "warning", about=line, ranger=ranger, target=target)
                self._line_failed(ranger, target, "of a wrong range", self._misfits)

    def resting(self, now: int) -> frozenset[tuple[str, str]]:
        """Lines that are left alone."""
        return self.suspensions.lines(now) | self._misfits.lines(now)

    def clock_corrected(self) -> None:
        """Forget when lines were to rest until, and when references were shot: the clock was corrected."""
        self.suspensions, self._misfits = Suspensions(), Suspensions()
        self.references.clear()

    # Inside ---------------------------------------------------------------------------------------------------------

    def _free(self, ranger: str, now: int) -> bool:
        busy, link = self._tasks.get(ranger), self._links[ranger]
        idle = (busy is None or busy.done()) and link.ready
        return idle and ranger not in self.dropped and not self.suspensions.resting(ranger, "", now)

    def _start(self, ranger: str, work: Coroutine[object, None, None]) -> None:
        task = asyncio.get_running_loop().create_task(work, name=f"shots {ranger}")
        task.add_done_callback(self._ended)
        self._tasks[ranger] = task

    def _ended(self, task: "asyncio.Task[None]") -> None:
        problem = None if task.cancelled() else task.exception()
        if problem is not None and self.broken is not None and not self.broken.done():
            self.broken.set_exception(problem)

    def _may_go_on(self, ranger: str) -> bool:
        return self._allowed() and ranger not in self.dropped

    async def _list(self, ranger: str, shots: Sequence[PlannedShot], end_ticks: int) -> None:
        """A ranger's shots of a round, one after another."""
        for planned in shots:
            begin = ticks_now(self._clock)
            if planned is not shots[0]:  # the first may be behind the round: a way longer than a round is gone too
                begin = max(begin, planned.begin_ticks)
            if begin >= end_ticks or not self._may_go_on(ranger):
                return
            if not self._telescope_known() and not self._stands(planned):
                continue
            if not await self._fire(planned, 1) and not self._failed(ranger, planned.target):
                return

    async def _stream(self, ranger: str, target: str, late: float) -> None:
        """Measure one target again and again, first in so many s."""
        await asyncio.sleep(late)
        while self.streams.get(ranger) == target and self._may_go_on(ranger):
            try:
                planned = self._aim(ranger, target)
            except CatseyeError as problem:
                self._event_log.tell("no-place", f"{ranger} {target}: {problem}", "warning", about=ranger)
                return
            if not self._telescope_known() and not self._stands(planned):
                return
            if not await self._fire(planned, STREAM_COUNT):
                self._failed(ranger, target)
                return

    def _stands(self, planned: PlannedShot) -> bool:
        """Whether it is where it is planned, wherever the telescope points."""
        return planned.fixed or {self._frames.get(n) for n in (planned.ranger, planned.target)} == {"ground"}

    async def _fire(self, planned: PlannedShot, count: int) -> int:
        return await self._links[planned.ranger].stream(planned, self._intake.take, count=count)

    def _failed(self, ranger: str, target: str) -> bool:
        """A shot did not come; whether the ranger goes on."""
        link, now = self._links[ranger], ticks_now(self._clock)
        if not link.connected:
            return False
        self._line_failed(ranger, target, "without a shot")
        rest = self.suspensions.failed(ranger, "", now) if link.failures >= FAILURES else None
        if rest is not None:
            text = f"{ranger} failed {link.failures} times in a row: left alone for {rest:g} s"
            self._event_log.tell("ranger-suspended", text, "alarm", about=ranger, ranger=ranger)
        return not self.suspensions.resting(ranger, "", now)

    def _weigh(self, answered: AnsweredShot) -> None:
        """A return far below what the ranger's targets give is told, though it is used."""
        shot, usual = answered.shot, self._returns.setdefault(answered.shot.ranger, deque(maxlen=RETURNS))
        if shot.target == REFERENCE or not shot.amplitude > 0.0:
            return
        level = median(usual) if len(usual) >= FEWEST_RETURNS else 0.0
        usual.append(shot.amplitude)
        if shot.amplitude < WEAK * level:
            line, share = f"{shot.ranger} {shot.target}", 100.0 * shot.amplitude / level
            text = f"{line}: return {shot.amplitude:.3f} V, {share:.0f} % of usual: dew, or partly in the way"
            self._event_log.tell("weak-return", text, "debug", about=line, ranger=shot.ranger, target=shot.target)

    def _line_failed(self, ranger: str, target: str, how: str, records: Suspensions | None = None) -> None:
        rest = (records or self.suspensions).failed(ranger, target, ticks_now(self._clock))
        if rest is not None:
            line = f"{ranger} {target}"
            text = f"{line} is {how} again and again: left alone for {rest:g} s"
            self._event_log.tell("line-suspended", text, about=line, ranger=ranger, target=target)

    def _aim(self, ranger: str, target: str) -> PlannedShot:
        """A shot as soon as it can be, on where the target is predicted; on the feed arm, where the records have it."""
        duration = self._links[ranger].sampling.duration
        now = ticks_now(self._clock)
        begin = now + round(STREAM_LEAD * TICKS_PER_SECOND)
        if target == REFERENCE or frame_of(self._site, ranger) == "reflector":
            return PlannedShot(ranger, target, now, duration, np.zeros(3), np.zeros(3), True, "stream")
        mjd = np.array([begin, begin + duration * TICKS_PER_SECOND]) / TICKS_PER_DAY
        first, last = self._live.place(target, mjd)
        fixed = bool(np.linalg.norm(last - first) < AT_REST * duration)
        return PlannedShot(ranger, target, now if fixed else begin, duration, first, last, fixed, "stream")
