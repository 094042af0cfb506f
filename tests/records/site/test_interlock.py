from datetime import UTC, datetime, time, timedelta, timezone

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.files.reading import read_record
from catseye.records.site.interlock import Interlock, Interlocks

TEXT = """
format = "catseye-interlocks-1"
by = "safety officer"
[[interlock]]
name = "crane"
why = "people on the feed arm"
rangers = ["ZY113"]
forbids = ["shine"]
begin = 2003-09-07T16:00:00Z
end = 2003-09-07T18:00:00+01:00
[[interlock]]
name = "tour"
why = "visitors look at the telescope"
daily_from = 23:00:00
daily_until = 01:00:00
[[interlock]]
name = "hut-door"
why = "somebody may be inside"
switch = true
"""
SEVENTH = 52_889.0  # 2003-09-07


def written(tmp_path, text):
    (tmp_path / "interlocks.toml").write_text(text)
    return read_record(tmp_path / "interlocks.toml", Interlocks)


def test_file_is_read_with_its_times(tmp_path):
    crane, tour, door = written(tmp_path, TEXT).interlock
    assert crane.spans(SEVENTH, SEVENTH + 1) == [(SEVENTH + 16 / 24, SEVENTH + 17 / 24)]
    assert crane.spans(SEVENTH + 0.75, SEVENTH + 1) == []
    assert crane.concerns("ZY113")
    assert not crane.concerns("ZY114")
    assert tour.concerns("ZY114")
    assert tour.forbids == ("shine", "move")
    assert door.spans(SEVENTH, SEVENTH + 1) == []


def test_hours_of_every_day_agree_with_a_clock_read_minute_by_minute():
    begin = datetime(2003, 9, 7, 12, tzinfo=UTC)
    each = Interlock(name="n", why="tests", daily_from=time(22, 30), daily_until=time(4), begin=begin)
    for k in range(0, 3 * 1440, 7):
        at = datetime(2003, 9, 7, tzinfo=UTC) + timedelta(minutes=k)
        mjd = SEVENTH + k / 1440
        inside = at >= begin and (at.time() >= time(22, 30) or at.time() < time(4))
        assert bool(each.spans(mjd, mjd + 1e-6)) is inside, at


def test_span_is_cut_to_the_requested_interval():
    tour = Interlock(name="n", why="tests", daily_from=time(9), daily_until=time(10))
    found = np.array(tour.spans(SEVENTH + 9.5 / 24, SEVENTH + 2))
    np.testing.assert_allclose((found - SEVENTH) * 24, [[9.5, 10], [33, 34]], atol=1e-6)
    for_ever = Interlock(name="n", why="tests", begin=datetime(2003, 9, 7, tzinfo=UTC))
    assert for_ever.spans(SEVENTH + 100, SEVENTH + 101) == [(SEVENTH + 100, SEVENTH + 101)]
    zone = timezone(timedelta(hours=-4))
    local = Interlock(name="n", why="tests", begin=datetime(2003, 9, 7, 12, tzinfo=zone))
    assert local.spans(SEVENTH, SEVENTH + 1) == [(SEVENTH + 16 / 24, SEVENTH + 1)]


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("16:00:00Z", "19:00:00Z", "is not after begin"),
        ("16:00:00Z", "16:00:00", "begin"),
        ("daily_from = 23:00:00\n", "", "belong together"),
        ("daily_from = 23:00:00", "daily_from = 01:00:00", "are the same"),
        ("switch = true", "switch = true\nend = 2003-09-07T16:00:00Z", "a switch has no times"),
        ("switch = true", "", "has no times"),
        ('"hut-door"', '"tour"', "given twice"),
        ('["shine"]', '["sing"]', "forbids"),
        ('["shine"]', "[]", "forbids"),
        ("interlocks-1", "interlocks-2", "format"),
        ("rangers", "ranger", "ranger"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path, old, new, text):
    assert old in TEXT
    with pytest.raises(InputError) as refused:
        written(tmp_path, TEXT.replace(old, new, 1))
    said = str(refused.value)
    assert said.startswith("interlocks.toml: ")
    assert text in said
    assert "\n" not in said
