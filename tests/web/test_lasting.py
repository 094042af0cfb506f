"""Half an hour of 50 clients at full rate, one of them stuck, 2268 targets: the page's memory does not grow."""

import asyncio

import pytest

from web import page_scene  # isort: skip - skips where the extra is absent
from web.busy_scene import LOOK, growth_of, memory_over

assert page_scene.TOKEN


@pytest.mark.slow
@pytest.mark.timeout(3000)
def test_memory_grows_by_less_than_a_megabyte_in_the_last_20_of_30_minutes():
    rows, counts = asyncio.run(memory_over(30.0))
    assert counts["open"] == 49
    assert counts["cut"] >= 20
    assert counts["events"] > 49 * 1800 * 50
    assert growth_of(rows) < 1.0, rows[:: round(60.0 / LOOK)]
