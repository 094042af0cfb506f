"""The tables of sound and of a refractometer: each number is the one in memory over the unit in its column's name."""

import numpy as np
import pytest

from catseye.gateways.air.tables import path_temperatures_csv, series_csv, shots_csv
from catseye.reduction.air.acoustic_recording import reduce_acoustic
from catseye.reduction.air.refractometer_calibration import calibrate_path
from catseye.reduction.air.refractometer_night import read_path_readings, read_path_sheet
from column_scene import assert_columns
from repository import ROOT

EXAMPLES = ROOT / "examples"


@pytest.fixture(scope="module")
def sounded():
    """Travel times of a table, and those found in recordings, which have a signal over their noise."""
    acoustic = EXAMPLES / "acoustic"
    return [
        *reduce_acoustic([acoustic / "night.csv"], None).paths,
        *reduce_acoustic(sorted(acoustic.glob("evening-*.wav")), acoustic / "evening.toml").paths,
    ]


def test_every_column_of_path_temperatures_has_the_unit_of_its_name(sounded):
    rows = [(path, k) for path in sounded for k in np.flatnonzero(path.used).tolist()]
    rows.sort(key=lambda row: row[0].shots.mjd[row[1]])
    told = {
        "mjd_utc": lambda r: r[0].shots.mjd[r[1]],
        "ranger": lambda r: r[0].sheet.ranger,
        "target": lambda r: r[0].sheet.target,
        "temperature_c": lambda r: r[0].temperatures.temperature_c[r[1]],
        "u_temperature_c": lambda r: r[0].temperatures.u_temperature_c[r[1]],
    }
    assert_columns(path_temperatures_csv(sounded), told, rows)


def test_every_column_of_the_soundings_has_the_unit_of_its_name(sounded):
    rows = [(path, k) for path in sounded for k in range(len(path.shots.mjd))]

    def found(name):
        return lambda r: getattr(r[0].temperatures, name)[r[1]]

    told = {
        "mjd_utc": lambda r: r[0].shots.mjd[r[1]],
        "ranger": lambda r: r[0].sheet.ranger,
        "target": lambda r: r[0].sheet.target,
        "file": lambda r: r[0].shots.file[r[1]],
        "time_ab_s": lambda r: r[0].shots.time_ab[r[1]],
        "time_ba_s": lambda r: None if r[0].shots.time_ba is None else r[0].shots.time_ba[r[1]],
        "u_time_ab_us": lambda r: r[0].shots.u_time[0, r[1]],
        "u_time_ba_us": lambda r: None if r[0].shots.time_ba is None else r[0].shots.u_time[1, r[1]],
        "snr_ab_db": lambda r: 10.0 * np.log10(r[0].shots.snr[0, r[1]]),
        "snr_ba_db": lambda r: 10.0 * np.log10(r[0].shots.snr[1, r[1]]),
        "temperature_c": found("temperature_c"),
        "u_temperature_c": found("u_temperature_c"),
        "wind_m_per_s": found("wind"),
        "u_wind_m_per_s": found("u_wind"),
        "group_refractivity_ppm": found("group_refractivity"),
        "u_group_refractivity_ppm": found("u_group_refractivity"),
        "status": lambda r: r[0].status(r[1]),
    }
    assert_columns(shots_csv(sounded), told, rows)


def test_every_column_of_the_group_index_has_the_unit_of_its_name():
    file = EXAMPLES / "refractometer" / "path-a.csv"
    sheet, hashes = read_path_sheet(file.with_suffix(".toml"), {})
    found = calibrate_path(read_path_readings(file, sheet, hashes))
    told = {
        "mjd_utc": lambda k: found.readings.mjd_utc[k],
        "section": lambda k: found.followed.section[k] + 1,
        "phase_rad": lambda k: found.followed.phase[k],
        "group_refractivity_ppm": lambda k: found.refractivity[k],
        "u_group_refractivity_ppm": lambda k: found.u_refractivity[k],
        "temperature_c": lambda k: found.temperature_c[k],
        "u_temperature_c": lambda k: found.u_temperature_c[k],
        "weather_refractivity_ppm": lambda k: found.weather.mean[k],
        "residual_ppm": lambda k: found.residual[k],
        "standardised": lambda k: found.standardised[k],
        "status": lambda k: found.status[k],
    }
    assert 2e-4 < np.nanmin(found.refractivity) < np.nanmax(found.refractivity) < 4e-4  # n_g - 1, not ppm
    assert_columns(series_csv(found), told, range(len(found.status)))
