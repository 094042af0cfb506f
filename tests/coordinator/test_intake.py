"""The one way in: what the journal says late is acknowledged all the same."""

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


def test_what_was_not_durable_in_time_is_made_known_once_it_is():
    async def story():
        journal, published = SlowJournal(), []
        intake = intake_of(journal, published)
        intake.take(NOTE)
        intake.flush()
        journal.futures[0].set_exception(NotDurable("kept, and written when that is possible"))
        await settled()
        assert published == []
        assert intake.trouble is not None  # nothing is fired while what was fired is not safe
        intake._retry()
        await settled()
        assert published == [NOTE]
        assert intake.trouble is None
        assert journal.given == [NOTE]  # not sent again: the journal has it

    asyncio.run(story())


def test_what_is_durable_late_is_made_known_in_the_journals_order():
    async def story():
        journal, published = SlowJournal(), []
        intake = intake_of(journal, published)
        for note in (NOTE, NEXT):
            intake.take(note)
            intake.flush()
        journal.futures[0].set_exception(NotDurable("kept, and written when that is possible"))
        await settled()
        journal.futures[1].set_result(2)  # the journal is back, and has written both
        await settled()
        assert published == [NOTE, NEXT]

    asyncio.run(story())


def test_a_mistake_while_what_came_is_handled_ends_the_coordinator_and_is_not_just_a_line_in_a_log():
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
def test_a_shot_stamped_long_ago_or_of_the_future_is_not_used_and_told_and_spoils_none_after_it(off):
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
