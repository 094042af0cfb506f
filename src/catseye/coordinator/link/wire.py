"""Interface of a ranger's link for shooting."""

import asyncio
from typing import Protocol

from catseye.coordinator.link.preparation import Preparation
from catseye.coordinator.link.settings import LinkSettings
from catseye.ranger.head import SamplingSettings
from catseye.ranger.line import Reply, Request

Sent = tuple[int, "asyncio.Future[Reply]"]  # TID, and the future reply


class Wire(Protocol):
    """A ranger that is connected and ready, as `RangerLink` is.

    told            cubes sent to it on demand
    names           of its cubes, by number
    counts          last known position of its mirror, azimuth and elevation
    shots, failures good shots, and failures in a row
    round_trip      s, NaN if not measured
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
        """Reply to a request past the guard.

        Raises InputError: refused by the guard, or not connected.
        """
        ...

    def send(self, request: Request) -> Sent:
        """Send a request past the guard; its TID and a future of its reply.

        Raises InputError, as `sure`.
        """
        ...

    async def reply_of(self, command: str, sent: Sent, timeout: float) -> Reply:
        """Reply to a sent request; f = 0 if not in time."""
        ...
