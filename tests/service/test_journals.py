"""Backups of running journals, and checks of altered ones."""

import os
import shutil
import signal
import sqlite3
import subprocess
import threading
import time

import numpy as np
import pytest

from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.verdict import chain_verdict
from catseye.coordinator.journal.writer import Journal
from catseye.errors import InputError
from catseye.records.night.live import LiveShot
from catseye.service.journals import checked, copied, exported
from catseye.simulator.clock.world_clock import ManualClock
from cli.living_scene import RUN, SOON, recorded
from journal_scene import MOST_WAIT, START, scene_answer, scene_entries, scene_run
from process_scene import ends_with_us
from repository import TESTS

FORMATS = TESTS / "vectors" / "formats"


def quiet(*_):
    """No progress is shown."""


def written(path, entries, *, heads=None):
    more = {} if heads is None else {"on_head": heads.append}
    with Journal.open(path, run=scene_run(), clock=ManualClock(START / 1e8), **more) as journal:
        journal.append(*entries).result(MOST_WAIT)
    return path


def verdict(path, *heads, run=None, against=None):
    reports, _ = checked(str(path), run, heads, against, progress=quiet)
    return chain_verdict(reports)


def altered(path, script):
    connection = sqlite3.connect(path)
    connection.executescript(script)
    connection.commit()
    connection.close()
    return path


@pytest.fixture
def night(tmp_path):
    """A journal of two runs, and each run's last head."""
    ends = []
    for seed in (0, 3):
        heads = []
        written(tmp_path / "j.db", scene_entries(20, seed=seed), heads=heads)
        ends.append(str(heads[-1]))
    return tmp_path / "j.db", ends


# What only a head can show -------------------------------------------------------------------------------------------


def test_verdict_states_if_heads_were_given(night):
    path, (first, last) = night
    assert verdict(path).word == "good"
    assert "checked against no head" in verdict(path).why
    assert verdict(path, first, last).why.endswith("which contains the 2 given heads")


def test_deleted_last_run_is_detected_by_its_head(night):
    path, (first, last) = night
    with sqlite3.connect(path) as connection:
        tables = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    mine = [name for name in tables if name not in ("journal", "texts")]
    altered(path, "".join(f"DELETE FROM {name} WHERE run = 2;" for name in mine))
    assert verdict(path).word == "good"  # nothing in the file can show it, and that is said
    assert "whose last run was deleted, would not be detected" in verdict(path).why
    assert verdict(path, first).word == "good"
    found = verdict(path, first, last)
    assert found.word == "failed"
    assert f"no run has the given head {last}: a run was deleted, cut or rewritten" in found.why


def test_head_is_searched_in_the_selected_run(night):
    path, (first, last) = night
    assert verdict(path, first, run=1).word == "good"
    assert verdict(path, last, run=1).word == "failed"


def test_head_is_published_to_subscribers_after_each_epoch():
    """What is in the journal as an event was pushed: in a run of two epochs, and the heads are its chain's."""
    with JournalReader(recorded()) as reader:
        entries = list(reader.events(1, kinds=["happenings", "solutions"]))
    epochs = [seq for seq, entry in entries if isinstance(entry, EpochSolution)]
    told = [(seq, entry) for seq, entry in entries if getattr(entry, "kind", "") == "journal-head"]
    assert len(told) == len(epochs) >= 2
    heads = [entry.details["head"] for _, entry in told]
    for epoch, (seq, entry), head in zip(epochs, told, heads, strict=True):
        assert epoch <= int(head.partition(":")[0]) < seq
        assert entry.text == f"head {head} of run 1"
    assert verdict(recorded(), *heads).why.endswith(f"which contains the {len(heads)} given heads")


# Chains that were taken away -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("DELETE FROM chain", "the run has no chain in a journal of version 2: it was removed"),
        ("DELETE FROM chain WHERE run = 1", "the run has no chain in a journal of version 2: it was removed"),
        ("DELETE FROM chain WHERE run = 2", "the run has no chain in a journal of version 2: it was removed"),
        ("DROP TABLE chain", "table 'chain' is missing (expected in a journal of version 2)"),
        ("DROP TABLE parts", "table 'parts' is missing"),
        ("DROP TABLE weather", "table 'weather' is missing"),
        (
            "UPDATE journal SET version = 1",
            "its version is 1, but it has the table 'chain' of version 2",
        ),
        ("UPDATE journal SET version = 1; DROP TABLE chain", "the table 'parts' of version 2"),
        ("DELETE FROM chain; UPDATE journal SET version = 1", "the version was set back"),
        ("DELETE FROM chain WHERE run = 1; UPDATE runs SET catseye = '0.0.1' WHERE run = 1", "it was removed"),
    ],
)
def test_removed_chain_is_not_taken_for_an_older_version(night, script, words):
    path, _ = night
    found = verdict(altered(path, script))
    assert found.word == "failed"
    assert words in found.why
    assert "\n" not in found.why


@pytest.mark.parametrize(
    ("taken", "left"),
    [
        ("DROP TABLE texts", 18),
        ("DROP TABLE parts", 18),
        ("ALTER TABLE weather RENAME TO w; CREATE VIEW weather AS SELECT * FROM w", 18),
    ],
)
def test_missing_table_hides_no_altered_shot_from_an_export(night, tmp_path, taken, left):
    """Two of twenty shots are altered; what contradicts its link is left out, whatever else is missing."""
    path, _ = night
    altered(path, f"UPDATE shots SET range_m = range_m + 1 WHERE run = 2 AND number IN (3, 7); {taken}")
    reports, _ = checked(str(path), 2, (), None, progress=quiet)
    assert "is missing" in reports[0].problems[0]
    assert sum("was altered" in text for text in reports[0].problems) == 2
    assert exported(str(path), tmp_path / "out", "csv", damaged=True, progress=quiet).rows["shots"] == left


@pytest.mark.parametrize("script", ["DROP TABLE chain", "DELETE FROM chain WHERE run = 2"])
def test_export_without_chain_is_doubtful(night, tmp_path, script):
    path, _ = night
    found = exported(str(altered(path, script)), tmp_path / "out", "csv", damaged=True, progress=quiet)
    assert found.rows["shots"] == 20  # nothing was left out
    assert found.verdict.word == "doubtful"
    assert found.verdict.why.startswith("nothing vouches for any of it: ")


def test_removed_chain_and_version_are_detected_by_any_head(night):
    path, (_, last) = night
    altered(path, "UPDATE journal SET version = 1; DROP TABLE chain; DROP TABLE parts")
    assert verdict(path).word == "doubtful"  # as an older catseye wrote it: nothing of it was checked
    assert verdict(path, last).word == "failed"


def test_run_of_an_older_version_is_recognised_in_a_newer_journal(tmp_path):
    path = tmp_path / "old.db"
    shutil.copy(FORMATS / "journal-1.db", path)
    assert verdict(path).word == "doubtful"
    written(path, scene_entries(5))
    assert verdict(path).word == "doubtful"
    assert "run 1 has no chain" in verdict(path).why
    written(path, scene_entries(5))
    altered(path, "DELETE FROM chain WHERE run = 3")  # the first with a chain: the next one hangs on it
    assert verdict(path).word == "failed"


@pytest.mark.parametrize("value", ["'zzz'", "x'ff00'", "-5", "5.5", str(10**15), str(2**63 - 1)])
@pytest.mark.parametrize("table", ["chain", "postures"])
def test_row_with_an_unused_number_hides_nothing(night, table, value):
    """Text and bytes stand above all numbers: the highest of a table is then none, and a killed run seems empty."""
    path, _ = night
    script = "UPDATE runs SET ended_ticks = NULL; DELETE FROM chain WHERE kind = 'end';"
    row = f"2, {value}, 'event', x'00'" if table == "chain" else f"2, {value}, 1, 1.0, 1.0, 1.0, 1.0"
    altered(path, f"{script} INSERT INTO {table} VALUES ({row})")
    reports, _ = checked(str(path), 2, (), None, progress=quiet)
    assert chain_verdict(reports).word == "failed"
    assert reports[0].events >= 40
    with JournalReader(path) as reader:
        reader.left_out = {2: reports[0].bad}
        assert len(list(reader.events(2))) >= 40


# Files ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("follows", "followed_by"),
    [(None, "j.db"), ("j.db", None), ("j.db", "j.db"), (None, ""), (None, "../j.db"), (None, 7)],
)
def test_file_linked_to_itself_or_to_none_is_refused_in_one_line(night, follows, followed_by):
    path, _ = night
    with sqlite3.connect(path) as connection:
        connection.execute("INSERT INTO parts VALUES (2, ?, ?)", (follows, followed_by))
    found = verdict(path)
    assert found.word == "failed"
    assert "the run's other files are unreadable" in found.why
    with JournalReader(path) as reader, pytest.raises(InputError) as caught:
        list(reader.events(2))
    assert "\n" not in str(caught.value)


def test_circular_file_links_are_refused_in_one_line(night, tmp_path):
    path, _ = night
    shutil.copy(path, tmp_path / "k.db")
    altered(path, "INSERT INTO parts VALUES (2, NULL, 'k.db')")
    altered(tmp_path / "k.db", "INSERT INTO parts VALUES (2, NULL, 'j.db')")
    assert "a circle" in verdict(path).why


def test_symbolic_link_to_an_open_journal_is_the_same_journal(tmp_path):
    real, link = tmp_path / "real.db", tmp_path / "link.db"
    with Journal.open(real, run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        journal.append(*scene_entries(5)).result(MOST_WAIT)
        link.symlink_to(real)
        with pytest.raises(InputError, match=r"link\.db, which is .*real\.db: process \d+ on .* is writing to it"):
            Journal.open(link, run=scene_run(), clock=ManualClock(START / 1e8))
        with JournalReader(link) as reader:  # its log, too
            assert len(list(reader.events(1))) == len(scene_entries(5))
        copied(str(link), tmp_path / "copy.db", progress=quiet)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy.db", "link.db", "real.db"]
    written(link, scene_entries(5, seed=4))
    with JournalReader(real) as reader:
        assert len(reader.runs()) == 2
    assert link.is_symlink()


def test_hard_link_to_a_journal_is_refused_for_writing(tmp_path):
    real, other = tmp_path / "real.db", tmp_path / "other.db"
    with Journal.open(real, run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        os.link(real, other)
        with pytest.raises(InputError, match="has 2 names") as caught:
            Journal.open(other, run=scene_run(), clock=ManualClock(START / 1e8))
        assert "\n" not in str(caught.value)
        journal.append(scene_answer(1)).result(MOST_WAIT)
    other.unlink()
    written(real, [scene_answer(2)])


@pytest.mark.parametrize("table", ["shots", "happenings", "texts", "runs", "run_files", "chain", "documents"])
def test_invalid_utf8_is_reported_in_one_line_with_its_place(night, table):
    path, _ = night
    column = {"runs": "site", "run_files": "path", "chain": "kind"}.get(table, "text")
    event = f"run = 2 AND seq = (SELECT min(seq) FROM {table} WHERE run = 2 AND seq > 0)"
    named = {"texts": "rowid = 1", "runs": "run = 2", "run_files": "run = 2 AND path = 'site.toml'"}
    rows = named.get(table, event)
    altered(path, f"UPDATE {table} SET {column} = CAST(x'41ff42' AS TEXT) WHERE {rows}")
    try:
        found = verdict(path)
        assert found.word == "failed"
        text = found.why
    except InputError as problem:
        text = str(problem)
    assert "\n" not in text
    assert "could not decode" not in text.lower()


# Backup --------------------------------------------------------------------------------------------------------------


def long_shot(number):
    codes = np.random.default_rng(number % 7).integers(-32768, 32768, 8192, dtype=np.int16)
    return LiveShot("ZY105", "ZEG41040L", START + 300 * number, 128, 64, 1000, 3e-4, codes, 1.0, 0.1, number)


@pytest.fixture
def running(tmp_path):
    """A journal of 20 MB that is written without a pause."""
    ends, path, count = threading.Event(), tmp_path / "j.db", 1200
    journal = Journal.open(path, run=scene_run(), clock=ManualClock(START / 1e8))
    for k in range(0, count, 50):
        journal.append(*map(long_shot, range(k, k + 50)))
    journal.append().result(MOST_WAIT)

    def write():
        number = count
        while not ends.is_set():
            journal.append(long_shot(number)).result(MOST_WAIT)
            number += 1

    writer = threading.Thread(target=write)
    writer.start()
    yield path, count
    ends.set()
    writer.join(MOST_WAIT)
    journal.close()


def test_backup_during_writing_finishes_and_verifies(running, tmp_path):
    path, count = running
    done = []

    def copy():
        done.extend(copied(str(path), tmp_path / "copy.db", progress=quiet))

    copying = threading.Thread(target=copy, daemon=True)
    copying.start()
    copying.join(MOST_WAIT)
    assert not copying.is_alive()
    (report,) = done
    assert report.intact
    assert report.events >= count
    assert not [
        name for name in os.listdir(tmp_path) if name.endswith(".new") or ("copy" in name and name != "copy.db")
    ]


def test_interrupted_backup_leaves_nothing(running, tmp_path):
    seen = []

    def interrupted(what, done, of):
        seen.append(what)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        copied(str(running[0]), tmp_path / "copy.db", progress=interrupted)
    assert seen == ["bytes"]
    assert not [name for name in os.listdir(tmp_path) if "copy" in name]


def test_leftovers_of_killed_backups_are_removed_and_of_running_ones_kept(night, tmp_path):
    path, _ = night
    dead = subprocess.Popen(["true"])
    dead.wait()
    left, other = tmp_path / f".copy.db.{dead.pid}.new", tmp_path / f".copy.db.{os.getppid()}.new"
    for folder in (left, other):
        folder.mkdir()
        (folder / "copy.db").write_bytes(b"half")
    copied(str(path), tmp_path / "copy.db", progress=quiet)
    assert not left.exists()
    assert other.exists()
    assert verdict(tmp_path / "copy.db").word == "good"


def test_backup_of_an_unreadable_journal_is_refused_and_leaves_nothing(night, tmp_path):
    path, _ = night
    raw = path.read_bytes()
    path.write_bytes(raw[: len(raw) // 2])
    with pytest.raises(InputError, match="a damaged one with its -wal file"):
        copied(str(path), tmp_path / "copy.db", progress=quiet)
    assert not [name for name in os.listdir(tmp_path) if "copy" in name]


def test_existing_file_is_not_overwritten(night, tmp_path):
    path, _ = night
    for name, make in (("file.db", lambda at: at.write_text("x")), ("gone.db", lambda at: at.symlink_to("nowhere"))):
        make(tmp_path / name)
        with pytest.raises(InputError, match="already exists"):
            copied(str(path), tmp_path / name, progress=quiet)
        assert os.path.lexists(tmp_path / name)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_backup_process_ends_at_a_signal_and_leaves_nothing(running, tmp_path, number, status):
    path, _ = running
    for _ in range(20):
        words = [*RUN, "journal", "backup", str(path), str(tmp_path / "copy.db"), "--quiet"]
        process = subprocess.Popen(words, stderr=subprocess.PIPE, preexec_fn=ends_with_us())
        until = time.monotonic() + MOST_WAIT
        while not list(tmp_path.glob(".copy.db.*.new/*")) and process.poll() is None and time.monotonic() < until:
            time.sleep(0.001)
        since = time.monotonic()
        process.send_signal(number)
        process.communicate(timeout=2 * SOON)
        if process.returncode == 0:  # it was done before the signal came
            (tmp_path / "copy.db").unlink()
            continue
        assert time.monotonic() - since < SOON
        assert process.returncode == status
        assert not [name for name in os.listdir(tmp_path) if "copy" in name]
        return
    pytest.fail("none of 20 backups was hit while it copied")
