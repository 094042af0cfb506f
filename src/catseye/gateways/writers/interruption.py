"""Ctrl-C and termination at any moment: undo what is half done, leave at once, without a traceback.

The handler leaves the process itself instead of raising an exception: libraries lose, wrap or print exceptions that
arrive while they are being imported or are cleaning up. What must not be cut in two is put under `deferred`.

A handler waits for a long call of a compiled library. Where this process is supervised, the supervisor hears of
`Unfinished` output while it is made, ends the process, and undoes it in its stead.
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
    """Output that is being made; calling it undoes what there is of it.

    fresh   file or directory that takes the output's place in the end
    where   that place, and
    old     where an earlier output waits until then; "" of none
    """

    fresh: str
    where: str = ""
    old: str = ""

    def __call__(self) -> None:
        if self.old and os.path.lexists(self.old) and not os.path.lexists(self.where):
            os.rename(self.old, self.where)  # between two renames: the old tree is all there is
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
        """Take in what came through the pipe."""
        *lines, self._text = (self._text + data).split(b"\n")
        for line in lines:
            begun, *paths = json.loads(line)
            output = Unfinished(*paths)
            if begun:
                self._open.append(output)
            elif output in self._open:
                self._open.remove(output)

    def undo(self) -> None:
        """Leave nothing half-made."""
        for output in reversed(self._open):
            with suppress(OSError):
                output()


def tell_supervisor(descriptor: int) -> None:
    """From now on unfinished output is said there."""
    global _supervisor
    _supervisor = descriptor


def leave_on_signals() -> None:
    """From now on SIGINT leaves with status 130 and SIGTERM with 143."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _handle)


def ignore_signals() -> None:
    """The work is done and the interpreter about to end: an interruption would change nothing but the status."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def undone_when_interrupted(undo: Callable[[], None] | Unfinished) -> Iterator[None]:
    """Calls `undo` when the process is interrupted inside; it must not raise for what is not there."""
    _undo.append(undo)
    _say(undo, begun=True)
    try:
        yield
    finally:
        _undo.remove(undo)
        _say(undo, begun=False)


def _say(undo: Callable[[], None] | Unfinished, *, begun: bool) -> None:
    if _supervisor is not None and isinstance(undo, Unfinished):
        with suppress(OSError):  # it is gone: this process hears of that by a signal
            os.write(_supervisor, json.dumps([begun, *undo]).encode() + b"\n")


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
