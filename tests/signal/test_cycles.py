"""Whole cycles at their edges, and the memo's rule that slips."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.signal.cycles import fraction, unwrapped_length, whole_cycles

HALF = 0.099905518  # m, half a modulation wavelength in air of 20 °C, 933 hPa, 50 %


@pytest.mark.parametrize("tiny", [-1e-17, -5e-324, -1e-300, -1e-16])
def test_a_tiny_negative_difference_does_not_become_a_whole_turn(tiny):
    assert 0.0 <= float(fraction(tiny, 0.0)) < 2 * np.pi
    assert 0.0 <= float(fraction(2 * np.pi + tiny, 2 * np.pi)) < 2 * np.pi


def test_phase_falls_as_distance_grows():
    # [PARKER04] 5.12 by hand: 1 m beyond D0 at a half wavelength of 0.4 m is 2.5 cycles back, so half a turn is left
    phase = fraction(-2 * np.pi * 1.0 / 0.4, 0.0)
    assert float(phase) == pytest.approx(np.pi, abs=1e-12)
    cycles, margin = whole_cycles(1.0, phase, 0.4)
    assert int(cycles) == 3
    assert float(margin) == pytest.approx(0.2, abs=1e-12)
    assert float(unwrapped_length(cycles, phase, 0.4)) == pytest.approx(1.0, abs=1e-12)


def test_a_coarse_length_half_way_has_no_margin():
    assert float(whole_cycles(1.5 * HALF, 0.0, HALF)[1]) == pytest.approx(0.0, abs=1e-16)


def test_a_shot_without_a_coarse_length_is_marked_and_spoils_no_other():
    cycles, margin = whole_cycles([10.0, np.nan, np.inf], 0.5, HALF)
    assert cycles.dtype == np.int64
    assert cycles.tolist() == [100, 0, 0]
    assert np.isnan(margin).tolist() == [False, True, True]


def test_a_half_wavelength_of_zero_is_refused():
    with pytest.raises(ValidityError, match=r"half wavelength 0\.0 m is not above 0"):
        whole_cycles(10.0, 0.5, [HALF, 0.0])


def test_the_memos_integer_rule_slips_where_ours_does_not():
    # [GOLDMAN00] 3.13: D_TOPPL stands for the range but is shorter by some 2.8 mm at 18 m
    true = np.linspace(18.0, 18.0 + 40 * HALF, 40_001)
    phase = fraction(-2 * np.pi * true / HALF, 0.0)
    coarse = true - 0.0028
    memo = np.trunc(coarse / HALF) + (phase > 0)  # INT, plus one where the phase difference is negative (3.7b)
    memo_error = np.abs(unwrapped_length(memo, phase, HALF) - true)
    ours, margin = whole_cycles(coarse, phase, HALF)
    assert 0.02 < np.mean(memo_error > 0.09) < 0.04  # about 3 % of the placements, by a half wavelength
    np.testing.assert_allclose(unwrapped_length(ours, phase, HALF), true, rtol=0, atol=1e-11)
    np.testing.assert_allclose(margin, HALF / 2 - 0.0028, rtol=0, atol=1e-11)
