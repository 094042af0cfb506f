"""Which weather readings are believed: stations that lie, jump, drift, fall silent; fronts that all of them see."""

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
    """What was said to each reading, by station; values are functions of s."""
    said = {name: [] for name in stations}
    for t in times:
        for name, temperature in stations.items():
            said[name].append(watch.add(read(name, t, temperature(t))))
    return said


def speaking(watch, seconds):
    return {w.station for w in watch.believed(ticks(seconds))}


STEPS = np.arange(0.0, 900.0, 10.0)


def test_a_station_that_jumps_while_another_does_not_is_doubted_until_it_is_back():
    watch = StationWatch(("WX1", "WX2"))
    said = fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 15.0 if 300 <= t < 600 else 10.0)
    assert not any(said["WX1"])
    assert [bool(s) for s in said["WX2"]] == [300 <= t < 600 for t in STEPS]
    assert "WX2 reads 15.0 C, +5.0 C off its last five minutes" in said["WX2"][30]
    assert speaking(watch, 890.0) == {"WX1", "WX2"}
    assert watch.notes() == ()


def test_while_it_is_doubted_none_of_its_readings_count_and_a_note_says_so():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:40], WX1=lambda t: 10.0, WX2=lambda t: 15.0 if t >= 300 else 10.0)
    assert speaking(watch, 390.0) == {"WX1"}
    assert len(watch.notes()) == 1
    assert "not believed" in watch.notes()[0]


@pytest.mark.parametrize("step", [1.4, -1.4])
def test_what_a_gust_does_is_no_jump(step):
    watch = StationWatch(("WX1", "WX2"))
    said = fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 10.0 + (step if t >= 300 else 0.0))
    assert not any(said["WX2"])


def test_a_warm_front_that_both_see_is_believed_of_both():
    """4 °C in one minute, as gust fronts bring: each station is the other's witness, whichever speaks first."""
    watch = StationWatch(("WX1", "WX2"))

    def front(t):
        return 10.0 + 4.0 * min(max((t - 300.0) / 60.0, 0.0), 1.0)

    fed(watch, STEPS, WX1=front, WX2=front)
    found = watch.believed(ticks(890.0))
    assert {w.station for w in found} == {"WX1", "WX2"}
    assert watch.notes() == ()
    last = {w.station: w for w in found}
    assert last["WX1"].temperature_c == last["WX2"].temperature_c == 14.0


def test_an_evening_that_cools_by_five_degrees_an_hour_is_no_lie():
    watch = StationWatch(("WX1", "WX2"))
    said = fed(watch, np.arange(0.0, 3600.0, 10.0), WX1=lambda t: 10.0 - t / 720.0, WX2=lambda t: 12.0 - t / 720.0)
    assert not any(said["WX1"] + said["WX2"])


def test_a_slow_lie_is_believed_as_the_watch_only_sees_jumps():
    """2 °C an hour stays within what air does; it is the adjustment's thermometer offsets that must find it."""
    watch = StationWatch(("WX1", "WX2"))
    said = fed(watch, np.arange(0.0, 3600.0, 10.0), WX1=lambda t: 10.0, WX2=lambda t: 10.0 + t / 1800.0)
    assert not any(said["WX2"])


def test_alone_a_station_is_doubted_for_ten_minutes_and_then_the_air_has_changed():
    watch = StationWatch(("WX1",))
    said = fed(watch, np.arange(0.0, 1500.0, 10.0), WX1=lambda t: 10.0 if t < 300 else 16.0)["WX1"]
    doubted = [t for t, s in zip(np.arange(0.0, 1500.0, 10.0), said, strict=True) if s]
    assert doubted[0] == 300.0
    assert doubted[-1] == pytest.approx(900.0, abs=10.0)
    assert {w.temperature_c for w in watch.believed(ticks(1490.0))} == {16.0}


def test_a_silent_witness_is_none():
    """A station that spoke an hour ago cannot say that the other one jumps."""
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:30], WX1=lambda t: 10.0, WX2=lambda t: 10.0)
    said = fed(watch, np.arange(4000.0, 5600.0, 10.0), WX1=lambda t: 10.0 if t < 4400 else 16.0)["WX1"]
    assert any(said)
    assert not said[-1]
    assert watch.believed(ticks(5590.0))[-1].temperature_c == 16.0


def test_silence_takes_a_station_out_after_half_an_hour():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:30], WX1=lambda t: 10.0, WX2=lambda t: 10.0)
    fed(watch, np.arange(300.0, 4000.0, 10.0), WX1=lambda t: 10.0)
    assert speaking(watch, 290.0 + 1790.0) == {"WX1", "WX2"}
    assert speaking(watch, 290.0 + 1810.0) == {"WX1"}


def test_old_weather_is_better_than_none():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:30], WX1=lambda t: 10.0, WX2=lambda t: 10.0)
    assert speaking(watch, 10 * 3600.0) == {"WX1", "WX2"}
    assert StationWatch(("WX1",)).believed(ticks(0.0)) == []


@pytest.mark.parametrize("sensor", [1, 2, 3])
def test_a_sensor_that_says_nothing_is_told(sensor):
    values = [10.0, 930.0, 70.0]
    values[sensor - 1] = math.nan
    watch = StationWatch(("WX1",))
    assert "says nothing" in watch.add(read("WX1", 0.0, *values))
    assert watch.believed(ticks(0.0)) == []


@pytest.mark.parametrize("values", [(61, 930, 70), (-61, 930, 70), (10, 499, 70), (10, 1101, 70), (10, 930, 101)])
def test_what_cannot_be_is_told(values):
    said = StationWatch(("WX1",)).add(read("WX1", 0.0, *values))
    assert "cannot be" in said
    assert "WX1" in said


def test_late_readings_and_strangers_are_refused():
    watch = StationWatch(("WX1",))
    assert watch.add(read("WX1", 100.0)) == ""
    for late in (90.0, 100.0):
        assert "earlier time came late" in watch.add(read("WX1", late))
    assert watch.add(read("WX9", 0.0)) == "station WX9 is not in site.toml (expected one of WX1)"
    assert len(watch.believed(ticks(100.0))) == 1


def test_readings_are_kept_for_two_hours():
    watch = StationWatch(("WX1",))
    fed(watch, np.arange(0.0, 4 * 3600.0, 60.0), WX1=lambda t: 10.0)
    kept = watch.believed(ticks(4 * 3600.0))
    assert len(kept) == 121
    assert np.all(np.diff([w.ticks for w in kept]) > 0)


def test_a_station_that_says_fractions_of_one_is_told_with_both_readings():
    watch = StationWatch(("WX1", "WX2"))
    for t in STEPS:
        assert watch.add(read("WX1", t, humidity=0.62)) == ""
        assert watch.add(read("WX2", t, humidity=61.0)) == ""
    [note] = watch.notes()
    assert note.startswith("WX1: a humidity of 0.62 %")
    assert "62 %" in note


def test_what_was_stamped_later_is_forgotten_when_the_clock_is_set_back():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, np.arange(0.0, 600.0, 10.0), WX1=lambda t: 10.0, WX2=lambda t: 10.0)
    fed(watch, np.arange(610.0, 900.0, 10.0), WX1=lambda t: 14.0, WX2=lambda t: 10.0)
    assert speaking(watch, 900.0) == {"WX2"}
    assert watch.add(read("WX2", 605.0)) != ""  # an earlier time
    watch.forget_after(ticks(600.0))
    assert watch.add(read("WX2", 605.0)) == ""
    assert watch.add(read("WX1", 605.0)) == ""  # its jump has not been
    assert {w.ticks for w in watch.believed(ticks(610.0))} == {*map(ticks, np.arange(0.0, 600.0, 10.0)), ticks(605.0)}


def at_heights(**heights):
    return StationWatch(tuple(heights), heights)


def test_of_three_stations_the_one_that_the_others_contradict_is_not_believed_from_its_first_reading():
    watch = at_heights(WX1=800.0, WX2=850.0, WX3=805.0)
    said = fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 10.2, WX3=lambda t: 14.0)
    assert not any(said["WX1"] + said["WX2"])
    assert "beyond what air can be between it and WX1 and WX2, which agree with each other" in said["WX3"][-1]
    assert speaking(watch, 890.0) == {"WX1", "WX2"}
    [stretch] = watch.stretches()
    assert (stretch.station, stretch.first, stretch.last) == ("WX3", ticks(0.0), None)


def test_an_inversion_of_three_stations_is_no_lie():
    watch = at_heights(WX1=800.0, WX2=850.0, WX3=805.0)
    said = fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 12.0, WX3=lambda t: 10.4)
    assert not any(said["WX1"] + said["WX2"] + said["WX3"])


def test_a_station_that_agrees_with_the_others_again_is_believed_from_then_on():
    watch = at_heights(WX1=800.0, WX2=850.0, WX3=805.0)
    fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 10.2, WX3=lambda t: 14.0 if t < 400 else 10.1)
    assert speaking(watch, 890.0) == {"WX1", "WX2", "WX3"}
    assert {w.temperature_c for w in watch.believed(ticks(890.0)) if w.station == "WX3"} == {10.1}
    assert watch.moved() == {"WX3"}
    assert watch.moved() == frozenset()
    [stretch] = watch.stretches()
    assert (stretch.first, stretch.last) == (ticks(0.0), ticks(400.0) - 1)


@pytest.mark.parametrize("size", [2.0, -2.0, 0.9, 5.0])
def test_a_step_that_takes_a_suspected_bias_away_is_its_end(size):
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:60], WX1=lambda t: 10.0 + size, WX2=lambda t: 10.0)
    watch.judged({"WX1": (size + 0.2, True)})
    said = fed(watch, STEPS[60:], WX1=lambda t: 10.0, WX2=lambda t: 10.0)["WX1"]
    assert not any(said[2:]), "from the third reading on"
    assert {w.temperature_c for w in watch.believed(ticks(890.0))} == {10.0}
    [stretch] = watch.stretches()
    assert (stretch.first, stretch.last) == (ticks(0.0), ticks(600.0) - 1)
    assert stretch.offset_c == size + 0.2
    assert watch.moved() == {"WX1"}


def test_a_slow_change_by_as_much_is_no_return():
    """An inversion that breaks up in ten minutes takes away what the stations were apart by."""
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS[:60], WX1=lambda t: 10.0, WX2=lambda t: 12.5)
    watch.judged({"WX2": (2.5, False)})
    after = np.arange(600.0, 1800.0, 10.0)
    fed(watch, after, WX1=lambda t: 10.0, WX2=lambda t: 12.5 - 2.5 * min((t - 600.0) / 600.0, 1.0))
    assert watch.stretches() == ()


def test_a_small_lie_is_not_believed_because_time_passes():
    """2 °C more than before for five minutes: after 250 s the watch took them for the air's own change."""
    watch = StationWatch(("WX1", "WX2"))
    said = fed(watch, STEPS, WX1=lambda t: 10.0, WX2=lambda t: 12.0 if 300 <= t < 700 else 10.0)
    assert [bool(s) for s in said["WX2"]] == [300 <= t < 700 for t in STEPS]
    [stretch] = watch.stretches()
    assert (stretch.first, stretch.last) == (ticks(300.0), ticks(700.0) - 1)


def test_a_level_that_is_believed_in_the_end_has_a_new_offset():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, np.arange(0.0, 3000.0, 10.0), WX1=lambda t: 10.0, WX2=lambda t: 12.0 if t >= 300 else 10.0)
    assert speaking(watch, 2990.0) == {"WX1", "WX2"}
    assert {w.temperature_c for w in watch.believed(ticks(2990.0)) if w.station == "WX2"} == {12.0}
    assert watch.moved() == {"WX2"}


def test_readings_of_a_station_that_the_ranges_contradict_are_a_stretch_that_lasts():
    watch = StationWatch(("WX1", "WX2"))
    fed(watch, STEPS, WX1=lambda t: 12.0, WX2=lambda t: 10.0)
    watch.judged({"WX1": (1.7, True)})
    [stretch] = watch.stretches()
    assert (stretch.station, stretch.first, stretch.last, stretch.offset_c) == ("WX1", ticks(0.0), None, 1.7)
    watch.judged({"WX1": (1.7, False)})
    assert watch.stretches() == ()
