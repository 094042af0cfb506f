"""Whole cycles at their edges, the doubt about them, and the memo's rule that slips."""

import numpy as np
import pytest
from scipy.special import erfc

from catseye.errors import ValidityError
from catseye.signal.cycles.whole import (
    CycleStatus,
    decision,
    fraction,
    glass_phase,
    memo_whole_cycles,
    slip_probability,
    unwrapped_length,
    whole_cycles,
)

HALF = 0.099905518  # m, half a modulation wavelength in air of 20 °C, 933 hPa, 50 %


@pytest.mark.parametrize("tiny", [-1e-17, -5e-324, -1e-300, -1e-16])
def test_a_tiny_negative_difference_does_not_become_a_full_turn(tiny):
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


def exact_slip(misfit, u, half):
    """Posterior probability of all other integers, summed without any series: 400 of them to each side."""
    k = np.arange(-400, 401) * half
    log = -0.5 * ((misfit + k) / u) ** 2
    weight = np.exp(log - log.max())
    return 1.0 - np.exp(log[400] - log.max()) / weight.sum()


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 0.7, 0.99, 1.01, 1.6, 5.0, 30.0])  # 1: where the series changes
def test_the_probability_of_a_slip_is_the_sum_over_all_other_integers(share):
    misfit = np.linspace(-0.5, 0.5, 41) * HALF
    expected = [exact_slip(m, share * HALF, HALF) for m in misfit]
    # 1e-8: the Fourier form leaves out its third term, 2 exp(-18 pi^2)
    np.testing.assert_allclose(slip_probability(misfit, share * HALF, HALF), expected, rtol=1e-8, atol=1e-14)


def test_midway_between_two_integers_both_are_equally_likely():
    assert float(slip_probability(0.5 * HALF, 1e-4, HALF)) == pytest.approx(0.5, abs=1e-12)
    assert float(slip_probability(0.05, 0.0, 0.1)) == 0.5


def test_slips_are_as_frequent_as_claimed():
    # a coarse length wrong by 25 mm (1 sigma): erfc(HALF / (2 sqrt 2 u)) of all shots slip, 4.6 %
    rng = np.random.default_rng(41)
    true = rng.uniform(5.0, 200.0, 150_000)
    u_coarse, u_phase = 0.025, 2e-3
    phase = fraction(-2 * np.pi * true / HALF + u_phase * rng.standard_normal(true.size), 0.0)
    d = decision(true + u_coarse * rng.standard_normal(true.size), phase, HALF, u_coarse=u_coarse, u_phase=u_phase)
    slipped = np.abs(unwrapped_length(d.cycles, phase, HALF) - true) > 0.5 * HALF
    prior = erfc(HALF / (2 * np.sqrt(2) * np.hypot(u_coarse, u_phase * HALF / (2 * np.pi))))
    scatter = np.sqrt(prior / true.size)
    assert np.mean(slipped) == pytest.approx(prior, abs=4 * scatter)
    assert np.mean(d.slip_probability) == pytest.approx(prior, abs=4 * scatter)
    for low, high in ((0.001, 0.01), (0.01, 0.1), (0.1, 0.5)):  # and for each misfit, not only on average
        some = (d.slip_probability > low) & (d.slip_probability <= high)
        claimed = d.slip_probability[some].mean()
        assert np.mean(slipped[some]) == pytest.approx(claimed, abs=4 * np.sqrt(claimed / some.sum()))


def test_a_decision_is_thin_where_misfit_and_five_u_reach_a_quarter_wavelength():
    edge = 0.5 * HALF - 5 * np.hypot(0.004, 0.001 * HALF / (2 * np.pi))
    coarse = 100 * HALF + np.array([edge - 1e-9, edge + 1e-9, -edge + 1e-9, -edge - 1e-9])
    d = decision(coarse, 0.0, HALF, u_coarse=0.004, u_phase=0.001)
    assert d.cycles.tolist() == [100] * 4
    assert d.thin.tolist() == [False, True, False, True]
    np.testing.assert_allclose(d.misfit, coarse - 100 * HALF, rtol=0, atol=1e-12)  # above zero: coarse is too long
    np.testing.assert_allclose(d.margin + np.abs(d.misfit), 0.5 * HALF, rtol=0, atol=1e-12)


def test_a_shot_without_coarse_length_or_uncertainty_is_unknown_and_spoils_no_other():
    d = decision([10.0, np.nan, 10.0], 0.5, HALF, u_coarse=[0.001, 0.001, np.nan], u_phase=0.001)
    assert d.status.tolist() == [CycleStatus.SURE, CycleStatus.UNKNOWN, CycleStatus.UNKNOWN]
    assert np.isfinite(d.slip_probability).tolist() == [True, False, False]
    with pytest.raises(ValidityError, match=r"u_coarse = -0\.1 is negative"):
        decision(10.0, 0.5, HALF, u_coarse=-0.1, u_phase=0.001)


def memo_geometry(count, rng):
    """Prism distances of the memo's calibration: D_TOPPL some 18 m, prisms aside by half of D12, 635 mm.

    [GOLDMAN00] figures 7 and 9: D1 is the hypotenuse over D_TOPPL and the way from its foot to the prism, here half the
    spacing: 2.8 mm longer at 18 m.
    """
    toppl = 18.0 + rng.uniform(-5.0, 5.0, count) * HALF
    return toppl, np.hypot(toppl, 0.5 * 0.635)


def test_any_coarse_length_bounded_by_a_quarter_wave_less_5_u_never_slips_and_the_memos_rule_does():
    rng = np.random.default_rng(404)
    count = 1_000_000
    true = rng.uniform(5.0, 200.0, count)
    half = 299_792_458.0 / (2 * 1.5e9 * (1.0 + rng.uniform(1.8e-4, 3.2e-4, count)))
    u_phase = 10.0 ** rng.uniform(-4, -1, count)
    noise = u_phase * rng.standard_normal(count)
    phase = fraction(-2 * np.pi * true / half + noise, 0.0)
    bound = 0.5 * half - 5 * u_phase * half / (2 * np.pi)
    coarse = true + np.where(rng.random(count) < 0.5, rng.uniform(-1, 1, count), rng.choice([-1, 1], count)) * bound
    cycles, _ = whole_cycles(coarse, phase, half)
    off = unwrapped_length(cycles, phase, half) - true
    assert np.abs(off + noise * half / (2 * np.pi)).max() < 1e-9  # phase too large: length too short

    toppl, d1 = memo_geometry(count, rng)
    assert 0.0027 < np.median(d1 - toppl) < 0.0029
    zrg = rng.uniform(0.0, 2 * np.pi, count)  # Phi_ZRG + Phi_Cal, 3.4b
    target = fraction(zrg - 2 * np.pi * d1 / HALF, 0.0)
    memo = memo_whole_cycles(toppl, target - zrg, HALF)
    slip = np.rint((unwrapped_length(memo, target - zrg, HALF) - d1) / HALF)
    assert set(np.unique(slip)) == {-1.0, 0.0}  # D_TOPPL is the shorter one
    assert np.mean(slip != 0) == pytest.approx(0.028, abs=0.002)  # 2.8 mm of 99.9 mm: about 3 % of the placements
    ours, margin = whole_cycles(toppl, fraction(target, zrg), HALF)
    np.testing.assert_allclose(unwrapped_length(ours, fraction(target, zrg), HALF), d1, rtol=0, atol=1e-9)
    np.testing.assert_allclose(margin, HALF / 2 - (d1 - toppl), rtol=0, atol=1e-9)


def test_the_memos_rule_is_right_where_its_coarse_length_is_exact():
    rng = np.random.default_rng(5)
    true = rng.uniform(5.0, 60.0, 100_000)
    zrg = rng.uniform(0.0, 2 * np.pi, true.size)
    target = fraction(zrg - 2 * np.pi * true / HALF, 0.0)
    away = np.abs(true / HALF - np.rint(true / HALF)) > 1e-6  # on a multiple itself rounding decides
    memo = memo_whole_cycles(true, target - zrg, HALF)
    np.testing.assert_allclose(unwrapped_length(memo, target - zrg, HALF)[away], true[away], rtol=0, atol=1e-9)


def test_the_memos_rule_refuses_values_outside_its_limits():
    for coarse, phase, half in ((10.0, 7.0, HALF), (-1.0, 0.0, HALF), (10.0, 0.0, 0.0)):
        with pytest.raises(ValidityError):
            memo_whole_cycles(coarse, phase, half)
    assert memo_whole_cycles([np.nan, 10.02], 0.0, 0.1).tolist() == [0, 100]  # equal phases: 3.13a, none added


def test_the_notes_glass_offset_and_the_range_constant_are_one_correction():
    half, length, constant = 0.099906, 57.123, -0.0334937
    phase = fraction(-2 * np.pi * (length - constant) / half, 0.0)  # glass makes the way longer
    n, _ = whole_cycles(length - constant, phase, half)
    by_length = unwrapped_length(n, phase, half) + constant
    by_phase = (n - phase / (2 * np.pi) - glass_phase(constant, half) / (2 * np.pi)) * half  # eq. 5.19
    assert by_phase == pytest.approx(by_length, abs=1e-12)
    assert by_length == pytest.approx(length, abs=1e-12)
    with pytest.raises(ValidityError, match="half wavelength"):
        glass_phase(constant, 0.0)
