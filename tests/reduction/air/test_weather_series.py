"""Series of a logger: rows in order, faults by line, the pressure at the station."""

import runpy

import numpy as np
import pytest

from catseye.atmosphere.index.air import air
from catseye.errors import ArgumentError, InputError
from catseye.records.laboratory.logger_sheet import LoggerSheet
from catseye.records.laboratory.logger_table import read_logger_sheet, read_logger_table
from catseye.reduction.air.weather_series import USED, station_pressure_of_altimeter_hpa, weather_series
from repository import ROOT

EXAMPLES = ROOT / "examples" / "weather"
SOURCE = runpy.run_path(str(EXAMPLES / "make_example.py"))


def example(name, **changes):
    sheet, hashes = read_logger_sheet((EXAMPLES / name).with_suffix(".toml"), changes, needed=True)
    return weather_series(read_logger_table(EXAMPLES / name, sheet, hashes))


def series(tmp_path, rows, **sheet):
    path = tmp_path / "log.csv"
    path.write_text("mjd_utc,temperature_c,pressure_hpa,humidity_percent\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return weather_series(read_logger_table(path, LoggerSheet(**sheet), {}))


def calm(count=30, t=10.0, p=930.0, h=60.0):
    """Rows a minute apart with the scatter of sensors."""
    rng = np.random.default_rng(7)
    noise = rng.normal(0.0, 0.05, (count, 3))
    return [f"{60350 + k / 1440:.8f},{t + a:.3f},{p + b:.3f},{h + c:.3f}" for k, (a, b, c) in enumerate(noise)]


def test_the_tower_is_its_night_but_for_its_faults():
    """Each usable row is the simulated reading of its minute: °F printed to 0.01, inHg to 1e-4, fractions to 1e-4."""
    truth = SOURCE["night"](np.random.default_rng(46), 720, 60.0)
    found = example("tower.dat")
    back = np.array([text.startswith("clock") for text in found.status])
    minute = np.rint((found.mjd_utc - (60350 + 23 / 24)) * 1440.0).astype(int)
    assert np.abs(np.asarray(found.index.state.temperature_c) - truth[minute, 0]).max() < 0.0029
    assert np.abs(found.pressure_hpa - truth[minute, 1]).max() < 0.0018
    assert np.abs(np.asarray(found.index.state.humidity_percent) - truth[minute, 2]).max() < 0.0051
    assert found.left_out == {
        "lacks temperature_c": (195, 196),
        "repeats the time of line 305": (306,),
        "spike of the thermometer": (408,),
        "clock is before that of line 604": (605, 606, 607, 608),
    }
    assert int(back.sum()) == 4
    assert [(g.first_line, g.last_line, round(g.minutes, 3)) for g in found.gaps if g.minutes > 4] == [
        (525, 526, 25.0),
        (604, 609, 5.0),
    ]
    assert found.verdict.word == "doubtful"


def test_the_valley_goes_through_the_end_of_summer_time():
    """Evenly ten minutes in UTC; the service's reduction, by 5.2559 in the example, taken back to the station."""
    truth = SOURCE["night"](np.random.default_rng(64), 61, 600.0)
    found = example("valley.csv")
    assert np.diff(found.mjd_utc) * 86400.0 == pytest.approx(600.0, abs=1e-3)
    assert found.mjd_utc[0] == pytest.approx(60609 + 20 / 24, abs=1e-8)
    # 0.05 of rounding at the sea is 0.046 here, and a tenth of a degree 0.03 hPa
    assert np.abs(found.pressure_hpa - truth[:, 1]).max() < 0.08
    assert (found.verdict.word, found.gaps, set(found.status)) == ("good", (), {USED})
    # the dew point is printed to 0.1 °C, 0.7 % of humidity, and so is the temperature; their formula is Magnus'
    assert np.abs(np.asarray(found.index.state.humidity_percent) - truth[:, 2]).max() < 1.2
    index = air(truth[:, 0], truth[:, 1], truth[:, 2]).group_refractivity
    off = (np.asarray(found.index.state.group_refractivity) - index) / found.index.u
    assert np.abs(off).max() < 1.0  # rounding alone, against sensors of 0.2 °C


@pytest.mark.parametrize("elevation", [0.0, 803.8, 2500.0])
def test_an_altimeter_setting_is_the_standard_atmospheres(elevation):
    """In the standard atmosphere the setting is 1013.25 hPa at every station: [ICAO93], 898.75 at 1 km."""
    standard = 1013.25 * (1.0 - 0.0065 * elevation / 288.15) ** 5.25588
    assert station_pressure_of_altimeter_hpa(1013.25, elevation) == pytest.approx(standard, abs=2e-3)


def test_a_pressure_at_sea_level_needs_the_elevation_and_is_doubted_without_being_told(tmp_path):
    with pytest.raises(ArgumentError, match="needs elevation_m"):
        series(tmp_path, calm(), pressure_at="sea-level")
    found = series(tmp_path, calm(p=1021.0), elevation_m=803.8)
    assert "already reduced to sea level" in found.verdict.why
    back = series(tmp_path, calm(p=1021.0), elevation_m=803.8, pressure_at="sea-level", u_pressure_hpa=0.1)
    assert back.verdict.word == "good"
    assert back.pressure_hpa.mean() == pytest.approx(1021.0 * np.exp(-803.8 * 0.0341632 / (283.15 + 2.6)), abs=0.1)
    # 3 °C of the air below is 0.9 hPa of the 93 that it weighs
    assert back.u_pressure_hpa.mean() == pytest.approx(0.1 * 0.908, abs=1.0)
    assert 0.7 < back.u_pressure_hpa.mean() < 1.1


def test_a_stuck_sensor_and_a_fraction_are_doubted(tmp_path):
    rows = calm(120)
    rows[40:80] = [",".join([row.split(",")[0], "10.013", *row.split(",")[2:]]) for row in rows[40:80]]
    assert "thermometer reads 10.013 °C from line 42 to 81" in series(tmp_path, rows).verdict.why
    assert "looks like a fraction" in series(tmp_path, calm(h=0.5)).verdict.why


def test_two_stations_are_two_series(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{60350 + k / 1440:.8f},{name},{10 + k % 3 * 0.1},930,60" for k in range(20) for name in ("A", "B")]
    del rows[11]  # of B, sixth minute
    text = "mjd_utc,station,temperature_c,pressure_mb,humidity_pct\n" + "\n".join(rows) + "\n"
    path.write_text(text, encoding="utf-8")
    found = weather_series(read_logger_table(path, LoggerSheet(), {}))
    assert [(gap.station, round(gap.minutes, 3)) for gap in found.gaps] == [("B", 2.0)]
    assert found.left_out == {}


def test_no_usable_row_is_refused(tmp_path):
    with pytest.raises(InputError, match="no row is usable: line 2: lacks temperature_c"):
        series(tmp_path, ["60350.0,,930,60"])
