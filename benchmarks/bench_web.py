"""The page beside a busy site: its share of a core, and the time from shot to durable with and without it.

python benchmarks/bench_web.py [--quick]
python benchmarks/bench_web.py --lasting 30    minutes: the page's memory, and its growth in the last two thirds

18 rangers stream 128 ms buffers back to back to a coordinator with a journal, as in bench_live.py; the site has Green
Bank's 2268 targets. In one run: without a page, with one that nobody looks at, with 50 clients of which one takes
nothing, and without a page again. Clients are in a process of their own and read all they get. The share of a
core is the page's process; the delay, from the end of a buffer until its entry is durable, is the coordinator's, whose
ratio tells if the page slows the site. First page: the time and the bytes of all that a browser asks for before it
shows the site.
"""

import asyncio
import gzip
import json
import re
import sys
import time
import urllib.request
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np

from harness import Row, main
from web.busy_scene import LOOK, busy_site, cpu_of, growth_of, listening_to, memory_of, memory_over, page_of

SETTLED = 3.0  # s after clients came
SECONDS, CLIENTS, RANGERS = 8.0, 50, 18
CROWD = f"{CLIENTS} clients, 1 stuck"
ASSET = re.compile(r'(?:src|href)="(/[^"]+)"')
API = ("/api/service", "/api/site", "/api/state", "/api/epochs?limit=1")


def fetched(base, path):
    """Body of an answer, and its bytes on the wire."""
    request = urllib.request.Request(base + path, headers={"Accept-Encoding": "gzip"})
    with urllib.request.urlopen(request, timeout=60.0) as answer:
        data = answer.read()
        body = gzip.decompress(data) if answer.headers.get("Content-Encoding") == "gzip" else data
    return body, len(data)


def first_page(base):
    """s and bytes of the page's files and of the answers that it shows first."""
    began = time.perf_counter()
    index, files = fetched(base, "/")
    for path in ASSET.findall(index.decode()):
        files += fetched(base, path)[1]
    answers = {path: fetched(base, path)[1] for path in API}
    epochs = json.loads(fetched(base, API[-1])[0])["epochs"]
    if epochs:
        path = f"/api/epochs/{epochs[-1]['number']}"
        answers[path] = fetched(base, path)[1]
    return {"seconds": time.perf_counter() - began, "file_bytes": files, "answer_bytes": answers}


async def with_clients(busy, page, count, stuck, seconds):
    """Delay of the site, share of a core and bytes of the page, with so many clients."""
    with listening_to(page.address.port, count, stuck=stuck) as counts:
        await asyncio.sleep(SETTLED)
        before, cpu = await counts(), cpu_of(page.child.pid)
        row = await busy.delay(seconds)
        after, cpu = await counts(), cpu_of(page.child.pid) - cpu
    readers = max(count - stuck, 1)
    return row | {
        "clients": after["open"],
        "stuck_cut": after["cut"],
        "page_percent": 100.0 * cpu / seconds,
        "page_mb": memory_of(page.child.pid),
        "bytes_a_second_a_client": (after["bytes"] - before["bytes"]) / seconds / readers,
        "events_a_second_a_client": (after["events"] - before["events"]) / seconds / readers,
    }


async def measured():
    async with busy_site(rangers=RANGERS) as busy:
        rows = {"without a page": await busy.delay(SECONDS)}
        async with page_of(busy) as page:
            await asyncio.sleep(SETTLED)
            base = f"http://127.0.0.1:{page.address.port}"
            first = await asyncio.to_thread(first_page, base)
            for name, count, stuck in (("nobody looks", 0, 0), (CROWD, CLIENTS, 1)):
                rows[name] = await with_clients(busy, page, count, stuck, SECONDS)
        rows["without a page again"] = await busy.delay(SECONDS)
    return {"rows": rows, "first_page": first}


def rows(quick):
    """Cost of the page to the site, its own processor time, and the first page; not in quick mode: a minute or more."""
    if quick:
        return
    found = asyncio.run(measured())
    table = found["rows"]
    crowd, alone = table[CROWD], [table[name] for name in ("without a page", "without a page again")]
    what = f"{RANGERS} rangers, {CLIENTS} clients, one of them stuck"
    p99 = float(np.mean([row["p99_ms"] for row in alone]))
    off = abs(alone[0]["p50_ms"] - alone[1]["p50_ms"]) / np.mean([row["p50_ms"] for row in alone])
    yield Row(
        path="dashboard, the site's buffer to durable beside it",
        what=what,
        ours_s=1e-3 * crowd["p50_ms"],
        beside={"no dashboard": 1e-3 * float(np.mean([row["p50_ms"] for row in alone]))},
        limit_s=None,
        spread=float(off),
        note=f"99 of 100 within {crowd['p99_ms']:.0f} ms, without within {p99:.0f} ms; near 1 is good; "
        "spread: before and after",
    )
    events = crowd["events_a_second_a_client"] * (CLIENTS - 1)
    yield Row(
        path="dashboard, processor time of an event to a client",
        what=what,
        ours_s=1e-2 * crowd["page_percent"] / events,
        beside={},
        limit_s=None,
        spread=0.0,
        note=f"{crowd['page_percent']:.0f} % of a core for {events:.0f} events a second, "
        f"{crowd['bytes_a_second_a_client'] / 1e3:.1f} kB/s a client, {crowd['page_mb']:.0f} MB; nobody looking "
        f"{table['nobody looks']['page_percent']:.1f} % of a core",
    )
    first = found["first_page"]
    total = first["file_bytes"] + sum(first["answer_bytes"].values())
    yield Row(
        path="dashboard, first page",
        what="all that a browser asks for before it shows the site",
        ours_s=first["seconds"],
        beside={},
        limit_s=None,
        spread=0.0,
        note=f"{total / 1e3:.0f} kB, {first['file_bytes'] / 1e3:.0f} of them files; one visit",
    )


def lasting(minutes):
    """Print the page's memory over so many minutes."""
    memory, counts = asyncio.run(memory_over(minutes, clients=CLIENTS))
    by_minute = ", ".join(f"{mb:.2f}" for mb in memory[:: round(60.0 / LOOK)])
    sys.stdout.write(f"memory each minute, MB: {by_minute}\ngrowth {growth_of(memory):.2f} MB; {counts}\n")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--lasting"]:
        lasting(float(sys.argv[2]))
    else:
        main(rows)
