"""The registry, the refusals and the collected answer."""

import dataclasses

import numpy as np
import pytest

from catseye.atmosphere.index.air import (
    MODELS,
    air,
    air_of_vapour,
    group_partials,
    group_refractivity,
    phase_refractivity,
)
from catseye.atmosphere.weather import humidity
from catseye.errors import ValidityError
from catseye.names import AIR_MODELS

GOOD = {"temperature_c": 20.0, "pressure_hpa": 933.0, "humidity_percent": 50.0}
REFUSED = [
    ({"wavelength_um": 10.6}, "wavelength 10.6 um is outside 0.30-1.69 um, where [CIDDOR96] holds"),
    ({"temperature_c": 120.0}, "temperature 120 C is outside -40 to 100 C, where [CIDDOR96] holds"),
    ({"temperature_c": 293.15}, "temperature 293.15 C is outside -40 to 100 C, where [CIDDOR96] holds"),
    ({"pressure_hpa": 93300.0}, "pressure 93300 hPa is outside 100-1400 hPa, where [CIDDOR96] holds"),
    ({"pressure_hpa": -1.0}, "pressure -1 hPa is outside 100-1400 hPa, where [CIDDOR96] holds"),
    ({"humidity_percent": 100.1}, "relative humidity 100.1 % is outside 0-100 %, where [CIDDOR96] holds"),
    (
        {"humidity_percent": 100.0000001},
        "relative humidity 100.0000001 % is outside 0-100 %, where [CIDDOR96] holds",
    ),
    ({"humidity_percent": -0.1}, "relative humidity -0.1 % is outside 0-100 %, where [CIDDOR96] holds"),
    ({"co2_ppm": 5000.0}, "carbon dioxide 5000 ppm is outside 0-2000 ppm, where [CIDDOR96] holds"),
    (
        {"model": "rueger1990", "pressure_hpa": 499.0},
        "pressure 499 hPa is outside 500-1100 hPa, where [RUEGER90] holds",
    ),
    ({"model": "rueger1990", "temperature_c": 51.0}, "temperature 51 C is outside -40 to 50 C, where [RUEGER90] holds"),
    ({"temperature_c": float("nan")}, "temperature is not a number; give a value in -40 to 100 C"),
    ({"temperature_c": float("inf")}, "temperature inf C is outside -40 to 100 C, where [CIDDOR96] holds"),
    (
        {"humidity_percent": [50.0, float("nan")]},
        "relative humidity is not a number (element 1 of 2); give a value in 0-100 %",
    ),
    (
        {"temperature_c": [20.0, 21.0, 212.0]},
        "temperature 212 C (element 2 of 3) is outside -40 to 100 C, where [CIDDOR96] holds",
    ),
    (
        {"temperature_c": 95.0, "humidity_percent": 100.0, "pressure_hpa": 500.0},
        "vapour's share of the pressure 170.397 % is outside 0-100 %, where [CIDDOR96] holds",
    ),
    (
        {"temperature_c": [20.0, -300.0, 212.0]},
        "temperature -300 C (element 1 of 3, and 1 more) is outside -40 to 100 C, where [CIDDOR96] holds",
    ),
    (
        {"model": "iag1999_closed", "wavelength_um": 1.71},
        "wavelength 1.71 um is outside 0.36-1.70 um, where [IAG99] holds",
    ),
    (
        {"model": "barrell_sears1963", "pressure_hpa": 101325.0},
        "pressure 101325 hPa is outside 500-1100 hPa, where [RUEGER90] holds",
    ),
    (
        {"model": "edlen"},
        f"air model 'edlen' is unknown; choose one of {', '.join(AIR_MODELS)}",
    ),
]


@pytest.mark.parametrize(("change", "text"), REFUSED, ids=[text[:60] for _, text in REFUSED])
@pytest.mark.parametrize("function", [group_refractivity, phase_refractivity, air])
def test_a_value_outside_the_limits_is_refused_in_one_line(function, change, text):
    with pytest.raises(ValidityError) as refusal:
        function(**{**GOOD, **change})
    assert str(refusal.value) == text


def test_an_array_is_refused_with_the_mask_of_the_offending_places():
    temperature = np.array([[20.0, np.nan, 300.0], [-300.0, 0.0, 10.0]])
    for function in (group_refractivity, phase_refractivity, air):
        with pytest.raises(ValidityError) as refusal:
            function(temperature, 933.0, 50.0)
        np.testing.assert_array_equal(refusal.value.mask, [[False, True, True], [True, False, False]])
    with pytest.raises(ValidityError) as refusal:
        group_refractivity(300.0, 933.0, 50.0)
    assert refusal.value.mask is None


@pytest.mark.parametrize("argument", ["temperature_c", "pressure_hpa", "humidity_percent"])
@pytest.mark.parametrize("model", MODELS)
def test_a_large_array_is_refused_as_a_small_one_is(model, argument):
    """Large arrays go through the compiled form, which only says that something is wrong."""
    weather = {name: np.full(300_000, value) for name, value in GOOD.items()}
    weather[argument][[7, 20_000]] = np.nan, 1e6
    with pytest.raises(ValidityError, match=r"is not a number \(element 7 of 300000, and 1 more\)") as refusal:
        group_refractivity(**weather, model=model)
    assert np.flatnonzero(refusal.value.mask).tolist() == [7, 20_000]


def both_of_vapour(*weather):
    state = air_of_vapour(*weather)
    return state.group_refractivity, state.phase_refractivity


@pytest.mark.parametrize("function", [both_of_vapour, group_partials])
def test_vapour_that_cannot_be_is_refused(function):
    assert np.all(np.isfinite(function(20.0, 933.0, 0.0)))
    assert np.all(np.isfinite(function(20.0, 933.0, 23.4646)))  # saturated by the notes' formula, 0.07 % over Ciddor's
    with pytest.raises(ValidityError, match="vapour pressure -1 hPa is outside"):
        function(20.0, 933.0, -1.0)
    with pytest.raises(ValidityError, match="vapour pressure over saturation"):
        function(20.0, 933.0, 25.0)
    with pytest.raises(ValidityError, match="vapour's share of the pressure"):
        function(100.0, 600.0, 900.0)
    with pytest.raises(ValidityError, match="vapour pressure is not a number"):
        function(20.0, 933.0, float("nan"))


def test_carbon_dioxide_not_in_a_model_is_reported_and_not_used():
    assert air(**GOOD, co2_ppm=600.0).co2_ppm == 600.0
    for model, fixed in (("rueger1990", 300.0), ("iag1999_closed", 375.0), ("barrell_sears1963", 300.0)):
        told = air(**GOOD, model=model, co2_ppm=600.0)
        assert told.co2_ppm == fixed
        assert told.sensitivity.co2_ppm == 0.0
        assert told.group_refractivity == air(**GOOD, model=model).group_refractivity


def test_a_modulation_of_zero_is_refused():
    with pytest.raises(ValidityError, match="modulation frequency 0 Hz"):
        air(20.0, 933.0, 50.0, modulation_hz=0.0)


@pytest.mark.parametrize("model", MODELS)
def test_every_limit_itself_is_legal(model):
    limits = MODELS[model].limits
    for end in ("lower", "upper"):
        for argument, limit in limits.items():
            # at both ends of everything else the vapour would fill the air; one limit at a time
            value = air(**{**GOOD, "model": model, argument: getattr(limit, end)})
            assert np.isfinite(value.group_refractivity), argument


@pytest.mark.parametrize("model", MODELS)
def test_zero_celsius_and_zero_humidity_are_legal(model):
    dry = air(0.0, 1013.25, 0.0, model=model)
    assert dry.vapour_pressure_hpa == 0.0
    assert np.isnan(dry.dew_point_c)
    # at 0 °C dry air is heavier than at 15 °C by 288.15/273.15, to its compressibility (2e-4)
    warm = air(15.0, 1013.25, 0.0, model=model)
    assert dry.group_refractivity / warm.group_refractivity == pytest.approx(288.15 / 273.15, rel=3e-4)


def test_the_registry_names_each_model_as_the_model_names_itself():
    for name, model in MODELS.items():
        assert model.name == name
        assert model.vapour_formula in humidity.FORMULAS
        assert 0.0 < model.standard_uncertainty < 1e-6
        assert set(model.limits) == {"temperature_c", "pressure_hpa", "humidity_percent", "wavelength_um", "co2_ppm"}


def test_the_default_model_is_todays():
    assert group_refractivity(**GOOD) == group_refractivity(**GOOD, model="ciddor_hill1999")
    assert air(**GOOD).model == "ciddor_hill1999"


@pytest.mark.parametrize("model", MODELS)
def test_the_collected_answer_agrees_with_the_single_functions(model):
    answer = air(**GOOD, model=model, wavelength_um=0.85, modulation_hz=1.0e9)
    light = {"model": model, "wavelength_um": 0.85}
    assert answer.group_refractivity == group_refractivity(**GOOD, **light)
    assert answer.phase_refractivity == phase_refractivity(**GOOD, **light)
    assert answer.group_index == 1.0 + answer.group_refractivity
    assert answer.group_wavelength * answer.group_index * 1.0e9 == pytest.approx(299_792_458.0, rel=1e-15)
    vapour = (GOOD["temperature_c"], GOOD["pressure_hpa"], answer.vapour_pressure_hpa)
    of_vapour = air_of_vapour(*vapour, **light)
    assert answer.group_refractivity == of_vapour.group_refractivity
    assert answer.phase_refractivity == of_vapour.phase_refractivity
    assert answer.sensitivity.vapour_pressure_hpa == group_partials(*vapour, **light).vapour_pressure_hpa
    with pytest.raises(dataclasses.FrozenInstanceError):
        answer.model = "other"


def test_inputs_add_their_share_to_the_uncertainty_whatever_their_sign():
    """At 20 °C, 933 hPa, 50 %: -0.8921 ppm/K, 0.2720 ppm/hPa, -0.008253 ppm/%, as facts of the model tested above."""
    state = air(20.0, 933.0, 50.0)
    by_hand = np.sqrt(0.05**2 + (0.8921 * 0.3) ** 2 + (0.2720 * 0.5) ** 2 + (0.008253 * 10.0) ** 2)
    assert state.combined_uncertainty(0.3, 0.5, 10.0) * 1e6 == pytest.approx(by_hand, rel=1e-4)
    assert state.combined_uncertainty(0.0, 0.0, 0.0) == pytest.approx(5e-8)
    carbon_dioxide = state.combined_uncertainty(u_co2_ppm=100.0)  # 0.01338 ppm: 0.534e-4 of the dry 250.6
    assert carbon_dioxide * 1e6 == pytest.approx(np.hypot(0.05, 0.01338), rel=1e-4)
    laser = state.combined_uncertainty(u_wavelength_um=0.002)  # 253 ppm falls by 0.0185 ppm a nm at 0.78 um
    assert laser * 1e6 == pytest.approx(np.hypot(0.05, 0.0369), rel=2e-3)
