"""Index of air and speed of sound by weather: verdicts, stated uncertainties, other formulas."""

import pytest

from catseye.atmosphere.sound.speed import MODELS
from catseye.errors import ArgumentError, ValidityError
from catseye.reduction.air.routes import Moisture, pressure_of
from catseye.reduction.air.sound_speed import sound_by_weather
from catseye.reduction.air.weather_index import index_by_weather


def test_the_verdict_says_which_uncertainties_are_in_u():
    alone = sound_by_weather(20.0, 933.0, 50.0)
    assert alone.verdict == (
        "good",
        "within the limits of parker2004; u is that of the formula only; those of the sensors are not given",
    )
    stated = sound_by_weather(20.0, 933.0, 50.0, u_temperature_c=0.1)
    assert stated.verdict.why.endswith("u includes the formula and temperature; not given: pressure, humidity")
    assert sound_by_weather(20.0, 933.0, 0.5).verdict.word == "doubtful"  # a fraction typed as per cent


def test_every_formula_answers_or_says_its_limit():
    found = sound_by_weather(20.0, 933.0, 50.0, model="real_gas")
    assert set(found.by_formula) == set(MODELS)
    assert found.by_formula["real_gas"].speed == found.state.speed
    cold = sound_by_weather(-30.0, 933.0, 50.0).by_formula
    assert any(isinstance(state, ValidityError) for state in cold.values())


def test_the_misprint_makes_sound_slow_and_the_air_too_warm():
    cost = sound_by_weather(20.0, 933.0, 50.0).misprint
    assert cost.slow_by > 0.0
    assert cost.temperature_read_high_by_c == pytest.approx(cost.slow_by / 0.6, rel=0.05)  # 0.6 m/s a degree


def test_a_stated_barometer_is_in_the_index_u():
    moisture = Moisture("humidity_percent", 50.0)
    pressure = pressure_of(933.0, None, u_pressure_hpa=0.5)
    assert index_by_weather(20.0, pressure, moisture).stated == ("pressure",)
    with pytest.raises(ArgumentError, match="u_surface_c belongs to surface_c"):
        index_by_weather(20.0, pressure, moisture, u_surface_c=0.1)
