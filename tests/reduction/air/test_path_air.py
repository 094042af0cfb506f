"""A campaign's paths by the profile, beside the campaign's own air; missing, short, lying weather."""

import dataclasses

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.night.weather import Weather
from catseye.reduction.air.path_air import site_air, site_readings
from catseye.reduction.epoch.air.field import AirField
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.site.places import places_of
from catseye.simulator.night.air import NIGHT, SUMMER_DAY, WINTER, TrueAir


def shots_of(campaign, every=5):
    """Times and ends of its shots, without those on the reference cube."""
    places = places_of(campaign)
    rows = [i for i, target in enumerate(campaign.shots.target) if target != "ZRG"][::every]
    a = np.array([places[campaign.shots.ranger[i]].start for i in rows])
    b = np.array([places[campaign.shots.target[i]].start for i in rows])
    return campaign.shots.mjd_utc[rows], a, b


def changed(weather, keep=None, **columns):
    """A table of weather with other columns, or some of its rows."""
    new = dataclasses.replace(weather, **columns)
    if keep is None:
        return new
    rows = np.flatnonzero(keep)
    return Weather(
        new.mjd_utc[rows],
        tuple(new.station[i] for i in rows),
        new.temperature_c[rows],
        new.pressure_hpa[rows],
        new.humidity_percent[rows],
    )


def test_night_01_agrees_with_the_campaigns_air_within_the_claims(night_01):
    when, a, b = shots_of(night_01)
    air = site_air(night_01.site, night_01.weather, model="rueger1990")
    assert air.notes == ()
    found = air.along(when, a, b)
    other = AirField.of(night_01, ReductionSettings()).along(when, a, b, np.zeros(3)).refractivity
    apart = (found.refractivity - other) * 1e6
    u = np.sqrt(np.diag(found.covariance)) * 1e6
    # the module's docstring states these; 0.02 ppm is what every fifth shot may differ from all
    assert np.mean(apart) == pytest.approx(0.13, abs=0.02)
    assert np.max(np.abs(apart)) < 0.36  # AirField follows its readings within minutes, where this one takes a mean
    assert np.mean(u) == pytest.approx(0.63, abs=0.02)
    assert np.all(np.abs(apart) < u)


@pytest.mark.parametrize("conditions", [NIGHT, SUMMER_DAY, WINTER])
def test_the_simulated_sites_paths_are_found_within_the_claim(night_01, conditions):
    """The twin's air is another formula: an exponential surface layer; its pressure falls by 0.11 hPa a metre."""
    rng = np.random.default_rng(6)
    when, a, b = shots_of(night_01, 40)
    seconds = (when - when[0]) * 86_400.0
    every = np.arange(-180.0, 4000.0, 60.0)
    ratios = []
    for _ in range(12):
        world = TrueAir(
            dataclasses.replace(
                conditions,
                surface_layer_c=rng.normal(0, 0.5),
                surface_layer_m=rng.uniform(5, 30),
                gradient_c_per_m=conditions.gradient_c_per_m + rng.normal(0, 0.01),
                drift_c_per_h=rng.normal(0, 1),
            )
        )
        z = np.array([s.elevation_m - 806.42 for s in night_01.site.weather_station])
        t, s = (column.ravel() for column in np.meshgrid(every, [0, 1], indexing="ij"))
        table = Weather(
            when[0] + t / 86_400.0,
            tuple(("WX1", "WX2")[k] for k in s),
            world.temperature_c(z[s], t) + rng.normal(0, 0.3, 2)[s] + rng.normal(0, 0.05, t.size),
            world.pressure_hpa(z[s], t) + rng.normal(0, 0.05, t.size),
            np.clip(world.humidity_percent(t) + rng.normal(0, 0.5, t.size), 0, 100),
        )
        found = site_air(night_01.site, table, model="rueger1990").along(when, a, b)
        wrong = found.refractivity - (world.path_index(a, b, seconds) - 1.0)
        ratios.append(np.mean(wrong**2 / np.diag(found.covariance)))
    # errors are nearly all common to a night's paths: 12 nights of one square each, 1 +- 0.4
    assert 0.2 < np.mean(ratios) < 2.2


def test_one_station_alone_costs_certainty_but_gives_an_answer(night_01):
    when, a, b = shots_of(night_01, 60)
    both = site_air(night_01.site, night_01.weather).along(when, a, b)
    for name in ("WX1", "WX2"):
        one = site_air(night_01.site, night_01.weather, without=(name,)).along(when, a, b)
        wider = np.sqrt(np.diag(one.covariance))
        assert np.all(np.diag(one.covariance) > np.diag(both.covariance))
        assert np.all(np.abs(one.refractivity - both.refractivity) < 2 * wider)


def test_a_table_that_ends_early_is_used_with_growing_uncertainty(night_01):
    when, a, b = shots_of(night_01, 60)
    early = changed(night_01.weather, night_01.weather.mjd_utc < when[len(when) // 2])
    found = site_air(night_01.site, early).along(when, np.tile(a[0], (len(a), 1)), np.tile(b[0], (len(b), 1)))
    u = np.sqrt(np.diag(found.covariance))
    assert u[-1] > 1.1 * u[0]
    assert np.all(np.diff(u[len(when) // 2 + 1 :]) > 0)


def test_wild_readings_and_contradicting_stations_are_named_and_kept(night_01):
    table = night_01.weather
    row = 40
    warmth = table.temperature_c.copy()
    warmth[row] += 5.0
    (note,) = site_air(night_01.site, changed(table, temperature_c=warmth)).notes
    assert note.startswith("temperature: 1 of 288 readings are outliers")
    assert table.station[row] in note
    lying = table.temperature_c + 9.0 * (np.array(table.station) == "WX2")
    (note,) = site_air(night_01.site, changed(table, temperature_c=lying)).notes
    assert note == "temperature: WX1 and WX2 contradict each other, undecided which is wrong; calibrate them"


def test_a_biased_barometer_among_three_is_named(night_01):
    station = night_01.site.weather_station[0]
    site = night_01.site.model_copy(
        update={"weather_station": (*night_01.site.weather_station, station.model_copy(update={"name": "WX3"}))}
    )
    table = night_01.weather
    first = np.flatnonzero(np.array(table.station) == "WX1")
    three = Weather(
        np.concatenate([table.mjd_utc, table.mjd_utc[first]]),
        (*table.station, *("WX3" for _ in first)),
        np.concatenate([table.temperature_c, table.temperature_c[first] + 0.1]),
        np.concatenate([table.pressure_hpa, table.pressure_hpa[first] + 3.0]),
        np.concatenate([table.humidity_percent, table.humidity_percent[first]]),
    )
    (note,) = site_air(site, three).notes
    assert note.startswith("pressure: WX3 reads +2.9")
    assert site_air(site, three, without=("WX3",)).notes == ()


def test_blocks_of_minutes_give_the_same_paths(night_01):
    when, a, b = shots_of(night_01, 60)
    fine, coarse = (site_air(night_01.site, night_01.weather, block=s).along(when, a, b) for s in (0.0, 120.0))
    np.testing.assert_allclose(coarse.refractivity, fine.refractivity, atol=0.03e-6)
    np.testing.assert_allclose(np.diag(coarse.covariance), np.diag(fine.covariance), rtol=0.05)


def test_a_long_night_of_many_readings_is_averaged_by_itself(night_01):
    table = night_01.weather
    rows = np.tile(np.arange(len(table)), 8)
    shift = np.repeat(np.arange(8), len(table)) * 4320.0 / 86_400.0
    long = Weather(
        table.mjd_utc[rows] + shift,
        tuple(table.station[i] for i in rows),
        table.temperature_c[rows],
        table.pressure_hpa[rows],
        table.humidity_percent[rows],
    )
    readings = site_readings(night_01.site, long)
    block = site_air(night_01.site, long).block
    assert 30.0 < block < 60.0  # ten hours of two stations
    assert len(readings.averaged(block).z) <= 2000


def test_names_that_are_no_stations_are_refused(night_01):
    with pytest.raises(InputError, match=r"weather station 'WX9' is not in site\.toml; it has WX1, WX2"):
        site_air(night_01.site, night_01.weather, without=("WX9",))
    with pytest.raises(InputError, match="no weather reading remains without WX1, WX2"):
        site_air(night_01.site, night_01.weather, without=("WX1", "WX2"))
