"""Beams at rest, and the Sun: each ranger is told where it is, and a beam that it comes to is taken away."""

import asyncio
from collections.abc import Mapping
from contextlib import suppress

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.link.ranger import RangerLink
from catseye.coordinator.parts import Clock, RequestGuard, ticks_now
from catseye.errors import InputError
from catseye.records.night.live import Severity

EVERY = 2.0  # s between two looks
SUN_EVERY = 5.0  # s: a ranger of the feed arm refuses to move by a vector older than a minute
ACT_WITHIN = 60.0  # s: what comes later is told, and the next shot will have moved the mirror


class BeamWatchdog:
    """The watch over all links' beams; it acts only on those that measure, and never while a shot is under way."""

    def __init__(self, links: Mapping[str, RangerLink], guard: RequestGuard, *, clock: Clock, event_log: EventLog):
        self._links, self._guard, self._clock, self._event_log = links, guard, clock, event_log

    async def run(self) -> None:
        """Watch all beams until cancelled."""
        await asyncio.gather(self._suns(), self._watch())

    async def _suns(self) -> None:
        """Each ranger is told the Sun's direction; a slow one keeps no other waiting."""
        while True:
            messages = []
            for name, link in self._links.items():
                with suppress(InputError):  # of the feed arm, and no posture: it will refuse to move by itself
                    messages.append(link.tell_sun(self._guard.sun_vector(name, ticks_now(self._clock))))
            with suppress(TimeoutError):
                async with asyncio.timeout(SUN_EVERY):
                    await asyncio.gather(*messages)
            await asyncio.sleep(SUN_EVERY)

    async def _watch(self) -> None:
        while True:
            counts = {name: link.counts for name, link in self._links.items() if link.connected and not link.busy}
            known = {name: pair for name, pair in counts.items() if pair is not None}
            for alarm in self._guard.watch(ticks_now(self._clock), known):
                severity: Severity = "alarm" if alarm.within < ACT_WITHIN else "warning"
                about = f"{alarm.ranger} {alarm.remedy}"
                self._event_log.tell(f"{alarm.cause}-comes", alarm.text, severity, about=about, ranger=alarm.ranger)
                if alarm.within < ACT_WITHIN and self._links[alarm.ranger].ready:
                    await self._act(self._links[alarm.ranger], alarm.remedy)
            await asyncio.sleep(EVERY)

    async def _act(self, link: RangerLink, remedy: str) -> None:
        """Look at ZRG inside the instrument where that is asked and free; else the laser goes off."""
        if remedy == "move" and await link.park():
            return
        await link.darken()
