"""Records that an epoch contradicts: an alarm from the first epoch on, and until the record is mended."""

from dataclasses import replace

import pytest

from catseye.reduction.live.live import Live
from live_scene import Night, twin

TRACK = "track 145.3 45"


def with_record(site, part, name, **values):
    table = dict(getattr(site, part))
    table[name] = table[name].model_copy(update=values)
    return replace(site, **{part: table})


def wrong(site, record):
    if record == "monument ZY104":
        return with_record(site, "monuments", "ZY104", x_mm=site.monuments["ZY104"].x_mm + 3.0)
    first, *others = site.benchmarks
    longer = first.model_copy(update={"certified_distance_mm": first.certified_distance_mm + 1.0})
    return replace(site, benchmarks=(longer, *others))


def doubts(site, epochs=2):
    """Doubts of the first epochs of a night at a site."""
    night = Night(twin(TRACK, seed=3), 3)
    live = Live(site)
    night.before().into(live)
    found = []
    for k in range(epochs):
        night.round(k).into(live)
        answer = live.solve(night.ticks(k))
        assert answer is not None
        found.append(answer.doubts)
    return found


@pytest.mark.parametrize("record", ["monument ZY104", "certificate of ZY102-ZBM01"])
def test_a_contradiction_lasts_beyond_its_epoch(record):
    """The state knows the truth after the first epoch: nothing contradicts it any more, and the file is as wrong."""
    for epoch in doubts(wrong(twin(TRACK, seed=3).site, record)):
        assert any(record in doubt for doubt in epoch), epoch


def test_right_records_raise_no_alarm():
    assert doubts(twin(TRACK, seed=3).site) == [(), ()]
