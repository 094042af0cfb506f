"""Health of a ranger, asked every ten seconds."""

import asyncio
import math
from itertools import pairwise

from catseye.coordinator.link.health import asked_health
from catseye.coordinator.link.ranger import HEALTH_EVERY, LinkListeners
from catseye.coordinator.samplers.columns import COLUMNS
from catseye.coordinator.samplers.health import health_row
from catseye.ranger.line import Reply
from coordinator.link_scene import Linked, run, until


def test_link_tells_its_rangers_health_every_ten_seconds():
    async def story():
        async with Linked() as (served, link):
            found = []
            link._health_to = found.append
            await until(lambda: len(found) >= 3)
            seconds = [(b.ticks - a.ticks) * 864e-6 for a, b in pairwise(found)]
            assert all(HEALTH_EVERY - 0.1 <= s <= HEALTH_EVERY + 2.5 for s in seconds)
            row = dict(zip(COLUMNS["HEALTH"], health_row(found[-1])[1:], strict=True))
            assert (row["ranger"], row["state"], row["laser"], row["clock"]) == ("ZY101", "ready", "on", "locked")
            assert float(row["temperature_c"]) == served.head.enclosure_temperature_c()
            assert (row["azimuth_motor"], row["elevation_motor"]) == ("on", "on")
            assert float(row["azimuth_error_counts"]) == served.head.actual(0) - served.head.desired(0)
            served.by_hand("PS 0")
            served.by_hand("AXIS 1, 0")
            link.wanted = "hold"  # else it is lit again
            before = len(found)
            await until(lambda: len(found) > before)
            row = dict(zip(COLUMNS["HEALTH"], health_row(found[-1])[1:], strict=True))
            assert (row["laser"], row["elevation_motor"]) == ("off", "off")

    run(story)


def test_unknown_commands_leave_their_values_unknown():
    async def ask(request):
        if request.command == "ACP":
            return Reply("ACP", True, (request.parameters[0], "105"), 1, 5_288_900_000_000)
        return Reply("UNKNOWN", False, ("command",), 1, None)

    found = asyncio.run(asked_health(ask))
    assert (found.laser, found.supplies, found.ticks) == (None, "", 5_288_900_000_000)
    assert math.isnan(found.temperature_c)
    assert math.isnan(found.errors[0])


def test_listeners_need_no_health():
    assert LinkListeners(print).health is None
