"""Units of work for tests of many: quick ones, ones that fail, ones that kill their process."""

import errno
import hashlib
import json
import math
import os
import signal
import sys
import time
from pathlib import Path

from catseye.errors import InputError
from catseye.gateways.writers.output import atomic_directory
from catseye.interruption import exit_on_signals
from catseye.service.many.run import StoppedError, run_many
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


def unsendable():
    """An answer that no process can send."""
    return {"function": lambda: None}


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


def written(number, folder, seconds):
    """A unit that writes a folder in steps, whole or not at all, and answers with a digest of what it wrote."""
    out, digest = Path(folder) / f"out-{number}", hashlib.sha256()
    with atomic_directory(out) as fresh:
        for part in range(4):
            time.sleep(seconds / 4)
            content = f"{number} {part} {math.sin(number + part / 3)!r}\n".encode() * 200
            (fresh / f"{part}.txt").write_bytes(content)
            digest.update(content)
        (fresh / "provenance.json").write_text(
            '{"format": "catseye-result-1", "outputs": {"0.txt": "", "1.txt": "", "2.txt": "", "3.txt": ""}}'
        )
    return {"digest": digest.hexdigest()}


def writers(folder, count=6, seconds=0.4):
    """Units that write."""
    place = Path(folder)
    return [Unit(f"w{k}", written, (k, str(folder), seconds), key="1", output=place / f"out-{k}") for k in range(count)]


def main():
    """A run in a process of its own: FOLDER COUNT SECONDS PROCESSES CLUSTER RESUME; a line of JSON at its end."""
    folder, count, seconds, processes, cluster, resume = sys.argv[1:]
    exit_on_signals()
    line = {}
    try:
        outcomes = run_many(
            writers(folder, int(count), float(seconds)),
            ledger=Path(folder) / "ledger",
            processes=int(processes),
            cluster=cluster or None,
            resume=resume == "resume",
            progress=lambda task, done, total: say({"done": done, "total": total}),
        )
        line = {each.name: [each.state, each.value and each.value["digest"], each.why] for each in outcomes}
    except StoppedError as problem:
        line = {"stopped": str(problem), "done": problem.done, "total": problem.total}
    say(line)


def say(line):
    """Write a line of JSON at once."""
    sys.stdout.write(json.dumps(line) + "\n")
    sys.stdout.flush()
