"""A process of ours beside this one: started, listened to, started again when it dies, and never left behind.

The child gets a pipe as its standard input and leaves when that ends: whatever becomes of this process, by whatever
signal, the child does not outlive it.
"""

import asyncio
import os
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress

from catseye.errors import InputError
from catseye.gateways.writers.interruption import undone_when_interrupted

PROGRAM = (sys.executable, "-P", "-m", "catseye")
LONGEST_START = 120.0  # s until the child says that it listens: the first time its kernels are compiled
LONGEST_LEAVE = 1.0  # s from SIGTERM until it is killed: its keeper has to be gone within five
FIRST_WAIT, LONGEST_WAIT, LIVED = 1.0, 30.0, 60.0  # s before it is started again, longer each time unless it lived
Heard = Callable[[str], None]


class LiveChild:
    """One child.

    name       for people
    arguments  of `catseye`
    said       told of each line that it writes to its standard output
    warned     of each line that it writes to its standard error
    program    that takes the arguments
    """

    def __init__(
        self,
        name: str,
        arguments: Sequence[str],
        *,
        said: Heard,
        warned: Heard,
        program: Sequence[str] = PROGRAM,
    ):
        self._program = tuple(program)
        self.name, self._arguments, self._said, self._warned = name, tuple(arguments), said, warned
        self._process: asyncio.subprocess.Process | None = None
        self._readers: list[asyncio.Task[None]] = []
        self._last_warning = ""
        self._spoke = asyncio.Event()

    @property
    def pid(self) -> int | None:
        """Process id of the child that runs."""
        return None if self._process is None else self._process.pid

    async def start(self) -> None:
        """Until its first line. Raises InputError: it ended before, with its own words; or took too long."""
        self._spoke.clear()
        self._last_warning = ""
        self._process = await asyncio.create_subprocess_exec(
            *self._program,
            *self._arguments,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for this process, which ends the child in its turn
        )
        process = self._process
        self._readers = [
            asyncio.create_task(self._read(process.stdout, self._hear)),
            asyncio.create_task(self._read(process.stderr, self._warn)),
        ]
        ended, spoke = asyncio.create_task(process.wait()), asyncio.create_task(self._spoke.wait())
        try:
            await asyncio.wait([ended, spoke], timeout=LONGEST_START, return_when=asyncio.FIRST_COMPLETED)
        finally:
            ended.cancel()
            spoke.cancel()
        if self._spoke.is_set():
            return
        await self.stop()
        why = self._last_warning.removeprefix("catseye: ") or f"it said nothing for {LONGEST_START:g} s"
        raise InputError(f"{self.name}: {why}")

    async def keep(self, *, patient: bool = False) -> None:
        """Start it, and again whenever it ends, until cancelled.

        patient   also where it cannot start the first time: what stands in its way may go, as a port's holder does

        Raises InputError: it cannot start the first time, unless `patient`.
        """
        wait, loop = FIRST_WAIT, asyncio.get_running_loop()
        with undone_when_interrupted(self.kill):
            try:
                with suppress(InputError) if patient else nullcontext():  # its own words have been passed on
                    await self.start()
                while True:
                    began = loop.time()
                    status = await self._process.wait() if self._process is not None else None
                    wait = FIRST_WAIT if loop.time() - began > LIVED else wait
                    what = "did not start" if self._process is None else f"ended with status {status}"
                    self._warned(f"{what}; started again in {wait:g} s")
                    await asyncio.sleep(wait)
                    wait = min(2.0 * wait, LONGEST_WAIT)
                    with suppress(InputError):  # its own words have been passed on
                        await self.start()
            finally:
                await self.stop()

    async def stop(self) -> None:
        """End it: asked first, killed if it does not."""
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
        await asyncio.gather(*self._readers, return_exceptions=True)
        if process.stdin is not None:
            process.stdin.close()

    def kill(self) -> None:
        """End the child at once, by SIGKILL."""
        if self._process is not None and self._process.returncode is None:
            with suppress(OSError):
                os.kill(self._process.pid, signal.SIGKILL)

    async def _read(self, stream: asyncio.StreamReader | None, heard: Heard) -> None:
        while stream is not None and (line := await stream.readline()):
            heard(line.decode("utf-8", "replace").rstrip("\n"))

    def _hear(self, line: str) -> None:
        self._said(line)
        self._spoke.set()

    def _warn(self, line: str) -> None:
        self._last_warning = line
        self._warned(line)
