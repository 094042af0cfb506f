"""One unit done where this is called: its work, its entry in the ledger, and a report that never raises."""

import errno
import json
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

from catseye.errors import CatseyeError, InputError
from catseye.memory import give_back, is_memory_error, out_of_memory
from catseye.service.many import ledger as book
from catseye.service.many.unit import Unit, UnitReport

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS})  # met by every unit alike


class UnseenLedgerError(InputError):
    """Ledger that is not there for a worker, as on a machine that shares no file system."""


def perform(unit: Unit, ledger: Path | None) -> UnitReport:
    """Report on a unit, done here.

    ledger   folder that gets its entry, `ledger.opened` by who started the run; None: none
    """
    start = time.perf_counter()
    try:
        value = _perform(unit, ledger)
    except Exception as problem:  # noqa: BLE001 - whatever one unit meets, the others go on
        state: Literal["stopped", "failed"] = "stopped" if any(map(_is_full, _causes(problem))) else "failed"
        return UnitReport(state, _reason(problem), None, time.perf_counter() - start)
    finally:
        give_back()
    return UnitReport("done", "", value, time.perf_counter() - start)


def _perform(unit: Unit, ledger: Path | None) -> dict[str, Any]:
    if ledger is None:
        return unit.work(*unit.arguments)
    if not book.is_ledger(ledger):
        raise UnseenLedgerError(f"{ledger}: a worker does not see it (expected a folder that all machines share)")
    start, hashed = time.perf_counter(), book.now()
    files = book.content_of(unit.inputs)
    value: dict[str, Any] = json.loads(json.dumps(unit.work(*unit.arguments)))  # as a later run will read it
    seconds = time.perf_counter() - start
    book.write_entry(ledger, unit, value, seconds=seconds, files=files, hashed=hashed)
    return value


def _causes(problem: BaseException | None) -> Iterator[BaseException]:
    """An exception, its cause, and so on."""
    while problem is not None:
        yield problem
        problem = problem.__cause__ or problem.__context__


def _is_full(problem: BaseException) -> bool:
    """True for a disk that takes no more, and for one that is not the run's."""
    if isinstance(problem, sqlite3.Error):
        return getattr(problem, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
    return isinstance(problem, UnseenLedgerError) or (isinstance(problem, OSError) and problem.errno in FULL)


def _reason(problem: BaseException) -> str:
    """One line on an exception: its text, and its type where it is none of ours."""
    if isinstance(problem, CatseyeError):
        text = str(problem)
    elif isinstance(problem, MemoryError | ImportError | OSError) and is_memory_error(problem):
        text = out_of_memory(problem)
    elif isinstance(problem, OSError):
        text = f"{problem.filename or 'input or output'}: {problem.strerror or problem}"
    else:
        text = f"{type(problem).__name__}: {problem}"
    return " ".join(text.split())
