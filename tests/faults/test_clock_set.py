"""Real processes on a machine whose clock is set: told, nothing restarted, no shot stamped wrongly.

libfaketime answers the processes' questions for CLOCK_REALTIME from a file and leaves CLOCK_MONOTONIC alone; what it
does in virtual time is in `tests/coordinator/test_clock_jumps.py`.
"""

from pathlib import Path

import pytest

from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.parts import TICKS_PER_SECOND
from cli.living_scene import PATIENCE
from faults.system_scene import START, LivingSite, replays

LIBRARIES = sorted(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"))
HOUR = 3600.0
SPAN = 900.0  # s that this test takes at most


@pytest.fixture
def faketime():
    if not LIBRARIES:
        pytest.skip("libfaketime is not installed (Debian's package libfaketime): this machine's clock cannot be set")
    return LIBRARIES[0]


class SettableSite(LivingSite):
    """A living site all of whose processes see the machine's UTC `ahead` s ahead."""

    def __init__(self, journal, folder, library):
        super().__init__(journal, folder)
        self.file = folder / "ahead"
        self.set(0.0)
        words = [f"LD_PRELOAD={library}", f"FAKETIME_TIMESTAMP_FILE={self.file}", "FAKETIME_DONT_FAKE_MONOTONIC=1"]
        for node in (self.coordinator, *self.rangers.values()):
            node.command = ["env", *words, "FAKETIME_CACHE_DURATION=1", "NO_FAKE_STAT=1", *node.command]

    def set(self, ahead):
        """Set the machine's UTC, in one step for all that look."""
        self.mark = len(self.heard[-1].lines) if self.heard else 0
        new = self.file.with_suffix(".new")
        new.write_text(f"{ahead:+f}\n")
        new.rename(self.file)

    def told(self, kind):
        """Whether the client is told of an event since the last setting."""
        heard, have = self.heard[-1], self.mark
        found = self.client.read(PATIENCE, lambda: any(line[4:5] == (kind,) for line in heard.lines[have:]))
        assert found, f"no {kind}: {[line for line in heard.lines[have:] if line[1] == 'EVENT']}"


@pytest.mark.slow
def test_site_continues_when_its_clock_is_set_wrong_and_right(faketime, tmp_path):
    place = tmp_path / "j.db"
    site = SettableSite(place, tmp_path, faketime)
    try:
        for node in site.rangers.values():
            node.start()
        for node in site.rangers.values():
            assert node.heard('"rangers"')
        site.start_coordinator()
        site.connect()
        site.measuring()
        pids = [node.pid for node in (site.coordinator, *site.rangers.values())]
        for ahead in (HOUR, -HOUR):  # set wrong, by an hour each way: the rangers know better
            site.set(ahead)
            site.told("host-clock-jump")
            site.told("host-clock-off")
            site.measuring()
            site.set(0.0)
            site.told("host-clock-off-over")
            site.measuring()
        assert [node.pid for node in (site.coordinator, *site.rangers.values())] == pids
        site.kill_coordinator()
        site.set(HOUR)  # a coordinator that starts on a wrong machine, and the machine is set right
        site.start_coordinator()
        site.mark = 0
        site.connect()
        site.told("host-clock-off")
        site.client.read(3.0)  # what was fired before the rangers were heard
        have = len(site.heard[-1].shots)
        site.client.read(5.0)
        assert len(site.heard[-1].shots) == have
        site.set(0.0)
        site.told("clock-corrected")
        site.measuring()
    finally:
        site.stop()
    with JournalReader(place) as reader:
        runs = reader.runs()
        assert len(runs) == 2
        for run in runs:
            stamps = [entry.shot.ticks / TICKS_PER_SECOND - START * 86_400.0 for _, entry in reader.shots(run.run)]
            assert len(stamps) >= 4
            assert all(0.0 < stamp < SPAN for stamp in stamps)  # s since the twin's start
            replays(reader, run.run)
        kinds = [entry.kind for _, entry in reader.events(runs[1].run, kinds=["happenings"])]
        assert kinds.count("clock-corrected") == 1
