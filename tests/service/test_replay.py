"""Replay under another version: texts, exact numbers, and sizes of changes."""

import math
from functools import cache

import numpy as np
import pytest

from catseye.coordinator.journal.entries import AnsweredShot
from catseye.coordinator.journal.movement import Moving
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.sameness import Sameness
from catseye.errors import InputError
from catseye.service.replay import Cause, replay_object, replay_passages, replayed
from cli.living_scene import recorded
from repository import TESTS
from service.replay_scene import carried_back, in_epoch, reworded, rewritten

JOURNAL_1 = TESTS / "vectors" / "formats" / "journal-1.db"


def again(path):
    return replayed(str(path), None, None, progress=lambda what, done, total: None)


def told(outcome):
    return dict(replay_passages(outcome))


@cache
def seen():
    """Epoch 2's names, places and u as recorded, and a point of both epochs with three coordinates of u > 0."""
    with JournalReader(recorded()) as reader:
        first, second = (solution for _, solution in reader.solutions(1))
    u = np.sqrt(np.diag(second.covariance)).reshape(-1, 3)
    names = second.answer["names"]
    row = next(k for k, name in enumerate(names) if u[k].min() > 0.0 and name in first.answer["names"])
    return names, second.answer["x"], u, row


def moved_by(row, change):
    """Epoch 2 with one point's coordinates changed."""

    def other(entry):
        x = [list(place) for place in entry.answer["x"]]
        x[row] = [float(value) for value in change(np.array(x[row]))]
        return {"x": x}

    return in_epoch(2, other)


def test_same_version_is_identical(tmp_path):
    outcome = again(rewritten(tmp_path / "j.db"))
    assert outcome.sameness is Sameness.IDENTICAL
    assert (outcome.same, outcome.identical, outcome.cause, outcome.first) == (True, True, None, "")
    assert outcome.verdict == ("good", "every answer is the same bit for bit")


def test_reworded_notes_and_reasons_are_the_same_numbers(tmp_path):
    outcome = again(rewritten(tmp_path / "j.db", reworded))
    assert outcome.sameness is Sameness.TEXTS
    assert (outcome.same, outcome.identical, outcome.cause) == (True, False, None)
    assert outcome.same_epochs == outcome.epochs == 2
    assert outcome.identical_epochs == 0
    assert outcome.same_shots == outcome.shots
    assert outcome.shots - outcome.identical_shots == 3  # two blocked and one dropout have a text
    verdict = outcome.verdict
    assert verdict.word == "good"
    assert "texts are another version's" in verdict.why
    assert "2 epochs and 3 shots have texts of another version" in told(outcome)["Epochs"]
    found = replay_object(outcome)
    assert (found["same"], found["identical"], found["cause"], found["parts_differing"]) == (True, False, None, {})


def test_one_ulp_of_a_coordinate_is_reported_with_its_size(tmp_path):
    names, x, u, row = seen()
    ulp = math.ulp(x[row][0])
    outcome = again(rewritten(tmp_path / "j.db", moved_by(row, lambda at: [at[0] + ulp, *at[1:]])))
    assert outcome.sameness is Sameness.DIFFERENT
    assert outcome.cause is Cause.SOFTWARE
    assert (outcome.same_epochs, dict(outcome.parts)) == (1, {"x": 1})
    points = outcome.movements[Moving.POINTS]
    assert (points.largest.name, points.largest.epoch, points.largest.size) == (names[row], 2, ulp)
    assert points.largest_u.size == ulp / u[row][0]
    assert points.rms == pytest.approx(ulp / math.sqrt(points.count), rel=1e-12)
    assert points.rms_u == pytest.approx(ulp / u[row][0] / math.sqrt(points.normalised), rel=1e-12)
    assert f"at most {ulp * 1e3:.1e} mm ({names[row]}, epoch 2)" in told(outcome)["Points"]
    verdict = outcome.verdict
    assert verdict.word == "failed"  # the same name of a version
    assert f"points by up to {ulp * 1e3:.1e} mm, {ulp / u[row][0]:.1e} of a coordinate's u" in verdict.why
    assert "by its solution (x)" in verdict.why


def test_changed_shot_status_in_an_epoch_differs(tmp_path):
    def other(entry):
        number, line = next(iter(entry.answer["rejected"].items()))
        assert line.startswith("blocked: ")
        return {"rejected": {**entry.answer["rejected"], number: line.replace("blocked: ", "dropout: ")}}

    outcome = again(rewritten(tmp_path / "j.db", in_epoch(2, other)))
    assert (outcome.sameness, dict(outcome.parts)) == (Sameness.DIFFERENT, {"rejected": 1})
    assert "no point changes" in outcome.verdict.why


def test_changed_status_of_a_shot_differs(tmp_path):
    def other(entry):
        if isinstance(entry, AnsweredShot) and entry.status == "dropout":
            return AnsweredShot(entry.shot, "stuck", entry.text, entry.range_, entry.u_range, entry.misfit)
        return entry

    outcome = again(rewritten(tmp_path / "j.db", other))
    assert outcome.sameness is Sameness.DIFFERENT
    assert (outcome.shots - outcome.same_shots, outcome.same_epochs) == (1, 2)


def test_changes_not_in_points_are_named_and_measured(tmp_path):
    """A thermometer by 0.1 of its u, and a covariance's last bit: parts and sizes are said."""
    with JournalReader(recorded()) as reader:
        value, u = next(s for _, s in reader.solutions(1)).answer["air"]["WX1"]

    def other(entry):
        return {"air": {**entry.answer["air"], "WX1": [value + 0.1 * u, u]}}

    outcome = again(rewritten(tmp_path / "j.db", in_epoch(1, other)))
    assert dict(outcome.parts) == {"air": 1}
    moved = outcome.movements[Moving.THERMOMETERS]
    assert moved.largest.size == pytest.approx(0.1 * u, rel=1e-9)
    assert (moved.largest_u.name, moved.largest_u.epoch) == ("WX1", 1)
    assert moved.largest_u.size == pytest.approx(0.1, rel=1e-9)
    assert "°C rms" in told(outcome)["Thermometers"]


def test_journal_version_1_by_another_version_reports_size_of_changes(tmp_path, monkeypatch):
    """A point of epoch 2 stored 0.3 mm to the east, notes in other words: mm, u, which point, which epoch.

    Sizes to 1e-9: an ulp of 50 m is 2e-11 of 0.3 mm.
    """
    names, _, u, row = seen()
    monkeypatch.setattr("catseye.coordinator.journal.run.__version__", "0.0.9")
    shift = moved_by(row, lambda at: [at[0] + 3e-4, *at[1:]])
    outcome = again(carried_back(rewritten(tmp_path / "j.db", lambda entry: reworded(shift(entry)))))
    assert outcome.cause is Cause.SOFTWARE
    assert (outcome.other_version, outcome.run.versions["catseye"]) == (True, "0.0.9")
    found = replay_object(outcome)
    points = found["moved"]["points"]
    assert points["largest"] == points["largest_in_u"] == {"name": names[row], "epoch": 2}
    assert points["largest_mm"] == pytest.approx(0.3, rel=1e-9)
    assert points["largest_u"] == pytest.approx(3e-4 / u[row][0], rel=1e-9)
    assert found["points"][names[row]]["largest_u"] == pytest.approx(3e-4 / u[row][0], rel=1e-9)
    assert found["points"][names[row]]["mean_mm"][0] == pytest.approx(-0.15, rel=1e-9)  # new less stored
    assert (found["versions"]["stored"]["catseye"], found["cause"]) == ("0.0.9", "software")
    verdict = outcome.verdict
    assert verdict.word == "doubtful"
    assert "points by up to 0.300 mm" in verdict.why
    why = [text for title, text in replay_passages(outcome) if title == "Why"]
    assert "the software differs: catseye 0.0.9" in why[0]
    assert "no chain" in why[1]


def test_without_samples_the_software_is_not_blamed(tmp_path):
    outcome = again(rewritten(tmp_path / "j.db", keep_buffers=False))
    assert (outcome.sameness, outcome.cause) == (Sameness.DIFFERENT, Cause.SAMPLES)
    assert outcome.verdict.word == "doubtful"
    assert "stored no samples" in told(outcome)["Why"]


def test_old_journal_vector_loads_and_is_refused_in_one_line():
    """Its solutions are of no reduction: it says no settings to reduce it with."""
    with pytest.raises(InputError, match="reduction settings are missing"):
        again(JOURNAL_1)
