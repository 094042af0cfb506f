"""The figure of the index of air: what it shows, what it says in numbers, what it refuses."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from catseye.atmosphere.index.air import MODELS, air, group_refractivity
from catseye.errors import ValidityError
from catseye.gateways.air.air_figures import VARIABLES, StateUncertainty, _draw, air_plot
from catseye.gateways.writers.drawing import Figure
from catseye.names import AIR_MODEL

USUAL = {"u_temperature_c": 0.2, "u_pressure_hpa": 0.3, "u_humidity_percent": 3.0}


@pytest.fixture(scope="module")
def usual():
    return air_plot(20.0, 933.0, 50.0, uncertainty=StateUncertainty(0.2, 0.3, 3.0))


def test_every_variable_and_every_model_is_named_in_the_figure(usual):
    drawn, told = usual
    ElementTree.fromstring(drawn)  # it is well formed
    for words in (
        *(f"{variable.name} ({variable.unit})" for variable in VARIABLES),
        *(model.label for model in MODELS.values()),
        "u of formula",
        "u with inputs",
        "group refractivity 253.319 ppm",
        "−0.8921 ppm per °C here",
    ):
        assert words in drawn
    assert told["not_drawn"] == []
    assert len({model.label for model in MODELS.values()}) == len(MODELS)


def test_the_same_state_gives_the_same_figure(usual):
    assert air_plot(20.0, 933.0, 50.0, uncertainty=StateUncertainty(0.2, 0.3, 3.0))[0] == usual[0]


def test_summary_agrees_with_the_models(usual):
    told = usual[1]
    assert told["group_refractivity_ppm"] == pytest.approx(1e6 * float(group_refractivity(20.0, 933.0, 50.0)))
    here = air(20.0, 933.0, 50.0)
    shares = [told[f"u_of_{name}_ppm"] for name in ("formula", "temperature", "pressure", "humidity")]
    assert shares[0] == pytest.approx(0.05)
    assert told["u_group_refractivity_ppm"] == pytest.approx(np.sqrt(np.sum(np.square(shares))), rel=1e-12)
    step = {"temperature": (0.2, 0.0, 0.0), "pressure": (0.0, 0.3, 0.0), "humidity": (0.0, 0.0, 3.0)}
    for name, (dt, dp, dh) in step.items():  # by a step of one u: straight within a thousandth
        moved = float(group_refractivity(20.0 + dt, 933.0 + dp, 50.0 + dh) - here.group_refractivity)
        assert told[f"u_of_{name}_ppm"] == pytest.approx(1e6 * abs(moved), rel=2e-3)
    for name, difference in told["other_less_this_ppm"].items():
        assert difference == pytest.approx(
            1e6 * float(group_refractivity(20.0, 933.0, 50.0, model=name) - here.group_refractivity), abs=1e-9
        )
    assert len(told["other_less_this_ppm"]) == len(MODELS) - 1


@pytest.mark.parametrize("model", ["rueger1990", "barrell_sears1963"])
def test_another_model_can_be_the_chosen_one_at_zero_degrees_in_dry_air(model):
    drawn, told = air_plot(0.0, 933.0, 0.0, model=model, wavelength_um=0.85)
    assert told["model"] == model
    assert told["u_of_temperature_ppm"] == 0.0
    assert "u with inputs" not in drawn
    fixed = re.search(r"fixed at (\d+) ppm in this model", drawn)
    assert (fixed is None) == bool(MODELS[model].co2_slope)
    if fixed:
        assert float(fixed[1]) == MODELS[model].co2_ppm


def holds(model, **state):
    return all(model.limits[key].lower <= value <= model.limits[key].upper for key, value in state.items())


def test_invalid_models_are_named_and_panels_end_at_vapour_saturation():
    drawn, told = air_plot(80.0, 400.0, 30.0)  # saturation is 476 hPa there: 84 % at most
    held = {name for name, model in MODELS.items() if holds(model, temperature_c=80.0, pressure_hpa=400.0)}
    assert told["not_drawn"] == sorted(set(MODELS) - held)
    assert {"barrell_sears1963", "iag1999_closed", "rueger1990"} <= set(MODELS) - held
    assert set(told["other_less_this_ppm"]) == held - {AIR_MODEL}
    assert "Barrell, Sears 1963" in drawn.partition("not drawn, outside their limits: ")[2].partition("<")[0]


def test_a_state_at_the_end_of_its_limits_is_drawn_to_that_end():
    assert air_plot(50.0, 1100.0, 100.0, model="rueger1990", wavelength_um=0.36)[1]["not_drawn"] == []
    values = VARIABLES[0].values(50.0, MODELS["rueger1990"])
    assert (values[0], values[-1]) == (35.0, 50.0)


def test_bands_are_plus_minus_u_and_lines_are_other_minus_chosen():
    above, below = Figure().subplots(2, 1)
    state = {"temperature_c": 20.0, "pressure_hpa": 933.0, "humidity_percent": 50.0, "wavelength_um": 0.78}
    names = _draw(above, below, VARIABLES[0], state | {"co2_ppm": 450.0}, "ciddor_hill1999", USUAL)
    assert names == set(MODELS) - {"ciddor_hill1999"}
    x = above.lines[0].get_xdata()
    swept = air(x, 933.0, 50.0)
    assert np.allclose(above.lines[0].get_ydata(), 1e6 * swept.group_refractivity, atol=1e-9)
    whole, formula = (band.get_paths()[0].vertices for band in below.collections)
    u = 1e6 * swept.combined_uncertainty(**USUAL)
    assert (whole[:, 1].max(), whole[:, 1].min()) == pytest.approx((u.max(), -u.max()))
    assert (formula[:, 1].max(), formula[:, 1].min()) == pytest.approx((0.05, -0.05))
    lines = {line.get_label(): line.get_ydata() for line in below.lines}
    for name in names:
        difference = 1e6 * (group_refractivity(x, 933.0, 50.0, model=name) - swept.group_refractivity)
        assert np.allclose(lines[MODELS[name].label], difference, atol=1e-9)
    assert lines[MODELS["rueger1990"].label][-1] < -0.1


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"temperature_c": -300.0}, "temperature -300 C is outside"),
        ({"pressure_hpa": 101_325.0}, "pressure 101325 hPa is outside"),
        ({"humidity_percent": np.nan}, "relative humidity is not a number"),
        ({"wavelength_um": 10.6}, "wavelength 10.6 um is outside"),
        ({"uncertainty": StateUncertainty(temperature_c=-0.1)}, "u of temperature -0.1 C is outside"),
        ({"uncertainty": StateUncertainty(pressure_hpa=np.nan)}, "u of pressure is not a number"),
        ({"model": "edlen"}, "air model 'edlen' is unknown"),
    ],
)
def test_invalid_states_are_refused_in_one_line(changed, words):
    state = {"temperature_c": 20.0, "pressure_hpa": 933.0, "humidity_percent": 50.0} | changed
    with pytest.raises(ValidityError, match=words):
        air_plot(**state)
