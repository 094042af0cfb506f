"""The log of a living command."""

import json

import pytest

from catseye.coordinator.journal.entries import EpochSolution
from catseye.records.night.live import Happening, LiveWeather
from catseye.service.logs import LiveLog
from catseye.simulator.clock.world_clock import ManualClock

ALARM = Happening(5288963344910, "ZY105", "hung", "VER was not\nanswered", "alarm", {"seconds": float("nan")})


def lines(*entries, **how):
    found = []
    log = LiveLog(found.append, clock=ManualClock(52889.0), **how)
    for entry in entries:
        log.entry(entry)
    log.tell("twin", "child", "ended", "warning")
    return found


def test_people_read_time_severity_who_and_text_on_one_line():
    first, last = lines(ALARM, LiveWeather("WX1", 1, 1.0, 2.0, 3.0))
    assert first == "2003-09-07T15:12:10.00Z  alarm    ZY105        VER was not answered"
    assert last == "2003-09-07T00:00:00.00Z  warning  twin         ended"


def test_programs_read_an_object_a_line():
    told = json.loads(lines(ALARM, json=True)[0])
    assert told == {
        "time_utc": "2003-09-07T15:12:10.00Z",
        "mjd": pytest.approx(52889.6334491, abs=1e-9),
        "severity": "alarm",
        "who": "ZY105",
        "kind": "hung",
        "text": "VER was not answered",
        "details": {"seconds": None},
    }


def test_colour_is_for_what_is_wrong_and_ends_with_the_line():
    alarm, warning = lines(ALARM, colour=True)
    assert alarm.startswith("\x1b[1;31m")
    assert warning.startswith("\x1b[33m")
    assert alarm.endswith("\x1b[0m")
    note = lines(Happening(0, "ZY101", "ready", "well"), colour=True)[0]
    assert "\x1b" not in note


def test_an_epoch_is_a_line_and_one_that_gave_nothing_a_warning():
    answer = {"number": 3, "names": ["A", "B"], "used": [1, 2, 3], "rejected": {"4": "no"}, "variance_factor": 0.5}
    good, empty, _ = lines(EpochSolution(0, answer), EpochSolution(0, {}))
    assert good.endswith("epoch 3: 2 points from 3 shots, 1 not used, variance factor 0.50")
    assert "warning" in empty
