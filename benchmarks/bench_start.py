"""Time to begin: imports, the command's help, and from a command to a living site's first shot.

python benchmarks/bench_start.py [--quick]
python benchmarks/bench_start.py --cold    with empty caches of Python's and of numba's compiled code, too

`simulate` and `serve --twin` are started with any free ports and a port that this program listens to; the time counts
from the start of the process until the coordinator says that the first shot is durable, the processor time is that of
all its processes until then. Of the time some 2.6 s are the first mirror's way from its index to the cube inside, which
no computer shortens. Imports count the processor time of a process of their own.
"""

import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from harness import LIMIT, Contender, Row, main, raced, spread

COMMANDS = {"simulate": ("--minutes", "0"), "serve": ("--twin", "--start", "60635.125")}
SITE, TRIES, COLD = "gbt", 3, "--cold"
PORTS = range(41_000, 60_000, 400)  # bases of a twin's ports
LONGEST = 180.0  # s
TICK = os.sysconf("SC_CLK_TCK")


def free_base() -> int:
    """Base of ports for 18 rangers, a feed and a coordinator of which the first and the last are free."""
    for base in PORTS:
        with closing(socket.socket()) as first, closing(socket.socket()) as last:
            try:
                first.bind(("127.0.0.1", base))
                last.bind(("127.0.0.1", base + 399))
            except OSError:
                continue
            return base
    raise SystemExit("no free ports")


def processor_seconds(pid: int) -> float:
    """Processor time of a process and its descendants, those that have ended included, s."""
    children: dict[int, list[int]] = {}
    spent: dict[int, float] = {}
    for folder in Path("/proc").iterdir():
        if not folder.name.isdecimal():
            continue
        try:
            words = (folder / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        except OSError:
            continue
        children.setdefault(int(words[1]), []).append(int(folder.name))
        spent[int(folder.name)] = sum(int(word) for word in words[11:15]) / TICK
    family = [pid]
    for member in family:
        family += children.get(member, [])
    return sum(spent.get(member, 0.0) for member in family)


def first_shot(command: str, site: str, caches: Path | None) -> tuple[float, float]:
    """Seconds from a command to its first shot, and processor seconds.

    caches   empty folder of compiled code; None: the usual ones
    """
    base = free_base()
    words = [command, site, *COMMANDS[command], "--port-base", str(base), "--port", str(base + 399)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    if caches is not None:
        environment |= {"PYTHONPYCACHEPREFIX": str(caches), "NUMBA_CACHE_DIR": str(caches / "numba")}
    began = time.monotonic()
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "catseye", *words],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as process:
        try:
            with closing(connected(base + 399, process)) as connection:
                connection.sendall(b"SUBSCRIBE SHOT\n")
                for line in connection.makefile("r"):
                    if line.rpartition("\t")[2].startswith("SHOT"):
                        return time.monotonic() - began, processor_seconds(process.pid)
            raise SystemExit(f"{command} ended before its first shot")
        finally:
            process.send_signal(signal.SIGTERM)


def connected(port: int, process: "subprocess.Popen[bytes]") -> socket.socket:
    """Connection to the coordinator's port, once it listens."""
    until = time.monotonic() + LONGEST
    while time.monotonic() < until and process.poll() is None:
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=LONGEST)
        except ConnectionRefusedError:
            time.sleep(0.01)
    raise SystemExit("the coordinator did not start")


def processor(*words: str) -> float:
    """Processor s of a Python of its own."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-P", *words], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def started(*words: str) -> Contender:
    """Contender of a Python's whole life."""
    return Contender(lambda: processor(*words), timed=True)


def site_row(command: str, *, cold: bool) -> Row:
    """Row of a living site's start."""
    taken = []
    for _ in range(TRIES):
        with tempfile.TemporaryDirectory(prefix="catseye-bench-") as folder:
            taken.append(first_shot(command, SITE, Path(folder) if cold else None))
    wall, spent = np.array(taken).T
    return Row(
        path=f"{command}, command to first shot",
        what=f"site {SITE}, {'empty' if cold else 'usual'} caches",
        ours_s=float(np.median(wall)),
        beside={},
        limit_s=None,
        spread=spread(wall),
        note=f"{np.median(spent):.1f} s of processors",
    )


def rows(quick: bool) -> Iterator[Row]:
    """Imports and help; in a whole run the starts of a living site."""
    yield raced(
        "import catseye",
        "processor time of a new Python",
        {
            "catseye": started("-c", "import catseye"),
            "numpy": started("-c", "import numpy"),
            "scipy.optimize and scipy.signal": started("-c", "import scipy.optimize, scipy.signal"),
            "astropy.coordinates": started("-c", "import astropy.coordinates"),
            LIMIT: started("-c", "pass"),
        },
        quick=quick,
        note="the limit is Python alone",
    )
    yield raced(
        "catseye --help",
        "processor time of a new Python",
        {"catseye": started("-m", "catseye", "--help"), LIMIT: started("-c", "import typer")},
        quick=quick,
        note="the limit is Python with typer",
    )
    if quick:
        return
    first_shot("simulate", SITE, None)  # which fills the caches
    for cold in (False, True) if COLD in sys.argv else (False,):
        for command in COMMANDS:
            yield site_row(command, cold=cold)


if __name__ == "__main__":
    main(rows, flags={COLD: "a living site's start with empty caches, too"})
