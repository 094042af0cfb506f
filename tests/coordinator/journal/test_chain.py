"""Verification of journals: altered, removed, inserted or cut entries are detected."""

import shutil
import sqlite3

import numpy as np
import pytest

from catseye.coordinator.journal import writer as journal_writer
from catseye.coordinator.journal.chain import Head
from catseye.coordinator.journal.check import check_run, parted, verify_run
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.writer import Journal, JournalSettings
from catseye.errors import InputError
from catseye.records.night.live import LivePosture
from catseye.service.journals import checked, copied
from catseye.simulator.clock.world_clock import ManualClock
from journal_scene import MOST_WAIT, START, plainly, scene_answer, scene_entries, scene_run
from repository import TESTS

TABLES = ("shots", "buffers", "weather", "postures", "commands", "happenings", "solutions", "documents", "chain")


def written(path, entries, *, together=5, **settings):
    """A journal of some entries, and the heads that were told; closed."""
    heads = []
    more = {"settings": JournalSettings(**settings), "on_head": heads.append}
    with Journal.open(path, run=scene_run(), clock=ManualClock(START / 1e8), **more) as journal:
        for k in range(0, len(entries), together):
            journal.append(*entries[k : k + together]).result(MOST_WAIT)
    return heads


def report_of(path, heads=(), run=1):
    with JournalReader(path) as reader:
        return verify_run(reader, run, heads=heads)


def altered(path, copy, script):
    shutil.copy(path, copy)
    connection = sqlite3.connect(copy)
    connection.executescript(script)
    connection.commit()
    connection.close()
    return copy


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    """A journal, its entries, its heads."""
    path = tmp_path_factory.mktemp("chain") / "j.db"
    entries = scene_entries(40)
    return path, entries, written(path, entries)


def test_unaltered_journal_verifies_with_all_its_heads(night):
    path, entries, heads = night
    report = report_of(path, heads)
    assert report.intact
    assert report.ended
    assert report.chained
    assert not report.problems
    assert (report.events, report.heads, report.first) == (len(entries), len(heads), None)
    assert report.head == heads[-1]
    assert heads[-1].seq == len(entries) + 1


@pytest.mark.parametrize(
    ("script", "first", "words"),
    [
        ("UPDATE shots SET phase_rad = phase_rad + 1e-15 WHERE seq = 9", 9, "event 9 or its link was altered"),
        (
            "UPDATE postures SET elevation_rate_rad_s = 0.0 WHERE seq = 8",
            8,
            "event 8 or its link was altered",
        ),  # it was -0.0
        ("UPDATE weather SET pressure_hpa = NULL WHERE seq = 3", 3, "event 3 or its link was altered"),
        ("UPDATE weather SET humidity_percent = '70.4' WHERE seq = 3", 3, "event 3 or its link was altered"),
        ("UPDATE commands SET ok = 1 WHERE seq = 6", 6, "event 6 or its link was altered"),
        ("UPDATE commands SET ok = NULL WHERE seq = 6", 6, "event 6 or its link was altered"),
        ("UPDATE solutions SET answer = answer || ' ' WHERE seq = 4", 4, "event 4 or its link was altered"),
        ("UPDATE solutions SET covariance = NULL WHERE seq = 4", 4, "event 4 or its link was altered"),
        ("UPDATE buffers SET samples = zeroblob(128) WHERE seq = 2", 2, "event 2 or its link was altered"),
        ("UPDATE buffers SET crc32 = 0 WHERE seq = 2", 2, "event 2 or its link was altered"),
        ("DELETE FROM buffers WHERE seq = 2", 2, "event 2 or its link was altered"),
        ("DELETE FROM weather WHERE seq = 3", 3, "event 3 is missing"),
        ("DELETE FROM weather WHERE seq = 3; DELETE FROM chain WHERE seq = 3", 3, "event 3 is missing"),
        ("DELETE FROM chain WHERE seq BETWEEN 20 AND 29", 20, "event 20 has no link"),
        ("UPDATE chain SET link = zeroblob(32) WHERE seq = 12", 12, "event 12 or its link was altered"),
        ("UPDATE chain SET kind = 'refused' WHERE seq = 12", 12, "event 12 was refused, but exists"),
        ("UPDATE chain SET kind = 'else' WHERE seq = 12", 12, "event 12"),
        ("INSERT INTO postures VALUES (1, 900, 1, 1.0, 1.0, 1.0, 1.0)", 166, "are missing"),
        ("INSERT INTO postures VALUES (1, 9, 1, 1.0, 1.0, 1.0, 1.0)", 9, "event 9 or its link was altered"),
        ("UPDATE runs SET seed = 9", 0, "the run's record"),
        ("UPDATE runs SET ended_ticks = ended_ticks + 1", 165, "the end or its link was altered"),
        ("UPDATE texts SET text = text || ' ' WHERE text LIKE '%monument%'", 0, "of the run was altered"),
        ("DELETE FROM run_files WHERE path = 'site.toml'", 0, "the list of its files"),
        ("DELETE FROM chain WHERE kind = 'end'", 165, "its chain stops at event"),
        ("DELETE FROM chain WHERE seq = 0", 0, "first link is missing"),
    ],
)
def test_alterations_are_reported_with_their_first_event(night, tmp_path, script, first, words):
    path, entries, _ = night
    assert len(entries) == 164  # the numbers above
    report = report_of(altered(path, tmp_path / "altered.db", script))
    assert not report.intact
    assert report.first == first
    assert any(words in problem for problem in report.problems)


def test_rewritten_history_is_detected_from_published_heads(night, tmp_path):
    """Whole in itself: only what was kept elsewhere tells."""
    path, entries, heads = night
    other = tmp_path / "other.db"
    changed = [LivePosture(e.ticks, 9.9, 0.1) if k == 60 else e for k, e in enumerate(entries)]
    written(other, changed)
    assert report_of(other).intact
    report = report_of(other, heads)
    assert report.heads == 0
    assert any("another history" in problem for problem in report.problems)
    with JournalReader(path) as one, JournalReader(path) as same:
        assert parted(one, same, one.run().uuid) == (None, len(entries) + 1)
    with JournalReader(path) as one, JournalReader(other) as two, pytest.raises(InputError, match="names 0 runs"):
        parted(one, two, one.run().uuid)


def test_first_difference_of_two_copies_is_located(night, tmp_path):
    """A forger who makes the links again from event 60 on: the copy tells where."""
    from catseye.coordinator.journal.chain import LinkKind, event_cells, link_of
    from catseye.coordinator.journal.check import _piece

    path, _, heads = night
    forged = altered(path, tmp_path / "forged.db", "UPDATE shots SET range_m = 1.0 WHERE seq > 60 AND seq < 64")
    connection = sqlite3.connect(forged)
    with JournalReader(forged) as reader:
        before = None
        for seq, kind, link, rows in _piece(reader, 1, 0, 1000):
            if seq >= 60:
                cells = event_cells(rows) if kind == "event" else [reader.run(1).ended]
                link = link_of(before, LinkKind(kind), seq, cells)
                connection.execute("UPDATE chain SET link = ? WHERE seq = ?", (link, seq))
            before = link
    connection.commit()
    connection.close()
    assert report_of(forged).intact
    assert report_of(forged, heads).first in {head.seq for head in heads}
    _, parting = checked(str(path), None, [], str(forged), progress=lambda *a: None)
    assert 60 < parting[0]["parts_at_event"] < 64


def test_truncation_is_detected_from_a_published_head(night, tmp_path):
    path, _entries, heads = night
    script = "UPDATE runs SET ended_ticks = NULL;" + "".join(f"DELETE FROM {t} WHERE seq > 100;" for t in TABLES)
    cut = altered(path, tmp_path / "cut.db", script)
    report = report_of(cut)
    assert report.intact
    assert not report.ended
    report = report_of(cut, heads)
    assert report.first == 101
    assert "a head of event" in report.problems[-1]


def test_refused_entry_has_a_link_of_its_kind(tmp_path):
    path = tmp_path / "j.db"
    with Journal.open(path, run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        journal.append(scene_answer(1)).result(MOST_WAIT)
        with pytest.raises(InputError, match="refused"):
            journal.append(scene_answer(1)).result(MOST_WAIT)
        journal.append(scene_answer(2)).result(MOST_WAIT)
        assert journal.head.seq == 3
    report = report_of(path)
    assert report.intact
    assert report.events == 2
    forged = altered(path, tmp_path / "f.db", "DELETE FROM chain WHERE seq = 2")
    assert report_of(forged).problems == ["event 2 is missing"]


def test_killed_run_has_no_end_and_is_linked_to_the_next(tmp_path, night):
    path = tmp_path / "two.db"
    shutil.copy(night[0], path)
    written(path, scene_entries(5, seed=3))
    script = "UPDATE runs SET ended_ticks = NULL WHERE run = 1; DELETE FROM chain WHERE kind = 'end' AND run = 1"
    killed = altered(path, tmp_path / "killed.db", script)
    assert report_of(killed).intact
    assert not report_of(killed).ended
    assert report_of(killed, run=2).intact
    gone = altered(
        path, tmp_path / "gone.db", "".join(f"DELETE FROM {t} WHERE run = 1;" for t in (*TABLES, "run_files", "runs"))
    )
    assert report_of(gone, run=2).first == 0  # the run before it is missing


def test_old_journal_is_reported_as_unchained(tmp_path):
    old = tmp_path / "old.db"
    shutil.copy(TESTS / "vectors" / "formats" / "journal-1.db", old)
    assert (report_of(old).chained, report_of(old).count) == (False, 0)
    written(old, scene_entries(5, seed=3))  # carried to this version
    assert not report_of(old, run=2).chained
    assert report_of(old, run=3).intact
    assert report_of(old, run=3).chained


def test_chain_of_version_2_verifies():
    """Its links were made by the release that made the version."""
    frozen = TESTS / "vectors" / "formats" / "journal-2.db"
    for run, head in ((1, "51:b85e04bef69ad5b2"), (2, "51:094912ae5c0d374b")):
        report = report_of(frozen, [Head.parse(head)], run)
        assert report.intact
        assert report.heads == 1


def test_heads_survive_the_round_trip_through_text():
    assert Head.parse(" 12:5F0C3B1E9A7D2C44 ") == Head(12, "5f0c3b1e9a7d2c44")
    for text in ("12", "x:5f0c3b1e", "12:5f0", "12:5f0c3b1g", ":5f0c3b1e"):
        with pytest.raises(InputError, match="expected EVENT:HASH"):
            Head.parse(text)


# Damages -------------------------------------------------------------------------------------------------------------


def stored(path):
    """All rows of all tables, as SQLite gives them; None where it does not."""
    try:
        connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
        tables = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return {name: connection.execute(f"SELECT * FROM {name} ORDER BY 1, 2").fetchall() for name in tables}
    except sqlite3.Error:
        return None


def damage(kind, path, other, rng):
    """One damage to a file; in place."""
    raw = bytearray(path.read_bytes())
    if kind == "bit":
        at = int(rng.integers(100, len(raw)))
        raw[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(raw)
    elif kind == "cut":
        path.write_bytes(raw[: int(rng.integers(1, len(raw)))])
    elif kind == "page":
        pages = len(raw) // 8192
        one, two = (int(k) * 8192 for k in rng.choice(np.arange(1, pages), 2, replace=False))
        raw[one : one + 8192], raw[two : two + 8192] = raw[two : two + 8192], raw[one : one + 8192]
        path.write_bytes(raw)
    elif kind == "swap":
        shutil.copy(other, path)
    elif kind == "row":
        connection = sqlite3.connect(path)
        table = str(rng.choice(TABLES))
        connection.execute(
            f"DELETE FROM {table} WHERE seq = (SELECT seq FROM {table} ORDER BY seq LIMIT 1 OFFSET ?)",
            [int(rng.integers(connection.execute(f"SELECT count(*) FROM {table}").fetchone()[0]))],
        )
        connection.commit()
        connection.close()


@pytest.mark.parametrize("count", [40, pytest.param(200, marks=pytest.mark.slow)])
def test_altered_numbers_are_detected_and_intact_events_kept(night, tmp_path, count):
    path, entries, heads = night
    other = tmp_path / "other.db"
    written(other, scene_entries(40, seed=9))
    before, rng = stored(path), np.random.default_rng(21)
    wanted = {seq: plainly(entry) for seq, entry in enumerate(entries, 1)}
    kinds = ("bit", "row", "cut", "page", "swap", "bit", "bit", "row")
    harmless = 0
    for k in range(count):
        hurt = tmp_path / "hurt.db"
        shutil.copy(path, hurt)
        damage(kinds[k % len(kinds)], hurt, other, rng)
        after = stored(hurt)
        try:
            with JournalReader(hurt) as reader:
                report = check_run(reader, 1, heads=heads)
                reader.left_out = {1: report.bad}
                found = dict(reader.events(1)) if report.chained else {}
        except InputError:
            continue  # the whole file is refused in one line: a copy is needed
        if after != before:
            assert not report.intact, kinds[k % len(kinds)]
        else:
            harmless += 1
        if kinds[k % len(kinds)] in ("bit", "row"):
            for seq, entry in found.items():  # what is given is what was written
                assert plainly(entry) == wanted[seq]
            lost = set(wanted) - set(found) - report.bad
            assert not lost
    assert harmless < count / 2


# Files ---------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rotated(tmp_path_factory):
    """A run in several files, its entries and heads."""
    folder, patch = tmp_path_factory.mktemp("rotated"), pytest.MonkeyPatch()
    patch.setattr(journal_writer, "LOOK", 0.0)
    entries = scene_entries(60)
    heads = written(folder / "site.db", entries, together=20, rotate_bytes=400_000)
    patch.undo()
    return folder, entries, heads


def test_rotated_run_is_read_as_one(rotated):
    folder, entries, heads = rotated
    files = sorted(folder.glob("site*.db"))
    assert len(files) > 3
    for file in files:
        with JournalReader(file) as reader:
            assert [plainly(e) for _, e in reader.events(1)] == [plainly(e) for e in entries]
            assert [seq for seq, _ in reader.events(1, after=30, until=90)] == list(range(31, 91))
            assert reader.last(1) == len(entries)
            report = verify_run(reader, 1, heads=heads)
            assert report.intact
            assert report.ended
            assert (report.events, report.heads) == (len(entries), len(heads))


def test_altered_swapped_or_missing_files_of_a_run_are_reported(rotated, tmp_path):
    folder, _entries, heads = rotated
    for name in ("changed", "swapped", "missing"):
        shutil.copytree(folder, tmp_path / name)
    connection = sqlite3.connect(tmp_path / "changed" / "site-3.db")
    connection.execute("UPDATE shots SET range_m = range_m + 1e-12")
    connection.commit()
    connection.close()
    report = report_of(tmp_path / "changed" / "site.db", heads)
    assert report.bad
    assert "site-3.db" in report.problems[0]
    patch = pytest.MonkeyPatch()
    patch.setattr(journal_writer, "LOOK", 0.0)
    (tmp_path / "else").mkdir()
    written(tmp_path / "else" / "site.db", scene_entries(60, seed=4), together=20, rotate_bytes=400_000)
    patch.undo()
    shutil.copy(tmp_path / "else" / "site-3.db", tmp_path / "swapped" / "site-3.db")
    assert "does not continue where" in " ".join(report_of(tmp_path / "swapped" / "site.db").problems)
    (tmp_path / "missing" / "site-3.db").unlink()
    with JournalReader(tmp_path / "missing" / "site.db") as reader, pytest.raises(InputError, match=r"site-3\.db"):
        list(reader.events(1))


def test_failed_rotation_continues_in_the_same_file(tmp_path, monkeypatch):
    monkeypatch.setattr(journal_writer, "LOOK", 0.0)

    def none(*_, **__):
        raise InputError("no room")

    monkeypatch.setattr(journal_writer, "go_on", none)
    said, entries = [], scene_entries(30)
    more = {"settings": JournalSettings(rotate_bytes=1), "on_alarm": said.append}
    with Journal.open(tmp_path / "j.db", run=scene_run(), clock=ManualClock(START / 1e8), **more) as journal:
        for entry in entries:
            journal.append(entry).result(MOST_WAIT)
        assert journal.trouble is None
    assert len(said) == 1
    assert "continues in" in said[0]
    assert [path.name for path in tmp_path.iterdir()] == ["j.db"]
    assert report_of(tmp_path / "j.db").events == len(entries)


def test_nightly_rotation_is_at_noon(tmp_path, monkeypatch):
    monkeypatch.setattr(journal_writer, "LOOK", 0.0)
    clock = ManualClock(61000.49)
    more = {"settings": JournalSettings(rotate_nightly=True)}
    with Journal.open(tmp_path / "j.db", run=scene_run(), clock=clock, **more) as journal:
        journal.append(scene_answer(1)).result(MOST_WAIT)
        clock.advance(0.02 * 86400)
        for k in (2, 3):
            journal.append(scene_answer(k)).result(MOST_WAIT)
    with JournalReader(tmp_path / "j-2.db") as reader:
        assert [shot.shot.number for _, shot in reader.shots(1)] == [1, 2, 3]
    assert report_of(tmp_path / "j.db").intact


def test_copy_made_during_writing_verifies(tmp_path):
    path, copy = tmp_path / "j.db", tmp_path / "copy.db"
    with Journal.open(path, run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        journal.append(*scene_entries(30)).result(MOST_WAIT)
        (report,) = copied(str(path), copy, progress=lambda *a: None)
        journal.append(scene_answer(99)).result(MOST_WAIT)
    assert report.intact
    assert not report.ended
    assert report.head.seq == report.events
    with JournalReader(copy) as one, JournalReader(path) as two:
        assert parted(one, two, one.run().uuid) == (None, report.head.seq)
    with pytest.raises(InputError, match="already exists"):
        copied(str(path), copy, progress=lambda *a: None)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["copy.db", "j.db"]
