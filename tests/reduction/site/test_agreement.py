"""Two records of one thing: told where they cannot both be right, accused only where height and standard air decide."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.reduction.site.agreement import StationSeries, distance_disagreement, weather_disagreements

WHEN = 60000.0 + np.arange(20) / 288.0


def standard_hpa(elevation_m):
    """[ICAO93], by hand: 1013.25 (1 - 2.25577e-5 h)^5.25588."""
    return 1013.25 * (1.0 - 2.25577e-5 * elevation_m) ** 5.25588


def station(name, elevation_m, *, high_hpa=0.0, humidity=60.0, offset_hpa=0.0):
    """A station in standard air, high_hpa above it at sea level."""
    ratio = standard_hpa(elevation_m) / standard_hpa(0.0)
    pressure = standard_hpa(elevation_m) + high_hpa * ratio + offset_hpa
    warm = 15.0 - 0.0065 * elevation_m
    wave = 0.3 * np.sin(np.arange(20))
    return StationSeries(
        name, elevation_m, WHEN, np.full(20, warm), pressure + wave, np.full(20, humidity), u_elevation_m=0.5
    )


@pytest.mark.parametrize("rise", [0.0, 46.0, 150.0, -300.0])
@pytest.mark.parametrize("high", [-40.0, 0.0, 30.0])
def test_honest_stations_agree_at_any_height_and_in_any_weather(rise, high):
    assert weather_disagreements([station("A", 806.0, high_hpa=high), station("B", 806.0 + rise, high_hpa=high)]) == ()


def test_a_barometer_set_to_sea_level_is_named_with_its_size():
    """At 806 m it shows the pressure reduced to the sea: 1013 hPa, which reduced once more is beyond all weather."""
    wrong = replace(station("B", 806.0), pressure_hpa=np.full(20, standard_hpa(0.0) + 5.0))
    (found,) = [d for d in weather_disagreements([station("A", 800.0), wrong]) if d.what == "barometers"]
    assert abs(found.difference) == pytest.approx(standard_hpa(0.0) + 5.0 - standard_hpa(806.0), abs=0.5)
    assert found.accused == "B"
    assert "disagree by 98" in found.text
    assert found.u < 1.0


@pytest.mark.parametrize("offset", [-12.0, 6.0, 20.0])
def test_where_height_and_standard_air_do_not_decide_none_is_accused(offset):
    (found,) = [
        d
        for d in weather_disagreements([station("A", 800.0), station("B", 850.0, offset_hpa=offset)])
        if d.what == "barometers"
    ]
    assert found.difference == pytest.approx(-offset, abs=0.2)
    assert found.accused == ""
    assert "do not decide which" in found.text


def test_order_does_not_matter():
    pair = [station("A", 800.0), station("B", 850.0, offset_hpa=9.0)]
    one, other = (weather_disagreements(p)[0].difference for p in (pair, pair[::-1]))
    assert one == pytest.approx(-other, abs=0.2)


def test_two_hygrometers_that_cannot_both_be_right():
    dry, damp = station("A", 800.0, humidity=25.0), station("B", 820.0, humidity=75.0)
    (found,) = weather_disagreements([dry, damp])
    assert (found.what, found.accused) == ("hygrometers", "")
    # mixing ratio held over 20 m of standard air: by Magnus' formula, 0.13 K colder is 0.9 % drier air's worth
    expected = 25.0 * np.exp(17.502 * 9.8 / 250.77 - 17.502 * 9.67 / 250.64) * standard_hpa(820) / standard_hpa(800)
    assert found.difference == pytest.approx(expected - 75.0, abs=0.1)
    assert weather_disagreements([station("A", 800.0, humidity=60.0), station("B", 820.0, humidity=66.0)]) == ()


def test_stations_that_were_never_read_together_are_not_compared():
    later = replace(station("B", 800.0, offset_hpa=50.0), mjd=WHEN + 3.0)
    assert weather_disagreements([station("A", 800.0), later]) == ()


@pytest.mark.parametrize(("factor", "looks"), [(1e3, "millimetres"), (0.3048, "feet"), (1.0 / 0.3048, "feet")])
def test_a_distance_in_another_unit_is_named(factor, looks):
    ends = np.array([[0.0, 0.0, 0.0], [30.0, 40.0, 0.0]])
    found = distance_disagreement(("A", "B"), 50.0 * factor, 1e-4, ends=ends, covariance=1e-8 * np.eye(6))
    assert looks in found.text
    assert found.difference == pytest.approx((50.0 * factor - 50.0) * 1e3)
    assert found.u == pytest.approx(np.sqrt(1e-8 + 2e-8) * 1e3)


def test_a_distance_within_five_u_agrees_and_beyond_it_is_undecided():
    ends = np.array([[0.0, 0.0, 0.0], [30.0, 40.0, 0.0]])
    u = np.sqrt(3e-8)
    for off, told in ((4.9 * u, False), (5.1 * u, True)):
        found = distance_disagreement(("A", "B"), 50.0 + off, 1e-4, ends=ends, covariance=1e-8 * np.eye(6))
        assert (found is not None) == told
    assert found.accused == ""
