"""Number of threads for linear algebra: the user's choice, or the free cores.

Threads of a BLAS pool wait for each other in busy loops: two of them on shared cores are slower than one. Large
factorisations ask each time; small ones have one thread.
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

VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")  # the first one set applies, as in OpenBLAS
SPARE = 0.3  # share of a core that an additional thread may lack: the clock ticks of an idle system
FEW = 200  # rows or blocks processed before a thread has started
SHORTEST = 0.5  # s, least time between load measurements: /proc/stat has steps of 0.01 s

Result = TypeVar("Result")


def said(environment: Mapping[str, str]) -> int | None:
    """Number of threads in a user's environment; None if not set.

    >>> said({"OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "1"}), said({"OMP_NUM_THREADS": "x"})
    (2, None)
    """
    for name in VARIABLES:
        with suppress(ValueError):
            if (count := int(environment.get(name, "0"))) > 0:
                return count
    return None


_requested: ContextVar[int | None] = ContextVar("asked", default=None)  # by --threads
_pool: ContextVar[int | None] = ContextVar("pool", default=None)  # size of the pool outside `one_thread`


def threads() -> int:
    """Threads for a large matrix now: the requested number, or the free cores, at least one.

    A pool that the caller has made smaller is not enlarged.
    """
    count = _requested.get()
    if count is None:
        count = said(os.environ)
    if count is None:
        count = max(1, math.floor(LOAD.free() + SPARE))
    pool = _pool.get()
    return count if pool is None or _requested.get() is not None else min(count, pool)


def on_threads(work: Callable[[int, int], Result]) -> list[Result]:
    """Results of work(part, parts), each part on its own thread; for kernels that release the GIL."""
    parts = threads()
    if parts == 1:
        return [work(0, 1)]
    with ThreadPoolExecutor(parts) as pool:
        return list(pool.map(work, range(parts), [parts] * parts))


def in_parts(count: int, work: Callable[[int, int], Result], *, least: int = FEW) -> list[Result]:
    """Results of work(low, high) over 0 to count in one part per thread; one part below `least`."""
    if count < least:
        return [work(0, count)]
    return on_threads(lambda part, parts: work(part * count // parts, (part + 1) * count // parts))


@contextmanager
def one_thread() -> Iterator[None]:
    """Use one thread for small matrices, where pools are many times slower."""
    sizes = [pool_info["num_threads"] for pool_info in threadpool_info() if pool_info["user_api"] == "blas"]
    before = _pool.set(_pool.get() or max(sizes, default=None))
    try:
        with threadpool_limits(limits=1, user_api="blas"):
            yield
    finally:
        _pool.reset(before)


@contextmanager
def free_threads() -> Iterator[None]:
    """Use a pool of `threads()` for large matrices, never larger than before."""
    sizes = [pool_info["num_threads"] for pool_info in threadpool_info() if pool_info["user_api"] == "blas"]
    with threadpool_limits(limits=min([threads(), *sizes]), user_api="blas"):
        yield


@contextmanager
def at_most(count: int) -> Iterator[None]:
    """Limit the number of threads inside, also of libraries loaded there."""
    before = {name: os.environ.get(name) for name in VARIABLES}
    os.environ.update(dict.fromkeys(VARIABLES, str(count)))
    token = _requested.set(count)
    try:
        with threadpool_limits(limits=count, user_api="blas"):
            yield
    finally:
        _requested.reset(token)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def allowed() -> tuple[set[int], float]:
    """Cores that this process may use, and the number at once by its control group."""
    cores = set(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else set(range(os.cpu_count() or 1))
    share = float(len(cores))
    with suppress(OSError, ValueError):
        quota, period = Path("/sys/fs/cgroup/cpu.max").read_text(encoding="ascii").split()
        share = min(share, float(quota) / float(period))  # "max" means no limit
    return cores, share


def idle_of(stat: str, cores: set[int]) -> float:
    """Idle time of some cores since the system's start, s.

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
    """Number of cores free since the last call: idle, or used by this process."""

    def __init__(self) -> None:
        self._last = self._now()
        self._free: float | None = None

    def free(self) -> float:
        """Cores available to this process, of those that it may use."""
        cores, share = allowed()
        since, current = self._last, self._now()
        if since is None or current is None:
            return self._by_average(cores, share)
        passed = current[0] - since[0]
        if passed >= SHORTEST:
            self._last, self._free = current, (current[1] - since[1] + current[2] - since[2]) / passed
        return min(share, self._by_average(cores, share) if self._free is None else self._free)

    @staticmethod
    def _by_average(cores: set[int], share: float) -> float:
        """Free cores by the load of the last minute, without a measurement."""
        with suppress(OSError, AttributeError):
            return max(0.0, min(share, len(cores) * (1.0 - os.getloadavg()[0] / (os.cpu_count() or 1))))
        return share

    @staticmethod
    def _now() -> tuple[float, float, float] | None:
        """Time, idle time of the allowed cores and processor time of this process, s."""
        with suppress(OSError):
            stat = Path("/proc/stat").read_text(encoding="ascii")
            return time.monotonic(), idle_of(stat, allowed()[0]), time.process_time()
        return None


LOAD = Load()


def free_cores() -> int:
    """Number of cores for processes of one thread now, at least one."""
    return max(1, math.floor(LOAD.free() + SPARE))
