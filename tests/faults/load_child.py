"""A process that serves many rangers and counts what each fired: load_child.py RANGERS TARGETS OFFSET fast|twin.

It says where they listen in one JSON line, answers `report` with another, and ends with its standard input.
"""

import asyncio
import gc
import json
import logging
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from catseye.clock import SystemClock
from catseye.ranger.server import LOOPBACK
from catseye.service.warm import WarmingClock, warm
from catseye.service.world import TwinWords, twin_heads
from catseye.simulator.twin.faults import FaultBoard
from catseye.simulator.twin.feed import SiteFeed
from catseye.simulator.twin.servers import TwinSite
from load_scene import MOTION, NOISE, START_MJD, VARIANTS, FastHead, load_site


async def serve(site, offset, twin):
    clock = SystemClock(offset)
    warming = WarmingClock(clock)
    world = TwinWords(START_MJD, motion=MOTION, offset=offset).twin(site)
    if twin:
        heads = {name: _counting(head) for name, head in twin_heads(world, site.rangers, warming).items()}
    else:
        noise = np.random.default_rng(1).normal(0.0, NOISE, (VARIANTS, 8192))
        heads = {name: FastHead(name, world, warming, noise) for name in site.rangers}
        world.phasors(site.rangers[0], np.zeros((1, 2)), np.zeros(1))  # compiled before anybody waits for it
    served = TwinSite(site, heads, world_faults=FaultBoard(), seconds=lambda: 0.0, addresses=0)
    stations = tuple(station.name for station in site.site.weather_station)
    feed = SiteFeed("load", stations, world, clock)
    await served.start()
    await warm(site, served.rangers, warming, posture=world.live_posture)
    for head in heads.values():
        head.fired.clear()
    await feed.start(LOOPBACK, 0)
    gc.collect()
    gc.freeze()  # as `zy` does
    say({"rangers": served.addresses, "feed": (LOOPBACK, feed.port)})
    work = [asyncio.create_task(each) for each in (served.serve(), feed.serve(), _asked(heads))]
    try:
        done, _ = await asyncio.wait(work, return_when=asyncio.FIRST_COMPLETED)
        for each in done:
            each.result()
    finally:
        for each in work:
            each.cancel()
        await asyncio.gather(*work, return_exceptions=True)
        await feed.stop()
        await served.stop()


async def _asked(heads):
    reader = asyncio.StreamReader()
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    while await reader.readline():
        fired = {name: head.fired for name, head in heads.items()}
        say({"fired": fired, "cpu": time.process_time()})


def _counting(head):
    """A twin's head that keeps the moments of its triggers."""
    head.fired, trigger = [], head.trigger

    def counted(sampling):
        head.fired.append(round(head.now_ns() / 864_000))
        trigger(sampling)

    head.trigger = counted
    return head


def say(what):
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    logging.getLogger("catseye").setLevel(logging.ERROR)  # a dark order a line would be all that is seen
    count, prisms, late, kind = sys.argv[1:]
    asyncio.run(serve(load_site(int(count), int(prisms) or None), float(late), kind == "twin"))
