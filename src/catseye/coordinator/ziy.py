"""The ZIY: asks the planner what to shoot, has each ranger shoot it, gives what comes back to reduction and journal.

One asyncio loop. Each ranger goes through its list of a round by itself; when the round's time is over, the next one is
planned and begun, and then the epoch is solved while the mirrors turn.
"""

import asyncio
from collections.abc import Callable, Coroutine, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial

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
from catseye.coordinator.link.preparation import Preparation
from catseye.coordinator.link.ranger import LinkListeners, RangerLink
from catseye.coordinator.link.settings import Address, LinkSettings, Wanted
from catseye.coordinator.modes import Mode
from catseye.coordinator.parts import (
    TICKS_PER_SECOND,
    Environment,
    Planner,
    RequestGuard,
    Round,
    SiteState,
    ticks_now,
)
from catseye.coordinator.station_events import StationEvents
from catseye.errors import CatseyeError, InputError
from catseye.ranger.initialisation import commands_of_ranger
from catseye.ranger.line import Reply, Request
from catseye.records.night.live import Happening, LivePosture
from catseye.records.site.folder import SiteFolder
from catseye.reduction.live.live import EpochAnswer, Live

WANTED: dict[Mode, Wanted] = {"active": "measure", "passive": "listen", "hold": "hold"}


@dataclass(frozen=True)
class ZiySettings:
    """Times in s.

    posture_every   the reduction and the journal get no more postures than one each
    idle            before it is asked again what to do, where nothing can be done
    epoch_every     between two epochs where no round is planned: streams alone, passive mode
    grace           past a round's end, for shots under way, before the next is planned without their rangers
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
    """Who thinks, who refuses, who remembers.

    live      the reduction
    planner   chooses what is shot
    guard     has the last word before each request
    journal   keeps what happened
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
    feed          host and port of the site's feed, a script of a known motion, or None: no posture is ever known
    mode          active: plans and fires; passive: hears what another client has measured; hold: connected, no more
    commands      what initialises a ranger; None: from the site's records
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
        self._script = feed if isinstance(feed, MotionScript) else None
        self.feed = self._listening(*feed, environment) if isinstance(feed, tuple) else None
        self.posture: LivePosture | None = None
        self.round_number = 0
        self.answer: EpochAnswer | None = None
        self._solving: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    def _linked(
        self,
        addresses: Mapping[str, Address],
        commands: Callable[[str], Sequence[Request]] | None,
        environment: Environment,
    ) -> dict[str, RangerLink]:
        """A link to each ranger; of the dish's thousand prisms it is told before their first shots only."""
        asked = commands or (lambda ranger: commands_of_ranger(self.site, ranger))
        later = [t.name for t in self.site.targets.values() if t.type == "prism" and t.frame == "reflector"]
        return {
            name: RangerLink(
                name,
                address,
                preparation=Preparation.of(asked(name), later),
                guard=self._guard,
                environment=environment,
                listeners=LinkListeners(self.tell, self._overheard, self.intake.take),
                wanted=WANTED[self.mode],
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

    # Life -----------------------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Measure until cancelled; then lasers off that were switched on here, and the journal closed, within 5 s."""
        self._event_log.tell(
            "started", f"coordinator of {self.site.site.campaign.name}, {len(self.links)} rangers, {self.mode}"
        )
        for name, link in self.links.items():
            self._spawn(link.run(), f"link {name}")
        if self.feed is not None:
            self._spawn(self.feed.run(), "feed")
        if self._script is not None:
            self._spawn(play(self._script, self.clock, self._posed, every=self.settings.posture_every), "script")
        self._spawn(
            BeamWatchdog(self.links, self._guard, clock=self.clock, event_log=self._event_log).run(), "watchdog"
        )
        self._spawn(self.host_clock.run(), "clocks")
        self._spawn(self._rounds(), "rounds")
        self.firing.broken, self.intake.broken = (asyncio.get_running_loop().create_future() for _ in range(2))
        try:
            parts = [*self._tasks, self.firing.broken, self.intake.broken]
            ended, _ = await asyncio.wait(parts, return_when=asyncio.FIRST_COMPLETED)
            for part in ended:
                await part  # none ends by itself: what it raises, a mistake of ours, is the coordinator's
        finally:
            await self._end()

    def _spawn(self, work: Coroutine[object, None, None], name: str) -> asyncio.Task[None]:
        task = asyncio.get_running_loop().create_task(work, name=name)
        self._tasks.add(task)
        return task

    async def _end(self) -> None:
        """No more shots, lasers off, connections closed, journal closed."""
        await self.firing.stop()
        leaving = [asyncio.ensure_future(link.leave(self.settings.leave)) for link in self.links.values()]
        last = [] if self._solving is None else [self._solving]  # an epoch under way may come to its end meanwhile
        if leaving or last:
            await asyncio.wait([*leaving, *last], timeout=self.settings.leave + 0.2)
        for each in (*leaving, *last):
            each.cancel()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._event_log.tell("stopped", f"{self.intake.numbered} shots, {self.intake.acknowledged} acknowledged")
        self.intake.flush()
        with suppress(InputError):  # what could not be written has been told
            await asyncio.to_thread(self._journal.close)

    def _clock_corrected(self, seconds: float) -> None:
        """Our clock was corrected: what any part keeps by it is looked at anew."""
        self.intake.clock_corrected(seconds)
        self.firing.clock_corrected()
        self.posture = None
        for link in self.links.values():
            link.clock_corrected(seconds)

    # Rounds ---------------------------------------------------------------------------------------------------------

    async def _rounds(self) -> None:
        loop, next_epoch = asyncio.get_running_loop(), 0.0
        while True:
            self.intake.flush()  # the planner shall know how the last shots were
            now = ticks_now(self.clock)
            stopped = self.mode != "active" or self.intake.trouble is not None or not self.host_clock.believed
            planned = None if stopped else self._planned(now)
            if planned is not None:
                self.round_number += 1
                self.firing.begin(planned)
            if not stopped:
                self.firing.begin_streams()
            due = planned is not None or loop.time() >= next_epoch
            if due and (self._solving is None or self._solving.done()):
                if self._solving is not None:
                    self._solving.result()  # an epoch's own failure is told; anything else is the program's
                self._solving = loop.create_task(self._solve(now), name="epoch")
                next_epoch = loop.time() + self.settings.epoch_every
            asked_again = loop.time() + self.settings.idle
            if planned is not None and planned.shots:
                left = (planned.end_ticks - ticks_now(self.clock)) / TICKS_PER_SECOND
                await self.firing.done(tuple(planned.shots), max(self.settings.idle, left + self.settings.grace))
            # a round may be over at once: nothing in it, or nothing that may be fired
            await asyncio.sleep(max(0.0, asked_again - loop.time()))

    def _planned(self, now: int) -> Round | None:
        if self.posture is None or not self.firing.ready(now):
            return None
        state = self.state(now)
        if state is None:
            return None
        try:
            return self._planner.round(state)
        except CatseyeError as problem:
            self._event_log.tell("not-planned", f"no round could be planned: {problem}", "alarm")
            return None

    def state(self, now: int) -> SiteState | None:
        """What the planner is told; None before the posture is known."""
        if self.posture is None:
            return None
        return SiteState(
            now,
            self.posture,
            self.firing.ready(now),
            {name: link.counts for name, link in self.links.items() if link.counts is not None},
            self.firing.resting(now),
            {name: (now - ticks) / TICKS_PER_SECOND for name, ticks in self.firing.references.items()},
            self._live.place,
            self._live.uncertainty(),
        )

    async def _solve(self, now: int) -> None:
        answer = await self.intake.solve(now)
        if answer is not None:
            self.answer = answer
            self._stations.solved(answer)
            self.firing.fitted(answer.used, answer.rejected)

    # What comes in --------------------------------------------------------------------------------------------------

    @property
    def telescope_known(self) -> bool:
        """Whether targets that move can be followed."""
        return self._script is not None or (self.feed is not None and self.feed.telescope_known)

    def _posed(self, read: LivePosture) -> None:
        every = (self.settings.posture_every - 1e-3) * TICKS_PER_SECOND  # a stamp has steps
        if self.posture is None or read.ticks - self.posture.ticks >= every:
            self.posture = read
            self._guard.telescope(read)
            self.intake.take(read)

    def _overheard(self, link: RangerLink, reply: Reply) -> None:
        """Another client's shot, in passive mode."""
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

    def tell(self, happening: Happening) -> None:
        """Journal and publish something that happened."""
        self.intake.take(happening)

    def _publish(self, entry: Entry) -> None:
        self.condition.entry(entry)
        for listener in self.listeners:
            listener(entry)

    # What people ask for --------------------------------------------------------------------------------------------

    def set_mode(self, mode: Mode) -> None:
        """Active, passive, hold; shots under way come to their end."""
        self.mode = mode
        for name, link in self.links.items():
            link.wanted = "hold" if name in self.firing.dropped and mode == "active" else WANTED[mode]
        self._event_log.tell("mode", f"mode is {mode}", always=True)

    def leased(self, before: str, now: str) -> None:
        """Note that another of its clients may command it."""
        self.condition.holder = now
        self._event_log.tell("lease", f"the coordinator's lease goes from {before} to {now}", always=True)

    def drop(self, ranger: str) -> None:
        """Leave a ranger out; it stays connected. Raises InputError: no such ranger."""
        self._known(ranger)
        self.firing.dropped.add(ranger)
        self.links[ranger].wanted = "hold" if self.mode == "active" else WANTED[self.mode]
        self._event_log.tell("dropped", f"{ranger} is left out on purpose", always=True, ranger=ranger)

    def take(self, ranger: str) -> None:
        """Use a ranger again. Raises InputError: no such ranger."""
        self._known(ranger)
        self.firing.dropped.discard(ranger)
        self.links[ranger].wanted = WANTED[self.mode]
        self._event_log.tell("taken", f"{ranger} is used again", always=True, ranger=ranger)

    def stream(self, ranger: str, target: str | None) -> None:
        """Have a ranger measure one target again and again; None ends it. Raises InputError: not known."""
        self._known(ranger)
        if target is None:
            self.firing.streams.pop(ranger, None)
            return
        if target not in self.links[ranger].preparation.numbers:
            raise InputError(f"{ranger} does not know {target[:20]!a} (expected one of its cubes)")
        self.firing.streams[ranger] = target

    def _known(self, ranger: str) -> None:
        if ranger not in self.links:
            raise InputError(f"{ranger[:20]!a} is no ranger here (expected one of {', '.join(self.links)})")
