"""Cyclic deviations against the phasors that make them, against scipy's quadrature, and the normal equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from catseye.errors import ValidityError
from catseye.signal.cycles.whole import fraction, unwrapped_length
from catseye.signal.systematics.cyclic import (
    cyclic_design,
    cyclic_orders,
    cyclic_range,
    cyclic_slope,
    imbalance_range,
    leakage_range,
    separable_orders,
)

WAVELENGTH = 0.199811  # m, 1500 MHz in air
TURN = np.linspace(0.0, 2 * np.pi, 401)
coefficients = st.integers(0, 5).flatmap(
    lambda k: st.tuples(*[st.lists(st.floats(-1e-4, 1e-4), min_size=k, max_size=k)] * 2)
)


def ranged(phasor):
    """Metres that the phase of a phasor stands for, by the notes' 5.18 without whole cycles: the independent road."""
    return unwrapped_length(0, fraction(np.angle(phasor), 0.0), WAVELENGTH / 2)


def too_long(disturbed, true):
    """Difference of two ranges, whole half wavelengths aside."""
    half = WAVELENGTH / 2
    return (ranged(disturbed) - ranged(true) + half / 2) % half - half / 2


def test_one_term_by_hand():
    # 3 um cos(2 x) + 1 um sin(x) at x = pi/6: 1.5 um + 0.5 um
    assert float(cyclic_range(np.pi / 6, [0.0, 3e-6], [1e-6, 0.0])) == pytest.approx(2e-6, abs=1e-20)


@given(coefficients, st.floats(-50, 50))
def test_a_full_turn_of_phase_changes_nothing(terms, x):
    assert abs(cyclic_range(x, *terms) - cyclic_range(x + 2 * np.pi, *terms)) <= 1e-16  # 50 rad, five orders of 0.1 mm


@given(coefficients, st.floats(0, 6.28))
def test_the_slope_is_the_difference_quotient(terms, x):
    h = 1e-5
    quotient = (cyclic_range(x + h, *terms) - cyclic_range(x - h, *terms)) / (2 * h)
    # third derivative, 5 orders of 5^3 1e-4 m, times h^2/6, and rounding of 1e-3 m over h
    assert abs(cyclic_slope(x, *terms) - quotient) <= 1e-11


@given(coefficients, st.lists(st.floats(0, 6.28), min_size=1, max_size=4))
def test_the_design_times_the_coefficients_is_the_range(terms, x):
    design = cyclic_design(np.array(x), len(terms[0]))
    assert design.shape == (len(x), 2 * len(terms[0]))
    np.testing.assert_allclose(design @ np.concatenate(terms), cyclic_range(np.array(x), *terms), rtol=0, atol=1e-18)


def test_no_terms_change_nothing():
    assert cyclic_range(np.zeros((2, 3)), [], []).tolist() == np.zeros((2, 3)).tolist()


@pytest.mark.parametrize("relative", [0.001j, 0.01 * np.exp(2j), 0.4 * np.exp(-1j)])
def test_leakage_is_the_range_of_light_and_leakage_together(relative):
    light = np.exp(1j * TURN)
    measured = light + relative
    x = np.angle(measured)
    np.testing.assert_allclose(
        leakage_range(x, relative, WAVELENGTH), too_long(measured, light), rtol=0, atol=1e-15
    )  # rounding of 0.1 m


def test_leakage_a_quarter_turn_ahead_reads_short():
    # at x = 0 a leakage along +90 degrees turns the sum forward: a phase too high is a range too short
    assert leakage_range(0.0, 0.01j, WAVELENGTH) < 0
    assert leakage_range(np.pi, 0.01j, WAVELENGTH) > 0


def test_leakage_has_odd_orders_of_the_measured_phase_and_all_orders_of_the_lights_own():
    r, a = 0.2, 0.7
    per = WAVELENGTH / (4 * np.pi)
    x = 2 * np.pi * np.arange(256) / 256
    _, cosine, sine = cyclic_orders(leakage_range(x, r * np.exp(1j * a), WAVELENGTH), 4)
    size = np.hypot(cosine, sine) / per
    assert size[0] == pytest.approx(r + r**3 / 8, rel=3e-4)  # next term 3 r^5/64
    assert size[2] == pytest.approx(r**3 / 24, rel=0.06)  # next term 3 r^5/128
    assert max(size[1], size[3]) < 1e-14
    # order 1 by hand: -per r sin(a - x) = per r (-sin a cos x + cos a sin x)
    assert cosine[0] == pytest.approx(-per * (r + r**3 / 8) * np.sin(a), rel=3e-4)
    assert sine[0] == pytest.approx(per * (r + r**3 / 8) * np.cos(a), rel=3e-4)
    own = too_long(np.exp(1j * x) + r * np.exp(1j * a), np.exp(1j * x))
    _, cosine, sine = cyclic_orders(own, 4)
    np.testing.assert_allclose(np.hypot(cosine, sine), per * r ** np.arange(1, 5) / np.arange(1, 5), rtol=1e-10)


@pytest.mark.parametrize(("gain", "skew"), [(0.01, 0.0), (0.0, 0.02), (-0.3, 0.4)])
def test_imbalance_is_the_range_of_two_unlike_channels(gain, skew):
    measured = np.cos(TURN) + 1j * (1 + gain) * np.sin(TURN + skew)
    got = imbalance_range(np.angle(measured), gain=gain, skew=skew, wavelength=WAVELENGTH)
    np.testing.assert_allclose(got, too_long(measured, np.exp(1j * TURN)), rtol=0, atol=1e-15)


def test_imbalance_is_of_order_two_with_the_signs_that_are_written():
    gain, skew, per = 1e-4, 3e-4, WAVELENGTH / (4 * np.pi)
    x = 2 * np.pi * np.arange(64) / 64
    mean, cosine, sine = cyclic_orders(imbalance_range(x, gain=gain, skew=skew, wavelength=WAVELENGTH), 3)
    second = per * 3e-7  # squares of gain and skew
    assert mean == pytest.approx(-per * skew / 2, abs=second)
    assert cosine[1] == pytest.approx(-per * skew / 2, abs=second)
    assert sine[1] == pytest.approx(-per * gain / 2, abs=second)
    assert np.hypot(cosine, sine)[[0, 2]].max() < 1e-16


def test_orders_are_the_integrals_of_fourier():
    def curve(x):
        return float(leakage_range(x, 0.3 * np.exp(1j), WAVELENGTH))

    _, cosine, sine = cyclic_orders(leakage_range(2 * np.pi * np.arange(200) / 200, 0.3 * np.exp(1j), WAVELENGTH), 3)
    for k in (1, 3):
        by_hand = [quad(lambda x, f=f, k=k: curve(x) * f(k * x) / np.pi, 0, 2 * np.pi)[0] for f in (np.cos, np.sin)]
        np.testing.assert_allclose([cosine[k - 1], sine[k - 1]], by_hand, rtol=0, atol=1e-13)


def test_a_short_rail_does_not_separate_order_one_from_zero():
    x = fraction(-4 * np.pi * np.linspace(0.0, 0.02, 40) / WAVELENGTH, 0.0)  # a fifth of a cycle
    found = separable_orders(x, 2)
    assert found.orders == ()
    assert found.inflation[0] > 5.0
    whole = separable_orders(fraction(-4 * np.pi * np.linspace(0.0, 0.3, 40) / WAVELENGTH, 0.0), 4)
    assert whole.orders == (1, 2, 3, 4)
    assert whole.inflation.max() < 1.2
    assert whole.condition < 2.0


@pytest.mark.parametrize(("points", "orders"), [(3, (1,)), (4, (1,)), (5, (1, 2)), (7, (1, 2, 3))])
def test_evenly_spaced_phases_do_not_separate_order_k_from_n_minus_k(points, orders):
    x = np.tile(2 * np.pi * np.arange(points) / points, 3)
    found = separable_orders(x, 3)
    assert found.orders == orders
    np.testing.assert_allclose(found.inflation[: len(orders)], 1.0, atol=1e-12)
    assert np.isinf(found.inflation[len(orders) :]).all()


@pytest.mark.parametrize("arc", [6.0, 4.0, 2.6])
def test_inflation_is_that_of_the_normal_equations(arc):
    x = np.random.default_rng(5).uniform(0, arc, 30)
    found = separable_orders(x, 2, worst=np.inf)
    for order in (1, 2):
        design = np.stack([f(k * x) for f in (np.cos, np.sin) for k in range(1, order + 1)] + [np.ones(30)], axis=1)
        u = np.sqrt(np.diag(np.linalg.inv(design.T @ design)) * 30 / 2)
        assert found.inflation[order - 1] == pytest.approx(max(u[order - 1], u[2 * order - 1]), rel=1e-8)
    assert found.inflation[1] > found.inflation[0] > 1.0


def test_nuisance_columns_affect_separability():
    x = fraction(-4 * np.pi * np.linspace(0.0, 0.11, 50) / WAVELENGTH, 0.0)
    slope = np.stack([np.ones(50), np.linspace(-1, 1, 50)], axis=1)
    assert separable_orders(x, 1, nuisance=slope).inflation[0] > separable_orders(x, 1).inflation[0] > 1.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: cyclic_range(0.0, [1e-6], []), "1 cosine and 0 sine coefficients do not pair"),
        (lambda: cyclic_design(0.0, [0, 1]), "not whole numbers of at least 1"),
        (lambda: leakage_range(0.0, 1.2, 0.2), r"leakage 1\.2 of the light is not below 1"),
        (lambda: imbalance_range(0.0, gain=-1.0, skew=0.0, wavelength=0.2), "is no channel"),
        (lambda: cyclic_orders(np.zeros(4), 2), "4 points of a cycle do not resolve 2 orders"),
    ],
)
def test_bad_input_is_refused_in_one_line(call, message):
    with pytest.raises(ValidityError, match=message):
        call()
