"""Whether a site lasts: its memory over two hours of virtual time, a shot's way to durable over ten real minutes.

    python studies/lasting.py memory FILE.csv [--minutes 120]
    python benchmarks/bench_live.py --seconds 600 --series LATE.csv
    python studies/lasting.py draw MEMORY.csv LATE.csv DIRECTORY

`memory` runs the whole site of Green Bank in virtual time in one process, twin, coordinator, solver and a journal with
buffers, and writes what the process holds each minute; then the slope of the second half with its u. `draw`
writes lasting.svg from both tables.

What it shows. Nothing grows with time: what is kept of shots, epochs, events and paths is bounded. The slope's u takes
the scatter of neighbours as one (blocks of five minutes), since memory is given back in steps.
"""

import argparse
import asyncio
import csv
import gc
import os
import sys
import tempfile
from pathlib import Path

import numpy as np

from catseye.cli.live.options import site_of
from catseye.gateways.writers.drawing import BAD, FAINT, SERIES, STYLE, Figure, mpl, svg
from catseye.service.coordinator import Orders
from catseye.service.running import FastLoop
from catseye.service.screen import SilentView
from catseye.service.simulation import Simulation
from catseye.service.world import TwinWords

NIGHT = 60635.125  # MJD
PAGE = os.sysconf("SC_PAGE_SIZE")
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
        simulation = Simulation(site_of("gbt"), "gbt", TwinWords(NIGHT), orders, minutes, SilentView())
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


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def draw(memory: Path, late: Path, folder: Path) -> None:
    rows = np.array([[float(row["s"]), float(row["MB"])] for row in table(memory)])
    slope, u = slope_of(rows[len(rows) // 2 :])
    each = table(late)
    at, ms = (np.array([float(row[key]) for row in each if row["kind"] == "shot"]) for key in ("s", "ms"))
    (flushed, flush), (second, stolen) = (
        np.array([[float(row["s"]), float(row["ms"])] for row in each if row["kind"] == kind]).T
        for kind in ("flush", "stolen")
    )
    limit = max(20.0, 3.0 * float(np.percentile(flush, 99)))
    quiet = ms[np.isin(np.ceil(at), np.ceil(second[stolen <= QUIET]))]
    with mpl().rc_context(STYLE):
        figure = Figure(figsize=(7.2, 3.6), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1, 2))
        left.plot(rows[:, 0] / 3600.0, rows[:, 1], color=SERIES[0])
        left.set(xlabel="virtual time, h", ylabel="memory, MB", ylim=(0.0, None))
        left.set_title(f"second half: {slope:+.1f} ± {u:.1f} MB an hour", loc="left")
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
        right.legend(loc="upper right")
    (folder / "lasting.svg").write_text(svg(figure), encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    jobs = parser.add_subparsers(dest="job", required=True)
    memory = jobs.add_parser("memory")
    memory.add_argument("file", type=Path)
    memory.add_argument("--minutes", type=float, default=120.0)
    drawing = jobs.add_parser("draw")
    for name in ("memory", "late", "folder"):
        drawing.add_argument(name, type=Path)
    options = parser.parse_args()
    if options.job == "memory":
        remember(options.file, options.minutes)
    else:
        draw(options.memory, options.late, options.folder)


if __name__ == "__main__":
    main()
