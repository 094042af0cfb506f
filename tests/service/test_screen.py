"""Operator's screen at 80 x 24 and 120 x 40: alarms, rangers, events."""

import asyncio
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from catseye.ranger.status import StatusWord
from catseye.service.book import RunSummary
from catseye.service.comparison import EpochComparison
from catseye.service.screen import ScreenView
from coordinator.condition_scene import NAMES, ScenedSite, link


def console_of(width, height):
    return Console(file=StringIO(), width=width, height=height, force_terminal=True, color_system=None)


def pictured(site, width, height):
    """What stands on the screen, line by line."""

    async def story():
        console = console_of(width, height)
        view = ScreenView(console)
        view.begin(site.book, site.running)
        with console.capture() as capture:
            console.print(view.picture())
        view.end()
        return capture.get().rstrip("\n").split("\n")

    return asyncio.run(story())


def night(rounds=8):
    site = ScenedSite()
    for k in range(rounds):
        site.round(k + 1)
        site.event("ZY101", "ready", f"event {k}")
    site.condition.holder = "anna"
    return site


def at_three_in_the_morning():
    """Two dark, one gone, one whose shots are blocked; WX2 in doubt; a long event."""
    site = night()
    for name in ("ZY104", "ZY111"):
        site.links[name] = link(status=StatusWord.LASER_OFF)
    site.links["ZY109"] = link(connected=False, state="down", troubles=("lost",))
    site.shot("ZY115", "blocked")
    site.event("ZY109", "lost", "ZY109: the connection was reset " + 30 * "and so on ", "warning")
    site.event("ZY104", "made-safe", "ZY104: nobody had the lease for 30 s: laser and motors are off", "alarm")
    site.epoch(9, doubts=["WX2's thermometer is biased by about +2.5 °C, or the air between the stations is unusual"])
    return site


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40), (200, 60), (60, 20)])
def test_picture_fits_the_screen(width, height):
    for site in (night(), at_three_in_the_morning(), ScenedSite()):
        lines = pictured(site, width, height)
        assert len(lines) < height, "one line is the cursor's"
        assert max(map(len, lines)) <= width


def test_every_ranger_has_a_character_explained_in_a_legend():
    lines = pictured(at_three_in_the_morning(), 80, 24)
    text = "\n".join(lines)
    wrong = {"ZY104": "D", "ZY111": "D", "ZY109": "x", "ZY115": "b"}
    for name in NAMES:
        assert f"{name} {wrong.get(name, '+')} " in f"{text} "
    [legend] = [line for line in lines if "+ measures" in line]
    assert "D dark" in legend
    assert "x not connected" in legend
    assert "L another's" not in legend


def test_tall_screen_has_a_line_per_ranger():
    lines = pictured(at_three_in_the_morning(), 120, 40)
    for name in NAMES:
        assert sum(line.strip().startswith(name) for line in lines) == 1
    [dark] = [line for line in lines if line.strip().startswith("ZY104")]
    assert dark.split()[1] == "dark"
    [gone] = [line for line in lines if line.strip().startswith("ZY109")]
    assert "not connected: lost" in gone
    assert sum("event" in line for line in lines) >= 3


def test_small_screen_shows_alarms_first():
    """The screen itself, as the person sees it."""
    lines = [line.rstrip() for line in pictured(at_three_in_the_morning(), 80, 24)]
    assert lines == [
        "gbt  2024-11-21T03:01:20Z  telescope 145.2505° 45.0001°",
        " ALARM   active, round 4, 15 of 18 rangers measure, 145 shots",
        "alarm    2 dark: ZY104, ZY111",
        "alarm    1 not connected: ZY109",
        "warning  epoch 9 doubtful: WX2's thermometer is biased by about +2.5 °C, or the…",
        "epoch    9 doubtful",
        "clock well   disk none   journal well   lease anna",
        "ZY101 + ZY102 + ZY103 + ZY104 D ZY105 + ZY106 + ZY107 + ZY108 + ZY109 x ZY110 +",
        "ZY111 D ZY112 + ZY113 + ZY114 + ZY115 b ZY116 + ZY117 + ZY118 +",
        "+ measures   b last shot failed   D dark   x not connected",
        "03:00:19 event 1",
        "03:00:29 event 2",
        "03:00:39 event 3",
        "03:00:49 event 4",
        "03:00:59 event 5",
        "03:01:10 event 6",
        "03:01:20 event 7",
        "03:01:20 ZY109: the connection was reset and so on and so on and so on and so o…",
        "03:01:20 ZY104: nobody had the lease for 30 s: laser and motors are off",
    ]


def test_quiet_night_shows_no_problems_and_the_lease_holder():
    lines = pictured(night(), 80, 24)
    assert lines[1].startswith(" WELL ")
    assert lines[2].rstrip() == "no problems"
    assert any(line.startswith("epoch    8 good") for line in lines)
    assert any("lease anna" in line for line in lines)
    assert [line.split()[-1] for line in lines[-10:] if "event" in line][-1] == "7"


def test_surplus_problems_are_counted_and_alarms_stay():
    site = night()
    site.links["ZY101"], site.links["ZY102"] = link(troubles=("slow",)), link(state="preparing")
    site.links["ZY103"], site.links["ZY104"] = link(connected=False), link(troubles=("leased",))
    site.believed, site.intake.trouble = False, "the disk is full"
    lines = pictured(site, 80, 24)
    assert [line.split()[0] for line in lines[2:5]] == ["alarm"] * 3
    assert lines[5].split()[:3] == ["and", "3", "more"]


def test_truth_of_a_simulation_is_shown_if_there_is_room():
    site = night()
    nothing = np.full(3, np.nan)
    told = EpochComparison(8, 0, 30, "TR01-B", 0.5, 0.1, 0.12, 0.9, (0.7, 1.4), nothing, nothing, nothing)
    site.book.comparisons[8] = told
    assert any("chi² 0.90 (0.70-1.40)" in line for line in pictured(site, 80, 24))


def test_screen_is_updated_without_durable_entries():
    """The journal is away, so nothing is published: the picture is renewed all the same."""

    async def story():
        site = night()
        console = console_of(80, 24)
        view = ScreenView(console)
        view.begin(site.book, site.running)
        site.intake.trouble = "the disk is full"
        site.clock.advance(60.0)
        view._next = 0.0
        view._tick()
        view.end()
        assert "STOPPED" in console.file.getvalue()
        assert "journal: the disk is full" in console.file.getvalue()
        assert view._timer.cancelled()

    asyncio.run(story())


def test_screen_works_before_any_entry():
    lines = pictured(ScenedSite(), 80, 24)
    assert lines[1].startswith(" STARTING ")
    assert RunSummary().latest is None
