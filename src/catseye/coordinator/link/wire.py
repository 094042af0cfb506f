"""What taking a shot needs of the connection to a ranger."""

import asyncio
from typing import Protocol

from catseye.coordinator.link.preparation import Preparation
from catseye.coordinator.link.settings import LinkSettings
from catseye.ranger.head import SamplingSettings
from catseye.ranger.line import Reply, Request

Sent = tuple[int, "asyncio.Future[Reply]"]  # TID, and what will be answered


class Wire(Protocol):
    """A ranger that is connected and made ready, as `RangerLink` is.

    told            cubes that it was told of on demand
    names           of its cubes, by number
    counts          where its mirror was last said to stand, azimuth and elevation
    shots, failures good shots, and failures in a row
    round_trip      s, NaN where none was measured
    """

    told: set[int]
    names: dict[int, str]
    counts: tuple[float, float] | None
    shots: int
    failures: int
    round_trip: float
    sampling: SamplingSettings
    preparation: Preparation
    settings: LinkSettings

    @property
    def ranger(self) -> str: ...
    @property
    def connected(self) -> bool: ...
    async def sure(self, request: Request, timeout: float) -> Reply:
        """A reply past the guard. Raises InputError: refused by the guard, or not connected."""
        ...

    def send(self, request: Request) -> Sent:
        """Send a request past the guard; its TID and a future of its reply. Raises InputError, as `sure`."""
        ...

    async def reply_of(self, command: str, sent: Sent, timeout: float) -> Reply:
        """The reply to what was sent; f = 0 where it did not come in time."""
        ...
