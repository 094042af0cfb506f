"""`catseye scan`: spots of the example's scans, with the truth of their twin, and one line for what cannot be."""

import json
from functools import partial

import pytest

from catseye.constants import DEGREE
from repository import ROOT

SCANS = ROOT / "examples" / "scans"
MIRROR = ROOT / "examples" / "night-01" / "mirrors" / "ZP103.toml"
TRUE = (20_000.3, 9_000.4)  # examples/scans/make_examples.py


@pytest.fixture
def asked(catseye):
    """`catseye scan` run in this process: exit status, what it said, what it complained of."""
    return partial(catseye, "scan")


def test_the_examples_spot_is_where_the_twin_had_it(asked, tmp_path):
    scans = [SCANS / f"{name}.csv" for name in ("azimuth", "elevation", "raster")]
    status, out, err = asked("fit", *scans, "--mirror", MIRROR, "--json", "--out", tmp_path / "out")
    assert (status, err) == (0, "")
    found = json.loads(out)
    for axis, true in zip(("azimuth", "elevation"), TRUE, strict=True):
        assert abs(found[f"{axis}_counts"] - true) < 2.5 * found[f"u_{axis}_counts"]
    assert [scan["axes"] for scan in found["scans"]] == ["azimuth", "elevation", "both"]
    assert len(found["scans"][2]["covariance"]) == len(found["parameters"]) == 6
    assert found["scans"][0]["peak_volt"] == pytest.approx(4.0, rel=0.05)
    names = "azimuth.svg elevation.svg provenance.json raster.svg readings.csv result.json samplers.fits scans.csv"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names.split()
    assert "spot" in asked("fit", scans[0], "--mirror", MIRROR)[1]


def test_a_clipped_scan_and_a_table_of_another_kind_are_one_line(asked, tmp_path):
    status, out, err = asked("fit", SCANS / "azimuth.csv", "--mirror", MIRROR, "--full-scale-volt", 3)
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert "azimuth.csv: line" in err
    assert "full scale, 3 V" in err
    status, out, err = asked("fit", ROOT / "examples" / "pointing" / "tilts.csv", "--mirror", MIRROR)
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert "expected the header azimuth_counts" in err
    assert asked("fit", SCANS / "azimuth.csv", "--mirror", MIRROR, "--noise-volt", 0)[0] == 2
    assert asked("fit", SCANS / "azimuth.csv")[0] == 2


def test_the_examples_prism_is_recognised_with_its_stages_zeros(asked, tmp_path):
    tables = [SCANS / "incidence.csv", SCANS / "rotation.csv"]
    status, out, err = asked("compare", *tables, "--json", "--out", tmp_path / "out")
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert (found["verdict"]["word"], found["kind"], found["unit"]) == ("good", "bare prism", "V")
    best = found["kinds"][0]
    for name, true in (("gain", 4.0), ("incidence_zero", 0.8 * DEGREE), ("rotation_zero", 17.0 * DEGREE)):
        assert abs(best[name] - true) < 3.0 * best[f"u_{name}"]
    assert found["kinds"][1]["rotation_zero"] is None
    names = "angles.svg kinds.csv provenance.json result.json returns.csv samplers.fits"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names.split()
    status, _, err = asked("compare", *tables, "--kind", "hollow-cube", "--strict", "--quiet")
    assert (status, err.count("\n")) == (1, 1)
    assert "bare prism fits better" in err
    assert asked("compare", SCANS / "azimuth.csv")[0] == 1
    assert asked("compare", *tables, "--reflectance", 1.5)[0] == 2


def test_a_search_says_what_to_expect_and_writes_what_a_calibration_takes(asked, tmp_path):
    monument = ROOT / "examples" / "night-01" / "monuments" / "ZY103.toml"
    ranger = ["--monument", monument, "--mirror", MIRROR]
    found, out_dir = tmp_path / "found.csv", tmp_path / "out"
    status, out, err = asked("search", SCANS / "targets.csv", *ranger, "--json", "--write", found, "--out", out_dir)
    assert (status, err) == (0, "")
    targets = json.loads(out)["targets"]
    assert [each["target"] for each in targets] == ["T0", "T1", "T2"]
    assert all(each["status"] == "found" and each["probability"] > 0.99 for each in targets)
    assert found.read_text().startswith("target,x_m,y_m,z_m,azimuth_counts,elevation_counts,")
    assert {"T0.svg", "probability.svg", "searches.csv", "looks.csv"} <= {path.name for path in out_dir.iterdir()}
    text = asked("search", SCANS / "targets.csv", *ranger, "--pattern", "raster")[1]
    assert "raster within 1.5 mrad" in text
    assert asked("search", SCANS / "targets.csv", *ranger, "--pattern", "zigzag")[0] == 2
    assert asked("search", SCANS / "targets.csv", *ranger, "--u-mrad", 0)[0] == 2
    found.write_text("mine\n")
    assert asked("search", SCANS / "targets.csv", *ranger, "--write", found)[0] == 1


def test_scans_through_an_analyser_say_a_bare_prism(catseye, tmp_path):
    """The made scans' truth: an edge at 17°, light at 30° from the plane of incidence."""
    table = ROOT / "examples" / "scans" / "analyser.csv"
    status, out, err = catseye("scan", "compare", table, "--polarization-deg", 30, "--json", "--out", tmp_path / "a")
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert (found["kind"], found["verdict"]["word"]) == ("bare prism", "good")
    assert found["polarization"] == pytest.approx(30.0 * DEGREE)
    assert found["analysers"] == pytest.approx([0.0, 90.0 * DEGREE])
    best = found["kinds"][0]
    assert best["rotation_zero"] == pytest.approx(17.0 * DEGREE, abs=4.0 * best["u_rotation_zero"])
    assert "analyser_deg" in (tmp_path / "a" / "returns.csv").read_text().splitlines()[0]
    status, out, err = catseye("scan", "compare", table)
    assert (status, out) == (2, "")
    assert "--polarization-deg is missing: a table has a column analyser_deg" in err
    (tmp_path / "b.csv").write_text(table.read_text().replace("15.0,8.0,0,", "15.0,8.0,200,"))
    status, out, err = catseye("scan", "compare", tmp_path / "b.csv", "--polarization-deg", 30)
    assert (status, out) == (1, "")
    assert "line 3, analyser_deg = '200' (expected -180 to 180 degrees, or a blank)" in err
