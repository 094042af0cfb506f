"""Execution of rounds and streams by each ranger, and suspensions."""

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
OF_THE_LINE = frozenset(  # failures of the line itself
    [ShotStatus.BLOCKED, ShotStatus.CLIPPED, ShotStatus.DEAD, ShotStatus.DROPOUT, ShotStatus.STUCK, ShotStatus.REFUSED]
)
WEAK = 0.1  # of the usual return, below which it is logged
RETURNS, FEWEST_RETURNS = 31, 5  # in the median that is usual
FAILURES = 3  # in a row, on any target, until a ranger counts as failing
STREAM_COUNT = 20  # buffers for each pointing of a stream
STREAM_LEAD = 0.1  # s that a track is sent ahead; fixed targets are measured at once
SLOWEST_TRACKED = 1e-6  # m/s: a slower target is pointed at, not tracked


class Firing:
    """Execution of shots by all rangers.

    allowed           True if shots may be taken
    telescope_known   True if moving targets can be tracked

    `dropped` rangers are excluded on purpose; `streams` has a target by ranger; `since_reference` uses `references`,
    ticks; `broken` gets the exception of a task that ended by a bug.
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
        self._unfitted: dict[int, tuple[str, str]] = {}  # lines of shots not yet in an epoch, by number
        self._frames = frames_of(site)
        self._returns: dict[str, deque[float]] = {}  # V, of each ranger's last good shots on targets
        self.last_status: dict[str, str] = {}
        self.references: dict[str, int] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self.broken: asyncio.Future[None] | None = None

    def ready(self, now_ticks: int) -> tuple[str, ...]:
        """Rangers that can start a list now."""
        return tuple(name for name in self._links if name not in self.streams and self._free(name, now_ticks))

    def begin(self, planned: Round) -> None:
        """Start each ranger's list."""
        for ranger, shots in planned.shots.items():
            if ranger in self._links and self._free(ranger, ticks_now(self._clock)):
                self._start(ranger, self._list(ranger, shots, planned.end_ticks))

    def begin_streams(self) -> None:
        """Start requested streams that do not run.

        Starts are spread over a buffer's length, to avoid a burst.
        """
        for k, ranger in enumerate(self._links):
            if ranger in self.streams and self._free(ranger, ticks_now(self._clock)):
                late = self._links[ranger].sampling.duration * k / len(self._links)
                self._start(ranger, self._stream(ranger, self.streams[ranger], late))

    async def done(self, rangers: Sequence[str], seconds: float) -> None:
        """Wait until rangers have finished, at most so many seconds."""
        tasks = [self._tasks[ranger] for ranger in rangers if ranger in self._tasks]
        if tasks:
            await asyncio.wait(tasks, timeout=seconds)

    async def stop(self) -> None:
        """Cancel everything under way."""
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def judged(self, answered: AnsweredShot) -> None:
        """Note a shot's status; suspend lines blocked repeatedly."""
        shot, now_ticks = answered.shot, answered.shot.ticks
        self.last_status[shot.ranger] = answered.status
        if answered.status in GOOD:
            self.suspensions.good(shot.ranger, shot.target)
            self.suspensions.good(shot.ranger, "")
            self._unfitted[shot.number] = shot.ranger, shot.target
            self._weigh(answered)
            if shot.target == REFERENCE:
                self.references[shot.ranger] = now_ticks
        elif answered.status in OF_THE_LINE:
            line = f"{shot.ranger} {shot.target}"
            text = f"{line}: {answered.text or answered.status}"
            self._event_log.tell(answered.status, text, "debug", about=line, ranger=shot.ranger, target=shot.target)
            self._line_failed(shot.ranger, shot.target, answered.status)

    def fitted(self, used: Iterable[int], rejected: Mapping[int, Reason]) -> None:
        """Log shots rejected by the epoch solution and suspend their lines."""
        accepted = frozenset(used)
        latest = max([*accepted, *rejected], default=0)
        for number in [n for n in self._unfitted if n <= latest]:
            ranger, target = self._unfitted.pop(number)
            reason = rejected.get(number)
            if number in accepted:
                self._misfits.good(ranger, target)
            elif reason is not None and reason.status is ShotStatus.REFLECTED:
                line = f"{ranger} {target}"
                text = f"{line}: {reason} (stray reflection, or one of them has moved)"
                self._event_log.tell("wrong-range", text, "warning", about=line, ranger=ranger, target=target)
                self._line_failed(ranger, target, "of a wrong range", self._misfits)

    def resting(self, now_ticks: int) -> frozenset[tuple[str, str]]:
        """Lines suspended at a time, ticks."""
        return self.suspensions.lines(now_ticks) | self._misfits.lines(now_ticks)

    def clock_corrected(self) -> None:
        """Forget suspensions and reference times: the clock was corrected."""
        self.suspensions, self._misfits = Suspensions(), Suspensions()
        self.references.clear()

    # Inside ---------------------------------------------------------------------------------------------------------

    def _free(self, ranger: str, now_ticks: int) -> bool:
        busy, link = self._tasks.get(ranger), self._links[ranger]
        idle = (busy is None or busy.done()) and link.ready
        return idle and ranger not in self.dropped and not self.suspensions.resting(ranger, "", now_ticks)

    def _start(self, ranger: str, work: Coroutine[object, None, None]) -> None:
        task = asyncio.get_running_loop().create_task(work, name=f"shots {ranger}")
        task.add_done_callback(self._finished)
        self._tasks[ranger] = task

    def _finished(self, task: "asyncio.Task[None]") -> None:
        problem = None if task.cancelled() else task.exception()
        if problem is not None and self.broken is not None and not self.broken.done():
            self.broken.set_exception(problem)

    def _may_go_on(self, ranger: str) -> bool:
        return self._allowed() and ranger not in self.dropped

    async def _list(self, ranger: str, shots: Sequence[PlannedShot], end_ticks: int) -> None:
        """Take a ranger's shots of a round, one after another."""
        for planned in shots:
            begin = ticks_now(self._clock)
            if planned is not shots[0]:  # the first may be after the round: moves longer than a round are made, too
                begin = max(begin, planned.begin_ticks)
            if begin >= end_ticks or not self._may_go_on(ranger):
                return
            if not self._telescope_known() and not self._stands(planned):
                continue
            if not await self._fire(planned, 1) and not self._failed(ranger, planned.target):
                return

    async def _stream(self, ranger: str, target: str, late: float) -> None:
        """Measure one target repeatedly, after so many seconds."""
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
        """True if it does not depend on the telescope's posture."""
        return planned.fixed or {self._frames.get(n) for n in (planned.ranger, planned.target)} == {"ground"}

    async def _fire(self, planned: PlannedShot, count: int) -> int:
        return await self._links[planned.ranger].stream(planned, self._intake.take, count=count)

    def _failed(self, ranger: str, target: str) -> bool:
        """Count a failed shot; True if the ranger may continue."""
        link, now_ticks = self._links[ranger], ticks_now(self._clock)
        if not link.connected:
            return False
        self._line_failed(ranger, target, "without a shot")
        pause = self.suspensions.failed(ranger, "", now_ticks) if link.failures >= FAILURES else None
        if pause is not None:
            text = f"{ranger} failed {link.failures} times in a row: suspended for {pause:g} s"
            self._event_log.tell("ranger-suspended", text, "alarm", about=ranger, ranger=ranger)
        return not self.suspensions.resting(ranger, "", now_ticks)

    def _weigh(self, answered: AnsweredShot) -> None:
        """Log a return far below the ranger's usual, though it is used."""
        shot, usual = answered.shot, self._returns.setdefault(answered.shot.ranger, deque(maxlen=RETURNS))
        if shot.target == REFERENCE or not shot.amplitude > 0.0:
            return
        level = median(usual) if len(usual) >= FEWEST_RETURNS else 0.0
        usual.append(shot.amplitude)
        if shot.amplitude < WEAK * level:
            line, share = f"{shot.ranger} {shot.target}", 100.0 * shot.amplitude / level
            text = f"{line}: return {shot.amplitude:.3f} V, {share:.0f} % of usual: dew, or partly blocked"
            self._event_log.tell("weak-return", text, "debug", about=line, ranger=shot.ranger, target=shot.target)

    def _line_failed(self, ranger: str, target: str, how: str, records: Suspensions | None = None) -> None:
        pause = (records or self.suspensions).failed(ranger, target, ticks_now(self._clock))
        if pause is not None:
            line = f"{ranger} {target}"
            text = f"{line} is {how} repeatedly: suspended for {pause:g} s"
            self._event_log.tell("line-suspended", text, about=line, ranger=ranger, target=target)

    def _aim(self, ranger: str, target: str) -> PlannedShot:
        """A shot as soon as possible, at the target's predicted position.

        On the feed arm, at the recorded position.
        """
        duration = self._links[ranger].sampling.duration
        now_ticks = ticks_now(self._clock)
        begin = now_ticks + round(STREAM_LEAD * TICKS_PER_SECOND)
        if target == REFERENCE or frame_of(self._site, ranger) == "reflector":
            return PlannedShot(
                ranger=ranger,
                target=target,
                begin_ticks=now_ticks,
                duration=duration,
                at_begin=np.zeros(3),
                at_end=np.zeros(3),
                fixed=True,
                reason="stream",
            )
        mjd = np.array([begin, begin + duration * TICKS_PER_SECOND]) / TICKS_PER_DAY
        first, last = self._live.place(target, mjd)
        fixed = bool(np.linalg.norm(last - first) < SLOWEST_TRACKED * duration)
        return PlannedShot(
            ranger=ranger,
            target=target,
            begin_ticks=now_ticks if fixed else begin,
            duration=duration,
            at_begin=first,
            at_end=last,
            fixed=fixed,
            reason="stream",
        )
