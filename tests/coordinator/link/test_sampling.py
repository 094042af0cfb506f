"""Sampling of a ranger's buffers changed over its link, before its next shot."""

import pytest

from catseye.coordinator.link.preparation import sampling_requests
from catseye.ranger.head import SamplingSettings
from catseye.ranger.line import Request
from coordinator.link_scene import Free, Linked, planned, run

EXTREMES = [
    SamplingSettings(),
    SamplingSettings(64, 1024, 1000),
    SamplingSettings(10, 6553, 10_000),
    SamplingSettings(65_536, 1, 1),
    SamplingSettings(3, 21_845, 10_000),
    SamplingSettings(50_000, 1, 2),
]


@pytest.mark.parametrize("before", EXTREMES)
@pytest.mark.parametrize("after", EXTREMES)
def test_no_step_of_a_change_breaks_a_limit(before, after):
    values = {"SFQ": before.samples, "CYC": before.cycles, "IFF": before.frequency_hz}
    for request in sampling_requests(before, after):
        values[request.command] = int(request.parameters[0])
        SamplingSettings(values["SFQ"], values["CYC"], values["IFF"])
    assert SamplingSettings(values["SFQ"], values["CYC"], values["IFF"]) == after


def test_next_shot_has_the_wanted_sampling_and_is_asked_for_once():
    async def story():
        async with Linked() as (served, link):
            link.wanted_sampling = SamplingSettings(32, 64, 2000)
            shots = [await link.fire(planned("ZG11")) for _ in range(2)]
            assert [(s.cycles, s.samples_per_cycle, s.if_hz) for s in shots] == [(64, 32, 2000)] * 2
            assert served.ranger.sampling == SamplingSettings(32, 64, 2000)
            asked = [r.command for r in link._guard.asked if r.command in ("SFQ", "CYC", "IFF")]
            assert len(asked) == 3
            assert served.kinds() == ["ready"]

    run(story)


def test_refused_sampling_is_reported_and_fires_nothing():
    async def story():
        guard = Free()
        async with Linked(guard=guard) as (served, link):
            guard.refused = ("CYC",)
            link.wanted_sampling = SamplingSettings(64, 64, 1000)
            assert await link.fire(planned("ZG11")) is None
            assert served.kinds()[-1] == "sampling-refused"
            assert link.sampling == SamplingSettings()
            assert link.failures == 1
            guard.refused = ()
            assert (await link.fire(planned("ZG11"))).cycles == 64

    run(story)


def test_ranger_that_was_changed_by_hand_keeps_its_sampling_where_none_is_wanted():
    async def story():
        async with Linked() as (served, link):
            served.by_hand("CYC 64")
            assert (await link.fire(planned("ZG11"))).cycles == 64
            assert not [r for r in link._guard.asked if r == Request("CYC", ("128",))]

    run(story)
