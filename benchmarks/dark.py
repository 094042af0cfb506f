"""Dark orders timed: all rangers fire for one connection, and another says PS 0 to one after the other.

Each second time the order stands behind a packet of long questions; the time is from the order to its answer, by which
the laser is off.
"""

import asyncio
import os
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness import spread
from load_scene import LoadChild

COMMANDING = ("LEASE peer", "AXIS 0, 1", "AXIS 1, 1", "PS 1", "CIL 0", "STM 0, 1000000")  # who fires by hand
LIMIT_MS = 100.0
LISTINGS = 8  # long answers that a dark order stands behind, each second time
RENEWED, LONGEST = 5.0, 60.0  # s


@dataclass(frozen=True)
class DarkResult:
    """Dark orders to rangers that all fire: count, ms until answered, % within the limit, spread as of a row."""

    tries: int
    p50_ms: float
    p99_ms: float
    max_ms: float
    within_percent: float
    load: float
    spread: float


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
        try:
            async with asyncio.timeout(LONGEST):
                while True:
                    head, _, body = (await self.heard.get()).rpartition("\t")
                    if body.startswith(words) and (tid is None or head.startswith(f"{tid}\t")):
                        return
        except TimeoutError:
            raise SystemExit(f"dark orders: no {words!r} in {LONGEST:g} s; is the machine overloaded?") from None

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
    within = 100.0 * float(np.mean(np.array(late) <= LIMIT_MS))
    return DarkResult(
        tries=tries,
        p50_ms=p50,
        p99_ms=p99,
        max_ms=most,
        within_percent=within,
        load=os.getloadavg()[0],
        spread=spread(np.array(late)),
    )
