"""Event loop of a running command, with orderly and forced exit."""

import asyncio
import os
import signal
import threading
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from types import FrameType
from typing import Any, Generic, TypeVar

from catseye.simulator.clock.virtual_time import VirtualLoop

T = TypeVar("T")
LONGEST_END = 4.0  # s from the signal until a forced exit: within five in all, with ten other processes running
NUMBERS = (signal.SIGINT, signal.SIGTERM)


@dataclass(frozen=True)
class SiteEnd:
    """End of a site that was served.

    signal    number of the signal that ended it; 0 for none
    failed    True if an error ended it, which its log reported
    journal   last head of the journal's chain and its run; None without a journal
    """

    signal: int = 0
    failed: bool = False
    journal: str | None = None


class FastLoop(VirtualLoop):
    """Virtual-time loop that can be closed after threads worked for it."""

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:
        with self.outside():  # the threads end in real time
            await super().shutdown_default_executor()


class LiveRun(Generic[T]):
    """One coroutine, run until it ends or a signal stops it.

    work           makes the coroutine; a signal cancels it, once
    loop_factory   of the loop; asyncio's own if None

    The first signal cancels; a second one, or 4 s, exit at once as `interruption` does.
    """

    def __init__(
        self,
        work: Callable[[], Coroutine[Any, Any, T]],
        *,
        loop_factory: Callable[[], asyncio.AbstractEventLoop] | None = None,
    ):
        self._work, self._factory = work, loop_factory
        self._before: dict[int, Any] = {}
        self._task: asyncio.Task[T] | None = None
        self._alarm: threading.Timer | None = None
        self.signal = 0  # signal that ended it; 0 if none

    def result(self) -> T | None:
        """Result of the coroutine; None if a signal ended it before."""
        with asyncio.Runner(loop_factory=self._factory) as runner:
            loop = runner.get_loop()

            async def watched() -> T:
                self._task = asyncio.current_task()
                if self.signal:  # received before there was anything to cancel
                    raise asyncio.CancelledError
                return await self._work()

            def caught(number: int, frame: FrameType | None) -> None:
                if self.signal:
                    self._leave(number)
                self.signal = number
                self._alarm = threading.Timer(LONGEST_END, self._leave, (number,))
                self._alarm.daemon = True
                self._alarm.start()
                if self._task is not None:
                    loop.call_soon_threadsafe(self._task.cancel)

            self._before = {number: signal.signal(number, caught) for number in NUMBERS}
            try:
                return runner.run(watched())
            except asyncio.CancelledError:
                return None
            finally:
                runner.close()
                self._restore()

    def _leave(self, number: int) -> None:
        """Exit at once, by the signal handler installed before, with its cleanup."""
        before = self._before.get(number)
        if callable(before) and before is not signal.default_int_handler:
            before(number, None)
        os._exit(128 + number)

    def _restore(self) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm.join()
        for number, before in self._before.items():
            signal.signal(number, before)
