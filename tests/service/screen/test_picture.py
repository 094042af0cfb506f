"""Operator's screen at many sizes: alarms, rangers, events, time, keys, colours."""

import re
from io import StringIO

import numpy as np
import pytest
from rich.color import Color
from rich.console import Console

from catseye.ranger.status import StatusWord
from catseye.service.book import RunSummary
from catseye.service.comparison import EpochComparison
from catseye.service.screen import styles
from catseye.service.screen.picture import PARTS, Chosen, Picture
from catseye.service.views import RunControls
from coordinator.condition_scene import NAMES, ScenedSite, link

SIZES = [(80, 24), (120, 40), (200, 60), (60, 20), (100, 30), (139, 34)]
CONTROLS = RunControls(stop=lambda: None, span=lambda: (72.4, 47.6))


def picture_of(site, width, height, colours=None):
    console = Console(file=StringIO(), width=width, height=height, force_terminal=True, color_system=colours)
    return Picture(console, site.book, site.running.ziy, CONTROLS)


def pictured(site, width, height, chosen=None):
    """Text of the screen, line by line."""
    return picture_of(site, width, height).lines(chosen or Chosen())


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


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("part", PARTS.values())
@pytest.mark.parametrize("words", [False, True])
def test_every_part_fits_the_screen(width, height, part, words):
    for site in (night(), at_three_in_the_morning(), ScenedSite()):
        lines = pictured(site, width, height, Chosen(part=part, help=words, keys=True))
        assert len(lines) == height, "the keys stand on the last line"
        assert max(map(len, lines)) <= width
        assert lines[-1].lstrip().startswith("q end  p pause")
        assert len(pictured(site, width, height, Chosen(part=part, help=words))) <= height


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
    assert dark.split()[1:3] == ["D", "dark"]
    [gone] = [line for line in lines if line.strip().startswith("ZY109")]
    assert "not connected: lost" in gone
    assert sum("event" in line for line in lines) >= 3


def test_small_screen_shows_alarms_first():
    """The screen itself, as the person sees it."""
    lines = [line.rstrip() for line in pictured(at_three_in_the_morning(), 80, 24)]
    assert lines == [
        "gbt  2024-11-21T03:01:20Z  telescope 145.2505° 45.0001°  1:12, 0:47 left",
        " ALARM   active, round 4, 15 of 18 rangers measure, 145 shots",
        "alarm    2 dark: ZY104, ZY111",
        "alarm    1 not connected: ZY109",
        "warning  epoch 9 doubtful: WX2's thermometer is biased by about +2.5 °C, or the…",
        "epoch    9 doubtful",
        "clock well   disk none   journal well   lease anna",
        "ZY101 + ZY102 + ZY103 + ZY104 D ZY105 + ZY106 + ZY107 + ZY108 + ZY109 x ZY110 +",
        "ZY111 D ZY112 + ZY113 + ZY114 + ZY115 b ZY116 + ZY117 + ZY118 +",
        "+ measures   b last shot failed   D dark   x not connected",
        "03:00:09 event 0",
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


def test_screen_works_before_any_entry():
    lines = pictured(ScenedSite(), 80, 24)
    assert lines[1].startswith(" STARTING ")
    assert lines[2].startswith("start    ████████████████████ 18 of 18 rangers ready")
    assert RunSummary().latest is None


def test_rangers_that_are_ready_are_counted_until_the_first_shot():
    site = ScenedSite()
    for name in NAMES[7:]:
        site.links[name] = link(connected=False, state="down")
    assert pictured(site, 80, 24)[2].startswith("start    ███████············· 7 of 18 rangers ready")
    site.shot("ZY101")
    assert not any(line.startswith("start") for line in pictured(site, 80, 24))


def test_time_of_a_round_is_shown_while_it_lasts():
    site = night()
    site.round_ticks = (site.ticks() - 70_000, site.ticks() + 50_000)  # of 0.864 ms
    assert "round 4 (60 of 104 s)" in pictured(site, 80, 24)[1]
    site.round_ticks = (site.ticks() - 70_000, site.ticks() - 1)
    assert "round 4, " in pictured(site, 80, 24)[1]


def test_frozen_part_stays_and_alarms_go_on():
    site = night()
    picture = picture_of(site, 80, 24)
    chosen = Chosen(part="events", keys=True)
    before = picture.lines(chosen)
    picture.freeze("03:01:20")
    picture.lines(chosen)
    site.event("ZY101", "made-safe", "a new event", "alarm")
    site.links["ZY104"] = link(connected=False)
    after = picture.lines(chosen)
    assert after[2].startswith("alarm    1 not connected: ZY104")
    assert [line for line in before[:-1] if "event" in line] == [line for line in after[:-1] if "event" in line]
    assert "FROZEN 03:01:20" in after[-1]
    assert after[-1].endswith("? help")
    picture.freeze("")
    assert any("a new event" in line for line in picture.lines(chosen))


def test_events_are_chosen_by_severity_and_scrolled():
    site = night(40)
    site.event("ZY104", "made-safe", "lasers are off", "alarm")
    assert any("lasers are off" in line for line in pictured(site, 80, 24, Chosen(part="events")))
    alarms = pictured(site, 80, 24, Chosen(part="events", severity="alarm"))
    assert sum("event" in line or "lasers" in line for line in alarms) == 1
    far = Chosen(part="events", scroll=10_000)
    assert any("event 0" in line for line in pictured(site, 80, 24, far))
    assert far.scroll < 40, "no further than the first"


def test_part_without_anything_to_show_says_so():
    assert any("no faults, no troubles" in line for line in pictured(night(), 80, 24, Chosen(part="faults")))
    none = pictured(ScenedSite(), 80, 24, Chosen(part="events", severity="alarm"))
    assert any("no event of severity alarm or above" in line for line in none)


def test_state_is_said_by_more_than_colour():
    """The same lines with colours and without, as with NO_COLOR."""
    plain = pictured(at_three_in_the_morning(), 120, 40, Chosen(keys=True))
    coloured = picture_of(at_three_in_the_morning(), 120, 40, "256").lines(Chosen(keys=True))
    assert any("\x1b[" in line and "38;5;196" in line for line in coloured)
    assert [re.sub(r"\x1b\[[0-9;]*m", "", line) for line in coloured] == [
        re.sub(r"\x1b\[[0-9;]*m", "", line) for line in plain
    ]


def luminance(colour):
    """Relative luminance of an sRGB colour. Source: WCAG 2.1."""
    parts = [c / 255.0 for c in Color.parse(colour).get_truecolor()]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("style", [styles.GOOD, styles.WARNING, styles.ALARM])
def test_colours_are_legible_on_light_and_on_dark_backgrounds(style):
    """3.5 at least to either; 4.58 is the most that a colour has to both. White letters on it: as to a white ground."""
    here = luminance(style.rpartition(" ")[2])
    assert 1.05 / (here + 0.05) > 3.5
    assert (here + 0.05) / 0.05 > 3.5
