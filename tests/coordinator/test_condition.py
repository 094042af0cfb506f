"""Condition of a site: problems, alarms first, and rangers."""

import pytest

from catseye.coordinator.condition import SIGNS, WRONG, verdict_of
from catseye.coordinator.journal.disk import DiskState
from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.parts import ticks_now
from catseye.ranger.status import StatusWord
from coordinator.condition_scene import ScenedSite, link


def measuring():
    site = ScenedSite()
    site.round()
    return site


def told(site):
    return [problem.text for problem in site.condition.now().problems]


def test_measuring_site_is_well():
    now = measuring().condition.now()
    assert (now.word, now.problems, now.measuring) == ("well", (), 18)
    assert (now.epoch, now.verdict.word, now.clock, now.disk, now.journal, now.holder) == (
        1, "good", "well", "none", "well", "nobody",
    )  # fmt: skip


def test_coordinator_without_shots_is_stopped_with_all_rangers_ready():
    site = measuring()
    site.clock.advance(46.0)
    now = site.condition.now()
    assert now.word == "stopped"
    assert now.problems[0].severity == "alarm"
    assert now.problems[0].text == "no shot for 46 s"


@pytest.mark.parametrize("mode", ["hold", "passive"])
def test_site_not_in_active_mode_is_not_well(mode):
    site = measuring()
    site.mode = mode
    assert site.condition.now().word == "stopped"
    assert f"mode {mode}: no shots are taken" in told(site)


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({"status": StatusWord.LASER_OFF}, "dark"),
        ({"troubles": ("dark",)}, "dark"),
        ({"connected": False, "state": "down", "troubles": ("lost",)}, "not connected"),
        ({"troubles": ("leased",), "state": "connected"}, "another's"),
        ({"state": "preparing"}, "not ready"),
        ({"state": "preparing", "status": StatusWord.LASER_OFF}, "not ready"),
        ({"troubles": ("slow",)}, "trouble"),
    ],
)
def test_ranger_that_does_not_measure_is_named(changed, word):
    site = measuring()
    site.links["ZY105"] = link(**changed)
    now = site.condition.now()
    assert now.rangers["ZY105"] == word
    assert now.word == ("alarm" if WRONG[word] == "alarm" else "impaired")
    assert told(site) == [f"1 {word}: ZY105"]


def test_excluded_suspended_or_idle_rangers_are_not_well():
    site = measuring()
    site.firing.dropped.add("ZY101")
    for _ in range(3):
        site.firing.suspensions.failed("ZY102", "", ticks_now(site.clock))
    assert told(site) == ["1 suspended: ZY102", "1 left out: ZY101"]
    for k in range(12):
        site.round(2 + k, without=("ZY101", "ZY102", "ZY103"))
    assert site.condition.now().rangers["ZY103"] == "idle"
    assert "idle: " in " ".join(told(site))


def test_first_of_many_are_named_and_the_others_counted():
    site = measuring()
    for name in ("ZY101", "ZY102", "ZY103", "ZY104", "ZY110"):
        site.links[name] = link(connected=False)
    assert told(site) == ["5 not connected: ZY101, ZY102, ZY103 and 2 more"]


def test_alarms_come_before_warnings():
    site = measuring()
    site.links["ZY105"] = link(troubles=("slow",))
    site.condition.disk = DiskState(3 * 10**8, 1e5, 1200.0)
    site.believed, site.telescope = False, False
    site.intake.trouble = "the disk is full"
    site.epoch(2, doubts=["WX2's thermometer is biased by about +2.5 °C"])
    now = site.condition.now()
    severities = [problem.severity for problem in now.problems]
    assert severities == ["alarm"] * 4 + ["warning"] * 2
    assert told(site)[:4] == [
        "journal: the disk is full: measuring suspended",
        "clock: this machine's clock is in doubt: no shots are taken",
        "disk: full in 20.0 min",
        "telescope: no posture, targets on it are not measured",
    ]
    assert "epoch 2 doubtful: WX2's thermometer is biased by about +2.5 °C" in told(site)
    assert (now.word, now.clock, now.journal, now.disk) == ("alarm", "in doubt", "the disk is full", "0.3 GB free")


def test_failed_or_missing_epochs_are_an_alarm():
    site = measuring()
    site.entry(EpochSolution(ticks_now(site.clock), {}))
    assert told(site) == ["epoch 1 failed: no solution"]
    site.epoch(2)
    for _ in range(10):
        site.clock.advance(10.0)
        for name in site.links:
            site.shot(name)
    assert told(site) == ["no epoch for 100 s"]


def test_pending_steps_are_no_problem_during_start():
    site = ScenedSite()
    for name in site.links:
        site.links[name] = link(connected=False, state="down", status=StatusWord.LASER_OFF)
    site.telescope = False
    now = site.condition.now()
    assert (now.word, now.problems) == ("starting", ())
    site.believed = False
    assert site.condition.now().word == "alarm", "a clock that is wrong is wrong from the start"
    site.believed = True
    site.clock.advance(121.0)
    now = site.condition.now()
    assert now.word == "stopped"
    assert any("18 not connected" in problem.text for problem in now.problems)


def test_each_state_of_a_ranger_has_its_own_character():
    assert len(set(SIGNS.values())) == len(SIGNS)
    assert all(len(sign) == 1 for sign in SIGNS.values())
    assert set(WRONG) < set(SIGNS)


def test_doubts_of_an_epoch_make_its_verdict():
    assert verdict_of(EpochSolution(0, {})).word == "failed"
    assert verdict_of(EpochSolution(0, {"number": 1, "names": ["A"]})).word == "good"
    doubtful = verdict_of(EpochSolution(0, {"number": 1, "doubts": ["WX1 lies."]}))
    assert (doubtful.word, doubtful.why) == ("doubtful", "WX1 lies")
