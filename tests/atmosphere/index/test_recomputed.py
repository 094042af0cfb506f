"""All models typed a second time in 30 digits, from the papers' equations: indices, group from phase, derivatives.

The second typing shares the constants' source with the first, so that it finds slips of algebra, not of the paper.
"""

import numpy as np
import pytest
from mpmath import mp, mpf

from catseye.atmosphere.index import rueger1990
from catseye.atmosphere.index.air import air, group_partials, group_refractivity, phase_refractivity

WEATHER = [(20, 933, 50), (0, 1013.25, 0), (-25, 880, 90), (35, 950, 100), (15, 700, 30), (0, 933, 100)]
WAVELENGTHS = ["0.633", "0.780", "0.850", "1.55"]


def owens_phase(t, p, e, sigma, carbon=None):
    kelvin = t + mpf("273.15")
    dry_p, s = p - e, sigma**2
    d_s = dry_p / kelvin * (1 + dry_p * (mpf("57.90e-8") - mpf("9.3250e-4") / kelvin + mpf("0.25844") / kelvin**2))
    bracket = mpf("-2.37321e-3") + mpf("2.23366") / kelvin - mpf("710.792") / kelvin**2 + mpf("7.75141e4") / kelvin**3
    d_w = e / kelvin * (1 + e * (1 + mpf("3.7e-4") * e) * bracket)
    dry = mpf("1646386.0") / (mpf("238.0185") - s) + mpf("47729.9") / (mpf("57.362") - s)
    vapour = mpf("6487.31") + mpf("58.058") * s - mpf("0.71150") * s**2 + mpf("0.08851") * s**3
    return (dry * d_s + vapour * d_w) * mpf("1e-8")


def buck(t, p, h):
    return (
        h / 100 * mpf("6.1121") * (mpf("1.0007") + mpf("3.46e-6") * p) * mp.exp(mpf("17.502") * t / (mpf("240.97") + t))
    )


def ciddor_z(t, pascal, x):
    kelvin = t + mpf("273.15")
    inner = mpf("1.58123e-6") - mpf("2.9331e-8") * t + mpf("1.1043e-10") * t**2
    inner += (mpf("5.707e-6") - mpf("2.051e-8") * t) * x + (mpf("1.9898e-4") - mpf("2.376e-6") * t) * x**2
    return 1 - pascal / kelvin * inner + (pascal / kelvin) ** 2 * (mpf("1.83e-11") - mpf("0.765e-8") * x**2)


def density(t, pascal, x, molar):
    return pascal * molar / (ciddor_z(t, pascal, x) * mpf("8.314510") * (t + mpf("273.15")))


def ciddor_phase(t, p, e, sigma, carbon=450):
    """The paper's own route by densities in kg/m³, whose gas constant and molar masses our form cancels."""
    s, pascal, x = sigma**2, 100 * p, e / p
    n_as = mpf("1e-8") * (mpf("5792105") / (mpf("238.0185") - s) + mpf("167917") / (mpf("57.362") - s))
    n_as *= 1 + mpf("0.534e-6") * (carbon - 450)
    n_ws = mpf("295.235") + mpf("2.6422") * s - mpf("0.032380") * s**2 + mpf("0.004028") * s**3
    n_ws *= mpf("1.022e-8")
    m_a, m_w = mpf("1e-3") * (mpf("28.9635") + mpf("12.011e-6") * (carbon - 400)), mpf("0.018015")
    dry = density(t, pascal, x, m_a) * (1 - x) / density(mpf(15), mpf(101325), mpf(0), m_a)
    vapour = density(t, pascal, x, m_w) * x / density(mpf(20), mpf(1333), mpf(1), m_w)
    return dry * n_as + vapour * n_ws


def ciddor_vapour(t, p, h):
    kelvin = t + mpf("273.15")
    exponent = mpf("1.2378847e-5") * kelvin**2 - mpf("1.9121316e-2") * kelvin + mpf("33.93711047")
    pure = mp.exp(exponent - mpf("6.3431645e3") / kelvin) / 100
    return h / 100 * pure * (mpf("1.00062") + mpf("3.14e-8") * 100 * p + mpf("5.6e-7") * t**2)


def closed_phase(t, p, e, sigma, carbon=None):
    """The geodesists' closed formula, whose group coefficients are printed: the phase's are 1, 1/3, 1/5 of them."""
    s = sigma**2
    standard = mpf("287.6155") + mpf("4.88660") / 3 * s + mpf("0.06800") / 5 * s**2
    kelvin = t + mpf("273.15")
    return (mpf("273.15") / mpf("1013.25") * standard * p / kelvin - mpf("11.27") * e / kelvin) * mpf("1e-6")


def barrell_phase(t, p, e, sigma, carbon=None):
    """In the resolution's mm Hg."""
    s, mm = sigma**2, mpf(760) / mpf("1013.25")
    standard = mpf("1e-6") * (mpf("287.604") + mpf("1.6288") * s + mpf("0.0136") * s**2)
    warmed = 1 + t / mpf("273.15")
    return standard / warmed * (p * mm) / 760 - mpf("5.5e-8") * (e * mm) / warmed


MODELS = {
    "rueger1990": (owens_phase, buck),
    "ciddor_hill1999": (ciddor_phase, ciddor_vapour),
    "iag1999_closed": (closed_phase, buck),
    "barrell_sears1963": (barrell_phase, buck),
}


def group(phase, t, p, e, sigma, carbon=450):
    return phase(t, p, e, sigma, carbon) + sigma * mp.diff(lambda s: phase(t, p, e, s, carbon), sigma)


@pytest.fixture(autouse=True)
def thirty_digits():
    with mp.workdps(30):
        yield


@pytest.mark.parametrize("wavelength", WAVELENGTHS)
@pytest.mark.parametrize("weather", WEATHER)
@pytest.mark.parametrize("name", MODELS)
def test_indices_are_those_of_the_equations_in_thirty_digits(name, weather, wavelength):
    phase, vapour = MODELS[name]
    t, p, h = map(mpf, weather)
    sigma, e = 1 / mpf(wavelength), vapour(t, p, h)
    light = {"wavelength_um": float(wavelength), "model": name}
    # double precision leaves 1e-15 of the refractivity times some tens of operations; the numeric derivative 1e-12
    assert float(phase_refractivity(*weather, **light)) == pytest.approx(float(phase(t, p, e, sigma)), rel=1e-13)
    assert float(group_refractivity(*weather, **light)) == pytest.approx(float(group(phase, t, p, e, sigma)), rel=1e-12)


@pytest.mark.parametrize("kind", ["group", "phase"])
@pytest.mark.parametrize("weather", WEATHER)
@pytest.mark.parametrize("name", MODELS)
def test_sensitivities_are_the_derivatives_of_the_equations(name, weather, kind):
    phase, vapour = MODELS[name]
    chosen = {"group": lambda *state: group(phase, *state), "phase": phase}[kind]
    t, p, h = map(mpf, weather)

    def index(t, p, h, e_more, carbon, wavelength):
        return chosen(t, p, vapour(t, p, h) + e_more, 1 / wavelength, carbon)

    state = air(*weather, model=name)
    slopes = state.sensitivity if kind == "group" else state.phase_sensitivity
    point = (t, p, h, mpf(0), mpf(450), mpf("0.780"))
    for axis, slope in enumerate(slopes):
        order = tuple(int(axis == other) for other in range(6))
        # a derivative of a numeric derivative in 30 digits keeps at least ten; models without carbon dioxide give zero
        assert float(slope) == pytest.approx(float(mp.diff(index, point, order)), rel=1e-9, abs=1e-25)


@pytest.mark.parametrize("weather", WEATHER)
@pytest.mark.parametrize("name", MODELS)
def test_partials_hold_the_vapour_pressure(name, weather):
    phase, vapour = MODELS[name]
    t, p, h = map(mpf, weather)
    point = (t, p, vapour(t, p, h), mpf(600), mpf("0.850"))
    slopes = group_partials(weather[0], weather[1], float(point[2]), model=name, co2_ppm=600.0, wavelength_um=0.850)
    for axis, slope in enumerate(slopes):
        order = tuple(int(axis == other) for other in range(5))
        expected = mp.diff(lambda t, p, e, carbon, w: group(phase, t, p, e, 1 / w, carbon), point, order)
        assert float(slope) == pytest.approx(float(expected), rel=1e-9, abs=1e-25)


def test_the_printed_group_form_of_vapour_is_the_phase_form_times_1_3_5_7():
    printed = (6487.31, 174.174, -3.55750, 0.61957)  # [PARKER04] eq. 1.25
    np.testing.assert_allclose(np.multiply((1, 3, 5, 7), rueger1990.VAPOUR.powers), printed, rtol=1e-12)


def test_the_notes_dry_air_is_peck_and_reeders_divided_by_the_standard_density_factor():
    scaled = [5791817.0 / rueger1990.DRY.poles[0][0], 167909.0 / rueger1990.DRY.poles[1][0]]  # [PECK72]
    # the ratio is the density factor at 288.16 K: 15 °C from the old ice point, 273.16 K; 3.5e-5, or 1e-8 of index
    standard = float(rueger1990.density_factors(15.01, 1013.25, 0.0).dry)
    # the coefficients carry six and seven digits
    np.testing.assert_allclose(scaled, standard, rtol=2e-6)
