"""A living site in virtual time whose faults are on command: what was told, when, by whom, and how honest epochs were.

The coordinator as `catseye simulate` puts it together, with real servers, heads and links, on seven rangers.
"""

import asyncio
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache

from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution
from catseye.records.night.live import Happening
from catseye.records.site.folder import SiteFolder, read_site
from catseye.service.comparison import EpochComparison, TwinComparison
from catseye.service.coordinator import LiveCoordinator, Orders
from catseye.service.rangers import Listening, RangersServed
from catseye.service.running import FastLoop
from catseye.service.simulation import peers_of
from catseye.service.warm import WarmingClock
from catseye.service.world import TwinWords, twin_heads
from catseye.simulator.clock.virtual_time import MemoryNetwork, VirtualClock
from repository import ROOT

START = 60635.125  # MJD, 22 h local mean time at Green Bank
GROUND = ("ZY101", "ZY103", "ZY105", "ZY107", "ZY109", "ZY111")
ARM = ("ZY115",)
DISH = ("DP01C", "DP20C", "DP20P10", "DP33N15", "DP44C")
LATENCY = 1e-4  # s one way, as on a local network
GOOD = ("used", "reference")


@cache
def site() -> SiteFolder:
    """Green Bank with seven of its rangers and five prisms on the dish."""
    whole = read_site(ROOT / "examples/sites/gbt")
    arm = tuple(r for r in whole.feedarm.ranger if r.name in ARM)
    return replace(
        whole,
        monuments={n: m for n, m in whole.monuments.items() if n in GROUND},
        feedarm=whole.feedarm.model_copy(update={"ranger": arm}),
        targets={n: t for n, t in whole.targets.items() if not n.startswith("DP") or n in DISH},
        benchmarks=tuple(b for b in whole.benchmarks if b.ranger in GROUND),
    )


@dataclass
class Told:
    """What a run told, in its order; times s since the twin's start."""

    seconds_of: object
    comparison: TwinComparison
    happenings: list[tuple[float, Happening]] = field(default_factory=list)
    shots: list[tuple[float, AnsweredShot]] = field(default_factory=list)
    epochs: list[tuple[float, dict, EpochComparison | None]] = field(default_factory=list)

    def entry(self, entry: object) -> None:
        """One entry of the journal."""
        if isinstance(entry, Happening):
            self.happenings.append((self.seconds_of(entry.ticks), entry))
        elif isinstance(entry, AnsweredShot):
            self.comparison.shot(entry)
            self.shots.append((self.seconds_of(entry.shot.ticks), entry))
        elif isinstance(entry, EpochSolution):
            compared = self.comparison.epoch(entry)
            self.epochs.append((self.seconds_of(entry.ticks), dict(entry.answer or {}), compared))

    def first(self, kinds: Iterable[str], who: str, after: float = 0.0) -> float | None:
        """When somebody was first named by one of some kinds, at or after a time."""
        wanted = set(kinds)
        for at, what in self.happenings:
            named = (what.who, what.details.get("ranger"), what.details.get("target"))
            if at >= after and what.kind in wanted and who in named:
                return at
        return None

    def good(self, begin: float, end: float, *, ranger: str | None = None, target: str | None = None) -> int:
        """Good shots that were taken between two times."""
        return sum(
            begin <= at < end
            and s.status in GOOD
            and ranger in (None, s.shot.ranger)
            and target in (None, s.shot.target)
            for at, s in self.shots
        )


def night(*faults: str, seconds: float, seed: int = 1, motion: str = "track 145.3 45", conditions="night") -> Told:
    """A run of so long, its rangers ready at its start."""
    world = TwinWords(START, seed=seed, motion=motion, conditions=conditions, faults=faults)
    with asyncio.Runner(loop_factory=FastLoop) as runner:
        return runner.run(_night(world, seconds))


async def _night(world: TwinWords, seconds: float) -> Told:
    loop = asyncio.get_running_loop()
    twin = world.twin(site())
    clock, network = VirtualClock(loop, world.start_mjd), MemoryNetwork(LATENCY)
    warming = WarmingClock(clock)
    served = RangersServed(
        site(), twin_heads(twin, site().rangers, warming), clock=clock, twin=twin, network=network, warming=warming
    )
    heard: asyncio.Queue[Listening] = asyncio.Queue()
    serving = asyncio.create_task(served.serve(heard.put_nowait))
    working = None
    try:
        await asyncio.wait([get := asyncio.ensure_future(heard.get()), serving], return_when=asyncio.FIRST_COMPLETED)
        at = get.result()
        running = LiveCoordinator(
            site(),
            Orders(port=0),
            peers_of(at),
            clock=clock,
            seed=world.seed,
            network=network,
            virtual=True,
        )
        after = running.settings.reference_after
        told = Told(twin.seconds_of_ticks, TwinComparison(site(), twin, reference_after=after))
        running.ziy.listeners.append(told.entry)
        working = asyncio.create_task(running.run())
        ended, _ = await asyncio.wait([serving, working], timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
        for task in ended:
            task.result()
        assert not ended, "neither rangers nor coordinator end by themselves"
        return told
    finally:
        for task in (working, serving):
            if task is not None and not task.done():
                task.cancel()
                with suppress(asyncio.CancelledError):
                    await task
