"""Ctrl-C and termination at any moment: undo what is half done, leave at once, without a traceback.

The handler leaves the process itself instead of raising an exception: libraries lose, wrap or print exceptions that
arrive while they are being imported or are cleaning up. What must not be cut in two is put under `deferred`.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

LONGEST_DEFERRAL = 3.0  # s: the contract allows five until the process is gone

_undo: list[Callable[[], None]] = []
_deferrals = 0
_pending = 0


def leave_on_signals() -> None:
    """From now on SIGINT leaves with status 130 and SIGTERM with 143."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _handle)


def ignore_signals() -> None:
    """The work is done and the interpreter about to end: an interruption would change nothing but the status."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def undone_when_interrupted(undo: Callable[[], None]) -> Iterator[None]:
    """Calls `undo` when the process is interrupted inside; it must not raise for what is not there."""
    _undo.append(undo)
    try:
        yield
    finally:
        _undo.remove(undo)


@contextmanager
def deferred() -> Iterator[None]:
    """Steps that belong together: an interruption waits until they are done, but never longer than three seconds."""
    global _deferrals
    _deferrals += 1
    try:
        yield
    finally:
        _deferrals -= 1
        if _pending and not _deferrals:
            _leave(_pending)


def _handle(number: int, frame: FrameType | None) -> None:
    global _pending
    if not _deferrals:
        _leave(number)
    if not _pending:
        _pending = number
        alarm = threading.Timer(LONGEST_DEFERRAL, _leave, (number,))
        alarm.daemon = True
        alarm.start()


def _leave(number: int) -> None:
    for undo in reversed(_undo):
        with suppress(OSError):
            undo()
    with suppress(OSError, ValueError, AttributeError):
        if sys.stderr.isatty():
            os.write(sys.stderr.fileno(), b"\n")
    os._exit(128 + number)
