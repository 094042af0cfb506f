"""Recovery of journals that SQLite cannot read, page by page."""

import shutil
import sqlite3
from dataclasses import replace

import numpy as np
import pytest

from catseye.coordinator.journal.check import verify_run
from catseye.coordinator.journal.entries import AnsweredShot
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.recovery import recover
from catseye.coordinator.journal.writer import Journal, JournalSettings
from catseye.errors import InputError
from catseye.records.night.live import LiveShot
from catseye.simulator.clock.world_clock import ManualClock
from journal_scene import MOST_WAIT, START, plainly, scene_entries, scene_run
from repository import TESTS

PAGE = 8192
LONG = 12  # shots of the scene whose samples need more pages
SHORT = ("shots", "weather", "postures", "commands", "happenings", "documents", "chain")  # each row within a page
OLD = TESTS / "vectors" / "formats" / "journal-1.db"


def long_shot(number):
    """A shot whose samples lie on overflow pages."""
    codes = np.random.default_rng(number).integers(-32768, 32768, 8192, dtype=np.int16)
    return LiveShot("ZY106", "ZEG41040L", START + 300 * number, 128, 64, 1000, 3e-4, codes, 1.0, 0.1, 10_000 + number)


def bare(entry):
    """An entry as it is without the samples that it may have had: their pages are others."""
    shot = entry.shot if isinstance(entry, AnsweredShot) else entry
    if not isinstance(shot, LiveShot):
        return plainly(entry)
    answered = entry if isinstance(entry, AnsweredShot) else AnsweredShot(entry)
    return plainly(replace(answered, shot=replace(shot, samples=None)))


ENTRIES = [*scene_entries(60), *map(long_shot, range(LONG))]
BARE = {seq: bare(entry) for seq, entry in enumerate(ENTRIES, 1)}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A journal with every kind of row, some of several pages, and its entries as text by seq."""
    path = tmp_path_factory.mktemp("recovery") / "j.db"
    with Journal.open(path, run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        for k in range(0, len(ENTRIES), 7):
            journal.append(*ENTRIES[k : k + 7]).result(MOST_WAIT)
    return path, {seq: plainly(entry) for seq, entry in enumerate(ENTRIES, 1)}


def stored(path):
    with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as connection:
        tables = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return {name: sorted(connection.execute(f"SELECT * FROM {name}"), key=repr) for name in tables}


def read(path):
    """What a recovered journal holds, by seq, and what its chain says."""
    with JournalReader(path) as reader:
        return {seq: plainly(entry) for seq, entry in reader.events(1)}, verify_run(reader, 1)


def test_intact_journal_is_recovered_to_the_last_bit(whole, tmp_path):
    path, entries = whole
    recovery = recover(path, tmp_path / "new.db")
    assert (recovery.lost, recovery.missing) == (0, 0)
    assert stored(tmp_path / "new.db") == stored(path)
    found, report = read(tmp_path / "new.db")
    assert found == entries
    assert report.intact


@pytest.mark.parametrize("size", [512, 1024, 4096, 65536])
def test_pages_of_all_sizes_are_read(whole, tmp_path, size):
    path = tmp_path / "other.db"
    shutil.copy(whole[0], path)
    with sqlite3.connect(path) as connection:
        connection.execute(f"PRAGMA page_size = {size}")
        connection.execute("VACUUM")
    assert path.read_bytes()[16:18] == (size % 65536 or 1).to_bytes(2, "big")
    recover(path, tmp_path / "new.db")
    assert stored(tmp_path / "new.db") == stored(whole[0])


def test_rows_only_in_the_log_are_recovered(whole, tmp_path):
    """The file and its log as they lie on the disk while it is written; a torn end of the log counts not."""
    path, entries = tmp_path / "j.db", scene_entries(30)
    with Journal.open(path, run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        journal.append(*entries).result(MOST_WAIT)
        for end in ("", "-wal"):
            shutil.copy(f"{path}{end}", f"{tmp_path / 'killed.db'}{end}")
    log = tmp_path / "killed.db-wal"
    assert log.stat().st_size > 10 * PAGE
    recover(tmp_path / "killed.db", tmp_path / "new.db")
    assert read(tmp_path / "new.db")[0] == {seq: plainly(entry) for seq, entry in enumerate(entries, 1)}
    raw = bytearray(log.read_bytes())
    raw[-3] ^= 1
    log.write_bytes(raw)
    torn = tmp_path / "torn.db"
    try:
        recover(tmp_path / "killed.db", torn)
        found, _ = read(torn)
    except InputError:
        found = {}  # all of it was one transaction
    assert found.items() <= {seq: plainly(entry) for seq, entry in enumerate(entries, 1)}.items()
    assert len(found) < len(entries)


@pytest.mark.parametrize("tenth", range(1, 11))
def test_truncated_journal_keeps_earlier_rows(whole, tmp_path, tenth):
    """Nothing is read that was not written, and of the pages that are there nothing is lost."""
    path, entries = whole
    raw = path.read_bytes()
    cut = tmp_path / "cut.db"
    cut.write_bytes(raw[: len(raw) * tenth // 11])
    recovery = recover(cut, tmp_path / "new.db")
    assert recovery.pages == len(raw) * tenth // 11 // PAGE
    found, report = read(tmp_path / "new.db")
    assert found.items() <= entries.items() | BARE.items()
    assert report.count
    with sqlite3.connect(path) as connection, sqlite3.connect(tmp_path / "new.db") as new:
        for table in SHORT:  # SQLite itself says how many rows lie on the pages that are left
            cells = "SELECT coalesce(sum(ncell), 0) FROM dbstat WHERE name = ? AND pageno <= ?"
            (there,) = connection.execute(cells, (table, recovery.pages)).fetchone()
            assert new.execute(f"SELECT count(*) FROM {table}").fetchone() == (there,), table


def test_rows_behind_a_lost_page_are_recognised_by_their_cells(whole, tmp_path):
    """Each interior page is lost, so that no way leads from a root to any row: all rows are still there."""
    path, entries = whole
    raw, lost = bytearray(path.read_bytes()), 0
    for at in range(PAGE, len(raw), PAGE):
        if raw[at] in (2, 5):  # an interior page
            raw[at : at + PAGE] = bytes(PAGE)
            lost += 1
    assert lost >= 3
    hurt = tmp_path / "hurt.db"
    hurt.write_bytes(raw)
    recover(hurt, tmp_path / "new.db")
    found, report = read(tmp_path / "new.db")
    assert found.items() <= entries.items() | BARE.items()
    assert len(found) > 0.9 * len(entries)  # an interior page has rows of its own
    before, after = stored(path), stored(tmp_path / "new.db")
    assert all(set(map(repr, after[name])) <= set(map(repr, before[name])) for name in before if name != "parts")
    assert report.count


def test_rows_are_recognised_without_the_first_page(whole, tmp_path):
    path, entries = whole
    hurt = tmp_path / "hurt.db"
    raw = bytearray(path.read_bytes())
    raw[100:PAGE] = bytes(PAGE - 100)  # the schema
    hurt.write_bytes(raw)
    recover(hurt, tmp_path / "new.db")
    assert stored(tmp_path / "new.db") == stored(path)
    raw[:PAGE] = b"\xff" * PAGE
    hurt.write_bytes(raw)
    recover(hurt, tmp_path / "again.db")
    assert read(tmp_path / "again.db")[0] == entries


def test_lost_run_record_costs_no_event(whole, tmp_path):
    path, entries = whole
    hurt = tmp_path / "hurt.db"
    shutil.copy(path, hurt)
    with sqlite3.connect(hurt) as connection:
        connection.execute("PRAGMA foreign_keys = OFF")
        connection.execute("DELETE FROM runs")
    recover(hurt, tmp_path / "new.db")
    found, report = read(tmp_path / "new.db")
    assert found == entries
    assert report.count
    with JournalReader(tmp_path / "new.db") as reader:
        assert reader.run().uuid == "lost-1"
        assert reader.run().started <= START


def test_old_journal_keeps_its_version(tmp_path):
    recover(OLD, tmp_path / "new.db")
    with (
        JournalReader(tmp_path / "new.db") as new,
        JournalReader(OLD) as old,
    ):
        assert new.version == 1
        assert [run.uuid for run in new.runs()] == [run.uuid for run in old.runs()]
        assert [plainly(e) for _, e in new.events(1)] == [plainly(e) for _, e in old.events(1)]
        report = verify_run(new, 1)
    assert (report.chained, report.count) == (False, 0)


@pytest.mark.parametrize("raw", [b"SQLite format 3\0", b"SQLite format 3\0" + bytes(20_000), bytes(range(256)) * 64])
def test_journal_without_readable_rows_is_refused_in_one_line(tmp_path, raw):
    (tmp_path / "hurt.db").write_bytes(raw)
    with pytest.raises(InputError, match="no readable row") as caught:
        recover(tmp_path / "hurt.db", tmp_path / "new.db")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("count", [60, pytest.param(1500, marks=pytest.mark.slow)])
def test_random_damage_never_stops_the_recovery(whole, tmp_path, count):
    """Twenty bytes at random places of each file, many of them lengths and page numbers: chains that never end, too."""
    path, _ = whole
    clean, rng = path.read_bytes(), np.random.default_rng(8)
    for k in range(count):
        raw = bytearray(clean)
        for at in rng.integers(0, len(raw), 20):
            raw[at] = rng.integers(256)
        page = int(rng.integers(1, len(raw) // PAGE)) * PAGE
        raw[page : page + 16] = rng.integers(0, 256, 16, dtype=np.uint8).tobytes()
        (tmp_path / "hurt.db").write_bytes(raw)
        new = tmp_path / f"{k}.db"
        try:
            recover(tmp_path / "hurt.db", new)
        except InputError:
            continue
        assert sqlite3.connect(new).execute("PRAGMA quick_check").fetchone() == ("ok",)
        new.unlink()


def test_rotated_parts_are_recovered_separately(tmp_path, monkeypatch):
    from catseye.coordinator.journal import writer as journal_writer

    monkeypatch.setattr(journal_writer, "LOOK", 0.0)
    entries = scene_entries(60)
    settings = JournalSettings(rotate_bytes=400_000)
    with Journal.open(
        tmp_path / "site.db", run=scene_run(), clock=ManualClock(START / 1e8), settings=settings
    ) as journal:
        for k in range(0, len(entries), 20):
            journal.append(*entries[k : k + 20]).result(MOST_WAIT)
    files = sorted(tmp_path.glob("site*.db"))
    assert len(files) > 3
    (tmp_path / "new").mkdir()
    for file in files:
        recover(file, tmp_path / "new" / file.name)
        assert stored(tmp_path / "new" / file.name) == stored(file)
