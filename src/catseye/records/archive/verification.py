"""Verification of an archive: every file against the SHA-256 in the index, and samples against their checksums."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from catseye.aliases import Progress
from catseye.errors import InputError
from catseye.records.archive.index import ArchivedFile
from catseye.records.archive.layout import HEAD, INDEX, LOCK
from catseye.records.archive.reading import ArchiveFolder, read_index, refuse_damaged


@dataclass(frozen=True)
class ArchiveCheck:
    """Result of the verification of an archive.

    files       number of files that the index names
    size        bytes of them
    problems    a line for each damaged or missing file, which it names
    strangers   files of the archive's folders that the index does not name, relative to the archive
    """

    files: int
    size: int
    problems: tuple[str, ...]
    strangers: tuple[str, ...]


def verify_archive(directory: Path, progress: Progress | None = None) -> ArchiveCheck:
    """Verification of all files of an archive.

    Raises InputError where the directory is no archive.
    """
    archive, broken = read_index(directory)
    problems = [str(problem) for problem in broken]
    files = list(archive_files(archive))
    for number, file in enumerate(files):
        if progress is not None:
            progress("checking", number, len(files))
        try:
            refuse_damaged(directory, file)
        except InputError as problem:
            problems.append(str(problem))
    named = {file.path for file in files}
    return ArchiveCheck(
        files=len(files),
        size=sum(file.size for file in files),
        problems=tuple(problems),
        strangers=tuple(path for path in _below(directory) if path not in named),
    )


def archive_files(archive: ArchiveFolder) -> Iterator[ArchivedFile]:
    """All files that the index names: of the nights, and of joined years."""
    for entry in archive.entries.values():
        yield from entry.files
    for year in archive.joined.values():
        yield from year.files


def _below(directory: Path) -> list[str]:
    """Files of an archive but for its head, lock and index."""
    paths = (path.relative_to(directory) for path in directory.rglob("*") if path.is_file())
    return sorted(path.as_posix() for path in paths if path.parts[0] not in (HEAD, LOCK, INDEX))
