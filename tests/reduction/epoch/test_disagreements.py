"""Stations of a campaign that contradict each other: told in its notes, and no answer that rests on them is good."""

import dataclasses

import numpy as np
import pytest

from catseye.reduction.epoch.epoch import reduce_epoch


def with_offset(campaign, station, **offset):
    weather = campaign.weather
    own = np.array(weather.station) == station
    changed = {name: getattr(weather, name) + np.where(own, value, 0.0) for name, value in offset.items()}
    return dataclasses.replace(campaign, weather=dataclasses.replace(weather, **changed))


def test_night_01s_stations_agree(few_01):
    notes = reduce_epoch(few_01).notes
    assert not any("disagree" in note for note in notes)


@pytest.mark.parametrize(
    ("offset", "said"),
    [({"pressure_hpa": 86.0}, "barometers"), ({"humidity_percent": -45.0}, "hygrometers")],
)
def test_disagreeing_stations_are_noted_and_no_single_thermometer_is_blamed(few_01, offset, said):
    reduction = reduce_epoch(with_offset(few_01, "WX2", **offset))
    (note,) = [n for n in reduction.notes if "disagree" in n]
    assert said in note
    assert "WX1" in note
    assert "WX2" in note
    assert reduction.verdict.word != "good"
    assert note in reduction.coordinates.doubts


def test_a_certificate_a_metre_off_is_noted_with_its_ends_typed_places(few_01):
    first, *others = few_01.benchmarks
    longer = first.model_copy(update={"certified_distance_mm": first.certified_distance_mm + 1000.0})
    reduction = reduce_epoch(dataclasses.replace(few_01, benchmarks=(longer, *others)))
    (note,) = [n for n in reduction.notes if "disagree" in n]
    assert "typed distance and coordinates" in note
    assert first.target in note
    assert reduction.verdict.word != "good"


def test_humidity_typed_as_a_fraction_is_doubtful_with_both_readings(few_01):
    weather = dataclasses.replace(few_01.weather, humidity_percent=0.01 * few_01.weather.humidity_percent)
    reduction = reduce_epoch(dataclasses.replace(few_01, weather=weather))
    notes = [n for n in reduction.notes if "as a fraction it would be" in n]
    assert [n.split(": ")[1] for n in notes] == ["WX1", "WX2"]
    assert reduction.verdict.word != "good"
