"""A coordinator of 18 streaming rangers: its processor time a shot, and the time from a buffer to its durable entry.

python benchmarks/bench_live.py [--quick]
python benchmarks/bench_live.py --seconds 600 --series FILE.csv
python benchmarks/bench_live.py --only-dark --dark 1000 --heads twin
python benchmarks/bench_live.py --postgresql URL    the journal in an empty database

The rangers are the twin's, in a process of their own, on sockets; 128 ms buffers back to back. `fast`: their heads have
the buffers ready (returns of the twin's truth), so that the generator does not take the second core; `twin`: the
twin's own heads. This process is the coordinator with all it has: links, guard, reduction, an epoch each 10 s, journal
with buffers, its own port; its processor time is that of the process, all threads. Time counts from the end of a
buffer, by its stamp (in steps of 0.9 ms), until the entry is reported as durable. Lost: fired, by the heads' own count,
and not in the journal.

Beside it what a user would write instead, on the same rangers: asyncio streams, a phase of each buffer, and sqlite3
with a commit a shot, samples as JSON or as bytes; no reduction, no guard, no epochs. Where the disk is slow it falls
behind, and its delay grows as long as it runs. The limits: base64 and a copy of a buffer; a flush of it to the disk.

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
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import limits
from catseye.coordinator.journal.entries import AnsweredShot
from catseye.coordinator.journal.reader import JournalReader
from catseye.records.site.folder import REFERENCE
from catseye.service.coordinator import LiveCoordinator, Orders, Peers
from dark import COMMANDING, LIMIT_MS, DarkResult, dark_orders
from harness import Row, main, spread
from load_scene import LoadChild, load_site, lost_and_doubled

TICK = 864e-6  # s
LONGEST_START, SETTLED, DRAINED, LONGEST_END = 60.0, 14.0, 2.0, 30.0  # s
RANGERS = 18
SECONDS, QUICK_SECONDS, PEER_SECONDS, PEER_SETTLED = 15.0, 10.0, 6.0, 2.0
SEGMENTS = 5  # of a measurement, for its spread
DARK_TRIES = 54
BUFFER_BYTES = 16_384


@dataclass(frozen=True)
class Measurement:
    """Shots of one run.

    late      s until durable, of each
    cpu       processor s a shot, of each segment
    rate      shots a second and ranger
    solving   share of a core of the process that solves epochs
    lost, doubled   shots, counted against what the heads fired; None where nobody counts
    """

    late: np.ndarray
    cpu: np.ndarray
    rate: float
    solving: float = 0.0
    lost: int | None = None
    doubled: int | None = None

    def percentile(self, percent: float) -> float:
        """Delay until durable, s."""
        return float(np.percentile(self.late, percent))


class Watch:
    """Processor time and shots of this process, segment by segment."""

    def __init__(self) -> None:
        self.late: list[tuple[float, float]] = []  # (`time.monotonic` when durable, s after its buffer's end)

    def note(self, late: float) -> None:
        """Count a shot that became durable just now."""
        self.late.append((time.monotonic(), late))

    async def measure(self, seconds: float, rangers: int, segments: int = SEGMENTS) -> Measurement:
        """Wait so long and measure what happens meanwhile."""
        self.late.clear()
        costs, begun = [], time.perf_counter()
        for _ in range(segments):
            cpu, count = time.process_time(), len(self.late)
            await asyncio.sleep(seconds / segments)
            costs.append((time.process_time() - cpu) / max(len(self.late) - count, 1))
        wall, late = time.perf_counter() - begun, np.array([late for _, late in self.late])
        if not len(late):
            raise SystemExit(f"no shot became durable in {seconds:g} s")
        return Measurement(late, np.array(costs), len(late) / wall / rangers)


async def coordinated(
    child: LoadChild, site: Any, journal: str, seconds: float, watch: Watch, *, segments: int = SEGMENTS
) -> Measurement:
    """The coordinator; first a round that gives each ranger a reference and a target, then streams."""
    targets: dict[str, str] = {}
    before = child.report()["fired"]
    running = LiveCoordinator(
        site, Orders(journal=journal, port=0), Peers(child.addresses, child.feed), clock=child.clock
    )

    def entry(entry: Any) -> None:
        if isinstance(entry, AnsweredShot):
            shot = entry.shot
            watch.note(child.clock.now_ns() * 1e-9 - shot.ticks * TICK - shot.duration)
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
    solving, wall = solver_cpu(running), time.perf_counter()
    found = await watch.measure(seconds, len(child.addresses), segments)
    solving, wall = solver_cpu(running) - solving, time.perf_counter() - wall
    for ranger in child.addresses:
        running.ziy.stream(ranger, None)
    running.ziy.mode = "hold"  # streams under way come to their end
    ending = time.monotonic() + LONGEST_END
    while any(link.busy for link in running.ziy.links.values()) and time.monotonic() < ending:
        await asyncio.sleep(0.1)
    await asyncio.sleep(DRAINED)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    fired = {name: ticks[len(before[name]) :] for name, ticks in child.report()["fired"].items()}
    lost, doubled = lost_and_doubled(fired, JournalReader(journal))
    return Measurement(
        late=found.late, cpu=found.cpu, rate=found.rate, solving=solving / wall, lost=lost, doubled=doubled
    )


def solver_cpu(running: LiveCoordinator) -> float:
    """s of the process that solves epochs."""
    used = Path(f"/proc/{running.solver_pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(used[11]) + int(used[12])) / os.sysconf("SC_CLK_TCK")


async def by_hand(child: LoadChild, path: Path, seconds: float, *, as_json: bool) -> Measurement:
    """Program that a user would write: a task a ranger, a commit a shot.

    A task that finds lines in its buffer never waits, so after each shot it lets the others run: or a disk slower than
    the rangers would keep this program from its clock, and the measurement from its end.
    """
    watch = Watch()
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
                    phasor = complex(turn @ samples) * float(volts)
                    stored = json.dumps(samples.tolist()) if as_json else samples.tobytes()
                    row = (ranger, stamp, abs(phasor), float(np.angle(phasor)), stored)
                    database.execute("INSERT INTO shots VALUES (?, ?, ?, ?, ?)", row)
                    database.commit()
                    day, rest = stamp.split(".")
                    ticks = int(day) * 10**8 + int(rest)
                    watch.note(child.clock.now_ns() * 1e-9 - ticks * TICK - int(cycles) / int(hertz))
                    await asyncio.sleep(0)
            finally:
                writer.close()

        tasks = [asyncio.create_task(listen(ranger)) for ranger in child.addresses]
        await asyncio.sleep(PEER_SETTLED)
        found = await watch.measure(seconds, len(child.addresses))
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    return found


# --- rows


def rows(quick: bool) -> Iterator[Row]:
    """Processor time a shot; in a whole run the delay until durable and dark orders, too."""
    with tempfile.TemporaryDirectory() as name:
        yield from asyncio.run(measured(Path(name), quick=quick))


async def measured(folder: Path, *, quick: bool) -> list[Row]:
    """Rows of one set of rangers: dark orders first, then ours, then by hand."""
    seconds = QUICK_SECONDS if quick else SECONDS
    with LoadChild(RANGERS) as child:
        dark = None if quick else await dark_orders(child, DARK_TRIES)
        ours = await coordinated(child, load_site(RANGERS), str(folder / "night.db"), seconds, Watch())
        peers = {
            f"asyncio and sqlite3, {kind}, no reduction": await by_hand(
                child, folder / f"{kind}.db", PEER_SECONDS, as_json=kind == "JSON"
            )
            for kind in ("JSON", "bytes")
        }
    return [*shot_rows(ours, peers, folder, quick=quick), *([] if dark is None else [dark_row(dark)])]


def shot_rows(ours: Measurement, peers: dict[str, Measurement], folder: Path, *, quick: bool) -> Iterator[Row]:
    """Rows of what a shot costs, and of how late it is durable."""
    raw = os.urandom(BUFFER_BYTES)
    text = base64.b64encode(raw)
    least = limits.median_seconds(lambda: [bytearray(base64.b64decode(text)) for _ in range(100)]) / 100
    what = f"{RANGERS} rangers, journal with samples"
    share = 100.0 * ours.rate * RANGERS * float(np.median(ours.cpu))
    yield Row(
        path="living site, processor time of a shot",
        what=what,
        ours_s=float(np.median(ours.cpu)),
        beside={name: float(np.median(peer.cpu)) for name, peer in peers.items()},
        limit_s=least,
        spread=spread(ours.cpu),
        note=f"{ours.rate:.2f} buffers a second of each ranger, {share:.0f} % "
        f"of a core, epochs {100 * ours.solving:.0f} % of another; the alternatives took "
        + " and ".join(f"{peer.rate:.2f}" for peer in peers.values())
        + " buffers a second",
    )
    if quick:
        return
    parts = np.array([np.median(part) for part in np.array_split(ours.late, SEGMENTS)])
    yield Row(
        path="living site, buffer to durable",
        what=what,
        ours_s=ours.percentile(50),
        beside={name: peer.percentile(50) for name, peer in peers.items()},
        limit_s=limits.flush(folder),
        spread=spread(parts),
        note=f"99 of 100 within {1e3 * ours.percentile(99):.1f} ms, the latest {1e3 * ours.percentile(100):.0f} ms; "
        f"{ours.lost} lost, {ours.doubled} doubled; the alternatives' 99 within "
        + " and ".join(f"{1e3 * peer.percentile(99):.0f} ms" for peer in peers.values()),
    )


def dark_row(dark: DarkResult) -> Row:
    """Row of dark orders."""
    return Row(
        path="living site, dark order to laser off",
        what=f"{dark.tries} orders to {RANGERS} rangers that fire",
        ours_s=dark.p50_ms * 1e-3,
        beside={},
        limit_s=None,
        spread=dark.spread,
        note=f"99 of 100 within {dark.p99_ms:.1f} ms, the latest {dark.max_ms:.1f} ms; {dark.within_percent:.1f} % "
        f"within {LIMIT_MS:g} ms",
    )


# --- long series, dark orders alone, PostgreSQL


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


async def series(options: argparse.Namespace, folder: Path) -> None:
    """A long run, shot by shot, into a table."""
    watch, recording = Watch(), Machine(folder / "flushed")
    with LoadChild(options.rangers, twin=options.heads == "twin") as child:
        recording.start()
        site = load_site(options.rangers)
        found = await coordinated(child, site, str(folder / "night.db"), options.seconds, watch)
        recording.stop()
    shots = watch.late[: len(found.late)]
    began, ended = shots[0][0], shots[-1][0]
    table = [("shot", at, 1e3 * late) for at, late in shots]
    table += [row for row in recording.rows if began <= row[1] <= ended]
    text = "kind,s,ms\n" + "".join(f"{kind},{at - began:.3f},{ms:.3f}\n" for kind, at, ms in table)
    options.series.write_text(text, encoding="utf-8")
    flushes, stolen = ([ms for kind, _, ms in table if kind == name] for name in ("flush", "stolen"))
    p99 = float(np.percentile(flushes, 99))
    sys.stdout.write(
        f"{len(shots)} shots in {options.seconds:g} s: p50 {1e3 * found.percentile(50):.1f} ms, p99 "
        f"{1e3 * found.percentile(99):.1f}, most {1e3 * found.percentile(100):.1f}; lost {found.lost}, doubled "
        f"{found.doubled}; a flush p50 {np.median(flushes):.1f} ms, p99 {p99:.1f}; limit max(20, 3 x {p99:.1f}) ms; "
        f"stolen {np.mean(stolen):.0f} ms a second, {np.max(stolen):.0f} in the worst\n"
    )


async def darkness(options: argparse.Namespace) -> None:
    """Dark orders alone."""
    with LoadChild(options.rangers, twin=options.heads == "twin") as child:
        dark = await dark_orders(child, options.dark)
    sys.stdout.write(
        f"dark orders: {dark.tries} to {options.rangers} rangers that fire, answered in p50 {dark.p50_ms:.1f} ms, p99 "
        f"{dark.p99_ms:.1f}, most {dark.max_ms:.1f}; {dark.within_percent:.1f} % within {LIMIT_MS:g} ms; load of the "
        f"machine {dark.load:.1f}\n"
    )


async def postgresql(options: argparse.Namespace) -> None:
    """The coordinator with its journal in a database."""
    with LoadChild(options.rangers, twin=options.heads == "twin") as child:
        found = await coordinated(child, load_site(options.rangers), options.postgresql, options.seconds, Watch())
    sys.stdout.write(
        f"PostgreSQL: {found.rate:.2f} shots/s a ranger, {1e3 * np.median(found.cpu):.2f} ms of a core a shot, durable "
        f"p50 {1e3 * found.percentile(50):.1f} ms, p99 {1e3 * found.percentile(99):.1f}; lost {found.lost}, doubled "
        f"{found.doubled}\n"
    )


def special() -> bool:
    """True if one of the long measurements was wanted, and done."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--rangers", type=int, default=RANGERS)
    parser.add_argument("--heads", choices=("fast", "twin"), default="fast")
    parser.add_argument("--postgresql", metavar="URL", help="an empty database")
    parser.add_argument("--folder", type=Path, help="where the journals are written and removed again")
    parser.add_argument("--series", type=Path, metavar="FILE.csv", help="a row for each shot, flush and second")
    parser.add_argument("--dark", type=int, default=200, help="dark orders that are timed")
    parser.add_argument("--only-dark", action="store_true", help="nothing else")
    options, _ = parser.parse_known_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as name:
        if options.only_dark:
            asyncio.run(darkness(options))
        elif options.series:
            asyncio.run(series(options, Path(name)))
        elif options.postgresql:
            asyncio.run(postgresql(options))
        else:
            return False
    return True


if __name__ == "__main__":
    if not special():
        main(rows)
