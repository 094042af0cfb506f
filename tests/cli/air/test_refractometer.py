"""`catseye refractometer` as programs call it: keys, statuses, streams, files whole or not at all."""

import csv
import json

import numpy as np
import pytest

from gateways.report_scene import column, read, words_of
from repository import ROOT

EXAMPLE = ROOT / "examples" / "refractometer" / "path-a.csv"
KEYS = {
    "path", "path_length", "group_index", "u_group_index", "phase", "mjd_utc", "temperature_c", "pressure_hpa",
    "humidity_percent", "phase_per_index", "budget", "slope", "thermometers", "drift", "noise", "variance_factor",
    "degrees_of_freedom", "absolute", "verdict", "sections", "notes", "series", "readings", "model", "wavelength_um",
    "modulation_hz", "co2_ppm", "length_sensitivity_per_m",
}  # fmt: skip
HEADER = "mjd_utc,phase_rad,temperature_c,pressure_hpa,humidity_percent"


@pytest.fixture
def catseye(catseye):
    """The command `refractometer`."""
    return lambda *arguments: catseye("refractometer", *arguments)


def test_the_example_is_calibrated_and_its_jump_and_gap_are_named(catseye, tmp_path):
    out = tmp_path / "out"
    status, said, complaint = catseye(EXAMPLE, "--json", "--out", out)
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert set(found) == KEYS
    assert [s["begins_with"] for s in found["sections"]] == ["start", "jump"]
    assert any("gap of 0.7" in note for note in found["notes"])
    assert found["slope"]["agrees"] is True
    assert found["phase_per_index"] == pytest.approx(-4 * np.pi * 1.5e9 / 299792458.0 * 97.3, rel=1e-9)
    assert found["readings"]["total"] == len(found["series"]["mjd_utc"]) == 438
    assert sorted(p.name for p in out.iterdir()) == [
        "acquired.svg", "group_index.csv", "night.svg", "provenance.json", "refractometer.json", "report.html",
    ]  # fmt: skip
    assert json.loads((out / "refractometer.json").read_text()) == found
    with (out / "group_index.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 438
    index = [float(r["group_refractivity_ppm"]) for r in rows if r["group_refractivity_ppm"]]
    series = [(v - 1.0) * 1e6 for v in found["series"]["group_index"] if v is not None]
    np.testing.assert_allclose(index, series, atol=1e-4)
    page = (out / "report.html").read_text()
    report = read(page)
    assert report["charts"].keys() == {"index", "residual", "temperature", "slope"}
    assert [v for v in report["charts"]["index"]["y"]["values"][:438] if v is not None] == pytest.approx(
        index, abs=6e-4
    )
    assert "a jump of" in " ".join(words_of(page))
    assert column(report, "budget", "u") == pytest.approx([u * 1e6 for u in found["budget"].values()], rel=6e-4)
    provenance = json.loads((out / "provenance.json").read_text())
    assert set(provenance["inputs_sha256"]) == {"path-a.csv", "path-a.toml"}


def test_the_text_says_what_a_person_should_know(catseye):
    status, said, complaint = catseye(EXAMPLE)
    assert (status, complaint) == (0, "")
    for word in ("Calibration", "The slope", "The length", "mrad per ppm in theory", "a jump of"):
        assert word in said
    assert "nan" not in said
    assert catseye(EXAMPLE, "--quiet") == (0, "", "")


def plain(tmp_path, rows):
    file = tmp_path / "night.csv"
    file.write_text("\n".join([HEADER, *rows]) + "\n")
    return file


ROWS = [f"{52889 + k / 1440:.8f},{1.0 + 0.0001 * k:.5f},{10 + 0.01 * k:.2f},930.00,0" for k in range(40)]


def test_options_serve_without_a_sheet_and_dry_air_at_0_degrees_is_legal(catseye, tmp_path):
    file = plain(tmp_path, [row.replace(",10.", ",0.") for row in ROWS])
    status, said, complaint = catseye(file, "--path-length-m", "100", "--u-temperature-c", "0.5", "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said, parse_constant=pytest.fail)
    assert found["model"] == "ciddor_hill1999"
    assert found["absolute"]["status"] == "thin"  # 25 mm where nothing is said
    assert found["absolute"]["group_index"] is None
    assert found["budget"]["thermometers"] == pytest.approx(0.5 * 271.5e-6 / 273.2, rel=0.01)  # n - 1 goes as 1/T
    again = json.loads(catseye(file, "--path-length-m", "100", "--model", "rueger1990", "--json")[1])
    assert again["model"] == "rueger1990"
    assert 0.0 < abs(again["group_index"] - found["group_index"]) < 0.2e-6


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda r: [r[0], r[1].replace("930.00", "101325"), *r[2:]], "line 3, pressure_hpa = '101325' (expected"),
        (lambda r: [*r[:4], r[4].replace(",10.", ",-310."), *r[5:]], "line 6, temperature_c = '-310.04' (expected"),
        (lambda r: [r[0].removesuffix("0") + "120", *r[1:]], "line 2, humidity_percent = '120' (expected 0 to 100"),
        (lambda r: [r[1], r[0], *r[2:]], "line 3, mjd_utc = '52889.00000000' (expected later than the line before"),
        (lambda r: [r[0].replace("1.00000", "nan"), *r[1:]], "line 2, phase_rad = 'nan' (expected a finite number"),
        (lambda r: r[:3], "holds 3 readings with weather (expected at least 5)"),
        (lambda r: [], "holds a header and no rows"),
    ],
)
def test_bad_readings_are_refused_in_one_line_and_nothing_is_left(catseye, tmp_path, change, says):
    status, said, complaint = catseye(
        plain(tmp_path, change(ROWS)), "--path-length-m", "100", "--out", tmp_path / "out", "--json"
    )
    assert (status, said) == (1, "")
    assert says in complaint
    assert complaint.count("\n") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["night.csv"]


def test_what_is_missing_is_named(catseye, tmp_path):
    status, _, complaint = catseye(tmp_path / "no.csv", "--path-length-m", "100")
    assert status == 1
    assert "no.csv: missing" in complaint
    status, _, complaint = catseye(plain(tmp_path, ROWS))
    assert status == 1
    assert "has no sheet night.toml beside it and there is no path length" in complaint
    assert "--path-length-m" in complaint
    status, _, complaint = catseye(tmp_path / "night.csv", "--sheet", tmp_path / "other.toml")
    assert status == 1
    assert "other.toml: missing" in complaint
    (tmp_path / "night.toml").write_text("path_length_m = 100.0\nu_path_length = 3.0\n")
    status, _, complaint = catseye(tmp_path / "night.csv")
    assert status == 1
    assert "u_path_length = 3.0 is not a known key (expected perhaps u_path_length_mm)" in complaint
    (tmp_path / "night.toml").write_text('path_length_m = 100.0\nair_model = "edlen"\n')
    status, _, complaint = catseye(tmp_path / "night.csv")
    assert status == 1
    assert "air_model = 'edlen' is unknown" in complaint


@pytest.mark.parametrize("option", [("--path-length-m", "-3"), ("--model", "edlen"), ("--u-temperature-c", "nan")])
def test_values_that_cannot_be_meant_are_wrong_usage(catseye, option):
    status, said, complaint = catseye(EXAMPLE, *option)
    assert status == 2
    assert said == ""
    assert option[0] in complaint


def test_help_has_an_example(catseye):
    status, said, _ = catseye("--help")
    assert status == 0
    assert "examples/refractometer/path-a.csv" in said


@pytest.mark.parametrize(("until", "word"), [("2003-09-06", "doubtful"), ("2003-09-07", "good")])
def test_a_path_whose_certificate_ended_before_the_readings_is_doubtful(catseye, tmp_path, until, word):
    (tmp_path / "path-a.csv").write_bytes(EXAMPLE.read_bytes())
    (tmp_path / "path-a.toml").write_text(f"valid_until = {until}\n" + EXAMPLE.with_suffix(".toml").read_text())
    _, said, _ = catseye(tmp_path / "path-a.csv", "--json")
    verdict = json.loads(said)["verdict"]
    assert verdict["word"] == word
    assert ("ended on 2003-09-06" in verdict["why"]) == (word == "doubtful")


def test_an_error_of_the_length_counts_as_1_37_to_1_39_say(catseye):
    """[PARKER04] 1.38: dn/dD = (n - n_0)/D in size; here by moving the length in the index itself, by hand."""
    found = json.loads(catseye(EXAMPLE, "--json")[1])
    index = np.array([v for v in found["series"]["group_index"] if v is not None])
    moved = index - found["group_index"]
    farthest = moved[np.argmax(np.abs(moved))]
    length = found["path_length"]
    # n - n_0 = phase c/(4 pi f D): with D + 1 mm the same phase gives less by (n - n_0)/D per metre
    by_hand = farthest * (length / (length + 1e-3) - 1.0) / 1e-3
    assert found["length_sensitivity_per_m"] == pytest.approx(by_hand, rel=1e-4)
