"""Saturation, ice, dew point: what the formulas claim, and what they do at the edges."""

import numpy as np
import pytest

from catseye.atmosphere import humidity
from catseye.errors import ValidityError

FORMULAS = list(humidity.FORMULAS)


def murphy_koop_hpa(temperature_c):
    """[MURPHY05] eq. 10, supercooled water, 123 to 332 K, typed here as an outside yardstick."""
    k = temperature_c + 273.15
    bend = np.tanh(0.0415 * (k - 218.8)) * (53.878 - 1331.22 / k - 9.44523 * np.log(k) + 0.014025 * k)
    return np.exp(54.842763 - 6763.22 / k - 4.210 * np.log(k) + 0.000367 * k + bend) / 100.0


def test_buck_is_the_notes_formula_digit_by_digit():
    by_hand = 6.1121 * (1.0007 + 3.46e-6 * 933.0) * np.exp(17.502 * 20.0 / 260.97)  # [PARKER04] eq. 1.3
    assert float(humidity.saturation_pressure_hpa(20.0, 933.0)) == pytest.approx(by_hand, rel=1e-14)


@pytest.mark.parametrize(
    ("temperature_c", "within"), [(50.0, 1e-3), (20.0, 1e-3), (0.0, 1e-3), (-20.0, 1e-3), (-40.0, 9e-3)]
)
def test_buck_is_as_good_as_its_docstring_says(temperature_c, within):
    moist = murphy_koop_hpa(temperature_c) * humidity.enhancement_factor(temperature_c, 933.0)
    assert float(humidity.saturation_pressure_hpa(temperature_c, 933.0) / moist) == pytest.approx(1.0, abs=within)


@pytest.mark.parametrize(("temperature_c", "within"), [(30.0, 2.5e-4), (0.0, 2.5e-4), (-20.0, 4e-4), (-40.0, 2.5e-3)])
def test_iapws_is_as_good_as_its_docstring_says_in_supercooled_water(temperature_c, within):
    ratio = humidity.iapws_saturation_pressure_hpa(temperature_c) / murphy_koop_hpa(temperature_c)
    assert float(ratio) == pytest.approx(1.0, abs=within)


def test_ice_and_water_meet_at_the_triple_point_and_ice_is_lower_below():
    # both are fits to 0.05 % at 0 °C
    at_zero = humidity.ice_saturation_pressure_hpa(0.0, 933.0) / humidity.saturation_pressure_hpa(0.0, 933.0)
    assert float(at_zero) == pytest.approx(1.0, abs=1e-3)
    cold = np.array([-1.0, -10.0, -30.0])
    assert np.all(humidity.ice_saturation_pressure_hpa(cold, 933.0) < humidity.saturation_pressure_hpa(cold, 933.0))
    # the standard meteorological tables' 2.597 hPa over ice at -10 °C, times 1.0042 for air
    assert float(humidity.ice_saturation_pressure_hpa(-10.0, 933.0)) == pytest.approx(2.597 * 1.0042, rel=3e-3)


@pytest.mark.parametrize("formula", FORMULAS)
@pytest.mark.parametrize("temperature_c", [-30.0, 0.0, 25.0])
def test_slopes_are_the_derivatives(formula, temperature_c):
    at = humidity.saturation(temperature_c, 933.0, formula)
    step = 1e-3  # a central difference is good to step² E'''/6E, 1e-10, and 1e-16/step, 1e-13
    warm, cool = (humidity.saturation(temperature_c + s, 933.0, formula).pressure_hpa for s in (step, -step))
    high, low = (humidity.saturation(temperature_c, 933.0 + s, formula).pressure_hpa for s in (1.0, -1.0))
    assert float(at.per_c) == pytest.approx((warm - cool) / (2 * step), rel=1e-8)
    assert float(at.per_hpa) == pytest.approx((high - low) / 2, rel=1e-8)


def test_dew_point_is_the_notes_equation_1_7():
    a = np.log(6.1121 * (1.0007 + 3.46e-6 * 933.0))
    by_hand = 240.97 * (np.log(11.7323) - a) / (17.502 + a - np.log(11.7323))
    assert float(humidity.dew_point_c(11.7323, 933.0)) == pytest.approx(by_hand, abs=1e-12)


@pytest.mark.parametrize("formula", FORMULAS)
def test_perfectly_dry_air_has_no_dew_point_and_says_nan_without_a_warning(formula):
    got = humidity.dew_point_c(np.array([0.0, 5e-324, 1e-3, 10.0]), 933.0, formula)
    np.testing.assert_array_equal(np.isnan(got), [True, True, False, False])


@pytest.mark.parametrize("formula", FORMULAS)
def test_zero_celsius_and_zero_humidity_are_legal(formula):
    assert float(humidity.vapour_pressure_hpa(0.0, 933.0, 0.0, formula)) == 0.0
    assert float(humidity.vapour_pressure_hpa(0.0, 933.0, 100.0, formula)) == pytest.approx(6.137, abs=0.005)


def test_an_unknown_formula_is_refused_by_name():
    with pytest.raises(ValidityError, match="'magnus' is unknown; choose one of buck, ciddor, iapws"):
        humidity.saturation(20.0, 933.0, "magnus")
