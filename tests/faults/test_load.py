"""Many rangers at once, in a process of their own, on sockets: each shot that was fired is in the journal, and once.

What counts is the heads' own count of what they fired. Timing is not asserted, machines differ: it is measured by
benchmarks/bench_live.py.
"""

import asyncio
import time
from typing import NamedTuple

import pytest

from catseye.coordinator.guard.guard import SafetyGuard
from catseye.coordinator.journal.entries import AnsweredShot, Run
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.writer import Journal
from catseye.coordinator.parts import Environment
from catseye.coordinator.ziy import Coordinator, CoordinatorParts
from catseye.ranger.initialisation import SiteCommands
from catseye.reduction.live.live import Live
from catseye.service.solver import SolverProcess
from load_scene import EverySecond, LoadChild, load_site, lost_and_doubled

TARGETS = 4
ROUND = 10.0  # s
LONGEST = 60.0  # s until all rangers are ready, or at rest


async def once_a_second(child, site, place, seconds):
    """The rangers shoot once a second for so long; what was acknowledged, and what the heads counted."""
    live, acknowledged = Live(site), []
    solver = SolverProcess(live.site)
    solver.start()
    journal = Journal.open(place, run=Run(site), clock=child.clock)
    ziy = Coordinator(
        site,
        addresses=child.addresses,
        parts=CoordinatorParts(
            live, EverySecond(site, live, seconds=round(ROUND)), SafetyGuard(site), journal, solver.solve
        ),
        environment=Environment(child.clock),
        feed=child.feed,
        mode="hold",
        commands=SiteCommands(site).of_ranger,
    )
    ziy.listeners.append(lambda entry: acknowledged.extend(told(entry)))
    task = asyncio.create_task(ziy.run())
    await until(lambda: all(link.connected for link in ziy.links.values()), task)
    ziy.set_mode("active")
    await until(lambda: all(link.state == "ready" for link in ziy.links.values()), task)
    await asyncio.wait([task], timeout=seconds)
    ziy.set_mode("hold")  # what is under way comes to its end, nothing more is begun
    await until(lambda: not any(link.busy for link in ziy.links.values()), task)
    ziy.intake.flush()
    await until(lambda: ziy.intake.acknowledged == ziy.intake.numbered, task)
    counted = child.report()["fired"]
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    solver.stop()
    return acknowledged, counted


def told(entry):
    """What is remembered of a shot: not its samples, which ten minutes of would fill the memory."""
    if isinstance(entry, AnsweredShot):
        shot = entry.shot
        yield Told(shot.ranger, shot.ticks, shot.number, entry.status, shot.samples is not None)


class Told(NamedTuple):
    ranger: str
    ticks: int
    number: int
    status: str
    sampled: bool


async def until(true, task):
    began = time.monotonic()
    while not true():
        assert time.monotonic() - began < LONGEST
        done, _ = await asyncio.wait([task], timeout=0.1)
        assert not done


def held(rangers, seconds, place):
    """Shots a ranger; nothing lost, nothing doubled, nothing told that is not there."""
    site = load_site(rangers, targets=TARGETS)
    with LoadChild(rangers, targets=TARGETS) as child:
        shots, fired = asyncio.run(once_a_second(child, site, place, seconds))
    assert sorted(fired) == list(site.rangers)
    assert lost_and_doubled(fired, JournalReader(place)) == (0, 0)
    assert sorted((s.ranger, s.ticks) for s in shots) == sorted((r, t) for r in fired for t in fired[r])
    assert [s.number for s in shots] == list(range(1, len(shots) + 1))
    assert all(s.sampled for s in shots)
    assert {s.status for s in shots} <= {"used", "reference"}
    return [len(ticks) for ticks in fired.values()]


@pytest.mark.slow  # once in eight runs, at load 9, it found a shot missing: not understood yet
def test_forty_rangers_at_a_shot_a_second_lose_and_duplicate_none(tmp_path):
    shots = held(40, 20.0, tmp_path / "load.db")
    assert min(shots) >= 5  # of 20: that it measured at all, on whatever machine


@pytest.mark.slow
def test_200_rangers_sustain_a_shot_a_second_for_ten_minutes(tmp_path):
    shots = held(200, 600.0, tmp_path / "load.db")
    assert min(shots) >= 0.9 * 600 * (ROUND - 1.0) / ROUND  # a round's lead and planning take a second of ten
