"""`catseye surface` of a dish without a site: answers, files, and spoiled tables whose mistake is named."""

import json

import pytest

from catseye.gateways.writers.samplers_fits import read_samplers
from reduction.surface.any_dish_scene import FOLDER

DISH = ("--focal-length-m", 9, "--diameter-m", 25)
HEAD = "point,x_mm,y_mm,z_mm,u_x_mm,u_y_mm,u_z_mm"


@pytest.fixture
def catseye(catseye):
    """The command `surface`."""
    return lambda *arguments: catseye("surface", *arguments)


def test_a_table_of_another_dish_is_answered_and_written(catseye, tmp_path):
    out = tmp_path / "out"
    status, said, complaint = catseye("dishes/surface.csv", *DISH, "--frequency-ghz", 86, "--out", out, "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert found["verdict"]["word"] == "good"
    assert found["dish"] == {
        "site": None, "focal_length": 9.0, "radius": 12.5, "centre": [0.0, 0.0], "vertex": [0.0, 0.0, 0.0],
        "axis": [0.0, 0.0, 1.0], "x": [1.0, 0.0, 0.0],
    }  # fmt: skip
    assert found["paraboloid"]["frame"] == "table"
    assert json.loads((out / "surface.json").read_text()) == found
    assert json.loads((out / "provenance.json").read_text())["dish"] == found["dish"]
    assert list(read_samplers(out / "samplers.fits")) == ["PRISMS", "ZERNIKE"]
    status, said, _ = catseye("dishes/surface.csv", *DISH)
    assert (status, "160 points of" in said, "table axes" in said) == (0, True, True)
    assert "rotation of the dish with a shift of its vertex" in " ".join(said.split())


def spoiled(tmp_path, change):
    """Table of the example with rows of numbers changed."""
    lines = (FOLDER / "surface.csv").read_text(encoding="utf-8").splitlines()
    path = tmp_path / "spoiled.csv"
    path.write_text("\n".join(change(lines)) + "\n", encoding="utf-8")
    return path


def order(*axes):
    """Change that takes the coordinates in another order."""

    def change(lines):
        rows = [line.split(",") for line in lines[1:]]
        return [lines[0], *(",".join([r[0], *(r[1 + k] for k in axes), *r[4:]]) for r in rows)]

    return change


def scaled(factor, header=HEAD):
    """Change that multiplies coordinates, and their header."""

    def change(lines):
        rows = [line.split(",") for line in lines[1:]]
        return [header, *(",".join([r[0], *(f"{float(c) * factor:.7f}" for c in r[1:4]), *r[4:]]) for r in rows)]

    return change


METRES = HEAD.replace("x_mm,y_mm,z_mm", "x_m,y_m,z_m", 1)


@pytest.mark.parametrize(
    ("change", "options", "named"),
    [
        (scaled(1.0, METRES), DISH, "a coordinate looks like mm"),
        (scaled(1e-3), DISH, "are the coordinates in another unit than their columns say, such as mm in x_m?"),
        (order(2, 1, 0), DISH, "x and z exchanged they do"),
        (order(0, 2, 1), DISH, "with y and z exchanged"),
        (lambda lines: [*lines, lines[3]], DISH, "point = 'T003' is also in line 4"),
        (lambda lines: [*lines[:7], lines[7].replace("T007", "T001"), *lines[8:]], DISH, "'T001' is also in line 2"),
        (lambda lines: [line.rpartition(",")[0] for line in lines], DISH, "'u_x_mm' without u_z (expected all three)"),
        (lambda lines: [",".join(line.split(",")[:4]) for line in lines], DISH, "has no uncertainty"),
        (lambda lines: lines[:6], DISH, "needs 6 points, 5 given"),
        (lambda lines: lines, (), "give focal_length_m and a size for another dish"),
    ],
)
def test_a_spoiled_table_is_refused_in_one_line_that_names_the_mistake(catseye, tmp_path, change, options, named):
    status, said, complaint = catseye(spoiled(tmp_path, change), *options, "--json")
    assert (status, said) == (1, "")
    assert named in complaint
    assert complaint.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (("--focal-length-m", 9, "--radius-m", 25), "is radius_m = 25 the diameter?"),
        (("--focal-length-m", 9, "--diameter-m", 12.5), "is diameter_m = 12.5 the radius?"),
        (("--focal-length-m", 10, "--diameter-m", 25), "focal length 9.002 m, the design's is 10.000 m"),
        (("--focal-length-m", 8, "--diameter-m", 25), "focal length 9.002 m, the design's is 8.000 m"),
    ],
)
def test_a_wrong_size_is_a_doubt_that_names_it(catseye, options, named):
    status, said, _ = catseye("dishes/surface.csv", *options, "--json")
    verdict = json.loads(said)["verdict"]
    assert (status, verdict["word"]) == (0, "doubtful")
    assert named in verdict["why"]


def test_u_may_be_said_for_a_table_without(catseye, tmp_path):
    path = spoiled(tmp_path, lambda lines: [",".join(line.split(",")[:4]) for line in lines])
    status, said, _ = catseye(path, *DISH, "--u-mm", 0.05, "--json")
    assert (status, json.loads(said)["verdict"]["word"]) == (0, "good")


def test_options_that_do_not_fit_together_are_named_as_typed(catseye):
    status, _, complaint = catseye("dishes/surface.csv", "--diameter-m", 25)
    assert (status, "--diameter-m needs --focal-length-m, too" in complaint) == (2, True)
