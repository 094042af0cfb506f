"""Ordered intake: late entries, wrong stamps, clock corrections."""

import asyncio
from concurrent.futures import Future

import pytest

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.intake import Intake
from catseye.coordinator.journal.entries import AnsweredShot
from catseye.coordinator.journal.protocol import NotDurable
from catseye.coordinator.parts import TICKS_PER_SECOND, ticks_now
from catseye.errors import InputError
from catseye.records.night.live import Happening, LiveShot, LiveWeather
from catseye.simulator.clock.world_clock import ManualClock

CLOCK = ManualClock(60_635.125)
NOTE = Happening(1, "ZY101", "ready", "ZY101 is ready")
NEXT = Happening(2, "ZY102", "ready", "ZY102 is ready")


class SlowJournal:
    """A journal without trouble by the time that its refusal is heard: it was away, and is back."""

    trouble = None

    def __init__(self):
        self.given, self.futures = [], []

    def append(self, *items):
        self.given += items
        self.futures.append(Future())
        if not items:  # all before it are durable by now
            self.futures[-1].set_result(1)
        return self.futures[-1]


def intake_of(journal, published):
    event_log = EventLog("journal", CLOCK, lambda said: None)
    return Intake(None, journal, judged=None, publish=published.append, event_log=event_log)


async def settled():
    """What the journal's thread has said goes through the loop twice."""
    await asyncio.sleep(0.0)
    await asyncio.sleep(0.0)


def test_late_entries_are_published_once_durable():
    async def story():
        journal, published = SlowJournal(), []
        intake = intake_of(journal, published)
        intake.take(NOTE)
        intake.flush()
        journal.futures[0].set_exception(NotDurable("not durable yet; queued for retry"))
        await settled()
        assert published == []
        assert intake.trouble is not None  # nothing is fired while what was fired is not safe
        intake._retry()
        await settled()
        assert published == [NOTE]
        assert intake.trouble is None
        assert journal.given == [NOTE]  # not sent again: the journal has it

    asyncio.run(story())


def test_late_entries_are_published_in_journal_order():
    async def story():
        journal, published = SlowJournal(), []
        intake = intake_of(journal, published)
        for note in (NOTE, NEXT):
            intake.take(note)
            intake.flush()
        journal.futures[0].set_exception(NotDurable("not durable yet; queued for retry"))
        await settled()
        journal.futures[1].set_result(2)  # the journal is back, and has written both
        await settled()
        assert published == [NOTE, NEXT]

    asyncio.run(story())


def test_bug_during_processing_ends_the_coordinator():
    class Mistaken:
        def weather(self, read):
            raise ZeroDivisionError("a mistake in the reduction")

    async def story():
        intake = Intake(
            Mistaken(),
            SlowJournal(),
            judged=None,
            publish=None,
            event_log=EventLog("journal", CLOCK, lambda said: None),
        )
        intake.broken = asyncio.get_running_loop().create_future()
        intake.take(LiveWeather("WX1", 1, 10.0, 930.0, 50.0))
        with pytest.raises(ZeroDivisionError, match="a mistake in the reduction"):
            await asyncio.wait_for(intake.broken, 5.0)

    asyncio.run(story())


@pytest.mark.parametrize("off", [-3600.0, -130.0, 1.0, 10.0, 3600.0])
def test_shot_with_a_wrong_stamp_is_rejected_without_effect_on_later_ones(off):
    """A stamp an hour ahead must not make all that come after it stamps before the last one's."""

    class Refusing:
        def shot(self, shot):
            raise InputError("no such line")

    def shot(seconds):
        ticks = ticks_now(CLOCK) + round(seconds * TICKS_PER_SECOND)
        return LiveShot("ZY101", "TR01-B", ticks, 128, 64, 1000, 1e-4, None)

    async def story():
        journal, told, judged = SlowJournal(), [], []
        log = EventLog("journal", CLOCK, told.append)
        intake = Intake(Refusing(), journal, judged=judged.append, publish=None, event_log=log, clock=CLOCK)
        for seconds in (-0.3, off, -0.1):
            intake.take(shot(seconds))
        intake.flush()
        assert [answered.shot.ticks for answered in judged] == [shot(-0.3).ticks, shot(-0.1).ticks]
        assert [answered.shot.number for answered in judged] == [1, 2]
        assert all(isinstance(given, AnsweredShot) for given in journal.given)
        assert [(said.kind, said.severity) for said in told] == [("stamp-off", "alarm")]
        assert f"ZY101: a shot's stamp is {off:+.1f} s from now" in told[0].text

    asyncio.run(story())


# A jump of our clock -------------------------------------------------------------------------------------------------


class Forgetful:
    """A reduction that uses every shot, and writes down corrections; solving waits until it may."""

    failed = ""

    def __init__(self):
        self.corrected, self.taken = [], []

    def shot(self, shot):
        raise InputError("no such line")

    def clock_corrected(self, ticks):
        self.corrected.append(ticks)

    def begin(self, ticks):
        return ticks

    def accept(self, job, epoch):
        self.taken.append(job)
        return {"number": 1}


def shot_at(seconds):
    ticks = ticks_now(CLOCK) + round(seconds * TICKS_PER_SECOND)
    return LiveShot("ZY101", "TR01-B", ticks, 128, 64, 1000, 1e-4, None)  # 0.128 s long


def jumping(told, journal=None, solver=None):
    live, judged = Forgetful(), []
    log = EventLog("journal", CLOCK, told.append)
    intake = Intake(
        live, journal or SlowJournal(), judged=judged.append, publish=None, event_log=log, clock=CLOCK, solver=solver
    )
    return intake, live, judged


@pytest.mark.parametrize(
    ("seconds", "used"), [(-10.2, True), (-10.1, False), (-9.0, False), (-5.1, False), (-4.9, True)]
)
def test_shot_overlapping_a_jump_is_rejected(seconds, used):
    async def story():
        told = []
        intake, _, judged = jumping(told)
        ticks = ticks_now(CLOCK)
        intake.clock_jumped(ticks - round(10.0 * TICKS_PER_SECOND), ticks - round(5.0 * TICKS_PER_SECOND))
        intake.take(shot_at(seconds))
        intake.flush()
        assert len(judged) == used
        assert [what.kind for what in told] == ([] if used else ["stamp-across-jump"])

    asyncio.run(story())


def test_shots_are_rejected_until_a_jump_is_judged():
    async def story():
        told = []
        intake, _, judged = jumping(told)
        intake.take(shot_at(-0.4))  # has come before: it is fed first
        intake.clock_jumped(ticks_now(CLOCK), None)
        intake.take(shot_at(-0.1))
        intake.take(shot_at(0.3))
        intake.flush()
        assert [answered.shot.ticks for answered in judged] == [shot_at(-0.4).ticks]

    asyncio.run(story())


def test_clock_set_back_by_an_hour_rejects_no_later_shot_and_is_journalled():
    clock = ManualClock(60_635.125)

    async def story():
        journal, live, judged = SlowJournal(), Forgetful(), []
        log = EventLog("journal", clock, lambda said: None)
        intake = Intake(live, journal, judged=judged.append, publish=None, event_log=log, clock=clock)
        ahead = ticks_now(clock) + round(0.3 * TICKS_PER_SECOND)
        intake.take(LiveShot("ZY101", "TR01-B", ahead, 128, 64, 1000, 1e-4, None))
        intake.flush()
        clock._now -= 3600 * 10**9
        now = ticks_now(clock)
        intake.clock_corrected(-3600.0)
        intake.take(LiveShot("ZY101", "TR01-B", now, 128, 64, 1000, 1e-4, None))
        intake.flush()
        assert [answered.shot.ticks for answered in judged] == [ahead, now]
        assert live.corrected == [now]
        document = journal.given[1]
        assert (document.ticks, document.name, document.text) == (now, "clock-corrected", '{"gained_s": -3600.0}')

    asyncio.run(story())


def test_epoch_under_way_at_a_clock_correction_is_discarded():
    async def story():
        told, journal, going = [], SlowJournal(), asyncio.Event()

        async def solver(job):
            await going.wait()
            return "an epoch"

        intake, live, _ = jumping(told, journal, solver)
        intake.take(shot_at(-0.2))
        solving = asyncio.ensure_future(intake.solve(ticks_now(CLOCK)))
        await asyncio.sleep(0.0)
        intake.clock_corrected(10.0)
        going.set()
        assert await solving is None
        assert live.taken == []
        assert [(what.kind, what.severity) for what in told] == [("not-solved", "warning")]
        assert "the clock was corrected meanwhile" in told[0].text
        names = [getattr(entry, "name", type(entry).__name__) for entry in journal.given]
        assert names == ["AnsweredShot", "epoch-begun", "clock-corrected", "EpochSolution"]
        assert journal.given[-1].answer == {}

    asyncio.run(story())
