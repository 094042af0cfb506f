"""A coordinator whose machine's UTC is set while it measures."""

import asyncio

import pytest

from catseye.clock import PER_DAY, UNIX_EPOCH_DAY, SystemClock
from catseye.coordinator.journal.entries import CLOCK_CORRECTED, AnsweredShot, Document, SentCommand
from catseye.coordinator.parts import TICKS_PER_SECOND, Environment, ticks_now
from catseye.coordinator.ziy import Coordinator, CoordinatorParts
from catseye.geometry.sky.time_tag import PER_SECOND
from catseye.records.night.live import Happening
from coordinator.link_scene import COMMANDS, DAY, LoopClock, network, run, until
from coordinator.ziy_scene import ListLive, Site, gbt

RANGERS = ("ZY101", "ZY102", "ZY103")


class TimedLive(ListLive):
    """Writes down corrections too."""

    def __init__(self):
        super().__init__()
        self.corrected = []

    def clock_corrected(self, ticks):
        self.corrected.append(ticks)


class SetSite(Site):
    """A site whose coordinator's machine is `ahead` s ahead of the rangers; `jump` sets its UTC."""

    def __init__(self, ahead=0.0):
        super().__init__(RANGERS, live=TimedLive())
        self.ahead = ahead
        self.ready = ahead == 0.0

    def jump(self, seconds):
        self.ahead += seconds

    def begin(self):
        loop = asyncio.get_running_loop()
        self.clock = SystemClock(
            realtime=lambda: round((loop.time() + self.ahead) * PER_SECOND) + (DAY - UNIX_EPOCH_DAY) * PER_DAY,
            monotonic=lambda: round(loop.time() * PER_SECOND),
        )
        self.ziy = Coordinator(
            gbt(),
            addresses={name: served.address for name, served in self.served.items()},
            parts=CoordinatorParts(self.live, self.planner, self.guard, self.journal),
            environment=Environment(self.clock, network()),
            feed=self.feed,
            commands=lambda ranger: COMMANDS,
        )
        self.ziy.host_clock._kernel = lambda: None
        self.ziy.listeners.append(self.published.append)
        self.task = asyncio.ensure_future(self.ziy.run())

    @property
    def shots(self):
        return [row.shot for row in self.journal.rows if isinstance(row, AnsweredShot)]

    def events(self, kind):
        return [row for row in self.journal.rows if isinstance(row, Happening) and row.kind == kind]


def fired(site):
    """Triggers that were sent, whatever came of them."""
    rows = [row for row in site.journal.rows if isinstance(row, SentCommand)]
    return sum("\tCMEAS" in row.line for row in rows)


@pytest.mark.parametrize("seconds", [3600.0, -3600.0, 0.4, -1.0])
def test_wrong_jump_suspends_measuring_until_the_count_is_confirmed(seconds):
    async def story():
        async with SetSite() as site:
            await until(lambda: len(site.shots) >= 9)
            site.jump(seconds)
            await until(lambda: not site.ziy.host_clock.believed, 5.0)
            await asyncio.sleep(1.0)  # what was under way has come
            before = fired(site)
            await asyncio.sleep(1.5)
            assert fired(site) == before
            await until(lambda: site.ziy.host_clock.believed, 20.0)
            have = len(site.shots)
            await until(lambda: len(site.shots) >= have + 9)
            assert len(site.events("host-clock-jump")) == 1
            assert len(site.events("host-clock-off")) == 1
            assert site.events("clock-corrected") == []
            assert site.live.corrected == []
            assert site.events("clock-off") == []  # no ranger's clock was touched
            true = ticks_now(LoopClock())
            assert all(0 <= true - shot.ticks < 600 * TICKS_PER_SECOND for shot in site.shots)

    run(story)


@pytest.mark.parametrize("ahead", [3600.0, -3600.0, 0.4])
def test_corrected_machine_measures_without_a_restart(ahead):
    async def story():
        async with SetSite(ahead) as site:
            await until(lambda: site.events("host-clock-off"), 30.0)
            await until(lambda: all(link.state == "ready" for link in site.ziy.links.values()), 30.0)
            for served in site.served.values():
                served.light()
            await asyncio.sleep(5.0)  # what was fired before the rangers' clocks were heard has come
            first = len(site.shots)
            before = fired(site)
            await asyncio.sleep(10.0)
            assert fired(site) == before
            site.jump(-ahead)
            await until(lambda: site.events("clock-corrected"), 20.0)
            now = ticks_now(LoopClock())
            assert abs(ticks_now(site.clock) - now) <= 2
            await until(lambda: len(site.shots) >= first + 9)
            (corrected,) = site.events("clock-corrected")
            assert corrected.details["offset_s"] == pytest.approx(-ahead, abs=1e-6)
            (document,) = [
                row for row in site.journal.rows if isinstance(row, Document) and row.name == CLOCK_CORRECTED
            ]
            assert site.live.corrected == [document.ticks]
            assert document.ticks == pytest.approx(now, abs=60 * TICKS_PER_SECOND)
            assert all(shot.ticks >= document.ticks for shot in site.shots[first:])
            assert site.ziy.host_clock.trouble is None
            assert not site.task.done()

    run(story)


def test_shot_during_a_jump_is_rejected():
    async def story():
        async with SetSite() as site:
            await until(lambda: len(site.shots) >= 9)
            for _ in range(4):
                have = len(site.shots)
                await until(lambda have=have: len(site.shots) > have)
                since = ticks_now(LoopClock())
                site.jump(3600.0)
                await until(lambda: not site.ziy.host_clock.believed, 5.0)
                seen = ticks_now(LoopClock())
                await until(lambda: site.ziy.host_clock.believed, 20.0)
                over = ticks_now(LoopClock())
                site.jump(-3600.0)
                await until(lambda: not site.ziy.host_clock.believed, 5.0)
                await until(lambda: site.ziy.host_clock.believed, 20.0)
                await until(lambda over=over: site.shots[-1].ticks > over)
                ends = [shot.ticks + 0.128 * TICKS_PER_SECOND for shot in site.shots]
                late = (
                    seen - 0.05 * TICKS_PER_SECOND
                )  # what had come before the jump was seen is used: it has true stamps
                assert not [end for end in ends if max(since, late) < end < over - TICKS_PER_SECOND]

    run(story)
