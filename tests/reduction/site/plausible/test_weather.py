"""Weather that no site has is named, with what is done; that of any climate is not."""

import dataclasses

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.site.site import WeatherStation
from catseye.reduction.site.plausible.campaign import plausible_campaign
from reduction.site.plausible.record_scene import implausible_records
from reduction.site.plausible.weather_scene import honest_night, with_elevation

NIGHTS = 250


def changed(campaign, **columns):
    """The campaign with columns of its weather replaced by functions of them, and which rows are WX1's."""
    weather = campaign.weather
    one = np.array([name == "WX1" for name in weather.station])
    new = {name: np.asarray(of(getattr(weather, name), one), dtype=float) for name, of in columns.items()}
    return dataclasses.replace(campaign, weather=dataclasses.replace(weather, **new))


def only(campaign, name="WX1"):
    """The campaign with one of its stations."""
    rows = np.flatnonzero(np.array(campaign.weather.station) == name)
    columns = {
        f.name: tuple(np.array(v)[rows]) if isinstance(v := getattr(campaign.weather, f.name), tuple) else v[rows]
        for f in dataclasses.fields(campaign.weather)
    }
    stations = tuple(s for s in campaign.site.weather_station if s.name == name)
    site = campaign.site.model_copy(update={"weather_station": stations})
    return dataclasses.replace(campaign, site=site, weather=dataclasses.replace(campaign.weather, **columns))


ONE = {  # what WX1 alone says -> quantity, words, largest rest of the change where another station gives it
    "reduced to sea level": ("pressure_hpa", lambda v, one: v + 86.0 * one, "reduced to sea level", 1.0),
    "mmHg": ("pressure_hpa", lambda v, one: np.where(one, v * 0.750062, v), "looks like mmHg, 931", 1.0),
    "Fahrenheit": ("temperature_c", lambda v, one: np.where(one, 1.8 * v + 32.0, v), "degrees Fahrenheit, 11", None),
    "no hygrometer": ("humidity_percent", lambda v, one: v * ~one, "0 % throughout", 3.0),
    "fraction": ("humidity_percent", lambda v, one: np.where(one, v / 100.0, v), "as a fraction it would be 72", 3.0),
}


@pytest.mark.parametrize("what", ONE)
def test_one_stations_mistake_is_named_and_left_out(night_01, what):
    column, of, words, near = ONE[what]
    campaign, (found,) = plausible_campaign(changed(night_01, **{column: of}))
    assert found.owners == ("WX1",)
    assert words in found.note
    assert "left out" in found.note
    if near is None:
        assert [s.name for s in campaign.site.weather_station] == ["WX2"]
        assert set(campaign.weather.station) == {"WX2"}
    else:
        right, now = getattr(night_01.weather, column), getattr(campaign.weather, column)
        assert np.abs(now - right).max() < near


@pytest.mark.parametrize("what", ONE)
@pytest.mark.parametrize("stations", ["all", "one"])
def test_a_mistake_at_every_station_is_refused(night_01, what, stations):
    column, of, words, _ = ONE[what]
    campaign = only(night_01) if stations == "one" else night_01
    wrong = changed(campaign, **{column: lambda v, one: of(v, np.ones_like(one))})
    with pytest.raises(InputError, match=f"^weather.csv: .*{words}") as refusal:
        plausible_campaign(wrong)
    assert ("WX2 likewise" in str(refusal.value)) == (stations == "all")


def test_a_pressure_within_all_weather_is_accused_where_it_is_the_others_at_sea_level(night_01):
    """In a low of 986 hPa a barometer at 804 m set to the sea reads a pressure that a high of 1085 hPa has there."""
    low = changed(night_01, pressure_hpa=lambda v, one: v - 35.0 + 86.0 * one)
    (found,) = implausible_records(low)
    assert found.owners == ("WX1",)
    assert "where WX2 reads 890.9 hPa" in found.note


def test_barometers_apart_by_another_amount_accuse_none(night_01):
    assert implausible_records(changed(night_01, pressure_hpa=lambda v, one: v + 30.0 * one)) == ()


def test_an_elevation_in_feet_is_named(night_01):
    stations = tuple(
        WeatherStation(name=s.name, elevation_m=s.elevation_m / 0.3048) for s in night_01.site.weather_station
    )
    site = night_01.site.model_copy(update={"weather_station": stations})
    with pytest.raises(InputError, match="an elevation_m in feet, 804 m"):
        plausible_campaign(dataclasses.replace(night_01, site=site))


def test_winter_in_fahrenheit_is_named_by_the_other_station(night_01):
    """At -8 °C a thermometer in °F reads 17.6: warm, but 26 °C from the other station."""
    cold = changed(night_01, temperature_c=lambda v, one: np.where(one, 1.8 * (v - 19.0) + 32.0, v - 19.0))
    (found,) = implausible_records(cold)
    assert found.owners == ("WX1",)
    assert "looks like degrees Fahrenheit, -8" in found.note


def test_a_desert_night_in_fahrenheit_is_refused_as_hotter_than_any_air(night_01):
    """14.6 °C is 58.2 °F; with 10 % humidity its dew point would be possible."""
    dry = changed(
        night_01,
        temperature_c=lambda v, one: v - v.mean() + 58.5,
        humidity_percent=lambda v, one: np.full_like(v, 10.0),
    )
    with pytest.raises(
        InputError, match=r"above 57 °C, the hottest air on record: looks like degrees Fahrenheit, 14\.6 °C"
    ):
        plausible_campaign(dry)


def test_a_spike_is_left_out_and_said(night_01):
    def spike(values, _):
        return np.where(np.arange(len(values)) == 100, values + 30.0, values)

    campaign, (found,) = plausible_campaign(changed(night_01, temperature_c=spike))
    assert "a spike; left out" in found.note
    assert "41." in found.note
    assert len(campaign.weather) == len(night_01.weather) - 1
    campaign, (found,) = plausible_campaign(changed(night_01, pressure_hpa=spike))
    assert "pressure_mb" in found.note
    assert np.abs(campaign.weather.pressure_hpa - night_01.weather.pressure_hpa).max() < 0.3


def hold(first, last):
    def of(values, one):
        values, rows = values.copy(), np.flatnonzero(one)[first:last]
        values[rows] = values[rows[0]]
        return values

    return of


def test_a_stuck_thermometer_is_named_and_its_readings_are_left_out(night_01):
    campaign, (found,) = plausible_campaign(changed(night_01, temperature_c=hold(20, 80)))
    assert "WX1's thermometer reads 11" in found.note
    assert "60 times in 29 min" in found.note
    assert campaign.weather.station.count("WX1") == night_01.weather.station.count("WX1") - 59


def test_a_station_stuck_for_most_of_the_night_is_left_out(night_01):
    campaign, (found,) = plausible_campaign(changed(night_01, temperature_c=hold(10, 144)))
    assert "the station is left out" in found.note
    assert set(campaign.weather.station) == {"WX2"}


def test_the_only_thermometer_stuck_is_refused(night_01):
    with pytest.raises(InputError, match="nothing else gives the air's temperature"):
        plausible_campaign(changed(only(night_01), temperature_c=hold(10, 144)))


def test_a_stuck_barometer_is_interpolated(night_01):
    campaign, (found,) = plausible_campaign(changed(night_01, pressure_hpa=hold(20, 80)))
    assert "the sensor was stuck; left out and interpolated" in found.note
    assert np.abs(campaign.weather.pressure_hpa - night_01.weather.pressure_hpa).max() < 0.5


def test_a_hygrometer_at_100_percent_for_hours_is_fog(night_01):
    assert implausible_records(changed(night_01, humidity_percent=lambda v, one: np.full_like(v, 100.0))) == ()


@pytest.mark.parametrize(("elevation", "pressure"), [(0.0, 1013.0), (2835.0, 681.0), (3488.0, 624.0), (4500.0, 577.0)])
def test_mean_pressures_of_places_on_earth_are_plausible(night_01, elevation, pressure):
    """The sea, the South Pole, Vostok by their climate, and the standard atmosphere."""
    rise = {"WX1": 0.0, "WX2": 46.0}
    stations = tuple(WeatherStation(name=n, elevation_m=elevation + r) for n, r in rise.items())
    here = changed(night_01, pressure_hpa=lambda v, one: v - v[0] + pressure)
    assert implausible_records(with_elevation(here, elevation, stations)) == ()


def test_honest_nights_of_any_climate_raise_no_alarm(night_01):
    """2000 of them have none (`NIGHTS` here): -40 to 45 °C, 0 to 4500 m, fog, desert, fronts, still air, 0.5 °C."""
    said = {seed: found for seed in range(NIGHTS) if (found := implausible_records(honest_night(night_01, seed)))}
    assert not said


def test_honest_nights_are_as_wide_as_they_claim(night_01):
    """So that the test before is worth something."""
    nights = [honest_night(night_01, seed) for seed in range(60)]
    temperatures = np.concatenate([n.weather.temperature_c for n in nights])
    assert temperatures.min() < -35.0
    assert temperatures.max() > 35.0
    assert any(np.median(n.weather.humidity_percent) == 100.0 for n in nights)
    assert any(n.weather.humidity_percent.max() < 12.0 for n in nights)
    assert {len(n.site.weather_station) for n in nights} == {1, 2, 3}
    same = [np.mean(np.diff(n.weather.temperature_c) == 0.0) for n in nights]
    assert max(same) > 0.9
