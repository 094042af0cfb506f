"""Process memory: release of freed pages, and messages for a run out of memory."""

import ctypes
import gc
import math
import resource
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

GIB = 2.0**30
MALLOPT = {-3: 2**18, -8: 2}  # M_MMAP_THRESHOLD, bytes; M_ARENA_MAX (mallopt(3))
UNLOADED = ("failed to map segment", "cannot allocate memory", "Cannot allocate memory")  # messages of the loader
UNFOUND = "load shared object file"  # llvmlite's, whose file is missing or did not fit
UNKNOWN = 2**31  # bytes that are assumed to be available where the system does not say
WORKSPACE = 200 * 2**20  # bytes: 32 MiB a library and thread of OpenBLAS, the libraries, their arguments
ADVICE = "use a machine or a limit with more; fewer shots or points at once need less"


def available() -> int:
    """Memory that this process and its children may still take, bytes; a limit of its address space is each one's.

    Source: proc(5), MemAvailable; cgroups(7), memory.max and memory.current.
    """
    sizes = [resource.getrlimit(resource.RLIMIT_AS)[0]]
    with suppress(OSError, ValueError, StopIteration), open("/proc/meminfo", encoding="ascii") as lines:
        sizes.append(1024 * int(next(line for line in lines if line.startswith("MemAvailable")).split()[1]))
    with suppress(OSError, ValueError):
        group = Path("/sys/fs/cgroup")
        limit = int((group / "memory.max").read_text(encoding="ascii"))  # "max" means no limit
        sizes.append(limit - int((group / "memory.current").read_text(encoding="ascii")))
    known = [size for size in sizes if size != resource.RLIM_INFINITY]
    return max(0, min(known, default=UNKNOWN))


def give_back() -> None:
    """Return freed memory to the system before a demanding step; glibc keeps fragments."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


@contextmanager
def uncollected() -> Iterator[None]:
    """Collect no garbage in the block: what a start makes stays, and each collection would search it all."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def keep_heap_small() -> None:
    """Allocate large arrays outside the heap of a process that runs for days, where the C library can.

    glibc takes them from the heap after the first one was freed, and keeps the gaps between them.
    """
    with suppress(OSError, AttributeError):
        libc = ctypes.CDLL(None)
        for option, value in MALLOPT.items():
            libc.mallopt(option, value)


def reserve_workspace() -> None:
    """Allocate the workspace of both BLAS libraries at once if the address space is limited.

    OpenBLAS repeats a failing mmap for ever: a run with no room left would never end.

    Raises MemoryError: no room.
    """
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    if soft == resource.RLIM_INFINITY:
        return
    if soft - _in_use() < WORKSPACE:
        raise MemoryError
    import numpy as np
    import scipy.linalg

    scipy.linalg.cholesky(np.eye(300))
    np.ones((900, 900)) @ np.ones((900, 900))


def is_memory_error(problem: MemoryError | ImportError | OSError) -> bool:
    """True for a memory error, and for a library that did not fit into memory."""
    text = str(problem)
    unfit = any(words in text for words in UNLOADED) or (UNFOUND in text and bool(_limit()))
    return isinstance(problem, MemoryError) or unfit


def out_of_memory(problem: MemoryError | ImportError | OSError) -> str:
    """Message with the memory requested, if known, and the memory in use.

    >>> out_of_memory(MemoryError()).partition(" (limit")[0].partition(" with")[0]
    'out of memory'
    """
    shape, dtype = getattr(problem, "shape", None), getattr(problem, "dtype", None)  # numpy's request
    used = _in_use()
    if shape is None or dtype is None:
        return f"out of memory with {used / GIB:.1f} GiB in use{_limit()}: more is needed ({ADVICE})"
    more = math.prod(shape) * dtype.itemsize
    what = " x ".join(str(n) for n in shape)
    return (
        f"out of memory: an array of {what} needs {_size(more)} beside {used / GIB:.1f} GiB in use{_limit()}, "
        f"at least {_size(used + more)} in all ({ADVICE})"
    )


def killed_process_message(name: str, peak: int) -> str:
    """Message for a process ended by the system.

    name   of the signal
    peak   largest memory in use, bytes
    """
    if name == "SIGBUS":
        return "ended by SIGBUS: an input file was truncated, or the disk is full; no partial output remains"
    return (
        f"ended by {name} with {peak / GIB:.1f} GiB in use{_limit()}: most likely out of memory, more is "
        f"needed ({ADVICE}); no partial output remains"
    )


def _size(count: float) -> str:
    """Bytes as text.

    >>> _size(3.5 * 2**30), _size(20 * 2**20)
    ('3.5 GiB', '20 MiB')
    """
    return f"{count / GIB:.1f} GiB" if count >= GIB else f"{count / 2**20:.0f} MiB"


def _in_use() -> int:
    """Peak address space in bytes, to which a limit applies; peak memory where unknown."""
    with suppress(OSError, ValueError, StopIteration), open("/proc/self/status", encoding="ascii") as lines:
        return 1024 * int(next(line for line in lines if line.startswith("VmPeak")).split()[1])
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _limit() -> str:
    """Limit of the process's address space as text; "" for none."""
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return "" if soft == resource.RLIM_INFINITY else f" (limit {_size(soft)}, by ulimit -v or prlimit --as)"
