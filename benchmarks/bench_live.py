"""A coordinator of 18 streaming rangers: its share of a core, the time from a buffer to its durable acknowledgement.

python benchmarks/bench_live.py [--seconds 30] [--rangers 18] [--heads fast|twin] [--postgresql URL] [--json]
python benchmarks/bench_live.py --seconds 600 --series FILE.csv
python benchmarks/bench_live.py --only-dark --dark 1000 --heads twin

The rangers are the twin's, in a process of their own, on sockets; 128 ms buffers back to back. `fast`: their heads have
the buffers ready (returns of the twin's truth), so that the generator does not take the second core; `twin`: the
twin's own heads. This process is the coordinator with all it has: links, guard, reduction, an epoch each 10 s, journal
with buffers, its own port; its share of a core is that of the process, all threads. Time counts from the end of a
buffer, by its stamp (in steps of 0.9 ms), until the entry is told as durable. Lost: fired, by the heads' own count,
and not in the journal.

Beside it what a user would write instead, on the same rangers: asyncio streams, a phase of each buffer, and sqlite3
with a commit a shot, samples as JSON or as bytes; no reduction, no guard, no epochs.

First it times dark orders: all rangers fire for one connection, and another says PS 0 to one after the other, each
second time behind a packet of long questions; the time from the order to its answer, by which the laser is off.

`--series` measures catseye alone, and the machine beside it: five times a second a buffer is written and flushed to the
same disk, and each second the kernel is asked how much of both cores' time a virtual machine's host gave to others.
The file has a row a shot, a flush and a second: kind (shot, flush, stolen), s since the first, ms. `studies/lasting.py`
draws it.
"""

import argparse
import asyncio
import base64
import json
import os
import sqlite3
import sys
import tempfile
import threading
import time
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from catseye.coordinator.journal.entries import AnsweredShot
from catseye.coordinator.journal.reader import JournalReader
from catseye.records.site.folder import REFERENCE
from catseye.service.coordinator import LiveCoordinator, Orders, Peers
from load_scene import LoadChild, load_site, lost_and_doubled

TICK = 864e-6  # s
LONGEST_START, SETTLED, DRAINED = 60.0, 14.0, 2.0  # s
PEER_SECONDS = 10.0
COMMANDING = ("LEASE peer", "AXIS 0, 1", "AXIS 1, 1", "PS 1", "CIL 0", "STM 0, 1000000")  # who fires by hand
DARK_LIMIT_MS = 100.0
LISTINGS = 8  # long answers that a dark order stands behind, each second time
RENEWED = 5.0  # s
BUFFER_BYTES = 16_384


@dataclass(frozen=True)
class Result:
    """Of one run: shots a second a ranger; % of a core, also of the process of epochs; ms until durable."""

    name: str
    rate: float
    cpu_percent: float
    ms_a_shot: float
    p50_ms: float
    p90_ms: float
    p99_ms: float
    max_ms: float
    shots: int
    lost: int | None = None
    doubled: int | None = None
    solving_percent: float | None = None


def result(name: str, late: list[float], cpu: float, wall: float, rangers: int, **counts: int) -> Result:
    quantiles = (float(v) * 1e3 for v in np.percentile(late, [50, 90, 99, 100]))
    n = len(late)
    return Result(name, n / wall / rangers, 100.0 * cpu / wall, 1e3 * cpu / n, *quantiles, n, **counts)


async def coordinated(
    child: LoadChild, site: Any, journal: str, name: str, seconds: float, told: list[tuple[float, float]] | None = None
) -> Result:
    """The coordinator; first a round that gives each ranger a reference and a target, then streams.

    told   is filled with when each shot was durable (`time.monotonic`) and how many s after its buffer's end
    """
    told = [] if told is None else told
    targets: dict[str, str] = {}
    before = child.report()["fired"]
    running = LiveCoordinator(
        site, Orders(journal=journal, port=0), Peers(child.addresses, child.feed), clock=child.clock
    )

    def entry(entry: Any) -> None:
        if isinstance(entry, AnsweredShot):
            shot = entry.shot
            told.append((time.monotonic(), child.clock.now_ns() * 1e-9 - shot.ticks * TICK - shot.duration))
            if entry.status == "used" and shot.target != REFERENCE:
                targets[shot.ranger] = shot.target

    running.ziy.listeners.append(entry)
    task = asyncio.create_task(running.run())
    began = time.monotonic()
    while len(targets) < len(child.addresses) and time.monotonic() - began < LONGEST_START:
        await asyncio.sleep(0.2)
    for ranger in child.addresses:
        running.ziy.stream(ranger, targets.get(ranger, REFERENCE))
    await asyncio.sleep(SETTLED)  # the round that was planned before comes to its end
    told.clear()
    cpu, solving, wall = time.process_time(), solver_cpu(running), time.perf_counter()
    await asyncio.sleep(seconds)
    cpu, wall, measured = time.process_time() - cpu, time.perf_counter() - wall, [late for _, late in told]
    solving = solver_cpu(running) - solving
    for ranger in child.addresses:
        running.ziy.stream(ranger, None)
    running.ziy.mode = "hold"  # streams under way come to their end
    while any(link.busy for link in running.ziy.links.values()):
        await asyncio.sleep(0.1)
    await asyncio.sleep(DRAINED)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    fired = {name: ticks[len(before[name]) :] for name, ticks in child.report()["fired"].items()}
    lost, doubled = lost_and_doubled(fired, JournalReader(journal))
    found = result(name, measured, cpu, wall, len(child.addresses), lost=lost, doubled=doubled)
    return replace(found, solving_percent=100.0 * solving / wall)


def solver_cpu(running: LiveCoordinator) -> float:
    """s of the process that solves epochs."""
    used = Path(f"/proc/{running.solver_pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(used[11]) + int(used[12])) / os.sysconf("SC_CLK_TCK")


async def by_hand(child: LoadChild, path: Path, name: str, seconds: float, *, as_json: bool) -> Result:
    """What a user would write: a task a ranger, a commit a shot."""
    late: list[float] = []
    turn = np.exp(1j * 2.0 * np.pi * np.arange(BUFFER_BYTES // 2) / 64) * 2.0 / (BUFFER_BYTES // 2)
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE shots (ranger TEXT, stamp TEXT, amplitude REAL, phase REAL, samples)")

        async def listen(ranger: str) -> None:
            at = child.addresses[ranger]
            reader, writer = await asyncio.open_connection(at.host, at.ports[0], limit=2**20)
            writer.write("".join(f"{line}\n" for line in COMMANDING).encode())
            try:
                while line := await reader.readline():
                    _, stamp, body = line.decode().rstrip().split("\t") if b"\t" in line else ("", "", "")
                    if not body.startswith("BUF 1"):
                        continue
                    _, _, cycles, _, hertz, volts, _, text = body.split(", ")
                    samples = np.frombuffer(base64.b64decode(text), dtype="<i2")
                    found = complex(turn @ samples) * float(volts)
                    kept = json.dumps(samples.tolist()) if as_json else samples.tobytes()
                    row = (ranger, stamp, abs(found), float(np.angle(found)), kept)
                    database.execute("INSERT INTO shots VALUES (?, ?, ?, ?, ?)", row)
                    database.commit()
                    day, rest = stamp.split(".")
                    ticks = int(day) * 10**8 + int(rest)
                    late.append(child.clock.now_ns() * 1e-9 - ticks * TICK - int(cycles) / int(hertz))
            finally:
                writer.close()

        tasks = [asyncio.create_task(listen(ranger)) for ranger in child.addresses]
        await asyncio.sleep(3.0)
        late.clear()
        cpu, wall = time.process_time(), time.perf_counter()
        await asyncio.sleep(seconds)
        cpu, wall, measured = time.process_time() - cpu, time.perf_counter() - wall, list(late)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    return result(name, measured, cpu, wall, len(child.addresses))


@dataclass(frozen=True)
class DarkResult:
    """Dark orders to rangers that all fire: count, ms until answered, % within the limit."""

    tries: int
    p50_ms: float
    p99_ms: float
    max_ms: float
    within_percent: float
    load: float


class FiringRanger:
    """A ranger that one connection has fire without end, and another makes dark."""

    def __init__(self, at: Any):
        self._at, self._token, self.heard = at, "", asyncio.Queue[str]()
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        host, ports = self._at.host, self._at.ports
        self._holder = await asyncio.open_connection(host, ports[0], limit=2**20)
        self._other = await asyncio.open_connection(host, ports[1], limit=2**20)
        self._say(self._holder, *COMMANDING)
        self._tasks = [asyncio.create_task(each) for each in (self._hold(), self._renew(), self._listen())]
        await self.until("CMEAS 1")

    async def stop(self) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for _, writer in (self._holder, self._other):
            writer.close()

    async def darkened(self, tid: int, *, behind: int, pause: float) -> float:
        """s from a PS 0, behind so many listings, to its answer; then it fires again.

        pause   s, from a measurement to the order
        """
        await self.until("CMEAS 1")
        await asyncio.sleep(pause)
        began = time.perf_counter()
        self._say(self._other, *["COO"] * behind, f"{tid}\tPS 0")
        await self.until("PS 1, 0", tid)
        took = time.perf_counter() - began
        await self.until("CMEAS 0", fresh=False)  # the stream is over, and a new one may begin
        self._say(self._other, "UNLATCH bench")
        await self.until("LATCH 1, none")
        self._say(self._holder, "PS 1", "STM 0, 1000000")
        return took

    async def until(self, words: str, tid: int | None = None, *, fresh: bool = True) -> None:
        """Wait for a line; a fresh one was not there before."""
        while fresh and not self.heard.empty():
            self.heard.get_nowait()
        while True:
            head, _, body = (await self.heard.get()).rpartition("\t")
            if body.startswith(words) and (tid is None or head.startswith(f"{tid}\t")):
                return

    def _say(self, connection: Any, *lines: str) -> None:
        connection[1].write("".join(f"{line}\n" for line in lines).encode())

    async def _hold(self) -> None:
        while line := await self._holder[0].readline():
            if b"\tLEASE 1, peer" in line and not self._token:
                self._token = line.decode().rsplit(", ", 1)[1].strip()

    async def _renew(self) -> None:
        while True:
            await asyncio.sleep(RENEWED)
            self._say(self._holder, f"LEASE peer, {self._token}")

    async def _listen(self) -> None:
        while line := await self._other[0].readline():
            self.heard.put_nowait(line.decode("ascii").rstrip())


async def dark_orders(child: LoadChild, tries: int) -> DarkResult:
    """Time until rangers that all fire are dark, one after another."""
    rangers = [FiringRanger(at) for at in child.addresses.values()]
    late: list[float] = []
    rng = np.random.default_rng(40)
    try:
        await asyncio.gather(*(ranger.start() for ranger in rangers))
        for k in range(tries):
            ranger = rangers[k % len(rangers)]
            behind = LISTINGS * (k // len(rangers) % 2)
            late.append(1e3 * await ranger.darkened(1000 + k, behind=behind, pause=rng.uniform(0.0, 0.128)))
    finally:
        await asyncio.gather(*(ranger.stop() for ranger in rangers))
    p50, p99, most = (float(v) for v in np.percentile(late, [50, 99, 100]))
    within = 100.0 * float(np.mean(np.array(late) <= DARK_LIMIT_MS))
    return DarkResult(tries, p50, p99, most, within, os.getloadavg()[0])


def machine(folder: Path) -> dict[str, float]:
    """What no program here can be faster than: a flush of one buffer to the disk, copying it, its base64."""
    raw = os.urandom(BUFFER_BYTES)
    text = base64.b64encode(raw)
    spent = []
    with (folder / "flushed").open("wb", buffering=0) as file:
        for _ in range(200):
            file.write(raw)
            began = time.perf_counter()
            os.fsync(file.fileno())
            spent.append(time.perf_counter() - began)
    taken = {}
    for name, job in (("copy_us", lambda: bytearray(raw)), ("base64_us", lambda: base64.b64decode(text))):
        best = float("inf")
        for _ in range(20):
            began = time.perf_counter()
            for _ in range(50):
                job()
            best = min(best, (time.perf_counter() - began) / 50)
        taken[name] = best * 1e6
    return {
        "flush_p50_ms": float(np.median(spent)) * 1e3,
        "flush_p99_ms": float(np.percentile(spent, 99)) * 1e3,
        **taken,
    }


async def measured(options: argparse.Namespace, folder: Path) -> tuple[list[Result], DarkResult]:
    site = load_site(options.rangers)
    found = []
    with LoadChild(options.rangers, twin=options.heads == "twin") as child:
        dark = await dark_orders(child, options.dark)
        places = [("catseye, SQLite", str(folder / "night.db"))]
        if options.postgresql:
            places.append(("catseye, PostgreSQL", options.postgresql))
        for name, place in places:
            found.append(await coordinated(child, site, place, name, options.seconds))
        for name, as_json in (("asyncio, JSON, a commit each", True), ("asyncio, bytes, a commit each", False)):
            path = folder / f"{len(found)}.db"
            found.append(await by_hand(child, path, name, min(options.seconds, PEER_SECONDS), as_json=as_json))
    return found, dark


async def darkness(options: argparse.Namespace) -> DarkResult:
    with LoadChild(options.rangers, twin=options.heads == "twin") as child:
        return await dark_orders(child, options.dark)


def tell_dark(dark: DarkResult, rangers: int) -> None:
    sys.stdout.write(
        f"dark orders: {dark.tries} to {rangers} rangers that fire, answered in p50 {dark.p50_ms:.1f} ms, p99 "
        f"{dark.p99_ms:.1f}, most {dark.max_ms:.1f}; {dark.within_percent:.1f} % within {DARK_LIMIT_MS:g} ms; load of "
        f"the machine {dark.load:.1f}\n"
    )


class Machine(threading.Thread):
    """Record of the machine's own delays until stopped: (kind, `time.monotonic`, ms)."""

    def __init__(self, path: Path):
        super().__init__(daemon=True)
        self._path, self._stopped, self.rows = path, threading.Event(), []

    def run(self) -> None:
        """Write and flush, a buffer over the one before, so that the file does not grow; read what was stolen."""
        raw = os.urandom(BUFFER_BYTES)
        stolen, turns = stolen_ms(), 0
        with self._path.open("wb", buffering=0) as file:
            while not self._stopped.wait(0.2):
                file.seek(0)
                file.write(raw)
                began = time.perf_counter()
                os.fsync(file.fileno())
                self.rows.append(("flush", time.monotonic(), 1e3 * (time.perf_counter() - began)))
                turns += 1
                if turns % 5 == 0:
                    before, stolen = stolen, stolen_ms()
                    self.rows.append(("stolen", time.monotonic(), stolen - before))

    def stop(self) -> None:
        """End it."""
        self._stopped.set()
        self.join()


def stolen_ms() -> float:
    """ms of all cores since the machine began that its host did not give it."""
    with Path("/proc/stat").open(encoding="ascii") as file:
        return 1e3 * int(file.readline().split()[8]) / os.sysconf("SC_CLK_TCK")


async def series(options: argparse.Namespace, folder: Path) -> Result:
    """A long run, shot by shot, into a table."""
    told: list[tuple[float, float]] = []
    machine = Machine(folder / "flushed")
    with LoadChild(options.rangers, twin=options.heads == "twin") as child:
        machine.start()
        place, name = str(folder / "night.db"), "catseye, SQLite"
        found = await coordinated(child, load_site(options.rangers), place, name, options.seconds, told)
        machine.stop()
    began, ended = told[0][0], told[found.shots - 1][0]
    rows = [("shot", at, 1e3 * late) for at, late in told[: found.shots]]
    rows += [row for row in machine.rows if began <= row[1] <= ended]
    text = "kind,s,ms\n" + "".join(f"{kind},{at - began:.3f},{ms:.3f}\n" for kind, at, ms in rows)
    options.series.write_text(text, encoding="utf-8")
    flushes = [ms for kind, _, ms in rows if kind == "flush"]
    stolen = [ms for kind, _, ms in rows if kind == "stolen"]
    p99 = float(np.percentile(flushes, 99))
    sys.stdout.write(
        f"{found.shots} shots in {options.seconds:g} s: p50 {found.p50_ms:.1f} ms, p99 {found.p99_ms:.1f}, most "
        f"{found.max_ms:.1f}; lost {found.lost}, doubled {found.doubled}; a flush p50 "
        f"{np.median(flushes):.1f} ms, p99 {p99:.1f}; limit max(20, 3 x {p99:.1f}) ms; stolen {np.mean(stolen):.0f} ms "
        f"a second, {np.max(stolen):.0f} in the worst\n"
    )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--rangers", type=int, default=18)
    parser.add_argument("--heads", choices=("fast", "twin"), default="fast")
    parser.add_argument("--postgresql", metavar="URL", help="an empty database")
    parser.add_argument("--folder", type=Path, help="where the journals are written and removed again")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--series", type=Path, metavar="FILE.csv", help="a row for each shot, flush and second")
    parser.add_argument("--dark", type=int, default=200, help="dark orders that are timed")
    parser.add_argument("--only-dark", action="store_true", help="nothing else")
    options = parser.parse_args()
    if options.only_dark:
        tell_dark(asyncio.run(darkness(options)), options.rangers)
        return
    with tempfile.TemporaryDirectory(dir=options.folder) as name:
        folder = Path(name)
        if options.series:
            asyncio.run(series(options, folder))
            return
        found, dark = asyncio.run(measured(options, folder))
        limits = machine(folder)
    load = os.getloadavg()[0]
    if options.json:
        sys.stdout.write(
            json.dumps(
                {"results": [asdict(each) for each in found], "dark": asdict(dark), "machine": limits, "load": load}
            )
            + "\n"
        )
        return
    ours = found[0]
    sys.stdout.write(
        f"{options.rangers} rangers, {options.heads} heads, {options.seconds:g} s; load of the machine {load:.1f}\n"
    )
    head = (
        "shots/s",
        "% of a core",
        "epochs %",
        "ms a shot",
        "ratio",
        "p50 ms",
        "p90",
        "p99",
        "max",
        "lost",
        "doubled",
    )
    sys.stdout.write(f"{'':<32}" + "".join(f"{each:>12}" for each in head) + "\n")
    for r in found:
        solving = "" if r.solving_percent is None else f"{r.solving_percent:.1f}"
        row = [
            f"{r.rate:.2f}",
            f"{r.cpu_percent:.1f}",
            solving,
            f"{r.ms_a_shot:.2f}",
            f"{r.ms_a_shot / ours.ms_a_shot:.1f} x",
        ]
        row += [f"{v:.1f}" for v in (r.p50_ms, r.p90_ms, r.p99_ms, r.max_ms)]
        row += ["" if v is None else str(v) for v in (r.lost, r.doubled)]
        sys.stdout.write(f"  {r.name:<30}" + "".join(f"{each:>12}" for each in row) + "\n")
    tell_dark(dark, options.rangers)
    sys.stdout.write(
        f"machine: a flush of {BUFFER_BYTES} bytes {limits['flush_p50_ms']:.1f} ms (99th percentile "
        f"{limits['flush_p99_ms']:.1f}), a copy {limits['copy_us']:.1f} us, base64 {limits['base64_us']:.0f} us\n"
    )


if __name__ == "__main__":
    main()
