"""A watch of a coordinator on served rangers, in virtual time without sockets."""

import asyncio

from catseye.ranger.server import LOOPBACK
from catseye.service.watch.watch import SiteWatch
from coordinator.clients.test_ziy_server import Served
from coordinator.link_scene import LoopClock, network, until
from coordinator.ziy_scene import gbt


class Watched(Served):
    """A served coordinator and a watch of it; `items` has all that its listener was given."""

    def __init__(self, *given, journal=None, consoles=(), watch=True, **options):
        super().__init__(*given, **options)
        self.consoles, self.watches, self.items = consoles, watch, []

    async def __aenter__(self):
        await super().__aenter__()
        self.port = self.server.port
        addresses = {name: (LOOPBACK, self.served[name].ports[1]) for name in self.consoles}
        self.watch = SiteWatch(
            gbt(), coordinator=(LOOPBACK, self.port), rangers=addresses, network=network(), clock=LoopClock()
        )
        self.watch.listeners.append(lambda kind, item: self.items.append((kind, item)))
        self.watching = asyncio.ensure_future(self.watch.run())
        await until(lambda: self.watch.state()["connected"])
        return self

    async def __aexit__(self, *given):
        self.watching.cancel()
        await asyncio.gather(self.watching, return_exceptions=True)
        await super().__aexit__(*given)

    def of(self, kind):
        """Objects of one kind that were told."""
        return [item for each, item in self.items if each == kind]
