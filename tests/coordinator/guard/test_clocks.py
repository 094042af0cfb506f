"""This machine's clock, against a steady counter and against the rangers'."""

from types import SimpleNamespace

import pytest

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.guard.clocks import HostClock
from catseye.coordinator.parts import TICKS_PER_SECOND, ticks_now
from catseye.geometry.sky.time_tag import PER_SECOND
from catseye.ranger.status import StatusWord
from catseye.simulator.clock.world_clock import ManualClock


class Machine:
    """A clock that can jump, a counter that cannot, rangers whose clocks are right."""

    def __init__(self, rangers=6):
        self.clock, self.counted, self.jumped, self.said = ManualClock(61000.0), 0.0, 0.0, []
        self.links = {
            f"ZY{k}": SimpleNamespace(connected=True, status=StatusWord(0), clock_offset=0.0, clock_seen=0)
            for k in range(rangers)
        }
        log = EventLog("coordinator", self.clock, self.said.append)
        self.watch = HostClock(self.links, self.clock, log)

    def jump(self, seconds):
        self.clock._now += round(seconds * PER_SECOND)
        self.jumped += seconds

    def run(self, seconds, drift=0.0):
        for _ in range(seconds):
            self.clock.advance(1.0 + drift)
            self.jumped += drift
            self.counted += 1.0
            for link in self.links.values():
                if link.clock_seen >= 0:
                    link.clock_offset, link.clock_seen = -self.jumped, ticks_now(self.clock)
            self.watch.look(self.counted)

    @property
    def kinds(self):
        return [what.kind for what in self.said]


@pytest.mark.parametrize("jump", [0.1, -0.1, 10.0, -10.0, 3600.0, -3600.0, -1.0])  # the last is a leap second
def test_a_jump_is_told_with_its_size_and_nothing_is_fired_until_the_rangers_agree(jump):
    machine = Machine()
    machine.run(30)
    assert machine.watch.believed
    machine.jump(jump)
    machine.run(30)
    assert machine.kinds == ["host-clock-jump", "host-clock-off"]
    assert machine.said[0].severity == "alarm"
    assert f"jumped by {jump:+.3f} s" in machine.said[0].text
    assert f"6 of 6 rangers' clocks agree that this machine's is {jump:+.3f} s off" in machine.said[1].text
    assert not machine.watch.believed
    machine.jump(-jump)
    machine.run(30)
    assert machine.watch.believed
    assert machine.kinds[2:] == ["host-clock-jump", "host-clock-off-over"]


def test_a_clock_that_is_steered_has_not_jumped_and_one_that_runs_away_is_found_by_the_rangers():
    machine = Machine()
    machine.run(60, drift=5e-4)
    assert machine.kinds == []
    machine.run(120, drift=5e-4)
    assert machine.kinds == ["host-clock-off"]
    assert not machine.watch.believed


def test_one_ranger_that_is_off_or_two_that_differ_do_not_outvote_this_machine():
    machine = Machine()
    machine.links["ZY0"].clock_seen = -1
    machine.run(5)
    machine.links["ZY0"].clock_offset, machine.links["ZY0"].clock_seen = 5.0, ticks_now(machine.clock)
    machine.watch.look(machine.counted)
    assert machine.watch.believed
    few = Machine(rangers=2)
    few.jump(10.0)
    few.run(5)
    assert few.watch.believed  # two are too few to judge by


def test_clocks_without_a_time_signal_unconnected_or_long_unseen_have_no_vote():
    machine = Machine()
    machine.run(5)
    for k, link in enumerate(machine.links.values()):
        link.clock_offset = 10.0
        link.status = StatusWord.CLOCK_FREE if k < 2 else StatusWord(0)
        link.connected = k != 2
        link.clock_seen = ticks_now(machine.clock) - round((0.0 if k < 4 else 60.0) * TICKS_PER_SECOND)
    machine.watch.look(machine.counted)
    assert machine.watch.believed
