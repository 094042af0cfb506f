"""calibrate as programs call it: statuses, streams, files whole or not at all; the examples tell their truth."""

import json
import tomllib

import numpy as np
import pytest

from catseye.records.files.reading import read_record
from catseye.records.laboratory.calibration import CalibrationRecord
from repository import ROOT

EXAMPLES = ROOT / "examples" / "calibrations"
# The truth of each example stands in the comment of its sheet.
ARCSECOND = np.pi / 648_000
TRUTH = {
    "reference-distance": {"d0_mm": 180.685},
    "leakage": {"leakage_amplitude_volt": 0.03104, "leakage_phase_rad": 4.3574},
    "leakage-lit": {"leakage_amplitude_volt": 0.03104, "leakage_phase_rad": 4.3574},
    "linearity": {
        "zero_mm": 0.035,
        "scale_ppm": 0.4,
        "cyclic_cosine_1_mm": 0.006,
        "cyclic_sine_1_mm": -0.009,
        "cyclic_cosine_2_mm": -0.0025,
        "cyclic_sine_2_mm": 0.0015,
    },
    "retroreflector": {"pc_ball-7_mm": -173.715, "pc_prism-12_mm": -33.4937},
    "amplitude-to-phase": {"amplitude_to_phase_rad": -1.8e-3},
    "second-pass": {
        "offset_rad": -1.2e-3 * np.log(3.1) + 0.031,
        "second_pass_cosine_per_volt": 6e-4 * np.sin(2.1),
        "second_pass_sine_per_volt": -6e-4 * np.cos(2.1),
    },
    "feedback": {"feedback_rad": 8e-4},
    "oscillator": {"white_mrad2": 144.0, "flicker_mrad2": 0.0, "walk_mrad2": 0.04},
    "repeatability": {"repeatability_um": 10.0, "between_um": 0.0, "intermediate_um": 10.0},
    "prism-constant": {"height_mm": 38.2040, "hrp_mm": 25.01773, "pc_mm": -33.32272},
    "ball-constant": {"r1_mm": 50.0126, "r2_mm": 96.4946, "pc_b_mm": -173.71556},
    "gauge-blocks": {"zero_mm": 0.0042, "scale_ppm": 18.0},
    "spacers": {"A_mm": 88.9003, "B_mm": 30.0121, "C_mm": 10.0008},
    "invar-wire": {"distance_mm": 24_003.1},
    "autocollimation": {
        "beta1_rad": -150 * ARCSECOND,
        "beta2_rad": 25 * ARCSECOND,
        "ne0": -4935.4,
        "na0": -4195.3,
        "face_tilt_rad": 20 * ARCSECOND,
    },
    "height-gauge": {"dx_mm": -0.075, "dy_mm": 247.459, "dz_mm": -0.762},
    "both-faces": {"axis_offset_mm": 0.4, "mirror_offset_mm": -0.3},
    "both-faces-pointing": {
        "face_tilt_rad": 2e-4,
        "beam_tilt_x_rad": 1e-4,
        "beam_tilt_y_rad": -3e-4,
        "na0": 2691.4,
        "ne0": 1434.7,
    },
    "encoder": {"azimuth_encoder_cosine_1_counts": 3.0, "azimuth_encoder_sine_2_counts": 0.5},
    "limits": {"az_low_stop_counts": -21_810.0, "az_high_stop_counts": 76_191.0},
    "alignment": {"beam_x_mm": 0.21, "beam_y_mm": -0.33, "beam_tilt_x_rad": 3e-4, "beam_tilt_y_rad": 1e-4},
    "detector-focus": {"best_focus_mm": 0.31, "depth_mm": 1.4},
    "search-results": {"na0": 2692.8, "ne0": 1432.9, "alpha1_rad": -1.1972616},
    "monument-azimuth": {"azimuth_deg": 45.4087, "alpha1_rad": np.pi - np.radians(45.4087)},
    "plate-levels": {"alpha2_rad": -14.0 * ARCSECOND, "alpha3_rad": 22.0 * ARCSECOND, "level_zero_arcsec": 4.0},
    "monument-place": {"x_mm": -85_312.0, "y_mm": -84_107.0, "z_mm": 2431.0},
    "inclinometer": {
        "zero_x_volt": 0.013,
        "zero_y_volt": -0.027,
        "scale_x_volt_per_rad": 412.0,
        "scale_y_volt_per_rad": 405.0,
        "misalignment_x_arcsec": 1400.0,
        "misalignment_y_arcsec": -2300.0,
        "cubic_x_per_rad2": 300.0,
        "cubic_y_per_rad2": 300.0,
        "warmth_x_volt_per_c": 2e-4,
        "warmth_y_volt_per_c": -1e-4,
        "table_tilt_x_arcsec": 35.0,
        "table_tilt_y_arcsec": -20.0,
    },
    "hydrostatic-level": {
        "height_ZY103_mm": 8.412,
        "height_ZY104_mm": -3.307,
        "height_ZY105_mm": 1.951,
        "constant_mm": 2.2,
    },
}
TRUTH |= {
    "reference-cube": {"azm_zrg_counts": 40_191.4, "elv_zrg_counts": 26_032.3, "play_counts": 3.0, "peak_volt": 5.2},
    "mounting-plate": {"plate_zero_deg": 213.4567, "collimation_arcsec": 11.0},
}
TRUTH_OF_PLANTED = {"repeatability": {"between_um": 15.0, "intermediate_um": np.hypot(10.0, 15.0)}}
WRONG = {
    "reference-distance": 13, "leakage": 29, "leakage-lit": None, "linearity": 77, "retroreflector": 41,
    "amplitude-to-phase": 9, "second-pass": 15, "feedback": None, "oscillator": None, "repeatability": None,
    "prism-constant": 3,
    "ball-constant": None, "gauge-blocks": 12, "spacers": None, "invar-wire": 6,
    "autocollimation": 11, "height-gauge": 19, "both-faces": 8, "both-faces-pointing": 4, "encoder": 17,
    "limits": 8, "alignment": 10, "detector-focus": 19, "search-results": 6, "monument-azimuth": None,
    "plate-levels": None, "monument-place": None, "inclinometer": None, "hydrostatic-level": None,
    "reference-cube": 19, "mounting-plate": 10,
}  # fmt: skip


PLANTED = [kind for kind, row in WRONG.items() if row is not None]


@pytest.mark.parametrize("kind", TRUTH)
def test_an_example_is_good_as_typed(catseye, kind):
    status, out, err = catseye("calibrate", kind, EXAMPLES / f"{kind}.csv", "--strict", "--json")
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["verdict"]["word"] == "good", found["verdict"]
    assert all(d["passed"] is not False for d in found["decisions"] + found["plausible"])
    for key, value in TRUTH[kind].items():
        each = found["quantities"][key]
        assert abs(each["value"] - value) < 3.5 * each["u"], key


@pytest.mark.parametrize(
    ("kind", "blamed"),
    [
        *((kind, "outliers") for kind in PLANTED),
        ("oscillator", "spurs: lines in the spectrum"),
        ("repeatability", "sets agree: F"),
    ],
)
def test_a_planted_fault_is_no_good_calibration(catseye, kind, blamed):
    status, out, _ = catseye("calibrate", kind, EXAMPLES / f"{kind}-planted.csv", "--strict", "--json")
    verdict = json.loads(out)["verdict"]
    assert status == 1
    assert verdict["word"] == "failed"
    assert blamed in verdict["why"]


@pytest.mark.parametrize("kind", [*PLANTED, "oscillator", "repeatability"])
def test_a_planted_example_finds_its_truth_and_its_one_wrong_reading_and_its_record_reads_back(catseye, kind, tmp_path):
    written, table = tmp_path / "record.toml", EXAMPLES / f"{kind}-planted.csv"
    status, out, err = catseye("calibrate", kind, table, "--reject", "--write", written, "--json")
    assert (status, err) == (0, "")
    record = read_record(written, CalibrationRecord)
    assert {q.key for q in record.quantity} >= set(TRUTH[kind])
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["not_used"] == ([] if WRONG[kind] is None else [WRONG[kind]])
    for key, value in {**TRUTH[kind], **TRUTH_OF_PLANTED.get(kind, {})}.items():
        each = found["quantities"][key]
        assert abs(each["value"] - value) < 3.5 * each["u"], key
    if kind == "oscillator":  # its line is no reading that could be left out
        assert found["decisions"][0]["text"] == "lines at 57 Hz"
    elif kind == "repeatability":
        assert found["decisions"][0]["passed"] is False  # its pointings differ
    else:
        assert all(d["passed"] is not False for d in found["decisions"]), found["decisions"]


def test_every_kind_has_an_example_its_help_and_its_page_of_columns():
    from catseye.cli.vocabularies import CALIBRATION_KINDS
    from catseye.reduction.calibrations.kinds import KINDS

    assert set(TRUTH) == set(KINDS) == set(CALIBRATION_KINDS.split("|"))
    text = (EXAMPLES.parents[1] / "docs" / "formats" / "calibrations.md").read_text(encoding="utf-8")
    for name, kind in KINDS.items():
        for word in (*kind.layout.required, *kind.layout.optional):
            assert f"`{word}`" in text, (name, word)


def test_without_reject_nothing_is_left_out_and_the_tests_say_so(catseye):
    status, out, _ = catseye("calibrate", "linearity", EXAMPLES / "linearity-planted.csv", "--json")
    found = json.loads(out)
    assert (status, found["not_used"]) == (0, [])
    assert found["readings"][77]["state"] == "suspect"
    assert {d["name"]: d["passed"] for d in found["decisions"]}["outliers: largest |w|"] is False


def test_files_appear_whole_and_only_where_catseye_may_write(catseye, tmp_path):
    record, page = tmp_path / "r.toml", tmp_path / "c.html"
    arguments = ("calibrate", "leakage", EXAMPLES / "leakage.csv", "--write", record, "--certificate", page)
    status, out, err = catseye(*arguments)
    assert (status, err) == (0, "")
    assert "leakage_amplitude_volt" in out
    assert tomllib.loads(record.read_text(encoding="utf-8"))["format"] == "catseye-calibration-1"
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert catseye(*arguments, "--quiet") == (0, "", "")  # our own files may be replaced
    page.write_text("somebody's", encoding="utf-8")
    before = record.stat().st_mtime_ns
    status, out, err = catseye(*arguments)
    assert (status, out) == (1, "")
    assert "exists and is not a catseye file" in err
    assert len(err.splitlines()) == 1
    assert record.stat().st_mtime_ns == before  # neither is begun
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c.html", "r.toml"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("leakage", "no.csv"), "no.toml: missing"),
        (("leakage", EXAMPLES / "linearity.csv"), "linearity.toml"),
        (("leakage", EXAMPLES / "leakage.csv", "--sheet", EXAMPLES / "linearity.toml"), "linearity.toml"),
        (
            ("leakage", EXAMPLES / "leakage.csv", "--write", EXAMPLES / "leakage.toml"),
            "is an input (expected another name)",
        ),
        (("leakage", EXAMPLES / "leakage.csv", "--write", "x", "--certificate", "x"), "is the record too"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_status_1(catseye, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    status, out, err = catseye("calibrate", *arguments)
    assert (status, out) == (1, "")
    assert said in err
    assert len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_an_unknown_kind_is_wrong_usage_and_help_has_an_example(catseye):
    status, out, err = catseye("calibrate", "bogus", "x.csv")
    assert status == 2
    assert "'bogus' is not one of reference-distance, leakage" in " ".join((out + err).split())
    status, out, _ = catseye("calibrate", "--help")
    assert status == 0
    assert "catseye calibrate linearity examples/calibrations/linearity.csv" in out  # good: the test of every example
