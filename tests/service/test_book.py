"""Summary of a running site, in words and for programs."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution
from catseye.gateways.writers.objects import json_line
from catseye.records.night.live import Happening, LivePosture, LiveShot
from catseye.service.book import RunSummary
from catseye.service.comparison import EpochComparison
from catseye.service.objects import epoch_line, simulation_object, summary
from catseye.service.simulation import Simulation
from catseye.service.views import LinesView
from catseye.service.world import TwinWords
from simulator.living_scene import site

NAN3 = np.full(3, math.nan)


class Judge:
    """Gives each epoch the same comparison."""

    def __init__(self, **other):
        self.shots, self.other = [], other

    def shot(self, answered):
        self.shots.append(answered)

    def epoch(self, solution):
        if not solution.answer:
            return None
        told = {
            "number": solution.answer["number"],
            "ticks": solution.ticks,
            "points": 30,
            "worst": "TR01-B",
            "worst_mm": 0.5,
            "rms_mm": 0.1,
            "mean_u_mm": 0.12,
            "chi2": 0.9,
            "band": (0.7, 1.4),
            **dict.fromkeys(("offset", "u_offset", "true_offset"), NAN3),
        }
        return EpochComparison(**(told | self.other))


def shot(number, ranger="ZY101", status="used", range_=100.0):
    taken = LiveShot(ranger, "TR01-B", number, 128, 64, 1000, 1e-4, None, number=number)
    return AnsweredShot(taken, status, "", range_, 3e-5, 0.0)


def epoch(number, *, used=(1, 2), of=None, **rejected):
    answer = {
        "number": number,
        "names": ["A"] * 30,
        "used": list(used),
        "rejected": of or {str(k): v for k, v in enumerate(rejected.values(), 1)},
    }
    return EpochSolution(number, answer)


def filled(**other):
    judge = Judge(**other)
    book = RunSummary(judge)
    for entry in [
        shot(1),
        shot(2, "ZY102", "reference", math.nan),
        shot(3, status="blocked"),
        LivePosture(5, 2.5, 0.5),
    ]:
        book.entry(entry)
    book.entry(epoch(1, a="reflected: range +1 mm off"))
    book.entry(
        Happening(6, "coordinator", "blocked", "ZY101 A: blocked", "warning", {"ranger": "ZY101", "unsaid": 4.0})
    )
    book.entry(Happening(7, "ZY104", "hung", "VER was not answered", "alarm"))
    book.entry(Happening(8, "ZY104", "ready", "made ready"))
    book.entry(EpochSolution(9, {}))
    return book, judge


def test_entries_are_counted():
    book, judge = filled()
    assert (book.acknowledged, dict(book.statuses)) == (3, {"used": 1, "reference": 1, "blocked": 1})
    assert dict(book.shots) == {"ZY101": 1, "ZY102": 1}
    assert book.last["ZY101"].status == "blocked"
    assert len(judge.shots) == 3
    assert [row["number"] for row in book.epochs] == [1]
    assert dict(book.left_out) == {"reflected": 1}
    assert dict(book.troubles.counts) == {("ZY101", "blocked"): 5, ("ZY104", "hung"): 1}
    assert book.latest.rms_mm == 0.1


def test_json_has_numbers_and_null_for_unknown_values():
    book, _ = filled()
    world = TwinWords(60635.125, faults=("dead-ranger ZY104 1 2",))
    text = json_line(simulation_object(book, world, "night.db", seconds=60.0, rangers=18, told=3))
    told = json.loads(text, parse_constant=lambda name: pytest.fail(name))
    assert (told["shots"], told["acknowledged"], told["used"], told["journal"]) == (3, 3, 1, "night.db")
    assert told["rejected"] == {"blocked": 1, "reflected": 1}
    assert told["faults"] == ["dead-ranger ZY104 1 2"]
    first = told["epochs"][0]
    assert (first["number"], first["rms_mm"], first["chi2_per_coordinate"]) == (1, 0.1, 0.9)
    assert first["beam"]["focus_mm"] == {"found": None, "u": None, "true": None}


def test_problems_of_more_than_one_shot_come_first():
    book, _ = filled()
    passages = dict(summary(book, TwinWords(60635.125), None, seconds=60.0, rangers=18, told=3))
    assert passages["Events"].startswith("VER was not answered; ZY101 A: blocked (5 times)")
    assert "3 by 18 rangers in 60 s, all acknowledged; 1 blocked, 1 reflected" in passages["Shots"]
    assert "1 epoch, 1 compared with the truth: 1 as claimed" in passages["Truth"]
    assert "none was written" in passages["Journal"]
    assert (
        "none was solved"
        in dict(summary(RunSummary(), TwinWords(60635.125), None, seconds=1.0, rangers=1, told=0))["Epochs"]
    )


def test_verdict_and_lines_count_epochs_alike():
    """Below its band an epoch is nearer the truth than it claims: good, and not "within its band"."""
    book, _ = filled(chi2=0.4)
    words = {"seconds": 60.0, "rangers": 18, "told": 3}
    passages = dict(summary(book, TwinWords(60635.125), None, **words))
    assert "1 better than claimed" in passages["Truth"]
    assert "as claimed" not in passages["Truth"]
    assert simulation_object(book, TwinWords(60635.125), None, **words)["verdict"]["word"] == "good"
    beyond, _ = filled(chi2=3.0)
    assert "1 worse than claimed" in dict(summary(beyond, TwinWords(60635.125), None, **words))["Truth"]
    assert simulation_object(beyond, TwinWords(60635.125), None, **words)["verdict"]["word"] == "doubtful"


def test_doubtful_epochs_make_a_doubtful_verdict():
    """Epochs agree with their claim, since it covers the doubt."""
    book, _ = filled()
    doubted = epoch(2)
    doubted.answer["doubts"] = ["WX2's thermometer is biased by about +2.5 °C, or the air is unusual"]
    book.entry(doubted)
    words = {"seconds": 60.0, "rangers": 18, "told": 3}
    told = simulation_object(book, TwinWords(60635.125), None, **words)
    assert told["verdict"]["word"] == "doubtful"
    assert "1 of 2 epochs are doubtful: WX2's thermometer" in told["verdict"]["why"]
    assert [each["doubt"] is None for each in told["epochs"]] == [True, False]


def test_shot_counts_once_in_any_number_of_epochs():
    """1 used, 2 overruled by its epoch, 3 blocked and named by it again, 4 of the next epoch, 5 of none yet."""
    book = RunSummary()
    for number, status in ((1, "used"), (2, "used"), (3, "blocked"), (4, "used")):
        book.entry(shot(number, status=status))
    book.entry(epoch(1, used=[1], of={"2": "reflected: +1 mm off", "3": "blocked: return 0.001 V"}))
    assert dict(book.fates) == {"used": 2, "reflected": 1, "blocked": 1}
    book.entry(shot(5))
    book.entry(epoch(2, used=[], of={"2": "undecided: again", "4": "undecided: one of two"}))
    assert dict(book.fates) == {"used": 2, "reflected": 1, "blocked": 1, "undecided": 1}
    assert sum(book.fates.values()) == book.acknowledged == 5


def test_shots_not_durable_are_not_counted_as_acknowledged():
    book, _ = filled()
    words = {"seconds": 60.0, "rangers": 18, "told": 5}
    passages = dict(summary(book, TwinWords(60635.125), None, **words))
    assert passages["Shots"].startswith("5 by 18 rangers in 60 s, 3 acknowledged, 2 not; ")
    told = simulation_object(book, TwinWords(60635.125), None, **words)
    assert (told["shots"], told["acknowledged"]) == (5, 3)


def test_excluded_rangers_are_not_counted():
    orders = SimpleNamespace(drop=("ZY102", "ZY102"))
    run = SimpleNamespace(site=site(), orders=orders, seconds=6.0, told=9, head=None)
    assert Simulation.totals.fget(run) == {"seconds": 6.0, "rangers": len(site().rangers) - 1, "told": 9, "head": None}


@pytest.mark.parametrize(
    ("chi2", "said"), [(0.5, "better than claimed"), (1.0, "as claimed"), (2.0, "worse than claimed")]
)
def test_epoch_line_judges_the_claim(chi2, said):
    assert epoch_line(filled(chi2=chi2)[0].latest).endswith(said)


def test_plain_lines_show_epochs_and_ongoing_problems():
    said = []
    view = LinesView(said.append)
    book, _ = filled()
    view.begin(book, None, None)
    for entry in (
        epoch(1),
        Happening(6, "coordinator", "blocked", "one shot", "debug"),
        Happening(7, "ZY1", "hung", "no VER", "alarm"),
    ):
        view.entry(entry)
    assert len(said) == 2
    assert "epoch 1: 30 points" in said[0]
    assert said[1].endswith("alarm: no VER")
