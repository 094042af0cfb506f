"""catseye panels as its users meet it: keys, files, words, refusals; and the example that says what it plants."""

import csv
import json
import re

import pytest

from command_scene import COMMAND, attempt
from gateways.report_scene import column, read, texts, words_of
from panel_scene import EXAMPLE

TOOL = ["--instrument", EXAMPLE / "tool.toml"]
FOUND = EXAMPLE / "as-found.csv"
ALL = [
    FOUND,
    *TOOL,
    "--survey",
    EXAMPLE / "survey.csv",
    "--cmm",
    EXAMPLE / "maps",
    "--as-left",
    EXAMPLE / "as-left.csv",
]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """One run with everything and a directory."""
    import contextlib
    import io

    out = tmp_path_factory.mktemp("panels") / "out"
    said, complained = io.StringIO(), io.StringIO()
    arguments = ["panels", *map(str, ALL), "--reject", "--json", "--out", str(out)]
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complained):
        status = attempt(lambda: COMMAND.main(arguments, prog_name="catseye"))
    return status, said.getvalue(), complained.getvalue(), out


def test_one_object_says_what_the_crew_did(whole):
    status, said, complained, _ = whole
    assert (status, complained) == (0, "")
    told = json.loads(said, parse_constant=pytest.fail)
    assert told["layout"] == {"panels": 2004, "corners": 2209}
    assert told["as_found"]["standing"]["corners"] == 284
    assert told["as_found"]["standing"]["rms"] > 150e-6
    assert told["as_left"]["standing"]["rms"] < 15e-6
    assert told["as_left"]["standing"]["within"] > 0.95
    assert 0.95 < told["setting"]["gain"] < 1.0  # planted: 0.98, and a hand that misses by 0.004 turns
    assert told["screws_from"] == "as_left"
    assert len(told["screws"]) == 288
    assert len(told["actuators"]) == 100
    (doubt,) = told["as_found"]["doubts"]
    assert (doubt["where"], doubt["gauge"], doubt["member"], doubt["out"]) == ("line 132", "a", "Ben", True)
    assert doubt["error"] == pytest.approx(120e-6, abs=15e-6)
    assert told["as_left"]["doubts"] == []


def test_the_files_are_whole_and_agree_with_the_object(whole):
    _, said, _, out = whole
    told = json.loads(said)
    assert {p.name for p in out.iterdir()} == {
        "report.html", "samplers.fits", "screws.csv", "actuators.csv", "panels.csv", "readings.csv",
        "readings-as-left.csv", "crew.csv", "panels.json", "provenance.json",
    }  # fmt: skip
    assert json.loads((out / "panels.json").read_text()) == told
    with (out / "screws.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 288
    assert all(r["verdict"] in ("leave", "turn", "read", "alone") for r in rows)
    for row, screw in zip(rows, told["screws"], strict=True):
        assert (row["panel"], row["corner"]) == (screw["panel"], screw["corner"])
        if screw["relative"] is not None:
            assert float(row["relative_um"]) == pytest.approx(1e6 * screw["relative"], abs=0.006)
            assert float(row["turns_clockwise"]) == pytest.approx(-screw["relative"] / 1.27e-3, abs=6e-4)
    with (out / "readings.csv").open() as stream:
        readings = list(csv.DictReader(stream))
    assert [r["place"] for r in readings if r["status"] == "left out"] == ["line 132"]
    provenance = json.loads((out / "provenance.json").read_text())
    assert {"as-found.csv", "as-left.csv", "tool.toml", "survey.csv", "maps/ (72 maps)", "targets.toml"} <= set(
        provenance["inputs_sha256"]
    )
    page = (out / "report.html").read_text()
    report = read(page)
    assert {"corners-as-found", "corners-as-left", "surface", "turning", "control-members-as-left"} <= set(
        report["charts"]
    )
    turned = {(r["panel"], r["corner"]): float(r["turns_clockwise"]) for r in rows if r["verdict"] == "turn"}
    keys = zip(column(report, "screws", "panel"), column(report, "screws", "corner"), strict=True)
    assert dict(zip(keys, column(report, "screws", "turns"), strict=True)) == pytest.approx(turned, abs=6e-4)
    assert not re.search(r"\b(nan|inf|None)\b", " ".join(words_of(page)) + texts(report))


def test_people_are_told_in_words_and_a_table_of_a_layout_serves_as_well(catseye):
    status, said, complained = catseye("panels", FOUND, *TOOL, "--layout", EXAMPLE / "layout.csv")
    assert (status, complained) == (0, "")
    for word in ("As found", "turn 279", "Doubt, found", "No survey", "No maps"):
        assert word in said
    assert catseye("panels", FOUND, *TOOL, "--quiet")[:2] == (0, "")


@pytest.mark.parametrize(
    ("arguments", "status", "told"),
    [
        ([FOUND], 2, ""),
        (["nowhere.csv", *TOOL], 1, "nowhere.csv: missing in ."),
        ([FOUND, "--instrument", EXAMPLE / "survey.csv"], 1, "survey.csv"),
        ([FOUND, *TOOL, "--layout", "elsewhere"], 1, "elsewhere"),
        ([FOUND, *TOOL, "--as-left", FOUND], 1, "as-found.csv: two inputs have this name"),
        ([FOUND, *TOOL, "--cmm", EXAMPLE / "nothing"], 1, "is not a directory"),
        ([FOUND, *TOOL, "--focal-length-m", "nan"], 2, ""),
        ([FOUND, *TOOL, "--out", EXAMPLE], 1, "--out"),
    ],
)
def test_what_cannot_be_is_one_line(catseye, arguments, status, told):
    found, said, complained = catseye("panels", *arguments)
    assert (found, said) == (status, "")
    assert told in complained
    if status == 1:
        assert complained.count("\n") == 1


def test_nothing_is_left_where_a_reading_is_bad(catseye, tmp_path):
    text = FOUND.read_text().replace("0.794", "94", 1)
    bad = tmp_path / "bad.csv"
    bad.write_text(text)
    status, said, complained = catseye("panels", bad, *TOOL, "--out", tmp_path / "out")
    assert (status, said) == (1, "")
    assert "bad.csv: line 3, d_mm = '94' (expected within ± 6.35 mm, half the travel)" in complained
    assert [p.name for p in tmp_path.iterdir()] == ["bad.csv"]
