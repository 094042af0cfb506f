"""Limits of this machine, one thread: read and write memory, multiply and add, take roots, flush a disk.

Compiled loops. A row's own limit is made of them in its script, within the same rounds; `measured` is what stands above
the table.
"""

import os
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from threading import Thread

import numpy as np
from numba import njit

READ_BYTES = 200_000_000  # beyond every cache
BLOCK = np.linspace(1.0, 2.0, 1024)
ROUNDS = 7


@njit(error_model="numpy", fastmath=True, nogil=True)
def read(words: np.ndarray) -> int:
    """Sum of an array of int64: one read of its memory."""
    total = 0
    for i in range(len(words)):
        total += words[i]
    return total


@njit(error_model="numpy", fastmath={"contract"}, nogil=True)
def multiply_adds(a: np.ndarray, times: int) -> None:
    """64 fused multiply-adds of each element, `times` times over, in the registers."""
    for _ in range(times):
        for i in range(len(a)):
            x = a[i]
            p, q, r, s = x, x, x, x  # four chains hide the latency
            for _ in range(16):
                p, q, r, s = p * x + 0.5, q * x + 0.4, r * x + 0.3, s * x + 0.2
            a[i] = 0.5 + 1e-30 * (p + q + r + s)


@njit(error_model="numpy", nogil=True)
def roots(a: np.ndarray, times: int) -> None:
    """A square root with its division of each element, `times` times over."""
    for _ in range(times):
        for i in range(len(a)):
            a[i] = 1.5 / np.sqrt(a[i])


def multiply_add_work(count: float) -> tuple[Callable[[], None], float]:
    """Call that takes at most a few ms, and the share of `count` fused multiply-adds that it does."""
    block, each = BLOCK.copy(), 64 * len(BLOCK)
    times = int(np.clip(count / each, 1, 200))
    return lambda: multiply_adds(block, times), times * each / count


def median_seconds(
    work: Callable[[], object], rounds: int = ROUNDS, clock: Callable[[], float] = time.process_time
) -> float:
    """Median s of a call, the first not counted; `clock` as in `harness.race`."""
    work()
    taken = []
    for _ in range(rounds):
        begun = clock()
        work()
        taken.append(clock() - begun)
    return statistics.median(taken)


def measured() -> dict[str, float]:
    """Limits: bytes/s read by one thread and by two, and written by one; operations/s; s of a flush of 16 KiB."""
    words = np.zeros(READ_BYTES // 8, dtype=np.int64)
    halves = np.split(words, 2)

    def both() -> None:
        threads = [Thread(target=read, args=(half,)) for half in halves]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    work, share = multiply_add_work(1e9)
    block = BLOCK.copy()
    return {
        "read_bytes_s": READ_BYTES / median_seconds(lambda: read(words)),
        "read_by_two_bytes_s": READ_BYTES / median_seconds(both, clock=time.perf_counter),
        "write_bytes_s": READ_BYTES / median_seconds(lambda: words.fill(1)),
        "multiply_adds_s": 1e9 * share / median_seconds(work),
        "roots_s": len(block) * 1000 / median_seconds(lambda: roots(block, 1000)),
        "flush_s": flush(),
    }


def flush(folder: Path | None = None, count: int = 50, size: int = 16_384) -> float:
    """Median s to write and flush so many bytes to the disk of a folder."""
    raw, taken = os.urandom(size), []
    with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
        for _ in range(count):
            file.write(raw)
            begun = time.perf_counter()
            os.fsync(file.fileno())
            taken.append(time.perf_counter() - begun)
    return statistics.median(taken)
