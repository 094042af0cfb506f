"""Amplitude-to-phase coupling: signs, inverse, the fit against numpy's polynomial, its scatter, a test that fails."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import EstimationError, ValidityError
from catseye.signal.systematics.amplitude import (
    amplitude_by_coefficient,
    amplitude_phase,
    fit_amplitude_phase,
    remove_amplitude_phase,
)

LADDER = 5.0 * np.exp(-np.linspace(0.0, 3.0, 13))  # V, attenuated to a twentieth
volts = st.floats(1e-3, 10.0)
couplings = st.floats(-0.01, 0.01)


@given(volts, volts, couplings, couplings, st.floats(-10, 10))
def test_coupling_added_can_be_removed(amplitude, reference, coefficient, quadratic, phase):
    measured = phase + amplitude_phase(amplitude, reference, coefficient, quadratic=quadratic)
    back = remove_amplitude_phase(measured, amplitude, reference, coefficient=coefficient, quadratic=quadratic)
    assert abs(back - phase) <= 1e-14


@given(volts, volts, volts, couplings)
def test_attenuators_in_a_row_add_their_phases(a, b, c, coefficient):
    whole = amplitude_phase(a, c, coefficient)
    assert abs(whole - amplitude_phase(a, b, coefficient) - amplitude_phase(b, c, coefficient)) <= 1e-16


def test_a_return_of_half_the_reference_by_hand():
    # 2 mrad a factor e: -2e-3 ln 2 rad; the range then reads 22 um too long at 1500 MHz
    added = float(amplitude_phase(1.0, 2.0, 2e-3))
    assert added == pytest.approx(-1.3862944e-3, abs=1e-10)
    assert -added * 0.199811 / (4 * np.pi) == pytest.approx(22.0e-6, abs=0.1e-6)


def test_derivatives_are_those_of_the_model():
    by = amplitude_by_coefficient(LADDER, 2.0)
    np.testing.assert_allclose(
        by @ [1e-3, 2e-4], amplitude_phase(LADDER, 2.0, 1e-3, quadratic=2e-4), rtol=1e-14, atol=1e-18
    )


@pytest.mark.parametrize("quadratic", [False, True])
def test_the_fit_is_numpys_polynomial(quadratic):
    rng = np.random.default_rng(3)
    u = 5e-4 / LADDER
    phase = 1.0 + amplitude_phase(LADDER, 2.0, 2e-3) + u * rng.standard_normal(13)
    found = fit_amplitude_phase(LADDER, phase, u, reference_amplitude=2.0, quadratic=quadratic)
    expected, covariance = np.polyfit(np.log(LADDER / 2.0), phase, 1 + quadratic, w=1 / u, cov="unscaled")
    order = [1, 2, 0] if quadratic else [0, 1]  # coefficient, phase, quadratic
    got = [found.coefficient, found.phase, found.quadratic][: len(order)]
    np.testing.assert_allclose(got, expected[order], rtol=1e-9)
    np.testing.assert_allclose(found.covariance, covariance[np.ix_(order, order)], rtol=1e-9)


@pytest.mark.parametrize("start", [0.0, 1e-4, 3.0, 2 * np.pi - 1e-4, 100.0])
def test_phases_across_a_full_turn_are_combined(start):
    phase = np.mod(start + amplitude_phase(LADDER, 2.0, 3e-3), 2 * np.pi)
    found = fit_amplitude_phase(LADDER, phase, 1e-4, reference_amplitude=2.0)
    assert found.coefficient == pytest.approx(3e-3, abs=1e-13)
    assert np.cos(found.phase - start) == pytest.approx(1.0, abs=1e-15)


def test_a_drift_column_is_estimated():
    time = np.linspace(-1, 1, 13)
    phase = 2.0 + amplitude_phase(LADDER, 2.0, 2e-3) + 1e-3 * time
    deceived = fit_amplitude_phase(LADDER, phase, 1e-5, reference_amplitude=2.0)
    assert abs(deceived.coefficient - 2e-3) > 5e-4  # the ladder only went down
    there_and_back = np.concatenate([LADDER, LADDER[::-1]])
    along = np.linspace(-1, 1, 26)
    phase = 2.0 + amplitude_phase(there_and_back, 2.0, 2e-3) + 1e-3 * along
    found = fit_amplitude_phase(there_and_back, phase, 1e-5, reference_amplitude=2.0, others=along[:, None])
    assert found.coefficient == pytest.approx(2e-3, abs=1e-12)
    assert found.fit.coefficient[-1] == pytest.approx(1e-3, abs=1e-12)
    assert found.covariance.shape == (2, 2)


def test_claimed_uncertainty_equals_scatter_and_the_test_has_its_false_alarm_rate():
    rng = np.random.default_rng(11)
    u = 3e-4 / LADDER
    fits = []
    for _ in range(1500):
        phase = 1.0 + amplitude_phase(LADDER, 2.0, 2e-3) + u * rng.standard_normal(13)
        fits.append(fit_amplitude_phase(LADDER, phase, u, reference_amplitude=2.0))
    normalised = np.array([(f.coefficient - 2e-3) / f.u_coefficient for f in fits])
    assert np.mean(normalised) == pytest.approx(0.0, abs=0.08)
    assert np.std(normalised) == pytest.approx(1.0, abs=0.06)  # three of 1/sqrt(2 * 1500)
    assert np.mean([not f.suffices() for f in fits]) == pytest.approx(0.05, abs=0.018)


def test_a_bend_fails_the_line_and_the_quadratic_term_finds_it():
    rng = np.random.default_rng(12)
    phase = 1.0 + amplitude_phase(LADDER, 2.0, 2e-3, quadratic=5e-4) + 1e-4 * rng.standard_normal(13)
    line = fit_amplitude_phase(LADDER, phase, 1e-4, reference_amplitude=2.0)
    assert line.suffices() is False
    assert line.curvature > 5.0  # with its sign
    bent = fit_amplitude_phase(LADDER, phase, 1e-4, reference_amplitude=2.0, quadratic=True)
    assert bent.suffices() is True
    assert abs(bent.quadratic - 5e-4) < 4 * bent.u_quadratic
    assert abs(bent.coefficient - 2e-3) < 4 * bent.u_coefficient


def test_residual_leakage_looks_like_coupling_and_fails_the_test():
    phase = np.angle(LADDER * np.exp(1j) + 0.01 * np.exp(1j * (1 + np.pi / 2)))
    found = fit_amplitude_phase(LADDER, phase, 1e-4, reference_amplitude=2.0)
    assert found.coefficient < -1e-3
    assert found.suffices() is False


def test_two_attenuations_give_a_line_and_no_test():
    found = fit_amplitude_phase([1.0, 2.0], [0.1, 0.102], 1e-4, reference_amplitude=1.0)
    assert found.coefficient == pytest.approx(2e-3 / np.log(2), rel=1e-9)
    assert found.suffices() is None
    assert np.isnan(found.fit.variance_factor)


def test_bad_input_is_refused_in_one_line():
    with pytest.raises(ValidityError, match=r"amplitude 0\.0 V is not above 0"):
        amplitude_phase([1.0, 0.0], 1.0, 1e-3)
    with pytest.raises(ValidityError, match=r"reference amplitude -1\.0 V is not above 0"):
        amplitude_phase(1.0, -1.0, 1e-3)
    with pytest.raises(EstimationError, match="3 readings do not separate 2 coefficients"):
        fit_amplitude_phase([1.0, 1.0, 1.0], np.zeros(3), 1e-4, reference_amplitude=1.0)
