"""Journals looked after: all runs checked, against heads and copies; a copy made while it is written; an export."""

import glob
import os
import shutil
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal
from urllib.parse import quote

from catseye.coordinator.journal.chain import Head
from catseye.coordinator.journal.check import ChainReport, check_whole, held_by, parted
from catseye.coordinator.journal.place import place_of, refuse_foreign
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.recovery import recover
from catseye.errors import InputError
from catseye.gateways.journal.campaign import export_campaign
from catseye.gateways.journal.chain import export_verdict
from catseye.gateways.journal.export import export_tables
from catseye.gateways.writers.interruption import Unfinished, undone_when_interrupted
from catseye.verdict import Verdict

STEP = 500  # of SQLite's virtual machine between two looks at signals and progress: some ms, 2 MB of buffers
Progress = Callable[[str, int, int], None]
Span = tuple[int, int]  # ticks
Format = Literal["csv", "fits", "campaign"]


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
        with suppress(InputError):  # checking that run will say so
            if held_by(reader, run, head):
                return run
    return None


# Copies --------------------------------------------------------------------------------------------------------------


def copied(journal: str, copy: Path, *, progress: Progress) -> list[ChainReport]:
    """A file's copy in one read transaction, beside which a writer goes on; what checking the copy said.

    An interruption ends it within some ms, and leaves nothing.

    Raises InputError: a server's journal, a name that is taken, a disk that cannot take it, a journal that cannot be
    read; then nothing is left.
    """
    place = place_of(journal)
    refuse_foreign(place, fresh=False)
    if place.path is None:
        raise InputError(f"journal {place.shown}: is a server's (expected a file; a server's is copied by pg_dump)")
    if os.path.lexists(copy):
        raise InputError(f"{copy}: is there already (expected a new name)")
    folder = copy.with_name(f".{copy.name}.{os.getpid()}.new")  # of its own: SQLite puts a file beside what it makes
    new = folder / copy.name
    _forget_dead(copy)
    try:
        with undone_when_interrupted(Unfinished(str(folder))):
            folder.mkdir()
            _copy(place.path, new, progress)
            if os.path.lexists(copy):
                raise FileExistsError(f"{copy.name} has come meanwhile")
            new.rename(copy)
        _sync(copy.absolute().parent)
    except (sqlite3.Error, OSError) as problem:
        raise InputError(
            f"{copy}: cannot be written: {problem} (expected room and leave to write, and a journal that is whole: of "
            "a damaged one copy the file and its log)"
        ) from problem
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    with JournalReader(copy) as reader:
        return [check_whole(reader, run.run, progress=progress) for run in reader.runs()]


def _copy(source: Path, new: Path, progress: Progress) -> None:
    """All of one state of a journal into a new file, and on the disk; signals are answered between two steps."""
    whole = source.stat().st_size

    ended: list[BaseException] = []

    def step() -> int:
        try:
            progress("bytes", min(new.stat().st_size, whole) if new.exists() else 0, whole)
        except (KeyboardInterrupt, SystemExit, OSError, ValueError) as problem:  # SQLite says only: interrupted
            ended.append(problem)
            return 1
        return 0

    address = f"file:{quote(str(source))}?mode=ro"
    try:
        with closing(sqlite3.connect(address, uri=True, isolation_level=None)) as connection:
            connection.set_progress_handler(step, STEP)
            connection.execute("VACUUM INTO ?", (str(new.absolute()),))
    except sqlite3.Error:
        for problem in ended:
            raise problem from None
        raise
    _sync(new)


def _sync(path: Path) -> None:
    """Flush a file, or a folder's names, to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _forget_dead(copy: Path) -> None:
    """Remove what a backup to this name left that was killed."""
    for path in copy.absolute().parent.glob(f".{glob.escape(copy.name)}.*.new"):
        number = path.name.removeprefix(f".{copy.name}.").partition(".")[0]
        if number.isdecimal() and not Path(f"/proc/{number}").exists() and Path("/proc/self").exists():
            shutil.rmtree(path, ignore_errors=True)


# Export --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ExportOutcome:
    """Counts of one exported run.

    run      its number
    chain    what checking said
    rows     written, by table
    notes    lines for people: what was left out, what was recovered
    verdict  of all of it
    """

    run: int
    chain: ChainReport
    rows: dict[str, int]
    notes: tuple[str, ...]
    verdict: Verdict


def exported(
    journal: str,
    out: Path,
    form: Format,
    *,
    which: int | str | None = None,
    span: Span | None = None,
    damaged: bool = False,
    progress: Progress,
) -> ExportOutcome:
    """A run's tables, or the campaign that it is.

    out       directory
    which     the last run if None
    damaged   also of a journal that does not check: what can be read and is as it was written

    Raises InputError: no such journal or run, one that does not check, a directory that is another's.
    """
    with _readable(journal, out, damaged=damaged, progress=progress) as (reader, notes):
        number = reader.run(which).run
        chain = check_whole(reader, number, progress=progress)
        if chain.count and not damaged:
            raise InputError(
                f"journal {reader.place}: run {number} is not as it was written: {chain.problems[0]} (expected a "
                "journal that checks: take its backup, or --damaged to leave out what does not)"
            )
        if notes and chain.unvouched:  # pages were lost, links or samples among them: they were not put in for that
            count = len(chain.unvouched)
            notes = (*notes, f"{count} events are in it that lost link or samples: nothing vouches for them")
            chain.bad -= chain.unvouched
        if form == "campaign":
            progress("writing the campaign", 0, 1)
            written = export_campaign(reader, out, run=number, span=span, chain=chain)
            counts = {"shots": written.shots, "weather": written.readings}
            return ExportOutcome(number, chain, counts, (*notes, *written.notes), written.verdict.hearing(notes))
        counts = export_tables(reader, out, runs=[number], forms=[form], span=span, progress=progress, chains=[chain])
        return ExportOutcome(number, chain, counts, notes, export_verdict(chain, sum(counts.values()), notes))


@contextmanager
def _readable(
    journal: str, out: Path, *, damaged: bool, progress: Progress
) -> Iterator[tuple[JournalReader, tuple[str, ...]]]:
    """A journal's reader; of one that the database refuses, and that is asked for all the same, what is recovered."""
    place = place_of(journal)
    if not damaged or place.path is None or _sound(journal):
        with JournalReader(journal) as reader:
            yield reader, ()
        return
    refuse_foreign(place, fresh=False)
    parent = out.absolute().parent
    with (
        TemporaryDirectory(prefix=".catseye-recovered-", dir=parent) as folder,
        undone_when_interrupted(Unfinished(folder)),
    ):
        notes = _recovered(place.path, Path(folder), progress)
        with JournalReader(Path(folder) / place.path.name) as reader:
            reader.place = place.shown
            if not reader.runs():
                raise InputError(f"journal {place.shown}: no run's record can be read (expected one at least)")
            try:
                reader.parts(reader.run(None).run)
            except InputError as problem:
                reader.alone = True
                notes = (*notes, f"of its other files nothing is in it: {problem}")
            yield reader, notes


def _sound(journal: str) -> bool:
    """True where the database can read a journal in all its files."""
    try:
        with JournalReader(journal) as reader:
            for run in reader.runs():
                for part in reader.parts(run.run):
                    with part.reading() as connection:
                        if connection.exec_driver_sql("PRAGMA quick_check(1)").scalar() != "ok":
                            return False
    except InputError:
        return False
    return True


def _recovered(path: Path, folder: Path, progress: Progress) -> tuple[str, ...]:
    """Recover a journal's file and those beside it in which its runs stand; what came of each."""
    notes, ahead, done = [], [path.name], set[str]()
    while ahead:
        name = ahead.pop(0)
        beside = path.with_name(name)
        if name in done or Path(name).name != name or not beside.is_file():
            continue
        done.add(name)
        progress(f"recovering {name}", 0, 1)
        notes.append(f"{name} is damaged: {recover(beside, folder / name)}")
        with closing(sqlite3.connect(folder / name)) as connection, suppress(sqlite3.Error):
            for follows, followed in connection.execute("SELECT follows, followed_by FROM parts").fetchall():
                ahead += [each for each in (follows, followed) if each]
    return tuple(notes)
