"""Solve epochs in a separate process, so that the event loop stays responsive.

The process gets the site at its start, and then only differences. It exits when its pipe ends, however this process
ends, and runs at low priority (`nice`). If it dies, the epoch is solved here, and it is restarted.
"""

import asyncio
import copyreg
import io
import os
import pickle
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import Any, BinaryIO

from catseye.memory import give_back, keep_heap_small
from catseye.records.site.folder import SiteFolder
from catseye.reduction.live.live import EpochJob

NICE = 5
LENGTH = 8  # bytes before each message


class SolverProcess:
    """Solver process of one site; `solve` is for an `Intake`.

    site   the object that jobs refer to: `Live.site`
    """

    def __init__(self, site: SiteFolder):
        self._site = site
        self._process: subprocess.Popen[bytes] | None = None
        self._changing, self._ended = threading.Lock(), False
        self._executor = ThreadPoolExecutor(1, "solver")  # one thread: each would hold the largest answer's memory

    @property
    def pid(self) -> int | None:
        """Process id of the running solver."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Start it if needed, and send it the site.

        That takes 0.1 s; it loads everything else by itself.
        """
        with self._changing:
            if self._process is not None or self._ended:
                return
            self._process = subprocess.Popen(
                _program(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
            )  # its own session: Ctrl-C is for this process, which then stops the child
            with suppress(OSError):  # the first request will notice that it died
                _send(self._process.stdin, dumped(self._site, None))

    async def solve(self, job: EpochJob) -> Any:
        """Result of `job.solve()`, from the process, or from here if it died."""
        loop = asyncio.get_running_loop()
        try:
            return await loop.run_in_executor(self._executor, partial(self._remote_solve, job))
        except (EOFError, OSError):
            self._discard()
            await loop.run_in_executor(None, self.start)
        return await loop.run_in_executor(None, job.solve)

    def stop(self) -> None:
        """Kill the process for good."""
        with self._changing:
            self._ended = True
        self._discard()
        self._executor.shutdown(wait=False, cancel_futures=True)

    def _discard(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError):
                if pipe is not None:
                    pipe.close()

    def _remote_solve(self, job: EpochJob) -> Any:
        process = self._process
        if process is None:
            raise EOFError("no process")
        _send(process.stdin, dumped(job, self._site))
        answer = loaded(_received(process.stdout), self._site)
        give_back()
        if isinstance(answer, BaseException):
            raise answer
        return answer


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, site: SiteFolder | None):
        super().__init__(file)
        self._site = site

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) != (__name__, _the_site.__name__):
            return super().find_class(module, name)
        if self._site is None:
            raise pickle.UnpicklingError("message refers to a site before one was sent")
        return lambda: self._site


def _the_site() -> SiteFolder:
    """Placeholder of the site in a message; each side has its own."""
    raise NotImplementedError


def dumped(what: Any, site: SiteFolder | None) -> bytes:
    """A pickled message, without the site itself.

    Only sites are compared: a `persistent_id` would be called for each of 20 000 objects, 30 ms of a thread during
    which the event loop waits.
    """
    file = io.BytesIO()
    pickler = pickle.Pickler(file, protocol=pickle.HIGHEST_PROTOCOL)
    pickler.dispatch_table = copyreg.dispatch_table | {
        SiteFolder: lambda each: (_the_site, ()) if each is site else each.__reduce_ex__(pickle.HIGHEST_PROTOCOL)
    }
    pickler.dump(what)
    return file.getvalue()


def loaded(message: bytes, site: SiteFolder | None) -> Any:
    """Object in a message of `dumped`, with this site in it."""
    return _Unpickler(io.BytesIO(message), site).load()


def serve() -> None:
    """Serve jobs for one site until standard input ends."""
    keep_heap_small()
    with suppress(OSError):
        os.nice(NICE)
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # printed text must not come between answers
    try:
        site = loaded(_received(sys.stdin.buffer), None)
        while True:
            message = _received(sys.stdin.buffer)
            try:
                answer = loaded(message, site).solve()
            except Exception as problem:  # noqa: BLE001 - a bug: raised in the coordinator
                answer = problem
            _send(answers, dumped(answer, site))
            del message, answer
            give_back()
    except (EOFError, OSError):
        return


def _program() -> tuple[str, ...]:
    """Command line of the solver's process, by the name of its function."""
    return sys.executable, "-P", "-c", f"from {__name__} import {serve.__name__}; {serve.__name__}()"


def _send(pipe: Any, message: bytes) -> None:
    pipe.write(len(message).to_bytes(LENGTH, "big") + message)
    pipe.flush()


def _received(pipe: Any) -> bytes:
    """One message.

    Raises EOFError if there is none, or only a part.
    """
    length = int.from_bytes(_exactly(pipe, LENGTH), "big")
    return _exactly(pipe, length)


def _exactly(pipe: BinaryIO, count: int) -> bytes:
    content = pipe.read(count)
    if len(content) < count:
        raise EOFError(f"{len(content)} bytes of {count}")
    return content
