"""Phase and index of a fixed path: the notes' printed numbers, signs, whole cycles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.reduction.air.group_index import (
    absolute_group_index,
    group_index,
    length_sensitivity,
    phase_slope,
)
from catseye.signal.cycles.whole import CycleStatus

C, F = 299_792_458.0, 1500e6
LENGTHS = st.floats(5.0, 1000.0)
INDICES = st.floats(1.0001, 1.0004)


def flight_phase(index, length):
    """Phase of the light that took 2 n L / c: minus the periods it was under way. No formula of ours."""
    return -2.0 * np.pi * F * (2.0 * index * length / C)


def test_the_slope_of_100_m_is_minus_6287_5_rad_where_the_notes_print_plus_6283():
    """P 1.34 takes c as 3e8 m/s; P 1.32 has the sign of a phase that grows. One ppm is 6.29 mrad."""
    assert float(phase_slope(100.0)) == pytest.approx(-6287.535, abs=5e-4)
    assert 4.0 * np.pi * F * 100.0 / 3e8 == pytest.approx(6283.0, abs=0.5)  # how the print came about
    assert float(phase_slope(100.0)) * 1e-6 == pytest.approx(-6.28e-3, abs=0.01e-3)


def test_half_a_radian_and_25_mm_in_100_m_make_1_988e_8():
    """P 1.39 prints 1.98e-8, cut."""
    found = float(length_sensitivity(0.5, path_length=100.0)) * 0.025
    assert found == pytest.approx(1.988e-8, abs=0.0005e-8)
    assert f"{found:.4e}".startswith("1.98")


@given(LENGTHS, INDICES, st.floats(-3e-5, 3e-5))
def test_the_phase_falls_as_the_index_rises_by_the_slope(length, index, change):
    """P 1.36, which prints plus, with the sign of 5.18."""
    moved = flight_phase(index + change, length) - flight_phase(index, length)
    assert moved / float(phase_slope(length)) == pytest.approx(change, abs=1e-12)
    if change > 1e-9:
        assert moved < 0.0


@given(LENGTHS, INDICES, st.floats(-0.02, 0.02))
def test_any_coarse_length_within_20_mm_finds_the_whole_cycles(length, index, off):
    expected = index + off / length
    found = absolute_group_index(
        flight_phase(index, length), path_length=length, u_path_length=0.002, expected_index=expected,
        u_expected_index=0.0, u_phase=1e-3,
    )  # fmt: skip
    assert found.status == CycleStatus.SURE
    # rounding: the phase of 1 km is 6e4 rad, an ulp of it 1e-11 of the index
    assert float(found.group_index) == pytest.approx(index, abs=3e-11)


@pytest.mark.parametrize(("off", "u_length"), [(0.0496, 1e-4), (0.0, 0.011)])
def test_an_uncertain_length_gives_no_index(off, u_length):
    found = absolute_group_index(
        flight_phase(1.00025, 100.0), path_length=100.0, u_path_length=u_length, expected_index=1.00025 + off / 100.0,
        u_expected_index=1e-6, u_phase=1e-3,
    )  # fmt: skip
    assert found.status == CycleStatus.THIN
    assert np.isnan(found.group_index)
    assert np.isnan(found.u)


def test_the_uncertainty_of_the_absolute_index_is_the_lengths_and_the_phases():
    rng = np.random.default_rng(1)
    length, u_length, u_phase = 100.0, 2e-5, 2e-3
    true = length + u_length * rng.normal(size=20000)
    phase = flight_phase(1.00026, true) + u_phase * rng.normal(size=20000)
    found = absolute_group_index(
        phase, path_length=length, u_path_length=u_length, expected_index=1.00025, u_expected_index=2e-6,
        u_phase=u_phase,
    )  # fmt: skip
    # 20 000 draws: the scatter is known to 0.5 %
    assert np.std(found.group_index) == pytest.approx(float(found.u[0]), rel=0.02)
    assert float(found.u[0]) == pytest.approx(np.hypot(0.2e-6, 2e-3 / 6287.5), rel=1e-3)


def test_another_modulation_scales_the_slope_and_the_uncertainty():
    assert float(phase_slope(100.0, modulation_hz=750e6)) == pytest.approx(-6287.535 / 2, abs=5e-4)
    kept = {"path_length": 100.0, "u_path_length": 1e-9, "expected_index": 1.0003, "u_expected_index": 0.0}
    u = [float(absolute_group_index(1.0, u_phase=1e-3, modulation_hz=f, **kept).u) for f in (1500e6, 750e6)]
    assert u[1] == pytest.approx(2.0 * u[0], rel=1e-3)


def test_a_length_below_zero_is_refused_by_value():
    with pytest.raises(ValidityError, match=r"path length -1.0 m is not above 0"):
        group_index(1.0, 5, path_length=-1.0)
    with pytest.raises(ValidityError, match="modulation frequency"):
        phase_slope(100.0, modulation_hz=0.0)
