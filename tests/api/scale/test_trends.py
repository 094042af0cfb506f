"""`catseye.trends` over a simulated archive: planted changes are alarms, and what is missing is said."""

import json

import numpy as np
import pytest

import catseye
from archive_scene import NEW_YEAR, YearTruth, written_year
from catseye.cli.commands import join_commands
from catseye.errors import ArgumentError, InputError
from command_scene import command_line

NIGHTS = 70
TRUTH = YearTruth(
    sag=0.0,
    steps={"ZP00002": (30, (0.0, 0.0, 1e-3))},
    zero_steps={"ZY107": (25, 3e-4)},
    zero_drift={"ZY103": 2e-3},
    thermometers={"WX2": 4.0},
    missing=tuple(range(40, 50)),
)


@pytest.fixture(scope="module")
def year(tmp_path_factory):
    """Archive of 60 of 70 nights, 9 points."""
    where = tmp_path_factory.mktemp("trends") / "years"
    written_year(where, NIGHTS, 9, seed=3, truth=TRUTH)
    return where


@pytest.fixture(scope="module")
def result(year):
    return catseye.trends(year)


def alarms(result, kind):
    return {alarm.subject: alarm for alarm in result.alarms if alarm.kind.value == kind}


def test_planted_changes_are_alarms(result):
    steps, drifts = alarms(result, "step"), alarms(result, "drift")
    assert set(steps) == {"ZP00002", "ZY107"}
    assert steps["ZP00002"].value == pytest.approx(1e-3, abs=4.0 * steps["ZP00002"].u)
    assert steps["ZY107"].value == pytest.approx(3e-4, abs=4.0 * steps["ZY107"].u)
    assert abs(steps["ZY107"].mjd - (TRUTH.start + 25)) <= 2.0
    assert set(drifts) == {"ZY103", "WX2"}
    assert drifts["WX2"].value == pytest.approx(4.0, abs=4.0 * drifts["WX2"].u)
    assert drifts["ZY103"].value == pytest.approx(2e-3, abs=4.0 * drifts["ZY103"].u)
    assert all(alarm.severity.value == "alarm" for alarm in (*steps.values(), *drifts.values()))
    assert alarms(result, "nights missing")
    assert result.verdict.word == "doubtful"


def test_answers_are_tables_json_figures_and_a_report(result, tmp_path):
    tables = result.tables()
    assert set(tables) == {"alarms", "coefficients", "points", "instruments"}
    assert len(tables["points"]) == 9
    assert json.loads(result.to_json())["series"] == result.found.series
    assert {"alarms", "noise", "series"} <= set(result.figures())
    assert any(table for table in result.to_report()["tables"].values())
    out = catseye.save(result, tmp_path / "out")
    written = {path.name for path in out.iterdir()}
    assert {
        "report.html",
        "alarms.csv",
        "coefficients.csv",
        "points.csv",
        "instruments.csv",
        "provenance.json",
    } <= written
    assert "ZY107" in (out / "report.html").read_text(encoding="utf-8")


def test_a_certificate_that_ends_soon_or_ended_is_said(tmp_path):
    written_year(tmp_path / "years", 6, 3, seed=1, truth=YearTruth(start=NEW_YEAR + 150.0))
    soon = catseye.trends(tmp_path / "years")
    assert len(alarms(soon, "certificate ends")) == 18
    written_year(tmp_path / "later", 6, 3, seed=1, truth=YearTruth(start=NEW_YEAR + 250.0))
    ended = alarms(catseye.trends(tmp_path / "later"), "certificate ended")
    assert {alarm.count for alarm in ended.values()} == {6}


def test_what_cannot_be_answered_is_one_line(year, tmp_path):
    with pytest.raises(ArgumentError, match="bodies = 'boat': not in the archive"):
        catseye.trends(year, bodies="boat")
    with pytest.raises(InputError, match="one night"):
        catseye.trends(year, until=TRUTH.start + 0.5)
    with pytest.raises(InputError, match="no night between these times"):
        catseye.trends(year, since=TRUTH.start + 1000.0)
    with pytest.raises(ArgumentError, match=r"false_alarm = 0\.9"):
        catseye.trends(year, false_alarm=0.9)
    with pytest.raises(ArgumentError, match="is not before until"):
        catseye.trends(year, since=2.0, until=1.0)
    with pytest.raises(InputError):
        catseye.trends(tmp_path)


def test_two_nights_have_a_model_and_no_trend(year):
    two = catseye.trends(year, until=TRUTH.start + 1.5)
    assert not alarms(two, "step")
    assert not alarms(two, "drift")
    assert all(body.functions.names == ("1",) for body in two.found.bodies)


def test_the_command_says_and_writes_the_same(year, tmp_path, capsys):
    join_commands()
    run = command_line(capsys)
    status, said, complaint = run("trends", year, "--body", "dish*", "--quiet", "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said)
    assert set(found["bodies"]) == {"dish prism"}
    assert any(alarm["subject"] == "ZY107" for alarm in found["alarms"])
    status, _, complaint = run("trends", year, "--body", "boat")
    assert status == 2
    assert "--body" in complaint


def test_a_prediction_has_a_covariance(result):
    place, covariance = result.predict("dish prism", elevation_deg=45.0, temperature_c=10.0, mjd=TRUTH.start + 60.0)
    assert place.shape == (8, 3)
    assert np.linalg.eigvalsh(covariance).min() > 0.0
    with pytest.raises(InputError, match="has no model"):
        result.body("boat")
