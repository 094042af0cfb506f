"""Worker processes of this machine, each in a pool of its own, so that a death has one unit to blame."""

import signal
import time
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import suppress
from multiprocessing import connection
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import Any

from catseye.service.many.unit import Death, Unit, UnitReport
from catseye.service.many.work import perform
from catseye.service.many.worker import begin, starting

LEAVE = 2.5  # s that a worker has to leave by itself, before it is killed
KILLED = 1.0  # s until a killed process is gone


class _Context(SpawnContext):
    """Spawn, with the processes that it started."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[SpawnProcess] = []

    def Process(self, *arguments: Any, **keywords: Any) -> SpawnProcess:  # type: ignore[override]
        process = SpawnProcess(*arguments, **keywords)
        self.started.append(process)
        return process


class _Slot:
    """A pool of one process, made again when it is broken."""

    def __init__(self, lifeline: connection.Connection, *, with_main: bool):
        self._lifeline, self._with_main = lifeline, with_main
        self._make()

    def _make(self) -> None:
        self._context = _Context()
        self._pool = ProcessPoolExecutor(1, self._context, initializer=begin, initargs=(self._lifeline,))

    def submit(self, unit: Unit, ledger: Path | None) -> "Future[UnitReport]":
        """Report to come; a process that died while idle is replaced first."""
        with starting(with_main=self._with_main):
            try:
                return self._pool.submit(perform, unit, ledger)
            except BrokenExecutor:
                self.renew()
                return self._pool.submit(perform, unit, ledger)

    def renew(self) -> str:
        """Replace the process that died; how it died."""
        self._pool.shutdown(wait=True)
        codes = [process.exitcode for process in self._context.started]
        self._make()
        code = next((code for code in codes if code), 1)
        return f"killed by {signal.Signals(-code).name}" if code < 0 else f"ended with status {code}"

    def shut(self) -> None:
        """Let the idle process end."""
        self._pool.shutdown(wait=True)

    def abandon(self) -> None:
        """Submit nothing more and wait for nothing."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    @property
    def alive(self) -> list[SpawnProcess]:
        """ProcessWorkers that were started and have not been seen to end."""
        return list(self._context.started)


class ProcessWorkers:
    """Places for units in processes of this machine.

    count       of the processes
    with_main   they import the main module
    """

    def __init__(self, count: int, ledger: Path | None, *, with_main: bool):
        self.count, self._ledger = count, ledger
        context = SpawnContext()
        theirs, self._lifeline = context.Pipe(duplex=False)
        self._slots = [_Slot(theirs, with_main=with_main) for _ in range(count)]
        self._idle = list(reversed(self._slots))
        self._running: dict[Future[UnitReport], tuple[int, _Slot]] = {}

    def start(self, number: int, unit: Unit) -> None:
        """Start a unit in an idle process; there must be one."""
        slot = self._idle.pop()
        self._running[slot.submit(unit, self._ledger)] = (number, slot)

    def ended(self, timeout: float | None = None) -> list[tuple[int, UnitReport | Death]]:
        """Units that have ended since, by their numbers; waits for the first, at most for a time, s."""
        done, _ = wait(self._running, timeout, FIRST_COMPLETED)
        answers: list[tuple[int, UnitReport | Death]] = []
        for future in sorted(done, key=lambda each: self._running[each][0]):
            number, slot = self._running.pop(future)
            try:
                answers.append((number, future.result()))
            except BrokenExecutor:
                answers.append((number, Death(slot.renew())))
            self._idle.append(slot)
        return answers

    def close(self) -> None:
        """Let the idle processes end."""
        for slot in self._slots:
            slot.shut()
        self._lifeline.close()

    def kill(self) -> None:
        """End all processes within 3.5 s, what they write undone where they can; from a signal handler, too."""
        with suppress(OSError):
            self._lifeline.close()
        waiting = {process.sentinel: process for slot in self._slots for process in slot.alive if process.pid}
        _until_ended(waiting, LEAVE)
        for process in waiting.values():
            with suppress(OSError, ValueError):
                process.kill()
        _until_ended(waiting, KILLED)

    def abandon(self) -> None:
        """Kill the processes and let the pools go."""
        self.kill()
        for slot in self._slots:
            slot.abandon()


def _until_ended(waiting: dict[int, SpawnProcess], seconds: float) -> None:
    """Remove the processes that have ended, until all have, or for a time."""
    until = time.monotonic() + seconds
    while waiting and (left := until - time.monotonic()) > 0.0:
        for sentinel in connection.wait(list(waiting), left):
            del waiting[sentinel]  # type: ignore[arg-type]
