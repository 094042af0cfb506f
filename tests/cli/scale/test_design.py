"""`catseye design`: its sentences, its JSON, its files, and its complaints."""

import json

import pytest

from command_scene import command_line

SMALL = "designs/structure-60m.toml"
QUICK = ["--steps", "5", "--exchanges", "0", "--map-side", "0", "--quiet"]


@pytest.fixture
def catseye(capsys, tmp_path, monkeypatch):
    """A command run in this process and an empty directory."""
    monkeypatch.chdir(tmp_path)
    return command_line(capsys)


def test_a_study_is_told_and_written(catseye, tmp_path):
    words = ["design", SMALL, "--vary", "ranger RG001 within 5 m", "--runs", "200", "--out", "out"]
    status, said, complaint = catseye(*words, *QUICK[:-1])
    assert (status, complaint) == (0, "")
    for words in ("The worst axis", "RG001", "simulated measurements", "out/: report.html"):
        assert words in said
    assert (tmp_path / "out" / "design.json").exists()


def test_json_is_one_object(catseye):
    status, said, _ = catseye("design", SMALL, "--vary", "rangers within 2 m", "--runs", "0", "--json", *QUICK)
    answer = json.loads(said, parse_constant=pytest.fail)
    assert status == 0
    assert answer["format"] == "catseye-design-study-1"
    assert answer["after"]["u"] < answer["before"]["u"]
    assert answer["verdict"]["word"] == "doubtful"  # not confirmed


@pytest.mark.parametrize(
    ("words", "status", "why"),
    [
        (["--vary", "mirrors"], 1, "vary 'mirrors' is not understood"),
        (["--vary", "rangers", "--criterion", "gain"], 2, "--frequency-ghz"),
        (["--vary", "rangers", "--criterion", "best"], 2, "not one of trace"),
        (["--vary", "rangers", "--posture", "12"], 2, "azimuth,elevation"),
        (["--vary", "rangers", "--interest", "XX"], 1, "interest 'XX' is no point"),
    ],
)
def test_complaints_are_one_line(catseye, words, status, why):
    ended, _, complaint = catseye("design", SMALL, *words, "--runs", "0", *QUICK)
    assert ended == status
    assert why in complaint
    assert "Traceback" not in complaint


def test_strict_ends_with_1_without_confirmation(catseye):
    words = ["design", SMALL, "--vary", "rangers within 2 m", "--runs", "0", "--strict", *QUICK]
    assert catseye(*words)[0] == 1
