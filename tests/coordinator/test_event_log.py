"""Event log: suppressed repetitions, and forgotten kinds."""

from catseye.coordinator.event_log import EventLog
from catseye.simulator.clock.world_clock import ManualClock


def test_kinds_without_suppressed_events_are_forgotten():
    """A line's kinds were kept for the whole night: a coordinator of 18 rangers and 2400 targets has many."""
    clock, said = ManualClock(61000.0), []
    log = EventLog("coordinator", clock, said.append)
    for k in range(1000):
        log.tell("blocked", f"line {k}", about=f"line {k}")
        clock.advance(1.0)
    assert len(log._logged) <= 11
    assert len(said) == 1000


def test_suppressed_events_are_counted_in_the_next_one():
    clock, said = ManualClock(61000.0), []
    log = EventLog("coordinator", clock, said.append)
    for _ in range(3):
        log.tell("blocked", "a line", about="a line")
    for k in range(100):
        clock.advance(1.0)
        log.tell("blocked", f"line {k}", about=f"line {k}")
    log.tell("blocked", "a line", about="a line")
    assert said[-1].details["unsaid"] == 2.0


def test_suppressed_event_does_not_keep_later_kinds():
    clock, said = ManualClock(61000.0), []
    log = EventLog("coordinator", clock, said.append)
    for k in range(1000):
        for _ in range(1 + (k % 100 == 0)):
            log.tell("blocked", f"line {k}", about=f"line {k}")
        clock.advance(1.0)
    assert len(log._logged) <= 11 + 10
    log.tell("blocked", "line 0", about="line 0")
    assert said[-1].details["unsaid"] == 1.0


def test_clock_set_back_does_not_stop_forgetting():
    clock, said = ManualClock(61000.0), []
    log = EventLog("coordinator", clock, said.append)
    for k in range(100):
        log.tell("blocked", f"line {k}", about=f"line {k}")
    clock.advance(-3600.0)
    for k in range(100, 1000):
        log.tell("blocked", f"line {k}", about=f"line {k}")
        clock.advance(1.0)
    assert len(log._logged) <= 11
