"""A night of an archive as the campaign that it was."""

from collections.abc import Iterator
from pathlib import Path

from catseye.gateways.writers.output import new_directory
from catseye.records.archive.inputs import restore_inputs
from catseye.records.archive.provenance import NightProvenance
from catseye.records.archive.reading import ArchiveFolder

FOLDERS = ("mirrors", "monuments", "triplets")  # of a campaign, even if empty


def write_restored(archive: ArchiveFolder, night: str, directory: Path) -> NightProvenance:
    """Write a night's files as they were, whole or not at all.

    directory   new, or empty

    Raises InputError: an unknown night, a damaged file, a directory that holds something.
    """
    archive.entry(night)
    with new_directory(directory) as fresh:

        def write(name: str, pieces: Iterator[bytes]) -> None:
            where = fresh / name
            where.parent.mkdir(parents=True, exist_ok=True)
            with where.open("xb") as stream:
                for piece in pieces:
                    stream.write(piece)

        provenance = restore_inputs(archive, night, write)
        for name in FOLDERS:
            (fresh / name).mkdir(exist_ok=True)
    return provenance
