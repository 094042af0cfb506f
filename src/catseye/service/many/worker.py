"""Worker process: its start with one thread of linear algebra, its signals, and its end with the run."""

import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from types import ModuleType

from catseye.interruption import exit_on_signals, leave
from catseye.memory import keep_heap_small
from catseye.processors import VARIABLES

ONE_THREAD = (*VARIABLES, "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
GRACE = 1.5  # s for the main thread to undo its output, which may be inside a long call of a library
SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def starting(*, with_main: bool) -> Iterator[None]:
    """Start processes in the block: one thread each, signals held back until they know what to do.

    with_main   they import the main module, as functions from it need; without, a script needs no `if __name__ ==
                "__main__"`
    """
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    main = sys.modules["__main__"]
    if not with_main:
        sys.modules["__main__"] = ModuleType("__main__")
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        sys.modules["__main__"] = main
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def begin(lifeline: Connection) -> None:
    """Prepare this process for its first unit.

    lifeline   that the run holds: at its end, however it came, this process undoes what it writes and ends
    """
    exit_on_signals()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the run, which lets go of the lifeline
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    keep_heap_small()
    threading.Thread(target=_end_with, args=(lifeline,), name="catseye-lifeline", daemon=True).start()


def _end_with(lifeline: Connection) -> None:
    with suppress(EOFError, OSError):
        lifeline.recv_bytes()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(GRACE)
    leave(signal.SIGTERM)
