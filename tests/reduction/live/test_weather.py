"""Rejection of weather readings: biased, jumping, drifting, silent stations; fronts."""

import math

import numpy as np
import pytest

from catseye.records.night.live import LiveWeather
from catseye.reduction.live.weather import StationWatch

PER_SECOND = 1e8 / 86400.0
T0 = 60635 * 10**8


def read(station, seconds, temperature=10.0, pressure=930.0, humidity=70.0):
    return LiveWeather(station, T0 + round(seconds * PER_SECOND), temperature, pressure, humidity)


def ticks(seconds):
    return T0 + round(seconds * PER_SECOND)


def fed(watch, times, **stations):
    """Replies to each reading, by station; values are functions of s."""
    replies = {name: [] for name in stations}
    for t in times:
        for name, temperature in stations.items():
            replies[name].append(watch.add(read(name, t, temperature(t))))
    return replies


def speaking(watch, seconds):
    return {w.station for w in watch.trusted_readings(ticks(seconds))}


STEPS = np.arange(0.0, 900.0, 10.0)


def test_station_that_jumps_alone_is_rejected_until_it_returns():
    watch = StationWatch(("WX1", "WX2"))
    replies = fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 15.0 if 300 <= t < 600 else 10.0)
    assert not any(replies["WX1"])
    assert [bool(s) for s in replies["WX2"]] == [300 <= t < 600 for t in STEPS]
    assert "WX2 reads 15.0 C, +5.0 C from its last five minutes" in replies["WX2"][30]
    assert speaking(watch, 890.0) == {"WX1", "WX2"}
    assert watch.notes() == ()


def test_rejected_station_is_excluded_and_noted():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:40], WX1=lambda t: 10.0, WX2=lambda t: 15.0 if t >= 300 else 10.0)
    assert speaking(watch, 390.0) == {"WX1"}
    assert len(watch.notes()) == 1
    assert "rejected" in watch.notes()[0]


@pytest.mark.parametrize("step", [1.4, -1.4])
def test_gust_is_not_a_jump(step):
    watch = StationWatch(("WX1", "WX2"))
    replies = fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 10.0 + (step if t >= 300 else 0.0))
    assert not any(replies["WX2"])


def test_warm_front_seen_by_both_stations_is_accepted():
    """4 °C in one minute, as gust fronts bring: each station confirms the other, whichever reports first."""
    watch = StationWatch(("WX1", "WX2"))

    def front(t):
        return 10.0 + 4.0 * min(max((t - 300.0) / 60.0, 0.0), 1.0)

    fed(watch, STEPS, WX1=front, WX2=front)
    trusted = watch.trusted_readings(ticks(890.0))
    assert {w.station for w in trusted} == {"WX1", "WX2"}
    assert watch.notes() == ()
    last = {w.station: w for w in trusted}
    assert last["WX1"].temperature_c == last["WX2"].temperature_c == 14.0


def test_evening_cooling_by_five_degrees_an_hour_is_accepted():
    watch = StationWatch(("WX1", "WX2"))
    replies = fed(watch, np.arange(0.0, 3600.0, 10.0), WX1=lambda t: 10.0 - t / 720.0, WX2=lambda t: 12.0 - t / 720.0)
    assert not any(replies["WX1"] + replies["WX2"])


def test_slow_drift_is_accepted_because_only_jumps_are_detected():
    """2 °C an hour stays within what air does; it is the adjustment's thermometer offsets that must find it."""
    watch = StationWatch(("WX1", "WX2"))
    replies = fed(watch, np.arange(0.0, 3600.0, 10.0), WX1=lambda t: 10.0, WX2=lambda t: 10.0 + t / 1800.0)
    assert not any(replies["WX2"])


def test_single_station_is_accepted_again_after_ten_minutes():
    watch = StationWatch(("WX1",))
    replies = fed(watch, np.arange(0.0, 1500.0, 10.0), WX1=lambda t: 10.0 if t < 300 else 16.0)["WX1"]
    doubted = [t for t, s in zip(np.arange(0.0, 1500.0, 10.0), replies, strict=True) if s]
    assert doubted[0] == 300.0
    assert doubted[-1] == pytest.approx(900.0, abs=10.0)
    assert {w.temperature_c for w in watch.trusted_readings(ticks(1490.0))} == {16.0}


def test_silent_station_is_not_used_for_comparison():
    """A station that spoke an hour ago cannot say that the other one jumps."""
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:30], WX1=lambda t: 10.0, WX2=lambda t: 10.0)
    replies = fed(watch, np.arange(4000.0, 5600.0, 10.0), WX1=lambda t: 10.0 if t < 4400 else 16.0)["WX1"]
    assert any(replies)
    assert not replies[-1]
    assert watch.trusted_readings(ticks(5590.0))[-1].temperature_c == 16.0


def test_station_is_dropped_after_half_an_hour_of_silence():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:30], WX1=lambda t: 10.0, WX2=lambda t: 10.0)
    fed(watch, np.arange(300.0, 4000.0, 10.0), WX1=lambda t: 10.0)
    assert speaking(watch, 290.0 + 1790.0) == {"WX1", "WX2"}
    assert speaking(watch, 290.0 + 1810.0) == {"WX1"}


def test_old_readings_are_used_rather_than_none():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:30], WX1=lambda t: 10.0, WX2=lambda t: 10.0)
    assert speaking(watch, 10 * 3600.0) == {"WX1", "WX2"}
    assert StationWatch(("WX1",)).trusted_readings(ticks(0.0)) == []


@pytest.mark.parametrize("sensor", [1, 2, 3])
def test_missing_sensor_value_is_reported(sensor):
    values = [10.0, 930.0, 70.0]
    values[sensor - 1] = math.nan
    watch = StationWatch(("WX1",))
    assert "is missing" in watch.add(read("WX1", 0.0, *values))
    assert watch.trusted_readings(ticks(0.0)) == []


@pytest.mark.parametrize("values", [(61, 930, 70), (-61, 930, 70), (10, 499, 70), (10, 1101, 70), (10, 930, 101)])
def test_impossible_values_are_reported(values):
    replies = StationWatch(("WX1",)).add(read("WX1", 0.0, *values))
    assert "out of range" in replies
    assert "WX1" in replies


def test_late_readings_and_unknown_stations_are_rejected():
    watch = StationWatch(("WX1",))
    assert watch.add(read("WX1", 100.0)) == ""
    for late in (90.0, 100.0):
        assert "older than the last one" in watch.add(read("WX1", late))
    assert watch.add(read("WX9", 0.0)) == "unknown station WX9 (site.toml has WX1)"
    assert len(watch.trusted_readings(ticks(100.0))) == 1


def test_readings_are_kept_for_two_hours():
    watch = StationWatch(("WX1",))
    fed(watch, np.arange(0.0, 4 * 3600.0, 60.0), WX1=lambda t: 10.0)
    readings = watch.trusted_readings(ticks(4 * 3600.0))
    assert len(readings) == 121
    assert np.all(np.diff([w.ticks for w in readings]) > 0)


def test_humidity_in_fractions_of_one_is_noted_with_both_readings():
    watch = StationWatch(("WX1", "WX2"))
    for t in STEPS:
        assert watch.add(read("WX1", t, humidity=0.62)) == ""
        assert watch.add(read("WX2", t, humidity=61.0)) == ""
    [note] = watch.notes()
    assert note.startswith("WX1's hygrometer reads 0.62 %")
    assert "62 %" in note


def test_pressure_reduced_to_sea_level_is_noted_where_the_elevation_is_known():
    watch = StationWatch(("WX1", "WX2"), {"WX1": 804.0, "WX2": 850.0})
    for t in STEPS:
        assert watch.add(read("WX1", t, pressure=1020.0)) == ""
        assert watch.add(read("WX2", t, pressure=925.0)) == ""
    [note] = watch.notes()
    assert note.startswith("WX1's barometer reads 1020.0 hPa at 804 m")
    assert "reduced to sea level" in note


def scattered(t):
    return round(10.0 + 0.05 * float(np.random.default_rng(round(t)).normal()), 2)


def test_stuck_sensor_is_rejected_since_it_stopped_until_it_moves_again():
    """Readings of 0.05 °C of scatter stop at 600 s; half an hour later they come back."""
    watch = StationWatch(("WX1", "WX2"))
    times = np.arange(0.0, 4800.0, 10.0)
    replies = fed(watch, times, WX1=scattered, WX2=lambda t: scattered(t if not 600.0 <= t < 2400.0 else 600.0))
    assert not any(replies["WX1"])
    rejected = times[[bool(reply) for reply in replies["WX2"]]]
    assert 1200.0 <= rejected[0] < 1500.0
    assert rejected[-1] == 2390.0
    assert "its sensor is stuck, rejected" in replies["WX2"][200]
    [stretch] = watch.stretches()
    assert (stretch.station, stretch.first) == ("WX2", ticks(610.0))
    assert ticks(2390.0) <= stretch.last < ticks(2400.0)
    assert not any(
        ticks(610.0) <= w.ticks < ticks(2400.0) for w in watch.trusted_readings(ticks(4800.0)) if w.station == "WX2"
    )
    assert speaking(watch, 4790.0) == {"WX1", "WX2"}


def test_calm_air_in_a_coarse_logger_is_not_a_stuck_sensor():
    watch = StationWatch(("WX1",))
    replies = fed(watch, np.arange(0.0, 7200.0, 10.0), WX1=lambda t: round(10.0 - t / 36000.0, 1))
    assert not any(replies["WX1"])


def test_later_readings_are_discarded_when_the_clock_is_set_back():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, np.arange(0.0, 600.0, 10.0), WX1=lambda t: 10.0, WX2=lambda t: 10.0)
    fed(watch, np.arange(610.0, 900.0, 10.0), WX1=lambda t: 14.0, WX2=lambda t: 10.0)
    assert speaking(watch, 900.0) == {"WX2"}
    assert watch.add(read("WX2", 605.0)) != ""  # an earlier time
    watch.forget_after(ticks(600.0))
    assert watch.add(read("WX2", 605.0)) == ""
    assert watch.add(read("WX1", 605.0)) == ""  # its jump was discarded
    assert {w.ticks for w in watch.trusted_readings(ticks(610.0))} == {
        *map(ticks, np.arange(0.0, 600.0, 10.0)),
        ticks(605.0),
    }


def at_heights(**heights):
    return StationWatch(tuple(heights), heights)


def test_station_contradicted_by_two_others_is_rejected_from_its_first_reading():
    watch = at_heights(WX1=800.0, WX2=850.0, WX3=805.0)
    replies = fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 10.2, WX3=lambda t: 14.0)
    assert not any(replies["WX1"] + replies["WX2"])
    assert "beyond any plausible gradient to WX1 and WX2, which agree with each other" in replies["WX3"][-1]
    assert speaking(watch, 890.0) == {"WX1", "WX2"}
    [stretch] = watch.stretches()
    assert (stretch.station, stretch.first, stretch.last) == ("WX3", ticks(0.0), None)


def test_inversion_across_three_stations_is_accepted():
    watch = at_heights(WX1=800.0, WX2=850.0, WX3=805.0)
    replies = fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 12.0, WX3=lambda t: 10.4)
    assert not any(replies["WX1"] + replies["WX2"] + replies["WX3"])


def test_station_is_accepted_once_it_agrees_again():
    watch = at_heights(WX1=800.0, WX2=850.0, WX3=805.0)
    fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 10.2, WX3=lambda t: 14.0 if t < 400 else 10.1)
    assert speaking(watch, 890.0) == {"WX1", "WX2", "WX3"}
    assert {w.temperature_c for w in watch.trusted_readings(ticks(890.0)) if w.station == "WX3"} == {10.1}
    assert watch.moved() == {"WX3"}
    assert watch.moved() == frozenset()
    [stretch] = watch.stretches()
    assert (stretch.first, stretch.last) == (ticks(0.0), ticks(400.0) - 1)


@pytest.mark.parametrize("size", [2.0, -2.0, 0.9, 5.0])
def test_step_that_removes_a_suspected_bias_ends_it(size):
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:60], WX1=lambda t: 10.0 + size, WX2=lambda t: 10.0)
    watch.judged({"WX1": (size + 0.2, True)})
    replies = fed(watch, STEPS[60:], WX1=lambda t: 10.0, WX2=lambda t: 10.0)["WX1"]
    assert not any(replies[2:]), "from the third reading on"
    assert {w.temperature_c for w in watch.trusted_readings(ticks(890.0))} == {10.0}
    [stretch] = watch.stretches()
    assert (stretch.first, stretch.last) == (ticks(0.0), ticks(600.0) - 1)
    assert stretch.offset_c == size + 0.2
    assert watch.moved() == {"WX1"}


def test_slow_change_does_not_end_a_suspected_bias():
    """An inversion that breaks up in ten minutes takes away what the stations were apart by."""
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:60], WX1=lambda t: 10.0, WX2=lambda t: 12.5)
    watch.judged({"WX2": (2.5, False)})
    after = np.arange(600.0, 1800.0, 10.0)
    fed(watch, after, WX1=lambda t: 10.0, WX2=lambda t: 12.5 - 2.5 * min((t - 600.0) / 600.0, 1.0))
    assert watch.stretches() == ()


def test_small_jump_stays_rejected_as_time_passes():
    """2 °C more than before for five minutes: after 250 s the watch took them for the air's own change."""
    watch = StationWatch(("WX1", "WX2"))
    replies = fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 12.0 if 300 <= t < 700 else 10.0)
    assert [bool(s) for s in replies["WX2"]] == [300 <= t < 700 for t in STEPS]
    [stretch] = watch.stretches()
    assert (stretch.first, stretch.last) == (ticks(300.0), ticks(700.0) - 1)


def test_level_accepted_in_the_end_has_a_new_offset():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, np.arange(0.0, 3000.0, 10.0), WX1=lambda t: 10.0, WX2=lambda t: 12.0 if t >= 300 else 10.0)
    assert speaking(watch, 2990.0) == {"WX1", "WX2"}
    assert {w.temperature_c for w in watch.trusted_readings(ticks(2990.0)) if w.station == "WX2"} == {12.0}
    assert watch.moved() == {"WX2"}


def test_station_contradicted_by_the_ranges_has_an_ongoing_biased_period():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS, WX1=lambda t: 12.0, WX2=lambda t: 10.0)
    watch.judged({"WX1": (1.7, True)})
    [stretch] = watch.stretches()
    assert (stretch.station, stretch.first, stretch.last, stretch.offset_c) == ("WX1", ticks(0.0), None, 1.7)
    watch.judged({"WX1": (1.7, False)})
    assert watch.stretches() == ()
