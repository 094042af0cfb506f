"""Objects of the index of air and of the speed of sound."""

import math

import pytest

from catseye.gateways.air.objects import air_object
from catseye.reduction.air.routes import Moisture, Pressure
from catseye.reduction.air.weather_index import index_by_weather


def test_air_object_has_its_state_and_both_uncertainties():
    found = index_by_weather(20.0, Pressure(933.0), Moisture("humidity_percent", 50.0), u_temperature_c=0.3)
    told = air_object(found)
    assert (told["temperature_c"], told["pressure_hpa"], told["humidity_percent"]) == (20.0, 933.0, 50.0)
    assert told["formula_uncertainty"] == found.state.standard_uncertainty
    # the slope as printed, four digits
    assert told["standard_uncertainty"] == pytest.approx(math.hypot(5e-8, 0.3 * 0.8921e-6), rel=1e-3)
    assert told["uncertainty_of"] == ["temperature"]
    assert told["verdict"] == found.verdict.to_object()
