"""Parts of a site for tests of its condition, without a network."""

import math
from types import SimpleNamespace

from catseye.coordinator.condition import ConditionWatch
from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution
from catseye.coordinator.modes import Suspensions
from catseye.coordinator.parts import ticks_now
from catseye.ranger.status import StatusWord
from catseye.records.night.live import Happening, LivePosture, LiveShot
from catseye.service.book import RunSummary
from catseye.simulator.clock.world_clock import ManualClock

START = 60635.125
NAMES = tuple(f"ZY{k}" for k in range(101, 119))


def link(**more):
    usual = {"state": "ready", "connected": True, "wanted": "measure", "status": StatusWord(0), "troubles": ()}
    return SimpleNamespace(**(usual | more))


class ScenedSite:
    """Eighteen rangers that measure, until something is done to them."""

    def __init__(self, names=NAMES):
        self.clock = ManualClock(START)
        self.links = {name: link() for name in names}
        self.firing = SimpleNamespace(dropped=set(), suspensions=Suspensions())
        self.intake = SimpleNamespace(trouble=None)
        self.mode, self.believed, self.telescope = "active", True, True
        self.round_number, self.numbers, self.round_ticks = 4, 0, None
        self.site = SimpleNamespace(site=SimpleNamespace(campaign=SimpleNamespace(name="gbt")))
        self.condition = ConditionWatch(
            self.clock,
            self.links,
            firing=self.firing,
            intake=self.intake,
            mode=lambda: self.mode,
            clock_believed=lambda: self.believed,
            telescope_known=lambda: self.telescope,
        )
        self.book = RunSummary()

    def ticks(self):
        return ticks_now(self.clock)

    @property
    def running(self):
        """What a screen is given."""
        return SimpleNamespace(ziy=self)

    def entry(self, entry):
        self.book.entry(entry)
        self.condition.entry(entry)

    def shot(self, ranger, status="used"):
        self.numbers += 1
        taken = LiveShot(ranger, "TR01-B", ticks_now(self.clock), 128, 64, 1000, 1e-4, None, number=self.numbers)
        self.entry(AnsweredShot(taken, status, "", 100.0 if status == "used" else math.nan, 3e-5, 0.0))

    def epoch(self, number, **more):
        answer = {"number": number, "names": ["A"] * 39, "used": [1, 2], "rejected": {}, **more}
        self.entry(EpochSolution(ticks_now(self.clock), answer))

    def event(self, who, kind, text, severity="note"):
        self.entry(Happening(ticks_now(self.clock), who, kind, text, severity))

    def round(self, number=1, *, without=()):
        """All rangers shoot, the telescope says where it is, an epoch is solved."""
        self.clock.advance(10.0)
        for name in self.links:
            if name not in without:
                self.shot(name)
        self.entry(LivePosture(ticks_now(self.clock), 2.5351, 0.7854))
        self.epoch(number)
