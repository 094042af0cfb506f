"""Tables of a year's nights joined to one file a kind, sorted by point, ranger or station."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path

from catseye.aliases import Progress
from catseye.gateways.archive.files import write_file, write_text
from catseye.gateways.archive.tables import write_arrow
from catseye.records.archive.index import ArchivedNight, JoinedYear, entry_text, joined_path, night_path
from catseye.records.archive.layout import JOINED, TABLES, year_folder
from catseye.records.archive.reading import ArchiveFolder, open_archive, rows_of_nights


def join_years(directory: Path, *, progress: Progress | None = None) -> list[int]:
    """Join the tables of each year that has nights with tables of their own; the years that were joined.

    The joined files are in the index before the nights' own are removed, so that an interruption loses nothing.

    Raises InputError: a damaged file, which stays as it is, and so does its year; a full disk.
    """
    archive = open_archive(directory)
    years = [year for year in archive.years if _separate(archive, year)]
    for number, year in enumerate(years):
        if progress is not None:
            progress(f"joining the tables of {year}", number, len(years))
        _join(archive, year, {name: entry for name, entry in archive.entries.items() if entry.year == year})
    tidy(open_archive(directory))
    return years


def _separate(archive: ArchiveFolder, year: int) -> list[str]:
    """Nights of a year that have tables of their own."""
    joined = archive.joined.get(year)
    nights = [name for name, entry in archive.entries.items() if entry.year == year]
    return [name for name in nights if joined is None or name not in joined.nights]


def _join(archive: ArchiveFolder, year: int, nights: Mapping[str, ArchivedNight]) -> None:
    """Write the joined files of some nights and their entry in the index."""
    mark = sha256("\n".join(sorted(nights)).encode()).hexdigest()[:8]
    files = []
    for kind in TABLES:
        rows = rows_of_nights(archive, kind, nights)
        if rows is not None:
            path = year_folder(kind, year) / f"{JOINED}-{mark}.parquet"
            write = partial(write_arrow, kind=kind, table=rows)
            files.append(write_file(archive.directory, path, write, kind=kind, rows=rows.num_rows))
    bare = {
        name: replace(entry, files=tuple(file for file in entry.files if file.kind not in TABLES))
        for name, entry in nights.items()
    }
    write_text(archive.directory, joined_path(year), entry_text(JoinedYear(year, bare, tuple(files))))


def drop_nights(directory: Path, nights: Iterable[str]) -> tuple[str, ...]:
    """Remove nights from an archive; their identifiers.

    nights   identifiers, or beginnings that only one has

    The index lacks them before their files are removed. Raises InputError for an unknown night.
    """
    archive = open_archive(directory)
    dropped = {entry.night: entry for entry in map(archive.entry, nights)}
    for year, joined in archive.joined.items():
        left = {name: entry for name, entry in joined.nights.items() if name not in dropped}
        if left and len(left) < len(joined.nights):
            _join(archive, year, left)
        elif not left:
            (directory / joined_path(year)).unlink()
            for file in joined.files:
                (directory / file.path).unlink(missing_ok=True)
    for name, entry in dropped.items():
        (directory / night_path(name)).unlink(missing_ok=True)
        for file in entry.files:
            (directory / file.path).unlink(missing_ok=True)
    tidy(open_archive(directory))
    return tuple(dropped)


def superseded(archive: ArchiveFolder) -> list[str]:
    """Nights that hold an earlier state of a journal's run of which a later one is in the archive, too."""
    latest: dict[str, str] = {}
    for name, entry in archive.entries.items():
        held = latest.get(entry.origin)
        if entry.origin and (held is None or archive.entries[held].last <= entry.last):
            latest[entry.origin] = name
    return [name for name, entry in archive.entries.items() if entry.origin and latest[entry.origin] != name]


def tidy(archive: ArchiveFolder) -> None:
    """Remove what a joined year replaces: its nights' own entries and tables, and earlier joined files."""
    for year, joined in archive.joined.items():
        current = {archive.directory / file.path for file in joined.files}
        for kind in TABLES:
            folder = archive.directory / year_folder(kind, year)
            for path in folder.glob("*.parquet"):
                if path not in current and (path.stem in joined.nights or path.stem.startswith(f"{JOINED}-")):
                    path.unlink(missing_ok=True)
        for name in joined.nights:
            (archive.directory / night_path(name)).unlink(missing_ok=True)
