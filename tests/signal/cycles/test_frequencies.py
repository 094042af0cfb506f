"""Lengths from several modulation frequencies: the exact search against brute force, its claims against scatter."""

from itertools import product

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.signal.cycles.cascade import cascade_length
from catseye.signal.cycles.frequencies import choose_frequencies, modulation_set
from catseye.signal.cycles.joint_length import JointStatus, joint_length

C = 299_792_458.0
N_AIR = 1.00025324  # [PARKER04] eq. 1.49: 20 °C, 933 hPa, 50 %
PLAN = np.array([1500e6, 1500.5e6, 1510e6])


def phases(length, f, n=N_AIR, noise=0.0):
    """[PARKER04] eq. 5.12 at each frequency: phase falls as the length grows."""
    turns = -2 * np.asarray(length)[..., None] * n * f / C
    return np.mod(2 * np.pi * turns + noise, 2 * np.pi)


def brute(phase, f, u_phase, low, high):
    """Best and second best of every set of whole cycles at all, by plain loops; optical lengths."""
    half = C / (2 * f)
    u = u_phase * half / (2 * np.pi)
    first = np.arange(np.floor(low / half[0]), np.ceil(high / half[0]) + 2)
    found = []
    for n0 in first:
        l0 = (n0 - phase[0] / (2 * np.pi)) * half[0]
        near = [np.rint(l0 / h + p / (2 * np.pi)) + np.arange(-1, 2) for h, p in zip(half[1:], phase[1:], strict=True)]
        for others in product(*near):
            each = (np.array([n0, *others]) - phase / (2 * np.pi)) * half
            mean = np.sum(each / u**2) / np.sum(1 / u**2)
            if low <= mean <= high:
                found.append((np.sum(((each - mean) / u) ** 2), mean))
    return sorted(found)[:2]


@pytest.mark.parametrize("f", [[1500e6, 1510e6], [1500e6, 1503e6, 1531e6], [1480e6, 1500e6, 1507e6, 1513e6]])
def test_the_search_agrees_with_brute_force(f):
    rng = np.random.default_rng(7)
    f = np.array(f)
    u = 0.01  # rad, so noisy that the second best is near
    low, high = 20.0, 34.0  # within every beat here
    true = rng.uniform(low + 0.1, high - 0.1, 6)
    noisy = phases(true, f, 1.0, u * rng.standard_normal((6, len(f))))
    found = joint_length(noisy, f, u_phase=u, within=(low, high))
    for i in range(6):
        best, second = brute(noisy[i], f, u, low, high)
        assert found.length[i] == pytest.approx(best[1], abs=1e-9)
        assert found.misfit[i] == pytest.approx(best[0], rel=1e-6, abs=1e-6)
        assert found.next_length[i] == pytest.approx(second[1], abs=1e-9)
        assert found.discrimination[i] == pytest.approx(second[0] - best[0], rel=1e-6)


def test_a_length_is_recovered_with_its_claimed_uncertainty():
    rng = np.random.default_rng(8)
    u = 1.5e-3
    true = rng.uniform(5.0, 200.0, 1000)
    n = N_AIR + 3e-5 * rng.standard_normal(true.size)
    noisy = phases(true, PLAN, n[:, None], u * rng.standard_normal((true.size, 3)))
    found = joint_length(noisy, PLAN, u_phase=u, within=(5.0, 200.0), group_index=n)
    assert (found.status == JointStatus.FOUND).all()
    z = (found.length - true) / found.u_length
    assert np.std(z) == pytest.approx(1.0, abs=0.06)  # three standard deviations of 1500
    assert np.mean(z) == pytest.approx(0.0, abs=0.08)
    assert np.mean(found.misfit) == pytest.approx(2.0, abs=0.16)  # chi-square of two degrees of freedom
    np.testing.assert_array_equal(found.cycles, np.rint(true[:, None] * n[:, None] * 2 * PLAN / C + noisy / 2 / np.pi))
    assert np.median(found.u_length) == pytest.approx(u / np.sqrt(3) * C / (4 * np.pi * 1503.5e6 * N_AIR), rel=1e-3)


def test_slips_are_as_frequent_as_claimed():
    rng = np.random.default_rng(9)
    f, u = np.array([1500e6, 1501.2e6, 1530e6]), 0.04
    true = rng.uniform(30.0, 60.0, 3000)
    noisy = phases(true, f, 1.0, u * rng.standard_normal((true.size, 3)))
    found = joint_length(noisy, f, u_phase=u, within=(30.0, 60.0))
    slipped = np.abs(found.length - true) > 0.04
    claimed = found.slip_probability
    assert 0.05 < np.mean(slipped) < 0.6
    assert np.mean(slipped) == pytest.approx(np.mean(claimed), abs=4 * np.sqrt(np.mean(claimed * (1 - claimed)) / 3000))
    for low, high in ((0.0, 0.05), (0.05, 0.3), (0.3, 0.9)):  # for each shot, not only on average
        some = (claimed > low) & (claimed <= high)
        expected = claimed[some]
        scatter = np.sqrt(np.mean(expected * (1 - expected)) / some.sum())
        assert np.mean(slipped[some]) == pytest.approx(np.mean(expected), abs=4 * scatter)
    assert not np.any(slipped & (found.status == JointStatus.FOUND))


def test_phases_that_fit_no_length_are_a_misfit_and_no_number_is_unknown():
    good = phases(np.array([50.0, 50.0, 50.0]), PLAN)
    good[1, 1] += 0.1  # a hundred standard uncertainties: another beat length, and then the third phase is off
    good[2, 2] = np.nan
    found = joint_length(good, PLAN, u_phase=1e-3, within=(5.0, 200.0), group_index=N_AIR)
    assert found.status.tolist()[0] == JointStatus.FOUND
    assert found.status.tolist()[1] == JointStatus.MISFIT
    assert found.status.tolist()[2] == JointStatus.UNKNOWN
    assert np.isnan(found.length[2])
    assert found.length[0] == pytest.approx(50.0, abs=1e-9)


def test_a_plan_repeats_itself_after_half_the_wavelength_of_the_greatest_common_divisor():
    for f, divisor in (([1500e6, 1510e6], 10e6), ([1500e6, 1506e6, 1515e6], 3e6), ([1500e6, 1500.5e6], 0.5e6)):
        beat = C / (2 * divisor)
        alias = modulation_set(f, u_phase=1e-6, span=beat * 1.001)
        assert not alias.unambiguous
        assert alias.first_alias == pytest.approx(beat, rel=1e-12)
        assert alias.separation == pytest.approx(0.0, abs=1e-3)
        assert modulation_set(f, u_phase=1e-6, span=beat * 0.999).unambiguous


def test_two_frequencies_separate_lengths_by_their_phase_difference():
    # by hand: one cycle of the beat up, the phases of 1500 and 1510 MHz miss each other by 2 pi / 151 per carrier cycle
    u, f = 1e-3, np.array([1500e6, 1510e6])
    plan = modulation_set(f, u_phase=u, span=10.0)
    gap = C / (2 * 1500e6) - C / (2 * 1510e6)  # after one cycle of each
    us = u * C / (4 * np.pi * f)
    assert plan.separation == pytest.approx(gap / np.hypot(*us), rel=1e-9)
    assert plan.nearest == pytest.approx(C / (2 * 1505e6), rel=1e-4)


def test_frequencies_that_cannot_separate_lengths_are_refused():
    with pytest.raises(ValidityError, match=r"1500, 1510 MHz confuse lengths 14\.9\d\d m apart"):
        joint_length(phases(np.array([20.0]), PLAN[[0, 2]]), PLAN[[0, 2]], u_phase=1e-3, within=(5.0, 200.0))
    with pytest.raises(ValidityError, match="confuse lengths"):  # the beat is long enough, the noise too large
        joint_length(phases(np.array([20.0]), PLAN[:2]), PLAN[:2], u_phase=1e-3, within=(5.0, 200.0))
    for f in ([1500e6], [1500e6, 1500e6], [1500e6, -1.0]):
        with pytest.raises(ValidityError, match="two or more are expected"):
            modulation_set(f, u_phase=1e-3, span=10.0)
    with pytest.raises(ValidityError, match=r"u_phase 0\.0 rad is not above 0"):
        modulation_set(PLAN, u_phase=0.0, span=10.0)
    with pytest.raises(ValidityError, match=r"limits 10\.0 to 5\.0 m"):
        joint_length(phases(np.array([20.0]), PLAN), PLAN, u_phase=1e-3, within=(10.0, 5.0))


@pytest.mark.parametrize(("span", "u_phase", "count"), [(5.0, 1e-4, 2), (200.0, 1e-3, 3), (200.0, 0.014, 4)])
def test_the_fewest_frequencies_are_chosen_and_pass(span, u_phase, count):
    plan = choose_frequencies(span, u_phase=u_phase)
    assert len(plan.frequencies_hz) == count
    assert plan.unambiguous
    assert plan.slip_probability < 1e-5  # five sigma, a handful of neighbours
    assert all(f % 1e3 == 0 for f in plan.frequencies_hz)
    assert max(plan.frequencies_hz) <= 1.55e9
    again = modulation_set(plan.frequencies_hz, u_phase=u_phase, span=span)
    assert again == plan


def test_a_band_too_narrow_for_the_noise_is_refused():
    with pytest.raises(ValidityError, match=r"tell 200\.0 m apart at 0\.1 rad: the best reach"):
        choose_frequencies(200.0, u_phase=0.1, widest_hz=5e6)
    with pytest.raises(ValidityError, match="needs frequencies"):
        choose_frequencies(0.1, u_phase=1e-3, widest_hz=5e6)


def test_the_joint_search_slips_where_the_cascade_slipped_already_more_often():
    rng = np.random.default_rng(10)
    u = 0.025
    f = np.array([1500e6, 1501e6, 1505e6, 1530e6])
    true = rng.uniform(5.0, 140.0, 1200)
    noisy = phases(true, f, 1.0, u * rng.standard_normal((true.size, 4)))
    stepped = cascade_length(noisy, f, u_phase=u, low=0.0)
    joint = joint_length(noisy, f, u_phase=u, within=(0.0, 149.0))
    slipped = [np.mean(np.abs(length - true) > 0.04) for length in (stepped.length, joint.length)]
    assert slipped[0] > 0.03
    assert slipped[1] < 0.7 * slipped[0]
    assert np.mean(stepped.thin[np.abs(stepped.length - true) > 0.04]) > 0.95  # and the cascade says where


def test_the_cascades_steps_have_the_margins_that_the_beats_leave():
    u = 1e-3
    stepped = cascade_length(phases(np.array([123.456]), PLAN), PLAN, u_phase=u, low=5.0, group_index=N_AIR)
    assert stepped.length[0] == pytest.approx(123.456, abs=1e-9)
    quarter = C / (4 * np.array([10e6, 1500e6]) * N_AIR)  # of the beat of 10 MHz, and of the carrier
    np.testing.assert_allclose(stepped.margin[0], quarter, rtol=1e-6)  # no noise: the misfit is nothing
    half = C / (2 * np.array([0.5e6, 10e6, 1500e6]) * N_AIR) * u / (2 * np.pi)
    # by hand: the steps' lengths are -(p1 - p0) h0, -(p2 - p0) h1, -p0 h2 in units of phase
    expected = [np.hypot(np.hypot(half[0], half[1]), half[0] - half[1]), np.hypot(half[1], half[1] + half[2])]
    np.testing.assert_allclose(stepped.u[0], expected, rtol=1e-9)
    assert stepped.thin.tolist() == [False]


def test_the_cascade_flags_lengths_so_near_a_limit_that_noise_carries_them_to_the_other():
    rng = np.random.default_rng(12)
    length = np.full(500, 5.02)  # 20 mm above the limit; the longest beat says it to 67 mm
    found = cascade_length(phases(length, PLAN, 1.0, 1e-3 * rng.standard_normal((500, 3))), PLAN, u_phase=1e-3, low=5.0)
    wrong = np.abs(found.length - length) > 0.01
    assert 0.2 < wrong.mean() < 0.6
    assert found.thin.all()


def test_no_number_is_thin_in_the_cascade_and_spoils_no_other():
    good = phases(50.0, PLAN, 1.0)
    found = cascade_length([good, [np.nan, 1.0, 2.0]], PLAN, u_phase=1e-3, low=5.0)
    assert found.thin.tolist() == [False, True]
    assert found.length[0] == pytest.approx(50.0, abs=1e-9)
    assert np.isnan(found.length[1])
    assert not found.cycles[1].any()


def test_no_shots_give_no_lengths_and_an_uncertainty_that_is_no_number_is_refused():
    assert joint_length(np.zeros((0, 3)), PLAN, u_phase=1e-3, within=(5.0, 200.0)).cycles.shape == (0, 3)
    for u in (np.nan, np.inf):
        with pytest.raises(ValidityError, match=r"u_phase .* is not finite"):
            modulation_set(PLAN, u_phase=u, span=200.0)
