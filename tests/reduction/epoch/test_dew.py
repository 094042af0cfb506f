"""The risk of dew during a campaign: when, how near, and in words."""

import dataclasses

import numpy as np
import pytest

from catseye.atmosphere.weather import humidity
from catseye.constants import SECONDS_PER_DAY
from catseye.errors import InputError
from catseye.records.night.weather import Weather
from catseye.reduction.epoch.dew import SurfaceTemperature, dew_risk

START = 52889.125


def night(campaign, temperature_c, humidity_percent, *, seconds=None, stations=("WX1",)):
    """The campaign with readings each 5 minutes, the same at every station."""
    seconds = 300.0 * np.arange(len(temperature_c)) if seconds is None else np.asarray(seconds, float)
    each = len(stations)
    return dataclasses.replace(
        campaign,
        weather=Weather(
            mjd_utc=np.repeat(START + seconds / SECONDS_PER_DAY, each),
            station=tuple(stations) * len(seconds),
            temperature_c=np.repeat(np.asarray(temperature_c, float), each),
            pressure_hpa=np.full(each * len(seconds), 933.0),
            humidity_percent=np.repeat(np.asarray(humidity_percent, float), each),
        ),
    )


def test_a_night_that_moistens_and_dries_has_one_spell_at_the_time_it_was_worst(night_01):
    rh = [60.0, 70.0, 80.0, 90.0, 85.0, 70.0, 60.0]
    campaign = night(night_01, [10.0] * 7, rh)
    exact = {"u_surface_c": 0.0, "u_temperature_c": 0.0, "u_humidity_percent": 0.0}
    found = dew_risk(campaign, surface_minus_air_c=-3.5, **exact)
    dew = humidity.dew_point_c(humidity.vapour_pressure_hpa(10.0, 933.0, np.array(rh)), 933.0)
    np.testing.assert_allclose(found.condensation.margin_k, 6.5 - dew, atol=1e-12)
    (spell,) = found.spells
    assert (spell.station, spell.threat) == ("WX1", "dew")
    assert [round((mjd - START) * SECONDS_PER_DAY) for mjd in (spell.start_mjd_utc, spell.end_mjd_utc)] == [600, 1200]
    assert round((spell.worst_mjd_utc - START) * SECONDS_PER_DAY) == 900
    assert spell.margin_k == pytest.approx(6.5 - float(dew[3]))
    assert found.notes == (
        "dew on targets near WX1 from 2003-09-07T03:10:00Z to 2003-09-07T03:20:00Z: at worst, 2003-09-07T03:15:00Z, "
        "1.9 K below the dew point of 8.4 °C (± 0.0 K), probability up to 100 %",
    )


def test_frost_is_distinguished_and_a_single_sample_has_one_time(night_01):
    found = dew_risk(night(night_01, [-4.0, -4.0, -4.0], [60.0, 95.0, 60.0]), surface_minus_air_c=-3.0)
    (spell,) = found.spells
    assert spell.threat == "frost"
    assert spell.probability > 0.9
    assert found.notes[0].startswith("frost on targets near WX1 at 2003-09-07T03:05:00Z: 2.9 K below the frost point")


def test_stations_and_long_pauses_make_spells_of_their_own(night_01):
    campaign = night(
        night_01, [10.0] * 4, [95.0] * 4, seconds=[0.0, 300.0, 2000.0, 2300.0], stations=("WX1", "WX2")
    )  # fmt: skip
    found = dew_risk(campaign, surface_minus_air_c=-4.0)
    assert [(s.station, round((s.start_mjd_utc - START) * SECONDS_PER_DAY)) for s in found.spells] == [
        ("WX1", 0), ("WX2", 0), ("WX1", 2000), ("WX2", 2000),
    ]  # fmt: skip


def test_a_typed_difference_shares_the_thermometer_with_the_dew_point(night_01):
    campaign = night(night_01, [10.0], [90.0])
    only_air = {"u_surface_c": 0.0, "u_temperature_c": 1.0, "u_humidity_percent": 0.0}
    shared = dew_risk(campaign, surface_minus_air_c=-3.0, **only_air).condensation.u_margin_k
    measured = SurfaceTemperature(np.array([START]), np.array([7.0]))
    apart = dew_risk(campaign, surface=measured, **only_air).condensation.u_margin_k
    assert float(shared[0]) < 0.1 < 0.9 < float(apart[0])


def test_a_measured_surface_is_interpolated_and_not_judged_outside(night_01):
    campaign = night(night_01, [10.0] * 5, [90.0] * 5)
    surface = SurfaceTemperature(
        START + np.array([250.0, 550.0, 650.0, 1100.0]) / SECONDS_PER_DAY, np.array([9.5, 8.0, 7.0, 5.0])
    )  # fmt: skip
    found = dew_risk(campaign, surface=surface)
    dew = float(humidity.dew_point_c(humidity.vapour_pressure_hpa(10.0, 933.0, 90.0), 933.0))
    expected = np.array([np.nan, 9.25, 7.5, 7.0 - 2.0 * 250 / 450, np.nan]) - dew
    np.testing.assert_allclose(found.condensation.margin_k, expected, atol=1e-5)  # an MJD resolves a microsecond
    assert found.condensation.deposit.tolist() == ["unknown", "none", "dew", "dew", "unknown"]
    assert found.notes[-1].startswith("dew: surface temperature unknown at 2 of 5 weather samples")


def test_long_gaps_between_readings_are_not_judged(night_01):
    campaign = night(night_01, [10.0] * 5, [90.0] * 5)
    surface = SurfaceTemperature(START + np.array([0.0, 1200.0]) / SECONDS_PER_DAY, np.array([9.0, 5.0]))
    found = dew_risk(campaign, surface=surface)
    assert np.isnan(found.condensation.margin_k).tolist() == [False, True, True, True, False]


def test_the_example_night_is_safe_at_the_airs_temperature_and_not_six_degrees_below(night_01):
    assert dew_risk(night_01, surface_minus_air_c=0.0).notes == ()
    cold = dew_risk(night_01, surface_minus_air_c=-6.0)
    assert {s.station for s in cold.spells} == {"WX1", "WX2"}
    assert all(s.threat == "dew" and s.margin_k < 0.0 for s in cold.spells)


def test_fog_and_dry_air_at_zero_celsius_are_legal(night_01):
    found = dew_risk(night(night_01, [0.0, 0.0], [0.0, 100.0]), surface_minus_air_c=-1.0)
    assert found.condensation.deposit.tolist() == ["none", "frost"]


def test_surface_input_must_be_single_and_in_order(night_01):
    surface = SurfaceTemperature(np.array([START, START]), np.array([5.0, 5.0]))
    with pytest.raises(InputError, match="give either"):
        dew_risk(night_01)
    with pytest.raises(InputError, match="give either"):
        dew_risk(night_01, surface_minus_air_c=-1.0, surface=surface)
    with pytest.raises(InputError, match="reading 2 of the surface is not after"):
        dew_risk(night_01, surface=surface)
    with pytest.raises(InputError, match="do not pair up"):
        dew_risk(night_01, surface=SurfaceTemperature(np.array([START]), np.array([5.0, 6.0])))
