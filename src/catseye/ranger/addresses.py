"""Network addresses of a site's rangers, feed and coordinator.

    loopback        ranger k of 127.0.8.k, ports 5240 and 5241, as real ones; feed 127.0.0.1 port 5250
    a port base     all on 127.0.0.1: ranger k at base + 10 k and base + 10 k + 1; feed at base

k counts the site's rangers in alphabetical order, from 1.
"""

from typing import Literal

from catseye.errors import InputError
from catseye.ranger.server import LOOPBACK, PORTS
from catseye.records.site.folder import SiteFolder

PORT_BASE = 24_100
FEED_PORT = 5250
COORDINATOR_PORT = 5260
STRIDE = 10
LAST_PORT = 65_535
MOST_LOOPBACK = 254
Addresses = Literal["loopback"] | int
Address = tuple[str, int, int]


def ranger_addresses(site: SiteFolder, addresses: Addresses = PORT_BASE) -> dict[str, Address]:
    """Host and both ports of each ranger by name.

    site        its records
    addresses   "loopback" or a port base

    Raises InputError: more rangers than there are addresses.
    """
    names = site.rangers
    if addresses == "loopback":
        if len(names) > MOST_LOOPBACK:
            raise InputError(
                f"too many rangers for loopback addresses: {len(names)} (expected at most {MOST_LOOPBACK})"
            )
        return {name: (f"127.0.8.{k}", *PORTS) for k, name in enumerate(names, start=1)}
    last = addresses + STRIDE * len(names) + 1
    if not 1 <= addresses <= last <= LAST_PORT:
        raise InputError(
            f"port base {addresses} gives ports up to {last} (expected at most {LAST_PORT}: use a lower base)"
        )
    return {name: (LOOPBACK, addresses + STRIDE * k, addresses + STRIDE * k + 1) for k, name in enumerate(names, 1)}


def feed_address(addresses: Addresses = PORT_BASE) -> tuple[str, int]:
    """Host and port of the site's feed."""
    return LOOPBACK, FEED_PORT if addresses == "loopback" else addresses
