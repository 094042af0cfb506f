"""A coordinator on served rangers, with recording planner, reduction and journal."""

import asyncio
from dataclasses import dataclass, field
from functools import cache, partial
from types import SimpleNamespace

import numpy as np

from catseye.coordinator.feed import MotionScript
from catseye.coordinator.parts import Environment, Round, ticks_now
from catseye.coordinator.ziy import Coordinator, CoordinatorParts
from catseye.records.night.live import LivePosture, LiveShot, LiveWeather
from catseye.records.site.folder import read_site
from coordinator.link_scene import COMMANDS, Free, LoopClock, MemoryJournal, Served, network, planned, until
from repository import ROOT

TARGETS = ("ZRG", "ZG11", "ZG12")


@cache
def gbt():
    return read_site(ROOT / "examples" / "sites" / "gbt")


@dataclass(frozen=True)
class Verdict:
    status: str
    text: str = ""
    range_: float = 80.0
    u_range: float = 3e-5
    misfit: float = 1e-5


@dataclass(frozen=True)
class Answer:
    number: int
    ticks: int
    names: tuple = ("ZG11",)
    x: tuple = ((1.0, 2.0, 3.0),)
    used: tuple = ()
    rejected: dict = field(default_factory=dict)
    variance_factor: float = 1.1
    doubts: tuple = ()
    biases: dict = field(default_factory=dict)
    returned: tuple = ()


class ListLive:
    """Writes down what it is fed; `verdicts` says what a target's shots are worth."""

    def __init__(self, **verdicts):
        self.fed, self.verdicts, self.epochs, self.pending = [], verdicts, 0, []
        self.changes = []

    def weather(self, read):
        self.fed.append(read)

    def posture(self, read):
        self.fed.append(read)

    def shot(self, shot):
        self.fed.append(shot)
        self.pending.append(shot.number)
        return Verdict(self.verdicts.get(shot.target, "reference" if shot.target == "ZRG" else "used"))

    def solve(self, ticks):
        self.epochs += 1
        used, self.pending = tuple(self.pending), []
        return Answer(self.epochs, ticks, used=used)

    failed = ""
    bending = None  # a rigid telescope

    def change(self, change):
        self.changes.append(change)

    def begin(self, ticks):
        return SimpleNamespace(solve=partial(self.solve, ticks))

    def accept(self, job, found):
        return found

    def place(self, name, mjd):
        return np.broadcast_to(next(planned(name).at_begin for _ in "1"), (*np.shape(mjd), 3))

    def uncertainty(self):
        return {}

    @property
    def shots(self):
        return [each for each in self.fed if isinstance(each, LiveShot)]


class ListPlanner:
    """Every ready ranger shoots every target, once a round of `period` s."""

    def __init__(self, period=4.0, targets=TARGETS, fixed=True):
        self.period, self.targets, self.fixed, self.states = period, targets, fixed, []

    def round(self, state):
        self.states.append(state)
        now = state.now_ticks
        lists = {
            ranger: tuple(
                planned(target, ranger=ranger, fixed=self.fixed or target == "ZRG", ahead=0.3 + 1.0 * k)
                for k, target in enumerate(self.targets)
                if (ranger, target) not in state.suspended
            )
            for ranger in state.ready
        }
        return Round(now, now + round(self.period / 864e-6), lists)


class Site:
    """Served rangers and a running coordinator."""

    def __init__(self, names=("ZY101", "ZY102"), *, live=None, planner=None, feed="script", ready=True, **options):
        self.names, self.ready = names, ready
        self.live, self.planner = live or ListLive(), planner or ListPlanner()
        self.journal, self.guard, self.published = MemoryJournal(), Free(), []
        self.options = options
        self.feed = MotionScript.parse("fixed 145 30") if feed == "script" else feed

    async def __aenter__(self):
        self.served = {name: await Served(name).start() for name in self.names}
        self.begin()
        if self.ready:
            await until(lambda: all(link.state == "ready" for link in self.ziy.links.values()))
            for served in self.served.values():
                served.light()
        return self

    def begin(self):
        self.ziy = Coordinator(
            gbt(),
            addresses={name: served.address for name, served in self.served.items()},
            parts=CoordinatorParts(self.live, self.planner, self.guard, self.journal),
            environment=Environment(LoopClock(), network()),
            feed=self.feed,
            commands=lambda ranger: COMMANDS,
            **self.options,
        )
        self.ziy.listeners.append(self.published.append)
        self.task = asyncio.ensure_future(self.ziy.run())

    async def end(self):
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)

    async def __aexit__(self, *_):
        await self.end()
        for served in self.served.values():
            await served.stop()

    def kinds(self):
        return [row.kind for row in self.journal.rows if hasattr(row, "kind")]


def posture(seconds=0.0):
    return LivePosture(ticks_now(LoopClock()) + round(seconds / 864e-6), 2.5, 0.5)


def weather(station="WX1"):
    return LiveWeather(station, ticks_now(LoopClock()), 10.0, 930.0, 50.0)
