"""Journals with bytes in text columns: one line with the file, from every reader."""

import shutil
import sqlite3

import pytest

from catseye.coordinator.journal.campaign import journal_campaign
from catseye.coordinator.journal.check import verify_run
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.structure import read_journal_epochs, read_range_series
from catseye.coordinator.journal.tables import EVENTS, JOURNAL, METADATA, RUN_FILES, RUNS, TEXTS
from catseye.coordinator.journal.writer import Journal
from catseye.errors import InputError
from catseye.gateways.journal.campaign import write_campaign
from catseye.gateways.journal.export import export_tables
from catseye.service.journals import checked, copied
from catseye.service.replay import replayed
from catseye.simulator.clock.world_clock import ManualClock
from journal_scene import START, scene_entries, scene_run

BYTES = {  # as an editor, a bad disk or another program might leave them
    "bytes": "x'ff'",
    "an end that is not UTF-8": "cast(cast({column} as blob) || x'ff' as text)",
    "its own text as bytes": "cast({column} as blob)",
    "bytes in the middle": (
        "cast(substr(cast({column} as blob), 1, 3) || x'ff' || substr(cast({column} as blob), 4) as blob)"
    ),
}
READ = (*EVENTS, RUNS, RUN_FILES, TEXTS)
COLUMNS = [
    (table.name, column.name)
    for table in READ
    for column in table.columns
    if column.name not in ("run", "seq") and column.type.python_type is not bool  # of which any byte is a truth
]
CELLS = {*COLUMNS, *((t.name, c.name) for t in METADATA.sorted_tables for c in t.columns)}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A small journal with entries of every kind."""
    path = tmp_path_factory.mktemp("whole") / "whole.db"
    with Journal.open(path, run=scene_run(), clock=ManualClock(START / 1e8)) as journal:
        for entry in scene_entries(6):
            journal.append(entry)
    return path


def damaged(source, folder, table, column, how):
    """A copy of a journal with one row's cell written over; None where SQLite does not let it be."""
    path = folder / "damaged.db"
    shutil.copy(source, path)
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA foreign_keys = OFF")
    key = "seq" if table in {each.name for each in METADATA.sorted_tables if "seq" in each.columns} else "rowid"
    row = f"{key} = (SELECT max({key}) FROM {table} WHERE {column} IS NOT NULL)"
    try:
        changed = connection.execute(f"UPDATE {table} SET {column} = {BYTES[how].format(column=column)} WHERE {row}")
        connection.commit()
    except sqlite3.Error:
        return None
    finally:
        connection.close()
    return path if changed.rowcount else None


def everything(path):
    """Each entry, file and record of the journal's runs."""
    with JournalReader(path) as reader:
        for run in reader.runs():
            reader.files(run.run)
            for _ in reader.events(run.run):
                pass


def again(path):
    return replayed(str(path), None, None, progress=lambda what, done, total: None)


def exported(path, write, **which):
    with JournalReader(path) as reader:
        number = reader.run().run
        return write(reader, path.with_name("out"), chain=verify_run(reader, number), number=number, **which)


READERS = {
    "replay": again,
    "export tables": lambda path: exported(
        path,
        lambda reader, out, chain, number: export_tables(reader, out, runs=[number], forms=["csv"], chains=[chain]),
    ),
    "export a campaign": lambda path: exported(
        path, lambda reader, out, chain, number: write_campaign(journal_campaign(reader, number, chain=chain), out)
    ),
    "structure": lambda path: read_journal_epochs(str(path)),
    "vibration": lambda path: read_range_series(str(path), ["*"], least=1),
    "journal check": lambda path: checked(str(path), None, (), None, progress=lambda what, done, total: None),
    "journal copy": lambda path: copied(str(path), path.with_name("copy.db"), progress=lambda *_: None),
}


def refused_or_read(action, path):
    """The refusal's text, "" where it was read; no other error, and the refusal one line that names the file."""
    try:
        action(path)
    except InputError as problem:
        text = str(problem)
        assert path.name in text or "copy.db" in text
        assert "\n" not in text
        return text
    return ""


@pytest.mark.parametrize("how", BYTES)
def test_bytes_in_a_text_column_are_refused_with_the_file(whole, tmp_path, how):
    tried = 0
    for table, column in COLUMNS:
        path = damaged(whole, tmp_path, table, column, how)
        if path is None:
            continue
        tried += 1
        told = refused_or_read(everything, path)
        samples = table == "solutions" and column == "covariance"  # a column of bytes: its own stay what they are
        assert told or (samples and how == "its own text as bytes"), (table, column)
    assert tried > 40


@pytest.mark.parametrize("reader", READERS)
def test_no_reader_of_a_damaged_journal_ends_in_an_internal_error(whole, tmp_path, reader):
    """The columns that each reader needs, and one of each other sort."""
    chosen = [
        ("runs", "settings"),
        ("runs", "uuid"),
        ("journal", "version"),
        ("texts", "text"),
        ("shots", "ranger"),
        ("weather", "station"),
        ("solutions", "answer"),
        ("documents", "name"),
        ("chain", "kind"),
        ("buffers", "samples"),
    ]
    assert set(chosen) <= CELLS
    for table, column in chosen:
        path = damaged(whole, tmp_path, table, column, "bytes")
        if path is not None:
            refused_or_read(READERS[reader], path)
            for made in ("out", "copy.db"):
                left = tmp_path / made
                shutil.rmtree(left) if left.is_dir() else left.unlink(missing_ok=True)


def test_settings_of_bytes_are_named(whole, tmp_path):
    """What the trial wrote: an internal error before."""
    told = refused_or_read(again, damaged(whole, tmp_path, "runs", "settings", "bytes in the middle"))
    assert "column 'settings'" in told
    assert "expected text" in told


def test_a_version_of_bytes_is_named(whole, tmp_path):
    path = damaged(whole, tmp_path, JOURNAL.name, "version", "bytes")
    assert "version is b'\\xff'" in refused_or_read(again, path)
