"""A shot explained for programs and for people: the same numbers in the object, the lines and the page."""

import dataclasses
import json
from datetime import UTC, datetime

import numpy as np
import pytest

from catseye.gateways.epoch.explain import budget_lines, explanation_object, explanation_passages
from catseye.gateways.epoch.explain_figures import _colour, figures
from catseye.gateways.epoch.explain_page import MARK, explanation_report
from catseye.gateways.writers.drawing import svgs
from catseye.gateways.writers.objects import json_line
from catseye.gateways.writers.report_page import report_page
from catseye.reduction.budget.explanation import explain_shot
from catseye.reduction.budget.scene import Assumptions
from gateways.report_scene import column, read, row, texts, words_of

WHEN = datetime(2026, 1, 2, tzinfo=UTC)
KEYS = {
    "shot", "ranger", "target", "mjd_utc", "status", "reason", "range", "u_range", "expanded_uncertainty",
    "coverage_factor", "effective_degrees_of_freedom", "cycles", "margin", "slip_probability", "inputs",
    "correlations", "monte_carlo", "adjusted",
}  # fmt: skip
INPUT_KEYS = {
    "name", "value", "unit", "standard_uncertainty", "distribution", "degrees_of_freedom", "sensitivity",
    "contribution", "share", "source",
}  # fmt: skip


@pytest.fixture(scope="module")
def explained(reduction):
    """Function shot -> explanation with a short Monte Carlo."""
    known = {}

    def of(shot):
        if shot not in known:
            known[shot] = explain_shot(reduction.campaign, shot, draws=20_000, reduction=reduction)
        return known[shot]

    return of


def told(found):
    """The object after its way through JSON, in which NaN would not survive."""
    return json.loads(json_line(explanation_object(found, 1)), parse_constant=pytest.fail)


def text_of(found):
    return "\n".join([*(f"{p.title}: {p.text}" for p in explanation_passages(found)), *budget_lines(found)])


@pytest.mark.parametrize("shot", [3, 700, 94, 1, 19])
def test_the_object_has_the_contracts_keys_for_every_status(explained, shot):
    found = told(explained(shot))
    assert set(found) >= KEYS
    assert found["shot"] == shot
    for entry in found["inputs"]:
        assert set(entry) == INPUT_KEYS


def test_the_inputs_of_the_object_give_its_uncertainty_again(explained):
    found = told(explained(3))
    parts = [entry["sensitivity"] * entry["standard_uncertainty"] for entry in found["inputs"]]
    assert [entry["contribution"] for entry in found["inputs"]] == pytest.approx(parts)
    assert found["u_range"] == pytest.approx(np.sqrt(np.sum(np.square(parts))))
    assert sum(entry["share"] for entry in found["inputs"]) == pytest.approx(1.0)
    assert found["expanded_uncertainty"] == pytest.approx(found["coverage_factor"] * found["u_range"])
    assert found["correlations"] == []
    sheets = {entry["name"]: entry["degrees_of_freedom"] for entry in found["inputs"]}
    assert sheets["distance of the cube D0"] is None
    assert sheets["noise of the target"] == 127.0


def test_monte_carlo_is_reported_with_draws_and_seed(explained):
    found = told(explained(3))
    beside = found["monte_carlo"]
    assert (beside["draws"], beside["seed"]) == (20_000, 1)
    assert beside["standard_uncertainty"] == pytest.approx(found["u_range"], rel=0.03)
    assert beside["low"] < found["range"] < beside["high"]
    assert beside["agrees"] is True


def test_disagreeing_interval_is_reported(explained):
    found = explained(3)
    wider = dataclasses.replace(found.scattered, high=found.scattered.high + 3.0 * found.budget.u)
    doubted = dataclasses.replace(found, scattered=wider)
    assert told(doubted)["monte_carlo"]["agrees"] is False
    assert "use this one" in text_of(doubted)
    assert "use this one" not in text_of(found)


def test_correlated_inputs_are_named(reduction):
    alike = Assumptions(thermometer_correlation=0.5)
    found = explain_shot(reduction.campaign, 3, assumptions=alike, reduction=reduction)
    (pair,) = told(found)["correlations"]
    assert pair["correlation"] == 0.5
    assert {pair["first"], pair["second"]} == {"offset of thermometer WX1", "offset of thermometer WX2"}
    assert "+0.50" in text_of(found)


def test_shot_without_range_gives_reason_and_return(explained):
    blocked, reference = explained(19), explained(1)
    for found in (told(blocked), told(reference)):
        assert found["range"] is None
        assert found["inputs"] == []
        assert found["monte_carlo"] is None
        assert found["amplitude"] > 0.0
    assert "blocked: return 0.0025 V" in text_of(blocked)
    assert "no return" in text_of(blocked)
    assert "internal cube" in text_of(reference)
    assert budget_lines(blocked) == []


def test_a_rejected_shot_is_explained_with_a_warning(explained):
    found = explained(94)
    text = text_of(found)
    assert "reflected" in text
    assert "does not include the reason for which this shot was rejected" in text
    assert -5e-3 < found.adjusted.residual < -4.7e-3  # a reflection 5 mm too near, less what the points gave way
    assert f"{-1e6 * found.adjusted.residual:.0f} µm less than between the adjusted points" in text
    assert text.count("stray reflection") == 1


def test_the_table_is_sorted_and_adds_up(explained):
    found = explained(3)
    lines = budget_lines(found)
    shares = [float(line.split()[0]) for line in lines[1:-2]]
    assert shares == sorted(shares, reverse=True)
    assert float(lines[-1].split()[0]) == 100.0
    assert sum(float(line.split()[0]) for line in lines[1:-1]) == pytest.approx(100.0, abs=0.1)
    assert float(lines[-1].split()[1]) == pytest.approx(found.budget.u * 1e6, abs=0.006)
    assert all(len(line) <= 110 for line in lines)


def test_page_is_self_contained_and_names_every_input(explained, reduction):
    found = explained(3)
    html = report_page(explanation_report(found, reduction.campaign, WHEN))
    assert MARK in html[:4096]
    report = read(html)
    budget = found.budget
    assert sorted(column(report, "budget", "input")) == sorted(item.given.name for item in found.items)
    for item, part in zip(found.items, budget.contribution, strict=True):
        shown = row(report, "budget", item.given.name)
        assert shown["source"] == item.source
        assert shown["contribution"] == pytest.approx(part * 1e6, abs=5.1e-5)
    assert report["charts"].keys() == {"contributions", "histogram"}
    assert report["charts"]["contributions"]["y"]["values"][0] == pytest.approx(budget.u * 1e6, abs=5.1e-4)
    assert column(report, "inputs", "value") == list(reduction.campaign.hashes.values())
    assert found.verdict.why in " ".join(words_of(html))


def test_the_page_of_a_shot_without_a_range_has_no_charts(explained, reduction):
    report = read(report_page(explanation_report(explained(19), reduction.campaign, WHEN)))
    assert "blocked: return" in texts(report)
    assert report["charts"] == {}


def test_figures_are_drawn_the_same_each_time(explained):
    found = explained(94)
    first, second = svgs(figures(found)), svgs(figures(found))
    assert first == second
    assert set(first) == {"contributions", "histogram"}
    assert set(figures(dataclasses.replace(found, scattered=None))) == {"contributions"}


@pytest.mark.parametrize("key", ["second pass cosine", "feedback", "image"])
def test_effects_of_a_head_have_its_colour(key):
    assert _colour(key) == _colour("leakage real") != _colour("noise")
