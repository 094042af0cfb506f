"""Records of a campaign that contradict each other or no site has: noted or refused, and no answer on them is good."""

import dataclasses

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.reduction.epoch.epoch import reduce_epoch


def with_offset(campaign, station, **offset):
    weather = campaign.weather
    own = np.array(weather.station) == station
    changed = {name: getattr(weather, name) + np.where(own, value, 0.0) for name, value in offset.items()}
    return dataclasses.replace(campaign, weather=dataclasses.replace(weather, **changed))


def test_night_01s_stations_agree(few_01):
    notes = reduce_epoch(few_01).notes
    assert not any("disagree" in note for note in notes)


def test_disagreeing_stations_are_noted_and_no_single_thermometer_is_blamed(few_01):
    reduction = reduce_epoch(with_offset(few_01, "WX2", humidity_percent=-45.0))
    (note,) = [n for n in reduction.notes if "disagree" in n]
    assert "hygrometers" in note
    assert "WX1" in note
    assert "WX2" in note
    assert reduction.verdict.word != "good"
    assert note in reduction.coordinates.doubts


def test_a_pressure_at_sea_level_is_left_out_and_moves_nothing(few_01, reduced_few_01):
    """WX2's becomes WX1's in the standard atmosphere: 0.1 hPa, 3 um at 100 m; it was 4.4 mm."""
    reduction = reduce_epoch(with_offset(few_01, "WX2", pressure_hpa=86.0))
    (record,) = reduction.implausible
    assert record.owners == ("WX2",)
    assert reduction.notes[0] == record.note == reduction.verdict.why
    assert reduction.verdict.word == "doubtful"
    assert not any("disagree" in note or "thermometer" in note for note in reduction.notes)
    right = reduced_few_01.coordinates
    assert np.abs(reduction.coordinates.x - right.x).max() < 20e-6


def test_an_hour_of_a_stuck_thermometer_is_left_out_and_moves_little(few_01, reduced_few_01):
    weather = few_01.weather
    temperature = weather.temperature_c.copy()
    held = np.flatnonzero(np.array(weather.station) == "WX1")[10:130]
    temperature[held] = temperature[held[0]]
    reduction = reduce_epoch(
        dataclasses.replace(few_01, weather=dataclasses.replace(weather, temperature_c=temperature))
    )
    assert "the sensor was stuck" in reduction.verdict.why
    right = reduced_few_01.coordinates
    u = np.sqrt(np.einsum("...ii->...i", np.array([right.block([n]) for n in right.points])))
    assert np.all(np.abs(reduction.coordinates.x - right.x) <= 0.5 * u)  # one height is held


def test_a_late_clock_is_put_back_and_moves_nothing(few_01, reduced_few_01):
    late = 600.0 / 86_400.0 * (np.array(few_01.shots.ranger) == "ZY103")
    shots = dataclasses.replace(few_01.shots, mjd_utc=few_01.shots.mjd_utc + late)
    reduction = reduce_epoch(dataclasses.replace(few_01, shots=shots))
    assert "ZY103's shots are 600 s later" in reduction.verdict.why
    assert np.abs(reduction.coordinates.x - reduced_few_01.coordinates.x).max() < 5e-6


def test_samples_that_are_all_clipped_are_refused_for_the_gain(few_01):
    strong = np.clip(np.asarray(few_01.frames).astype(np.int32) * 40, -32768, 32767).astype(np.int16)
    with pytest.raises(InputError, match=r"^frames\.npy: 391 of 391 shots .* lower the gain"):
        reduce_epoch(dataclasses.replace(few_01, frames=strong))


def test_a_certificate_a_metre_off_is_noted_with_its_ends_typed_places(few_01):
    first, *others = few_01.benchmarks
    longer = first.model_copy(update={"certified_distance_mm": first.certified_distance_mm + 1000.0})
    reduction = reduce_epoch(dataclasses.replace(few_01, benchmarks=(longer, *others)))
    (note,) = [n for n in reduction.notes if "disagree" in n]
    assert "typed distance and coordinates" in note
    assert first.target in note
    assert reduction.verdict.word != "good"


def test_humidity_typed_as_a_fraction_is_refused_with_both_readings(few_01):
    weather = dataclasses.replace(few_01.weather, humidity_percent=0.01 * few_01.weather.humidity_percent)
    with pytest.raises(InputError, match=r"reads 0\.7\d+ %.* as a fraction it would be 7\d\.\d %.*WX2 likewise"):
        reduce_epoch(dataclasses.replace(few_01, weather=weather))


def test_a_prism_far_off_the_others_surface_is_doubted(night_01, reduced_night_01):
    """A radius typed for its height makes all its ranges 16.6 mm too long, and they agree with each other."""
    assert reduced_night_01.surface.outlying == {}
    prism = night_01.targets["DP022"]
    half = {key: 0.5 * getattr(prism, key) for key in ("height_mm", "hrp_mm", "pc_mm")}
    targets = {**night_01.targets, "DP022": prism.model_copy(update=half)}
    reduction = reduce_epoch(dataclasses.replace(night_01, targets=targets))
    assert list(reduction.surface.outlying) == ["DP022"]
    assert reduction.verdict.word == "doubtful"
    assert "DP022" in reduction.verdict.why
    assert "height_mm" in reduction.verdict.why


def test_a_focal_length_20_mm_long_is_noted(night_01, reduced_night_01):
    assert reduced_night_01.surface.other_focus == 0.0
    design = night_01.site.paraboloid
    longer = design.model_copy(update={"focal_length_mm": design.focal_length_mm + 20.0})
    site = night_01.site.model_copy(update={"paraboloid": longer})
    reduction = reduce_epoch(dataclasses.replace(night_01, site=site))
    assert any("focal_length_mm" in note for note in reduction.notes)
    assert abs(1e3 * reduction.surface.other_focus - design.focal_length_mm) < 5.0


def test_a_scale_that_leans_accuses_no_thermometer_alone(few_01):
    """Light of 0.850 um in the record, not 0.780, is a scale: one of several explanations, within the claim."""
    ranging = few_01.site.ranging.model_copy(update={"wavelength_um": 0.850})
    site = few_01.site.model_copy(update={"ranging": ranging})
    reduction = reduce_epoch(dataclasses.replace(few_01, site=site))
    assert not any("thermometer is biased" in doubt for doubt in reduction.coordinates.doubts)
