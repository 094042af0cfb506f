"""Watchdog of parked beams, and distribution of the Sun's direction."""

import asyncio
from collections.abc import Mapping
from contextlib import suppress

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.link.ranger import RangerLink
from catseye.coordinator.parts import Clock, RequestGuard, ticks_now
from catseye.errors import InputError
from catseye.records.night.live import Severity

PERIOD = 2.0  # s between two checks
SUN_PERIOD = 5.0  # s: a ranger of the feed arm refuses to move by a vector older than a minute
ACT_WITHIN = 60.0  # s: later hazards are only logged, since the next shot will move the mirror


class BeamWatchdog:
    """Watchdog of all links' parked beams.

    It acts only on those that measure, and never during a shot.
    """

    def __init__(self, links: Mapping[str, RangerLink], guard: RequestGuard, *, clock: Clock, event_log: EventLog):
        self._links, self._guard, self._clock, self._event_log = links, guard, clock, event_log

    async def run(self) -> None:
        """Watch all beams until cancelled."""
        await asyncio.gather(self._suns(), self._watch())

    async def _suns(self) -> None:
        """Send the Sun direction to all rangers concurrently, with a timeout."""
        while True:
            messages = []
            for name, link in self._links.items():
                with suppress(InputError):  # on the feed arm without posture: it will refuse to move by itself
                    messages.append(link.tell_sun(self._guard.sun_vector(name, ticks_now(self._clock))))
            with suppress(TimeoutError):
                async with asyncio.timeout(SUN_PERIOD):
                    await asyncio.gather(*messages)
            await asyncio.sleep(SUN_PERIOD)

    async def _watch(self) -> None:
        while True:
            counts = {name: link.counts for name, link in self._links.items() if link.connected and not link.busy}
            positions = {name: pair for name, pair in counts.items() if pair is not None}
            for alarm in self._guard.watch(ticks_now(self._clock), positions):
                severity: Severity = "alarm" if alarm.within < ACT_WITHIN else "warning"
                about = f"{alarm.ranger} {alarm.remedy}"
                self._event_log.tell(f"{alarm.cause}-comes", alarm.text, severity, about=about, ranger=alarm.ranger)
                if alarm.within < ACT_WITHIN and self._links[alarm.ranger].ready:
                    await self._act(self._links[alarm.ranger], alarm.remedy)
            await asyncio.sleep(PERIOD)

    async def _act(self, link: RangerLink, remedy: str) -> None:
        """Park at ZRG if that is the remedy and allowed; else laser off."""
        if remedy == "move" and await link.park():
            return
        await link.darken()
