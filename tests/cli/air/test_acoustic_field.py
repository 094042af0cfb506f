"""`catseye acoustic-field`: the shipped array gives its truth back; wrong tables are one line."""

import importlib.util
import json

import numpy as np
import pytest

from repository import ROOT

EXAMPLE = ROOT / "examples" / "acoustic"
STATIONS, TIMES, SHEET = (EXAMPLE / name for name in ("array-stations.csv", "array-times.csv", "array-times.toml"))


@pytest.fixture(scope="module")
def maker():
    spec = importlib.util.spec_from_file_location("make_array", EXAMPLE / "make_array.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_shipped_array_gives_its_truth_back(catseye, maker):
    status, out, err = catseye("acoustic-field", STATIONS, TIMES, "--json")
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["verdict"]["word"] == "good"
    assert [line["name"] for line in found["lines"]] == list(maker.LASERS)
    for line, ends in zip(found["lines"], maker.LASERS.values(), strict=True):
        assert abs(line["temperature_c"] - maker.line_mean(*ends)) < 2.0 * line["u_temperature_c"]
        assert line["u_temperature_c"] < 0.12
    points = np.array(found["map"]["points"])
    z = (np.array(found["map"]["temperature_c"]) - maker.temperature_c(points)) / found["map"]["u_temperature_c"]
    assert np.abs(z).max() < 3.0
    assert np.abs((np.array(found["map"]["wind"]) - maker.wind(points)) / found["map"]["u_wind"]).max() < 3.0
    assert found["chi_square"] == pytest.approx(56.0, abs=3.0 * np.sqrt(112.0))
    assert np.array(found["lines_covariance_c2"]).shape == (2, 2)


def test_files_appear_whole_and_may_be_replaced(catseye, tmp_path):
    out = tmp_path / "out"
    for _ in range(2):
        status, said, err = catseye("acoustic-field", STATIONS, TIMES, "--out", out)
        assert (status, err) == (0, "")
    assert "line ZY103" in said
    names = {path.name for path in out.iterdir()}
    assert names == {"acoustic_field.csv", "acoustic_times.csv", "map.svg", "acoustic_field.json", "provenance.json"}
    whole = json.loads((out / "acoustic_field.json").read_text(encoding="utf-8"))["map"]
    covariance = np.array(whole["covariance_c2"])
    assert np.sqrt(np.diag(covariance)) == pytest.approx(whole["u_temperature_c"], rel=1e-4)
    rows = (out / "acoustic_times.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 57
    made = json.loads((out / "provenance.json").read_text(encoding="utf-8"))
    assert set(made["inputs_sha256"]) == {STATIONS.name, TIMES.name, SHEET.name}


@pytest.mark.parametrize(
    ("file", "before", "after", "words"),
    [
        (TIMES, "S1,S2,", "S1,S9,", "line 2, receiver = 'S9' is no station (expected one of S1, S2"),
        (TIMES, "S1,S2,", "S1,S1,", "line 2, source and receiver are both 'S1'"),
        (TIMES, "S1,S2,0.", "S1,S2,-0.", "line 2, time_s = '-0."),
        (TIMES, "source,receiver", "from,receiver", "source"),
        (STATIONS, "S2,40", "S1,40", "line 3, station 'S1' is also in line 2"),
        (STATIONS, "S2,40", "S2,x", "line 3, x_m = 'x'"),
        (SHEET, "variation_c = 0.7", "variation_c = -1.0", "variation_c"),
        (SHEET, 'name = "ZY104"', 'name = "ZY103"', "lines names 'ZY103' 2 times"),
        (SHEET, "u_wind_m_per_s = 5.0", "u_wind_m_per_s = 0.0", "still air"),
    ],
)
def test_a_spoilt_file_is_1_in_one_line(catseye, tmp_path, file, before, after, words):
    for each in (STATIONS, TIMES, SHEET):
        text = each.read_text(encoding="utf-8")
        assert each != file or before in text
        changed = text.replace(before, after, 1) if each == file else text
        (tmp_path / each.name).write_text(changed, encoding="utf-8")
    status, out, err = catseye("acoustic-field", tmp_path / STATIONS.name, tmp_path / TIMES.name)
    assert (status, out) == (1, "")
    assert words in err
    assert err.count("\n") == 1
    assert str(file.name) in err


def test_missing_files_and_a_file_twice_are_1(catseye, tmp_path):
    for arguments in ((tmp_path / "no.csv", TIMES), (STATIONS, tmp_path / "no.csv"), (TIMES, TIMES)):
        status, out, err = catseye("acoustic-field", *arguments)
        assert (status, out) == (1, "")
        assert err.count("\n") == 1
