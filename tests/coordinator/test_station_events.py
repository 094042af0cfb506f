"""Events of weather stations: rejected readings, suspicions, ended biases."""

import math
from types import SimpleNamespace

from catseye.coordinator.station_events import StationEvents
from catseye.records.night.live import LiveWeather
from catseye.reduction.live.thermometers import SuspectedBias
from catseye.reduction.live.weather import BiasedPeriod
from catseye.simulator.clock.world_clock import ManualClock


def answer(doubts=(), returned=(), **biases):
    return SimpleNamespace(doubts=doubts, returned=returned, biases=biases)


def told_of(*answers):
    said = []
    events = StationEvents(ManualClock(60635.0), said.append)
    for each in answers:
        events.solved(each)
    return [(what.who, what.kind) for what in said], said


def test_suspicion_is_logged_at_start_and_end():
    biased = answer(WX1=SuspectedBias("biased", 1.65, 0.13), doubts=("WX1's thermometer is biased",))
    kinds, said = told_of(biased, biased, answer(), answer())
    assert kinds == [
        ("WX1", "weather-biased"),
        ("reduction", "epoch-doubtful"),
        ("WX1", "weather-biased-over"),
        ("reduction", "epoch-doubtful-over"),
    ]
    assert said[0].details["offset_c"] == 1.65
    assert "+1.65 °C (u 0.13 °C)" in said[0].text


def test_undecided_suspicion_is_logged_for_each_station():
    kinds, said = told_of(answer(WX1=SuspectedBias("apart", -2.5, 1.4), WX2=SuspectedBias("apart", 2.5, 1.4)))
    assert kinds == [("WX1", "weather-apart"), ("WX2", "weather-apart")]
    assert [what.details["offset_c"] for what in said] == [-2.5, 2.5]


def test_rejected_station_is_not_cleared_by_its_absence_from_an_epoch():
    said = []
    events = StationEvents(ManualClock(60635.0), said.append)
    events.solved(answer(WX1=SuspectedBias("biased", 1.65, 0.13)))
    events.read(LiveWeather("WX1", 1, 10.0, 930.0, 50.0), "WX1 reads 10.0 C: not believed")
    events.solved(answer())
    assert [what.kind for what in said] == ["weather-biased", "weather-doubted"]
    events.read(LiveWeather("WX1", 2, 10.0, 930.0, 50.0), "")
    events.solved(answer())
    assert [what.kind for what in said][2:] == ["weather-doubted-over", "weather-biased-over"]


def test_end_of_a_bias_is_logged_with_its_size():
    _, said = told_of(answer(returned=(BiasedPeriod("WX2", 1, 9, 4.8, "WX2 was biased by +4.8 °C until then"),)))
    assert (said[0].who, said[0].kind, said[0].details["offset_c"]) == ("WX2", "weather-returned", 4.8)
    assert not math.isnan(said[0].details["offset_c"])
