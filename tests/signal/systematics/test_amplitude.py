"""Amplitude-to-phase coupling: signs, attenuators in a row, derivatives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.signal.systematics.amplitude import amplitude_by_coefficient, amplitude_phase

LADDER = 5.0 * np.exp(-np.linspace(0.0, 3.0, 13))  # V, attenuated to a twentieth
volts = st.floats(1e-3, 10.0)
couplings = st.floats(-0.01, 0.01)


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


def test_bad_input_is_refused_in_one_line():
    with pytest.raises(ValidityError, match=r"amplitude 0\.0 V is not above 0"):
        amplitude_phase([1.0, 0.0], 1.0, 1e-3)
    with pytest.raises(ValidityError, match=r"reference amplitude -1\.0 V is not above 0"):
        amplitude_phase(1.0, -1.0, 1e-3)
