"""Full disk, removed file, hung server: an alarm, nothing half-written, recovery."""

import asyncio
import os
import resource
import shutil
import sqlite3
import subprocess
import threading
from contextlib import contextmanager

import pytest

from catseye.coordinator.journal import writer as journal_module
from catseye.coordinator.journal.protocol import NotDurable
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.writer import Journal, JournalSettings
from catseye.errors import InputError
from catseye.records.night.live import Happening
from catseye.simulator.clock.world_clock import ManualClock
from journal_scene import MOST_WAIT, START, scene_answer, scene_run


class Told:
    """Alarms and recoveries, and events to wait for."""

    def __init__(self):
        self.said, self.alarmed, self.back = [], threading.Event(), threading.Event()

    def alarm(self, text):
        self.said.append(("alarm", text))
        self.alarmed.set()

    def recovery(self, text):
        self.said.append(("back", text))
        self.back.set()


def opened(place, told, **more):
    settings = {"run": scene_run(), "clock": ManualClock(START / 1e8), "settings": JournalSettings(patience=0.05)}
    return Journal.open(place, **{**settings, **more}, on_alarm=told.alarm, on_recovery=told.recovery)


@contextmanager
def no_file_larger_than(size):
    """For this process; Python ignores the signal, so that a write fails as one on a full disk does."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def fill(journal):
    """Pairs of a shot and its happening until even the next one cannot be made durable; the futures.

    Folding the log into the file may make a little room after a first failure.
    """
    futures = []
    while not (len(futures) > 8 and all(future.done() and future.exception() for future in futures[-2:])):
        futures.append(journal.append(scene_answer(len(futures)), Happening(START, "x", "filler", "w" * 20_000)))
        if len(futures) % 8 == 0 or (len(futures) > 1 and futures[-2].done()):
            futures[-1].exception(MOST_WAIT)
    return futures


def pairs_stored(place):
    """Whole pairs in run 1; there is never a half."""
    with JournalReader(place) as reader:
        seqs = [seq for seq, _ in reader.events(1, buffers=False)]
    assert seqs == list(range(1, len(seqs) + 1))
    assert len(seqs) % 2 == 0
    return len(seqs) // 2


def assert_full_and_back(place, told, journal, make_room):
    """Fills up; futures fail while it lasts; after there is room all is there."""
    futures = fill(journal)
    failed = [k for k, future in enumerate(futures) if future.exception(MOST_WAIT) is not None]
    assert all(future.result() == 2 * k + 2 for k, future in enumerate(futures) if k not in failed)
    assert {type(futures[k].exception()) for k in failed} == {NotDurable}
    assert "not durable yet; queued for retry" in str(futures[-1].exception())
    assert len(futures) - len(failed) <= pairs_stored(place) < len(futures)
    assert journal.trouble is not None
    make_room()
    late = journal.append(scene_answer(10_000))
    assert late.exception(MOST_WAIT) is None or told.back.wait(MOST_WAIT)
    assert journal.append().result(MOST_WAIT) == 2 * len(futures) + 1
    assert journal.trouble is None
    kinds = [kind for kind, _ in told.said]
    assert kinds == ["alarm", "back"] * (len(kinds) // 2) != []
    return len(futures)


def test_full_disk_is_reported_and_recovered_from(tmp_path):
    told = Told()
    journal = opened(tmp_path / "j.db", told)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    with no_file_larger_than(1_500_000):
        count = assert_full_and_back(
            tmp_path / "j.db", told, journal, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, before)
        )
    journal.close()
    with JournalReader(tmp_path / "j.db") as reader:
        assert [seq for seq, _ in reader.shots(1)] == [*range(1, 2 * count + 1, 2), 2 * count + 1]
        assert [shot.shot.number for _, shot in reader.shots(1)] == [*range(count), 10_000]
    assert "full" in told.said[0][1] or "I/O error" in told.said[0][1]
    assert told.said[0][1].count("\n") == 0


@pytest.mark.skipif(os.getuid() != 0 or shutil.which("mount") is None, reason="needs root to mount a small disk")
def test_full_small_disk_is_reported_and_recovered_from(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", disk], check=False, capture_output=True)
    if mounted.returncode:
        pytest.skip(f"cannot mount: {mounted.stderr.decode().strip()}")
    try:
        told = Told()
        (disk / "ballast").write_bytes(bytes(1_500_000))
        journal = opened(disk / "j.db", told)
        assert_full_and_back(disk / "j.db", told, journal, (disk / "ballast").unlink)
        assert "database or disk is full" in told.said[0][1]
        journal.close()
    finally:
        subprocess.run(["umount", disk], check=True)


def test_journal_closed_on_a_full_disk_reports_its_loss(tmp_path):
    journal = opened(tmp_path / "j.db", Told())
    with no_file_larger_than(1_000_000):
        futures = fill(journal)
        with pytest.raises(InputError, match="rows not written") as caught:
            journal.close(timeout=0.2)
    lost = int(str(caught.value).partition("closed with ")[2].split()[0])
    assert lost == 3 * (len(futures) - pairs_stored(tmp_path / "j.db"))  # a shot, its buffer, the happening
    with opened(tmp_path / "j.db", Told()) as journal:
        assert journal.append(scene_answer(1)).result(MOST_WAIT) == 1


def test_removed_file_stops_acknowledgements(tmp_path):
    """The system would let us write into it for ever."""
    told = Told()
    journal = opened(tmp_path / "j.db", told)
    journal.append(scene_answer(0)).result(MOST_WAIT)
    for name in ("j.db", "j.db-wal", "j.db-shm"):
        (tmp_path / name).rename(tmp_path / f"away-{name}")
    with pytest.raises(InputError, match="not durable yet; queued for retry"):
        journal.append(scene_answer(1)).result(MOST_WAIT)
    assert "the file was moved or removed" in told.said[0][1]
    for name in ("j.db", "j.db-wal", "j.db-shm"):
        if (tmp_path / f"away-{name}").exists():
            (tmp_path / f"away-{name}").rename(tmp_path / name)
    assert told.back.wait(MOST_WAIT)
    journal.close()
    with JournalReader(tmp_path / "j.db") as reader:
        assert [shot.shot.number for _, shot in reader.shots(1)] == [0, 1]


def test_writer_waits_for_a_locked_file(tmp_path, monkeypatch):
    """A person with a database tool: the writer says so after its patience, `durable` gives up, and all goes on."""
    monkeypatch.setattr(journal_module, "LONGEST_DURABLE", 0.2)
    told = Told()
    with opened(tmp_path / "j.db", told) as journal:
        journal.append().result(MOST_WAIT)
        other = sqlite3.connect(tmp_path / "j.db", isolation_level=None)
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(InputError, match=r"not durable after 0.2 s"):
            asyncio.run(journal.durable(scene_answer(0)))
        assert "no answer for" in journal.trouble
        other.rollback()
        other.close()
        assert journal.append(scene_answer(1)).result(MOST_WAIT) == 2
        assert journal.trouble is None
