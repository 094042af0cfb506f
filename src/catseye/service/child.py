"""A supervised child process: started, read, restarted when it dies, never orphaned.

The child's standard input is a pipe, and it exits at its end: however this process ends, by whatever signal, the child
does not outlive it.
"""

import asyncio
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from pathlib import Path

from catseye.errors import InputError
from catseye.interruption import undo_on_interruption

PROGRAM = (sys.executable, "-P", "-m", "catseye")
LONGEST_START = 120.0  # s until the child is up: its kernels are compiled the first time
LONGEST_LEAVE = 1.0  # s from SIGTERM until it is killed: the parent has to exit within five
FIRST_WAIT, LONGEST_WAIT, LIVED = 1.0, 30.0, 60.0  # s of back-off before a restart, doubled unless it ran for LIVED
LineHandler = Callable[[str], None]


class LiveChild:
    """One child process.

    name       for people
    arguments  of `catseye`
    said       called with each line of its standard output
    warned     called with each line of its standard error
    program    that takes the arguments
    first_line called at each start for the first line on its standard input; None: it gets none
    is_up      True for the line of its output by which it has started; the first one by default

    `ended` is called when it has ended, or could not start.
    """

    def __init__(
        self,
        name: str,
        arguments: Sequence[str],
        *,
        said: LineHandler,
        warned: LineHandler,
        program: Sequence[str] = PROGRAM,
        first_line: Callable[[], str] | None = None,
        is_up: Callable[[str], bool] = lambda line: True,
    ):
        self._is_up = is_up
        self.ended: Callable[[], None] = lambda: None
        self._program, self._first_line = tuple(program), first_line
        self.name, self._arguments, self._said, self._warned = name, tuple(arguments), said, warned
        self._process: asyncio.subprocess.Process | None = None
        self._readers: list[asyncio.Task[None]] = []
        self._last_warning = ""
        self._up = asyncio.Event()

    @property
    def pid(self) -> int | None:
        """Process id of the running child."""
        return None if self._process is None else self._process.pid

    async def start(self) -> None:
        """Start it and wait until it is up.

        Raises InputError if it exits before, with its last message, or takes too long.
        """
        self._up.clear()
        self._last_warning = ""
        self._process = await asyncio.create_subprocess_exec(
            *self._program,
            *self._arguments,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for this process, which then stops the child
        )
        process = self._process
        self._readers = [
            asyncio.create_task(self._read(process.stdout, self._hear)),
            asyncio.create_task(self._read(process.stderr, self._warn)),
        ]
        if self._first_line is not None and process.stdin is not None:
            process.stdin.write(self._first_line().encode() + b"\n")  # buffered: a child that has ended is seen below
        exit_task, up_task = asyncio.create_task(process.wait()), asyncio.create_task(self._up.wait())
        try:
            await asyncio.wait([exit_task, up_task], timeout=LONGEST_START, return_when=asyncio.FIRST_COMPLETED)
        finally:
            exit_task.cancel()
            up_task.cancel()
        if self._up.is_set():
            return
        await self.stop()
        why = self._last_warning.removeprefix("catseye: ") or f"it has not started within {LONGEST_START:g} s"
        raise InputError(f"{self.name}: {why}")

    async def keep(self, *, patient: bool = False) -> None:
        """Start it and restart it whenever it ends, until cancelled.

        patient   retry also if the first start fails: the cause, such as an occupied port, may go away

        Raises InputError if the first start fails, unless `patient`.
        """
        wait, loop = FIRST_WAIT, asyncio.get_running_loop()
        with undo_on_interruption(self.kill):
            try:
                with suppress(InputError) if patient else nullcontext():  # its message has been passed on
                    await self.start()
                while True:
                    started = loop.time()
                    status = await self._process.wait() if self._process is not None else None
                    self.ended()
                    wait = FIRST_WAIT if loop.time() - started > LIVED else wait
                    what = "did not start" if self._process is None else f"ended with status {status}"
                    self._warned(f"{what}; restarting in {wait:g} s")
                    await asyncio.sleep(wait)
                    wait = min(2.0 * wait, LONGEST_WAIT)
                    with suppress(InputError):  # its message has been passed on
                        await self.start()
            finally:
                await self.stop()

    async def stop(self) -> None:
        """Terminate it, and kill it if it does not exit."""
        process, self._process = self._process, None
        if process is None:
            return
        if process.returncode is None:
            with suppress(ProcessLookupError):
                process.send_signal(signal.SIGTERM)
            try:
                await asyncio.wait_for(process.wait(), LONGEST_LEAVE)
            except (TimeoutError, asyncio.CancelledError):
                with suppress(ProcessLookupError):
                    process.kill()
                await process.wait()
                _remove_temporary(process.pid)
        await asyncio.gather(*self._readers, return_exceptions=True)
        if process.stdin is not None:
            process.stdin.close()

    def kill(self) -> None:
        """Kill the child at once, by SIGKILL."""
        if self._process is not None and self._process.returncode is None:
            with suppress(OSError):
                os.kill(self._process.pid, signal.SIGKILL)
            _remove_temporary(self._process.pid)

    async def _read(self, stream: asyncio.StreamReader | None, handle: LineHandler) -> None:
        while stream is not None and (line := await stream.readline()):
            handle(line.decode("utf-8", "replace").rstrip("\n"))

    def _hear(self, line: str) -> None:
        self._said(line)
        if self._is_up(line):
            self._up.set()

    def _warn(self, line: str) -> None:
        self._last_warning = line
        self._warned(line)


def _remove_temporary(pid: int) -> None:
    """Remove the temporary folders, `catseye-PID-…`, of a child that was killed before it could."""
    for folder in Path(tempfile.gettempdir()).glob(f"catseye-{pid}-*"):
        shutil.rmtree(folder, ignore_errors=True)
