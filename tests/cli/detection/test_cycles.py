"""`catseye cycles`: the example's true lengths, files, and one line for what cannot be."""

import json
import re

import numpy as np
import pytest

from repository import ROOT

CYCLES = ROOT / "examples" / "cycles"
TABLE = CYCLES / "three-frequencies.csv"


def truth():
    """True lengths, as the README lists them."""
    text = (CYCLES / "README.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^    (\d[\d., ]+)$", text, re.MULTILINE)
    return [float(v) for v in line.split(",")]


def test_the_examples_lengths_are_found(catseye):
    status, out, err = catseye("cycles", TABLE, "--group-index", 1.000253, "--json")
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["verdict"]["word"] == "good"
    w = [(s["length"] - t) / s["u_length"] for s, t in zip(found["shots"], truth(), strict=True)]
    assert np.max(np.abs(w)) < 3.5
    assert found["sets"][0]["unambiguous"]
    assert found["advice"] is None


def test_people_see_every_shot_and_get_files(catseye, tmp_path):
    status, out, err = catseye("cycles", TABLE, "--group-index", 1.000253, "--out", tmp_path / "out")
    assert (status, err) == (0, "")
    assert out.count(" found") >= 12
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"cycles.json", "cycles.svg", "lengths.csv", "provenance.json"}


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["none.csv"], 1, "missing"),
        ([CYCLES / "README.md"], 1, "header"),
        ([TABLE, "--longest", 30000], 2, "--longest = 30000"),
        ([TABLE, "--group-index", 2], 2, "--group-index = 2"),
        ([TABLE, "--shortest", 300], 2, "--shortest = 300"),
    ],
)
def test_what_cannot_be_is_one_line(catseye, arguments, status, said):
    ended, _, err = catseye("cycles", *arguments)
    assert ended == status
    assert said in " ".join(err.split())
    assert "Traceback" not in err
