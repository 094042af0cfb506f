"""Time from a command to its first shot: a living site started again and again.

python benchmarks/bench_start.py [--tries 5] [--site gbt] [--cold] [--json]

`simulate` and `serve --twin` are started with any free ports and a port that this program listens to; the time counts
from the start of the process until the coordinator says that the first shot is durable, the processor time is that of
all its processes until then. `--cold` starts each with empty caches of Python's and of numba's compiled code, as after
an installation. Of the time some 2.6 s are the first mirror's way from its index to the cube inside, which no computer
shortens; on a busy machine look at the processor time.
"""

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path
from statistics import median

COMMANDS = {"simulate": ("--minutes", "0"), "serve": ("--twin", "--start", "60635.125")}
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


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tries", type=int, default=5)
    parser.add_argument("--site", default="gbt")
    parser.add_argument("--cold", action="store_true", help="with empty caches of compiled code, too")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    first_shot("simulate", options.site, None)  # which fills the caches
    rows = []
    for cold in (False, True) if options.cold else (False,):
        for command in COMMANDS:
            told = []
            for _ in range(options.tries):
                with tempfile.TemporaryDirectory(prefix="catseye-bench-") as folder:
                    told.append(first_shot(command, options.site, Path(folder) if cold else None))
            wall, spent = (median(values) for values in zip(*told, strict=True))
            rows.append({"command": command, "cold": cold, "wall_s": wall, "processor_s": spent})
    load = os.getloadavg()[0]
    if options.json:
        sys.stdout.write(json.dumps({"first_shot": rows, "tries": options.tries, "load": load}) + "\n")
        return
    sys.stdout.write(f"command to first shot, medians of {options.tries}; load of the machine {load:.1f}\n")
    for row in rows:
        caches = "empty caches" if row["cold"] else "usual caches"
        sys.stdout.write(
            f"  {row['command']:<9} {caches}  {row['wall_s']:5.1f} s, {row['processor_s']:5.1f} s of processors\n"
        )


if __name__ == "__main__":
    main()
