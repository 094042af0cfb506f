"""Alarms: since when, acknowledged, shelved; what a return and a worse one do to both."""

import pytest

from catseye.coordinator.alarms import AlarmBook
from catseye.coordinator.condition import StandingProblem
from catseye.coordinator.event_log import EventLog
from catseye.coordinator.parts import TICKS_PER_SECOND, ticks_now
from catseye.errors import InputError
from catseye.simulator.clock.world_clock import ManualClock


class Book:
    """A book over a list of problems."""

    def __init__(self):
        self.clock, self.problems, self.events = ManualClock(60635.125), [], []
        self.book = AlarmBook(self.clock, lambda: self.problems, EventLog("alarms", self.clock, self.events.append))

    def one(self):
        (alarm,) = self.book.look()
        return alarm


def disk(severity="warning", text="disk: full in 20 h"):
    return StandingProblem("disk", severity, text)


def test_alarm_has_the_time_it_was_first_noticed_and_its_latest_text():
    site = Book()
    site.problems = [disk()]
    since = site.one().since
    assert since == ticks_now(site.clock)
    site.clock.advance(60.0)
    site.problems = [disk(text="disk: full in 19 h")]
    assert (site.one().since, site.one().problem.text) == (since, "disk: full in 19 h")


def test_alarm_that_returns_or_becomes_worse_is_unacknowledged():
    site = Book()
    site.problems = [disk()]
    site.book.acknowledge("disk", "anna")
    assert (site.one().acknowledged_by, site.one().acknowledged_at) == ("anna", ticks_now(site.clock))
    site.problems = [disk("alarm", "disk: full in 50 min")]
    assert site.one().acknowledged_by == ""
    site.book.acknowledge("disk", "ben")
    site.problems = [disk()]
    assert site.one().acknowledged_by == "ben"  # better, and still there
    site.problems = []
    assert site.book.look() == ()
    site.problems = [disk()]
    assert site.one().acknowledged_by == ""
    assert [(e.kind, e.details["alarm"], e.details["by"]) for e in site.events] == [
        ("acknowledged", "disk", "anna"),
        ("acknowledged", "disk", "ben"),
    ]


def test_shelving_lasts_over_a_return_and_ends_by_itself():
    site = Book()
    site.problems = [disk()]
    site.book.shelve("disk", 10.0, "anna")
    site.problems = []
    site.book.look()
    site.clock.advance(300.0)
    site.problems = [disk()]
    shelving = site.one().shelving
    assert shelving.by == "anna"
    assert (shelving.until - ticks_now(site.clock)) / TICKS_PER_SECOND == pytest.approx(300.0, abs=0.01)
    site.clock.advance(301.0)
    assert site.one().shelving is None
    assert [e.kind for e in site.events] == ["shelved", "shelved-over"]


def test_worse_alarm_is_not_shelved_any_more():
    site = Book()
    site.problems = [disk()]
    site.book.shelve("disk", 10.0, "anna")
    site.problems = [disk("alarm")]
    assert site.one().shelving is None
    site.problems = []
    site.book.look()
    site.problems = [disk()]
    assert site.one().shelving is None


def test_unshelved_by_hand_and_refusals_name_the_remedy():
    site = Book()
    site.problems = [disk()]
    site.book.shelve("disk", 10.0, "anna")
    site.book.unshelve("disk", "ben")
    assert site.one().shelving is None
    for call, words in [
        (lambda: site.book.unshelve("disk", "ben"), "is not shelved"),
        (lambda: site.book.acknowledge("clock", "ben"), "is not an alarm here now"),
        (lambda: site.book.acknowledge("disk", ""), "is no name"),
        (lambda: site.book.shelve("disk", 0.0, "ben"), "above 0"),
        (lambda: site.book.shelve("disk", float("nan"), "ben"), "above 0"),
        (lambda: site.book.shelve("disk", 1441.0, "ben"), "at most 1440"),
    ]:
        with pytest.raises(InputError, match=words):
            call()
    assert [e.kind for e in site.events] == ["shelved", "unshelved"]


def test_worst_and_latest_come_first():
    site = Book()
    site.problems = [disk()]
    site.book.look()
    site.clock.advance(5.0)
    site.problems = [disk(), StandingProblem("mode", "warning", "m"), StandingProblem("clock", "alarm", "c")]
    assert [alarm.problem.id for alarm in site.book.look()] == ["clock", "mode", "disk"]
