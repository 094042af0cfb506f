"""Two hundred damages to a journal: each found, or without effect; none ends in anything but one line; what is left is
exported, and nothing that was not written.
"""

import csv
import os
import shutil
import sqlite3

import numpy as np
import pytest

from catseye.coordinator.journal.recovery import recover
from catseye.coordinator.journal.verdict import chain_verdict
from catseye.coordinator.journal.writer import Journal
from catseye.errors import InputError
from catseye.records.night.live import LiveShot
from catseye.service.journals import checked, exported
from catseye.simulator.clock.world_clock import ManualClock
from draws import draws
from journal_scene import MOST_WAIT, START, scene_entries, scene_run

PAGE = 8192
EVENTS = ("shots", "buffers", "weather", "postures", "commands", "happenings", "solutions", "documents")
TABLES = (*EVENTS, "chain", "runs", "run_files", "texts")
TEXTS = ("shots.text", "weather.station", "commands.line", "happenings.details", "solutions.answer", "documents.text")
READ = ("shots", "weather", "postures", "commands", "happenings")  # tables whose rows are compared


def quiet(*_):
    """No progress is shown."""


def long_shot(number):
    codes = np.random.default_rng(number).integers(-32768, 32768, 8192, dtype=np.int16)
    return LiveShot("ZY106", "ZEG41040L", START + 300 * number, 128, 64, 1000, 3e-4, codes, 1.0, 0.1, 10_000 + number)


def written(path):
    """Two runs, some shots of which are long; the heads that were told."""
    heads = []
    for seed in (0, 3):
        entries = [*scene_entries(60, seed=seed), *map(long_shot, range(8))]
        with Journal.open(path, run=scene_run(), clock=ManualClock(START / 1e8), on_head=heads.append) as journal:
            for k in range(0, len(entries), 11):
                journal.append(*entries[k : k + 11]).result(MOST_WAIT)
    return [str(head) for head in heads]


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    folder = tmp_path_factory.mktemp("damaged")
    heads = written(folder / "j.db")
    written(folder / "other.db")
    wanted = {name: set() for name in READ}
    for run in (1, 2):
        exported(str(folder / "j.db"), folder / f"out-{run}", "csv", which=run, progress=quiet)
        for name, there in rows(folder / f"out-{run}").items():
            wanted[name] |= there
    return folder, heads, wanted


def rows(out):
    """The rows of an export's tables as they stand."""
    found = {}
    for name in READ:
        with (out / f"{name}.csv").open(newline="") as stream:
            found[name] = {tuple(row) for row in list(csv.reader(stream))[1:]}
    return found


def stored(path):
    """All rows of all tables, as SQLite gives them; None where it does not."""
    try:
        connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
        tables = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        found = {name: sorted(connection.execute(f"SELECT * FROM {name}").fetchall(), key=repr) for name in tables}
        return found if connection.execute("PRAGMA quick_check(1)").fetchone() == ("ok",) else None
    except sqlite3.Error:
        return None
    finally:
        connection.close()


def scripted(path, *scripts):
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA foreign_keys = OFF")
    for script, given in scripts:
        connection.execute(script, given)
    connection.commit()
    connection.close()


def of_bytes(kind, path, rng):
    """Damages to the file: a bit, a page of zeros, two pages changed for each other, a cut, a hole, rubbish."""
    raw = bytearray(path.read_bytes())
    pages = len(raw) // PAGE
    one, two = (int(k) * PAGE for k in rng.choice(np.arange(1, pages), 2, replace=False))
    if kind == "bit":
        raw[int(rng.integers(100, len(raw)))] ^= 1 << int(rng.integers(8))
    elif kind == "zeros":
        raw[one : one + PAGE] = bytes(PAGE)
    elif kind == "changed pages":
        raw[one : one + PAGE], raw[two : two + PAGE] = raw[two : two + PAGE], raw[one : one + PAGE]
    elif kind == "cut":
        del raw[int(rng.integers(1, len(raw))) :]
    elif kind == "hole":
        del raw[one : one + PAGE]
    elif kind == "rubbish":
        at = int(rng.integers(0, len(raw) - 4096))
        raw[at : at + 4096] = rng.integers(0, 256, 4096, dtype=np.uint8).tobytes()
    path.write_bytes(raw)


def of_rows(kind, path, rng):
    """Damages that SQLite itself makes: rows, texts, chain, version, files."""
    table = str(rng.choice(EVENTS))
    seq = int(rng.integers(1, 200))
    if kind == "row":
        scripted(path, (f"DELETE FROM {table} WHERE run = 2 AND seq >= ? AND seq < ?", (seq, seq + 9)))
    elif kind == "value":
        scripted(path, ("UPDATE shots SET phase_rad = phase_rad + 1e-9 WHERE seq >= ? AND seq < ?", (seq, seq + 9)))
    elif kind == "put in":
        number = ["zzz", -1, 1000 + seq, 10**12, b"\xff"][int(rng.integers(5))]
        scripted(path, ("INSERT INTO postures VALUES (2, ?, 1, 1.0, 1.0, 1.0, 1.0)", (number,)))
    elif kind == "no utf-8":
        table, column = str(rng.choice(TEXTS)).split(".")
        scripted(path, (f"UPDATE {table} SET {column} = CAST(x'e9ff' AS TEXT) WHERE run = 2", ()))
    elif kind == "chain deleted":
        scripted(path, ("DELETE FROM chain WHERE run >= ?", (int(rng.integers(3)),)))
    elif kind == "version back":
        scripted(path, ("UPDATE journal SET version = 1", ()), *[("DROP TABLE chain", ())] * int(rng.integers(2)))
    elif kind == "table dropped":
        scripted(path, (f"DROP TABLE {rng.choice(TABLES)}", ()))
    elif kind == "own part":
        names = [[None, path.name], [path.name, None], [path.name, path.name], [None, "gone.db"]]
        scripted(path, ("INSERT INTO parts VALUES (2, ?, ?)", names[int(rng.integers(4))]))
    elif kind == "last run deleted":
        names = [name for name in (*TABLES, "parts") if name != "texts"]
        scripted(path, *[(f"DELETE FROM {name} WHERE run = 2", ()) for name in names])
    elif kind == "end deleted":
        scripted(path, ("DELETE FROM chain WHERE run = 2 AND seq >= ?", (seq,)))
    elif kind == "another":
        shutil.copy(path.with_name("other.db"), path)


OF_BYTES = ("bit", "zeros", "changed pages", "cut", "hole", "rubbish")
OF_ROWS = (
    *("row", "value", "put in", "no utf-8", "chain deleted", "version back", "table dropped", "own part"),
    *("last run deleted", "end deleted", "another"),
)


def one_line(action):
    """What an action gives; None where it refuses in one line. Anything else is raised."""
    try:
        return action()
    except InputError as problem:
        said = str(problem)
    assert "\n" not in said
    assert len(said) < 1000
    return None


@draws(200, quick=20, name="count")
def test_damage_is_detected_and_exported_rows_are_genuine(night, tmp_path, count):
    folder, heads, wanted = night
    before, rng = stored(folder / "j.db"), np.random.default_rng(40)
    kinds = (*OF_BYTES, *OF_ROWS)
    shutil.copy(folder / "other.db", tmp_path / "other.db")
    given = harmless = refused = 0
    for k in range(count):
        kind, hurt, out = kinds[k % len(kinds)], tmp_path / "j.db", tmp_path / f"out-{k}"
        shutil.copy(folder / "j.db", hurt)
        (of_bytes if kind in OF_BYTES else of_rows)(kind, hurt, rng)
        found = one_line(lambda hurt=hurt: chain_verdict(checked(str(hurt), None, heads, None, progress=quiet)[0]))
        if stored(hurt) == before:
            harmless += 1
            assert found is None or found.word == "good", kind
        else:
            assert found is None or found.word == "failed", f"{k}: {kind}: {found}"
        which = 1 if kind == "last run deleted" else 2
        done = one_line(
            lambda hurt=hurt, out=out, which=which: exported(
                str(hurt), out, "csv", which=which, damaged=True, progress=quiet
            )
        )
        refused += done is None
        if done is None or kind == "another":
            assert done is not None or not out.exists()
            continue
        for name, there in rows(out).items():
            assert there <= wanted[name], f"{k}: {kind}: {name} {sorted(there - wanted[name])[:2]}"
            given += len(there)
        if kind not in ("chain deleted", "version back", "own part", "no utf-8", "put in"):
            continue
        assert sum(map(len, rows(out).values())) > 100, f"{k}: {kind}"
    assert harmless < count / 4
    assert refused < count / 4
    assert given > 100 * count
    assert [name for name in os.listdir(tmp_path) if name.startswith(".")] == []


@pytest.mark.parametrize("tenth", range(1, 11))
def test_truncated_journal_is_exported_as_far_as_readable(night, tmp_path, tenth):
    folder, heads, wanted = night
    raw = (folder / "j.db").read_bytes()
    cut = tmp_path / "cut.db"
    cut.write_bytes(raw[: len(raw) * tenth // 11])
    found = one_line(lambda: chain_verdict(checked(str(cut), None, heads, None, progress=quiet)[0]))
    assert found is None or found.word == "failed"
    with pytest.raises(InputError) as caught:
        exported(str(cut), tmp_path / "out", "csv", which=1, progress=quiet)
    assert "\n" not in str(caught.value)
    done = exported(str(cut), tmp_path / "out", "csv", which=1, damaged=True, progress=quiet)
    assert done.verdict.word == "doubtful"
    assert "cut.db is damaged" in done.notes[0]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut.db", "out"]
    recover(cut, tmp_path / "new.db")
    with sqlite3.connect(tmp_path / "new.db") as new:
        for name in READ:
            (there,) = new.execute(f"SELECT count(*) FROM {name} WHERE run = 1").fetchone()
            assert done.rows.get(name, 0) == there  # all that is there, whether its link and samples are or not
    there = rows(tmp_path / "out")
    assert all(there[name] <= wanted[name] for name in READ)
    assert tenth < 6 or sum(done.rows.values()) > 100
