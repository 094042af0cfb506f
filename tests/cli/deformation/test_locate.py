"""`catseye locate`: example, JSON, files, refusals."""

import json

import numpy as np
import pytest

from catseye.records.files.examples import example

STATIONS, RANGES, THREE = (f"positions/{name}.csv" for name in ("stations", "ranges", "three-ranges"))


def test_the_example_is_good_and_json_has_every_target(catseye):
    status, out, err = catseye("locate", STATIONS, RANGES)
    assert (status, err) == (0, "")
    assert "Good: every target was found" in out
    assert "T06" in out
    found = json.loads(catseye("locate", STATIONS, RANGES, "--json")[1])
    assert found["names"] == [f"T0{k}" for k in range(1, 7)]
    truth = np.array([-29.593, 35.925, 35.131])  # of examples/networks/ground-ring, from which it was simulated
    u = np.sqrt(np.diag(found["covariance"][0]))
    assert (np.abs(np.array(found["x"][0]) - truth) < 4.0 * u).all()


def test_both_solutions_and_the_iteration_are_told(catseye):
    out = catseye("locate", STATIONS, THREE, "--both")[1]
    assert "Mirror images" in out
    assert out.count("  or ") == 3
    status, out, err = catseye("locate", STATIONS, THREE, "--method", "averaging", "--near=0,0,30")
    assert (status, err) == (0, "")
    assert "7 to 8 solutions of eq. 3.7" in " ".join(out.split())


def test_the_directory_has_tables_and_figures(catseye, tmp_path):
    out = tmp_path / "out"
    assert catseye("locate", STATIONS, THREE, "--near=0,0,30", "--method", "averaging", "--out", out)[0] == 0
    files = "elevation.svg plan.svg positions.csv provenance.json ranges.csv report.html result.json steps.csv"
    assert sorted(path.name for path in out.iterdir()) == files.split()
    assert (out / "steps.csv").read_text().splitlines()[0] == "target,step,x_m,y_m,z_m,difference_m"


@pytest.mark.parametrize(
    ("table", "old", "new", "complaint"),
    [
        ("ranges", "ZY101,T02", "ZY100,T02", "from = 'ZY100' is not a point (expected perhaps 'ZY109')"),
        ("ranges", "ZY103,T01", "ZY101,T01", "line 3, 'ZY101' to 'T01' occurs twice (expected each pair once"),
        ("ranges", "0.0002\n", "\n", "line 2, no sigma (expected one, m, or sigma_mm and sigma_ppm"),
        ("ranges", "0.0002\n", "0\n", "line 2, sigma = '0' (expected above 0 m"),
        ("ranges", "ZY101,T01,", "ZY101,T01,-", "(expected above 0 m)"),
        ("stations", "0.0002\n", "-0.0002\n", "line 2, u_z = '-0.0002' (expected 0 or above)"),
        ("stations", "31.0582", "", "line 2, x = '' (expected a finite number)"),
    ],
)
def test_spoilt_tables_are_refused_in_one_line(catseye, tmp_path, table, old, new, complaint):
    for name in ("stations", "ranges"):
        text = example(f"positions/{name}.csv").read_text()
        assert table != name or old in text
        (tmp_path / f"{name}.csv").write_text(text.replace(old, new, 1) if name == table else text)
    status, out, err = catseye("locate", tmp_path / "stations.csv", tmp_path / "ranges.csv")
    assert (status, out) == (1, "")
    assert complaint in err
    assert err.count("\n") == 1


def test_the_refusal_of_averaging_names_the_target(catseye):
    assert "target T01 has 6 ranges" in catseye("locate", STATIONS, RANGES, "--method", "averaging", "--near=0,0,30")[2]


def test_the_worst_coordinate_is_told(catseye):
    covariance = np.array(json.loads(catseye("locate", STATIONS, RANGES, "--json")[1])["covariance"])
    worst = 1e3 * np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).max())
    assert f"the worst to {worst:.3g} mm" in " ".join(catseye("locate", STATIONS, RANGES)[1].split())


def test_averaging_without_a_start_and_a_bad_start_are_wrong_usage(catseye):
    assert "--near is missing" in catseye("locate", STATIONS, THREE, "--method", "averaging")[2]
    status, _, err = catseye("locate", STATIONS, THREE, "--near=0,0")
    assert status == 2
    assert "x,y,z in metres" in err
