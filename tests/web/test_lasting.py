"""Half an hour of 50 clients at full rate, one of them stuck, 2268 targets: the page's memory does not grow."""

import asyncio
import statistics

import pytest

from web import page_scene  # isort: skip - skips where the extra is absent
from web.busy_scene import busy_site, listening_to, memory_of, page_of

assert page_scene.TOKEN
LOOK = 5.0  # s


async def memory_over(minutes, *, clients=50):
    """Resident memory of the page each 5 s, MB, and what its clients counted."""
    async with busy_site(keep_buffers=False) as busy, page_of(busy) as page:
        with listening_to(page.address.port, clients, stuck=1) as counts:
            rows = []
            for _ in range(round(60.0 * minutes / LOOK)):
                await asyncio.sleep(LOOK)
                rows.append(memory_of(page.child.pid))
            return rows, await counts()


@pytest.mark.slow
@pytest.mark.timeout(3000)
def test_memory_grows_by_less_than_a_megabyte_in_the_last_20_of_30_minutes():
    rows, counts = asyncio.run(memory_over(30.0))
    third = len(rows) // 3
    minute = round(60.0 / LOOK)
    growth = statistics.median(rows[-minute:]) - statistics.median(rows[third : third + minute])
    assert counts["open"] == 49
    assert counts["cut"] >= 20
    assert counts["events"] > 49 * 1800 * 50
    assert growth < 1.0, rows[::minute]
