"""The page beside a busy site: its share of a core, and the time from shot to durable with and without it.

python benchmarks/bench_web.py [--seconds 30] [--clients 50] [--rangers 18] [--json]
python benchmarks/bench_web.py --lasting 30 [--clients 50]

18 rangers stream 128 ms buffers back to back to a coordinator with a journal, as in bench_live.py; the site has Green
Bank's 2268 targets. In one run: without a page, with one that nobody looks at, with one client, with 50 of which one
takes nothing, and without a page again. Clients are in a process of their own and read all they get. The share of a
core is the page's process; the delay, from the end of a buffer until its entry is durable, is the coordinator's, whose
ratio tells if the page slows the site. First page: the time and the bytes of all that a browser asks for before it
shows the site.

`--lasting` runs so many minutes with all clients, and prints the page's memory each minute and its growth in the last
two thirds.
"""

import argparse
import asyncio
import gzip
import json
import os
import re
import sys
import time
import urllib.request
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from web.busy_scene import LOOK, busy_site, cpu_of, growth_of, listening_to, memory_of, memory_over, page_of

SETTLED = 3.0  # s after clients came
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


async def measured(options):
    async with busy_site(rangers=options.rangers) as busy:
        rows = {"without a page": await busy.delay(options.seconds)}
        async with page_of(busy) as page:
            await asyncio.sleep(SETTLED)
            base = f"http://127.0.0.1:{page.address.port}"
            first = await asyncio.to_thread(first_page, base)
            for name, count, stuck in (
                ("nobody looks", 0, 0),
                ("1 client", 1, 0),
                (f"{options.clients} clients, 1 stuck", options.clients, 1),
            ):
                rows[name] = await with_clients(busy, page, count, stuck, options.seconds)
        rows["without a page again"] = await busy.delay(options.seconds)
    return {"rows": rows, "first_page": first, "load": os.getloadavg()[0]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--rangers", type=int, default=18)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--lasting", type=float, metavar="MINUTES")
    options = parser.parse_args()
    if options.lasting is not None:
        memory, counts = asyncio.run(memory_over(options.lasting, clients=options.clients))
        minutes = ", ".join(f"{mb:.2f}" for mb in memory[:: round(60.0 / LOOK)])
        sys.stdout.write(f"memory each minute, MB: {minutes}\ngrowth {growth_of(memory):.2f} MB; {counts}\n")
        return
    found = asyncio.run(measured(options))
    if options.json:
        sys.stdout.write(json.dumps(found, indent=1) + "\n")
        return
    rows = found["rows"]
    alone = 0.5 * (rows["without a page"]["p99_ms"] + rows["without a page again"]["p99_ms"])
    for name, row in rows.items():
        text = (
            f"{name:<22} durable p50 {row['p50_ms']:6.1f} ms, p99 {row['p99_ms']:6.1f} ms ({row['p99_ms'] / alone:.2f})"
        )
        text += f", {row['shots_a_second']:.0f} shots/s, coordinator {row['coordinator_percent']:.0f} % of a core"
        if "page_percent" in row:
            text += f"; page {row['page_percent']:.1f} %, {row['page_mb']:.0f} MB"
            text += (
                f", {row['events_a_second_a_client']:.0f} events/s and {row['bytes_a_second_a_client'] / 1e3:.1f} kB/s"
            )
        sys.stdout.write(text + "\n")
    page = found["first_page"]
    total = page["file_bytes"] + sum(page["answer_bytes"].values())
    sys.stdout.write(
        f"first page: {page['seconds']:.2f} s, {total / 1e3:.0f} kB ({page['file_bytes'] / 1e3:.0f} of files); "
        f"load of the machine {found['load']:.1f}\n"
    )


if __name__ == "__main__":
    main()
