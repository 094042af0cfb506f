"""A coordinator on scripted rangers behind a real port, until it is killed: python watch_child.py PORT."""

import asyncio
import sys

from catseye.coordinator.clients.server import ZiyServer
from coordinator.link_scene import until
from coordinator.ziy_scene import Site


async def serve(port):
    async with Site() as site:
        server = ZiyServer(site.ziy, port=port)
        await server.start()
        await until(lambda: site.live.epochs >= 1)
        sys.stdout.write(f"{server.port}\n")
        sys.stdout.flush()
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(serve(int(sys.argv[1])))
