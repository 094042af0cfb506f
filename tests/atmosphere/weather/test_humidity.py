"""Saturation, ice, dew point: what the formulas claim, and what they do at the edges."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp

from catseye.atmosphere.weather import humidity
from catseye.errors import ValidityError

FORMULAS = list(humidity.FORMULAS)


def murphy_koop_hpa(temperature_c):
    """[MURPHY05] eq. 10, supercooled water, 123 to 332 K, typed here as an outside yardstick."""
    k = temperature_c + 273.15
    bend = np.tanh(0.0415 * (k - 218.8)) * (53.878 - 1331.22 / k - 9.44523 * np.log(k) + 0.014025 * k)
    return np.exp(54.842763 - 6763.22 / k - 4.210 * np.log(k) + 0.000367 * k + bend) / 100.0


def water_hpa(temperature_c, pressure_hpa, formula="buck"):
    return humidity.saturation(temperature_c, pressure_hpa, formula).pressure_hpa


def ice_hpa(temperature_c, pressure_hpa, formula="buck"):
    return humidity.ice_saturation(temperature_c, pressure_hpa, formula).pressure_hpa


def pure_water_hpa(temperature_c):
    """[IAPWS97] eq. 30 without air: the enhancement factor is divided out."""
    return water_hpa(temperature_c, 933.0, "iapws") / humidity.enhancement_factor(temperature_c, 933.0)


def pure_ice_hpa(temperature_c):
    """[IAPWS11] eq. 6 without air: where vapour alone makes the pressure, the enhancement factor over ice is 1."""
    # the yardstick is 6.5e-4 off at most, and its factor then by alpha + beta, 4e-4 at most, of that: 3e-7
    return humidity.ICE_FORMULAS["iapws"](temperature_c, murphy_koop_ice_hpa(temperature_c)).pressure_hpa


@pytest.mark.parametrize(
    ("kelvin", "printed", "half_a_digit"),
    [(300.0, 35.36589, 5e-6), (500.0, 26388.9776, 5e-5), (600.0, 123443.146, 5e-4)],
)
def test_iapws_gives_the_printed_pressures_of_water(kelvin, printed, half_a_digit):
    """[IAPWS97] table 35."""
    assert float(pure_water_hpa(kelvin - 273.15)) == pytest.approx(printed, abs=half_a_digit)


def test_iapws_gives_the_printed_pressure_of_ice_at_230_k():
    """[IAPWS11], the release's check value, 8.94735e-6 MPa."""
    assert float(pure_ice_hpa(230.0 - 273.15)) * 1e-4 == pytest.approx(8.94735e-6, abs=5e-12)


def test_buck_is_the_notes_formula_digit_by_digit():
    by_hand = 6.1121 * (1.0007 + 3.46e-6 * 933.0) * np.exp(17.502 * 20.0 / 260.97)  # [PARKER04] eq. 1.3
    assert float(water_hpa(20.0, 933.0)) == pytest.approx(by_hand, rel=1e-14)


@pytest.mark.parametrize(
    ("temperature_c", "within"), [(50.0, 1e-3), (20.0, 1e-3), (0.0, 1e-3), (-20.0, 1e-3), (-40.0, 9e-3)]
)
def test_buck_has_its_documented_accuracy(temperature_c, within):
    moist = murphy_koop_hpa(temperature_c) * humidity.enhancement_factor(temperature_c, 933.0)
    assert float(water_hpa(temperature_c, 933.0) / moist) == pytest.approx(1.0, abs=within)


@pytest.mark.parametrize(("temperature_c", "within"), [(30.0, 2.5e-4), (0.0, 2.5e-4), (-20.0, 4e-4), (-40.0, 2.5e-3)])
def test_iapws_has_its_documented_accuracy_in_supercooled_water(temperature_c, within):
    ratio = pure_water_hpa(temperature_c) / murphy_koop_hpa(temperature_c)
    assert float(ratio) == pytest.approx(1.0, abs=within)


def test_ice_and_water_meet_at_the_triple_point_and_ice_is_lower_below():
    # both are fits to 0.05 % at 0 °C
    at_zero = ice_hpa(0.0, 933.0) / water_hpa(0.0, 933.0)
    assert float(at_zero) == pytest.approx(1.0, abs=1e-3)
    cold = np.array([-1.0, -10.0, -30.0])
    assert np.all(ice_hpa(cold, 933.0) < water_hpa(cold, 933.0))
    # the standard meteorological tables' 2.597 hPa over ice at -10 °C, times 1.0042 for air
    assert float(ice_hpa(-10.0, 933.0)) == pytest.approx(2.597 * 1.0042, rel=3e-3)


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
def test_perfectly_dry_air_has_nan_dew_point_without_a_warning(formula):
    got = humidity.dew_point_c(np.array([0.0, 5e-324, 1e-3, 10.0]), 933.0, formula)
    np.testing.assert_array_equal(np.isnan(got), [True, True, False, False])


@pytest.mark.parametrize("formula", FORMULAS)
def test_zero_celsius_and_zero_humidity_are_legal(formula):
    assert float(humidity.vapour_pressure_hpa(0.0, 933.0, 0.0, formula)) == 0.0
    assert float(humidity.vapour_pressure_hpa(0.0, 933.0, 100.0, formula)) == pytest.approx(6.137, abs=0.005)


def test_an_unknown_formula_is_refused_by_name():
    with pytest.raises(ValidityError, match="'magnus' is unknown; choose one of buck, ciddor, iapws"):
        humidity.saturation(20.0, 933.0, "magnus")


def murphy_koop_ice_hpa(temperature_c):
    """[MURPHY05] eq. 7, ice above 110 K, typed here as an outside yardstick."""
    k = temperature_c + 273.15
    return np.exp(9.550426 - 5723.265 / k + 3.53068 * np.log(k) - 0.00728332 * k) / 100.0


@pytest.mark.parametrize(("temperature_c", "within"), [(0.0, 1e-6), (-20.0, 1.5e-4), (-40.0, 2.5e-4), (-80.0, 6.5e-4)])
def test_sublimation_has_its_documented_accuracy(temperature_c, within):
    ratio = pure_ice_hpa(temperature_c) / murphy_koop_ice_hpa(temperature_c)
    assert float(ratio) == pytest.approx(1.0, abs=within)


def test_ice_and_water_meet_at_the_triple_point_of_the_releases():
    ice, water = pure_ice_hpa(0.01), pure_water_hpa(0.01)
    assert float(ice) == pytest.approx(6.11657, abs=1e-9)
    assert float(water / ice) == pytest.approx(1.0, abs=1e-5)  # IF97 gives 611.657 Pa to its last digit


# enhancement over ice of the IAPWS virial coefficients B and C of moist air (package iapws 1.5.5 on PyPI), worked out
# once outside this project: hPa, °C, factor
VIRIAL = [
    (700.0, -0.01, 1.003052), (700.0, -20.0, 1.003249), (700.0, -40.0, 1.003879),
    (933.0, -0.01, 1.003904), (933.0, -20.0, 1.004283), (933.0, -40.0, 1.005163),
    (1013.25, -0.01, 1.004198), (1013.25, -20.0, 1.004639), (1013.25, -40.0, 1.005606),
]  # fmt: skip


@pytest.mark.parametrize(("pressure_hpa", "temperature_c", "expected"), VIRIAL)
def test_the_enhancement_over_ice_has_its_documented_accuracy(pressure_hpa, temperature_c, expected):
    moist = humidity.ice_saturation(temperature_c, pressure_hpa, "iapws").pressure_hpa
    factor = moist / pure_ice_hpa(temperature_c)
    below = expected - float(factor)
    assert 1.5e-4 < below < 6.5e-4  # Greenspan's is the lower one throughout
    assert below == pytest.approx(2e-4 - 1e-5 * temperature_c, abs=1e-4)


def test_both_formulas_over_ice_agree_as_documented():
    t = np.linspace(-40.0, 0.0, 41)
    for p in (500.0, 933.0, 1100.0):
        ratio = humidity.ice_saturation(t, p, "buck").pressure_hpa / humidity.ice_saturation(t, p, "iapws").pressure_hpa
        assert np.all(np.abs(ratio - 1.0) < 1e-3)
    cold = [humidity.ice_saturation(-80.0, 933.0, f).pressure_hpa for f in ("buck", "iapws")]
    assert float(cold[0] / cold[1]) == pytest.approx(0.989, abs=2e-3)


def high_precision(formula, over_ice):
    """Saturation in hPa as a function of two mpf: the printed formulas again, typed from the sources."""

    def buck(t, p):
        if over_ice:
            return (
                mp.mpf("6.1115")
                * (mp.mpf("1.0003") + mp.mpf("4.18e-6") * p)
                * mp.exp(mp.mpf("22.452") * t / (mp.mpf("272.55") + t))
            )
        return (
            mp.mpf("6.1121")
            * (mp.mpf("1.0007") + mp.mpf("3.46e-6") * p)
            * mp.exp(mp.mpf("17.502") * t / (mp.mpf("240.97") + t))
        )

    def ciddor(t, p):
        k = t + mp.mpf("273.15")
        pure = mp.exp(mp.mpf("1.2378847e-5") * k**2 - mp.mpf("1.9121316e-2") * k + mp.mpf("33.93711047")
                      - mp.mpf("6.3431645e3") / k) / 100  # fmt: skip
        return (mp.mpf("1.00062") + mp.mpf("3.14e-6") * p + mp.mpf("5.6e-7") * t**2) * pure

    def iapws(t, p):
        theta = (t + mp.mpf("273.15")) / mp.mpf("273.16")
        terms = (("-0.212144006e2", "0.333333333e-2"), ("0.273203819e2", "0.120666667e1"),
                 ("-0.610598130e1", "0.170333333e1"))  # fmt: skip
        e = mp.mpf("6.11657") * mp.exp(sum(mp.mpf(a) * theta ** mp.mpf(b) for a, b in terms) / theta)
        alpha = mp.mpf("3.64449e-4") + t * (
            mp.mpf("2.93631e-5") + t * (mp.mpf("4.88635e-7") + t * mp.mpf("4.36543e-9"))
        )
        beta = mp.exp(
            mp.mpf("-10.7271") + t * (mp.mpf("7.61989e-2") + t * (mp.mpf("-1.74771e-4") + t * mp.mpf("2.46721e-6")))
        )
        return e * mp.exp(alpha * (1 - e / p) + beta * (p / e - 1))

    return {"buck": buck, "ciddor": ciddor, "iapws": iapws}[formula]


@pytest.mark.parametrize(("formula", "over_ice"), [("buck", False), ("ciddor", False), ("buck", True), ("iapws", True)])
@pytest.mark.parametrize(("temperature_c", "pressure_hpa"), [(-35.0, 600.0), (-10.0, 933.0), (-0.5, 1080.0)])
def test_values_and_slopes_are_those_of_the_formula_in_high_precision(formula, over_ice, temperature_c, pressure_hpa):
    at = (humidity.ice_saturation if over_ice else humidity.saturation)(temperature_c, pressure_hpa, formula)
    exact = high_precision(formula, over_ice)
    with mp.workdps(40):
        t, p = mp.mpf(temperature_c), mp.mpf(pressure_hpa)
        expected = [exact(t, p), mp.diff(lambda x: exact(x, p), t), mp.diff(lambda x: exact(t, x), p)]
    # 1e-12: exponents near 20 lose four digits of sixteen
    np.testing.assert_allclose([float(v) for v in at], [float(v) for v in expected], rtol=1e-12)


temperatures = st.floats(-40.0, 50.0)
pressures = st.floats(500.0, 1100.0)


@given(temperatures, pressures, st.floats(0.1, 100.0), st.sampled_from(FORMULAS))
def test_a_dew_point_gives_back_its_vapour_pressure_and_relative_humidity_its_own(t, p, h, formula):
    e = humidity.vapour_pressure_hpa(t, p, h, formula)
    dew = humidity.dew_point_c(e, p, formula)
    assert float(dew) <= t + 1e-9
    back = water_hpa(dew, p, formula)
    assert float(back) == pytest.approx(float(e), rel=1e-10)  # 1e-9 °C is 1e-10 of the pressure
    assert float(humidity.relative_humidity_percent(e, t, p, formula=formula)) == pytest.approx(h, rel=1e-12)


@given(st.floats(-95.0, 0.0), pressures, st.sampled_from(["buck", "iapws"]))
def test_a_frost_point_gives_back_its_vapour_pressure_and_lies_above_the_dew_point(frost, p, formula):
    e = ice_hpa(frost, p, formula)
    assert float(humidity.frost_point_c(e, p, formula)) == pytest.approx(frost, abs=1e-8)
    # at 0 °C Buck's two fits cross by 0.02 %, 0.002 °C
    assert float(humidity.dew_point_c(e, p, "buck")) < frost + 0.01 or formula == "iapws"
    assert float(humidity.relative_humidity_percent(e, frost, p, formula=formula, over_ice=True)) == pytest.approx(
        100.0
    )


def test_relative_humidity_over_ice_is_the_higher_number_for_the_same_vapour():
    e = 2.0
    over_water = humidity.relative_humidity_percent(e, -10.0, 933.0)
    over_ice = humidity.relative_humidity_percent(e, -10.0, 933.0, over_ice=True)
    assert float(over_ice / over_water) == pytest.approx(
        2.8627 / 2.5970, rel=1e-3
    )  # Smithsonian tables, pure water, ice
    assert float(humidity.vapour_pressure_hpa(-10.0, 933.0, over_ice, over_ice=True)) == pytest.approx(e, rel=1e-14)


@pytest.mark.parametrize("formula", ["buck", "iapws"])
def test_moist_or_perfectly_dry_air_has_nan_frost_point_without_a_warning(formula):
    got = humidity.frost_point_c(np.array([0.0, 1e-3, 3.0, 6.2, 20.0]), 933.0, formula)
    np.testing.assert_array_equal(np.isnan(got), [True, False, False, True, True])


@pytest.mark.parametrize(
    ("call", "text", "mask"),
    [
        (lambda: humidity.ice_saturation([-1.0, 0.5], 933.0), "temperature of ice 0.5 °C", [False, True]),
        (lambda: humidity.ice_saturation(-1.0, 101325.0), "pressure 101325 hPa is outside 100-1400 hPa", None),
        (lambda: humidity.ice_saturation(-1.0, 933.0, "ciddor"), "unknown over ice; choose one of buck, iapws", None),
        (lambda: humidity.frost_point_c(1.0, 933.0, "ciddor"), "unknown over ice", None),
        (lambda: humidity.dew_point_c(1.0, 933.0, "magnus"), "'magnus' is unknown; choose", None),
        (lambda: humidity.relative_humidity_percent(-0.1, 20.0, 933.0), "vapour pressure -0.1 hPa", None),
        (lambda: humidity.relative_humidity_percent(1.0, 20.0, 933.0, over_ice=True), "temperature of ice 20", None),
    ],
)
def test_values_out_of_range_are_refused_with_name_value_and_limit(call, text, mask):
    with pytest.raises(ValidityError, match=text) as refused:
        call()
    assert mask == (None if refused.value.mask is None else refused.value.mask.tolist())


def test_zero_celsius_is_a_legal_dew_and_frost_point():
    assert float(water_hpa(0.0, 933.0)) == pytest.approx(6.136, abs=1e-3)
    assert float(ice_hpa(0.0, 933.0)) == pytest.approx(6.137, abs=1e-3)


@pytest.mark.parametrize(
    ("function", "arguments", "said"),
    [
        (humidity.dew_point_c, (-5.0, 933.0), "vapour pressure -5 hPa is outside"),
        (humidity.dew_point_c, (1e9, 933.0), r"vapour pressure 1e\+09 hPa is outside"),  # was -3238 °C
        (humidity.dew_point_c, (10.0, -933.0), "pressure -933 hPa is outside"),  # was 7.0 °C
        (humidity.dew_point_c, (np.nan, 933.0), "vapour pressure is not a number"),
        (humidity.frost_point_c, (-5.0, 933.0), "vapour pressure -5 hPa is outside"),
        (humidity.frost_point_c, (1.0, 93300.0), "pressure 93300 hPa is outside"),
        (humidity.vapour_pressure_hpa, (-300.0, 933.0, 50.0), "temperature -300 °C is outside"),  # was 1e39 hPa
        (humidity.vapour_pressure_hpa, (20.0, 93300.0, 50.0), "pressure 93300 hPa is outside"),
        (humidity.ice_saturation, (20.0, 933.0), "temperature of ice 20 °C is outside"),
        (humidity.vapour_pressure_hpa, (20.0, 933.0, 120.0), "relative humidity 120 % is outside"),
        (humidity.vapour_pressure_hpa, (20.0, 933.0, np.nan), "relative humidity is not a number"),
        (humidity.vapour_pressure_hpa, (20.0, np.nan, 50.0), "pressure is not a number"),
    ],
)
def test_invalid_values_are_refused_by_every_converter(function, arguments, said):
    with pytest.raises(ValidityError, match=said):
        function(*arguments)
