"""link as programs call it."""

import json

import pytest


def test_a_measured_return_sets_the_gain_and_an_oblique_one_is_weaker(catseye):
    status, out, err = catseye("link", "--distance", "120", "--measured-volt", "4.5", "--json")
    assert (status, err) == (0, "")
    straight = json.loads(out, parse_constant=pytest.fail)
    assert straight["amplitude_volt"] == pytest.approx(4.5)
    _, out, _ = catseye("link", "--distance", "120", "--measured-volt", "4.5", "--incidence-deg", "40", "--json")
    oblique = json.loads(out)
    assert oblique["volts_per_ampere"] == pytest.approx(straight["volts_per_ampere"])
    assert oblique["amplitude_volt"] < straight["amplitude_volt"]
    assert oblique["u_range"] > straight["u_range"] > 0.0


def test_the_text_names_every_factor_and_full_scale(catseye):
    status, out, _ = catseye("link", "--distance", "50", "--measured-volt", "12")
    assert status == 0
    assert "it clips" in out
    for word in ("head's optics", "hits the reflector", "comes into the lens", "noise of the range", "crosstalk"):
        assert word in out


@pytest.mark.parametrize(
    ("option", "value", "line"),
    [
        ("--distance", "-3", "distance = -3.0 m is not above 0"),
        ("--transmission", "2", "transmission 2.0 is not above 0 and up to 1"),
        ("--incidence-deg", "95", "right angle"),
        ("--measured-volt", "0", "measured return 0.0 V is not above 0"),
        ("--distance", "0.05", "Fresnel zones"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(catseye, option, value, line):
    arguments = ["link", "--distance", "50"] if option != "--distance" else ["link"]
    status, out, err = catseye(*arguments, option, value)
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert line in err
