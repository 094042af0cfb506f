"""A journal's run into an archive."""

import shutil
import tempfile
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from hashlib import sha256
from pathlib import Path
from typing import Any

from catseye.coordinator.journal.check import ChainReport, verify_run
from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.journal.reader import JournalReader, StoredRun
from catseye.errors import InputError
from catseye.interruption import Unfinished, undo_on_interruption
from catseye.records.night.live import TICKS_PER_DAY
from catseye.service.archive.campaigns import summary
from catseye.verdict import Verdict

MJD_0 = datetime(1858, 11, 17, tzinfo=UTC)


def archive_run(directory: str, journal: str, number: int) -> dict[str, Any]:
    """Summary of a journal's run, after it is in an archive; one that is there already stays as it is.

    Raises InputError for a journal that fails verification, a run without shots and weather, or a full disk.
    """
    from catseye.gateways.archive.files import TEMPORARY
    from catseye.records.archive.reading import intact_night

    archive = Path(directory)
    with JournalReader(journal) as reader:
        run = reader.run(number)
        chain = verify_run(reader, number)
        if chain.count:
            raise InputError(
                f"journal {reader.place}: run {number} fails verification: {chain.problems[0]} (use its backup, or "
                "export it as damaged and archive the campaign)"
            )
        head = "" if chain.head is None else str(chain.head)
        identity = sha256(f"{run.uuid}\n{reader.last(number)}\n{head}\n".encode()).hexdigest()
        night = run_identifier(run, identity)
        if (present := intact_night(archive, night)) is not None:
            return summary(present, added=False)
        folder = Path(tempfile.mkdtemp(prefix=TEMPORARY, dir=archive))
        try:
            with undo_on_interruption(Unfinished(str(folder))):
                return _archived(archive, reader, run, chain, night, identity, folder / "campaign")
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def run_identifier(run: StoredRun, identity: str) -> str:
    """Identifier of a run: site, date of its start in UTC, and the first digits of its identity."""
    from catseye.records.archive.index import night_identifier

    day = MJD_0 + timedelta(days=run.started // TICKS_PER_DAY)
    return night_identifier(f"{run.site}-{day:%Y-%m-%d}", identity)


def _archived(
    archive: Path, reader: JournalReader, run: StoredRun, chain: ChainReport, night: str, identity: str, folder: Path
) -> dict[str, Any]:
    """Write a run by way of a campaign's folder, which is what comes back when it is restored."""
    from catseye.gateways.archive.inputs import night_inputs
    from catseye.gateways.archive.journal import RunEntries, run_content
    from catseye.gateways.archive.writer import write_night
    from catseye.records.night.campaign import read_campaign

    entries = RunEntries.of(reader, run.run)
    if not entries.ticks:
        raise InputError(f"journal {reader.place}: run {run.run} has no shot and no reading (expected some)")
    campaign = None
    if _write_campaign(reader, run, chain, entries.shots, folder):
        campaign = read_campaign(folder)
    content = run_content(
        run,
        reader.site(run.run),
        entries,
        chain=chain,
        verdict=run_verdict(entries.solutions),
        inputs=night_inputs(night, identity, folder),
        campaign=campaign,
    )
    return summary(write_night(archive, content), added=True, row=content.tables["nights"])


def _write_campaign(
    reader: JournalReader, run: StoredRun, chain: ChainReport, shots: Sequence[Any], folder: Path
) -> bool:
    """Write the run's shots with samples as a campaign; its site's files alone, and False, where there are none."""
    from catseye.coordinator.journal.campaign import journal_campaign
    from catseye.gateways.journal.campaign import write_campaign

    if run.buffers and shots:
        try:
            chosen = journal_campaign(reader, run.run, chain=chain)
        except InputError:  # no shot or reading that a campaign can hold
            pass
        else:
            write_campaign(chosen, folder)
            return True
    for path, text in reader.files(run.run).items():
        where = folder / path
        where.parent.mkdir(parents=True, exist_ok=True)
        where.write_text(text, encoding="utf-8", newline="")
    return False


def run_verdict(solutions: Sequence[EpochSolution]) -> Verdict:
    """Verdict on a run by the doubts of its epochs."""
    doubts = [doubt for solution in solutions for doubt in solution.answer.get("doubts") or ()]
    if not solutions:
        return Verdict("failed", "no epoch of the run was solved")
    count = f"{len(solutions)} epochs" if len(solutions) != 1 else "1 epoch"
    return Verdict("good", f"{count} solved, none with a doubt").hearing(doubts)
