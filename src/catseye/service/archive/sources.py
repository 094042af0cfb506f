"""Sources of an archive as units of work."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from catseye.coordinator.journal.place import SIGNATURE
from catseye.coordinator.journal.reader import JournalReader
from catseye.errors import InputError
from catseye.service.archive.campaigns import archive_campaign
from catseye.service.archive.runs import archive_run
from catseye.service.many.nights import memory_of
from catseye.service.many.unit import Unit

SHOTS = "shots.csv"  # file that a campaign has and a site has not
RUN_MEMORY = 700 * 2**20  # bytes: a run's entries without samples


def archive_units(directory: Path, sources: Sequence[str]) -> list[Unit]:
    """A unit a campaign, and one a run of a journal.

    Raises InputError for a source that is neither, or that lies in the archive.
    """
    units: list[Unit] = []
    names: set[str] = set()
    for source in sources:
        for unit in _units(directory, source):
            name, number = unit.name, 1
            while name in names:
                number += 1
                name = f"{unit.name}-{number}"
            names.add(name)
            units.append(Unit(name=name, work=unit.work, arguments=unit.arguments, memory=unit.memory))
    return units


def _units(directory: Path, source: str) -> Iterator[Unit]:
    path, where = Path(source), str(directory)
    if "://" in source or _is_journal(path):
        with JournalReader(source) as reader:
            for run in reader.runs():
                name = f"{path.name}-run-{run.run}"
                yield Unit(name=name, work=archive_run, arguments=(where, source, run.run), memory=RUN_MEMORY)
        return
    if not (path / SHOTS).is_file():
        state = "is neither a campaign nor a journal" if path.exists() else "missing"
        raise InputError(f"{source}: {state} (expected a folder with {SHOTS}, or a journal)")
    if path.resolve().is_relative_to(directory.resolve()):
        raise InputError(f"{source}: lies in the archive {directory} (expected a campaign outside it)")
    name = path.resolve().name.lstrip(".") or "night"
    yield Unit(name=name, work=archive_campaign, arguments=(where, str(path.resolve())), memory=memory_of(path))


def _is_journal(path: Path) -> bool:
    try:
        with path.open("rb") as stream:
            return stream.read(len(SIGNATURE)) == SIGNATURE
    except OSError:
        return False
