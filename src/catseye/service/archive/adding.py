"""Sources into an archive, by many processes, under the archive's lock."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from catseye.aliases import Progress
from catseye.service.many.unit import UnitOutcome


@dataclass(frozen=True)
class ArchiveChange:
    """Change of an archive: nights added, removed, replaced, joined.

    outcomes   of each campaign and each run of a journal
    removed    identifiers of nights that were removed
    replaced   identifiers of earlier states of journals' runs, replaced by later ones
    joined     years whose tables were joined
    """

    outcomes: tuple[UnitOutcome, ...]
    removed: tuple[str, ...]
    replaced: tuple[str, ...]
    joined: tuple[int, ...]


NO_CHANGE = ArchiveChange((), (), (), ())


def change_archive(
    directory: Path,
    sources: Sequence[str],
    *,
    remove: Sequence[str],
    compact: bool,
    processes: int | None,
    cluster: str | None,
    progress: Progress | None,
) -> ArchiveChange:
    """Add nights to an archive, remove some, join tables; each night is in it whole or not at all.

    directory   of the archive; new or empty where there are sources

    Raises InputError: a missing package or an invalid source, before anything is written; another process that writes
    to the archive; a night to be removed that is not there; a full disk.
    """
    from catseye.gateways.archive.files import create_archive, sole_writer
    from catseye.gateways.archive.joining import drop_nights, join_years, superseded
    from catseye.records.archive.parquet import PACKAGES, scale_module
    from catseye.records.archive.reading import open_archive, refuse_foreign
    from catseye.service.archive.sources import archive_units
    from catseye.service.many.run import run_many

    for package in PACKAGES:
        scale_module(package)
    units = archive_units(directory, sources)
    if units:
        create_archive(directory)
    refuse_foreign(directory)
    with sole_writer(directory):
        removed = drop_nights(directory, remove) if remove else ()
        outcomes = run_many(units, processes=processes, cluster=cluster, progress=progress, task="archiving nights")
        earlier = superseded(open_archive(directory))
        replaced = drop_nights(directory, earlier) if earlier else ()
        joined = tuple(join_years(directory, progress=progress)) if compact else ()
    return ArchiveChange(tuple(outcomes), removed, replaced, joined)
