"""Journals looked after: all runs checked, against heads and copies; a copy made while it is written."""

import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import quote

from catseye.coordinator.journal.chain import Head
from catseye.coordinator.journal.check import ChainReport, check_whole, held_by, parted
from catseye.coordinator.journal.place import place_of, refuse_foreign
from catseye.coordinator.journal.reader import JournalReader
from catseye.errors import InputError

PAGES = 1024  # copied in one step, 8 MB: the writer's commits go between
Progress = Callable[[str, int, int], None]


def checked(
    journal: str, which: int | str | None, heads: Sequence[str], against: str | None, *, progress: Progress
) -> tuple[list[ChainReport], list[dict[str, Any]]]:
    """Reports of one run, or of all; and where a copy's runs part from them.

    heads   EVENT:HASH, of the run that is named; where none is, of whichever run has it

    Raises InputError: no such journal, run or copy; a text that is no head.
    """
    told = [Head.parse(text) for text in heads]
    with JournalReader(journal) as reader:
        runs = reader.runs() if which is None else (reader.run(which),)
        if not runs:
            raise InputError(f"journal {reader.place}: holds no run (expected one at least)")
        numbers = [run.run for run in runs]
        holders = {head: _holder(reader, numbers, head) for head in told}
        reports = []
        for run in runs:
            mine = [head for head in told if holders[head] == run.run or which is not None]
            reports.append(check_whole(reader, run.run, heads=mine, progress=progress))
        for head in told if which is None else ():
            if holders[head] is None:
                text = f"no run has head {head}, which was told: a run was deleted, cut or written anew"
                reports[-1].given += 1
                reports[-1].wrong(reports[-1].last[0] + 1, text)
        if against is None:
            return reports, []
        with JournalReader(against) as other:
            shared = {r.uuid for r in other.runs()}
            found = []
            for run in runs:
                if run.uuid not in shared:
                    text = f"{other.place} does not hold it."
                    found.append({"run": run.run, "parts_at_event": None, "both_up_to": None, "text": text})
                    continue
                first, last = parted(reader, other, run.uuid)
                same = f"{other.place} is the same up to event {last}, the last that both have."
                text = same if first is None else f"{other.place} has another history from event {first} on."
                found.append({"run": run.run, "parts_at_event": first, "both_up_to": last, "text": text})
            return reports, found


def _holder(reader: JournalReader, runs: Sequence[int], head: Head) -> int | None:
    """The run that has a head, None where none has."""
    for run in runs:
        try:
            if held_by(reader, run, head):
                return run
        except InputError:  # checking that run will say so
            continue
    return None


def copied(journal: str, copy: Path, *, progress: Progress) -> list[ChainReport]:
    """A file's copy by SQLite's own way, which a writer does not disturb; what checking the copy said.

    Raises InputError: a server's journal, a name that is taken, a disk that cannot take it; then nothing is left.
    """
    place = place_of(journal)
    refuse_foreign(place, fresh=False)
    if place.path is None:
        raise InputError(f"journal {place.shown}: is a server's (expected a file; a server's is copied by pg_dump)")
    if copy.exists():
        raise InputError(f"{copy}: is there already (expected a new name)")
    new = copy.with_name(f".{copy.name}.new")
    try:
        address = f"file:{quote(str(place.path))}?mode=ro"
        with closing(sqlite3.connect(address, uri=True)) as source, closing(sqlite3.connect(new)) as target:
            source.backup(target, pages=PAGES, progress=lambda _, left, of: progress("pages", of - left, of))
            target.execute("PRAGMA journal_mode = DELETE")  # one file, as a journal that was closed
        new.replace(copy)
    except (sqlite3.Error, OSError) as problem:
        raise InputError(f"{copy}: cannot be written: {problem} (expected room and leave to write)") from problem
    finally:
        new.unlink(missing_ok=True)
    with JournalReader(copy) as reader:
        return [check_whole(reader, run.run, progress=progress) for run in reader.runs()]
