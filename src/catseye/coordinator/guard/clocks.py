"""The clock of this machine: against its own steady counter, and against the clocks of the rangers.

A jump is what UTC gains on a counter that only counts. Where most rangers with a time signal agree with each other and
not with this machine, it is this machine that is wrong: then no ranger is set by it, and nothing is fired.
"""

import asyncio
from collections.abc import Mapping

import numpy as np

from catseye.coordinator.event_log import EventLog
from catseye.coordinator.link.ranger import RangerLink
from catseye.coordinator.parts import TICKS_PER_SECOND, Clock, ticks_now
from catseye.geometry.sky.time_tag import PER_SECOND
from catseye.ranger.status import StatusWord

EVERY = 1.0  # s between two looks
JUMP = 0.02  # s in a second: a clock that is steered gains 0.5 ms
AGREE = 0.05  # s within which rangers' clocks are of one mind
FRESH = 15.0  # s, how old a ranger's offset may be
LEAST_VOTES = 3


class HostClock:
    """The watch over this machine's clock.

    links   of the rangers, whose clocks vote
    """

    def __init__(self, links: Mapping[str, RangerLink], clock: Clock, event_log: EventLog):
        self._links, self._clock, self._event_log = links, clock, event_log
        self._before: tuple[int, float] | None = None
        self.believed = True

    async def run(self) -> None:
        """Look each second until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            self.look(loop.time())
            await asyncio.sleep(EVERY)

    def look(self, counted: float) -> None:
        """Look once, at a steady counter's s."""
        now = self._clock.now_ns()
        if self._before is not None:
            gained = (now - self._before[0]) / PER_SECOND - (counted - self._before[1])
            if abs(gained) > JUMP:
                text = f"this machine's clock jumped by {gained:+.3f} s (see to its time service)"
                self._event_log.tell("host-clock-jump", text, "alarm", always=True, offset_s=gained)
        self._before = now, counted
        self._vote()

    def _vote(self) -> None:
        """Whether this machine is believed; told when that changes."""
        now = ticks_now(self._clock)
        offsets = [
            link.clock_offset
            for link in self._links.values()
            if link.connected and not link.status & StatusWord.CLOCK_FREE and self._fresh(link.clock_seen, now)
        ]
        offsets = [offset for offset in offsets if np.isfinite(offset)]
        middle = float(np.median(offsets)) if offsets else 0.0
        of_one_mind = sum(abs(offset - middle) <= AGREE for offset in offsets)
        wrong = len(offsets) >= LEAST_VOTES and 2 * of_one_mind > len(offsets) and abs(middle) > AGREE
        self.believed = not wrong
        text = (
            f"{of_one_mind} of {len(offsets)} rangers' clocks agree that this machine's is {-middle:+.3f} s off: "
            "nothing is fired and no clock is set until they agree with it (see to its time service)"
        )
        over = "the rangers' clocks agree with this machine's: measuring goes on"
        self._event_log.standing("host-clock-off", text if wrong else None, "alarm", over=over, offset_s=-middle)

    @staticmethod
    def _fresh(seen: int, now: int) -> bool:
        """A jump of this machine makes old what was seen before, or of the future."""
        return 0 <= now - seen <= FRESH * TICKS_PER_SECOND
