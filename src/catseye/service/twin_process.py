"""A site's twin in a process of its own: started before anything heavy is imported here, watched, started again.

It reads the site by itself, and makes its rangers ready while this process imports, plans and assembles.
"""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import TYPE_CHECKING, Self

from catseye.aliases import Progress
from catseye.errors import InputError
from catseye.service.child import LONGEST_START, LiveChild
from catseye.service.listening import STEP_NAME, Listening, start_line_of

if TYPE_CHECKING:
    from catseye.service.world import TwinWords


def twin_arguments(name: str, world: "TwinWords", port_base: int) -> list[str]:
    """Arguments of `catseye` for a child that serves a twin's rangers.

    It says in JSON lines how it starts (`service.listening`).
    """
    return ["zy", name, *world.options(), f"--port-base={port_base}", "--json", "--leave-with-stdin"]


class TwinProcess:
    """The twin's process while the block runs.

    arguments   of `catseye`, from `twin_arguments`
    patient     True if a first start that fails is tried again, as of a service
    progress    called with the number of rangers that are ready

    `listens` is called whenever the rangers answer, `warned` with messages for people; what is said before they are set
    is kept for them.
    """

    def __init__(
        self, arguments: list[str], *, patient: bool = False, progress: Progress = lambda what, done, total: None
    ):
        self._child = LiveChild("twin", arguments, said=self._hear, warned=self._tell, is_up=self._is_up)
        self._child.ended = lambda: self._settled.set()
        self._patient, self.progress = patient, progress
        self._task: asyncio.Task[None] | None = None
        self._bound, self._settled = asyncio.Event(), asyncio.Event()
        self._at: Listening | None = None
        self._listens: Callable[[], None] | None = None
        self._warned: Callable[[str], None] | None = None
        self._early: list[str | None] = []  # messages; None: the rangers answer

    async def __aenter__(self) -> Self:
        self._task = asyncio.create_task(self._child.keep(patient=self._patient))
        await asyncio.sleep(0.0)  # in which it is launched
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.task.cancel()
        with suppress(asyncio.CancelledError, InputError):
            await self.task

    @property
    def task(self) -> "asyncio.Task[None]":
        """Task that keeps it running; it ends with an exception only."""
        assert self._task is not None
        return self._task

    def report(self, *, listens: Callable[[], None] = lambda: None, warned: Callable[[str], None]) -> None:
        """Tell of the process from now on, and of what happened before."""
        self._listens, self._warned = listens, warned
        early, self._early = self._early, []
        for line in early:
            self._tell(line)

    async def bound(self) -> Listening:
        """Addresses, once its ports are taken; nobody can connect yet."""
        await self._bound.wait()
        assert self._at is not None
        return self._at

    @property
    def starting(self) -> bool:
        """True until the rangers answer for the first time, or a start has failed."""
        return not self._settled.is_set()

    async def settled(self) -> None:
        """Wait until the rangers answer for the first time, or a start has failed."""
        with suppress(TimeoutError):
            async with asyncio.timeout(LONGEST_START):
                await self._settled.wait()

    def _hear(self, line: str) -> None:
        try:
            told = start_line_of(line)
        except InputError as problem:
            self._tell(str(problem))
            return
        if told.at is not None:
            self._at = told.at
            self._bound.set()
        elif told.count:
            self.progress(STEP_NAME, told.ready, told.count)
        if told.up:
            self._settled.set()
            self._tell(None)

    def _tell(self, line: str | None) -> None:
        if self._listens is None or self._warned is None:
            self._early.append(line)
        elif line is None:
            self._listens()
        else:
            self._warned(line)

    @staticmethod
    def _is_up(line: str) -> bool:
        with suppress(InputError):  # `_hear` has told of it
            return start_line_of(line).up
        return False
