"""stray as programs call it."""

import json

import pytest


def test_leakage_of_a_thousandth_is_the_notes_sixteen_micrometres(catseye):
    """[PARKER04] eq. 5.8: 15.9 µm at 1000:1."""
    status, out, err = catseye("stray", "--distance", "100", "--leakage", "0.001", "--json")
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["largest"] * 1e6 == pytest.approx(15.9, abs=0.05)
    assert found["verdict"]["word"] == "doubtful"
    assert found["feedback"] is None
    assert catseye("stray", "--distance", "100", "--leakage", "0.001", "--strict")[0] == 1


def test_a_figure_is_written_and_the_text_names_each_cause(catseye, tmp_path):
    words = ["--distance", "100", "--path", "0.001,80", "--reflector=0.002,-25", "--second-pass", "0.0004"]
    status, out, _ = catseye("stray", *words, "--gain", "0.001", "--out", tmp_path / "stray.png")
    assert status == 0
    for word in ("path 80 mm longer", "reflector -25 mm", "second pass", "quadratures"):
        assert word in out
    assert (tmp_path / "stray.png").read_bytes()[:4] == b"\x89PNG"
    assert catseye("stray", *words, "--out", tmp_path / "stray.xyz")[0] == 1


@pytest.mark.parametrize(
    ("words", "status", "line"),
    [
        ([], 2, "no stray light is given (expected a path, a reflector, a share or feedback)"),
        (["--leakage", "2"], 1, "leakage 2 of the light is not below 1"),
        (["--path", "0.1"], 2, "'0.1' is not a share and millimetres"),
        (["--leakage", "0.1", "--limit-um", "0.1"], 2, "--limit-um = 0.1 is not within 1 to 20000 µm"),
        (["--feedback", "2"], 1, "returned power 2 is not within 0 to 1"),
        (["--second-pass", "1.5"], 1, "the direct light is not the strongest"),
    ],
)
def test_what_is_no_stray_light_is_refused_in_one_line(catseye, words, status, line):
    found, out, err = catseye("stray", "--distance", "100", *words)
    assert (found, out) == (status, "")
    assert line in " ".join(err.replace("--path", "path").split())
