"""How many threads linear algebra may have: what the user says, else what is free of the cores that we may use.

Threads of a BLAS pool wait for each other in busy loops: two of them on cores that others use too need more time than
one, the same work taken. Large factorisations ask each time; small ones have one thread.
"""

import math
import os
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import TypeVar

from threadpoolctl import threadpool_info, threadpool_limits

VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")  # the first that is set counts, as for OpenBLAS
SPARE = 0.3  # of a core that may be missing for one more thread: the clock ticks of an idle system
FEW = 200  # rows or blocks that are done before a thread has started
SHORTEST = 0.5  # s over which load is measured: /proc/stat counts in hundredths

Result = TypeVar("Result")


def said(environment: Mapping[str, str]) -> int | None:
    """The number of threads that a user's environment asks for; None of none.

    >>> said({"OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "1"}), said({"OMP_NUM_THREADS": "x"})
    (2, None)
    """
    for name in VARIABLES:
        with suppress(ValueError):
            if (count := int(environment.get(name, "0"))) > 0:
                return count
    return None


_asked: ContextVar[int | None] = ContextVar("asked", default=None)  # by --threads
_pool: ContextVar[int | None] = ContextVar("pool", default=None)  # size of the pool outside `one_thread`


def threads() -> int:
    """Threads for a large matrix, now: what was asked for, else as many as there are cores free, at least one.

    A pool that whoever calls has made smaller stays so.
    """
    asked = _asked.get()
    if asked is None:
        asked = said(os.environ)
    if asked is None:
        asked = max(1, math.floor(LOAD.free() + SPARE))
    pool = _pool.get()
    return asked if pool is None or _asked.get() is not None else min(asked, pool)


def on_threads(work: Callable[[int, int], Result]) -> list[Result]:
    """Answers of work(part, parts), each part on a thread of its own; for kernels that release the interpreter."""
    parts = threads()
    if parts == 1:
        return [work(0, 1)]
    with ThreadPoolExecutor(parts) as pool:
        return list(pool.map(work, range(parts), [parts] * parts))


def in_parts(count: int, work: Callable[[int, int], Result], *, least: int = FEW) -> list[Result]:
    """Answers of work(low, high) over 0 to count in as many parts as there are threads; below `least` in one."""
    if count < least:
        return [work(0, count)]
    return on_threads(lambda part, parts: work(part * count // parts, (part + 1) * count // parts))


@contextmanager
def one_thread() -> Iterator[None]:
    """Small matrices inside: spinning pools make them many times slower. `threads` still says what large ones get."""
    sizes = [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]
    before = _pool.set(_pool.get() or max(sizes, default=None))
    try:
        with threadpool_limits(limits=1, user_api="blas"):
            yield
    finally:
        _pool.reset(before)


@contextmanager
def free_threads() -> Iterator[None]:
    """Large matrices inside: a pool of `threads()`, never more than it was."""
    sizes = [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]
    with threadpool_limits(limits=min([threads(), *sizes]), user_api="blas"):
        yield


@contextmanager
def at_most(count: int) -> Iterator[None]:
    """So many threads inside, whatever else is said; libraries that are loaded inside begin with so many."""
    before = {name: os.environ.get(name) for name in VARIABLES}
    os.environ.update(dict.fromkeys(VARIABLES, str(count)))
    token = _asked.set(count)
    try:
        with threadpool_limits(limits=count, user_api="blas"):
            yield
    finally:
        _asked.reset(token)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def allowed() -> tuple[set[int], float]:
    """Cores that this process may use, and how many of them at once by its control group."""
    cores = set(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else set(range(os.cpu_count() or 1))
    share = float(len(cores))
    with suppress(OSError, ValueError):
        quota, period = Path("/sys/fs/cgroup/cpu.max").read_text(encoding="ascii").split()
        share = min(share, float(quota) / float(period))  # "max" is no number: no limit
    return cores, share


def idle_of(stat: str, cores: set[int]) -> float:
    """Seconds that some cores were idle since the system's start.

    stat   text of /proc/stat

    Source: proc(5), /proc/stat: user nice system idle iowait ..., in clock ticks.

    >>> idle_of("cpu 9 9 9 900 9\\ncpu0 1 1 1 300 10\\ncpu1 1 1 1 200 0\\nintr 5", {0}) * os.sysconf("SC_CLK_TCK")
    310.0
    """
    ticks = 0
    for line in stat.splitlines():
        name, *counts = line.split()
        if name.startswith("cpu") and name[3:].isdigit() and int(name[3:]) in cores:
            ticks += int(counts[3]) + int(counts[4])
    return ticks / os.sysconf("SC_CLK_TCK")


class Load:
    """How many cores were free since it was last asked: idle, or used by this process itself."""

    def __init__(self) -> None:
        self._last = self._now()
        self._free: float | None = None

    def free(self) -> float:
        """Cores that others left to this process, of those that it may use."""
        cores, share = allowed()
        since, now = self._last, self._now()
        if since is None or now is None:
            return self._by_average(cores, share)
        passed = now[0] - since[0]
        if passed >= SHORTEST:
            self._last, self._free = now, (now[1] - since[1] + now[2] - since[2]) / passed
        return min(share, self._by_average(cores, share) if self._free is None else self._free)

    @staticmethod
    def _by_average(cores: set[int], share: float) -> float:
        """Before anything was measured, and where the system does not say: by the load of the last minute."""
        with suppress(OSError, AttributeError):
            return max(0.0, min(share, len(cores) * (1.0 - os.getloadavg()[0] / (os.cpu_count() or 1))))
        return share

    @staticmethod
    def _now() -> tuple[float, float, float] | None:
        """Time, idle time of our cores and our own processor time, s."""
        with suppress(OSError):
            stat = Path("/proc/stat").read_text(encoding="ascii")
            return time.monotonic(), idle_of(stat, allowed()[0]), time.process_time()
        return None


LOAD = Load()
