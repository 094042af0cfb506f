"""A page beside a coordinator of rangers that fire fast, and clients that listen: for benchmark and long test."""

import asyncio
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import numpy as np

from catseye.coordinator.journal.entries import AnsweredShot
from catseye.records.site.folder import REFERENCE, site_files
from catseye.service.coordinator import LiveCoordinator, Orders, Peers
from catseye.service.page import PageAddress, PageChild
from load_scene import LoadChild, load_site
from repository import ROOT

TICK = 864e-6  # s
LONGEST_START, SETTLED = 90.0, 14.0  # s: the round that was planned before the streams comes to its end
LOOK = 5.0  # s between two looks at the memory
TICKS_A_SECOND = os.sysconf("SC_CLK_TCK")


class BusySite:
    """A coordinator in this process whose rangers stream; `late` has s from each buffer's end until it was durable."""

    def __init__(self, running, child, folder):
        self.running, self.child, self.folder, self.late = running, child, folder, []
        self.targets = {}
        running.ziy.listeners.append(self._entry)

    def _entry(self, entry):
        if isinstance(entry, AnsweredShot):
            shot = entry.shot
            self.late.append(self.child.clock.now_ns() * 1e-9 - shot.ticks * TICK - shot.duration)
            if entry.status == "used" and shot.target != REFERENCE:
                self.targets[shot.ranger] = shot.target

    async def stream(self):
        """Let all rangers fire back to back."""
        began = time.monotonic()
        while len(self.targets) < len(self.child.addresses) and time.monotonic() - began < LONGEST_START:
            await asyncio.sleep(0.2)
        for ranger in self.child.addresses:
            self.running.ziy.stream(ranger, self.targets.get(ranger, REFERENCE))
        await asyncio.sleep(SETTLED)

    async def delay(self, seconds):
        """Percentiles 50 and 99 of the delay, ms, shots a second, and this process's share of a core, %."""
        self.late.clear()
        cpu, wall = time.process_time(), time.perf_counter()
        await asyncio.sleep(seconds)
        cpu, wall, late = time.process_time() - cpu, time.perf_counter() - wall, list(self.late)
        p50, p99 = (1e3 * float(v) for v in np.percentile(late, [50, 99]))
        return {
            "p50_ms": p50,
            "p99_ms": p99,
            "shots_a_second": len(late) / wall,
            "coordinator_percent": 100 * cpu / wall,
        }


@asynccontextmanager
async def busy_site(*, rangers=18, targets=None, keep_buffers=True):
    """A coordinator of rangers that stream, with a journal in a temporary folder.

    targets   as `load_site`; None for Green Bank's own
    """
    with tempfile.TemporaryDirectory() as name, LoadChild(rangers, targets) as child:
        folder = Path(name)
        site = load_site(rangers, targets)
        for path, text in site_files(site).items():
            (folder / "site" / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / "site" / path).write_text(text, encoding="utf-8")
        orders = Orders(journal=str(folder / "site.db"), port=0, keep_buffers=keep_buffers)
        running = LiveCoordinator(site, orders, Peers(child.addresses, child.feed), clock=child.clock)
        busy = BusySite(running, child, folder)
        task = asyncio.create_task(running.run())
        try:
            await busy.stream()
            yield busy
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


@asynccontextmanager
async def page_of(busy):
    """The page beside it, in a process of its own: its port and its process id."""
    listening, log = asyncio.Event(), []
    coordinator = ("127.0.0.1", busy.running.server.port)
    subject = {"site": str(busy.folder / "site"), "coordinator": coordinator, "journal": str(busy.folder / "site.db")}
    page = PageChild(
        PageAddress("127.0.0.1", 0),
        lambda at: at.settings("site", **subject),
        listening=lambda at: listening.set(),
        warned=log.append,
    )
    keeping = asyncio.create_task(page.child.keep())
    try:
        async with asyncio.timeout(LONGEST_START):
            await listening.wait()
        yield page
    finally:
        keeping.cancel()
        await asyncio.gather(keeping, return_exceptions=True)


@contextmanager
def listening_to(port, count, *, stuck=0):
    """So many clients in a process of their own: a function that gives its counts."""
    words = [sys.executable, str(ROOT / "tests" / "web" / "listeners.py"), str(port), str(count), str(stuck)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:

        async def counts():
            def asked():
                process.stdin.write("\n")
                process.stdin.flush()
                return json.loads(process.stdout.readline())

            return await asyncio.to_thread(asked)

        try:
            yield counts
        finally:
            process.kill()


def cpu_of(pid):
    """s of processor time of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_A_SECOND


def memory_of(pid):
    """Resident memory of a process, MB."""
    lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1024.0


async def memory_over(minutes, *, clients=50):
    """Resident memory of the page each 5 s, MB, and what its clients counted; one of them takes nothing."""
    async with busy_site(keep_buffers=False) as busy, page_of(busy) as page:
        with listening_to(page.address.port, clients, stuck=1) as counts:
            rows = []
            for _ in range(round(60.0 * minutes / LOOK)):
                await asyncio.sleep(LOOK)
                rows.append(memory_of(page.child.pid))
            return rows, await counts()


def growth_of(rows):
    """Growth of the memory in the last two thirds, MB, by the medians of a minute at both ends."""
    third, minute = len(rows) // 3, min(round(60.0 / LOOK), len(rows) // 3)
    return statistics.median(rows[-minute:]) - statistics.median(rows[third : third + minute])
