"""`catseye subreflector`: lengths for a position, a position for lengths, files, refusals."""

import json

import pytest

MOUNT = ["subreflector", "subreflector/hexapod.toml"]


def test_people_read_lengths_and_the_files_are_there(catseye, tmp_path):
    status, said, _ = catseye(*MOUNT, "--shift-mm", "0,0,10", "--out", tmp_path / "out")
    assert status == 0
    for words in ("shift z       10.00000", "1A", "2040 to 2640", "every actuator is within its limits"):
        assert words in said
    files = ["actuators.svg", "lengths.csv", "position.csv", "provenance.json", "result.json"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == files


def test_the_answer_to_lengths_has_the_position_with_covariance(catseye):
    status, said, complaint = catseye(*MOUNT, "--lengths-mm", "2340,2340,2340,2340,2340,2340", "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert found["shift"][:2] == pytest.approx([0.0, 0.0], abs=1e-4)  # three equal pairs, joints rounded to 0.1 mm
    assert found["source"] == "lengths"
    assert len(found["covariance"]) == 6


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [
        ([], 2, "expected --shift-mm with --turn-deg, --lengths-mm, or --pose"),
        (["--shift-mm", "1,2"], 2, "X,Y,Z in millimetres"),
        (["--lengths-mm", "100,100,100,100,100,9000"], 1, "no position reached from rest"),
        (["--pose", "none.json"], 1, "none.json"),
    ],
)
def test_what_cannot_be_done_is_one_line(catseye, arguments, status, complaint):
    found, _, complained = catseye(*MOUNT, *arguments)
    assert found == status
    assert complaint in " ".join(complained.split())
