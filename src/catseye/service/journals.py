"""Journal maintenance: check all runs, back up while writing, export."""

import glob
import os
import shutil
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal
from urllib.parse import quote

from catseye.aliases import Progress
from catseye.coordinator.journal.campaign import journal_campaign
from catseye.coordinator.journal.chain import Head
from catseye.coordinator.journal.check import ChainReport, has_head, parted, verify_run
from catseye.coordinator.journal.place import place_of, refuse_foreign
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.recovery import recover
from catseye.coordinator.journal.verdict import export_verdict
from catseye.errors import InputError
from catseye.gateways.journal.campaign import write_campaign
from catseye.gateways.journal.export import export_tables
from catseye.interruption import Unfinished, undo_on_interruption
from catseye.verdict import Verdict

STEP = 500  # SQLite VM steps between checks for signals and progress: some ms, 2 MB of buffers
Span = tuple[int, int]  # ticks
Format = Literal["csv", "fits", "campaign"]


def checked(
    journal: str, which: int | str | None, heads: Sequence[str], against: str | None, *, progress: Progress
) -> tuple[list[ChainReport], list[dict[str, Any]]]:
    """Check reports of one run or of all, and differences from a copy.

    heads   EVENT:HASH, of the selected run; if none is selected, of whichever run has it

    Raises InputError: no such journal, run or copy; an invalid head.
    """
    given_heads = [Head.parse(text) for text in heads]
    with JournalReader(journal) as reader:
        runs = reader.runs() if which is None else (reader.run(which),)
        if not runs:
            raise InputError(f"journal {reader.place}: contains no run (expected at least one)")
        numbers = [run.run for run in runs]
        holders = {head: _holder(reader, numbers, head) for head in given_heads}
        reports = []
        for run in runs:
            run_heads = [head for head in given_heads if holders[head] == run.run or which is not None]
            reports.append(verify_run(reader, run.run, heads=run_heads, progress=progress))
        for head in given_heads if which is None else ():
            if holders[head] is None:
                text = f"no run has the given head {head}: a run was deleted, cut or rewritten"
                reports[-1].given += 1
                reports[-1].wrong(reports[-1].last[0] + 1, text)
        if against is None:
            return reports, []
        with JournalReader(against) as copy:
            shared = {r.uuid for r in copy.runs()}
            differences = []
            for run in runs:
                if run.uuid not in shared:
                    text = f"{copy.place} does not contain it."
                    differences.append({"run": run.run, "parts_at_event": None, "both_up_to": None, "text": text})
                    continue
                first, last = parted(reader, copy, run.uuid)
                identical = f"{copy.place} is the same up to event {last}, the last in both."
                text = identical if first is None else f"{copy.place} has another history from event {first} on."
                differences.append({"run": run.run, "parts_at_event": first, "both_up_to": last, "text": text})
            return reports, differences


def _holder(reader: JournalReader, runs: Sequence[int], head: Head) -> int | None:
    """The run that has a head, None if none has."""
    for run in runs:
        with suppress(InputError):  # reported by that run's check
            if has_head(reader, run, head):
                return run
    return None


# Copies --------------------------------------------------------------------------------------------------------------


def copied(journal: str, copy: Path, *, progress: Progress) -> list[ChainReport]:
    """Copy a journal file in one read transaction; reports of the copy's check.

    The writer goes on beside it. An interruption ends it within some ms, and leaves nothing.

    Raises InputError: a server's journal, an existing name, a full disk, an unreadable journal; then nothing is left.
    """
    place = place_of(journal)
    refuse_foreign(place, fresh=False)
    if place.path is None:
        raise InputError(f"journal {place.shown}: is on a server (expected a file; use pg_dump for a server)")
    if os.path.lexists(copy):
        raise InputError(f"{copy}: already exists (expected a new name)")
    folder = copy.with_name(f".{copy.name}.{os.getpid()}.new")  # private: SQLite puts a file beside the new one
    new = folder / copy.name
    _forget_dead(copy)
    try:
        with undo_on_interruption(Unfinished(str(folder))):
            folder.mkdir()
            _copy(place.path, new, progress)
            if os.path.lexists(copy):
                raise FileExistsError(f"{copy.name} was created meanwhile")
            new.rename(copy)
        _sync(copy.absolute().parent)
    except (sqlite3.Error, OSError) as problem:
        raise InputError(
            f"{copy}: cannot be written: {problem} (expected disk space, write permission and an undamaged journal; "
            "copy a damaged one with its -wal file)"
        ) from problem
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    with JournalReader(copy) as reader:
        return [verify_run(reader, run.run, progress=progress) for run in reader.runs()]


def _copy(source: Path, new: Path, progress: Progress) -> None:
    """Copy one consistent state of a journal to disk.

    Signals are handled between two steps.
    """
    size = source.stat().st_size

    interruptions: list[BaseException] = []

    def step() -> int:
        try:
            progress("bytes", min(new.stat().st_size, size) if new.exists() else 0, size)
        except (KeyboardInterrupt, SystemExit, OSError, ValueError) as problem:  # SQLite reports only an interruption
            interruptions.append(problem)
            return 1
        return 0

    address = f"file:{quote(str(source))}?mode=ro"
    try:
        with closing(sqlite3.connect(address, uri=True, isolation_level=None)) as connection:
            connection.set_progress_handler(step, STEP)
            connection.execute("VACUUM INTO ?", (str(new.absolute()),))
    except sqlite3.Error:
        for problem in interruptions:
            raise problem from None
        raise
    _sync(new)


def _sync(path: Path) -> None:
    """Flush a file, or a folder's names, to disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _forget_dead(copy: Path) -> None:
    """Remove what a killed backup to this name left."""
    for path in copy.absolute().parent.glob(f".{glob.escape(copy.name)}.*.new"):
        number = path.name.removeprefix(f".{copy.name}.").partition(".")[0]
        if number.isdecimal() and not Path(f"/proc/{number}").exists() and Path("/proc/self").exists():
            shutil.rmtree(path, ignore_errors=True)


# Export --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ExportOutcome:
    """Counts of one exported run.

    run      its number
    chain    report of the check
    rows     written, by table
    notes    lines for people: omitted or recovered entries
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
    """Export a run as tables or as a campaign.

    out       directory
    which     the last run if None
    damaged   also export a journal that fails the check, skipping altered and unreadable entries

    Raises InputError: no such journal or run, one that fails the check, a foreign directory.
    """
    with _readable(journal, out, damaged=damaged, progress=progress) as (reader, notes):
        number = reader.run(which).run
        chain = verify_run(reader, number, progress=progress)
        if chain.count and not damaged:
            raise InputError(
                f"journal {reader.place}: run {number} fails verification: {chain.problems[0]} (use its "
                "backup, or export it as damaged, without altered entries)"
            )
        if notes and chain.unvouched:  # explained by lost pages with links or samples, not by insertion
            count = len(chain.unvouched)
            notes = (*notes, f"{count} exported events lost their link or samples: they cannot be verified")
            chain.bad -= chain.unvouched
        if form == "campaign":
            progress("writing the campaign", 0, 1)
            campaign = journal_campaign(reader, number, span=span, chain=chain)
            write_campaign(campaign, out)
            counts = {"shots": len(campaign.shots), "weather": len(campaign.readings)}
            return ExportOutcome(number, chain, counts, (*notes, *campaign.notes), campaign.verdict.hearing(notes))
        counts = export_tables(reader, out, runs=[number], forms=[form], span=span, progress=progress, chains=[chain])
        return ExportOutcome(number, chain, counts, notes, export_verdict(chain, sum(counts.values()), notes))


@contextmanager
def _readable(
    journal: str, out: Path, *, damaged: bool, progress: Progress
) -> Iterator[tuple[JournalReader, tuple[str, ...]]]:
    """Reader of a journal, or of what is recovered from it.

    Recovery is for a journal that the database refuses, if `damaged` is set.
    """
    place = place_of(journal)
    if not damaged or place.path is None or _sound(journal):
        with JournalReader(journal) as reader:
            yield reader, ()
        return
    refuse_foreign(place, fresh=False)
    parent = out.absolute().parent
    with (
        TemporaryDirectory(prefix=".catseye-recovered-", dir=parent) as folder,
        undo_on_interruption(Unfinished(folder)),
    ):
        notes = _recovered(place.path, Path(folder), progress)
        with JournalReader(Path(folder) / place.path.name) as reader:
            reader.place = place.shown
            if not reader.runs():
                raise InputError(f"journal {place.shown}: no readable run record (expected at least one)")
            try:
                reader.parts(reader.run(None).run)
            except InputError as problem:
                reader.alone = True
                notes = (*notes, f"nothing of its other files is included: {problem}")
            yield reader, notes


def _sound(journal: str) -> bool:
    """True if the database can read all files of a journal."""
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
    """Recover a journal's file and its other parts; results in lines."""
    notes, pending, finished = [], [path.name], set[str]()
    while pending:
        name = pending.pop(0)
        part = path.with_name(name)
        if name in finished or Path(name).name != name or not part.is_file():
            continue
        finished.add(name)
        progress(f"recovering {name}", 0, 1)
        notes.append(f"{name} is damaged: {recover(part, folder / name)}")
        with closing(sqlite3.connect(folder / name)) as connection, suppress(sqlite3.Error):
            for follows, followed in connection.execute("SELECT follows, followed_by FROM parts").fetchall():
                pending += [other for other in (follows, followed) if other]
    return tuple(notes)
