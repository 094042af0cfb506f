"""Sameness of answers: numbers to the last bit, codes and statuses; texts apart."""

import math
from dataclasses import replace

import numpy as np
import pytest

from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution
from catseye.coordinator.journal.sameness import (
    Sameness,
    SolutionComparison,
    compare_shots,
    compare_solutions,
    least_same,
)
from catseye.reduction.epoch.reason import Reason, ShotStatus
from journal_scene import scene_shot

COVARIANCE = np.array([[1.0, 2.0], [2.0, 3.0]])
ANSWER = {
    "number": 3,
    "x": [[0.1, None, 5.0]],
    "used": [1, 2],
    "rejected": {"4": "blocked: return 0.0010 V", "5": "a beam that was cut"},
    "pose": {"dish": {"chi2": 1.5}, "feed": None, "missing": ""},
    "notes": ["a", "b"],
}
STORED = EpochSolution(5, ANSWER, COVARIANCE)


def with_answer(**changed):
    return replace(STORED, answer=ANSWER | changed)


def up(number):
    return math.nextafter(number, math.inf)


def test_solution_is_identical_in_any_order_of_keys():
    again = EpochSolution(5, dict(reversed(ANSWER.items())), COVARIANCE.T.copy())
    assert compare_solutions(STORED, again) == SolutionComparison(Sameness.IDENTICAL)


@pytest.mark.parametrize(
    "changed",
    [
        {"notes": []},
        {"rejected": ANSWER["rejected"] | {"4": "blocked: a return of 1 mV"}},
        {"rejected": ANSWER["rejected"] | {"4": Reason(ShotStatus.BLOCKED, "a return of 1 mV")}},
        {"pose": ANSWER["pose"] | {"missing": "in other words"}},
    ],
    ids=["notes", "reason", "live reason", "missing"],
)
def test_texts_are_not_compared(changed):
    other = with_answer(**changed)
    assert compare_solutions(STORED, other) == SolutionComparison(Sameness.TEXTS)
    assert compare_solutions(other, STORED) == SolutionComparison(Sameness.TEXTS)


@pytest.mark.parametrize(
    ("part", "other"),
    [
        ("x", with_answer(x=[[up(0.1), None, 5.0]])),
        ("x", with_answer(x=[[0.1, 0.0, 5.0]])),
        ("used", with_answer(used=[1])),
        ("rejected", with_answer(rejected=ANSWER["rejected"] | {"4": "dropout: return 0.0010 V"})),
        ("rejected", with_answer(rejected={"5": "a beam that was cut"})),
        ("rejected", with_answer(rejected=ANSWER["rejected"] | {"5": "a beam that was lost"})),  # no status to read
        ("pose", with_answer(pose=None)),
        ("pose", with_answer(pose=ANSWER["pose"] | {"dish": {"chi2": up(1.5)}})),
        ("ticks asked for", replace(STORED, ticks=6)),
        ("covariance", replace(STORED, covariance=np.array([[1.0, 2.0], [2.0, up(3.0)]]))),
        ("covariance", replace(STORED, covariance=COVARIANCE.reshape(1, 4))),
        ("covariance", replace(STORED, covariance=None)),
        ("solved or not", EpochSolution(5, {})),
    ],
)
def test_differing_numbers_codes_and_statuses_are_named(part, other):
    assert compare_solutions(STORED, other) == SolutionComparison(Sameness.DIFFERENT, (part,))
    assert compare_solutions(other, STORED) == SolutionComparison(Sameness.DIFFERENT, (part,))


def test_two_failed_solutions_are_identical():
    assert compare_solutions(EpochSolution(5, {}), EpochSolution(5, {})).sameness is Sameness.IDENTICAL


def test_keys_not_stored_by_an_older_version_are_named_not_compared():
    other = with_answer(tilts=[0.5], pose=ANSWER["pose"] | {"dish": {"chi2": 1.5, "bending": 0.2}})
    assert compare_solutions(STORED, other) == SolutionComparison(
        Sameness.TEXTS, unstored=("tilts", "pose.dish.bending")
    )


def test_missing_key_in_the_new_answer_differs():
    found = compare_solutions(with_answer(tilts=[0.5]), STORED)
    assert found == SolutionComparison(Sameness.DIFFERENT, ("tilts",))


def answered(**changed):
    return replace(AnsweredShot(scene_shot(1), "used", "", 100.1, 31e-6, math.nan), **changed)


@pytest.mark.parametrize(
    ("changed", "sameness"),
    [
        ({}, Sameness.IDENTICAL),
        ({"text": "in other words"}, Sameness.TEXTS),
        ({"status": "doubted"}, Sameness.DIFFERENT),
        ({"range_": up(100.1)}, Sameness.DIFFERENT),
        ({"u_range": up(31e-6)}, Sameness.DIFFERENT),
        ({"misfit": 0.0}, Sameness.DIFFERENT),
    ],
)
def test_shots_are_compared_by_status_and_numbers_not_text(changed, sameness):
    assert compare_shots(answered(), answered(**changed)) is sameness


def test_least_same_is_the_worst_of_several():
    assert least_same(Sameness) is Sameness.DIFFERENT
    assert least_same([Sameness.TEXTS, Sameness.IDENTICAL]) is Sameness.TEXTS
    assert least_same([]) is Sameness.IDENTICAL
