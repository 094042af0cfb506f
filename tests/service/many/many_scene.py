"""Units of work for tests of many: quick ones, ones that fail, ones that kill their process."""

import errno
import os
import signal
import sys
import time
from pathlib import Path

from catseye.errors import InputError
from catseye.service.many.unit import Unit


def square(number):
    """Square of a number, and what this process is."""
    return {"square": number * number, "third": number / 3.0, "threads": os.environ["OPENBLAS_NUM_THREADS"]}


def process_of(number):
    """Number and process."""
    return {"number": number, "pid": os.getpid(), "scipy": "scipy" in sys.modules}


def backwards(number, count):
    """The later asked, the earlier answered."""
    time.sleep(0.05 * (count - number))
    return {"number": number}


def noted(number, folder):
    """Leave a trace of having been done."""
    with (Path(folder) / f"{number}.trace").open("a") as stream:
        stream.write("done\n")
    return {"number": number}


def refused(number):
    """A unit whose input is bad."""
    raise InputError(f"shots.csv: row {number}, range = -1 (expected 0 or more)")


def broken(number):
    """A unit with a fault of ours."""
    return {"value": [][number]}


def killed(number):
    """A unit that ends its process each time."""
    os.kill(os.getpid(), signal.SIGKILL)
    return {"number": number}


def killed_once(number, folder):
    """A unit whose first process is killed."""
    trace = Path(folder) / f"{number}.killed"
    if not trace.exists():
        trace.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"number": number}


def full(number):
    """A unit that finds the disk full."""
    try:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    except OSError as problem:
        raise InputError(f"--out {number}: cannot be written: {problem.strerror}") from problem


def span(number, seconds, folder):
    """Begin and end of this unit, s."""
    start = time.monotonic()
    time.sleep(seconds)
    return {"number": number, "start": start, "end": time.monotonic()}


def units(work, count, *more, **fields):
    """Units of one kind."""
    return [Unit(f"{work.__name__}-{k}", work, (k, *more), **fields) for k in range(count)]
