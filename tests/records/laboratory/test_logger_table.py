"""A logger's table: separators, units and clocks of its dialect; every bad cell by line and column."""

import pytest

from catseye.errors import InputError
from catseye.records.laboratory.logger_sheet import LoggerSheet
from catseye.records.laboratory.logger_table import read_logger_table

COLUMNS = {"time": "t", "temperature_c": "T", "pressure_hpa": "p", "humidity_percent": "h"}
ROW = "2024-02-10 18:00,9.5,930.1,50"


def table(tmp_path, text, **sheet):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    sheet.setdefault("columns", COLUMNS)
    return read_logger_table(path, LoggerSheet.model_validate(sheet), {})


@pytest.mark.parametrize(
    ("key", "cell", "quantity", "value"),
    [
        ("temperature_f", "50", "temperature_c", 10.0),
        ("temperature_k", "283.15", "temperature_c", 10.0),
        ("pressure_inhg", "27.4659", "pressure_hpa", 930.11),  # 29.9213 inHg are 1013.25 hPa
        ("pressure_mmhg", "697.635", "pressure_hpa", 930.11),  # 760 mmHg are 1013.25 hPa
        ("pressure_kpa", "93.011", "pressure_hpa", 930.11),
        ("pressure_pa", "93011", "pressure_hpa", 930.11),
        ("humidity_fraction", "0.5", "humidity_percent", 50.0),
        ("dew_point_f", "41", "dew_point_c", 5.0),
        ("dew_point_k", "278.15", "dew_point_c", 5.0),
        ("wet_bulb_f", "44.6", "wet_bulb_c", 7.0),
    ],
)
def test_units_are_converted(tmp_path, key, cell, quantity, value):
    own = {"temperature": ("temperature_c", "T"), "pressure": ("pressure_hpa", "p"), "x": ("humidity_percent", "h")}
    taken = key.split("_")[0] if key.split("_")[0] in own else "x"
    columns = {"time": "t", **{name: heading for part, (name, heading) in own.items() if part != taken}, key: "q"}
    found = table(tmp_path, f"t,T,p,h,q\n{ROW},{cell}\n", columns=columns)
    assert found.readings[quantity][0] == pytest.approx(value, rel=2e-5)
    assert len(found.readings) == 3


@pytest.mark.parametrize(
    ("zone", "clock", "utc_hour"),
    [
        ("UTC", "2024-02-10 18:00", 18.0),
        ("-05:00", "2024-02-10 18:00", 23.0),
        ("+05:30", "2024-02-10 18:00", 12.5),
        ("America/New_York", "2024-02-10 18:00", 23.0),
        ("America/New_York", "2024-07-10 18:00", 22.0),
        ("America/New_York", "2024-02-10T18:00Z", 18.0),  # an offset of its own counts
        ("UTC", "2024-02-10T18:00:00.5-05:00", 23.0 + 0.5 / 3600),
    ],
)
def test_clocks_become_utc(tmp_path, zone, clock, utc_hour):
    found = table(tmp_path, f"t,T,p,h\n{clock},9.5,930.1,50\n", time_zone=zone)
    hours = (found.mjd_utc[0] % 1.0) * 24.0
    assert hours == pytest.approx(utc_hour, abs=1e-6)
    assert int(found.mjd_utc[0]) == (60350 if "-02-" in clock else 60501)  # of the astronomical almanac


def test_the_hour_that_summer_time_repeats_goes_on(tmp_path):
    """26 October 2024 in Berlin: 02:00 to 03:00 comes twice, and the second is an hour later."""
    clocks = ["01:30", "02:00", "02:30", "02:00", "02:30", "03:00"]
    rows = "".join(f"27.10.2024 {clock};9,5;930,1;50\n" for clock in clocks)
    found = table(tmp_path, f"t;T;p;h\n{rows}", time_zone="Europe/Berlin", time_format="%d.%m.%Y %H:%M")
    assert (found.mjd_utc - found.mjd_utc[0]) * 24.0 == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0, 2.5], abs=1e-6)
    assert found.readings["temperature_c"].tolist() == [9.5] * 6


def test_a_thousands_point_and_a_decimal_comma(tmp_path):
    found = table(tmp_path, "t;T;p;h\n2024-02-10 18:00;9,5;1.013,25;50\n", decimal=",")
    assert found.readings["pressure_hpa"][0] == 1013.25


def test_headings_that_are_the_keys_need_no_sheet(tmp_path):
    text = "mjd_utc,station,temperature_c,pressure_mb,humidity_pct\n60350.5,WX7,9.5,930.1,101\n"
    found = table(tmp_path, text, columns=None)
    assert (found.station, found.mjd_utc[0], found.readings["humidity_percent"][0]) == (("WX7",), 60350.5, 100.0)
    assert found.saturated.tolist() == [True]  # a capacitor in fog


@pytest.mark.parametrize(
    ("text", "sheet", "words"),
    [
        (f"t,T,p,h\n{ROW}\n2024-02-10 18:01,9.x,930,50\n", {}, r"line 3, column 'T' = '9.x' \(expected a number"),
        ("t,T,p,h\n10.2.2024,9,930,50\n", {}, r"line 2, column 't' = '10.2.2024' is no time \(expected ISO 8601"),
        ("t,T,p,h\n2024-02-10,-999,930,50\n", {}, "line 2, column 'T' = '-999' is a temperature of -999 °C"),
        ("t,T,p,h\n2024-02-10,9,29.9,50\n", {}, r"column 'p' = '29.9' is a pressure of 29.9 hPa \(expected 500 to"),
        ("t,T,p,h\n2024-02-10,9,930,104\n", {}, "column 'h' = '104' is a humidity of 104 %"),
        ("t,T,p,h\n2024-02-10,9,930\n", {}, r"line 2, 3 cells = .* \(expected 4\)"),
        ("t,T,P,h\n2024-02-10,9,930,50\n", {}, r"line 1, column 'p' is missing \(the headings are 't, T, P, h'\)"),
        ("t,T,T,h\n2024-02-10,9,930,50\n", {}, "line 1, column 'T' occurs 2 times"),
        ("t,T,p,h\n", {}, "holds headings and no rows"),
        ("t,T,p,h\n", {"header_line": 3}, "has 1 lines"),
        (f"t,T,p,h\n{ROW}\n", {"columns": None}, r"columns need time or mjd_utc.*\[columns\] in a sheet"),
        (f"t,T,p,h\n{ROW}\n", {"time_zone": "Mars/Base"}, "time zone 'Mars/Base' is unknown"),
        ("t,T,p,h\n1802-02-10,9,930,50\n", {}, "line 2, column 't' = '1802-02-10' .expected a time of 1968"),
        (
            "t,T,p,h\n2024-03-31 02:30,9,930,50\n",
            {"time_zone": "Europe/Berlin"},
            "line 2, column 't' = '2024-03-31 02:30' is an hour that summer time leaves out",
        ),
    ],
)
def test_a_bad_table_is_one_line_with_its_place(tmp_path, text, sheet, words):
    with pytest.raises(InputError, match=words) as caught:
        table(tmp_path, text, **sheet)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"time": "t", "mjd_utc": "m"}, "time or mjd_utc, not both"),
        ({**COLUMNS, "temperature_f": "F"}, "temperature_c and temperature_f are given"),
        ({**COLUMNS, "dew_point_c": "d"}, "humidity_percent and dew_point_c are given"),
        ({"time": "t", "temperature_c": "T", "humidity_percent": "h"}, "need one of pressure_hpa, pressure_mb"),
    ],
)
def test_columns_have_one_of_each_quantity(columns, words):
    with pytest.raises(ValueError, match=words):
        LoggerSheet.model_validate({"columns": columns})
