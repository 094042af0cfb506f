"""`catseye plot`: figures whole or not at all, what they say as JSON, refusals."""

import json
import xml.etree.ElementTree as ET

import pytest

from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"
SKY = [
    "sky", "--monument", NIGHT / "monuments/ZY103.toml", "--mirror", NIGHT / "mirrors/ZP103.toml",
    "--at", "2003-09-10T18:00:00Z", "--longitude-deg=-79.84", "--keep-out", ROOT / "examples/keep-out.toml",
]  # fmt: skip
ZP3 = ROOT / "examples/mirrors/ZP3.toml"
SETTINGS = "fkp_0 = 356\nfki_0 = 465\nfkd_0 = 4355\nfil_0 = 4096\nfsi_0 = 3\n"


def test_a_slew_through_the_sun_is_refused_and_led_round(catseye, tmp_path):
    out = tmp_path / "sky.svg"
    slew = ["--from=18500,10000", "--to=21500,12000"]  # the Sun stands at 19919, 10888
    status, said, complaint = catseye("plot", *SKY, *slew, "--out", out, "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert not found["slew_allowed"]
    assert "from the Sun" in found["slew_refused"]
    assert found["free_at_mjd"] > 52_892.75
    assert found["route"] == "a way round the zones"
    assert len(found["waypoints"]) >= 3
    assert ET.fromstring(out.read_text(encoding="utf-8")).tag.endswith("svg")
    status, said, _ = catseye("plot", *SKY, "--out", out)  # its own file may be written again
    assert (status, "Written to" in said) == (0, True)


def test_a_servo_move_takes_a_mirrors_settings(catseye, tmp_path):
    mirror, out = tmp_path / "z.toml", tmp_path / "servo.svg"
    mirror.write_text(f"abv_0 = 268435\naba_0 = 305\n{SETTINGS}" + ZP3.read_text(encoding="utf-8"), encoding="utf-8")
    ours = json.loads(catseye("plot", "servo", "--out", out, "--json")[1])
    its = json.loads(catseye("plot", "servo", "--mirror", mirror, "--out", out, "--json")[1])
    same = ("kp", "ki", "kd", "il", "interval", "phase_margin_deg")
    assert [its[key] for key in same] == [ours[key] for key in same]
    assert its["following_error_counts"] == pytest.approx(ours["following_error_counts"], abs=2.0)
    assert its["settled_after_s"] < 1.3
    assert not its["motor_off"]


def test_a_move_that_takes_for_ever_is_refused(catseye, tmp_path):
    mirror, out = tmp_path / "z.toml", tmp_path / "servo.svg"
    mirror.write_text(f"abv_0 = 1\naba_0 = 1\n{SETTINGS}" + ZP3.read_text(encoding="utf-8"), encoding="utf-8")
    status, said, problem = catseye("plot", "servo", "--mirror", mirror, "--counts", "1000000", "--out", out)
    assert (status, said) == (1, "")
    assert "abv 1, aba 1 takes up to 22369622 s" in problem
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [
        (["clouds", "--out", "a.svg"], 2, "No such command 'clouds'"),
        (["air", "--counts", "5", "--out", "a.svg"], 2, "No such option"),
        (["servo"], 2, "Missing option '--out'"),
        (["sky", "--out", "a.svg"], 2, "Missing option '--monument'"),
        (["coating", "--name", "butter", "--out", "a.svg"], 1, "butter"),
        (["coating", "--incidence-deg", "95", "--out", "a.svg"], 2, "is not within 0 to 90 degrees"),
        (["aberration", "--beam-radius-mm", "0", "--out", "a.svg"], 1, "beam_radius"),
        (["polarization", "--glass", "butter", "--out", "a.svg"], 1, "butter"),
        (["beam", "nothing.toml", "--out", "a.svg"], 1, "nothing.toml"),
        (
            ["beam", ROOT / "examples/beams/head.toml", "--out", ROOT / "examples/beams/head.toml"],
            1,
            "unknown figure format",
        ),
        ([*SKY, "--from=1,2", "--out", "a.svg"], 2, "go together"),
        ([*SKY, "--from=1", "--to=2,3", "--out", "a.svg"], 2, "is not AZIMUTH,ELEVATION in counts"),
        (["servo", "--counts", "0", "--out", "a.svg"], 2, "greater than or equal to 1"),
        (["servo", "--mirror", ZP3, "--out", "a.svg"], 1, "fkp_0 is missing"),
        (["servo", "--out", ROOT / "docs" / "night-01.svg"], 1, "exists and is not a catseye file"),
        (["servo", "--out", ROOT], 1, "is a directory"),
    ],
)
def test_what_cannot_be_drawn_says_so(catseye, tmp_path, monkeypatch, arguments, status, complaint):
    monkeypatch.chdir(tmp_path)
    done, said, problem = catseye("plot", *arguments)
    assert (done, said) == (status, "")
    assert complaint in " ".join(problem.replace("│", " ").split())
    assert not list(tmp_path.iterdir())


def test_an_input_with_a_figures_name_is_not_overwritten(catseye, tmp_path):
    train = tmp_path / "head.svg"
    train.write_bytes(content := (ROOT / "examples/beams/head.toml").read_bytes())
    status, said, complaint = catseye("plot", "beam", train, "--out", train)
    assert (status, said) == (1, "")
    assert "is an input of this figure" in complaint
    assert train.read_bytes() == content


def test_the_airs_figure_says_its_index_and_what_makes_it_uncertain(catseye, tmp_path):
    out = tmp_path / "air.svg"
    state = ["--temperature-c", 20, "--pressure-hpa", 933, "--humidity-percent", 50, "--model", "rueger1990"]
    status, said, complaint = catseye("plot", "air", *state, "--u-temperature-c", 0.3, "--out", out, "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert found["group_refractivity_ppm"] == pytest.approx(253.246815, abs=1e-6)
    assert found["u_of_temperature_ppm"] == pytest.approx(0.3 * 0.895887, rel=1e-5)
    assert ET.fromstring(out.read_text(encoding="utf-8")).tag.endswith("svg")
    status, said, complaint = catseye("plot", "air", "--temperature-c", 120, "--out", tmp_path / "none.svg")
    assert (status, said) == (1, "")
    assert "temperature 120 C is outside" in complaint
    assert not (tmp_path / "none.svg").exists()


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (["return"], None),
        (["aberration", "--beam-radius-mm", "5"], None),
        (["coating", "--name", "gold"], "wavelength_um"),
        (["polarization"], None),
        (["beam", ROOT / "examples/beams/head.toml"], "power_on_detector"),
    ],
)
def test_figures_of_the_optics_are_drawn_and_told(catseye, tmp_path, arguments, key):
    out = tmp_path / "figure.svg"
    status, said, complaint = catseye("plot", *arguments, "--out", out, "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert found["kind"] == arguments[0]
    assert len(found) > 2
    assert key is None or key in found
    assert ET.fromstring(out.read_text(encoding="utf-8")).tag.endswith("svg")
