"""Log of a running command."""

import json
import logging
import warnings

import pytest

from catseye.coordinator.journal.entries import EpochSolution
from catseye.records.night.live import Happening, LiveWeather
from catseye.service.logs import LiveLog, logging_to
from catseye.simulator.clock.world_clock import ManualClock

ALARM = Happening(5288963344910, "ZY105", "hung", "VER was not\nanswered", "alarm", {"seconds": float("nan")})


def lines(*entries, **how):
    found = []
    log = LiveLog(found.append, clock=ManualClock(52889.0), **how)
    for entry in entries:
        log.entry(entry)
    log.tell("twin", "child", "ended", "warning")
    return found


def test_line_has_time_severity_source_and_text():
    first, last = lines(ALARM, LiveWeather("WX1", 1, 1.0, 2.0, 3.0))
    assert first == "2003-09-07T15:12:10.00Z  alarm    ZY105        VER was not answered"
    assert last == "2003-09-07T00:00:00.00Z  warning  twin         ended"


def test_json_log_has_an_object_per_line():
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


def test_colour_marks_problems_and_ends_with_the_line():
    alarm, warning = lines(ALARM, colour=True)
    assert alarm.startswith("\x1b[1;31m")
    assert warning.startswith("\x1b[33m")
    assert alarm.endswith("\x1b[0m")
    note = lines(Happening(0, "ZY101", "ready", "well"), colour=True)[0]
    assert "\x1b" not in note


def test_epoch_is_a_line_and_without_solution_a_warning():
    answer = {"number": 3, "names": ["A", "B"], "used": [1, 2, 3], "rejected": {"4": "no"}, "variance_factor": 0.5}
    good, empty, _ = lines(EpochSolution(0, answer), EpochSolution(0, {}))
    assert good.endswith("epoch 3: 2 points from 3 shots, 1 not used, variance factor 0.50")
    assert "warning" in empty


def test_routine_is_logged_only_as_json():
    """85 % of a night's lines were warnings about single shots."""
    routine = Happening(5288963344910, "coordinator", "weak-return", "ZY110 TR07-B: 4 % of usual", "debug")
    assert len(lines(routine)) == 1, "what is told here is the child's end"
    assert json.loads(lines(routine, json=True)[0])["severity"] == "debug"


def test_doubtful_epoch_is_marked_in_its_line():
    answer = {"number": 3, "names": ["A"], "used": [1], "rejected": {}, "doubts": ["WX2's thermometer is biased"]}
    told, _ = lines(EpochSolution(0, answer))
    assert told.endswith("0 not used; doubtful: WX2's thermometer is biased")


def test_python_logging_and_warnings_are_logged_like_events():
    """A port that turns a browser away said so as bare text between lines of JSON."""
    found = []
    log = LiveLog(found.append, clock=ManualClock(52889.0), json=True)
    with logging_to(log):
        logging.getLogger("catseye.ranger.server").warning("port %d: closed", 24120)
        logging.getLogger("asyncio").error("Exception in callback")
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.warn("old", DeprecationWarning, stacklevel=1)
        try:
            raise ValueError("ours")
        except ValueError:
            logging.getLogger("x").exception("it broke")
    logging.getLogger("catseye.ranger.server").debug("not any more")
    rows = [json.loads(line) for line in found]
    assert [(row["who"], row["severity"]) for row in rows] == [
        ("server", "warning"),
        ("asyncio", "alarm"),
        ("warnings", "warning"),
        ("x", "alarm"),
    ]
    assert rows[0]["text"] == "port 24120: closed"
    assert rows[3]["text"].endswith("ValueError: ours")
    assert all(row["time_utc"] == "2003-09-07T00:00:00.00Z" for row in rows)
