"""`catseye servo identify`: the example's truth, its loop, spoilt tables."""

import json
from functools import partial

import pytest

from repository import ROOT

MOVES = ROOT / "examples" / "servo" / "moves.csv"
GAINS = ("--kp", 176, "--ki", 217, "--kd", 2273, "--interval", 3)
TRUE = {"gain": 9325.48, "decay": 3.0, "friction": 4.2667, "delay": 3.4133e-4}  # examples/servo/make_examples.py


@pytest.fixture
def asked(catseye):
    """`catseye servo identify` run in this process: exit status, output, errors."""
    return partial(catseye, "servo", "identify")


def test_the_examples_truth_is_found_within_its_u(asked, tmp_path):
    status, out, err = asked(MOVES, *GAINS, "--json", "--out", tmp_path / "out")
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert found["verdict"]["word"] == "good"
    for name, true in TRUE.items():
        assert abs(found[name] - true) < 2.5 * found[f"u_{name}"], name
    assert found["loop"]["crossover_hz"] == pytest.approx(20.0, rel=0.02)  # designed for 20 Hz and 55 degrees
    assert found["loop"]["phase_margin"] == pytest.approx(0.96, abs=0.04)
    names = "moves.svg provenance.json result.json samplers.fits windows.csv"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names.split()


def test_a_loop_with_a_small_phase_margin_is_doubtful(asked):
    status, out, _ = asked(MOVES, "--kp", 300, "--kd", 800)
    assert status == 0
    assert "Doubtful" in out
    assert "the phase margin is" in out


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("position_counts", "place", "position_counts"),
        ("1,0.0341333,", "1,0.0341999,", "not evenly spaced"),
        ("1,0.0341333,", "1,0.0341333,9", "-128 to 128"),
    ],
)
def test_spoilt_tables_are_refused_in_a_line(asked, tmp_path, old, new, said):
    text = MOVES.read_text("utf-8")
    assert old in text
    spoilt = tmp_path / "moves.csv"
    spoilt.write_text(text.replace(old, new), "utf-8")
    status, out, err = asked(spoilt)
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert said in err


def test_a_lonely_gain_is_wrong_usage(asked):
    status, _, err = asked(MOVES, "--kp", 3)
    assert status == 2
    assert "--kd is missing" in err
