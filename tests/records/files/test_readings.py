"""A table of readings and its sheet: what is read, and every refusal in one line with place, value and what to do."""

from typing import Annotated

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, read_readings
from catseye.records.files.record import Within


class Weather(Sheet):
    temperature_c: Annotated[float, Within(-40, 60)] | None = None


LAYOUT = SheetLayout(
    "thing",
    Weather,
    required={"range_m": Within(0.5, 100)},
    optional={"who": TEXT, "temperature_c": Within(-40, 60)},
)
SHEET = """kind = "thing"
instrument = "ZP1"
serial = 7
measured_on = 2026-09-01
valid_until = 2027-09-01
by = "someone"
report = "L1"
"""


@pytest.fixture
def files(tmp_path):
    """Function (table, sheet) -> path of the table."""

    def made(table, sheet=SHEET):
        (tmp_path / "t.csv").write_text(table, encoding="utf-8")
        (tmp_path / "t.toml").write_text(sheet, encoding="utf-8")
        return tmp_path / "t.csv"

    return made


def test_numbers_words_and_reasons(files):
    found = read_readings(files("who,range_m,left_out\na,1.5,\nb,2.5,dew on the cube\n"), LAYOUT)
    assert found.numbers["range_m"].tolist() == [1.5, 2.5]
    assert found.words == {"who": ("a", "b")}
    assert found.active.tolist() == [True, False]
    assert found.where == ("line 2", "line 3")
    assert set(found.hashes) == {"t.csv", "t.toml"}


def test_a_column_wins_over_the_key_of_the_sheet_and_zero_is_a_temperature(files):
    table, sheet = "range_m,temperature_c\n1,0\n2,0\n", SHEET + "temperature_c = 20.0\n"
    assert read_readings(files(table, sheet), LAYOUT).get("temperature_c").tolist() == [0.0, 0.0]
    assert read_readings(files("range_m\n1\n2\n", sheet), LAYOUT).get("temperature_c").tolist() == [20.0, 20.0]
    assert read_readings(files("range_m\n1\n", SHEET + "temperature_c = 0.0\n"), LAYOUT).has("temperature_c")


def test_a_sheet_elsewhere_is_named(files, tmp_path):
    path = files("range_m\n1\n")
    (tmp_path / "other.toml").write_text(SHEET.replace("ZP1", "ZP2"), encoding="utf-8")
    assert read_readings(path, LAYOUT, tmp_path / "other.toml").sheet.instrument == "ZP2"


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("range_m\n", "t.csv: holds a header and no rows"),
        ("", "t.csv: holds 0 bytes and no text: empty"),
        ("range_m\n1\nmuch\n", "t.csv: line 3, range_m = 'much' (expected a finite number)"),
        ("range_m\n1\nnan\n", "t.csv: line 3, range_m = 'nan' (expected a finite number)"),
        ("range_m\n0.1\n", "t.csv: line 2, range_m = 0.1 (expected 0.5 to 100)"),
        ("range_m\n2500\n", "t.csv: line 2, range_m = 2500 looks like millimetres (expected 0.5 to 100)"),
        ("range_m,temperature_c\n1,293.15\n", "temperature_c = 293.15 looks like kelvin (expected -40 to 60)"),
        ("range_mm\n1\n", "t.csv: line 1, column 'range_mm' is unknown (expected the header range_m, optionally who,"),
        ("who\na\n", "t.csv: line 1, column 'range_m' is missing"),
        ("range_m,left_out\n1,bad\n", "t.csv: every reading has a reason in 'left_out' (expected some without)"),
        ("range_m,mjd_utc\n1,2461280.5\n", "mjd_utc = 2461280.5 (expected 40000 to 100000)"),
    ],
)
def test_a_bad_table_is_refused_in_one_line(files, table, said):
    with pytest.raises(InputError) as refusal:
        read_readings(files(table), LAYOUT)
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("serial = 7\n", ""), "t.toml: serial is missing (expected a value)"),
        (('by = "someone"', 'by = ""'), "t.toml: by = ''"),
        (
            ('kind = "thing"', 'kind = "leakage"'),
            "kind = 'leakage' is the sheet of another calibration (expected 'thing')",
        ),
        (
            ('kind = "thing"', 'kind = "leakage"\nu_session_volt = 0.1'),
            "kind = 'leakage' is the sheet of another calibration (expected 'thing')",
        ),
        (("2027-09-01", "2026-09-01"), "valid_until = 2026-09-01 is not after measured_on = 2026-09-01"),
        (('report = "L1"', 'report = "L1"\nlevel = 0.95'), "level = 0.95 is not a small probability"),
        (('report = "L1"', 'report = "L1"\nlevl = 0.05'), "levl = 0.05 is not a known key (expected perhaps level)"),
        (('report = "L1"', 'report = "L1"\nformat = 2'), "format = 2 (expected 1 or 'catseye-readings-1'"),
        (('report = "L1"', 'report = "L1'), "is not TOML"),
    ],
)
def test_a_bad_sheet_is_refused_in_one_line(files, change, said):
    with pytest.raises(InputError) as refusal:
        read_readings(files("range_m\n1\n", SHEET.replace(*change)), LAYOUT)
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_missing_files_and_times_are_named(files, tmp_path):
    path = files("range_m\n1\n")
    with pytest.raises(InputError, match=r"no\.csv: missing in"):
        read_readings(tmp_path / "no.csv", LAYOUT, tmp_path / "t.toml")
    (tmp_path / "t.toml").unlink()
    with pytest.raises(InputError, match=r"t\.toml: missing in .* \(expected the sheet of t\.csv, TOML\)"):
        read_readings(path, LAYOUT)
    with pytest.raises(InputError, match="is given as the table and as its sheet"):
        read_readings(path, LAYOUT, path)
    found = read_readings(files("range_m\n1\n"), LAYOUT)
    with pytest.raises(InputError, match="column 'mjd_utc' is missing"):
        found.hours()
    with pytest.raises(InputError, match=r"t\.toml: temperature_c is missing \(expected a value, or a column"):
        found.get("temperature_c")


def test_hours_count_from_the_first_reading(files):
    found = read_readings(files("range_m,mjd_utc\n1,61280.5\n1,61280.25\n"), LAYOUT)
    np.testing.assert_allclose(found.hours(), [6.0, 0.0])


@pytest.mark.parametrize("name", ["EDM 7", "Leica TM50 / 2", "Messgerät Süd"])
def test_instrument_name_is_free_text(files, name):
    sheet = SHEET.replace('instrument = "ZP1"', f'instrument = "{name}"')
    assert read_readings(files("range_m\n1\n2\n", sheet), LAYOUT).sheet.instrument == name
    with pytest.raises(InputError, match="instrument"):
        read_readings(files("range_m\n1\n2\n", sheet.replace(name, "")), LAYOUT)
