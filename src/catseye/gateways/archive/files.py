"""Files of an archive, each written whole: a temporary neighbour, flushed to the disk, renamed."""

import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hashlib import file_digest
from pathlib import Path, PurePosixPath

from catseye.errors import InputError
from catseye.interruption import Unfinished, deferred, undo_on_interruption
from catseye.records.archive.index import ArchivedFile
from catseye.records.archive.layout import FORMAT, HEAD, INDEX, LOCK
from catseye.records.archive.parquet import footer_sha256
from catseye.records.archive.reading import refuse_foreign
from catseye.version import __version__

TEMPORARY = ".catseye-"  # begins the name of a file that is being written


def create_archive(directory: Path) -> None:
    """Make a new archive in a missing or empty directory; an existing archive stays as it is.

    Raises InputError: a directory with other files, an archive of another version.
    """
    if directory.is_dir() and any(directory.iterdir()):
        if not (directory / HEAD).exists():
            raise InputError(f"{directory}: holds files and is no archive (expected an archive, or a new directory)")
        refuse_foreign(directory)
        (directory / INDEX).mkdir(exist_ok=True)
        return
    try:
        (directory / INDEX).mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InputError(f"{directory}: cannot be written: {problem.strerror or problem}") from problem
    head = f'format = "{FORMAT}"\ncatseye = "{__version__}"  # that made it\n'
    write_text(directory, PurePosixPath(HEAD), head)


@contextmanager
def sole_writer(directory: Path) -> Iterator[None]:
    """Hold the archive's lock in the block, which ends with the process however it ends.

    Raises InputError where another process holds it.
    """
    import fcntl

    with (directory / LOCK).open("a+", encoding="ascii") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as problem:
            lock.seek(0)
            raise InputError(
                f"{directory}: process {lock.read().strip() or 'unknown'} is writing to it (expected one at a time; "
                "wait until it has ended)"
            ) from problem
        lock.truncate(0)
        lock.write(f"{os.getpid()}\n")
        lock.flush()
        _sweep(directory)
        yield


def write_file(
    directory: Path, path: PurePosixPath, write: Callable[[Path], object], *, kind: str = "", rows: int = 0
) -> ArchivedFile:
    """Write a file of the archive whole, over an earlier one.

    path    relative to the archive
    write   called with the path of a temporary neighbour

    Raises InputError: a full disk, a directory that cannot be written.
    """
    where = directory / path
    fresh = where.parent / f"{TEMPORARY}{secrets.token_hex(6)}"
    with undo_on_interruption(Unfinished(str(fresh))):
        try:
            where.parent.mkdir(parents=True, exist_ok=True)
            write(fresh)
            with fresh.open("rb+") as stream:
                digest = file_digest(stream, "sha256").hexdigest()
                os.fsync(stream.fileno())
            size, footer = fresh.stat().st_size, footer_sha256(fresh) if where.suffix == ".parquet" else ""
            with deferred():
                os.replace(fresh, where)
            _flush_folder(where.parent)
        except OSError as problem:
            raise InputError(f"{where}: cannot be written: {problem.strerror or problem}") from problem
        finally:
            fresh.unlink(missing_ok=True)
    return ArchivedFile(str(path), kind, size, digest, footer, rows)


def write_text(directory: Path, path: PurePosixPath, text: str, *, kind: str = "") -> ArchivedFile:
    """Write a text of the archive whole; arguments as for `write_file`."""
    return write_file(directory, path, lambda fresh: fresh.write_text(text, encoding="utf-8"), kind=kind)


def _flush_folder(folder: Path) -> None:
    """Make a rename in a folder last through a loss of power."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # some file systems cannot
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sweep(directory: Path) -> None:
    """Remove temporary files of a process that was killed."""
    for path in list(directory.rglob(f"{TEMPORARY}*")):
        Unfinished(str(path))()
