"""Undo unfinished output on Ctrl-C or termination, then exit without a traceback.

The handler exits the process instead of raising an exception: libraries lose, wrap or print exceptions that arrive
while they are being imported or are cleaning up. Steps that must not be interrupted are put under `deferred`.

A handler cannot run during a long call of a compiled library. Where this process is supervised, the supervisor is
told of `Unfinished` output while it is written; it ends the process and undoes the output.
"""

import json
import os
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NamedTuple

LONGEST_DEFERRAL = 3.0  # s: the contract allows five until the process is gone

_deferrals = 0
_pending = 0
_supervisor: int | None = None  # descriptor that the supervisor reads


class Unfinished(NamedTuple):
    """Output in progress; calling it undoes the output.

    fresh   temporary file or directory, renamed to `where` at the end
    where   final path
    old     path to which an earlier output is moved meanwhile; "" for none
    """

    fresh: str
    where: str = ""
    old: str = ""

    def __call__(self) -> None:
        if self.old and os.path.lexists(self.old) and not os.path.lexists(self.where):
            os.rename(self.old, self.where)  # interrupted between two renames: restore the old tree
        for path in filter(None, (self.fresh, self.old)):
            if os.path.isdir(path):
                shutil.rmtree(path, ignore_errors=True)
            else:
                with suppress(FileNotFoundError):
                    os.unlink(path)


_undo: list[Callable[[], None] | Unfinished] = []


class UnfinishedWork:
    """Unfinished output that a supervised process reported."""

    def __init__(self) -> None:
        self._text, self._open = b"", list[Unfinished]()

    def hear(self, data: bytes) -> None:
        """Parse data from the pipe."""
        *lines, self._text = (self._text + data).split(b"\n")
        for line in lines:
            started, *paths = json.loads(line)
            output = Unfinished(*paths)
            if started:
                self._open.append(output)
            elif output in self._open:
                self._open.remove(output)

    def undo(self) -> None:
        """Undo all unfinished output."""
        for output in reversed(self._open):
            with suppress(OSError):
                output()


def report_to_supervisor(descriptor: int) -> None:
    """Report unfinished output to this descriptor from now on."""
    global _supervisor
    _supervisor = descriptor


def exit_on_signals() -> None:
    """Exit with status 130 on SIGINT and 143 on SIGTERM from now on."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _handle)


def ignore_signals() -> None:
    """Ignore interruptions: the work is done and they would only change the exit status."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def undo_on_interruption(undo: Callable[[], None] | Unfinished) -> Iterator[None]:
    """Call `undo` if the process is interrupted in the block.

    `undo` must not raise if there is nothing to undo.
    """
    _undo.append(undo)
    _say(undo, started=True)
    try:
        yield
    finally:
        _undo.remove(undo)
        _say(undo, started=False)


def _say(undo: Callable[[], None] | Unfinished, *, started: bool) -> None:
    if _supervisor is not None and isinstance(undo, Unfinished):
        with suppress(OSError):  # the supervisor is gone; a signal will follow
            os.write(_supervisor, json.dumps([started, *undo]).encode() + b"\n")


@contextmanager
def deferred() -> Iterator[None]:
    """Delay interruptions until the block ends, at most 3 s."""
    global _deferrals
    _deferrals += 1
    try:
        yield
    finally:
        _deferrals -= 1
        if _pending and not _deferrals:
            leave(_pending)


def _handle(number: int, frame: FrameType | None) -> None:
    global _pending
    if not _deferrals:
        leave(number)
    if not _pending:
        _pending = number
        alarm = threading.Timer(LONGEST_DEFERRAL, leave, (number,))
        alarm.daemon = True
        alarm.start()


def leave(number: int) -> None:
    """Undo unfinished output and exit as after this signal, from any thread."""
    for undo in reversed(_undo):
        with suppress(OSError):
            undo()
    with suppress(OSError, ValueError, AttributeError):
        if number == signal.SIGINT and sys.stderr.isatty():
            os.write(sys.stderr.fileno(), b"\n")
    os._exit(128 + number)
