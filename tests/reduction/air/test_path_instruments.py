"""A path's night with psychrometer and mercury is the night of the same air with other sensors."""

import csv

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.reduction.air.refractometer_calibration import calibrate_path
from catseye.reduction.air.refractometer_night import read_path_readings, read_path_sheet
from reduction.air.refractometer_scene import PathPlan, simulate_path_night

GRAVITY = 9.79784


def saturation(t, p):
    """[RUEGER90] eq. 5.27, typed again."""
    return (1.0007 + 3.46e-6 * p) * 6.1121 * np.exp(17.502 * t / (240.97 + t))


def wet_bulb(t, e, p):
    """[RUEGER90] eq. 5.23 solved by bisection."""
    low, high = np.full(len(t), -20.0), np.array(t, float)
    for _ in range(80):
        middle = 0.5 * (low + high)
        below = saturation(middle, p) - 0.000662 * p * (t - middle) < e
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)


@pytest.fixture
def night(tmp_path):
    """A simulated night with sensors, and a function that writes it with other instruments."""
    file = simulate_path_night(8, PathPlan(strays=0.0, patch_c=0.0)).write(tmp_path / "n.csv", air_model="rueger1990")
    with file.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))

    def written(change, **sheet):
        changed = [change(dict(row)) for row in rows]
        with file.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.DictWriter(stream, list(changed[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(changed)
        apart = tmp_path / "sheet.toml"
        apart.write_bytes(file.with_suffix(".toml").read_bytes())
        found, hashes = read_path_sheet(apart, sheet)
        return read_path_readings(file, found, hashes)

    return written


def with_instruments(row):
    """The row's air as mercury at 20 °C and as a wet bulb below the mean of the thermometers, printed to 1e-4."""
    names = [name for name in row if name.startswith("temperature")]
    t = np.mean([float(row[name]) for name in names if row[name]])
    if not row["pressure_hpa"] or not row["humidity_percent"]:
        row["barometer_mmhg"], row["mercury_c"], row["wet_bulb_c"] = "", "", ""
    else:
        p, h = float(row["pressure_hpa"]), float(row["humidity_percent"])
        e = saturation(t, p) * h / 100.0
        at_zero = p / 1.33322387415 * 9.80665 / GRAVITY
        row["barometer_mmhg"] = f"{at_zero * (1 + 1.818e-4 * 20) / (1 + 1.84e-5 * 20):.4f}"
        row["mercury_c"] = "20"
        row["wet_bulb_c"] = f"{wet_bulb(np.array([t]), e, p)[0]:.5f}"
    del row["pressure_hpa"], row["humidity_percent"]
    return row


def test_a_psychrometer_and_mercury_give_the_same_air_and_calibration(night):
    plain = night(lambda row: row)
    found = night(with_instruments, gravity_m_per_s2=GRAVITY, u_wet_bulb_c=0.2)
    assert found.pressure_hpa == pytest.approx(plain.pressure_hpa, abs=2e-4, nan_ok=True)
    assert found.humidity_percent == pytest.approx(plain.humidity_percent, abs=2e-3, nan_ok=True)
    # at these temperatures 0.1 °C of wet bulb is about 1 % of humidity
    assert 1.0 < found.sheet.u_humidity_percent < 4.0
    first, second = calibrate_path(plain), calibrate_path(found)
    assert second.index_0 == pytest.approx(first.index_0, abs=0.1 * first.u_index_0)


@pytest.mark.parametrize(
    ("change", "sheet", "words"),
    [
        (lambda row: {**row, "wet_bulb_c": "5"}, {}, "columns humidity_percent and wet_bulb_c give one quantity"),
        (lambda row: {k: v for k, v in row.items() if k != "pressure_hpa"}, {}, "column 'pressure_hpa' is missing"),
        (lambda row: {**row, "mercury_c": "5"}, {}, "column 'mercury_c' belongs to 'barometer_mmhg'"),
        (with_instruments, {}, "^sheet.toml: gravity_m_per_s2 is missing"),
        (
            lambda row: {**with_instruments(row), "wet_bulb_c": "45"},
            {"gravity_m_per_s2": GRAVITY},
            "line 2, wet_bulb_c = 45: .*above the dry bulb",
        ),
        (
            lambda row: {**with_instruments(row), "barometer_mmhg": "70"},
            {"gravity_m_per_s2": GRAVITY},
            "line 2, barometer_mmhg = '70' .expected 300 to 850 mm Hg",
        ),
    ],
)
def test_what_does_not_fit_is_one_line(night, change, sheet, words):
    with pytest.raises(InputError, match=words):
        night(change, **sheet)
