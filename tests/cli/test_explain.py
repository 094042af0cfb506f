"""explain as programs call it: keys, statuses, streams, the page that appears whole or not at all."""

import json

import pytest

from catseye.gateways.epoch.explain_page import MARK
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"


def test_a_shot_is_one_json_object_and_nothing_on_stderr(catseye):
    status, out, err = catseye("explain", NIGHT, 3, "--json", "--monte-carlo", 5000, "--seed", 7)
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert out.count("\n") == 1
    assert (found["ranger"], found["target"], found["status"]) == ("ZY116", "DP026", "used")
    assert (found["monte_carlo"]["draws"], found["monte_carlo"]["seed"]) == (5000, 7)
    assert 70.0 < found["range"] < 72.0
    other = json.loads(catseye("explain", NIGHT, 3, "--json", "--monte-carlo", 5000, "--seed", 8)[1])
    assert other["monte_carlo"] != found["monte_carlo"]
    assert {**other, "monte_carlo": None} == {**found, "monte_carlo": None}


def test_people_read_a_table_with_or_without_a_monte_carlo(catseye):
    status, out, err = catseye("explain", NIGHT, 3, "--monte-carlo", 0)
    assert (status, err) == (0, "")
    assert "noise of the target" in out
    assert "together" in out
    assert "draws" not in out


def test_a_shot_without_a_range_is_no_failure(catseye):
    code, out, err = catseye("explain", NIGHT, 19, "--json")
    assert (code, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["status"] == "blocked"
    assert found["range"] is None


def test_a_shot_that_does_not_exist_is_one_line_with_the_range_of_ids(catseye):
    status, out, err = catseye("explain", NIGHT, 760)
    assert (status, out) == (1, "")
    assert err == "catseye: shot 760 is not in shots.csv (expected 1 to 759, 759 shots)\n"


def test_a_missing_campaign_is_one_line(catseye, tmp_path):
    status, out, err = catseye("explain", tmp_path / "none", 1, "--json")
    assert (status, out) == (1, "")
    assert err.count("\n") == 1
    assert "none" in err


@pytest.mark.parametrize(
    "arguments",
    [("x",), (3, "--monte-carlo", 10), (3, "--monte-carlo", -1), (3, "--seed", -1), (3, "--air-model", "a")],
)
def test_what_cannot_be_parsed_is_wrong_usage(catseye, arguments):
    status, out, err = catseye("explain", NIGHT, *arguments)
    assert (status, out) == (2, "")
    assert "Usage" in err


def test_a_page_replaces_its_like_and_nothing_else(catseye, tmp_path):
    page = tmp_path / "shot.html"
    page.write_text(f"{MARK}1 of another night</title>")
    status, out, err = catseye("explain", NIGHT, 3, "--page", page, "--monte-carlo", 1000)
    assert (status, err) == (0, "")
    assert str(page) in "".join(out.split())
    assert "Shot 3 of night-01" in page.read_text(encoding="utf-8")
    other = tmp_path / "mine.html"
    other.write_text("mine")
    status, _, err = catseye("explain", NIGHT, 3, "--page", other, "--monte-carlo", 0)
    assert status == 1
    assert "not a catseye file" in err
    assert other.read_text() == "mine"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine.html", "shot.html"]
