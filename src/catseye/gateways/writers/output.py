"""An output directory that appears whole or not at all."""

import json
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from catseye.errors import InputError
from catseye.gateways.writers.interruption import Unfinished, deferred, undone_when_interrupted

PROVENANCE = "provenance.json"
PAGES = (".html", ".htm")
FORMAT = "catseye-reduction-1"  # marks a directory as ours, so that it may be replaced; as do the next
FORMATS = (
    FORMAT,
    "catseye-adjustment-1",
    "catseye-comparison-1",
    "catseye-plan-1",
    "catseye-baseline-1",
    "catseye-calibration-1",
    "catseye-acoustic-1",
    "catseye-refractometer-1",
    "catseye-beam-1",
    "catseye-journal-export-1",
    "catseye-surface-1",
    "catseye-pose-1",
    "catseye-pointing-1",
    "catseye-track-profile-1",
    "catseye-structure-1",
    "catseye-panels-1",
    "catseye-result-1",
)


def refuse_output(out: Path, *read: Path) -> Path:
    """The directory that `out` stands for, links resolved, when it can be made or replaced; or InputError.

    out    as the user wrote it; missing, empty, or an earlier output of catseye and of nobody else
    read   the directories and files that are read, which must be neither in it nor around it
    """
    where = out.resolve()
    here = Path.cwd().resolve()
    if where == here or where in here.parents:
        raise InputError(f"--out {out}: is the current directory or holds it (expected a directory of its own)")
    for each in read:
        source = each.resolve()
        if where == source or where in source.parents or source in where.parents:
            raise InputError(f"--out {out}: is, holds or lies in the input {each} (expected a place outside it)")
    if not where.parent.is_dir():
        raise InputError(f"--out {out}: {out.parent} is not a directory (expected an existing one)")
    if not os.access(where.parent, os.W_OK | os.X_OK):
        raise InputError(f"--out {out}: {out.parent} cannot be written to (expected one with permission)")
    if where.exists():
        if not where.is_dir():
            raise InputError(f"--out {out}: exists and is not a directory (expected a new or an empty one)")
        _refuse_strangers(out, where)
    return where


def _refuse_strangers(out: Path, where: Path) -> None:
    """Nothing is replaced but what catseye wrote itself."""
    names = sorted(entry.name for entry in where.iterdir())
    if not names:
        return
    known = {PROVENANCE, *_written(where)}
    strangers = [name for name in names if name not in known] if len(known) > 1 else names
    if strangers:
        more = f" and {len(strangers) - 1} more" if len(strangers) > 1 else ""
        raise InputError(
            f"--out {out}: holds {strangers[0]!r}{more}, which catseye did not write (expected a new or an empty one)"
        )


def _written(where: Path) -> set[str]:
    """The files that a directory's provenance says catseye wrote there; none without our mark."""
    try:
        provenance: Any = json.loads((where / PROVENANCE).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return set()
    if not isinstance(provenance, dict) or provenance.get("format") not in FORMATS:
        return set()
    outputs = provenance.get("outputs")
    return set(outputs) if isinstance(outputs, dict) else set()


@contextmanager
def whole_directory(out: Path, *read: Path) -> Iterator[Path]:
    """A directory to write into, which takes the place of `out` when the block ends well and vanishes otherwise.

    It is a neighbour of `out`, so that putting it in place is a rename.
    """
    where = refuse_output(out, *read)
    fresh = where.parent / f".catseye-{secrets.token_hex(6)}"
    old = where.parent / f".catseye-{secrets.token_hex(6)}"
    undo = Unfinished(str(fresh), str(where), str(old))
    with undone_when_interrupted(undo):
        try:
            fresh.mkdir()
            yield fresh
            refuse_output(out, *read)
            with deferred():
                _replace(where, fresh, old)
        except OSError as problem:
            raise InputError(f"--out {out}: cannot be written: {problem.strerror or problem}") from problem
        finally:
            undo()


@contextmanager
def new_directory(directory: Path) -> Iterator[Path]:
    """A directory to write into, which becomes a new one, or takes an empty one's place, when the block ends well.

    Raises InputError where it holds something or something cannot be written, with the file's name in it.
    """
    where = directory.resolve()
    if where.exists() and (not where.is_dir() or any(where.iterdir())):
        raise InputError(f"{directory}: exists and is not an empty directory (expected a new or an empty one)")
    fresh = where.parent / f".catseye-{secrets.token_hex(6)}"
    undo = Unfinished(str(fresh))
    with undone_when_interrupted(undo):
        try:
            where.parent.mkdir(parents=True, exist_ok=True)
            fresh.mkdir()
            yield fresh
            with deferred():
                if where.exists():
                    where.rmdir()
                os.rename(fresh, where)
        except OSError as problem:
            file = Path(problem.filename or fresh)
            inside = file.relative_to(fresh) if file.is_relative_to(fresh) else Path()
            raise InputError(f"{directory / inside}: cannot be written: {problem.strerror or problem}") from problem
        finally:
            undo()


def _replace(where: Path, fresh: Path, old: Path) -> None:
    """Two renames: the old tree aside, the new one in its place; when the second fails the first is taken back."""
    if not where.exists():
        os.rename(fresh, where)
        return
    os.rename(where, old)
    try:
        os.rename(fresh, where)
    except OSError:
        os.rename(old, where)
        raise


@contextmanager
def whole_file(path: Path, option: str, mark: str) -> Iterator[list[str]]:
    """A text file that appears whole or not at all: what the block puts into the list.

    path     as the user wrote it: new, or an earlier file of catseye, one that holds `mark` in its first 4096 bytes
    option   that named it, for messages
    mark     text that tells our files from others', such as format = "catseye-baseline-1"

    Raises InputError where another's file would be lost or nothing can be written.
    """
    where = path.resolve()
    fresh = where.parent / f".catseye-{secrets.token_hex(6)}"
    pieces: list[str] = []
    with undone_when_interrupted(Unfinished(str(fresh))):
        try:
            if where.is_dir():
                raise InputError(f"{option} {path}: is a directory (expected the name of a file)")
            if where.exists():
                with where.open("rb") as stream:
                    if mark.encode() not in stream.read(4096):
                        raise InputError(f"{option} {path}: exists and is not catseye's (expected a new name)")
            yield pieces
            fresh.write_text("".join(pieces), encoding="utf-8")
            with deferred():
                os.replace(fresh, where)
        except OSError as problem:
            raise InputError(f"{option} {path}: cannot be written: {problem.strerror or problem}") from problem
        finally:
            fresh.unlink(missing_ok=True)


def refuse_suffix(path: Path, option: str) -> None:
    """InputError for the name of a page that says another format than HTML."""
    suffix = path.suffix.lower()
    if suffix not in PAGES and not path.is_dir():
        hint = "; a browser prints a page as PDF" if suffix == ".pdf" else ""
        raise InputError(f"{option} {path}: a page is HTML (expected a name that ends in .html{hint})")


def write_whole(path: Path, content: bytes, *, option: str, ours: Callable[[bytes], bool]) -> None:
    """A file that appears whole or not at all.

    path      new, or an earlier file of catseye
    content   all of it
    option    that named the file, for messages
    ours      whether what stands there is catseye's

    Raises InputError where another's file would be lost, and where nothing can be written.
    """
    where = path.resolve()
    fresh = where.parent / f".catseye-{secrets.token_hex(6)}"
    with undone_when_interrupted(Unfinished(str(fresh))):
        try:
            if where.is_dir():
                raise InputError(f"{option} {path}: is a directory (expected the name of a file)")
            if where.exists() and not ours(where.read_bytes()):
                raise InputError(f"{option} {path}: exists and is not catseye's (expected a new name)")
            fresh.write_bytes(content)
            with deferred():
                os.replace(fresh, where)
        except OSError as problem:
            raise InputError(f"{option} {path}: cannot be written: {problem.strerror or problem}") from problem
        finally:
            fresh.unlink(missing_ok=True)
