"""A parent that does nothing but watch: it answers signals while the work is inside a long call of a library.

A handler in Python waits until LAPACK returns, which may be minutes, and a process without memory may be ended by the
system with no word. The work is done by a child. The parent passes signals on; where the child does not leave by
itself, it is killed and what it had half-made is removed. The status is the child's, or 128 + the signal's number.
"""

import math
import os
import select
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

from catseye.interruption import (
    LONGEST_DEFERRAL,
    UnfinishedWork,
    exit_on_signals,
    report_to_supervisor,
)

GRACE = LONGEST_DEFERRAL + 0.5  # s that the child has to leave by itself: the contract allows five
SIGNALS = (signal.SIGINT, signal.SIGTERM)
HEARD = (*SIGNALS, signal.SIGCHLD)
PDEATHSIG = 1  # PR_SET_PDEATHSIG of prctl(2)


def work_in_child(stopped: Callable[[int], None]) -> None:
    """Return in a child that does the work; the parent never returns. Where none can be made, return as we are.

    stopped   says that a signal ended the program, and leaves
    """
    reports, ours = os.pipe()
    signal.pthread_sigmask(signal.SIG_BLOCK, HEARD)  # until both know what to do
    try:
        parent, child = os.getpid(), os.fork()
    except OSError:
        child, parent = -1, 0
        os.close(reports)
        os.close(ours)
    if child > 0:
        os.close(ours)
        _watch(child, reports, stopped)
    if child == 0:
        os.close(reports)
        report_to_supervisor(ours)
        _end_with(parent)
    exit_on_signals()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, HEARD)


def _end_with(parent: int) -> None:
    """Ask the system for SIGTERM when the parent is no more, by whatever signal."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(PDEATHSIG, int(signal.SIGTERM), 0, 0, 0)
        if os.getppid() != parent:
            os._exit(128 + signal.SIGTERM)


def _watch(child: int, reports: int, stopped: Callable[[int], None]) -> NoReturn:
    """Until the child has ended, then leave as it did."""
    work, woken = UnfinishedWork(), _woken_by_signals()
    os.set_blocking(reports, False)
    asked, until, ended, open_ = 0, math.inf, 0, [woken, reports]
    while not ended:
        left = until - time.monotonic()
        if left <= 0.0:  # it does not leave by itself
            os.kill(child, signal.SIGKILL)
            until = math.inf
        select.select(open_, [], [], None if until == math.inf else left)
        with suppress(BlockingIOError):
            for number in os.read(woken, 512):
                if number in SIGNALS and not asked:
                    asked, until = number, time.monotonic() + GRACE
                    os.kill(child, number)
        ended, status, usage = os.wait4(child, os.WNOHANG)
        if not _hear(work, reports):  # it is about to end, which a signal will say
            open_ = [woken]
    killed = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    if killed:
        work.undo()
    if asked and (killed or os.WEXITSTATUS(status) == 128 + asked):
        stopped(asked)
    if killed and killed not in SIGNALS:
        _complain_of(signal.Signals(killed).name, usage.ru_maxrss * 1024)
        os._exit(1)
    os._exit(128 + killed if killed else os.WEXITSTATUS(status))


def _hear(work: UnfinishedWork, reports: int) -> bool:
    """Take in all that the child has said until now; whether it may say more."""
    with suppress(BlockingIOError):
        while data := os.read(reports, 65_536):
            work.hear(data)
        return False
    return True


def _woken_by_signals() -> int:
    """A descriptor from which the number of each signal can be read."""
    ours, theirs = os.pipe()
    for end in (ours, theirs):
        os.set_blocking(end, False)
    signal.set_wakeup_fd(theirs)
    for number in HEARD:
        signal.signal(number, lambda number, frame: None)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, HEARD)
    return ours


def _complain_of(name: str, memory: int) -> None:
    from catseye.cli.terminal import complain
    from catseye.memory import killed_process_message

    complain(killed_process_message(name, memory))
