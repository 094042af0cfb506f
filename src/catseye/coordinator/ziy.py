"""Coordinator (ZIY): plan rounds, execute, reduce, journal.

One asyncio loop. Each ranger works through its list of a round independently; when the round's time is over, the next
one is planned and started, and then the epoch is solved while the mirrors turn.
"""

import asyncio
import math
import re
from collections.abc import Callable, Coroutine, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import islice

from catseye.coordinator.alarms import AlarmBook
from catseye.coordinator.condition import ConditionWatch
from catseye.coordinator.event_log import EventLog
from catseye.coordinator.feed import FeedClient, FeedSettings, MotionScript, play
from catseye.coordinator.firing import Firing
from catseye.coordinator.guard.clocks import HostClock
from catseye.coordinator.guard.watchdog import BeamWatchdog
from catseye.coordinator.intake import Intake, Solver
from catseye.coordinator.journal.entries import Entry
from catseye.coordinator.journal.protocol import JournalWriter
from catseye.coordinator.link.decode import measurement_of, shot_of
from catseye.coordinator.link.health import RangerHealth
from catseye.coordinator.link.preparation import Preparation
from catseye.coordinator.link.ranger import LinkListeners, RangerLink
from catseye.coordinator.link.settings import Address, LinkSettings, Wanted
from catseye.coordinator.modes import Mode
from catseye.coordinator.parts import (
    TICKS_PER_SECOND,
    Environment,
    PlannedShot,
    Planner,
    RequestGuard,
    Round,
    SiteState,
    SunZone,
    ticks_now,
)
from catseye.coordinator.station_events import StationEvents
from catseye.errors import CatseyeError, InputError
from catseye.ranger.initialisation import commands_of_ranger
from catseye.ranger.line import Reply, Request
from catseye.records.night.live import Happening, LivePosture
from catseye.records.site.folder import SiteFolder
from catseye.reduction.live.changes import LiveChange
from catseye.reduction.live.live import EpochAnswer, Live

ALARMS_EVERY = 1.0  # s
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")  # of an actuator, of a person
MOVE_UNITS = ("m", "mm", "um", "rad", "deg", "arcsec", "counts", "V")
LINK_STATES: dict[Mode, Wanted] = {"active": "measure", "passive": "listen", "hold": "hold"}


@dataclass(frozen=True)
class ZiySettings:
    """Times in s.

    posture_every   shortest interval of postures for reduction and journal
    idle            before planning is retried if nothing can be done
    epoch_every     between two epochs without planned rounds: streams only, passive mode
    grace           after a round's end, for shots under way, before the next is planned without their rangers
    leave           for lasers to be switched off at the end
    links, feed     of the connections to rangers and feed
    """

    posture_every: float = 0.1
    idle: float = 0.25
    epoch_every: float = 10.0
    grace: float = 0.4
    leave: float = 1.8
    links: LinkSettings = field(default_factory=LinkSettings)
    feed: FeedSettings = field(default_factory=FeedSettings)


@dataclass(frozen=True, eq=False)
class CoordinatorParts:
    """Components of a coordinator.

    live      the reduction
    planner   chooses the shots
    guard     checks each request
    journal   stores what happened
    solver    solves epochs beside the loop; None: in a thread
    """

    live: Live
    planner: Planner
    guard: RequestGuard
    journal: JournalWriter
    solver: Solver | None = None


class Coordinator:
    """A site's rangers, feed, reduction and journal.

    addresses     of the rangers
    feed          host and port of the site's feed, a motion script, or None: the posture is never known
    mode          active: plans and measures; passive: listens to another client's measurements; hold: connected, idle
    commands      initialisation commands of a ranger; None: from the site's records
    """

    def __init__(
        self,
        site: SiteFolder,
        *,
        addresses: Mapping[str, Address],
        parts: CoordinatorParts,
        environment: Environment,
        feed: tuple[str, int] | MotionScript | None = None,
        mode: Mode = "active",
        commands: Callable[[str], Sequence[Request]] | None = None,
        settings: ZiySettings | None = None,
    ):
        self.site, self.mode, self.settings = site, mode, settings or ZiySettings()
        self.clock = clock = environment.clock
        self._live, self._planner, self._guard, self._journal = parts.live, parts.planner, parts.guard, parts.journal
        self.listeners: list[Callable[[Entry], None]] = []
        self.health_listeners: list[Callable[[RangerHealth], None]] = []
        self._event_log = EventLog("coordinator", clock, self.tell)
        self._stations = StationEvents(clock, self.tell)
        self.intake = Intake(
            parts.live,
            parts.journal,
            judged=lambda answered: self.firing.judged(answered),
            publish=self._publish,
            event_log=EventLog("journal", clock, self.tell),
            doubted=self._stations.read,
            clock=clock,
            solver=parts.solver,
        )
        self.links = self._linked(addresses, commands, environment)
        self.host_clock = HostClock(self.links, clock, EventLog("coordinator", clock, self.tell))
        for link in self.links.values():
            link.host_believed = partial(self.host_clock.may_set, link)
        self.host_clock.jumped, self.host_clock.corrected = self.intake.clock_jumped, self._clock_corrected
        self.firing = Firing(
            site,
            self.links,
            intake=self.intake,
            live=parts.live,
            event_log=self._event_log,
            clock=clock,
            allowed=lambda: self.mode == "active" and self.intake.trouble is None and self.host_clock.believed,
            telescope_known=lambda: self.telescope_known,
        )
        self.condition = ConditionWatch(
            clock,
            self.links,
            firing=self.firing,
            intake=self.intake,
            mode=lambda: self.mode,
            clock_believed=lambda: self.host_clock.believed,
            telescope_known=lambda: self.telescope_known,
        )
        self.alarms = AlarmBook(clock, lambda: self.condition.now().alarms, EventLog("alarms", clock, self.tell))
        self.planned: Round | None = None  # the round under way
        self.gives_corrections = True
        self.at_border: list[Callable[[], None]] = []  # called between two rounds
        self._script = feed if isinstance(feed, MotionScript) else None
        self.feed = self._listening(*feed, environment) if isinstance(feed, tuple) else None
        self.posture: LivePosture | None = None
        self.round_number = 0
        self.round_ticks: tuple[int, int] | None = None  # begin and end of the last planned round
        self.answer: EpochAnswer | None = None
        self._solving: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    def _linked(
        self,
        addresses: Mapping[str, Address],
        commands: Callable[[str], Sequence[Request]] | None,
        environment: Environment,
    ) -> dict[str, RangerLink]:
        """Links to the rangers; dish prisms are sent on demand."""
        commands_of = commands or (lambda ranger: commands_of_ranger(self.site, ranger))
        later = [t.name for t in self.site.targets.values() if t.shapes_dish]
        return {
            name: RangerLink(
                name,
                address,
                preparation=Preparation.of(commands_of(name), later),
                guard=self._guard,
                environment=environment,
                listeners=LinkListeners(self.tell, self._overheard, self.intake.take, self._healthy),
                wanted=LINK_STATES[self.mode],
                settings=self.settings.links,
            )
            for name, address in sorted(addresses.items())
        }

    def _listening(self, host: str, port: int, environment: Environment) -> FeedClient:
        """A client of the site's feed."""
        return FeedClient(
            host,
            port,
            environment=environment,
            tell=self.tell,
            weather=self.intake.take,
            posture=self._posed,
            stations=tuple(station.name for station in self.site.site.weather_station),
            settings=self.settings.feed,
        )

    # Running ---------------------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Measure until cancelled.

        Then switch off lasers that were switched on here, and close the journal, within 5 s.
        """
        name = self.site.site.campaign.name
        self._event_log.tell(
            "started", f"coordinator of {name}, {len(self.links)} rangers, {self.mode}", mode=self.mode
        )
        for name, link in self.links.items():
            self._spawn(link.run(), f"link {name}")
        if self.feed is not None:
            self._spawn(self.feed.run(), "feed")
        if self._script is not None:
            self._spawn(play(self._script, self.clock, self._posed, period=self.settings.posture_every), "script")
        self._spawn(
            BeamWatchdog(self.links, self._guard, clock=self.clock, event_log=self._event_log).run(), "watchdog"
        )
        self._spawn(self.host_clock.run(), "clocks")
        self._spawn(self._rounds(), "rounds")
        self._spawn(self._look_at_alarms(), "alarms")
        self.firing.broken, self.intake.broken = (asyncio.get_running_loop().create_future() for _ in range(2))
        try:
            parts = [*self._tasks, self.firing.broken, self.intake.broken]
            finished, _ = await asyncio.wait(parts, return_when=asyncio.FIRST_COMPLETED)
            for part in finished:
                await part  # none ends by itself: an exception, a bug, ends the coordinator
        finally:
            await self._end()

    def _spawn(self, work: Coroutine[object, None, None], name: str) -> asyncio.Task[None]:
        task = asyncio.get_running_loop().create_task(work, name=name)
        self._tasks.add(task)
        return task

    async def _end(self) -> None:
        """Stop shots, switch lasers off, close connections and journal."""
        await self.firing.stop()
        leaving = [asyncio.ensure_future(link.leave(self.settings.leave)) for link in self.links.values()]
        last = [] if self._solving is None else [self._solving]  # an epoch under way may finish meanwhile
        if leaving or last:
            await asyncio.wait([*leaving, *last], timeout=self.settings.leave + 0.2)
        for pending in (*leaving, *last):
            pending.cancel()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._event_log.tell("stopped", f"{self.intake.numbered} shots, {self.intake.acknowledged} acknowledged")
        self.intake.flush()
        with suppress(InputError):  # unwritten entries have been reported
            await asyncio.to_thread(self._journal.close)

    def _clock_corrected(self, seconds: float) -> None:
        """Reset everything that depends on the corrected clock."""
        self.intake.clock_corrected(seconds)
        self.firing.clock_corrected()
        self.posture = None
        for link in self.links.values():
            link.clock_corrected(seconds)

    async def _look_at_alarms(self) -> None:
        """Notice alarms that come and go, until cancelled."""
        while True:
            self.alarms.look()
            await asyncio.sleep(ALARMS_EVERY)

    # Rounds ---------------------------------------------------------------------------------------------------------

    async def _rounds(self) -> None:
        loop, next_epoch = asyncio.get_running_loop(), 0.0
        while True:
            for act in self.at_border:
                act()
            self.intake.flush()  # the planner needs the status of the last shots
            now_ticks = ticks_now(self.clock)
            stopped = self.mode != "active" or self.intake.trouble is not None or not self.host_clock.believed
            planned = None if stopped else self._planned(now_ticks)
            if planned is not None:
                self.round_number += 1
                self.planned = planned
                self.round_ticks = now_ticks, planned.end_ticks
                self.firing.begin(planned)
            if not stopped:
                self.firing.begin_streams()
            due = planned is not None or loop.time() >= next_epoch
            if due and (self._solving is None or self._solving.done()):
                if self._solving is not None:
                    self._solving.result()  # an epoch's own failure is logged; anything else is a bug
                self._solving = loop.create_task(self._solve(now_ticks), name="epoch")
                next_epoch = loop.time() + self.settings.epoch_every
            retry_at = loop.time() + self.settings.idle
            if planned is not None and planned.shots:
                remaining = (planned.end_ticks - ticks_now(self.clock)) / TICKS_PER_SECOND
                await self.firing.done(tuple(planned.shots), max(self.settings.idle, remaining + self.settings.grace))
            # a round may be over at once: no shots in it, or none allowed
            await asyncio.sleep(max(0.0, retry_at - loop.time()))

    def _planned(self, now_ticks: int) -> Round | None:
        if self.posture is None or not self.firing.ready(now_ticks):
            return None
        state = self.state(now_ticks)
        if state is None:
            return None
        try:
            return self._planner.round(state)
        except CatseyeError as problem:
            self._event_log.tell("not-planned", f"no round could be planned: {problem}", "alarm")
            return None

    def state(self, now_ticks: int) -> SiteState | None:
        """Input of the planner; None before the posture is known."""
        if self.posture is None:
            return None
        return SiteState(
            now_ticks=now_ticks,
            posture=self.posture,
            ready=self.firing.ready(now_ticks),
            counts={name: link.counts for name, link in self.links.items() if link.counts is not None},
            suspended=self.firing.resting(now_ticks),
            since_reference={
                name: (now_ticks - ticks) / TICKS_PER_SECOND for name, ticks in self.firing.references.items()
            },
            place=self._live.place,
            u=self._live.uncertainty(),
            bent_frame=None if self._live.bending is None else self._live.bent_frame,
        )

    async def _solve(self, now_ticks: int) -> None:
        answer = await self.intake.solve(now_ticks)
        if answer is not None:
            self.answer = answer
            self._stations.solved(answer)
            self.firing.fitted(answer.used, answer.rejected)

    def next_shots(self, count: int) -> Iterator[PlannedShot]:
        """Next planned shots of each ranger that can fire, at most so many each."""
        now_ticks = ticks_now(self.clock)
        shots = {} if self.planned is None or self.mode != "active" else self.planned.shots
        for ranger, planned in shots.items():
            if ranger in self.links and ranger not in self.firing.dropped and ranger not in self.firing.streams:
                yield from islice((shot for shot in planned if shot.begin_ticks >= now_ticks), count)

    def sun_zone(self) -> SunZone:
        """The Sun over the site now."""
        return self._guard.sun_zone(ticks_now(self.clock))

    # Input --------------------------------------------------------------------------------------------------

    @property
    def telescope_known(self) -> bool:
        """True if moving targets can be tracked."""
        return self._script is not None or (self.feed is not None and self.feed.telescope_known)

    def _posed(self, read: LivePosture) -> None:
        interval = (self.settings.posture_every - 1e-3) * TICKS_PER_SECOND  # a stamp is quantised
        if self.posture is None or read.ticks - self.posture.ticks >= interval:
            self.posture = read
            self._guard.telescope(read)
            self.intake.take(read)

    def _overheard(self, link: RangerLink, reply: Reply) -> None:
        """Add another client's shot, in passive mode."""
        if self.mode != "passive" or reply.ok is not True:
            return
        try:
            measurement = measurement_of(reply)
            self.intake.take(
                shot_of(
                    link.ranger,
                    link.names.get(measurement.cube, measurement.name),
                    measurement,
                    buffer=None,
                    usual=link.sampling,
                )
            )
        except InputError as problem:
            self._event_log.tell("bad-shot", f"{link.ranger}: {problem}", "warning", about=link.ranger)

    def _healthy(self, health: RangerHealth) -> None:
        for listener in self.health_listeners:
            listener(health)

    def tell(self, happening: Happening) -> None:
        """Journal and publish an event."""
        self.intake.take(happening)

    def _publish(self, entry: Entry) -> None:
        self.condition.entry(entry)
        for listener in self.listeners:
            listener(entry)

    # Commands --------------------------------------------------------------------------------------------

    def set_mode(self, mode: Mode) -> None:
        """Set active, passive or hold; shots under way finish."""
        self.mode = mode
        for name, link in self.links.items():
            link.wanted = "hold" if name in self.firing.dropped and mode == "active" else LINK_STATES[mode]
        self._event_log.tell("mode", f"mode is {mode}", always=True, mode=mode)

    def set_reference(self) -> None:
        """Make the last epoch the zero of poses and corrections; journalled, and replayed at its place.

        Raises InputError: no epoch yet, or the journal fails.
        """
        if self.answer is None:
            raise InputError("no epoch was solved yet (expected one, whose pose becomes the zero)")
        if self.intake.trouble is not None:
            raise InputError(f"a reference cannot be journalled: {self.intake.trouble}")
        self.intake.change(ticks_now(self.clock), LiveChange(reference=True))
        self._event_log.tell("reference", "the last epoch becomes the zero of poses and corrections", always=True)

    def record_move(self, actuator: str, value: str, unit: str, by: str, *, reference: int) -> None:
        """Journal a move of another actuator of the telescope.

        reference   number of the reference epoch then, 0 for none

        Raises InputError: not a name, a number and a unit.
        """
        wrong = next((word for word in (actuator, by) if not NAME.fullmatch(word)), None)
        if wrong is not None:
            raise InputError(f"{wrong[:20]!a} is not a name (expected a letter with up to 31 letters, digits, _ and -)")
        if unit not in MOVE_UNITS:
            raise InputError(f"unit {unit[:20]!a} (expected one of {' '.join(MOVE_UNITS)})")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise InputError(f"value {value[:20]!a} is not a number")
        self._event_log.tell(
            "actuator-moved",
            f"{actuator} was moved to {number:g} {unit}, says {by}",
            always=True,
            actuator=actuator,
            value=value,
            unit=unit,
            by=by,
            reference=str(reference),
        )

    def leased(self, before: str, holder: str) -> None:
        """Log a new holder of the coordinator's lease."""
        self.condition.holder = holder
        text = f"the coordinator's lease passes from {before} to {holder}"
        self._event_log.tell("lease", text, always=True, holder=holder)

    def drop(self, ranger: str) -> None:
        """Exclude a ranger; it stays connected.

        Raises InputError: no such ranger.
        """
        self._refuse_unknown(ranger)
        self.firing.dropped.add(ranger)
        self.links[ranger].wanted = "hold" if self.mode == "active" else LINK_STATES[self.mode]
        self._event_log.tell("dropped", f"{ranger} is excluded on purpose", always=True, ranger=ranger)

    def take(self, ranger: str) -> None:
        """Use a ranger again.

        Raises InputError: no such ranger.
        """
        self._refuse_unknown(ranger)
        self.firing.dropped.discard(ranger)
        self.links[ranger].wanted = LINK_STATES[self.mode]
        self._event_log.tell("taken", f"{ranger} is used again", always=True, ranger=ranger)

    def stream(self, ranger: str, target: str | None) -> None:
        """Have a ranger measure one target repeatedly; None ends it.

        Raises InputError: unknown ranger or target.
        """
        self._refuse_unknown(ranger)
        if target is None:
            self.firing.streams.pop(ranger, None)
            return
        if target not in self.links[ranger].preparation.numbers:
            raise InputError(f"{ranger} has no cube {target[:20]!a} (expected one of its cubes)")
        self.firing.streams[ranger] = target

    def _refuse_unknown(self, ranger: str) -> None:
        if ranger not in self.links:
            raise InputError(f"{ranger[:20]!a} is not a ranger here (expected one of {', '.join(self.links)})")
