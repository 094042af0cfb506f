"""`catseye path`: stations or a campaign to the air between two points."""

import json

import pytest

from repository import ROOT

STATIONS = ROOT / "examples" / "weather" / "stations.csv"
ENDS = ("--start=0,0,3", "--end=100,0,40")


def test_json_and_text_say_the_same(catseye):
    status, out, err = catseye("path", STATIONS, *ENDS, "--json")
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["length"] == pytest.approx(11369**0.5)
    assert found["mjd_utc"] is None  # the table has no times
    assert found["ray"]["leaving"] > 0.0 > found["ray"]["arriving"]  # thinner air above: concave to the ground
    assert found["arc"]["index_gradient"] < 0.0
    assert len(found["profile"]["z"]) == len(found["profile"]["u_temperature_c"])
    _, text, _ = catseye("path", STATIONS, *ENDS)
    assert f"n_g - 1 = {found['group_refractivity'] * 1e6:.3f}" in text
    assert f"leaves {found['ray']['leaving'] * 206264.806:.2f} arcsec above" in " ".join(text.split())


def test_files_of_a_campaigns_path(catseye, tmp_path):
    status, _, err = catseye("path", "night-01", "--start=0,-39,1.5", "--end=10,60,40", "--out", tmp_path / "out")
    assert (status, err) == (0, "")
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"air_profile.csv", "path.svg", "path.json", "provenance.json"}
    made = json.loads((tmp_path / "out" / "provenance.json").read_text(encoding="utf-8"))
    assert set(made["inputs_sha256"]) == {"site.toml", "weather.csv"}


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (("no.csv", *ENDS), 1, "no.csv"),
        ((STATIONS, "--start=0,0,3", "--end=0,0,3"), 2, "--start and --end are one point"),
        ((STATIONS, "--start=0,0,3", "--end=0,0"), 2, "x,y,z in metres"),
        ((STATIONS, "--start=0,0,-9", "--end=9,0,5"), 1, "height above the ground"),
        (("night-01", *ENDS, "--mjd-utc", 60000), 2, "more than an hour outside"),
        (("night-01", *ENDS, "--wavelength-um", 0.6), 2, "of a campaign is its site's"),
    ],
)
def test_refusals_are_one_line(catseye, arguments, status, words):
    got, out, err = catseye("path", *arguments)
    assert (got, out) == (status, "")
    assert words in " ".join(err.split())
    assert status == 2 or err.count("\n") == 1


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("mast,10,8,93000,80", "line 6, pressure_hpa = '93000' (expected 500 to 1100)"),
        ("mast,x,8,930,80", "line 6, z_m = 'x' (expected a finite number)"),
        ("field,5,8,930,80", "line 6, z_m = 5 of 'field', which was at 2"),
    ],
)
def test_a_spoilt_table_is_named_by_its_line(catseye, tmp_path, row, words):
    file = tmp_path / "stations.csv"
    file.write_text(STATIONS.read_text(encoding="utf-8") + row + "\n", encoding="utf-8")
    status, _, err = catseye("path", file, *ENDS)
    assert status == 1
    assert words in err
