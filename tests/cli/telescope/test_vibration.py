"""`catseye follow`: modes, prediction and motion for people and programs; refusals."""

import json

import pytest

ARM = ["vibration/quadrant.csv", "--slope-mm", "10", "--u-signal", "0.002"]
MODEL = ["--model", "structural-model/telescope.toml"]


def test_the_answer_has_modes_prediction_and_check(catseye):
    status, said, complaint = catseye("follow", *ARM, *MODEL, "--lead-s", "0.5", "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert [mode["name"] for mode in found["modes"]] == ["sway", "nod"]
    assert [row["lead"] for row in found["predicted"]] == [0.5]
    assert found["check"]["ratio"] == pytest.approx(1.0, abs=0.2)
    assert (found["motion"]["frame"], found["motion"]["pivot"]) == ("feed_arm", [0.0, 0.0, 0.0])


def test_people_read_frequency_phase_and_residual(catseye, tmp_path):
    status, said, _ = catseye("follow", *ARM, "--modes", "2", "--near-hz", "0.8", "--near-hz", "1.0", "--out",
                              tmp_path / "arm")  # fmt: skip
    assert status == 0
    for words in ("Mode 1", "Hz, u", " deg, u ", "rms x", "claimed", "following.svg"):
        assert words in said
    assert (tmp_path / "arm" / "following.svg").is_file()


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [
        ([ARM[0]], 2, "--slope-mm"),
        ([*ARM, "--target", "ZEG1"], 2, "--target says nothing without --model"),
        ([*ARM, *MODEL, "--ranger", "ZY115"], 2, "--ranger says nothing without --site"),
        ([*ARM, "--lead-s=-1"], 2, "--lead-s = -1"),
        (["none.csv", *ARM[1:]], 1, "none.csv"),
        ([*ARM, "--model", "none.toml"], 1, "none.toml"),
    ],
)
def test_what_cannot_be_done_is_one_line(catseye, arguments, status, complaint):
    found, _, complained = catseye("follow", *arguments)
    assert found == status
    assert complaint in complained.replace("\n", " ")
