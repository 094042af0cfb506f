"""Injected faults: detected, or reported as not detected."""

from typing import get_args

import pytest

from catseye.coordinator.parts import TICKS_PER_SECOND
from catseye.records.night.live import TICKS_PER_DAY, Happening
from catseye.service.book import RunSummary
from catseye.service.found import SIGNS, FaultFinder
from catseye.service.objects import simulation_object, summary
from catseye.service.views import LinesView
from catseye.service.world import TwinWords
from catseye.simulator.twin.faults import Kind

START = 60635.125


def told(seconds, who, kind, **details):
    ticks = round(START * TICKS_PER_DAY) + round(seconds * TICKS_PER_SECOND)
    return Happening(ticks, who, kind, f"{who}: {kind} was seen", "warning", details)


def found_after(fault, *happenings):
    finder = FaultFinder([fault], START)
    for each in happenings:
        finder.heard(each)
    after = finder.found[0].after
    return None if after is None else round(after, 2)


def test_every_kind_of_fault_has_indicating_events():
    assert set(SIGNS) == set(get_args(Kind))


@pytest.mark.parametrize(
    ("fault", "by", "after"),
    [
        ("dead-ranger ZY104 40 60", told(40.5, "ZY104", "lost"), 0.5),
        ("dead-ranger ZY104 40 60", told(40.5, "ZY105", "lost"), None),  # another
        ("dead-ranger ZY104 40 60", told(39.0, "ZY104", "lost"), None),  # before
        ("dead-ranger ZY104 40 60", told(41.0, "ZY104", "slow"), None),  # something else
        ("stuck-axis ZY105:1 10", told(12.0, "ZY105", "motor-off-1"), 2.0),
        ("stuck-axis ZY105:1 10", told(12.0, "ZY105", "motor-off-0"), None),
        ("blocked-beam ZY105:ZBM05 10", told(12.0, "coordinator", "blocked", ranger="ZY105", target="ZBM05"), 2.0),
        ("blocked-beam ZY105:ZBM05 10", told(12.0, "coordinator", "blocked", ranger="ZY105", target="ZBM01"), None),
        ("dew ZBM02 10", told(15.0, "coordinator", "weak-return", ranger="ZY101", target="ZBM02"), 5.0),
        ("dew * 10", told(15.0, "coordinator", "weak-return", ranger="ZY101", target="ZBM07"), 5.0),
        ("lying-station WX2 30 90 5", told(33.0, "WX2", "weather-doubted"), 3.0),
        ("lying-station WX2 30 90 5", told(95.0, "WX2", "weather-doubted"), None),  # its true readings were doubted
        ("lying-station WX2 0 90 5", told(5.0, "WX2", "weather-apart", offset_c=5.6), 5.0),
        ("lying-station WX2 0 90 5", told(5.0, "WX2", "weather-biased", offset_c=-5.0), None),  # the other way
        ("lying-station WX2 0 90 5", told(5.0, "WX2", "weather-biased", offset_c=0.9), None),  # of another size
        ("lying-station WX2 0 90 5", told(115.0, "WX2", "weather-returned", offset_c=4.6), 115.0),
        ("lying-station WX2 0 90 5", told(5.0, "WX1", "weather-apart", offset_c=5.6), None),  # another
        ("dead-ranger ZY104 40 60", told(130.0, "ZY104", "lost"), None),  # long after
        ("wrong-target ZY104 40", told(50.0, "coordinator", "line-suspended", ranger="ZY104"), None),
        ("silent-telescope telescope 5", told(8.0, "telescope", "telescope-silent"), 3.0),
    ],
)
def test_fault_is_detected_by_an_event_at_its_place_and_time(fault, by, after):
    assert found_after(fault, by) == after


def test_first_event_counts_in_text_and_json():
    world = TwinWords(START, faults=("dead-ranger ZY104 40 60", "lying-station WX2 30 90 0.2", "dew ZBM01 500"))
    book = RunSummary(finder=FaultFinder(world.faults, START))
    said = []
    view = LinesView(said.append)
    view.begin(book, None, None)
    for entry in (told(40.4, "ZY104", "lost"), told(41.0, "ZY104", "no-reply"), told(100.0, "ZY101", "slow")):
        book.entry(entry)
        view.entry(entry)
    assert [line for line in said if "fault" in line] == [
        "2024-11-21T03:00:40.39Z  fault dead-ranger ZY104 40 60: found after 0.4 s (lost: ZY104: lost was seen)"
    ]
    passages = dict(summary(book, world, None, seconds=60.0, rangers=18, told=0))
    assert passages["Events"].startswith(
        "dead-ranger ZY104 40 60: found after 0.4 s (lost: ZY104: lost was seen); lying-station WX2 30 90 0.2: "
        "not detected; dew ZBM01 500: begins in 400 s; "
    )
    assert passages["Faults"].endswith("not detected: lying-station WX2 30 90 0.2.")
    found = simulation_object(book, world, None, seconds=60.0, rangers=18, told=0)["found"]
    assert [each["kind"] for each in found] == ["lost", None, None]
    assert found[0]["after_s"] == pytest.approx(0.4, abs=1e-3)
    assert found[0]["text"] == "ZY104: lost was seen"


def test_event_is_assigned_to_the_most_specific_fault():
    finder = FaultFinder(["dew * 10", "blocked-beam ZY103 10"], START)
    for seconds in (12.0, 25.0):
        finder.heard(told(seconds, "coordinator", "blocked", ranger="ZY103", target="ZBM05"))
    assert [each.by is None for each in finder.found] == [True, False]
    finder.heard(told(30.0, "coordinator", "weak-return", ranger="ZY101", target="ZBM05"))
    assert [each.after for each in finder.found] == pytest.approx([20.0, 2.0], abs=1e-3)
