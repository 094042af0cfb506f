"""Output directories and files, written atomically."""

import json
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from catseye.errors import InputError
from catseye.interruption import Unfinished, deferred, undo_on_interruption

PROVENANCE = "provenance.json"
PAGES = (".html", ".htm")
PDF = b"%PDF"  # first bytes of one
FORMAT = "catseye-reduction-1"  # identifies a directory of catseye, which may be replaced; so do the next
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
    "catseye-budget-1",
    "catseye-pose-1",
    "catseye-pointing-1",
    "catseye-track-profile-1",
    "catseye-structure-1",
    "catseye-panels-1",
    "catseye-result-1",
    "catseye-acoustic-field-1",
    "catseye-detection-1",
    "catseye-model-1",
    "catseye-movements-1",
    "catseye-path-1",
    "catseye-positions-1",
    "catseye-weather-series-1",
    "catseye-scan-fit-1",
    "catseye-scan-compare-1",
    "catseye-scan-search-1",
    "catseye-servo-identify-1",
    "catseye-design-study-1",
    "catseye-query-1",
    "catseye-trends-1",
)


def refuse_output(out: Path, *read: Path) -> Path:
    """Output directory with links resolved; InputError if it cannot be made or replaced.

    out    as the user wrote it: missing, empty, or holding only an earlier output of catseye
    read   input directories and files; none may lie in it or contain it
    """
    where = out.resolve()
    current = Path.cwd().resolve()
    if where == current or where in current.parents:
        raise InputError(f"--out {out}: is the current directory or holds it (expected a directory of its own)")
    for path in read:
        source = path.resolve()
        if where == source or where in source.parents or source in where.parents:
            raise InputError(f"--out {out}: is, holds or lies in the input {path} (expected a place outside it)")
    if not where.parent.is_dir():
        raise InputError(f"--out {out}: {out.parent} is not a directory (expected an existing one)")
    if not os.access(where.parent, os.W_OK | os.X_OK):
        raise InputError(f"--out {out}: {out.parent} cannot be written to (expected one with permission)")
    if where.exists():
        if not where.is_dir():
            raise InputError(f"--out {out}: exists and is not a directory (expected a new or an empty one)")
        _refuse_foreign(out, where)
    return where


def _refuse_foreign(out: Path, where: Path) -> None:
    """Raise InputError if the directory holds a file that catseye did not write."""
    names = sorted(entry.name for entry in where.iterdir())
    if not names:
        return
    own_names = {PROVENANCE, *_written(where)}
    foreign = [name for name in names if name not in own_names] if len(own_names) > 1 else names
    if foreign:
        more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        raise InputError(
            f"--out {out}: holds {foreign[0]!r}{more}, which catseye did not write (expected a new or an empty one)"
        )


def _written(where: Path) -> set[str]:
    """File names in the directory's provenance; empty without catseye's mark."""
    try:
        provenance: Any = json.loads((where / PROVENANCE).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return set()
    if not isinstance(provenance, dict) or provenance.get("format") not in FORMATS:
        return set()
    outputs = provenance.get("outputs")
    return set(outputs) if isinstance(outputs, dict) else set()


@contextmanager
def atomic_directory(out: Path, *read: Path) -> Iterator[Path]:
    """Yield a directory to write into; it replaces `out` on success and is removed on failure.

    It lies beside `out`, so that a rename puts it in place.
    """
    where = refuse_output(out, *read)
    fresh = where.parent / f".catseye-{secrets.token_hex(6)}"
    old = where.parent / f".catseye-{secrets.token_hex(6)}"
    undo = Unfinished(str(fresh), str(where), str(old))
    with undo_on_interruption(undo):
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
    """Yield a directory to write; on success it becomes `directory`.

    Raises InputError where `directory` is not empty or a file cannot be written, naming the file.
    """
    where = directory.resolve()
    if where.exists() and (not where.is_dir() or any(where.iterdir())):
        raise InputError(f"{directory}: exists and is not an empty directory (expected a new or an empty one)")
    fresh = where.parent / f".catseye-{secrets.token_hex(6)}"
    undo = Unfinished(str(fresh))
    with undo_on_interruption(undo):
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
    """Move the old tree aside and the new one in; undo the first if the second fails."""
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
def atomic_file(path: Path, option: str, mark: str) -> Iterator[list[str | bytes]]:
    """Write a file atomically from the pieces that the block appends to the list.

    path     as the user wrote it: new, or an earlier file of catseye, one that holds `mark` where `holds` looks
    option   command option that named the file, for messages
    mark     text that identifies catseye's files, such as format = "catseye-baseline-1"

    Raises InputError where a foreign file would be overwritten or nothing can be written.
    """
    where = path.resolve()
    fresh = where.parent / f".catseye-{secrets.token_hex(6)}"
    pieces: list[str | bytes] = []
    with undo_on_interruption(Unfinished(str(fresh))):
        try:
            refuse_file(path, option, mark)
            yield pieces
            fresh.write_bytes(b"".join(p if isinstance(p, bytes) else p.encode("utf-8") for p in pieces))
            with deferred():
                os.replace(fresh, where)
        except OSError as problem:
            raise InputError(f"{option} {path}: cannot be written: {problem.strerror or problem}") from problem
        finally:
            fresh.unlink(missing_ok=True)


def refuse_file(path: Path, option: str, mark: str) -> None:
    """Raise InputError for a file that `atomic_file` would not replace; arguments as for it."""
    where = path.resolve()
    if where.is_dir():
        raise InputError(f"{option} {path}: is a directory (expected the name of a file)")
    if where.exists() and not holds(where, mark):
        raise InputError(f"{option} {path}: exists and is not a catseye file (expected a new name)")


def holds(file: Path, mark: str) -> bool:
    """True if a file holds a mark in its first 4096 bytes, or anywhere in a PDF, whose metadata come last."""
    with file.open("rb") as stream:
        content = stream.read(4096)
        if content.startswith(PDF):
            content += stream.read()
    return mark.encode() in content


def refuse_suffix(path: Path, option: str, *, pdf: bool = False) -> None:
    """Raise InputError for a page's name whose suffix is not HTML.

    pdf   True: nor PDF
    """
    suffix = path.suffix.lower()
    if pdf and suffix not in (".pdf", *PAGES) and not path.is_dir():
        raise InputError(f"{option} {path}: a certificate is PDF or HTML (expected a name that ends in .pdf or .html)")
    if not pdf and suffix not in PAGES and not path.is_dir():
        hint = "; a browser prints a page as PDF" if suffix == ".pdf" else ""
        raise InputError(f"{option} {path}: a page is HTML (expected a name that ends in .html{hint})")


def write_atomically(path: Path, content: bytes, *, option: str, ours: Callable[[bytes], bool]) -> None:
    """Write a file atomically.

    path      new, or an earlier file of catseye
    content   complete content
    option    command option that named the file, for messages
    ours      True for the content of an existing file that is catseye's

    Raises InputError where a foreign file would be overwritten or nothing can be written.
    """
    where = path.resolve()
    fresh = where.parent / f".catseye-{secrets.token_hex(6)}"
    with undo_on_interruption(Unfinished(str(fresh))):
        try:
            if where.is_dir():
                raise InputError(f"{option} {path}: is a directory (expected the name of a file)")
            if where.exists() and not ours(where.read_bytes()):
                raise InputError(f"{option} {path}: exists and is not a catseye file (expected a new name)")
            fresh.write_bytes(content)
            with deferred():
                os.replace(fresh, where)
        except OSError as problem:
            raise InputError(f"{option} {path}: cannot be written: {problem.strerror or problem}") from problem
        finally:
            fresh.unlink(missing_ok=True)
