"""`archive` and `restore`: years of nights in one place, and one of them as it was."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from catseye.aliases import Progress
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    import numpy as np
    from astropy.table import QTable

    from catseye.gateways.writers.passage import Passage
    from catseye.records.archive.reading import ArchiveFolder
    from catseye.records.archive.verification import ArchiveCheck
    from catseye.service.archive.adding import ArchiveChange
    from catseye.service.many.unit import UnitOutcome
    from catseye.verdict import Verdict


@dataclass(frozen=True, eq=False, repr=False)
class ArchiveResult(Result):
    """An archive after what was done to it.

    directory   of the archive
    archive     its index: nights, years, files
    change      what was added, removed and joined
    sizes       bytes of its files, by kind
    raw_bytes   of the inputs of all nights before compression
    check       verification of every file; None if not asked for
    """

    directory: Path
    archive: "ArchiveFolder"
    change: "ArchiveChange"
    sizes: dict[str, int]
    raw_bytes: int
    check: "ArchiveCheck | None"

    @property
    def nights(self) -> tuple[str, ...]:
        """Identifiers of the nights, in order of time."""
        return self.archive.nights

    @property
    def outcomes(self) -> "tuple[UnitOutcome, ...]":
        """Outcomes of the sources, in order: `value` has "night", the identifier, and "added", False if present."""
        return self.change.outcomes

    @property
    def intact(self) -> bool:
        """False if a source failed or the verification named a damaged file."""
        return self.verdict.word != "failed"

    @with_units
    def table(
        self,
        kind: str,
        columns: Sequence[str] | None = None,
        *,
        where: Annotated[Any, In("name")] = None,
        since: Annotated[Any, In("mjd", one=True)] = None,
        until: Annotated[Any, In("mjd", one=True)] = None,
    ) -> "QTable":
        """Columns of a table over all nights, sorted by its first column and `mjd`.

        kind           "nights", "points", "poses", "zeros", "weather", "residuals" or "certificates"
        columns        names; None for all
        where          value or tuple of values that a column must equal, by column
        since, until   MJD, the last excluded; None for no limit

        Raises InputError: an unknown table or column, a damaged file, which it names.
        """
        from catseye.records.archive.layout import table_layout
        from catseye.records.archive.reading import read_table

        layout = table_layout(kind)
        rows = read_table(self.archive, kind, columns, where=where, since=since, until=until)
        return quantities({name: (values, layout.field(name).unit) for name, values in rows.items()})

    @with_units
    def samples(self, night: str, rows: Annotated[Any, In("", many=True)] = None) -> "np.ndarray":
        """Samples of a night, (shots, samples) int16, bit for bit.

        night   identifier, or a beginning that only one has
        rows    of the campaign's frames.npy; None for all
        """
        from catseye.records.archive.samples import read_samples

        return read_samples(self.archive, night, rows)

    def passages(self) -> "Sequence[Passage]":
        """Nights, size, what was added, failed, removed, and the verification."""
        from catseye.gateways.archive.passages import change_passages, check_passages, size_passages

        checked = [] if self.check is None else check_passages(self.check)
        sizes = size_passages(self.directory, len(self.nights), self.archive.years, self.sizes, self.raw_bytes)
        change = self.change
        return [*sizes, *change_passages(change.outcomes, change.removed, change.replaced, change.joined), *checked]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye archive --json`."""
        check = self.check
        sources = [{"name": o.name, "state": o.state, "why": o.why, **(o.value or {})} for o in self.outcomes]
        return {
            "verdict": self.verdict.to_object(),
            "archive": str(self.directory),
            "nights": list(self.nights),
            "years": list(self.archive.years),
            "bytes": self.sizes,
            "raw_bytes": self.raw_bytes,
            "sources": sources,
            "removed": list(self.change.removed),
            "replaced": list(self.change.replaced),
            "joined_years": list(self.change.joined),
            "check": None
            if check is None
            else {
                "files": check.files,
                "bytes": check.size,
                "problems": list(check.problems),
                "not_in_index": list(check.strangers),
            },
        }

    def tables(self) -> "dict[str, QTable]":
        """`nights`: a row a night; `sources`: a row a source of this call."""
        outcomes = self.outcomes
        sources = {
            "source": ([outcome.name for outcome in outcomes], ""),
            "state": ([outcome.state for outcome in outcomes], ""),
            "why": ([outcome.why for outcome in outcomes], ""),
            "night": ([(outcome.value or {}).get("night", "") for outcome in outcomes], ""),
            "added": ([bool((outcome.value or {}).get("added")) for outcome in outcomes], ""),
            "seconds": ([outcome.seconds for outcome in outcomes], "s"),
        }
        return {"nights": self.table("nights"), "sources": quantities(sources)}

    def sources(self) -> tuple[Path, ...]:
        """Directory of the archive."""
        return (self.directory,)


@with_units
def archive(
    directory: "str | os.PathLike[str]",
    sources: "Sequence[str | os.PathLike[str]] | str | os.PathLike[str]" = (),
    *,
    check: bool = False,
    compact: bool = False,
    remove: Sequence[str] = (),
    processes: Annotated[Any, In("", whole=True)] = None,
    cluster: str | None = None,
    progress: Progress | None = None,
) -> ArchiveResult:
    """An archive of nights, after campaigns and journals were added to it.

    directory   of the archive; made where there are sources
    sources     campaigns, which are reduced, and journals, whose epochs are archived as stored
    check       True to hold every file against its SHA-256
    compact     True to join the tables of each year to one file a kind: series over the year come quicker
    remove      identifiers of nights to remove, or beginnings that only one has
    processes   of one thread each; None: as many as cores are free and memory allows
    cluster     "local" or a dask scheduler's address or file; None: processes of this machine
    progress    called with (what, done, of how many)

    A night that is there already stays as it is. A source that cannot be archived is a failed outcome and does not stop
    the others. Raises InputError: no archive and no sources, an invalid source, an archive that another process writes
    to, a damaged index unless it is to be checked.
    """
    from catseye.api.reading import place_of
    from catseye.records.archive.reading import read_index, refuse_foreign
    from catseye.records.archive.verification import archive_files, verify_archive
    from catseye.service.archive.adding import NO_CHANGE, change_archive

    listed = [sources] if isinstance(sources, str | os.PathLike) else list(sources)
    where, change = Path(directory), NO_CHANGE
    places = [item if "://" in item else str(place_of(item)) for item in map(str, listed)]
    if isinstance(remove, str):
        raise ArgumentError(f"remove = {remove!r} (expected a list of identifiers)", "remove")
    if places or compact or remove:
        change = change_archive(
            where, places, remove=remove, compact=compact, processes=processes, cluster=cluster, progress=progress
        )
    refuse_foreign(where)
    checked = verify_archive(where, progress) if check else None
    folder, problems = read_index(where)
    if problems and checked is None:
        raise problems[0]
    sizes: dict[str, int] = {}
    for file in archive_files(folder):
        sizes[file.kind] = sizes.get(file.kind, 0) + file.size
    damage = () if checked is None else checked.problems
    return ArchiveResult(
        verdict=_verdict(change.outcomes, damage, len(folder.nights)),
        directory=where,
        archive=folder,
        change=change,
        sizes=sizes,
        raw_bytes=0 if damage else _raw_bytes(folder),
        check=checked,
    )


@dataclass(frozen=True, eq=False, repr=False)
class RestoreResult(Result):
    """A night that came back from an archive.

    night       identifier
    directory   of the campaign
    files       number of files written
    size        bytes of them
    """

    night: str
    directory: Path
    files: int
    size: int

    def passages(self) -> "Sequence[Passage]":
        """Place and size of the campaign."""
        from catseye.gateways.archive.passages import megabytes
        from catseye.gateways.writers.passage import Passage

        text = f"{self.directory}/: night {self.night}, {self.files} files, {megabytes(self.size)}."
        return [Passage("Written to", text)]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye restore --json`."""
        return {
            "verdict": self.verdict.to_object(),
            "night": self.night,
            "out": str(self.directory),
            "files": self.files,
            "bytes": self.size,
        }

    def tables(self) -> "dict[str, QTable]":
        """`night`: a row with its files and bytes."""
        row = {"night": ([self.night], ""), "files": ([self.files], ""), "size": ([self.size], "byte")}
        return {"night": quantities(row)}


def restore(archive: "str | os.PathLike[str]", night: str, directory: "str | os.PathLike[str]") -> RestoreResult:
    """Campaign of an archived night as it was, byte for byte; of a journal's run, as `export` writes it.

    archive     directory
    night       identifier, or a beginning that only one has
    directory   new, or empty

    Raises InputError: an unknown night, a damaged file, which it names, a directory that holds something.
    """
    from catseye.gateways.archive.restored import write_restored
    from catseye.records.archive.reading import open_archive
    from catseye.verdict import Verdict

    where = Path(directory)
    provenance = write_restored(open_archive(Path(archive)), night, where)
    return RestoreResult(
        verdict=Verdict("good", "every file equals what was archived, by its SHA-256"),
        night=provenance.night,
        directory=where,
        files=len(provenance.inputs),
        size=sum(file.size for file in provenance.inputs),
    )


def _verdict(outcomes: "Sequence[UnitOutcome]", damage: Sequence[str], nights: int) -> "Verdict":
    """Verdict on an archive: damage, sources that failed, nights without a result, or none of them."""
    from catseye.verdict import Verdict

    failed = [outcome for outcome in outcomes if outcome.state == "failed"]
    if damage:
        return Verdict("failed", f"{len(damage)} of its files damaged: {damage[0]}")
    if failed:
        return Verdict("failed", f"{len(failed)} of {len(outcomes)} sources failed: {failed[0].name}: {failed[0].why}")
    if not nights:
        return Verdict("doubtful", "there is no night in it")
    empty = [item for item in outcomes if ((item.value or {}).get("result") or {}).get("word") == "failed"]
    if empty:
        why = (empty[0].value or {})["result"]["why"]
        return Verdict("doubtful", f"{empty[0].name} was archived with a failed result: {why}")
    return Verdict("good", "every source is in it" if outcomes else "its index is intact")


def _raw_bytes(folder: "ArchiveFolder") -> int:
    from catseye.records.archive.reading import read_table

    return int(read_table(folder, "nights", ["raw_bytes"])["raw_bytes"].sum())
