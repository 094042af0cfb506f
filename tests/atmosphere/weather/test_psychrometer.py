"""The psychrometer against other people's wet bulbs, in high precision, and where it is refused; instruments and u."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mpmath import mp

from catseye.atmosphere.index import air, ciddor_hill1999, hygrometer
from catseye.atmosphere.weather import humidity, psychrometer
from catseye.errors import ValidityError

# the adiabatic saturation temperature of ASHRAE's handbook: PsychroLib 2.5.0 (PyPI), GetHumRatioFromTWetBulb and
# GetVapPresFromHumRatio: dry bulb °C, wet bulb °C, hPa, vapour pressure hPa
ASHRAE_WATER = [
    (20.0, 14.0, 933.0, 12.374143), (30.0, 20.0, 933.0, 17.376942), (35.0, 22.0, 1013.25, 17.955019),
    (10.0, 8.0, 933.0, 9.524676), (5.0, 2.0, 850.0, 5.419431), (25.0, 25.0, 933.0, 31.692165),
    (40.0, 20.0, 1013.25, 10.321699),
]  # fmt: skip
ASHRAE_ICE = [
    (-2.0, -4.0, 933.0, 3.313021), (-8.0, -9.0, 933.0, 2.307926), (3.0, -1.0, 933.0, 3.505514),
    (-15.0, -15.5, 933.0, 1.312446), (-5.0, -6.0, 700.0, 3.289252),
]  # fmt: skip
EITHER = [(row, False) for row in ASHRAE_WATER] + [(row, True) for row in ASHRAE_ICE]


@pytest.mark.parametrize(("row", "over_ice"), EITHER)
def test_it_agrees_with_the_adiabatic_wet_bulb_within_their_difference(row, over_ice):
    t, wet, p, expected = row
    got = float(psychrometer.vapour_pressure_of_wet_bulb_hpa(t, wet, p, over_ice=over_ice))
    saturated = humidity.ice_saturation if over_ice else humidity.saturation
    # PsychroLib has no enhancement of saturation by air, 0.3 to 0.5 %; a ventilated bulb is not the adiabatic one: the
    # ratio of heat to vapour carried differs from 1 by some percent
    enhanced = 0.0045 * saturated(wet, p).pressure_hpa
    assert got - expected < enhanced
    assert abs(got - expected) < enhanced + 0.03 * 0.00066 * p * (t - wet)


@pytest.mark.parametrize(("row", "over_ice"), EITHER)
def test_it_agrees_with_the_formula_of_the_world_meteorological_organisation(row, over_ice):
    t, wet, p, _ = row
    got = float(psychrometer.vapour_pressure_of_wet_bulb_hpa(t, wet, p, over_ice=over_ice))
    factor = 1.0016 + 3.15e-6 * p - 0.074 / p  # [WMO18] annex 4.B, typed here as an outside yardstick
    if over_ice:
        other = 6.112 * np.exp(22.46 * wet / (272.62 + wet)) * factor - 5.75e-4 * p * (t - wet)
    else:
        other = 6.112 * np.exp(17.62 * wet / (243.12 + wet)) * factor - 6.53e-4 * (1 + 0.000944 * wet) * p * (t - wet)
    # both saturations are good to 0.1 %, the coefficients agree within 1.5 %: beside U_COEFFICIENT
    assert abs(got - other) < 2e-3 * humidity.saturation(wet, p).pressure_hpa + 0.015 * 6.6e-4 * p * (t - wet)


def test_saturation_is_at_the_wet_bulb_and_not_as_the_listing_leaves_it_at_the_dry_one():
    e = float(psychrometer.vapour_pressure_of_wet_bulb_hpa(20.0, 14.0, 933.0))
    assert e == pytest.approx(16.04185 - 0.000662 * 933.0 * 6.0, abs=1e-4)  # eq527 at tp = 14, eq523, by hand
    trap = float(humidity.saturation(20.0, 933.0).pressure_hpa) - 0.000662 * 933.0 * 0.0  # tp = t
    assert trap - e > 11.0


@pytest.mark.parametrize("over_ice", [False, True])
def test_slopes_are_those_of_the_formula_in_high_precision(over_ice):
    t0, wet0, p0 = -3.0, -4.5, 880.0
    water, ice = "6.1121 1.0007 3.46e-6 17.502 240.97", "6.1115 1.0003 4.18e-6 22.452 272.55"
    names = (ice if over_ice else water).split()
    e0, f0, fp, a, b = (mp.mpf(name) for name in names)
    coefficient = mp.mpf("0.000583" if over_ice else "0.000662")

    def exact(t, wet, p):
        return e0 * (f0 + fp * p) * mp.exp(a * wet / (b + wet)) - coefficient * p * (t - wet)

    with mp.workdps(40):
        at = (mp.mpf(t0), mp.mpf(wet0), mp.mpf(p0))
        expected = [mp.diff(exact, at, order) for order in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
        value = exact(*at)
    got = psychrometer.wet_bulb_partials(t0, wet0, p0, over_ice=over_ice)
    np.testing.assert_allclose([float(v) for v in got], [float(v) for v in expected], rtol=1e-12)
    assert float(psychrometer.vapour_pressure_of_wet_bulb_hpa(t0, wet0, p0, over_ice=over_ice)) == pytest.approx(
        float(value), rel=1e-12
    )


@given(st.floats(-40.0, 50.0), st.floats(0.0, 100.0), st.floats(500.0, 1100.0), st.sampled_from(["buck", "iapws"]))
def test_any_air_has_a_wet_bulb_and_the_wet_bulb_gives_the_air_back(t, h, p, formula):
    e = float(humidity.vapour_pressure_hpa(t, p, h, formula))
    wet = float(psychrometer.wet_bulb_c(t, e, p, formula=formula))
    assume(wet >= -40.0)
    assert wet <= t + 1e-9
    back = psychrometer.vapour_pressure_of_wet_bulb_hpa(t, min(wet, t), p, formula=formula)
    assert float(back) == pytest.approx(e, abs=1e-9 * (1.0 + e))


@given(st.floats(-35.0, 5.0), st.floats(5.0, 100.0), st.floats(500.0, 1100.0))
def test_an_ice_bulb_gives_the_air_back_wherever_its_ice_stays_ice(t, h, p):
    e = float(humidity.vapour_pressure_hpa(t, p, h))
    wet = float(psychrometer.wet_bulb_c(t, e, p, over_ice=True))
    if np.isnan(
        wet
    ):  # then ice at 0.01 °C would still be drying or melting: more vapour than the bulb at 0.01 °C shows
        assert e > float(humidity.ice_saturation(0.01, p).pressure_hpa) - 0.000583 * p * (t - 0.01) - 1e-6
        return
    assume(wet >= -40.0)
    assert float(psychrometer.vapour_pressure_of_wet_bulb_hpa(t, wet, p, over_ice=True)) == pytest.approx(e, abs=1e-8)


def test_air_between_ice_and_water_saturation_warms_an_ice_bulb_and_is_not_refused():
    e = float(humidity.vapour_pressure_hpa(-10.0, 933.0, 99.0))
    wet = float(psychrometer.wet_bulb_c(-10.0, e, 933.0, over_ice=True))
    assert wet == pytest.approx(-9.7, abs=0.1)  # (E_water - E_ice)/(dE/dt + A p) = 0.24/0.75
    assert float(psychrometer.vapour_pressure_of_wet_bulb_hpa(-10.0, wet, 933.0, over_ice=True)) == pytest.approx(e)


@pytest.mark.parametrize(
    ("call", "text", "mask"),
    [
        (
            lambda of: of([20.0, 20.0], [21.0, 14.0], 933.0),
            "wet bulb 21 °C is above the dry bulb, 20 °C",
            [True, False],
        ),
        (lambda of: of(35.0, 5.0, 933.0), "negative vapour pressure, -9.77 hPa", None),
        (
            lambda of: of([20.0, 35.0], [14.0, 5.0], 933.0),
            "element 1 of 2: dry bulb 35 °C, wet bulb 5 °C",
            [False, True],
        ),
        (lambda of: of(5.0, 1.0, 933.0, over_ice=True), "wet bulb with ice 1 °C is outside", None),
        (lambda of: of(-10.0, -8.0, 933.0, over_ice=True), "more than water at the dry bulb's -10 °C", None),
        (lambda of: of(np.nan, 1.0, 933.0), "dry bulb is not a number", None),
        (lambda of: of(20.0, -300.0, 933.0), "wet bulb -300 °C", None),
        (lambda of: of(20.0, 14.0, 93300.0), "pressure 93300 hPa", None),
        (lambda of: of(-2.0, -3.0, 933.0, over_ice=True, formula="ciddor"), "unknown over ice", None),
        (lambda of: psychrometer.wet_bulb_c(20.0, 25.0, 933.0), "vapour pressure 25.000 hPa is above saturation", None),
        (lambda of: psychrometer.wet_bulb_c(-5.0, 1.0, 933.0, over_ice=True, formula="ciddor"), "over ice", None),
        (lambda of: psychrometer.wet_bulb_c(20.0, -1.0, 933.0), "vapour pressure -1 hPa", None),
    ],
)
def test_impossible_readings_are_refused_by_name_value_and_place(call, text, mask):
    with pytest.raises(ValidityError, match=text) as refused:
        call(psychrometer.vapour_pressure_of_wet_bulb_hpa)
    assert mask == (None if refused.value.mask is None else refused.value.mask.tolist())


def test_both_bulbs_at_zero_celsius_are_legal_over_water_and_over_ice():
    for over_ice in (False, True):
        got = psychrometer.vapour_pressure_of_wet_bulb_hpa(0.0, 0.0, 933.0, over_ice=over_ice)
        assert float(got) == pytest.approx(6.137, abs=1e-3)


# instruments


def test_a_mirror_below_zero_needs_its_deposit():
    with pytest.raises(ValidityError, match="mirror at -10 °C may carry dew or frost; give deposit") as refused:
        hygrometer.of_mirror([5.0, -10.0], 933.0)
    assert refused.value.mask.tolist() == [False, True]
    dew, frost = (hygrometer.of_mirror(-10.0, 933.0, deposit=d).vapour_pressure_hpa for d in ("dew", "frost"))
    assert float(frost / dew) == pytest.approx(2.5970 / 2.8627, rel=1e-3)  # Smithsonian tables, pure ice and water
    assert float(hygrometer.of_mirror(0.0, 933.0).vapour_pressure_hpa) == pytest.approx(6.136, abs=1e-3)
    with pytest.raises(ValidityError, match="deposit 'rime' is unknown; choose one of dew, frost"):
        hygrometer.of_mirror(-10.0, 933.0, deposit="rime")


READINGS = {
    "relative humidity": (lambda t, p, r: hygrometer.of_relative_humidity(t, p, r), 50.0, 2.0),
    "dew point": (lambda t, p, r: hygrometer.of_mirror(r, p), 9.3, 0.3),
    "wet bulb": (lambda t, p, r: hygrometer.of_wet_bulb(t, r, p), 14.0, 0.15),
}


@pytest.mark.parametrize("name", READINGS)
def test_a_readings_uncertainty_in_vapour_pressure_and_index_is_the_scatter_of_a_monte_carlo(name):
    of, reading, u_reading = READINGS[name]
    rng, n = np.random.default_rng(8), 20_000
    u_t, u_p = 0.3, 0.5
    t, p, r = (
        20.0 + u_t * rng.normal(size=n),
        933.0 + u_p * rng.normal(size=n),
        reading + u_reading * rng.normal(size=n),
    )
    at = of(20.0, 933.0, reading)
    light = {"wavelength_um": 0.78, "co2_ppm": 450.0}
    e = of(t, p, r).vapour_pressure_hpa
    index = ciddor_hill1999.MODEL.refractivity(t, p, e, **light)
    exact = at._replace(u_formula_hpa=0.0)
    u_e = exact.standard_uncertainty_hpa(u_reading, u_temperature_c=u_t, u_pressure_hpa=u_p)
    partials = ciddor_hill1999.MODEL.partials(20.0, 933.0, at.vapour_pressure_hpa, **light)
    u_n = exact.index_uncertainty(partials, u_reading, u_temperature_c=u_t, u_pressure_hpa=u_p)
    # 20 000 draws know a standard deviation to 0.5 %; the second order adds 0.5 %
    assert e.std() == pytest.approx(float(u_e), rel=0.02)
    assert index.std() == pytest.approx(float(u_n), rel=0.02)
    grown = at.index_uncertainty(partials, u_reading, u_temperature_c=u_t, u_pressure_hpa=u_p, u_model=1e-7)
    formula = partials.vapour_pressure_hpa * at.u_formula_hpa
    assert float(grown**2) == pytest.approx(float(u_n**2 + 1e-14 + formula**2), rel=1e-12)


def test_the_thermometers_two_ways_into_the_index_add_before_they_are_squared():
    formula = air.MODELS["ciddor_hill1999"].vapour_formula
    at = hygrometer.of_relative_humidity(20.0, 933.0, 50.0, formula=formula)
    partials = air.group_partials(20.0, 933.0, at.vapour_pressure_hpa)
    u = float(at._replace(u_formula_hpa=0.0).index_uncertainty(partials, 0.0, u_temperature_c=1.0))
    assert u == pytest.approx(abs(float(air.air(20.0, 933.0, 50.0).sensitivity.temperature_c)), rel=1e-12)
    # with relative humidity held the index falls faster than with vapour pressure held: the vapour grows too
    assert u > abs(float(partials.temperature_c)) + 0.5e-8


@pytest.mark.parametrize("formula", ["buck", "ciddor", "iapws"])
def test_the_formulas_own_uncertainty_covers_what_they_differ_by(formula):
    t = np.linspace(-20.0, 30.0, 51)
    e = [hygrometer.of_relative_humidity(t, 933.0, 100.0, formula=name) for name in (formula, "iapws")]
    apart = np.abs(e[0].vapour_pressure_hpa - e[1].vapour_pressure_hpa)
    assert np.all(apart <= 2.0 * np.hypot(e[0].u_formula_hpa, e[1].u_formula_hpa))
    with pytest.raises(ValidityError, match="relative humidity 101 %"):
        hygrometer.of_relative_humidity(20.0, 933.0, 101.0, formula=formula)
