"""Page of what was measured: its tables are of its data, the data name their run, a part is measured again."""

import json
import re

import pytest

from evidence import baselines, networks, nights, page, wrong_records
from hostile.outcome import OUTCOMES, outcome
from hostile.rows import NAMES


@pytest.fixture(scope="module")
def data():
    return json.loads(page.DATA.read_text(encoding="utf-8"))


def test_the_page_has_the_tables_of_its_data(data):
    text = page.PAGE.read_text(encoding="utf-8")
    assert page.filled(text, data) == text
    changed = json.loads(json.dumps(data))
    changed["nights"][0]["classes"]["arm"]["mean"] += 1.0
    assert page.filled(text, changed) != text


def test_the_data_name_their_run(data):
    run = data["run"]
    assert data["format"] == "catseye-evidence-1"
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", run["date"])
    assert re.fullmatch(r"\d+\.\d+\.\d+\S*", run["version"])
    assert run["revision"]
    assert "dirty" not in run["revision"]
    assert run["processor"]
    assert run["processor_s"] > 10.0
    assert {n["prisms"] for n in data["nights"]} >= {60, 200}
    assert all(n["seeds"][0] == nights.FIRST_SEED[n["prisms"]] for n in data["nights"])
    assert [row["row"] for row in data["wrong_records"]] == list(NAMES)
    for row in data["wrong_records"]:
        assert (
            sum(row[word] for word in OUTCOMES)
            == row["nights"]
            == len(wrong_records.nights_of(row["row"], data["wrong_records"][0]["nights"]))
        )


def test_a_page_without_a_place_for_a_table_is_refused(data):
    text = page.PAGE.read_text(encoding="utf-8")
    with pytest.raises(AssertionError, match="0 places for baseline"):
        page.filled(text.replace("<!-- baseline: written by make evidence -->", ""), data)


def test_networks_and_baseline_are_measured_again(data):
    """Tolerances: a tenth of the last digits that the others print, as rounding differs between machines."""
    for row, kept in zip(networks.compared(), data["networks"], strict=True):
        assert row["network"] == kept["network"]
        assert row["largest_difference_m"] == pytest.approx(kept["largest_difference_m"], abs=1e-9)
        assert row["largest_difference_of_u"] == pytest.approx(kept["largest_difference_of_u"], abs=1e-6)
    for row, kept in zip(networks.factors(), data["variance_factors"], strict=True):
        assert row["ours"] == pytest.approx(kept["ours"], abs=1e-6)
        assert row["ours"] == pytest.approx(row["printed"], abs=6e-4)
    again = baselines.compared()
    assert {k: v for k, v in again.items() if k.endswith("_m")} == pytest.approx(
        {k: v for k, v in data["baseline"].items() if k.endswith("_m")}, abs=1e-9
    )


def test_the_first_night_and_two_wrong_records_are_measured_again(data, tmp_path):
    """The same seed on another machine: rounding moves a settled adjustment by up to 0.02 of u."""
    (small,) = [n for n in data["nights"] if n["prisms"] == 60]
    again = nights.one(nights.FIRST_SEED[60], 60, tmp_path / "first")
    assert again["mean"] == pytest.approx(small["first_night"], rel=0.05)
    kept = {row["row"]: row["first_night"] for row in data["wrong_records"]}
    for name in ("humidity as a fraction", "d0 in metres"):
        again = outcome(wrong_records.nights_of(name, 1)[0])
        assert {"lies": list(again.case.lies), "word": again.word} == kept[name]
