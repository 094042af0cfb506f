"""A ranger's clock, judged by stamps and round trips."""

import pytest

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.link.clock_watch import ClockWatch
from catseye.coordinator.parts import TICKS_PER_SECOND, ticks_now
from catseye.simulator.clock.world_clock import ManualClock

LIMIT = 0.002  # s


@pytest.fixture
def watched():
    clock, happenings = ManualClock(60_000.1), []
    return ClockWatch(clock, EventLog("ZY101", clock, happenings.append), LIMIT), clock, happenings


def stamp(clock, seconds):
    return ticks_now(clock) + round(seconds * TICKS_PER_SECOND)


def test_clock_is_set_allowing_for_link_delay(watched):
    """Half a round trip from now: the command is as long on its way as the reply was."""
    watch, clock, happenings = watched
    trip = 0.05
    assert watch.look(stamp(clock, -0.5 * trip - 0.5), trip) is None  # so far off, it is asked again
    right = watch.look(stamp(clock, -0.5 * trip - 0.5), trip)  # it made its stamp half a trip ago, half a second slow
    assert watch.offset == pytest.approx(-0.5, abs=1.0 / TICKS_PER_SECOND)
    assert right == stamp(clock, 0.5 * trip)
    assert [each.kind for each in happenings] == ["clock-off"]


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_offset_within_link_delay_is_ignored(watched, sign):
    watch, clock, happenings = watched
    trip = 0.05
    unsure = LIMIT + 0.5 * trip + 0.5 / TICKS_PER_SECOND
    assert watch.look(stamp(clock, -0.5 * trip + sign * (unsure - 0.002)), trip) is None
    assert watch.look(stamp(clock, -0.5 * trip + sign * (unsure + 0.002)), trip) is not None
    assert watch.look(stamp(clock, -0.1), 1.0) is None  # a long way may have made it
    assert [each.kind for each in happenings] == ["clock-off", "clock-jump"]  # it was right at the same instant


def test_drift_is_reported_with_its_rate(watched):
    watch, clock, happenings = watched
    watch.look(stamp(clock, 0.0432), 0.0)  # 50 ticks
    clock.advance(43.2)
    watch.look(stamp(clock, 0.0432), 0.0)  # 0.0432 s in 43.2 s since it was set right
    assert [each.kind for each in happenings] == ["clock-off", "clock-off", "clock-drift"]
    assert "+1000 us a second" in happenings[-1].text


@pytest.mark.parametrize("trip", [0.01, 0.3, 3.0])
@pytest.mark.parametrize("jump", [10.0, -10.0, 3600.0, -3600.0])
def test_jump_is_not_drift_and_is_detected_over_a_slow_link(watched, jump, trip):
    watch, clock, happenings = watched
    for _ in range(3):
        assert watch.look(stamp(clock, -0.5 * trip), trip) is None
        clock.advance(2.0)
    assert watch.look(stamp(clock, jump - 0.5 * trip), trip) is None
    assert watch.look(stamp(clock, jump - 0.5 * trip), trip) is not None
    assert [each.kind for each in happenings] == ["clock-off", "clock-jump"]
    assert happenings[1].severity == "alarm"
    assert f"jumped by {jump:+.3f} s: shots since" in happenings[1].text


@pytest.mark.parametrize("jump", [0.1, -0.1])
def test_jump_of_a_tenth_of_a_second_is_reported(watched, jump):
    watch, clock, happenings = watched
    assert watch.look(stamp(clock, 0.0), 0.001) is None
    clock.advance(2.0)
    assert watch.look(stamp(clock, jump), 0.001) is None
    assert watch.look(stamp(clock, jump), 0.001) is not None
    assert [each.kind for each in happenings] == ["clock-off", "clock-jump"]


def test_clock_is_not_set_without_permission(watched):
    _, clock, happenings = watched
    watch = ClockWatch(clock, EventLog("ZY101", clock, happenings.append), LIMIT, lambda: False)
    assert watch.look(stamp(clock, 10.0), 0.001) is None
    assert watch.offset == pytest.approx(10.0, abs=1e-3)
    assert happenings == []


@pytest.mark.parametrize("jitter", [0.0, 1.0])
def test_long_round_trips_hide_nothing_and_set_nothing(watched, jitter):
    """One short way among seven long ones says where the clock is; the long ones never say otherwise."""
    watch, clock, happenings = watched
    for k in range(64):
        trip = 0.004 if k % 7 == 0 else 1.5
        late = trip * (0.5 + jitter * (k * 37 % 10 - 4.5) / 10.0)  # anywhere within its way
        assert watch.look(stamp(clock, -late), trip) is None
        assert watch.error < 0.004
        assert abs(watch.offset) <= watch.error
        clock.advance(2.0)
    assert happenings == []
    assert watch.look(stamp(clock, 0.4 - 0.75), 1.5) is None  # within what a long way allows
    clock.advance(2.0)
    assert watch.look(stamp(clock, 0.04 - 0.002), 0.004) is not None  # off, and a short way shows it
    assert [each.kind for each in happenings] == ["clock-off", "clock-jump"]


def test_offset_error_is_the_shortest_round_trip(watched):
    watch, clock, _ = watched
    watch.look(stamp(clock, -0.9), 1.0)
    assert watch.offset == pytest.approx(-0.4, abs=1e-3)
    assert watch.error == pytest.approx(0.5, abs=1e-3)


def test_samples_are_cleared_after_a_correction_of_our_clock(watched):
    watch, clock, happenings = watched
    for _ in range(3):
        assert watch.look(stamp(clock, 0.0), 0.002) is None
        clock.advance(2.0)
    watch.corrected()
    assert (watch.seen, watch.error) == (0, float("inf"))
    assert watch.look(stamp(clock, 3600.0), 0.002) is None
    assert watch.look(stamp(clock, 3600.0), 0.002) is not None  # a ranger that had been set by ours
    assert [each.kind for each in happenings] == ["clock-off"]  # no jump of its own
