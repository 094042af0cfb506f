"""`export`, `check_journal` and `backup_journal`: a journal's run in other formats, its verification, its copy."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from catseye.aliases import Progress
from catseye.api.reading import DATABASES, place_of
from catseye.api.result import Result, quantities, require_writable
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError, CatseyeError, InputError

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.coordinator.journal.check import ChainReport
    from catseye.coordinator.journal.reader import JournalReader
    from catseye.gateways.writers.passage import Passage

    Journal = str | os.PathLike[str] | JournalReader

ExportFormat = Literal["csv", "fits", "campaign"]
LATEST_MJD = 1e6  # no time of a journal is later


@dataclass(frozen=True, eq=False, repr=False)
class ExportResult(Result):
    """Export of a journal's run.

    run         number of the run
    directory   where it was written
    form        "csv", "fits" or "campaign"
    rows        number written, by table
    notes       lines on what was omitted or recovered
    chain       verification of the run
    """

    run: int
    directory: Path
    form: ExportFormat
    rows: dict[str, int]
    notes: tuple[str, ...]
    chain: "ChainReport"

    def passages(self) -> "Sequence[Passage]":
        """Rows written, problems of the chain, and notes."""
        from catseye.gateways.journal.chain import chain_words
        from catseye.gateways.writers.passage import Passage

        rows = ", ".join(f"{count} {name}" for name, count in self.rows.items())
        chain = chain_words(self.chain) if self.chain.count or not self.chain.chained else []
        return [
            Passage("Written to", f"{self.directory}/: run {self.run}, {rows}."),
            *(Passage("Chain", text) for text in chain),
            *(Passage("Note", note) for note in self.notes),
        ]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye export --json`."""
        from catseye.gateways.journal.chain import chain_object

        return {
            "verdict": self.verdict.to_object(),
            "chain": chain_object(self.chain),
            "run": self.run,
            "out": str(self.directory),
            "format": self.form,
            "rows": self.rows,
            "notes": list(self.notes),
        }

    def tables(self) -> "dict[str, QTable]":
        """`rows`: a row a table written."""
        return {"rows": quantities({"table": (list(self.rows), ""), "rows": (list(self.rows.values()), "")})}


@with_units
def export(
    journal: "Journal",
    directory: "str | os.PathLike[str]",
    *,
    to: ExportFormat,
    run: Annotated[Any, In("", whole=True, text=True)] = None,
    since: Annotated[Any, In("mjd", one=True, text=True)] = None,
    until: Annotated[Any, In("mjd", one=True, text=True)] = None,
    damaged: bool = False,
    progress: Progress | None = None,
) -> ExportResult:
    """Write a journal's run as tables, or as a campaign that `reduce` reads.

    journal        file, postgresql://USER@HOST/DATABASE, or the reader that `load` returned
    directory      new, empty, or an earlier output of catseye
    to             "csv" or "fits" for tables, "campaign"
    run            number, or the beginning of its uuid; None for the last
    since, until   UTC as text, or MJD, of the first and the first excluded entry; None for no limit
    damaged        True to export a journal that fails verification, without its altered entries
    progress       called with (what, done, of how many)

    Raises InputError: unknown journal or run, a journal that fails verification, a directory that is not catseye's;
    ArgumentError: an invalid time or format.
    """
    from catseye.service.journals import exported

    if to not in get_args(ExportFormat):
        raise ArgumentError(f"to = {to!r} (expected one of {', '.join(get_args(ExportFormat))})", "to")
    span, out, place = _span(since, until), Path(directory), journal_place(journal)
    require_writable(out, place)
    outcome = exported(
        place, out, to, which=run_of(run), span=span, damaged=damaged, progress=progress or (lambda *_: None)
    )
    return ExportResult(
        verdict=outcome.verdict,
        run=outcome.run,
        directory=out,
        form=to,
        rows=outcome.rows,
        notes=outcome.notes,
        chain=outcome.chain,
    )


@dataclass(frozen=True, eq=False, repr=False)
class JournalCheckResult(Result):
    """Verification of a journal's runs against their chains of hashes.

    reports       a report a run
    differences   a row a run from the copy `against`: "run", "parts_at_event" (None: the same), "both_up_to", "text"
    """

    reports: "tuple[ChainReport, ...]"
    differences: tuple[dict[str, Any], ...]

    @property
    def unaltered(self) -> bool:
        """False if a run was altered, or has another history than the copy."""
        return self.verdict.word != "failed" and all(each["parts_at_event"] is None for each in self.differences)

    def passages(self) -> "Sequence[Passage]":
        """Chain of each run, and its differences from the copy."""
        from catseye.gateways.writers.passage import Passage

        return [
            *_chain_passages(self.reports),
            *(Passage(f"Run {each['run']}", str(each["text"])) for each in self.differences),
        ]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye journal check --json`."""
        from catseye.gateways.journal.chain import chain_object

        runs = [chain_object(report) for report in self.reports]
        return {"verdict": self.verdict.to_object(), "runs": runs, "against": list(self.differences)}

    def tables(self) -> "dict[str, QTable]":
        """`runs`: a row a run of the journal."""
        return {"runs": _runs_table(self.reports)}


@with_units
def check_journal(
    journal: "Journal",
    *,
    run: Annotated[Any, In("", whole=True, text=True)] = None,
    head: Sequence[str] = (),
    against: "str | os.PathLike[str] | None" = None,
    progress: Progress | None = None,
) -> JournalCheckResult:
    """Verify each event of a journal against its chain of hashes.

    journal    as for `export`
    run        number, or the beginning of its uuid; None for all
    head       EVENT:HASH from the coordinator's log, that the chain must contain
    against    a copy, compared event by event
    progress   called with (what, done, of how many)

    Raises InputError: unknown journal, run or copy, an invalid head.
    """
    from catseye.coordinator.journal.verdict import chain_verdict
    from catseye.service.journals import checked

    copy = None if against is None else journal_place(against)
    place = journal_place(journal)
    reports, differences = checked(place, run_of(run), tuple(head), copy, progress=progress or (lambda *_: None))
    return JournalCheckResult(chain_verdict(reports), tuple(reports), tuple(differences))


@dataclass(frozen=True, eq=False, repr=False)
class BackupResult(Result):
    """Copy of a journal, verified.

    copy         its file
    size_bytes   its size
    reports      a report a run
    """

    copy: Path
    size_bytes: int
    reports: "tuple[ChainReport, ...]"

    def passages(self) -> "Sequence[Passage]":
        """Size of the copy, and the chain of each run."""
        from catseye.gateways.writers.passage import Passage

        written = Passage("Written to", f"{self.copy}: {self.size_bytes / 1e6:.1f} MB.")
        return [written, *_chain_passages(self.reports)]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye journal backup --json`."""
        from catseye.gateways.journal.chain import chain_object

        runs = [chain_object(report) for report in self.reports]
        return {"verdict": self.verdict.to_object(), "copy": str(self.copy), "bytes": self.size_bytes, "runs": runs}

    def tables(self) -> "dict[str, QTable]":
        """`runs`: a row a run of the journal."""
        return {"runs": _runs_table(self.reports)}


def backup_journal(
    journal: "Journal", copy: "str | os.PathLike[str]", *, progress: Progress | None = None
) -> BackupResult:
    """Copy a journal, also one that is being written, whole or not at all, and verify the copy.

    journal    file, or the reader that `load` returned
    copy       a new file
    progress   called with (what, done, of how many)

    Raises InputError: an unreadable journal, one on a server, an existing file, a full disk.
    """
    from catseye.coordinator.journal.verdict import chain_verdict
    from catseye.service.journals import copied

    where = Path(copy)
    reports = copied(journal_place(journal), where, progress=progress or (lambda *_: None))
    return BackupResult(chain_verdict(reports), where, where.stat().st_size, tuple(reports))


def journal_place(journal: "Journal") -> str:
    """Place of a journal: a path, the example of that name, or a database's address."""
    from catseye.coordinator.journal.reader import JournalReader

    place = journal.place if isinstance(journal, JournalReader) else str(journal)
    return place if place.startswith(DATABASES) else str(place_of(place))


def run_of(run: int | str | None) -> int | str | None:
    """Run as the journal's reader takes it: a number, or the beginning of a uuid."""
    return int(run) if isinstance(run, str) and run.isdecimal() else run


def mjd_argument(name: str, value: float | str) -> float:
    """MJD of an argument that is a time, as text or as a number.

    Raises ArgumentError.
    """
    from catseye.geometry.sky.time_tag import mjd_of

    try:
        mjd = mjd_of(value) if isinstance(value, str) else float(value)
    except CatseyeError as problem:
        raise ArgumentError(f"{name}: {problem}", name) from problem
    if not 0.0 <= mjd < LATEST_MJD:
        raise ArgumentError(f"{name} = {value} (expected an MJD of 0 to {LATEST_MJD:.0f})", name)
    return mjd


def _span(since: float | str | None, until: float | str | None) -> tuple[int, int] | None:
    """First tick of a span and the first after it; None for all."""
    if since is None and until is None:
        return None
    from catseye.records.night.live import TICKS_PER_DAY

    low = 0 if since is None else round(mjd_argument("since", since) * TICKS_PER_DAY)
    high = round(LATEST_MJD) * TICKS_PER_DAY
    if until is not None:
        high = round(mjd_argument("until", until) * TICKS_PER_DAY)
    if not low < high:
        raise InputError(f"the span begins at {since} and ends at {until} (expected a later end)")
    return low, high


def _chain_passages(reports: "Sequence[ChainReport]") -> "list[Passage]":
    from catseye.gateways.journal.chain import chain_words
    from catseye.gateways.writers.passage import Passage

    return [Passage(f"Run {report.run}", text) for report in reports for text in chain_words(report)]


def _runs_table(reports: "Sequence[ChainReport]") -> "QTable":
    return quantities(
        {
            "run": ([report.run for report in reports], ""),
            "uuid": ([report.uuid for report in reports], ""),
            "intact": ([report.intact for report in reports], ""),
            "events": ([report.events for report in reports], ""),
            "problems": ([report.count for report in reports], ""),
            "head": (["" if report.head is None else str(report.head) for report in reports], ""),
        }
    )
