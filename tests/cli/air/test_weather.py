"""`catseye weather`: a logger's table to an index series, files, and a campaign's weather."""

import json

import pytest

from catseye.records.files.reading import Folder
from catseye.records.night.weather import WeatherSample
from repository import ROOT

EXAMPLES = ROOT / "examples" / "weather"


def test_json_has_the_series_and_what_was_left_out(catseye):
    status, out, err = catseye("weather", EXAMPLES / "tower.dat", "--json")
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert len(found["group_refractivity"]) == len(found["mjd_utc"]) == 689
    assert {"line": 408, "reason": "spike of the thermometer"} in found["left_out"]
    assert found["uncertainty_of"] == ["temperature", "pressure", "humidity"]
    # 0.2 °C, 0.3 hPa, 2 % at 10 °C: 0.19, 0.084, 0.008 ppm
    assert found["u_group_refractivity"][0] * 1e6 == pytest.approx(0.215, abs=0.01)


def test_files_are_written_and_a_campaign_reads_the_weather(catseye, tmp_path):
    status, out, err = catseye(
        "weather", EXAMPLES / "valley.csv", "--out", tmp_path / "valley", "--write", tmp_path / "weather.csv"
    )
    assert (status, err) == (0, "")
    assert "Good: 61 of 61 rows" in out
    assert {path.name for path in (tmp_path / "valley").iterdir()} == {
        "weather_index.csv", "weather.svg", "weather.json", "provenance.json",
    }  # fmt: skip
    samples = Folder(tmp_path).table("weather.csv", WeatherSample)
    assert len(samples) == 61
    assert samples[0].station == "WX2"
    status, _, _ = catseye("weather", tmp_path / "weather.csv", "--elevation-m", 760)  # and so does the command
    assert status == 0


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        ((EXAMPLES / "tower.dat", "--elevation-m", 9999), 1, "elevation_m = 9999"),
        ((EXAMPLES / "tower.dat", "--pressure-at", "moon"), 2, "is not one of station, sea-level, altimeter"),
        ((EXAMPLES / "tower.dat", "--sheet", EXAMPLES / "valley.toml"), 1, "column 'Datum' is missing"),
        ((EXAMPLES / "tower.dat", "--u-pressure-hpa", -1), 2, "not a standard uncertainty"),
        (("no.csv",), 1, "no.csv"),
    ],
)
def test_refusals_are_one_line(catseye, arguments, status, words):
    got, out, err = catseye("weather", *arguments)
    assert (got, out) == (status, "")
    assert words in " ".join(err.split())
    assert status == 2 or err.count("\n") == 1


def test_text_names_lines_and_gaps(catseye):
    status, out, _ = catseye("weather", EXAMPLES / "tower.dat", "--u-temperature-c", 0)
    text = " ".join(out.split())
    assert status == 0
    assert "lacks temperature_c: lines 195, 196" in text
    assert "25 min between lines 525 and 526" in text
    assert "not given: temperature" in text
