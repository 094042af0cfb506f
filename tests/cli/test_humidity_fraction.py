"""A relative humidity typed as a fraction of 1: each command that takes one says both readings and is doubtful."""

import csv
import json
import re
import shutil

import pytest

from repository import ROOT

EXAMPLES = ROOT / "examples"
LINE = re.compile(r"^(humidity(?:_flipped)?_percent = )([0-9.]+)", re.MULTILINE)
INLINE = re.compile(r"(humidity_percent = )([0-9.]+)")
SAID = "is below hygrometers' resolution; as a fraction it would be"


def _hundredths(text, pattern):
    """The same record with every humidity over 100."""
    found, count = pattern.subn(lambda m: f"{m[1]}{float(m[2]) / 100.0:.4f}", text)
    assert count
    return found


def _column(path, name):
    with path.open() as stream:
        rows = list(csv.DictReader(stream))
    for row in rows:
        row[name] = row[name] and f"{float(row[name]) / 100.0:.4f}"  # some hours have no weather
    with path.open("w") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def refractometer(place):
    path = shutil.copy(EXAMPLES / "refractometer" / "path-a.csv", place)
    shutil.copy(EXAMPLES / "refractometer" / "path-a.toml", place)
    _column(place / "path-a.csv", "humidity_percent")
    return "refractometer", path


def baseline(place):
    path = shutil.copy(EXAMPLES / "baselines" / "busselton" / "ts30-baseline-observations.csv", place)
    _column(place / "ts30-baseline-observations.csv", "humidity")
    return "baseline", path


def acoustic(place):
    path = shutil.copy(EXAMPLES / "acoustic" / "night.csv", place)
    text = (EXAMPLES / "acoustic" / "night.toml").read_text()
    (place / "night.toml").write_text(_hundredths(text, INLINE))
    return "acoustic", path


def calibrate(place):
    path = shutil.copy(EXAMPLES / "calibrations" / "linearity.csv", place)
    text = (EXAMPLES / "calibrations" / "linearity.toml").read_text()
    (place / "linearity.toml").write_text(_hundredths(text, LINE))
    return "calibrate", "linearity", path


def air(place):
    return "air", "--temperature-c", "20", "--pressure-hpa", "933", "--humidity-percent", "0.5"


def sound(place):
    return "sound", "--temperature-c", "20", "--pressure-hpa", "933", "--humidity-percent", "0.5"


@pytest.mark.parametrize("doors", [refractometer, baseline, acoustic, calibrate, air, sound])
def test_a_humidity_typed_as_a_fraction_is_doubtful_with_both_readings(catseye, tmp_path, doors):
    status, said, complaint = catseye(*doors(tmp_path), "--json")
    assert (status, complaint) == (0, "")
    found = json.loads(said)
    verdict = (found["calibrations"][0] if "calibrations" in found else found)["verdict"]
    assert verdict["word"] != "good"
    assert SAID in said
    assert SAID in verdict["why"] or verdict["word"] == "failed"


def test_a_triplets_sheet_with_fractions_is_refused_with_both_readings(catseye, tmp_path):
    text = (EXAMPLES / "triplets" / "TR01.toml").read_text()
    (tmp_path / "TR01.toml").write_text(_hundredths(text, LINE))
    status, said, complaint = catseye("triplet", tmp_path / "TR01.toml", "--json")
    assert (status, said) == (1, "")
    assert "humidity_percent = 0.4693" in complaint
    assert "which would be 46.93 %" in complaint
