"""`catseye convert`: points of one frame in another, for people and programs; refusals."""

import json

import pytest

FOCUS = ["--point", "0,0,60", "--from-frame", "reflector", "--to-frame", "ground"]


def test_the_answer_has_points_transform_and_posture(catseye):
    status, said, complaint = catseye("convert", *FOCUS, "--posture", "90,45", "--u-mm", "1,1,1", "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    [point] = found["points"]
    assert [point[axis] for axis in "xyz"] == pytest.approx([7.184829, 0.0, 132.999039], abs=0.6e-6)
    assert [point["covariance"][k][k] for k in range(3)] == pytest.approx([1e-6] * 3)
    assert (found["from_frame"], found["to_frame"], found["transform"]["frame"]) == ("reflector", "ground", "ground")


def test_people_read_coordinates_frame_and_pivot(catseye, tmp_path):
    status, said, _ = catseye("convert", *FOCUS, "--posture", "90,45", "--out", tmp_path / "out")
    assert status == 0
    for words in ("7.184829", "132.999039", "pivot of its turn", "azimuth 90 deg, elevation 45 deg", "rigid telescope"):
        assert words in said
    assert (tmp_path / "out" / "frames.svg").is_file()
    status, said, _ = catseye("convert", "--point", "0,0,0", "--from-frame", "subreflector", "--to-frame",
                              "feed_arm", "--subreflector-shift-mm", "0,0,10")  # fmt: skip
    assert "shift 0, 0, 10 mm" in said
    assert said.splitlines()[-1].split()[-2:] == ["8.000000", "50.010000"]


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [
        ([*FOCUS], 2, "--posture is missing"),
        ([*FOCUS, "--posture", "0,99"], 2, "--posture = 0, 99"),
        ([*FOCUS, "--file", "coord.dat", "--posture", "0,30"], 2, "--point"),
        ([*FOCUS, "--posture", "0"], 2, "AZ,EL"),
        (["--point", "0,0,60", "--from-frame", "dish", "--to-frame", "ground"], 2, "not one of ground"),
        ([*FOCUS, "--site", "nowhere"], 1, "nowhere"),
    ],
)
def test_what_cannot_be_done_is_one_line(catseye, arguments, status, complaint):
    found, _, complained = catseye("convert", *arguments)
    assert found == status
    assert complaint in complained.replace("\n", " ")
    assert "Traceback" not in complained
