"""A ranger's clock, judged from the stamp of a reply and how long it took."""

import pytest

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.link.clock_watch import LONGEST_TRIP, ClockWatch
from catseye.coordinator.parts import TICKS_PER_SECOND, ticks_now
from catseye.simulator.clock.world_clock import ManualClock

LIMIT = 0.002  # s


@pytest.fixture
def watched():
    clock, happenings = ManualClock(60_000.1), []
    return ClockWatch(clock, EventLog("ZY101", clock, happenings.append), LIMIT), clock, happenings


def stamp(clock, seconds):
    return ticks_now(clock) + round(seconds * TICKS_PER_SECOND)


def test_what_it_is_set_to_is_right_when_it_arrives(watched):
    """Half a round trip from now: the command is as long on its way as the reply was."""
    watch, clock, happenings = watched
    trip = 0.05
    right = watch.look(stamp(clock, -0.5 * trip - 0.5), trip)  # it made its stamp half a trip ago, half a second slow
    assert watch.offset == pytest.approx(-0.5, abs=1.0 / TICKS_PER_SECOND)
    assert right == stamp(clock, 0.5 * trip)
    assert [each.kind for each in happenings] == ["clock-off"]


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_an_offset_that_the_way_may_have_made_is_none(watched, sign):
    watch, clock, happenings = watched
    trip = 0.05
    unsure = LIMIT + 0.5 * trip + 0.5 / TICKS_PER_SECOND
    assert watch.look(stamp(clock, -0.5 * trip + sign * (unsure - 0.002)), trip) is None
    assert watch.look(stamp(clock, -0.5 * trip + sign * (unsure + 0.002)), trip) is not None
    assert watch.look(stamp(clock, 10.0), LONGEST_TRIP + 0.01) is None  # too long a way tells nothing
    assert [each.kind for each in happenings] == ["clock-off"]


def test_a_clock_that_gains_is_told_with_its_rate(watched):
    watch, clock, happenings = watched
    watch.look(stamp(clock, 0.108), 0.0)  # 125 ticks
    clock.advance(108.0)
    watch.look(stamp(clock, 0.108), 0.0)  # 0.108 s in 108 s since it was set right
    assert [each.kind for each in happenings] == ["clock-off", "clock-off", "clock-drift"]
    assert "+1000 us a second" in happenings[-1].text
