"""Dew and frost on a surface: thresholds, probabilities against Monte Carlo, and the clear sky's estimate."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.atmosphere.weather import humidity
from catseye.atmosphere.weather.condensation import CondensationSpread, condensation, radiative_depression_k
from catseye.errors import ValidityError


def test_air_with_a_dew_point_above_freezing_threatens_dew_and_drier_air_frost():
    dew = condensation(3.0, 10.0, 933.0, humidity_percent=60.0)
    assert (str(dew.threat), str(dew.deposit)) == ("dew", "none")
    assert float(dew.threshold_c) == pytest.approx(2.6, abs=0.1)  # psychrometric tables: 10 °C, 60 %
    frost = condensation(-5.0, 2.0, 933.0, humidity_percent=50.0)
    assert (str(frost.threat), str(frost.deposit)) == ("frost", "none")
    e = humidity.vapour_pressure_hpa(2.0, 933.0, 50.0)
    assert float(frost.threshold_c) == pytest.approx(float(humidity.frost_point_c(e, 933.0)))
    assert float(frost.threshold_c) > float(humidity.dew_point_c(e, 933.0)) + 0.5  # -6.4 against -7.2 °C
    assert float(frost.margin_k) == pytest.approx(-5.0 - float(frost.threshold_c))


@given(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0), st.floats(1.0, 100.0), st.sampled_from(["buck", "iapws"]))
def test_a_surface_collects_water_exactly_where_air_at_its_temperature_would_be_oversaturated(surface, t, h, formula):
    found = condensation(surface, t, 933.0, humidity_percent=h, formula=formula)
    e = float(humidity.vapour_pressure_hpa(t, 933.0, h, formula))
    phase = humidity.ice_saturation if surface < 0.0 else humidity.saturation
    most = float(phase(surface, 933.0, formula).pressure_hpa)
    if abs(e / most - 1.0) < 1e-3:  # on the edge, where at 0 °C the fits over water and ice differ by 0.02 %
        return
    assert (float(found.margin_k) < 0.0) == (e > most)
    expected = ("frost" if surface < 0.0 else "dew") if e > most else "none"
    assert str(found.deposit) == expected


def test_the_threshold_does_not_jump_where_dew_gives_way_to_frost():
    h = np.linspace(66.0, 69.0, 3001)  # at 5 °C the dew point passes 0 °C near 67.6... %
    found = condensation(-3.0, 5.0, 933.0, humidity_percent=100.0 * 6.1361 / 8.7517 * h / 67.5)
    assert {"dew", "frost"} == set(found.threat)
    assert np.all(np.diff(found.threshold_c) > -0.004)  # Buck's two fits cross by 0.002 °C
    assert np.all(np.abs(np.diff(found.threshold_c)) < 0.006)


@pytest.mark.parametrize(
    ("surface", "t", "h", "offset_known", "within"),
    [
        (5.0, 10.0, 75.0, False, 0.03),  # second order in humidity
        (2.0, 10.0, 50.0, False, 0.06),  # the dew point is 0.06 °C: half of the draws are frost points, a tenth flatter
        (-6.0, -4.0, 80.0, False, 0.03),
        (-1.5, 3.0, 60.0, True, 0.03),
    ],
)
def test_the_probability_is_that_of_a_monte_carlo(surface, t, h, offset_known, within):
    rng, n = np.random.default_rng(3), 40_000
    u_s, u_t, u_h = 0.6, 0.4, 4.0
    air = t + u_t * rng.normal(size=n)
    if offset_known:  # the surface taken as the air's temperature plus an offset
        surfaces, covariance, u_surface = air + (surface - t) + u_s * rng.normal(size=n), u_t**2, np.hypot(u_s, u_t)
    else:
        surfaces, covariance, u_surface = surface + u_s * rng.normal(size=n), 0.0, u_s
    drawn = condensation(surfaces, air, 933.0, humidity_percent=np.clip(h + u_h * rng.normal(size=n), 0.0, 100.0))
    found = condensation(
        surface,
        t,
        933.0,
        humidity_percent=h,
        u=CondensationSpread(surface_c=u_surface, temperature_c=u_t, humidity_percent=u_h, covariance_c2=covariance),
    )
    assert drawn.margin_k.std() == pytest.approx(float(found.u_margin_k), rel=within)
    assert np.mean(drawn.margin_k < 0.0) == pytest.approx(float(found.probability), abs=0.02)


def test_a_shared_thermometer_nearly_cancels():
    shared = condensation(
        5.0,
        10.0,
        933.0,
        humidity_percent=80.0,
        u=CondensationSpread(surface_c=1.0, temperature_c=1.0, covariance_c2=1.0),
    )
    apart = condensation(
        5.0, 10.0, 933.0, humidity_percent=80.0, u=CondensationSpread(surface_c=1.0, temperature_c=1.0)
    )
    assert float(shared.u_margin_k) < 0.1 < 1.3 < float(apart.u_margin_k)


def test_without_uncertainties_the_probability_is_a_step():
    found = condensation(np.array([5.0, 6.5]), 10.0, 933.0, humidity_percent=75.0)
    assert found.probability.tolist() == [1.0, 0.0]


def test_perfectly_dry_air_leaves_every_surface_clear():
    found = condensation(
        np.array([-40.0, 0.0]),
        0.0,
        933.0,
        humidity_percent=0.0,
        u=CondensationSpread(surface_c=1.0, humidity_percent=1.0),
    )
    assert np.all(np.isinf(found.margin_k))
    assert found.probability.tolist() == [0.0, 0.0]
    assert found.lines() == ["clear: the air has no vapour"] * 2


def test_a_sky_warmer_than_a_black_body_is_refused():
    # 0.711 + 0.56 0.39 + 0.73 0.39² + 0.013 = 1.053: the surface would gain heat from the sky and stand above the air
    with pytest.raises(ValidityError, match="emissivity of the sky"):
        radiative_depression_k(40.0, 39.0, 1000.0)


def test_lines_contain_deposit_margin_point_and_probability():
    found = condensation(
        np.array([5.0, 8.0, -3.5, -1.0]), np.array([10.0, 10.0, -2.0, 8.0]), 933.0,
        humidity_percent=np.array([75.0, 75.0, 90.0, 70.0]),
        u=CondensationSpread(surface_c=0.5),
    )  # fmt: skip
    assert found.lines() == [
        "dew: 0.8 K below the dew point, 5.8 °C, ± 0.5 K; 94 % probable",
        "clear: 2.2 K above the dew point, 5.8 °C, ± 0.5 K; 0 % probable",
        "frost: 0.5 K below the frost point, -3.0 °C, ± 0.5 K; 83 % probable",
        "frost: 3.9 K below the dew point, 2.9 °C, ± 0.5 K; 100 % probable",
    ]
    assert condensation(8.0, 10.0, 933.0, humidity_percent=75.0).lines() == ["clear: 2.2 K above the dew point, 5.8 °C"]


@given(
    st.floats(-30.0, 33.0), st.floats(0.0, 30.0), st.floats(0.0, 7.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0)
)  # fmt: skip
def test_the_cooled_surface_balances_radiation_against_the_air(t, below, wind, emissivity, view):
    dew = max(t - below, -40.0)
    depression = float(radiative_depression_k(t, dew, 950.0, wind=wind, emissivity=emissivity, sky_view=view))
    assert -1e-9 <= depression < 30.0
    air, share = t + 273.15, dew / 100.0
    sky = 0.711 + 0.56 * share + 0.73 * share**2 + 0.013 + 0.00012 * (950.0 - 1000.0)  # [BERDAHL84], typed here
    sigma = 5.670374419e-8
    lost = (
        emissivity
        * sigma
        * (view * ((air - depression) ** 4 - sky * air**4) + (1.0 - view) * ((air - depression) ** 4 - air**4))
    )
    assert lost == pytest.approx((2.8 + 3.0 * wind) * depression, abs=1e-8)


def test_glass_under_a_clear_sky_is_several_kelvin_below_the_air_and_gold_is_not():
    assert 3.0 < float(radiative_depression_k(10.0, 5.0, 933.0, wind=2.0)) < 10.0
    assert float(radiative_depression_k(10.0, 5.0, 933.0, wind=2.0, emissivity=0.03)) < 0.5
    assert float(radiative_depression_k(10.0, 5.0, 933.0, sky_view=0.0)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: condensation(5.0, -300.0, 933.0, humidity_percent=75.0), "temperature -300 °C"),
        (lambda: condensation(5.0, 10.0, 101325.0, humidity_percent=75.0), "pressure 101325 hPa"),
        (lambda: condensation(5.0, 10.0, 933.0, humidity_percent=120.0), "relative humidity 120 %"),
        (lambda: condensation(np.nan, 10.0, 933.0, humidity_percent=75.0), "surface temperature is not a number"),
        (
            lambda: condensation(5.0, 10.0, 933.0, humidity_percent=75.0, u=CondensationSpread(surface_c=-1.0)),
            "u_surface_c = -1 is invalid as a standard unc",
        ),
        (
            lambda: condensation(
                5.0, 10.0, 933.0, humidity_percent=75.0, u=CondensationSpread(surface_c=1.0, covariance_c2=1.0)
            ),
            "no correlation exceeds 1",
        ),
        (lambda: condensation(5.0, 10.0, 933.0, humidity_percent=75.0, formula="ciddor"), "unknown over ice"),
        (lambda: radiative_depression_k(10.0, 12.0), "dew point 2 °C above the air"),
        (lambda: radiative_depression_k(10.0, 2.0, wind=-1.0), "wind -1 m/s"),
        (lambda: radiative_depression_k(10.0, 2.0, emissivity=90.0), "emissivity 90"),
    ],
)
def test_values_out_of_range_are_refused_with_name_value_and_limit(call, text):
    with pytest.raises(ValidityError, match=text):
        call()
