"""link as programs call it."""

import json
import math

import numpy as np
import pytest

from catseye.optics.gaussian_beam import radius
from catseye.optics.retroreflector.dihedral import deviations
from catseye.reduction.optics.link import Link, LinkReflector
from catseye.reduction.optics.link_budget import link_budget


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


def test_every_option_is_taken_in_the_unit_of_its_name(catseye):
    """All at once, each unlike its default; what it must mean is written out here in SI."""
    options = {
        "--distance": 80, "--incidence-deg": 12, "--offset-mm": 3, "--power-mw": 2.5, "--depth": 0.6, "--waist-mm": 9,
        "--receiver-mm": 30, "--transmission": 0.4, "--aperture-mm": 15, "--height-mm": 28, "--index": 1.6,
        "--duration": 0.3, "--blocked-noise-volt": 0.004, "--background-uw": 7,
    }  # fmt: skip
    status, out, err = catseye("link", "--json", *(f"{name}={value}" for name, value in options.items()))
    assert (status, err) == (0, "")
    head = Link(
        power=2.5e-3, depth=0.6, waist=9e-3, receiver=30e-3, transmission=0.4, duration=0.3, blocked_noise_volt=0.004
    )
    expected = link_budget(
        head,
        LinkReflector(aperture=15e-3, height=28e-3, index=1.6),
        80.0,
        offset=3e-3,
        incidence=math.radians(12.0),
        background=7e-6,
    )
    told = json.loads(out)
    assert told["received_power"] == pytest.approx(expected.received, rel=1e-12)
    assert told["u_range"] == pytest.approx(expected.u_range, rel=1e-12)
    assert told["noise_shares"] == pytest.approx(expected.noise_shares, rel=1e-12)


def test_angles_too_wide_by_a_makers_limit_turn_the_beams_by_three_arc_seconds(catseye):
    """[YODER58]: equal errors e of a glass n turn all six by (4/3) sqrt 6 n e; a lens that is wide loses nothing."""
    words = ["link", "--distance", "120", "--dihedral-arcsec", "0.61"]
    found = json.loads(catseye(*words, "--json")[1], parse_constant=pytest.fail)
    assert found["deviation"] == pytest.approx(math.radians(3.0 / 3600), rel=0.01)
    assert found["factors"]["dihedral errors"] == pytest.approx(1.0, abs=1e-4)
    assert 0.0 < found["pupil_offset"] < 0.1e-6
    assert "deviation by dihedral errors" in catseye(*words)[1]


def test_a_narrow_lens_loses_the_light_of_turned_beams(catseye):
    """Against two million rays of a Gaussian beam, each sector moved aside by distance times its deviation."""
    errors = [12.0, -5.0, 8.0]
    words = ["link", "--distance", "400", "--waist-mm", "15", "--receiver-mm", "15", "--index", "1"]
    text = ",".join(map(str, errors))
    found = json.loads(catseye(*words, f"--dihedral-arcsec={text}", "--json")[1])
    turned = deviations(np.radians(np.array(errors) / 3600.0))
    rng, beam = np.random.default_rng(1), radius(800.0, waist=0.015, wavelength=0.78e-6)
    rays = 0.5 * beam * rng.standard_normal((2_000_000, 2))
    hit = [np.mean(np.hypot(*(rays + 400.0 * one).T) < 0.015) for one in turned]
    share = np.mean(hit) / np.mean(np.hypot(*rays.T) < 0.015)
    assert share < 0.8
    assert found["factors"]["dihedral errors"] == pytest.approx(share, abs=2e-3)


@pytest.mark.parametrize(("text", "status"), [("60,x", 2), ("60,-20", 2), ("9000", 1)])
def test_dihedral_errors_that_are_none_are_refused(catseye, text, status):
    found, out, err = catseye("link", "--distance", "120", f"--dihedral-arcsec={text}")
    assert (found, out) == (status, "")
    assert "dihedral" in err
