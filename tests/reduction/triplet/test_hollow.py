"""A hollow target by itself: phases made from distances, whole cycles, and the zero-distance phase back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import catseye
from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError
from catseye.reduction.triplet.hollow import RangePhases, half_in_air, hollow_range, zero_phase_of

HALF = 0.09990551
turns = st.floats(0.0, 6.28)


@given(st.floats(1.0, 200.0), turns, turns, st.floats(-0.049, 0.049))
def test_any_coarse_length_within_a_quarter_wave_gives_the_distance(distance, reference, zero, off):
    """The phase falls as the way grows: two lengths of D and the constant parts, in waves of the modulation."""
    phase = float(np.mod(reference + zero - TWO_PI * 2.0 * distance / (2.0 * HALF), TWO_PI))
    phase = min(phase, np.nextafter(TWO_PI, 0.0))
    answer = hollow_range(RangePhases(phase, reference), distance + off, zero, HALF)
    assert answer.distance == pytest.approx(distance, abs=1e-11)
    back = zero_phase_of(RangePhases(phase, reference), distance, 0.0, HALF).zero_phase
    assert np.cos(back - zero) == pytest.approx(1.0, abs=1e-12)


def test_the_int_rule_slips_where_coarse_and_true_length_straddle_a_half_wavelength():
    """3.7: true 182.01 half wavelengths, coarse 181.99: INT gives one less, 99.9 mm; the nearest integer does not."""
    distance = 182.01 * HALF
    phase = float(np.mod(1.5 - TWO_PI * 182.01, TWO_PI))
    answer = hollow_range(RangePhases(phase, 1.0), distance - 0.02 * HALF, 0.5, HALF)
    assert answer.distance == pytest.approx(distance, abs=1e-12)
    assert answer.memo_distance == pytest.approx(distance - HALF, abs=1e-12)


def test_uncertainties_by_hand():
    phases = RangePhases(2.0, 1.0, 0.0004)
    assert hollow_range(phases, 18.2, 0.5, HALF).u_distance == pytest.approx(np.sqrt(2) * 0.0004 * HALF / TWO_PI)
    u = zero_phase_of(phases, 18.17, 20e-6, HALF).u_zero_phase
    assert u == pytest.approx(np.hypot(np.sqrt(2) * 0.0004, TWO_PI * 20e-6 / HALF))


def test_the_half_wavelength_is_the_memos():
    """[GOLDMAN00] table: HWLV 99.930819 mm, eta_A 1.00025324 at 20 deg C, 933 mb, 50 %."""
    half = half_in_air(20.0, 933.0, 50.0, modulation_hz=1500e6, wavelength_um=0.78, model="rueger1990")
    assert half * 1.00025324 == pytest.approx(99.930819e-3, abs=2e-9)
    assert half == pytest.approx(0.5 * SPEED_OF_LIGHT / 1500e6 / 1.000253247, abs=3e-11)  # the printed digits of eta


def test_a_thin_margin_is_doubtful_and_nonsense_is_refused():
    assert hollow_range(RangePhases(1.5, 1.0), 182.49 * HALF, 0.5, HALF).verdict.word == "doubtful"
    for wrong in (lambda: RangePhases(7.0, 1.0), lambda: hollow_range(RangePhases(1, 1), -1.0, 0.5, HALF)):
        with pytest.raises(ValidityError):
            wrong()


@pytest.mark.parametrize("wrong", [{}, {"coarse_m": 18.0}, {"distance_m": 18.0, "cal_rad": 0.5}])
def test_one_of_both_ways_is_asked_for(wrong):
    with pytest.raises(catseye.ArgumentError):
        catseye.range_triplets(phase_rad=1.0, zrg_rad=1.0, **wrong)
