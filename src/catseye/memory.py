"""Memory of a process: freed pages returned to the system, and one line for a run that has too little."""

import ctypes
import math
import resource
from contextlib import suppress

GIB = 2.0**30
UNLOADED = ("failed to map segment", "cannot allocate memory", "Cannot allocate memory")  # the loader's words
UNFOUND = "load shared object file"  # llvmlite's, whose file is missing or did not fit
WORKSPACE = 200 * 2**20  # bytes: 32 MiB a library and thread of OpenBLAS, the libraries themselves, their arguments
ADVICE = "expected a machine or a limit with more; fewer shots or points at once need less"


def give_back() -> None:
    """Return freed memory to the system, before a step that needs much of it; glibc keeps what lies in pieces."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def reserve_workspace() -> None:
    """Let both BLAS libraries take their workspace at once, where the address space is limited.

    OpenBLAS repeats an mmap that fails for ever: a run that came to it with no room left would never end.

    Raises MemoryError: no room even now.
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


def lacks_memory(problem: MemoryError | ImportError | OSError) -> bool:
    """True for an error of memory, and for a library that did not fit into it."""
    text = str(problem)
    unfit = any(words in text for words in UNLOADED) or (UNFOUND in text and bool(_limit()))
    return isinstance(problem, MemoryError) or unfit


def out_of_memory(problem: MemoryError | ImportError | OSError) -> str:
    """One line: the memory asked for, where the error says it, and the memory in use.

    >>> out_of_memory(MemoryError()).partition(" (limit")[0].partition(" with")[0]
    'out of memory'
    """
    shape, dtype = getattr(problem, "shape", None), getattr(problem, "dtype", None)  # numpy says what it wanted
    used = _in_use()
    if shape is None or dtype is None:
        return f"out of memory with {used / GIB:.1f} GiB in use{_limit()}: more than that is needed ({ADVICE})"
    more = math.prod(shape) * dtype.itemsize
    what = " x ".join(str(n) for n in shape)
    return (
        f"out of memory: an array of {what} needs {_size(more)} beside {used / GIB:.1f} GiB in use{_limit()}, "
        f"at least {_size(used + more)} in all ({ADVICE})"
    )


def memory_of_a_killed(name: str, peak: int) -> str:
    """The line for a process that the system ended.

    name   of the signal
    peak   bytes that it had at most
    """
    if name == "SIGBUS":
        return "ended by SIGBUS: a file that was read was cut off, or its disk is full; nothing half-written is left"
    return (
        f"ended by {name} with {peak / GIB:.1f} GiB in use{_limit()}: most likely out of memory, more than that is "
        f"needed ({ADVICE}); nothing half-written is left"
    )


def _size(count: float) -> str:
    """Bytes for people.

    >>> _size(3.5 * 2**30), _size(20 * 2**20)
    ('3.5 GiB', '20 MiB')
    """
    return f"{count / GIB:.1f} GiB" if count >= GIB else f"{count / 2**20:.0f} MiB"


def _in_use() -> int:
    """Bytes of address space at the most so far: what a limit counts; of memory where the system does not say."""
    with suppress(OSError, ValueError, StopIteration), open("/proc/self/status", encoding="ascii") as status:
        return 1024 * int(next(line for line in status if line.startswith("VmPeak")).split()[1])
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _limit() -> str:
    """The limit of the process's address space, where there is one."""
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return "" if soft == resource.RLIM_INFINITY else f" (limit {_size(soft)}, by ulimit -v or prlimit --as)"
