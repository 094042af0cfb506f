"""`catseye safety`: what it says, what programs get, what it refuses."""

import json
import math

import pytest

RANGER = (
    "safety", "--power-mw", 10, "--wavelength-um", 0.78, "--diameter-mm", 20, "--divergence-mrad", 0.05,
)  # fmt: skip


def asked(catseye, *arguments):
    status, out, err = catseye(*RANGER, *arguments, "--json")
    assert (status, err, out.count("\n")) == (0, "", 1)
    return json.loads(out)


def test_the_ranger_for_programs(catseye):
    told = asked(catseye)
    assert told["class"] == "3B"
    assert told["edition"] == "iec2014"
    assert told["duration"] == 100.0
    assert told["mpe_eye"] == pytest.approx(14.454, abs=1e-3)
    assert told["mpe_skin"] == pytest.approx(2890.9, abs=0.1)
    assert told["class_limits"]["1"] == pytest.approx(0.5637e-3, abs=1e-7)
    # by hand: 10 mW and 0.5563 mW through 7 mm: d = 7 mm sqrt(2 / 0.05723) = 41.38 mm = (20^2 + (0.05 z)^2)^0.5
    assert told["nohd"] == pytest.approx(724.5, abs=0.1)
    assert told["nohd_aided"] > 5 * told["nohd"]
    assert told["skin_hazard_distance"] == 0.0
    assert told["scan"] is None
    assert told["returned"] is None
    assert [row["duration"] for row in told["what_if"]] == [0.25, 10.0, 100.0, 3e4]
    assert "not a certificate" in told["notice"]


def test_visible_light_is_looked_at_for_a_quarter_second_unless_told(catseye):
    status, out, _ = catseye(*RANGER[:4], 0.65, *RANGER[5:], "--json")
    assert status == 0
    assert json.loads(out)["duration"] == 0.25
    assert asked(catseye, "--duration-s", 10)["duration"] == 10.0


def test_sweep_and_return(catseye):
    told = asked(catseye, "--scan-rad-per-s", 0.5, "--scan-period-s", 1, "--reflector-distance", 120)
    assert 0.0 < told["scan"]["hazard_distance"] < told["nohd"]
    assert told["returned"]["power_into_eye"] == pytest.approx(1.65e-3, abs=0.02e-3)
    assert told["returned"]["times_limit"] == pytest.approx(2.97, abs=0.03)
    aided = asked(catseye, "--scan-rad-per-s", 0.5, "--scan-period-s", 1, "--reflector-distance", 120, "--aided")
    assert aided["scan"]["hazard_distance"] > told["scan"]["hazard_distance"]
    assert aided["returned"]["power_into_eye"] > told["returned"]["power_into_eye"]
    assert aided["viewer"] == "7x50 binoculars"


def test_what_comes_back_counts_for_the_front_of_the_eye_too(catseye):
    # at 1390 nm the retina may have 766 W, the front of the eye 10 kW/m2 over 3.5 mm: 96.2 mW
    infrared = ("safety", "--power-mw", 2000, "--wavelength-um", 1.39, "--diameter-mm", 20, "--divergence-mrad", 0.1)
    back = json.loads(catseye(*infrared, "--reflector-distance", 20, "--json")[1])["returned"]
    assert back["limit"] == pytest.approx(1e4 * math.pi / 4 * 3.5e-3**2)
    assert back["limit_aperture"] == 3.5e-3
    # 3.5 mm in the middle of a beam 20.2 mm wide 40 m away gets 1 - exp(-2 (3.5/20.2)^2) = 5.9 % of 2 W
    assert back["times_limit"] == pytest.approx(0.118 / 0.0962, rel=0.03)


def test_a_source_that_is_no_point_warns_of_farther_hazard(catseye):
    assert "farther than that" in " ".join(catseye(*RANGER, "--subtense-mrad", 5)[1].split())
    assert "farther than that" not in " ".join(catseye(*RANGER)[1].split())


def test_the_text_says_class_reasons_distances_and_the_warning(catseye):
    status, out, err = catseye(*RANGER, "--scan-rad-per-s", 0.5, "--reflector-distance", 120)
    assert (status, err) == (0, "")
    for said in (
        "3B by iec2014",
        "class 1M: 2.173 mW through 7 mm at 0.1 m, 10 mW through 50 mm at 2 m does not keep",
        "14.45 W/m² for 100 s",
        "naked eye up to 724.5 m",
        "Sweeping",
        "Sent back",
        "30000 s",
        "not a certificate",
    ):
        assert said in out
    assert max(map(len, out.splitlines())) <= 100


def test_editions_that_disagree_say_so(catseye):
    narrow = ("safety", "--power-mw", 0.56, "--wavelength-um", 0.78, "--diameter-mm", 1, "--divergence-mrad", 1.2)
    _, out, _ = catseye(*narrow)
    assert "1 by iec2014 (ansi2014: 3R)" in out
    _, out, _ = catseye(*narrow, "--edition", "ansi2014")
    assert "3R by ansi2014 (iec2014: 1)" in out


def test_a_low_class_does_not_hide_an_exposure_above_its_limit(catseye):
    # 0.389 mW: class 1 is 0.39 mW, the limit of exposure over a pupil 0.385 mW
    pointer = ("safety", "--power-mw", 0.389, "--wavelength-um", 0.65, "--diameter-mm", 1, "--divergence-mrad", 1)
    _, out, _ = catseye(*pointer, "--duration-s", 100)
    assert "1 by iec2014 (ansi2014: 2)" in out
    assert "class 1, but the limit" in out


def test_a_focused_beam_says_where_the_hazard_begins(catseye):
    focused = ("safety", "--power-mw", 5, "--wavelength-um", 0.78, "--diameter-mm", 40, "--divergence-mrad", 0.99)
    _, out, _ = catseye(*focused, "--waist-distance", 40)
    assert "m, around the waist" in out


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (("--wavelength-um", 1.55), "wavelength 1.55 um is outside 0.4-1.4 um"),
        (("--wavelength-um", "nan"), "wavelength nan um"),
        (("--power-mw", 0), "power = 0 W is not above 0"),
        (("--divergence-mrad", 0.01), "away is impossible"),
        (("--duration-s", 1e6), "duration 1e+06 s is outside"),
        (("--scan-rad-per-s", 0), "rate = 0 rad/s is not above 0"),
        (("--power-mw", 1e-4, "--scan-rad-per-s", -3), "rate = -3 rad/s is not above 0"),
        (("--power-mw", 1e-4, "--scan-rad-per-s", 3, "--scan-period-s", -1), "period = -1 s is not above 0"),
        (("--divergence-mrad", 5e4), "divergence = 50 rad is above 1 rad"),
        (("--subtense-mrad", -1), "subtense -0.001 rad is outside"),
        (("--reflector-distance", 0), "distance = 0.0 m is not above 0"),
        (("--reflector-distance", 9, "--waist-distance", 1), "waist 1 m away"),
    ],
)
def test_what_cannot_be_is_one_line_and_status_1(catseye, changed, said):
    status, out, err = catseye(*RANGER, *changed)
    assert (status, out) == (1, "")
    assert err.count("\n") == 1
    assert said in err


@pytest.mark.parametrize(
    "arguments",
    [RANGER[:-2], (*RANGER, "--edition", "iec2007"), (*RANGER, "--scan-period-s", 1), (*RANGER, "--power-mw", "x")],
)
def test_wrong_usage_is_status_2(catseye, arguments):
    assert catseye(*arguments)[0] == 2


def test_help_has_an_example(catseye):
    status, out, _ = catseye("safety", "--help")
    assert status == 0
    assert "Example: catseye safety --power-mw 10" in out
