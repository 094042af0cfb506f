"""`catseye point`: counts for people and programs, files of CAL.EQ, stops, Sun and boxes, refusals."""

import json
import math
import tomllib

import numpy as np
import pytest

from catseye.geometry.antenna import frames
from repository import ROOT

ZY3, ZP3 = ROOT / "examples/monuments/ZY3.toml", ROOT / "examples/mirrors/ZP3.toml"
NOTES = ["--monument", ZY3, "--mirror", ZP3]
NIGHT = [
    "--monument",
    ROOT / "examples/night-01/monuments/ZY103.toml",
    "--mirror",
    ROOT / "examples/night-01/mirrors/ZP103.toml",
]
KEYS = {
    "to",
    "range",
    "theta",
    "phi",
    "azimuth_counts",
    "elevation_counts",
    "autocollimation_counts",
    "back_retro_counts",
    "prime",
    "allowed",
}
SUNNY = ["--at", "2003-09-10T14:00:00Z", "--longitude-deg=-79.84"]


def answer(catseye, *arguments):
    status, said, complaint = catseye("point", *arguments, "--json")
    assert (status, complaint) == (0, "")
    return json.loads(said, parse_constant=pytest.fail)


def test_the_answer_is_a_list_with_the_agreed_keys(catseye):
    found = answer(catseye, *NOTES, "--to=0,100,20", "--to=-30,5,60")
    assert [item["to"] for item in found] == [[0.0, 100.0, 20.0], [-30.0, 5.0, 60.0]]
    for item in found:
        assert set(item) >= KEYS
        assert set(item["prime"]) == {"azimuth_counts", "elevation_counts", "allowed"}
    first = found[0]  # by the program of the notes' figure 2.5, run by hand
    assert first["range"] == pytest.approx(81.76955970426295, abs=1e-9)
    assert first["azimuth_counts"] == pytest.approx(576.8106307472071, abs=1e-6)
    assert first["elevation_counts"] == pytest.approx(12423.739743706377, abs=1e-6)
    assert first["autocollimation_counts"] == pytest.approx(29782.479487412755, abs=1e-6)
    assert first["back_retro_counts"] == pytest.approx(79782.479487412755, abs=1e-6)
    assert first["prime"]["elevation_counts"] == pytest.approx(2 * -4935 - 12423.739743706377, abs=1e-6)


def test_prime_goes_half_a_turn_up_or_down_whichever_is_allowed(catseye):
    for item in answer(catseye, *NIGHT, "--to=0,0,50", "--to=-20,30,40", "--to=90,90,1", "--to=-90,90,80"):
        up = item["azimuth_counts"] + 50_000
        allowed = [v for v in (up, up - 100_000) if -21_309 <= v <= 75_691]
        assert item["prime"]["allowed"] == bool(allowed)
        assert item["prime"]["azimuth_counts"] == pytest.approx(allowed[0] if allowed else up, abs=1e-6)
        assert item["allowed"] == (-21_309 <= item["azimuth_counts"] <= 75_691)


def test_a_coord_dat_gives_what_the_same_points_give(catseye, tmp_path):
    (tmp_path / "coord.dat").write_text("# test range\n0 100000 20000  # first\n\n-30000.0 5e3 60000\n")
    from_file = answer(catseye, *NOTES, "--file", tmp_path / "coord.dat", "--write", tmp_path / "output.dat")
    assert from_file == answer(catseye, *NOTES, "--to=0,100,20", "--to=-30,5,60")
    rows = [line.split() for line in (tmp_path / "output.dat").read_text().splitlines() if not line.startswith("#")]
    assert rows[0] == ["0.0", "100000.0", "20000.0", "576.8", "12423.7", "29782.5"]
    assert len(rows) == 2


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("1 2\n", "coord.dat: line 1, '1 2' has 2 numbers (expected x y z in mm)"),
        ("# a\n1 2 three\n", "coord.dat: line 2, '1 2 three': 'three' is not a number (expected x y z in mm)"),
        ("1 2 nan\n", "'nan' is not a number"),
        ("1 2 3e9\n", "3e9 mm (expected -1e7 to 1e7)"),
        ("# only\n", "coord.dat: has no points"),
        ("", "coord.dat: holds 0 bytes and no text: empty"),
    ],
)
def test_a_bad_coord_dat_is_refused_with_line_and_value(catseye, tmp_path, text, complaint):
    (tmp_path / "coord.dat").write_text(text)
    status, said, problem = catseye("point", *NOTES, "--file", tmp_path / "coord.dat", "--write", tmp_path / "o.dat")
    assert (status, said) == (1, "")
    assert complaint in problem
    assert len(problem.strip().splitlines()) == 1
    assert not (tmp_path / "o.dat").exists()


def test_the_sun_answers_under_its_own_key(catseye):
    sun = answer(catseye, *NIGHT, "--to=0,0,50", *SUNNY)[0]["sun"]
    assert sun["allowed"]
    # 2003-09-10 14:00 UT at 79.84 W: nearly two and a half hours before noon
    assert math.degrees(sun["altitude"]) == pytest.approx(34.4, abs=0.3)
    assert math.degrees(sun["azimuth"]) == pytest.approx(114.2, abs=0.3)
    assert sun["earth_rotation"] == "measured"
    assert sun["free_at_mjd"] is None


def test_the_beam_of_a_leaning_face_is_as_far_from_the_sun_as_its_target(catseye, tmp_path):
    """Its counts are others, its beam is not."""
    place = ["--at", "2003-09-10T17:00:00Z", "--longitude-deg=-79.84", "--latitude-deg", "38.4"]
    (tmp_path / "ZP3.toml").write_text(ZP3.read_text() + "\nface_tilt_rad = 0.02\nu_tilt_rad = 1e-4\n")
    leaning = ["--monument", ZY3, "--mirror", tmp_path / "ZP3.toml"]
    plain, other = (answer(catseye, *at, "--to=5,30,30", *place)[0] for at in (NOTES, leaning))
    assert abs(plain["azimuth_counts"] - other["azimuth_counts"]) > 100
    assert other["sun"]["separation"] == pytest.approx(plain["sun"]["separation"], abs=1e-9)


def test_a_beam_into_the_sun_is_refused_with_the_time_when_it_is_free(catseye):
    sun = answer(catseye, *NIGHT, "--to=0,0,50", *SUNNY)[0]["sun"]
    e, a = sun["altitude"], sun["azimuth"]
    scan_point = (113.0, 44.3, 0.25)  # of ZY103, to decimetres: the target is ten kilometres away
    towards = (math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e))
    to = ",".join(f"{s + 1e4 * d:.3f}" for s, d in zip(scan_point, towards, strict=True))
    refused = answer(catseye, *NIGHT, f"--to={to}", *SUNNY)[0]["sun"]
    assert not refused["allowed"]
    assert math.degrees(refused["separation"]) < 0.1
    assert refused["free_at_mjd"] > sun["mjd"]
    assert (refused["free_at_mjd"] - sun["mjd"]) * 1440 == pytest.approx(20, abs=12)  # 5 deg at 15 deg an hour
    assert "from the Sun" in refused["reason"]
    status, said, _ = catseye("point", *NIGHT, f"--to={to}", *SUNNY)
    assert status == 0
    assert "free at 2003-09-10T14:" in said


def test_a_box_in_the_way_is_named(catseye, tmp_path):
    (tmp_path / "boxes.toml").write_text(
        'format = 1\n[[box]]\nname = "tower"\nwhy = "people"\ncentre_mm = [0.0, 0.0, 25000.0]\n'
        "size_mm = [4000.0, 4000.0, 50000.0]\n"
    )
    found = answer(catseye, *NIGHT, "--to=0,0,30", "--to=60,-60,2", "--keep-out", tmp_path / "boxes.toml")
    assert [item["keep_out"]["allowed"] for item in found] == [False, True]
    assert "tower" in found[0]["keep_out"]["reason"]


def test_without_uncertainties_u_is_unknown_and_with_them_it_is_given(catseye, tmp_path):
    found = answer(catseye, *NOTES, "--to=0,100,20")[0]
    assert found["u_azimuth_counts"] is None
    assert "u_beta_rad" in found["uncertainties_lacking"]
    monument, mirror = tmp_path / "m.toml", tmp_path / "z.toml"
    monument.write_text(
        ZY3.read_text()
        + "\nu_x_mm = 1.0\nu_y_mm = 1.0\nu_z_mm = 1.0\nu_alpha1_rad = 2e-5\nu_alpha2_rad = 1e-5\nu_alpha3_rad = 1e-5\n"
    )
    mirror.write_text(ZP3.read_text() + "\nu_offset_mm = 0.01\nu_beta_rad = 1e-5\nu_zero_counts = 0.5\n")
    known = answer(catseye, "--monument", monument, "--mirror", mirror, "--to=0,100,20")[0]
    assert known["uncertainties_lacking"] == []
    assert known["u_azimuth_counts"] == pytest.approx(0.6, abs=0.15)  # 0.5 of the zero, 0.3 of 2e-5 rad


@pytest.mark.parametrize(
    ("change", "status", "complaint"),
    [
        (["--to=1,2"], 2, "'1,2' is not x,y,z in metres"),
        (["--to=1,2,inf"], 2, "is not x,y,z in metres"),
        ([], 2, "give points by --to or by --file"),
        (["--to=1,2,3", "--file", "x.dat"], 2, "give points by --to or by --file"),
        (["--file", "nowhere.dat"], 1, "nowhere.dat: missing"),
        (["--to=1,2,3", "--at", "yesterday"], 2, "is neither an MJD nor a time"),
        (["--to=1,2,3", "--sun-cone-deg", "0"], 2, "is not 0.5 to 60 degrees"),
        (["--to=1,2,3", "--at", "52892.5"], 1, "needs latitude_deg, which the record of ZY3 lacks"),
        (["--to=1,2,3", "--keep-out", "none.toml"], 1, "none.toml: missing"),
        (["--to=1,2,3", "--keep-out", "."], 1, "catseye: .: is not a file (expected one)"),
        (["--to=1e200,2,3"], 1, "m is too far (expected within 20000 m)"),
        (["--to=1,2,3", "--sun-cone-deg", "7"], 2, "says nothing without --at"),
        (["--to=1,2,3", "--longitude-deg", "7"], 2, "says nothing without --at"),
        (["--to=1,2,3", "--posture", "0,45"], 2, "says nothing without --solids"),
        (
            ["--to=1,2,3", "--at", "52892.5", "--latitude-deg", "138", "--longitude-deg", "0"],
            1,
            "latitude_deg = 138 is outside -90 to 90 (degrees)",
        ),
    ],
)
def test_what_cannot_be_done_says_so_in_one_line(catseye, change, status, complaint):
    done, said, problem = catseye("point", *NOTES, *change)
    assert (done, said) == (status, "")
    assert complaint in " ".join(problem.split())


def test_a_point_in_the_mirror_itself_has_no_counts(catseye, tmp_path):
    (tmp_path / "m.toml").write_text(
        'monument = "ZY1"\nx_mm = 5000.0\ny_mm = 0.0\nz_mm = 0.0\n'
        "alpha1_rad = 0.0\nalpha2_rad = 0.0\nalpha3_rad = 0.0\n"
    )
    (tmp_path / "z.toml").write_text(
        'zp = "ZP1"\ndx_mm = 0.0\ndy_mm = 250.0\ndz_mm = 0.0\nbeta1_rad = 0.0\nbeta2_rad = 0.0\nna0 = 0\nne0 = 0\n'
        "az_low_limit = -20000\naz_high_limit = 70000\n"
    )
    at = ["--monument", tmp_path / "m.toml", "--mirror", tmp_path / "z.toml", "--to=5,0,0.25"]
    status, _, problem = catseye("point", *at)
    assert status == 1
    assert "no setting of the mirror looks there" in problem


@pytest.mark.parametrize(
    ("file", "line", "complaint"),
    [
        ("ZY3", "alpha1_rad = 57.8", "alpha1_rad = 57.8 looks like degrees (expected"),
        ("ZY3", "alpha3_rad = 1.2", "alpha3_rad = 1.2 looks like degrees (expected -0.1 to 0.1)"),
        ("ZY3", "x_mm = 5.5862\ny_mm = 20.85", "x_mm, y_mm = 5.5862, 20.85 looks like metres (expected"),
        ("ZP3", "dy_mm = 0.247459", "dy_mm = 0.247459 looks like metres (expected 50 to 1000)"),
        ("ZP3", "beta1_rad = -2.5", "beta1_rad = -2.5 looks like degrees (expected -0.1 to 0.1)"),
        ("ZP3", "az_low_limit = 70000\naz_high_limit = -20000", "az_low_limit = 70000 is not below az_high_limit"),
        ("ZP3", "beam_tilt_x_rad = 0.001", "beam_tilt_x_rad = 0.001 has no u_tilt_rad"),
        ("ZP3", "fkp_0 = 40000", "fkp_0 = 40000 (expected 0 to 32767)"),
        ("ZP3", "abv_1 = 10\naba_1 = 20", "abv_1 = 10 is below aba_1 = 20 (expected no less"),
    ],
)
def test_bad_records_are_refused_with_file_key_value_and_range(catseye, tmp_path, file, line, complaint):
    keys = [part.split(" = ")[0] for part in line.splitlines()]
    records = {"ZY3": ZY3, "ZP3": ZP3}
    kept = [row for row in records[file].read_text().splitlines() if row.split(" = ")[0].strip() not in keys]
    path = tmp_path / f"{file}.toml"
    path.write_text("\n".join([line, *kept]))
    records[file] = path
    at = ["--monument", records["ZY3"], "--mirror", records["ZP3"], "--to=0,100,20"]
    status, said, problem = catseye("point", *at)
    assert (status, said) == (1, "")
    assert problem.startswith(f"catseye: {file}.toml: ")
    assert complaint in problem


def test_visibility_answers_under_its_own_key(catseye):
    scene = ["--reflector", "prism", "--facing=1,0.5,0", "--solids", ROOT / "examples/solids.toml"]
    found = answer(catseye, *NIGHT, "--to=60,40,20", "--to=-100,-40,20", *scene, "--posture", "145.3,30")
    first, second = (item["visibility"] for item in found)
    assert first == {"visible": True, "reason": "seen", "incidence": first["incidence"]}
    assert math.degrees(first["incidence"]) < 45.0
    assert not second["visible"]
    assert "obstructed by" in second["reason"]
    turned = answer(catseye, *NIGHT, "--to=60,40,20", "--reflector", "hollow", "--facing=-1,0,0")[0]["visibility"]
    assert (turned["visible"], "above 30" in turned["reason"]) == (False, True)
    unknown = answer(catseye, *NIGHT, "--to=60,40,20", "--reflector", "ball")[0]["visibility"]
    assert (unknown["visible"], unknown["incidence"]) == (True, None)


def test_a_posture_is_degrees_of_azimuth_and_elevation(catseye, tmp_path):
    """A ball carried by the dish that stands in the way at 145.3, 30 deg, and at no other of these postures."""
    monument = tomllib.loads(NIGHT[1].read_text("utf-8"))  # whose scan point is some 0.1 m off
    middle = 0.5 * (np.array([60.0, 40.0, 20.0]) + [1e-3 * monument[f"{axis}_mm"] for axis in "xyz"])
    ground_from_reflector = frames.ground_from_reflector(145.3 * math.pi / 180.0, 30.0 * math.pi / 180.0)
    ball = tmp_path / "ball.toml"
    ball.write_text(
        'format = "catseye-solids-1"\n[[sphere]]\nname = "ball"\nframe = "reflector"\nradius_mm = 500.0\n'
        f"centre_mm = {(1e3 * ground_from_reflector.inverse().points(middle)).tolist()}\n"
    )
    scene = ["--to=60,40,20", "--reflector", "prism", "--solids", ball, "--posture"]
    seen = {
        posture: answer(catseye, *NIGHT, *scene, posture)[0]["visibility"]["visible"]
        for posture in ("145.3,30", "145.3,33", "149,30", "30,30")
    }
    assert seen == {"145.3,30": False, "145.3,33": True, "149,30": True, "30,30": True}


def test_what_no_pointing_reaches_is_not_visible_and_the_records_are_named(catseye, tmp_path):
    mirror = tmp_path / "z.toml"
    kept = [row for row in ZP3.read_text(encoding="utf-8").splitlines() if not row.startswith("az_")]
    mirror.write_text("\n".join(["az_low_limit = 20000", "az_high_limit = 30000", *kept]), encoding="utf-8")
    found = answer(catseye, "--monument", ZY3, "--mirror", mirror, "--to=0,100,20", "--reflector", "prism")[0]
    assert found["visibility"]["reason"] == "beyond the azimuth stops"
    assert (found["monument"], found["mirror"], found["mirror_of_monument"]) == ("ZY3", "ZP3", "ZP3")


def test_a_solid_on_the_telescope_needs_a_posture(catseye):
    status, said, problem = catseye("point", *NIGHT, "--to=0,0,50", "--solids", ROOT / "examples/solids.toml")
    assert (status, said) == (1, "")
    assert "'alidade tower' stands in the frame alidade" in problem
    for option, value in (("--posture", "10"), ("--facing", "0,0,0"), ("--reflector", "mirror")):
        assert catseye("point", *NIGHT, "--to=0,0,50", option, value)[0] == 2


def test_millimetres_typed_as_metres_are_refused_or_doubtful_with_both_readings(catseye):
    status, _, error = catseye("point", *NOTES, "--to=0,0,50000")
    assert status == 1
    assert "50000 m is too far (expected within 20000 m): read as millimetres it is 0, 0, 50 m" in error
    verdict = answer(catseye, *NOTES, "--to=0,0,5000")[0]["verdict"]
    assert verdict["word"] == "doubtful"
    assert "in millimetres it would be 0, 0, 5 m" in verdict["why"]
    assert answer(catseye, *NOTES, "--to=0,0,50")[0]["verdict"]["word"] == "good"


def test_a_ranger_of_a_site_points_at_a_point_of_the_reflector(catseye):
    found = answer(catseye, "--site", "gbt", "--ranger", "ZY115", "--frame", "reflector", "--posture", "145.3,30",
                   "--to=0,54,12.2")  # fmt: skip
    [item] = found
    assert set(item) >= KEYS | {"ranger", "frame", "posture", "in_frame"}
    scan_point = np.array([-7.5943, -9.0847, 51.8391])  # m, reflector, as its record has it
    assert item["range"] == pytest.approx(np.linalg.norm(scan_point - [0.0, 54.0, 12.2]), abs=1e-9)
    np.testing.assert_allclose(item["to"], frames.ground_from_reflector(*np.radians([145.3, 30.0])).points(
        [0.0, 54.0, 12.2]), atol=1e-9)  # fmt: skip
    _, said, _ = catseye("point", "--site", "gbt", "--ranger", "ZY115", "--frame", "reflector", "--to=0,54,12.2")
    assert "azimuth 145.3, elevation 30 deg" in said.replace("\n              ", " ")


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--site", "gbt"], "--site says nothing without --ranger"),
        (["--site", "gbt", "--ranger", "ZY103", *NOTES[2:]], "--mirror does not go with --site and --ranger"),
        (NOTES[:2], "--mirror is missing"),
        ([*NOTES, "--frame", "reflector"], "--posture is missing"),
        ([*NOTES, "--frame", "dish"], "not one of ground"),
    ],
)
def test_a_ranger_that_is_not_one_is_wrong_usage(catseye, arguments, complaint):
    status, _, said = catseye("point", *arguments, "--to=0,0,50")
    assert status == 2
    assert complaint in said.replace("\n", " ")
