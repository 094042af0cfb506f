"""Harmonics: the limit, what folds back, and what moves zero crossings."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.signal.detection.harmonics import (
    DISTORTED,
    SURE,
    crossing_shift,
    distorted,
    folded_error,
    kinked_bound,
    relative_harmonics,
)
from catseye.signal.detection.phase import detect
from catseye.signal.detection.zero_crossing import crossing_phase


def clipped(n, phase, top, bottom=-1.0):
    """One cycle of a cosine cut off above and below."""
    return np.clip(np.cos(2.0 * np.pi * np.arange(n) / n - phase), bottom, top)


@pytest.mark.parametrize("n", [16, 32, 64, 128])
@pytest.mark.parametrize("both", [False, True])
def test_clipping_turns_the_phase_by_less_than_the_bound_and_the_bound_is_close(n, both):
    """Exact clipping at every level and phase, against harmonics of the wave itself (from 4096 samples a cycle)."""
    closest = 0.0
    for level in np.linspace(0.2, 0.99, 80):
        bottom = -level if both else -1.0
        fine = np.abs(np.fft.rfft(clipped(4096, 0.0, level, bottom)))
        if max(fine[2], fine[3]) < 0.003 * fine[1]:
            continue
        bound = float(kinked_bound(fine[2] / fine[1], fine[3] / fine[1], n))
        phases = np.linspace(0.0, 2.0 * np.pi / n, 21)
        found = detect(np.array([clipped(n, phase, level, bottom) for phase in phases]), n).phase
        worst = float(np.max(np.abs(np.angle(np.exp(1j * (found - phases))))))
        assert worst <= bound
        closest = max(closest, worst / bound)
    assert closest > 0.4  # a bound, and not one ten times too wide


def test_the_limit_is_worth_a_quarter_of_a_usual_shots_noise():
    assert float(kinked_bound(0.0, DISTORTED, 64)) < 0.00075 / 4.0  # rad, noise of night-01's median shot


@pytest.mark.parametrize("order", [2, 3, 7, 15, 17, 31, 33])
def test_a_harmonic_turns_the_phase_as_told(order):
    """At the worst of all phases; orders next to a multiple of 16 fold, all others leave no trace."""
    x = 2.0 * np.pi * np.arange(16) / 16
    waves = np.array([np.cos(x) + 0.1 * np.cos(order * x - psi) for psi in np.linspace(0.0, 2.0 * np.pi, 721)])
    worst = float(np.max(np.abs(np.angle(detect(waves, 16).phasor))))
    assert worst == pytest.approx(float(folded_error(order, 0.1, 16)), abs=1e-6)
    assert (worst > 0.1) == (order in (15, 17, 31, 33))


def test_a_stronger_harmonic_may_turn_it_anywhere():
    assert float(folded_error(63, 1.5, 64)) == np.pi
    with pytest.raises(ValidityError, match="harmonic 1"):
        folded_error(1, 0.1, 64)


def test_noise_alone_is_not_distortion():
    """At a limit of zero one shot in 1500 of two harmonics would exceed SURE; with the limit none of 4000 here."""
    rng = np.random.default_rng(5)
    waves = np.cos(2.0 * np.pi * np.arange(2048) / 16) + rng.normal(0.0, 0.4, (4_000, 2048))
    seen = detect(waves, 16)
    relative, u = relative_harmonics(seen.harmonics, seen.amplitude, seen.u_phasor)
    assert not distorted(relative, u).any()
    beyond = np.mean(np.any(relative > SURE * u[:, None], axis=-1))
    assert beyond < 0.0025  # 2 exp(-8), 127 cycles' scatter of u, and 4 sigma of 4000 draws


def test_a_harmonic_above_the_limit_is_seen_and_one_below_is_not():
    x = 2.0 * np.pi * np.arange(8192) / 64
    rng = np.random.default_rng(6)
    noise = rng.normal(0.0, 0.05, (200, 8192))
    for share, seen_as in ((0.03, True), (0.017, False)):
        seen = detect(np.cos(x - 1.0) + share * np.cos(2 * x) + noise, 64)
        assert (distorted(*relative_harmonics(seen.harmonics, seen.amplitude, seen.u_phasor)) == seen_as).all()


def test_without_a_fundamental_nothing_is_distorted():
    relative, u = relative_harmonics([[0.1, 0.1]], [0.0], [0.01])
    assert np.isnan(relative).all()
    assert not distorted(relative, u).any()


@pytest.mark.parametrize("seed", range(6))
def test_zero_crossings_move_as_the_harmonics_say(seed):
    """512 samples a cycle, so that straight lines between samples matter little."""
    rng = np.random.default_rng(seed)
    x, phase, orders = 2.0 * np.pi * np.arange(512) / 512, rng.uniform(0.0, 2.0 * np.pi), (2, 3, 4, 5)
    overtones = 0.03 * (rng.normal(size=4) + 1j * rng.normal(size=4))
    wave = np.cos(x - phase) + sum(abs(b) * np.cos(k * x - np.angle(b)) for k, b in zip(orders, overtones, strict=True))
    shift, _ = crossing_shift(np.exp(1j * phase), list(overtones), orders)
    found = float(crossing_phase(np.tile(wave, 4), 512).phase)
    assert np.angle(np.exp(1j * (found - phase - shift))) == pytest.approx(
        0.0, abs=1e-5
    )  # straight lines where harmonics bend the edge
    assert abs(shift) > 1e-4


def test_a_third_harmonic_moves_a_crossing_by_its_share():
    """By hand: cos x + h sin 3x at x = pi/2 is -h, the slope -1: both edges come early by h."""
    shift, _ = crossing_shift(1.0, [0.001j], [3])
    assert shift == pytest.approx(-0.001, abs=1e-8)


def test_a_wave_with_other_edges_has_no_shift():
    assert all(np.isnan(crossing_shift(1.0, [3.0], [2])))
    assert all(np.isnan(crossing_shift(0.0, [3.0], [2])))
