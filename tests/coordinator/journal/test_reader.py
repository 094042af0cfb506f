"""Journal reader: during writing, after a crash, damaged or foreign files."""

import os
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from catseye.coordinator.journal import reader as journal_reader
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.writer import Journal, JournalSettings
from catseye.errors import InputError
from catseye.simulator.clock.world_clock import ManualClock
from journal_scene import MOST_WAIT, START, plainly, scene_answer, scene_entries, scene_run
from repository import TESTS

FROZEN = [TESTS / "vectors" / "formats" / f"journal-{version}.db" for version in (1, 2)]


def written(path, entries, **more):
    with Journal.open(path, **{"run": scene_run(), "clock": ManualClock(START / 1e8), **more}) as journal:
        for entry in entries:
            journal.append(entry)
    return path


@pytest.mark.parametrize("frozen", FROZEN, ids=lambda path: path.stem)
def test_journals_of_all_versions_always_load(frozen):
    """Written by the release that made the version from the entries of the scene, half of them packed."""
    with JournalReader(frozen) as reader:
        raw, packed = reader.runs()
        assert (raw.seed, packed.seed, raw.settings["solve_every"], raw.site) == (1, 2, 0.5, "night-01")
        for run, seed in ((raw, 1), (packed, 2)):
            wanted = scene_entries(12, seed)
            assert [plainly(entry) for _, entry in reader.events(run.run)] == [plainly(entry) for entry in wanted]
        assert len(reader.site(1).rangers) == 18


@pytest.mark.parametrize("piece", [1, 3, 7, 512])
def test_piece_size_does_not_matter(tmp_path, monkeypatch, piece):
    entries = scene_entries(12)
    written(tmp_path / "j.db", entries)
    monkeypatch.setattr(journal_reader, "PIECE", piece)
    with JournalReader(tmp_path / "j.db") as reader:
        assert [plainly(entry) for _, entry in reader.events(1)] == [plainly(entry) for entry in entries]
        for after, until in ((0, 5), (5, 9), (8, 8), (len(entries) - 1, None), (len(entries), None)):
            found = [seq for seq, _ in reader.events(1, after=after, until=until)]
            assert found == list(range(after + 1, (until or len(entries)) + 1))


def test_kinds_can_be_selected(tmp_path):
    entries = scene_entries(12)
    written(tmp_path / "j.db", entries)
    with JournalReader(tmp_path / "j.db") as reader:
        names = {
            "shots": "AnsweredShot",
            "weather": "LiveWeather",
            "postures": "LivePosture",
            "commands": "SentCommand",
        }
        names |= {"happenings": "Happening", "solutions": "EpochSolution", "documents": "Document"}
        for kind, name in names.items():
            wanted = [(seq, plainly(e)) for seq, e in enumerate(entries, 1) if type(e).__name__ == name]
            assert [(seq, plainly(e)) for seq, e in reader.events(1, kinds=[kind])] == wanted
            assert wanted
        assert [seq for seq, _ in reader.solutions(1)] == [
            seq for seq, e in enumerate(entries, 1) if type(e).__name__ == "EpochSolution"
        ]
        assert all(shot.shot.samples is None for _, shot in reader.shots(1, buffers=False))


def test_journal_of_a_killed_writer_is_readable(tmp_path):
    """Its log was never folded in; a reader must not need to write it."""
    code = (
        "import os, sys\nfrom journal_scene import scene_entries, scene_run, START\n"
        "from catseye.coordinator.journal.writer import Journal\n"
        "from catseye.simulator.clock.world_clock import ManualClock\n"
        "j = Journal.open(sys.argv[1], run=scene_run(), clock=ManualClock(START / 1e8))\n"
        "[j.append(e) for e in scene_entries(12)]\nj.append().result(30)\nos.kill(os.getpid(), 9)\n"
    )
    place = {**os.environ, "PYTHONPATH": str(TESTS)}
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "j.db")], check=False, env=place, timeout=MOST_WAIT)
    assert (tmp_path / "j.db-wal").stat().st_size > 0
    entries = scene_entries(12)
    with JournalReader(tmp_path / "j.db") as reader:
        assert reader.run().ended is None
        assert [plainly(entry) for _, entry in reader.events(1)] == [plainly(entry) for entry in entries]
    half = (tmp_path / "j.db-wal").stat().st_size // 2
    os.truncate(tmp_path / "j.db-wal", half)  # the power went before the rest was on the disk
    Path(tmp_path / "j.db-shm").unlink(missing_ok=True)
    with JournalReader(tmp_path / "j.db") as reader:
        found = [plainly(entry) for run in reader.runs() for _, entry in reader.events(run.run)]
        assert found == [plainly(entry) for entry in entries[: len(found)]]
        assert len(found) < len(entries)


def test_torn_file_gives_intact_events_then_one_line(tmp_path):
    whole = written(tmp_path / "whole.db", scene_entries(400), settings=JournalSettings(keep_buffers=False))
    size, told = whole.stat().st_size, []
    for part in (0.03, 0.2, 0.4, 0.6, 0.8, 0.97):
        torn = tmp_path / f"{part}.db"
        shutil.copyfile(whole, torn)
        os.truncate(torn, int(size * part))
        found = []
        try:
            with JournalReader(torn) as reader:
                found.extend(seq for seq, _ in reader.events(1))
        except InputError as problem:
            told.append(str(problem).removeprefix(f"journal {torn}: "))
        assert found == list(range(1, len(found) + 1))
    assert len(told) >= 5
    assert set(told) <= {"database disk image is malformed", "disk I/O error", "file is not a database"}


def test_altered_samples_are_reported(tmp_path):
    path = written(tmp_path / "j.db", [scene_answer(k) for k in range(5)])
    packed = written(tmp_path / "p.db", [scene_answer(k) for k in range(5)], settings=JournalSettings(compress=True))
    for where in (path, packed):
        with sqlite3.connect(where) as connection:
            (blob,) = connection.execute("SELECT samples FROM buffers WHERE seq = 3").fetchone()
            turned = bytes([*blob[:-9], blob[-9] ^ 1, *blob[-8:]])
            connection.execute("UPDATE buffers SET samples = ? WHERE seq = 3", (turned,))
        connection.close()
        with (
            JournalReader(where) as reader,
            pytest.raises(InputError, match=r"run 1, event 3: samples are damaged \(expected CRC-32 [0-9a-f]{8}\)"),
        ):
            list(reader.events(1))


def test_other_files_are_refused_in_one_line(tmp_path):
    (tmp_path / "empty.db").touch()
    (tmp_path / "text.db").write_text("hello\n")
    sqlite3.connect(tmp_path / "none.db").execute("CREATE TABLE notes (a)").connection.close()
    with sqlite3.connect(tmp_path / "newer.db") as connection:
        connection.execute("CREATE TABLE journal (format TEXT, version INT)")
        connection.execute("INSERT INTO journal VALUES ('catseye-journal', 9)")
    connection.close()
    cases = {
        "empty.db": "starts with b''",
        "text.db": r"is not a journal: it starts with b'hello\\n'",
        "none.db": "it has other tables, such as 'notes'",
        "newer.db": "version 9 is newer than 2",
        "missing.db": "file is missing",
        ".": "is not a file",
    }
    for name, text in cases.items():
        with pytest.raises(InputError, match=text):
            JournalReader(tmp_path / name)
    assert not (tmp_path / "missing.db").exists()


def test_file_name_with_url_characters_is_a_file_name(tmp_path):
    path = tmp_path / "night 7?mode=ro&x=%41#1.db"
    written(path, scene_entries(2))
    with JournalReader(path) as reader:
        assert reader.last(1) == len(scene_entries(2))
    assert [found.name for found in tmp_path.iterdir()] == [path.name]


def test_site_file_outside_its_folder_is_refused(tmp_path):
    written(tmp_path / "j.db", [], run=scene_run(extra={"../../escaped.txt": "x"}))
    with JournalReader(tmp_path / "j.db") as reader, pytest.raises(InputError, match="outside its site"):
        reader.site(1)
