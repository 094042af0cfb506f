"""Weather of an acoustic path: columns of its table, a logger, one reading; doubts on what is far in time."""

import numpy as np
import pytest

from catseye.errors import ArgumentError, InputError
from catseye.records.night.recording import read_sheet
from catseye.reduction.air.acoustic_recording import reduce_acoustic
from catseye.reduction.air.sound_weather import logger_readings, one_reading, sheet_readings
from repository import ROOT

EXAMPLE = ROOT / "examples" / "acoustic"
HEAD = "mjd_utc,temperature_c,pressure_hpa,humidity_percent"


def bare(tmp_path, rows, header="mjd_utc,time_ab_s,time_ba_s,u_time_us", drop=()):
    """Table of times with a sheet that has no [[weather]]."""
    sheet = (EXAMPLE / "night.toml").read_text()
    sheet = sheet[: sheet.index("[[weather]]")]
    for line in drop:
        assert line in sheet
        sheet = sheet.replace(line, "")
    (tmp_path / "t.toml").write_text(sheet)
    (tmp_path / "t.csv").write_text("\n".join([header, *rows]) + "\n")
    return tmp_path / "t.csv"


ROWS = (EXAMPLE / "night.csv").read_text().splitlines()[1:]


def logger(tmp_path, rows, sheet="u_pressure_hpa = 0.3\nu_humidity_percent = 2.0\n", header=HEAD):
    (tmp_path / "log.csv").write_text("\n".join([header, *rows]) + "\n")
    (tmp_path / "log.toml").write_text(sheet)
    return tmp_path / "log.csv"


def readings(*minutes, start=61365.14, h=71.0):
    rng = np.random.default_rng(3)
    return [
        f"{start + m / 1440:.6f},{14.0 + rng.normal(0, 0.1):.3f},{930.4 + rng.normal(0, 0.05):.3f},"
        f"{h + rng.normal(0, 0.3):.2f}"
        for m in minutes
    ]


def test_a_sheets_weather_is_linear_in_time_and_held_beyond_its_ends():
    sheet, _ = read_sheet(EXAMPLE / "evening.toml")
    t, p, h = sheet_readings(sheet, "evening.toml").at(np.array([61365.0, 61365.12, 61366.0]))
    assert t == pytest.approx([16.2, 15.05, 13.9])
    assert (p == 930.4).all()
    assert (h == 71.0).all()


def test_columns_of_the_table_are_weather_enough(tmp_path):
    """The sheet's constant pressure and humidity written in each row give the same temperatures to the last bit."""
    (by_sheet,) = reduce_acoustic([EXAMPLE / "night.csv"]).paths
    header = "mjd_utc,time_ab_s,time_ba_s,u_time_us,pressure_hpa,humidity_percent"
    (path,) = reduce_acoustic([bare(tmp_path, [f"{row},930.4,71.0" for row in ROWS], header)]).paths
    assert np.array_equal(path.temperatures.temperature_c, by_sheet.temperatures.temperature_c)
    assert np.array_equal(path.temperatures.covariance_c2, by_sheet.temperatures.covariance_c2)
    assert path.weather_of == "the table's columns"
    assert np.isnan(path.shots.weather[0]).all()


def test_without_any_weather_the_refusal_names_the_ways(tmp_path):
    with pytest.raises(InputError, match=r"t.csv: has no column pressure_hpa.*a logger's table as weather"):
        reduce_acoustic([bare(tmp_path, ROWS)])
    recording = EXAMPLE / "evening-1.wav"
    sheet = (EXAMPLE / "evening.toml").read_text()
    start = sheet.index("[[weather]]")
    (tmp_path / "e.toml").write_text(sheet[:start])
    with pytest.raises(InputError, match=r"e.toml: has no \[\[weather\]\]"):
        reduce_acoustic([recording], tmp_path / "e.toml")


def test_a_loggers_table_gives_the_truth_of_the_night(tmp_path):
    """Mean of the example's truth: 14.918 at the first shot, 0.03 a minute, shots 60 to 83 minutes after it."""
    found = reduce_acoustic([bare(tmp_path, ROWS)], weather=logger_readings(EXAMPLE / "station.csv"))
    mean = found.paths[0].mean
    true = 14.918 - 0.03 * np.arange(60, 84).mean()
    assert abs(mean.temperature_c - true) < 3.0 * mean.u_temperature_c
    assert found.paths[0].u_weather == pytest.approx((0.3, 2.0))
    assert found.verdict.word == "good"
    assert "station.csv" in found.inputs


def test_one_reading_is_held_for_all_shots(tmp_path):
    """1 % of humidity at 14 °C is 0.16 hPa of vapour, which moves the temperature by 0.32 T e/p: 0.016 °C."""
    rows = bare(tmp_path, ROWS)
    found = [reduce_acoustic([rows], weather=one_reading(14.0, 930.4, h)).paths[0].mean for h in (71.0, 72.0)]
    virtual = 0.32 * 286.0 * 0.148 / 930.4  # 0.148 hPa at the path's 12.8 °C; [CRAMER93]'s acoustic virtual temperature
    assert found[1].temperature_c - found[0].temperature_c == pytest.approx(-virtual, rel=0.15)
    assert one_reading(None, None, None) is None
    with pytest.raises(ArgumentError, match="lacks pressure_hpa"):
        one_reading(14.0, None, 70.0)


@pytest.mark.parametrize(
    ("minutes", "word", "said"),
    [
        (range(0, 30, 5), "good", ""),
        ((0, 5, 10, 15), "doubtful", "no reading within 10.4 minutes of a shot"),
        # shots at 2.4 to 25.4 minutes: those from 5.4 on are over 1.5 minutes from any
        ((0, 1, 2, 3, 28, 29), "doubtful", "no reading within 12.4 minutes of a shot (21 in a gap or beyond)"),
    ],
)
def test_shots_far_from_the_readings_are_doubted(tmp_path, minutes, word, said):
    found = reduce_acoustic([bare(tmp_path, ROWS)], weather=logger_readings(logger(tmp_path, readings(*minutes))))
    assert found.verdict.word == word
    assert said in found.verdict.why


def test_weather_of_another_hour_is_refused(tmp_path):
    table = logger(tmp_path, readings(0, 5, 10, start=61365.05))
    with pytest.raises(InputError, match=r"log.csv: no reading within an hour of the shot at MJD 61365.15764"):
        reduce_acoustic([bare(tmp_path, ROWS)], weather=logger_readings(table))


def test_weather_in_two_places_is_refused(tmp_path):
    header = "mjd_utc,time_ab_s,time_ba_s,u_time_us,pressure_hpa,humidity_percent"
    table = bare(tmp_path, [f"{row},930.4,71.0" for row in ROWS], header)
    with pytest.raises(InputError, match=r"t.csv: has pressure_hpa and humidity_percent in its rows, and one reading"):
        reduce_acoustic([table], weather=one_reading(14.0, 930.4, 71.0))


def test_several_stations_need_a_choice(tmp_path):
    rows = [f"{name},{row}" for name, h in (("A", 60.0), ("B", 71.0)) for row in readings(*range(0, 30, 5), h=h)]
    table = logger(tmp_path, rows, header=f"station,{HEAD}")
    with pytest.raises(InputError, match="has 2 stations: A, B"):
        logger_readings(table)
    with pytest.raises(InputError, match="has no station 'C'"):
        logger_readings(table, "C")
    assert logger_readings(table, "A").humidity_percent == pytest.approx(60.0, abs=1.5)
    assert logger_readings(table, "B").humidity_percent == pytest.approx(71.0, abs=1.5)


def test_uncertainties_come_from_option_logger_or_sheet_in_that_order(tmp_path):
    drop = ("u_pressure_hpa = 0.3\n", "u_humidity_percent = 3.0\n")
    table = bare(tmp_path, ROWS, drop=drop)
    silent = logger_readings(logger(tmp_path, readings(*range(0, 30, 5)), sheet='station = "A"\n'))
    with pytest.raises(InputError, match=r"t.toml: u_pressure_hpa is missing"):
        reduce_acoustic([table], weather=silent)
    found = reduce_acoustic([table], weather=silent, u_pressure_hpa=0.5, u_humidity_percent=4.0)
    assert found.paths[0].u_weather == (0.5, 4.0)
    stated = logger_readings(logger(tmp_path, readings(*range(0, 30, 5))))
    assert reduce_acoustic([table], weather=stated, u_humidity_percent=4.0).paths[0].u_weather == (0.3, 4.0)


def test_u_of_a_dew_point_becomes_one_of_humidity(tmp_path):
    """Clausius and Clapeyron: d ln e/dT = L/(R_v T²), 2.47e6/(461.5 282²) = 0.0673 per °C at a dew point of 9 °C."""
    rows = [
        f"{61365.14 + m / 1440:.6f},{14.0 + 0.01 * (m % 3):.2f},930.4{m % 7},{9.0 + 0.01 * (m % 2):.2f}"
        for m in range(30)
    ]
    header = "mjd_utc,temperature_c,pressure_hpa,dew_point_c"
    of_dew = logger_readings(logger(tmp_path, rows, "u_dew_point_c = 0.3\n", header))
    assert of_dew.u_humidity_percent == pytest.approx(71.8 * 0.0673 * 0.3, rel=0.02)
    of_both = logger_readings(logger(tmp_path, rows, "u_dew_point_c = 0.3\nu_temperature_c = 0.4\n", header))
    of_air = 71.8 * 2.466e6 / (461.5 * 287.15**2) * 0.4
    assert of_both.u_humidity_percent == pytest.approx(np.hypot(71.8 * 0.0673 * 0.3, of_air), rel=0.02)
