"""`catseye pose` of two tables of points: answer, files, and usage."""

import json

import pytest

from catseye.gateways.writers.samplers_fits import read_samplers
from reduction.surface.any_dish_scene import FOLDER


@pytest.fixture
def catseye(catseye):
    """The command `pose`."""
    return lambda *arguments: catseye("pose", *arguments)


def test_two_tables_give_a_pose_and_its_files(catseye, tmp_path):
    out = tmp_path / "out"
    tables = ("dishes/receiver-later.csv", "dishes/receiver.csv")
    status, said, complaint = catseye(*tables, "--pivot", "0,0,9", "--robust", "igg3", "--out", out, "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert (found["verdict"]["word"], found["frame"], found["pivot"]) == ("good", "table", [0.0, 0.0, 9.0])
    assert (list(found["left_out"]), found["missing"]) == (["R07"], ["R12"])
    assert json.loads((out / "pose.json").read_text()) == found
    assert list(read_samplers(out / "samplers.fits")) == ["POSE", "POINTS"]
    provenance = json.loads((out / "provenance.json").read_text())
    assert set(provenance["inputs_sha256"]) == {"receiver.csv", "receiver-later.csv"}
    status, said, _ = catseye(*tables)
    text = " ".join(said.split())
    assert "Doubtful" in text
    assert "R07 has the largest |w|" in text
    assert "one point is not in both: R12" in text


def test_metres_typed_as_millimetres_are_refused_in_one_line(catseye, tmp_path):
    text = (FOLDER / "receiver.csv").read_text(encoding="utf-8")
    (tmp_path / "wrong.csv").write_text(text.replace("x_mm,y_mm,z_mm", "x_m,y_m,z_m"), encoding="utf-8")
    status, said, complaint = catseye("dishes/receiver-later.csv", tmp_path / "wrong.csv", "--json")
    assert (status, said, complaint.count("\n")) == (1, "", 1)
    assert "another unit than a heading says" in complaint


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ((), "--site is needed"),
        (("dishes/receiver.csv", "--group", "dish"), "--group needs --site"),
        (("dishes/receiver.csv", "--tilt", "1,2,3"), "--tilt needs the group alidade"),
        (("dishes/receiver.csv", "--posture", "10,20"), "--posture needs --site"),
    ],
)
def test_usage_names_the_options(catseye, options, named):
    status, said, complaint = catseye("dishes/receiver-later.csv", *options)
    assert (status, said) == (2, "")
    assert named in complaint
