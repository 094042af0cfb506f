"""`catseye model` as a user meets it: displacements of targets and rangers, what it writes, what it refuses."""

import csv
import json

import numpy as np
import pytest

from repository import ROOT

MODEL = ROOT / "examples" / "structural-model" / "telescope.toml"
SITE = ROOT / "examples" / "sites" / "gbt"


def test_displacements_of_a_site_are_told_in_both_axes_with_u(catseye):
    status, out, err = catseye("model", "displace", MODEL, "--posture", "145,45", "--site", SITE, "--json")
    assert (status, err) == (0, "")
    (posture,) = json.loads(out)["postures"]
    ranger = posture["points"]["ZY113"]
    assert ranger["kind"] == "ranger"
    # the same length in either axes
    ground, body = np.array(ranger["displacement"]), np.array(ranger["body_displacement"])
    assert np.linalg.norm(ground) == pytest.approx(np.linalg.norm(body), rel=1e-12)
    assert 0.02 < np.linalg.norm(ground) < 0.1
    assert set(posture["beam"]) == {"azimuth_cos_e", "elevation", "focus", "covariance"}
    text = catseye("model", "displace", MODEL, "--posture", "145,45", "--site", SITE)[1]
    assert "ZY113" in text
    assert "Beam" in text


def test_displacements_are_written_as_tables_and_figures(catseye, tmp_path):
    words = ["--posture", "0,10", "--posture", "0,80", "--site", SITE, "--points", "ZEG*", "--temperature-c", 25]
    assert catseye("model", "displace", MODEL, *words, "--out", tmp_path / "bent")[0] == 0
    files = sorted(path.name for path in (tmp_path / "bent").iterdir())
    assert files == [
        "beam.csv",
        "displacements.csv",
        "elevation.svg",
        "model.json",
        "provenance.json",
        "report.html",
        "side.svg",
    ]
    with (tmp_path / "bent" / "displacements.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["elevation_deg"] for row in rows] == ["10.000000"] * 2 + ["80.000000"] * 2
    assert {row["temperature_c"] for row in rows} == {"25.000000"}
    provenance = json.loads((tmp_path / "bent" / "provenance.json").read_text(encoding="utf-8"))
    assert "telescope.toml" in provenance["inputs_sha256"]


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["--posture", "145"], 2, "'145' is not azimuth,elevation in degrees"),
        (["--posture", "0,98"], 1, "elevation 98 deg is outside 0 to 95 deg"),
        (["--posture", "600,45"], 2, "--posture = 600, 45 (expected azimuth -540 to 540"),
        (["--posture", "0,45", "--temperature-c", "60"], 1, "temperature 60 C is outside -25 to 40 C"),
        (["--posture", "0,45", "--points", "BOOM"], 1, "no point is 'BOOM'"),
    ],
)
def test_what_cannot_be_displaced_is_one_line(catseye, words, status, said):
    found, out, err = catseye("model", "displace", MODEL, *words)
    assert (found, out) == (status, "")
    assert said in " ".join(err.split())


EPOCHS = ROOT / "examples" / "structure" / "epochs.csv"


def test_a_fit_writes_a_model_that_bends_by_the_new_coefficients(catseye, tmp_path):
    new = tmp_path / "new.toml"
    words = [MODEL, EPOCHS, "--free", "feed_arm:turn_x,shift_y", "--write", new, "--out", tmp_path / "fit", "--json"]
    status, out, err = catseye("model", "fit", *words)
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert found["covariance_order"][0] == "feed_arm shift_y cosE"
    assert len(found["covariance"]) == 8
    files = {path.name for path in (tmp_path / "fit").iterdir()}
    assert {
        "report.html",
        "model-coefficients.csv",
        "model-residuals.csv",
        "coefficients.svg",
        "residuals.svg",
    } <= files
    words = ["--posture", "0,10", "--points", "ZEG41040L", "--json"]
    before, after = (json.loads(catseye("model", "displace", file, *words)[1]) for file in (MODEL, new))
    moved = [one["postures"][0]["points"]["ZEG41040L"]["displacement"][2] for one in (before, after)]
    assert moved[0] != moved[1]
    assert any("no covariance" in note for note in before["notes"])
    assert not any("no covariance" in note for note in after["notes"])


def test_the_structure_of_the_examples_epochs_runs(catseye):
    status, out, err = catseye("structure", "--epochs", EPOCHS, "--points", "ZEG*", "--folds", 0, "--json")
    assert (status, err) == (0, "")
    assert json.loads(out)["epochs"] == 16


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        ([EPOCHS, "--free", "feed_arm"], 2, "'feed_arm' names no component"),
        ([EPOCHS, "--free", "boom:turn_x"], 1, "'boom' has no motion"),
        ([EPOCHS, "--free", "feed_arm:twist"], 1, "'twist' is not a component"),
        ([EPOCHS, EPOCHS], 2, "2 lists"),
        ([MODEL.parent / "missing.csv"], 1, "missing.csv"),
        ([EPOCHS, "--write", MODEL], 1, "is an input"),
    ],
)
def test_what_cannot_be_fitted_is_one_line(catseye, words, status, said):
    found, out, err = catseye("model", "fit", MODEL, *words)
    assert (found, out) == (status, "")
    assert said in " ".join(err.split())


FINITE = ROOT / "examples" / "finite-elements"


def test_a_finite_element_result_becomes_a_model_that_bends(catseye, tmp_path):
    new = tmp_path / "bent.toml"
    words = [MODEL, FINITE / "reflector.pch", "--nodes", FINITE / "nodes.csv", "--unit", "mm", "--case", "1=cosE"]
    words += ["--case", "2=sinE", "--axes=-y,x,z", "--origin=0,54.839108,-4.99999", "--write", new]
    status, out, err = catseye("model", "import", *words, "--out", tmp_path / "bent", "--json")
    assert (status, err) == (0, "")
    assert json.loads(out)["targets"]["TR01"]["node"] == 1001
    files = {path.name for path in (tmp_path / "bent").iterdir()}
    assert files == {"model-nodes.csv", "model.json", "targets.svg", "provenance.json"}
    assert catseye("model", "displace", new, "--posture", "0,45", "--json")[0] == 0
    status, _, err = catseye("model", "import", *words[:-2], "--origin=0,0")
    assert status == 2
    assert "'0,0' is not x,y,z in metres" in " ".join(err.split())


def test_cardinal_points_are_chosen_and_written(catseye, tmp_path):
    words = [MODEL, "--site", SITE, "--count", 2, "--points", "ZEG*", "--points", "ZAG*", "--free", "feed_arm:turn_x"]
    words += ["--posture", "0,20", "--posture", "90,70"]
    status, out, err = catseye("model", "choose", *words, "--out", tmp_path / "cardinal", "--json", "--quiet")
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert found["points"][0] == "ZEG41040L"  # the longest arm about the foot
    assert found["bits"][1] > found["bits"][0] > 0
    files = {path.name for path in (tmp_path / "cardinal").iterdir()}
    assert files == {"model-points.csv", "model.json", "information.svg", "provenance.json"}


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["--count", 99, "--points", "ZEG*"], 1, "count = 99 of 2 targets"),
        (["--count", 1, "--temperature-c", 3], 2, "--temperature-c needs --posture"),
        (["--count", 1, "--posture", "3"], 2, "'3' is not azimuth,elevation"),
        (["--count", 1, "--u-range-mm", 0], 2, "--u-range-mm = 0"),
    ],
)
def test_what_cannot_be_chosen_is_one_line(catseye, words, status, said):
    found, out, err = catseye("model", "choose", MODEL, "--site", SITE, *words, "--quiet")
    assert (found, out) == (status, "")
    assert said in " ".join(err.split())
