"""Fringes: against fields multiplied out in time, against draws at random, and the laser's equation against scipy."""

import numpy as np
import pytest
from scipy.optimize import brentq

from catseye.errors import ValidityError
from catseye.signal.detection.phase import detect
from catseye.signal.systematics.feedback import (
    dephasing,
    feedback_fringe,
    feedback_parameter,
    fringe_contrast,
    fringe_uncertainty,
    interference_phase,
    optical_phase,
    regulation_phase,
)

LIGHT = 780e-9  # m


def modulated(contrast, theta, psi, depth):
    """Phase of the modulation in the power of two fields that interfere, the second later by psi; share q apart."""
    t = 2 * np.pi * np.arange(4096) / 64
    direct, late = 1 + depth * np.cos(t), 1 + depth * np.cos(t + psi)  # later: the phase of the samples falls
    phase = float(detect(direct + contrast * np.cos(theta) * np.sqrt(direct * late), 64).phase)
    return (phase + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("theta", [0.0, 1.0, np.pi])
@pytest.mark.parametrize("psi", [0.4, 1.6, 3.0, 5.0])
def test_interference_equals_the_product_of_the_fields(theta, psi):
    got = float(interference_phase(0.05, theta, psi))
    assert got == pytest.approx(modulated(0.05, theta, psi, 1e-4), abs=1e-8)
    # [interference_phase] says deep modulation makes up to 8 % more of it
    assert abs(got) <= abs(modulated(0.05, theta, psi, 0.7)) * (1 + 1e-9) + 1e-12
    assert abs(modulated(0.05, theta, psi, 0.7)) <= 1.09 * abs(got) + 1e-6


def test_interference_to_first_order_by_hand():
    # contrast 2e-3, bright fringe, detour of a quarter wavelength: -1e-3 rad, 15.9 um too long
    phase = float(interference_phase(2e-3, 0.0, np.pi / 2))
    assert phase == pytest.approx(-1e-3, rel=2e-3)
    assert -phase * 0.199811 / (4 * np.pi) == pytest.approx(15.9e-6, abs=0.05e-6)


def test_half_a_wavelength_of_light_is_one_fringe():
    assert float(optical_phase(1.0 + LIGHT / 2, LIGHT) - optical_phase(1.0, LIGHT)) == pytest.approx(
        2 * np.pi, rel=1e-8
    )
    bright, dark = optical_phase(np.array([0.0, LIGHT / 4]), LIGHT)
    assert float(regulation_phase(0.01, bright, 0.3)) == pytest.approx(3e-3)
    assert float(regulation_phase(0.01, dark, 0.3)) == pytest.approx(-3e-3)


def test_contrast_is_that_of_two_fields():
    theta = np.linspace(0, 2 * np.pi, 1001)
    power = np.abs(1 + np.sqrt(1e-4) * np.exp(1j * theta)) ** 2
    assert float(fringe_contrast(1e-4)) == pytest.approx(np.ptp(power) / 2, rel=1e-12)
    assert float(fringe_contrast(1e-4, 0.5)) == pytest.approx(0.01)


@pytest.mark.parametrize("u_displacement", [0.0, 20e-9, 100e-9, 1e-6])
def test_correlation_between_shots_is_that_of_draws(u_displacement):
    rng = np.random.default_rng(1)
    first = rng.uniform(0, LIGHT, 200_000)
    second = first + u_displacement * rng.standard_normal(200_000)
    correlation = 2 * np.mean(np.cos(optical_phase(first, LIGHT)) * np.cos(optical_phase(second, LIGHT)))
    assert float(dephasing(u_displacement, LIGHT)) == pytest.approx(correlation, abs=0.008)  # four of 200 000 draws


@pytest.mark.parametrize("u_displacement", [0.0, 60e-9, 1e-6])
def test_the_claimed_uncertainty_of_a_mean_of_shots_is_the_scatter(u_displacement):
    rng = np.random.default_rng(2)
    shots = 5
    # all shots about one resting place, each displaced on its own: two of them differ by sqrt(2) of one
    place = rng.uniform(0, LIGHT, (40_000, 1)) + u_displacement / np.sqrt(2) * rng.standard_normal((40_000, shots))
    phase = regulation_phase(2e-3, optical_phase(place, LIGHT), 0.5)
    claimed = fringe_uncertainty(1e-3, shots=shots, correlation=dephasing(u_displacement, LIGHT))
    assert float(claimed) == pytest.approx(np.std(phase.mean(axis=1)), rel=0.02)  # four of 40 000 draws


def test_one_shot_has_arcsine_uncertainty_and_a_fixed_path_averages_nothing():
    assert float(fringe_uncertainty(1e-3)) == pytest.approx(1e-3 / np.sqrt(2))
    assert float(fringe_uncertainty(1e-3, shots=100)) == pytest.approx(1e-3 / np.sqrt(2))
    assert float(fringe_uncertainty(1e-3, shots=100, correlation=0.0)) == pytest.approx(1e-4 / np.sqrt(2))
    assert float(fringe_uncertainty(-1e-3)) == pytest.approx(1e-3 / np.sqrt(2))


@pytest.mark.parametrize(("c", "alpha"), [(0.0, 5.0), (0.5, 3.0), (0.95, 5.0)])
def test_the_lasers_phase_solves_its_equation(c, alpha):
    alone = np.linspace(-10, 10, 41)
    got = feedback_fringe(alone, c, alpha)
    for x, phase in zip(alone, got, strict=True):
        root = brentq(lambda p, x=x: p + c * np.sin(p + np.arctan(alpha)) - x, x - 1.01, x + 1.01, xtol=1e-14)
        assert phase == pytest.approx(root, abs=1e-11)


@pytest.mark.parametrize(("c", "alpha"), [(0.3, 3.0), (0.9, 5.0)])
def test_a_leaning_fringe_has_the_written_mean_and_mean_square(c, alpha):
    alone = np.linspace(0, 2 * np.pi, 20_000, endpoint=False)
    wave = np.cos(feedback_fringe(alone, c, alpha))
    assert wave.mean() == pytest.approx(c / (2 * np.sqrt(1 + alpha**2)), abs=1e-9)
    assert np.mean(wave**2) == pytest.approx(0.5, abs=1e-9)


def test_the_feedback_parameter_by_hand_and_its_powers():
    given = {"laser_path": 1e-3, "facet_reflectance": 0.32, "enhancement": 5.0}
    # 1e5 round trips ratio x 0.68/sqrt(0.32) x 1e-6 x sqrt(26)
    one = float(feedback_parameter(1e-12, 100.0, **given))
    assert one == pytest.approx(1e5 * 0.68 / 0.565685 * 1e-6 * 5.09902, rel=1e-5)
    assert float(feedback_parameter(4e-12, 50.0, **given)) == pytest.approx(one)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fringe_contrast(1.5), r"returned power 1\.5 is not within 0 to 1"),
        (lambda: fringe_contrast(0.1, -0.5), r"coherence -0\.5 is not within 0 to 1"),
        (lambda: interference_phase(1.0, 0.0, 1.0), "contrast of a fringe 1 is not within 0 to below 1"),
        (lambda: fringe_uncertainty(1.0, shots=0), "number of shots 0 is not at least 1"),
        (lambda: fringe_uncertainty(1.0, correlation=1.1), r"correlation between shots 1\.1 is not within 0 to 1"),
        (
            lambda: feedback_fringe(0.0, 1.0, 5.0),
            "feedback parameter 1 is not within 0 to below 1, where the laser does not jump",
        ),
        (
            lambda: feedback_parameter(1e-9, 1.0, laser_path=1e-3, facet_reflectance=1.0, enhancement=5.0),
            "reflectance of the laser's facet 1 is not between 0 and 1",
        ),
    ],
)
def test_bad_input_is_refused_in_one_line(call, message):
    with pytest.raises(ValidityError, match=message):
        call()
