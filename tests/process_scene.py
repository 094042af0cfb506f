"""Processes that end with the test run that started them, also where kill -9 ends it and no test can clean up."""

import ctypes
import os
import signal

PDEATHSIG = 1  # PR_SET_PDEATHSIG of prctl(2); it outlives exec
_libc = ctypes.CDLL(None)


def ends_with_us(number=signal.SIGKILL):
    """A `preexec_fn` by which the kernel sends a child that signal once the thread that started it is no more."""
    parent = os.getpid()

    def ask():
        if hasattr(_libc, "prctl"):  # Linux
            _libc.prctl(PDEATHSIG, int(number), 0, 0, 0)
            if os.getppid() != parent:  # it died in between
                os._exit(1)

    return ask
