"""Spikes and stuck sensors: found by hand-made series, and none in fronts, still air and coarse loggers."""

import numpy as np
import pytest

from catseye.reduction.site.plausible.readings import HUMIDITY, PRESSURE, TEMPERATURE, ConstantRun, spikes, stuck

EVERY_S = 30.0


def times(n, every=EVERY_S):
    return every * np.arange(n)


def scattered(n, seed=1, noise=0.05, resolution=0.01):
    values = 11.0 + noise * np.random.default_rng(seed).normal(size=n)
    return np.round(values / resolution) * resolution


@pytest.mark.parametrize(("size", "count"), [(30.0, 1), (-8.0, 1), (5.0, 2), (5.0, 3)])
def test_readings_far_from_both_sides_are_a_spike(size, count):
    values = scattered(60)
    values[20 : 20 + count] += size
    assert spikes(times(60), values, TEMPERATURE).tolist() == list(range(20, 20 + count))


def test_a_front_is_no_spike():
    values = scattered(60)
    values[30:] -= 8.0
    assert not len(spikes(times(60), values, TEMPERATURE))


def test_a_turbulent_day_has_no_spikes():
    values = scattered(400, noise=1.0)
    assert not len(spikes(times(400), values, TEMPERATURE))


def test_the_allowance_grows_with_the_time_between_readings():
    """5 °C within 30 s is none of the air's changes; within 10 minutes a foehn makes them."""
    values = scattered(60)
    values[20] += 5.0
    assert len(spikes(times(60, 30.0), values, TEMPERATURE)) == 1
    assert not len(spikes(times(60, 600.0), values, TEMPERATURE))


def test_pressures_and_humidities_have_limits_of_their_own():
    values = scattered(60)
    values[20] += 10.0
    assert len(spikes(times(60), values, PRESSURE)) == 1
    assert not len(spikes(times(60), values, HUMIDITY))


def test_few_readings_are_left_alone():
    assert not len(spikes(times(4), np.array([1.0, 30.0, 1.0, 1.0]), TEMPERATURE))


def test_a_fine_series_that_stops_is_stuck():
    values = scattered(140)
    values[20:80] = values[20]
    assert stuck(times(140), values, TEMPERATURE) == [ConstantRun(20, 79)]


def test_a_short_pause_is_not():
    values = scattered(140)
    values[20:35] = values[20]
    assert stuck(times(140), values, TEMPERATURE) == []


def test_a_logger_of_a_tenth_repeats_itself_in_still_air():
    """No scatter, and half a degree in two hours: 24 minutes for each reading, of which nothing is said."""
    values = np.round((11.0 - 0.25 * times(240) / 3600.0) * 10.0) / 10.0
    assert stuck(times(240), values, TEMPERATURE, [(times(240), values - 0.3)]) == []


def test_a_coarse_series_is_stuck_where_another_shows_that_the_air_changed():
    """Both cool by 3 °C in an hour; one stands still in it and makes that good in one step."""
    air = 11.0 - 3.0 * np.clip(times(240) - 1800.0, 0.0, 3600.0) / 3600.0
    values = np.round(air * 10.0) / 10.0
    held = values.copy()
    held[60:180] = held[60]
    other = (times(240), values + 0.4)
    assert [(s.first, s.last) for s in stuck(times(240), held, TEMPERATURE, [other])] == [(0, 179)]
    assert stuck(times(240), values, TEMPERATURE, [other]) == []
    assert stuck(times(240), held, TEMPERATURE, [(times(240), held + 0.4)]) == []


def test_a_front_that_reaches_one_station_later_leaves_none_behind():
    """A calm hour at 0.1 °C, then a front of 3 °C that the other station had ten minutes before."""
    values = np.where(times(240) < 3600.0, 11.0, 8.0)
    flicker = 0.1 * (np.arange(240) % 7 == 0)
    other = (times(240), np.where(times(240) < 3000.0, 11.4, 8.4) + flicker)
    assert stuck(times(240), values, TEMPERATURE, [other]) == []


def cooling_other(step=0.0, amount=3.0):
    """Another station that cools evenly in the hour before 5400 s, and by a step then."""
    air = 11.0 - amount * np.clip(times(240) - 1800.0, 0.0, 3600.0) / 3600.0 - step * (times(240) >= 5400.0)
    return times(240), np.round(10.0 * air) / 10.0


@pytest.mark.parametrize(
    ("other", "release", "expected"),
    [
        (cooling_other(), 3.0, 1),
        (cooling_other(step=3.0), 3.0, 0),  # a front reaches both: the air here was calm before it
        (cooling_other(), 0.1, 0),  # a pool of cold air elsewhere: nothing was made good
        (cooling_other(), 9.0, 0),
    ],
)
def test_a_coarse_series_is_stuck_only_if_it_makes_the_others_change_good(other, release, expected):
    values = np.where(times(240) < 5400.0, 11.0, 11.0 - release)
    assert len(stuck(times(240), values, TEMPERATURE, [other])) == expected


def test_a_calm_hour_after_a_turbulent_one_is_no_stuck_sensor():
    """By the turbulent hour 120 repeats are impossible, but a reading of 0.1 °C may rest in calm air."""
    values = scattered(240, noise=0.5, resolution=0.1)
    values[120:] = 11.0
    assert stuck(times(240), values, TEMPERATURE) == []


def test_a_series_smoother_than_its_resolution_may_rest():
    """A filtered sensor of 0.01 °C that repeats four readings of five, and rests for an hour."""
    values = 11.0 + 0.01 * np.minimum(np.arange(240) // 5, 24)
    assert stuck(times(240), values, TEMPERATURE) == []


def test_a_front_that_overshoots_is_no_spike():
    values = scattered(60)
    values[30], values[31:] = 3.0, 8.0
    assert not len(spikes(times(60), values, TEMPERATURE))


def test_a_station_that_never_changes_needs_another_to_contradict_it():
    assert stuck(times(240), np.full(240, 11.0), TEMPERATURE) == []
