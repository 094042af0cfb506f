"""Ledger of a run: a file a unit, written whole after its work, by which an interrupted run goes on."""

import errno
import fcntl
import hashlib
import json
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from catseye.errors import InputError
from catseye.service.many.unit import Unit, UnitOutcome

FORMAT = "catseye-ledger-1"
MARK = "ledger.json"  # file by which a worker recognises the folder, and which one run at a time locks
SETTLED = 2.0  # s that a file is older than its hash: then size and time say that it is the same
PIECE = 2**20  # bytes read at once
TEMPORARY = re.compile(r"\.catseye-[0-9a-f]{12}")  # names of unfinished output

Files = dict[str, tuple[int, int, str]]  # path -> size, time of change in ns, SHA-256


@contextmanager
def opened(ledger: Path | None) -> Iterator[None]:
    """Make the folder of a ledger, and hold it against a second run.

    Raises InputError where it cannot be made or a run holds it.
    """
    if ledger is None:
        yield
        return
    try:
        ledger.mkdir(parents=True, exist_ok=True)
        if not (ledger / MARK).exists():
            write_whole(ledger / MARK, json.dumps({"format": FORMAT}).encode() + b"\n")
        stream = (ledger / MARK).open("rb")
    except OSError as problem:
        raise InputError(f"{ledger}: cannot be written: {problem.strerror or problem}") from problem
    with stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{ledger}: another run writes there (wait for its end, or take another folder)") from None
        except OSError as problem:
            if problem.errno not in (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS):  # a file system without locks
                raise
        yield


def is_ledger(folder: Path) -> bool:
    """True for the folder of a ledger."""
    try:
        mark = json.loads((folder / MARK).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(mark, dict) and mark.get("format") == FORMAT


def remove(folder: Path) -> None:
    """Remove a ledger whose run is over; nothing that is no ledger."""
    if is_ledger(folder):
        shutil.rmtree(folder, ignore_errors=True)


def content_of(inputs: Sequence[Path], earlier: Files | None = None, hashed: float = 0.0) -> Files:
    """Size, time and SHA-256 of each input file; of a folder's, each beneath it; none of a missing one.

    earlier   of the same inputs, hashed at a time, s since 1970: a file of that size and time is not read again
    """
    files: Files = {}
    for path in inputs:
        for file in _files_of(path):
            state = file.stat()
            entry_of_file = (earlier or {}).get(str(file))
            old = state.st_mtime + SETTLED < hashed
            if entry_of_file is not None and old and entry_of_file[:2] == (state.st_size, state.st_mtime_ns):
                files[str(file)] = entry_of_file
            else:
                files[str(file)] = (state.st_size, state.st_mtime_ns, _digest(file))
    return files


def write_entry(
    ledger: Path, unit: Unit, value: dict[str, Any], *, seconds: float, files: Files, hashed: float
) -> None:
    """Write the entry of a unit that is done.

    files, hashed   of its inputs, and when they were read, s since 1970
    """
    body = {
        "format": FORMAT,
        "name": unit.name,
        "key": unit.key,
        "inputs": files,
        "hashed": hashed,
        "output": None if unit.output is None else _sizes(unit.output),
        "seconds": seconds,
        "value": value,
    }
    write_whole(_entry_file(ledger, unit), _page(body))


def read_entry(ledger: Path, unit: Unit) -> UnitOutcome | None:
    """Outcome of a unit in an earlier run.

    None without one: missing, damaged, of other inputs or options, or its output is not what it wrote.
    """
    try:
        raw = _entry_file(ledger, unit).read_bytes()
        entry = json.loads(raw)["entry"]
        if raw != _page(entry):
            return None
        if (entry["format"], entry["name"], entry["key"]) != (FORMAT, unit.name, unit.key):
            return None
        earlier: Files = {file: tuple(entry_of_file) for file, entry_of_file in entry["inputs"].items()}
        files = content_of(unit.inputs, earlier, entry["hashed"])
        if {file: entry_of_file[2] for file, entry_of_file in files.items()} != {
            file: entry_of_file[2] for file, entry_of_file in earlier.items()
        }:
            return None
        if unit.output is not None and _sizes(unit.output) != entry["output"]:
            return None
        return UnitOutcome(unit.name, "resumed", "", entry["value"], entry["seconds"])
    except (OSError, ValueError, RecursionError, KeyError, TypeError, AttributeError):
        return None


def write_whole(path: Path, content: bytes) -> None:
    """Write a file through a temporary neighbour, on the disk before it has its name."""
    fresh = path.parent / f".catseye-{secrets.token_hex(6)}"
    try:
        with fresh.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(fresh, path)
    finally:
        fresh.unlink(missing_ok=True)
    with suppress(OSError):  # a file system whose folders cannot be synchronised
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def clear_unfinished(places: Sequence[Path]) -> None:
    """Remove unfinished output of processes that were killed; no unit of these places may run."""
    for place in places:
        with suppress(OSError):
            for entry in list(place.iterdir()):
                if not TEMPORARY.fullmatch(entry.name):
                    continue
                if entry.is_dir() and not entry.is_symlink():
                    shutil.rmtree(entry, ignore_errors=True)
                else:
                    entry.unlink(missing_ok=True)


def now() -> float:
    """Time, s since 1970, as files have it."""
    return time.time()


def _page(entry: dict[str, Any]) -> bytes:
    """Content of an entry's file, with the SHA-256 of the entry's text."""
    digest = hashlib.sha256(json.dumps(entry).encode()).hexdigest()
    return json.dumps({"sha256": digest, "entry": entry}).encode() + b"\n"


def _entry_file(ledger: Path, unit: Unit) -> Path:
    return ledger / f"{unit.name}.json"


def _sizes(folder: Path) -> dict[str, int]:
    """Size of each file beneath a folder, bytes."""
    return {str(file.relative_to(folder)): file.stat().st_size for file in _files_of(folder)}


def _files_of(path: Path) -> list[Path]:
    """The file, or all files beneath a folder, in the order of their names."""
    return [path] if path.is_file() else sorted(file for file in path.rglob("*") if file.is_file())


def _digest(file: Path) -> str:
    digest = hashlib.sha256()
    with file.open("rb") as stream:
        while piece := stream.read(PIECE):
            digest.update(piece)
    return digest.hexdigest()
