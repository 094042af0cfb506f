"""Execution of a round by each ranger."""

import asyncio
from types import SimpleNamespace

import numpy as np
import pytest

from catseye.coordinator.firing import Firing
from catseye.coordinator.parts import TICKS_PER_SECOND, PlannedShot, Round
from catseye.simulator.clock.world_clock import ManualClock
from simulator.living_scene import site

NOW = 60_635.125  # MJD


class Link:
    """A ranger that is always ready; a shot is over where it was planned to be."""

    connected = ready = True
    failures = 0

    def __init__(self, clock):
        self.clock, self.shot = clock, []

    async def stream(self, planned, take, *, count):
        self.shot.append(planned.target)
        self.clock.advance(max(0.0, planned.begin_ticks * 864e-6 - self.clock.now_ns() * 1e-9))
        return count


@pytest.mark.parametrize(
    ("begins", "shot"),
    [
        ([3.4, 4.0], ["T0"]),  # the way to the first is longer than the round of 2 s
        ([0.5, 1.0, 1.9, 2.1], ["T0", "T1", "T2"]),
    ],
)
def test_first_shot_of_a_list_is_taken_after_any_move(begins, shot):
    """Or a ranger whose reference is farther than a round would never do anything, and nobody would know."""

    async def story():
        clock = ManualClock(NOW)
        link = Link(clock)
        firing = Firing(
            site(), {"ZY101": link}, intake=SimpleNamespace(take=None), live=None, event_log=None, clock=clock,
            allowed=lambda: True, telescope_known=lambda: True,
        )  # fmt: skip
        now = clock.now_ns() // 864_000
        zero = np.zeros(3)
        shots = tuple(
            PlannedShot("ZY101", f"T{k}", now + round(begin * TICKS_PER_SECOND), 0.128, zero, zero, True, "test")
            for k, begin in enumerate(begins)
        )
        firing.begin(Round(now, now + round(2.0 * TICKS_PER_SECOND), {"ZY101": shots}, {}))
        await firing.done(["ZY101"], 5.0)
        assert link.shot == shot

    asyncio.run(story())
