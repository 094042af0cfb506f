"""Watch of the journal's disk: prediction, warnings, stop and resumption."""

from pathlib import Path

import pytest

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.journal.disk import DiskWatch
from catseye.coordinator.journal.writer import Journal
from catseye.simulator.clock.world_clock import ManualClock
from journal_scene import MOST_WAIT, START, scene_answer, scene_run

GB = 10**9


class Disk:
    """A disk that fills at a rate, with what a watch on it says and holds."""

    def __init__(self, free, reserve=GB):
        self.free, self.now, self.held, self.said = free, 0.0, [], []
        log = EventLog("journal", ManualClock(61000.0), self.said.append)
        self.watch = DiskWatch(log, self.held.append, reserve=reserve, free_of=lambda _: int(self.free))

    def run(self, seconds, rate):
        for _ in range(round(seconds / 10.0)):
            self.now, self.free = self.now + 10.0, self.free - 10.0 * rate
            state = self.watch.look(Path(), self.now)
        return state

    @property
    def kinds(self):
        return [(what.kind, what.severity) for what in self.said]


def test_disk_that_does_not_fill_is_not_reported():
    disk = Disk(5 * GB)
    assert disk.run(600, 0.0).seconds == float("inf")
    assert disk.run(600, -1e6).seconds == float("inf")
    assert disk.said == []
    assert disk.held == []


def test_full_disk_is_predicted_from_the_recent_rate():
    disk = Disk(101 * GB)
    state = disk.run(600, 2e6)
    assert state.rate == pytest.approx(2e6)
    assert state.seconds == pytest.approx((101 * GB - 600 * 2e6 - GB) / 2e6)
    assert disk.kinds == [("disk-full-in-a-day", "warning")]
    assert "measuring stops in 13.9 h" in disk.said[0].text


def test_warnings_a_day_and_an_hour_before_then_stop_and_resume():
    disk = Disk(20 * GB)
    disk.run(600, 1e5)  # two days
    assert disk.kinds == []
    disk.run(600, 1e6)
    assert disk.kinds == [("disk-full-in-a-day", "warning")]
    disk.run(600, 1e7)
    assert disk.kinds[-1] == ("disk-full-in-an-hour", "alarm")
    assert disk.held == []
    disk.run(2000, 1e7)
    assert disk.kinds[-1] == ("disk-full", "alarm")
    assert len(disk.held) == 1
    assert "expected at least 1000 MB" in disk.held[0]
    disk.free = 1.2 * GB  # a little room is not yet enough
    disk.run(10, 0.0)
    assert len(disk.held) == 1
    disk.free = 3 * GB
    disk.run(600, 0.0)
    assert disk.held[1:] == [None]
    assert disk.kinds[-1] == ("disk-full-over", "note")


def test_held_journal_refuses_shots_but_writes_entries(tmp_path):
    with Journal.open(tmp_path / "j.db", run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        journal.hold("the disk is nearly full")
        assert journal.trouble == "the disk is nearly full"
        assert journal.append(scene_answer(1)).result(MOST_WAIT) == 1
        journal.hold(None)
        assert journal.trouble is None
