"""`catseye plot quadrant` and `catseye plot visibility`: numbers of the figures, and what cannot be."""

import json
from functools import partial

import pytest


@pytest.fixture
def asked(catseye):
    """`catseye plot` run in this process: exit status, what it said, what it complained of."""
    return partial(catseye, "plot")


def test_a_quadrant_saturates_and_its_servo_settles(asked, tmp_path):
    status, out, err = asked("quadrant", "--json", "--out", tmp_path / "q.svg")
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert found["centre_slope"] == pytest.approx(62.666e-6, rel=1e-4)
    assert found["u_settled"] == pytest.approx(found["u_place_centre"] * (0.3 / 1.7) ** 0.5)
    assert 5 <= found["settled_after_steps"] <= 30
    assert found["reads_90_percent_to"] < 0.5 * found["spot"]
    assert (tmp_path / "q.svg").read_text().startswith("<?xml")
    assert asked("quadrant", "--gain", 2.5, "--out", tmp_path / "q.svg")[0] == 1
    assert asked("quadrant", "--noise-percent", 0, "--out", tmp_path / "q.svg")[0] == 2


def test_the_quadrants_text_has_units(asked, tmp_path):
    """Near the centre w sqrt(pi/8) times the ratio: 62.67 µm; u of it times 2 x 0.5 %, in the loop sqrt(0.3/1.7)."""
    status, out, err = asked("quadrant", "--out", tmp_path / "q.svg")
    said = " ".join(out.split())
    assert (status, err) == (0, "")
    assert "100 µm radius at 1/e²; near the centre the place is 62.67 µm times" in said
    assert "u 0.627 µm of one reading at the centre" in said
    assert "it settles after 17 steps; there u 0.263 µm remains" in said
    assert "does not settle within these steps" in asked("quadrant", "--steps", 3, "--out", tmp_path / "q.svg")[1]


def test_a_solid_hides_what_was_seen_and_the_posture_changes_it(asked, tmp_path):
    def seen(*options):
        status, out, err = asked("visibility", *options, "--json", "--out", tmp_path / "v.svg")
        assert (status, err) == (0, "")
        return json.loads(out)

    free, behind, low = seen(), seen("--solids", "solids.toml"), seen("--elevation-deg", 10)
    assert free["obstructed"] == 0
    assert behind["seen"] + behind["obstructed"] + behind["incidence"] == behind["pairs"] == 1800
    assert behind["seen"] + behind["obstructed"] == free["seen"]
    assert (low["elevation_deg"], low["azimuth_deg"]) == (10.0, free["azimuth_deg"])
    assert low["seen"] != free["seen"]
    assert asked("visibility", "--elevation-deg", 120, "--out", tmp_path / "v.svg")[0] == 2
    assert asked("visibility", "calibrations", "--out", tmp_path / "v.svg")[0] == 1
