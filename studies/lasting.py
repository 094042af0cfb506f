"""Memory of a site's processes over hours, and a shot's way to durable over ten real minutes.

    python studies/lasting.py memory FILE.csv [--minutes 120]
    python studies/lasting.py processes FILE.csv [--minutes 60] [--rate 3] [--motion "track 145.3 45"]
    python benchmarks/bench_live.py --seconds 600 --series LATE.csv
    python studies/lasting.py draw MEMORY.csv LATE.csv DIRECTORY

`memory` runs the whole site of Green Bank in virtual time in one process, twin, coordinator, solver and a journal with
buffers, and writes what the process holds each minute; then the slope of the second half with its u. `draw`
writes lasting.svg from both tables; the first may be that of `processes`.

`processes` runs the same site as three processes on sockets, twin, coordinator and solver, as `catseye simulate` does,
on clocks that run `rate` times as fast as the machine's: all loops wait a third as long at 3. It writes what each holds
every ten virtual seconds, prints each one's slope after the first fifth with its u, and says by how much the loop was
late: a site that cannot follow its clock would do less than a real one.

What it shows. Nothing grows with time: what is kept of shots, epochs, events and paths is bounded. The slope's u takes
the scatter of neighbours as one (blocks of five minutes), since memory is given back in steps.
"""

import argparse
import asyncio
import csv
import gc
import json
import os
import selectors
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import catseye
from catseye.gateways.writers.drawing import BAD, FAINT, SERIES, STYLE, Figure, mpl, svg
from catseye.geometry.sky.time_tag import PER_DAY
from catseye.service.coordinator import LiveCoordinator, Orders
from catseye.service.listening import start_line_of
from catseye.service.rangers import ListenAddresses, Listening, RangersServed
from catseye.service.running import FastLoop
from catseye.service.simulation import Simulation, peers_of
from catseye.service.views import SilentView
from catseye.service.warm import WarmingClock
from catseye.service.world import MOTION, TwinWords, twin_heads

NIGHT = 60635.125  # MJD
PAGE = os.sysconf("SC_PAGE_SIZE")
EVERY = 10.0  # s of virtual time between two looks at the processes
SETTLING = 0.2  # share of a run in which caches, arenas and queues fill
NAMES = ("twin", "coordinator", "solver")
BLOCK = 5  # minutes that count as one
QUIET = 10.0  # ms of both cores that a host takes in a second which counts as undisturbed: a tick of its count


def held() -> float:
    """MB of this process."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * PAGE / 1e6


def remember(path: Path, minutes: float) -> None:
    rows: list[tuple[float, float]] = []

    async def watch() -> None:
        while True:
            await asyncio.sleep(60.0)
            rows.append((60.0 * (len(rows) + 1), held()))
            sys.stderr.write(f"{len(rows)} min: {rows[-1][1]:.1f} MB\n")

    async def both(journal: str) -> None:
        orders = Orders(journal=journal, port=0)
        simulation = Simulation(catseye.load("gbt"), "gbt", TwinWords(NIGHT), orders, minutes, SilentView())
        watching = asyncio.ensure_future(watch())
        try:
            await simulation.run_fast()
        finally:
            watching.cancel()
        sys.stderr.write(f"{simulation.told} shots in {simulation.seconds:.0f} s\n")

    with tempfile.TemporaryDirectory() as folder, asyncio.Runner(loop_factory=FastLoop) as runner:
        runner.run(both(str(Path(folder) / "night.db")))
    path.write_text("s,MB\n" + "".join(f"{s:.0f},{mb:.2f}\n" for s, mb in rows), encoding="utf-8")
    slope, u = slope_of(np.array(rows)[len(rows) // 2 :])
    sys.stdout.write(f"second half: {slope:+.2f} MB an hour, u {u:.2f}; at the end {rows[-1][1]:.0f} MB\n")


def slope_of(rows: np.ndarray) -> tuple[float, float]:
    """MB an hour with its u, of rows (k, 2) a minute apart."""
    blocks = rows[: len(rows) // BLOCK * BLOCK].reshape(-1, BLOCK, 2).mean(axis=1)
    hours = (blocks[:, 0] - blocks[:, 0].mean()) / 3600.0
    slope = float(hours @ blocks[:, 1] / (hours @ hours))
    left = blocks[:, 1] - blocks[:, 1].mean() - slope * hours
    return slope, float(np.sqrt(left @ left / (len(blocks) - 2) / (hours @ hours)))


class FastClock:
    """UTC that runs `rate` times as fast as the machine's counter, the same in every process.

    began   ns of `time.monotonic_ns`, when it reads `NIGHT`
    """

    def __init__(self, began: int, rate: float):
        self._began, self._rate = began, rate

    def now_ns(self) -> int:
        """Nanoseconds since MJD 0."""
        return round(NIGHT * PER_DAY) + round((time.monotonic_ns() - self._began) * self._rate)


class HastySelector(selectors.DefaultSelector):
    """A selector whose waits are given in s of a clock that is faster than the machine's."""

    rate = 1.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        return super().select(timeout if timeout is None or timeout <= 0 else timeout / self.rate)


class HastyLoop(asyncio.SelectorEventLoop):
    """An event loop whose time runs `rate` times as fast as the machine's."""

    def __init__(self, rate: float):
        self._rate = rate
        selector = HastySelector()
        selector.rate = rate
        super().__init__(selector)

    def time(self) -> float:
        return super().time() * self._rate


def twin_process(began: int, rate: float, motion: str) -> None:
    """Serve a twin on free ports until standard input ends; say where in one JSON line."""
    site, world = catseye.load("gbt"), TwinWords(NIGHT, motion=motion)
    truth, clock = world.twin(site), FastClock(began, rate)
    warming = WarmingClock(clock)
    heads = twin_heads(truth, site.rangers, warming)
    served = RangersServed(site, heads, clock=clock, twin=truth, warming=warming, at=ListenAddresses(0))

    def say(at: Listening) -> None:
        sys.stdout.write(json.dumps(at.plain()) + "\n")
        sys.stdout.flush()

    async def serve() -> None:
        work = asyncio.ensure_future(served.serve(say))
        asyncio.get_running_loop().add_reader(sys.stdin, work.cancel)
        await asyncio.gather(work, return_exceptions=True)

    with asyncio.Runner(loop_factory=lambda: HastyLoop(rate)) as runner:
        runner.run(serve())


def resident(pid: int | None) -> float:
    """MB of its own that a process holds, NaN of one that is gone.

    Pages of libraries' files are left out: the system takes and gives them as it likes.
    """
    try:
        _, whole, shared, *_ = Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()
        return (int(whole) - int(shared)) * PAGE / 1e6
    except (OSError, ValueError):
        return float("nan")


def remember_processes(path: Path, minutes: float, rate: float, motion: str) -> None:
    """Run twin, coordinator and solver, and write what each holds every ten virtual seconds."""
    began = time.monotonic_ns()
    words = [sys.executable, __file__, "twin", str(began), str(rate), motion]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as twin:
        assert twin.stdin is not None
        assert twin.stdout is not None
        at = start_line_of(twin.stdout.readline()).at
        assert at is not None
        with tempfile.TemporaryDirectory() as folder, asyncio.Runner(loop_factory=lambda: HastyLoop(rate)) as runner:
            orders = Orders(journal=str(Path(folder) / "night.db"), port=0)
            site = catseye.load("gbt")
            running = LiveCoordinator(site, orders, peers_of(at), clock=FastClock(began, rate))
            rows = runner.run(_watched(running, twin.pid, minutes, path))
        twin.stdin.close()
    told = np.array(rows)
    sys.stdout.write(
        f"{running.ziy.intake.numbered} shots, {running.ziy.intake.acknowledged} durable, {running.live.number} epochs "
        f"in {told[-1, 0] / 60.0:.1f} min of virtual time, {rate:g} times as fast as the clock; the loop was late by "
        f"{np.median(told[:, 4]):.2f} s of it, {told[:, 4].max():.1f} at most\n"
    )
    for name, slope, u in slopes(told):
        sys.stdout.write(f"{name}: {slope:+.4f} MB a minute, u {u:.4f}\n")


async def _watched(running: LiveCoordinator, twin: int, minutes: float, path: Path) -> list[tuple[float, ...]]:
    """Run a coordinator for minutes, and look at the processes meanwhile."""
    loop, rows = asyncio.get_running_loop(), list[tuple[float, ...]]()
    work = asyncio.ensure_future(running.run())
    while running.live.number < 1:
        await asyncio.wait([work], timeout=EVERY)
        if work.done():
            work.result()
    began = loop.time()
    with path.open("w", encoding="utf-8") as file:
        file.write(f"s,{','.join(NAMES)},late_s\n")
        while loop.time() - began < 60.0 * minutes:
            asked = loop.time() + EVERY
            await asyncio.wait([work], timeout=EVERY)
            if work.done():
                work.result()
            held_now = [resident(pid) for pid in (twin, os.getpid(), running.solver_pid)]
            rows.append((loop.time() - began, *held_now, loop.time() - asked))
            file.write(",".join(f"{value:.3f}" for value in rows[-1]) + "\n")
            file.flush()
    work.cancel()
    await asyncio.gather(work, return_exceptions=True)
    return rows


def slopes(rows: np.ndarray) -> list[tuple[str, float, float]]:
    """MB a minute of each process with its u, after the first fifth of the run: of the least in each five minutes.

    That is what a process holds between epochs; while one is solved it has tens of MB more for a second.

    Neighbours go together, since memory is taken and given back in steps: the u of independent rows is widened by their
    lag-one correlation r, sqrt((1 + r) / (1 - r)), of which a negative one is taken as zero.
    """
    late = rows[rows[:, 0] >= SETTLING * rows[-1, 0]]
    block = (late[:, 0] // (60.0 * BLOCK)).astype(int)
    late = np.array([[late[block == k, 0].mean(), *late[block == k, 1:4].min(axis=0)] for k in np.unique(block)])
    minutes = (late[:, 0] - late[:, 0].mean()) / 60.0
    found = []
    for name, held_mb in zip(NAMES, late[:, 1:4].T, strict=True):
        slope = float(minutes @ held_mb / (minutes @ minutes))
        left = held_mb - held_mb.mean() - slope * minutes
        u = float(np.sqrt(left @ left / (len(left) - 2) / (minutes @ minutes)))
        r = float(left[1:] @ left[:-1] / max(left @ left, 1e-30))
        found.append((name, slope, u * float(np.sqrt((1.0 + max(r, 0.0)) / max(1.0 - max(r, 0.0), 1e-3)))))
    return found


def draw_memory(axes: Any, path: Path) -> None:
    """Draw what one process held, or each of three, since the end of the first fifth."""
    rows = np.array([[float(value) for value in row.values()] for row in table(path)])
    if rows.shape[1] == 2:
        slope, u = slope_of(rows[len(rows) // 2 :])
        axes.plot(rows[:, 0] / 3600.0, rows[:, 1], color=SERIES[0])
        axes.set(xlabel="virtual time, h", ylabel="memory, MB", ylim=(0.0, None))
        axes.set_title(f"second half: {slope:+.1f} ± {u:.1f} MB an hour", loc="left")
        return
    first = int(np.argmax(rows[:, 0] >= SETTLING * rows[-1, 0]))
    for k, (name, slope, u) in enumerate(slopes(rows), 1):
        label = f"{name}, {rows[-1, k]:.0f} MB: {slope:+.3f} ± {u:.3f}"
        axes.plot(rows[:, 0] / 60.0, rows[:, k] - rows[first, k], color=SERIES[k - 1], label=label)
    axes.axvline(rows[first, 0] / 60.0, color=FAINT, lw=0.8)
    axes.set(xlabel="time of the site, min", ylabel="memory since the line, MB")
    axes.set_title("MB a minute behind the line", loc="left")
    axes.set_ylim(top=1.4 * axes.get_ylim()[1])
    axes.legend(loc="upper left", fontsize="x-small")


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def draw(memory: Path, late: Path, folder: Path) -> None:
    each = table(late)
    at, ms = (np.array([float(row[key]) for row in each if row["kind"] == "shot"]) for key in ("s", "ms"))
    (flushed, flush), (second, stolen) = (
        np.array([[float(row["s"]), float(row["ms"])] for row in each if row["kind"] == kind]).T
        for kind in ("flush", "stolen")
    )
    limit = max(20.0, 3.0 * float(np.percentile(flush, 99)))
    quiet = ms[np.isin(np.ceil(at), np.ceil(second[stolen <= QUIET]))]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.8), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(2, 3))
        draw_memory(left, memory)
        edges = np.arange(0.0, at[-1] + 1.0, 10.0)
        inside = [ms[(at >= a) & (at < a + 10.0)] for a in edges]
        shown = [(a, part) for a, part in zip(edges, inside, strict=True) if len(part) > 100]
        for q, color in ((50, SERIES[0]), (99, SERIES[1])):
            right.plot(
                [a / 60.0 for a, _ in shown], [np.percentile(part, q) for _, part in shown], color=color, label=f"p{q}"
            )
        right.plot(flushed / 60.0, flush, ".", ms=2, color=FAINT, label="the disk's own flush")
        right.plot(second / 60.0, np.maximum(stolen, 0.1), color=SERIES[2], lw=0.6, label="stolen by the host, each s")
        right.axhline(limit, color=BAD, lw=0.8)
        right.annotate(f"limit {limit:.0f} ms", (0.0, limit), color=BAD, va="bottom")
        right.set(xlabel="time, min", ylabel="end of a buffer to durable, ms, of each 10 s", yscale="log")
        right.set_title(
            f"{len(ms)} shots: p99 {np.percentile(ms, 99):.1f} ms, {np.percentile(quiet, 99):.1f} little stolen",
            loc="left",
        )
        right.set_ylim(top=30.0 * limit)
        right.legend(loc="upper right", ncols=2)
    (folder / "lasting.svg").write_text(svg(figure), encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    jobs = parser.add_subparsers(dest="job", required=True)
    memory = jobs.add_parser("memory")
    memory.add_argument("file", type=Path)
    memory.add_argument("--minutes", type=float, default=120.0)
    each = jobs.add_parser("processes")
    each.add_argument("file", type=Path)
    each.add_argument("--minutes", type=float, default=60.0)
    each.add_argument("--rate", type=float, default=3.0)
    each.add_argument("--motion", default=MOTION)
    twin = jobs.add_parser("twin")  # the child of `processes`
    twin.add_argument("began", type=int)
    twin.add_argument("rate", type=float)
    twin.add_argument("motion")
    drawing = jobs.add_parser("draw")
    for name in ("memory", "late", "folder"):
        drawing.add_argument(name, type=Path)
    options = parser.parse_args()
    if options.job == "memory":
        remember(options.file, options.minutes)
    elif options.job == "processes":
        remember_processes(options.file, options.minutes, options.rate, options.motion)
    elif options.job == "twin":
        twin_process(options.began, options.rate, options.motion)
    else:
        draw(options.memory, options.late, options.folder)


if __name__ == "__main__":
    main()
