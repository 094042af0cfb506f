"""Leakage as a vector in the phase plane."""

import numpy as np
import pytest

from catseye.errors import EstimationError, ValidityError
from catseye.signal.detection.phase import detect
from catseye.signal.systematics.leakage import (
    circle_leakage,
    phase_by_leakage,
    polar_covariance,
    quadrature_range_error,
    rms_range_error,
    subtract_leakage,
    worst_range_error,
)


def test_leakage_in_the_samples_is_taken_out_of_the_phasor():
    j = 2 * np.pi * np.arange(640) / 64
    light, leak = 2.0 * np.cos(j - 1.2), 0.02 * np.cos(j - 5.0)
    phasor = subtract_leakage(detect(light + leak, 64).phasor, 0.02, 5.0)
    assert complex(phasor) == pytest.approx(2.0 * np.exp(1.2j), abs=1e-13)


def test_leakage_broadcasts_one_ranger_a_row():
    phasors = subtract_leakage(np.ones((3, 4)), np.array([[0.1], [0.2], [0.3]]), 0.0)
    np.testing.assert_allclose(phasors, np.broadcast_to([[0.9], [0.8], [0.7]], (3, 4)), rtol=0, atol=1e-15)


@pytest.mark.parametrize("ratio", [0.001, 0.1])
def test_quadrature_error_is_the_phase_of_the_disturbed_phasor(ratio):
    half = 0.0999
    turned = np.angle(1.0 + 1j * ratio)
    assert float(quadrature_range_error(ratio, 2 * half)) == pytest.approx(turned / (2 * np.pi) * half, rel=1e-14)


@pytest.mark.parametrize(("ratio", "excess"), [(0.001, 5e-7), (0.1, 5e-3)])
def test_the_worst_direction_exceeds_quadrature_as_the_docstring_says(ratio, excess):
    worst = np.angle(1.0 + ratio * np.exp(1j * np.linspace(0, 2 * np.pi, 1_000_001))).max()
    assert worst / np.arctan(ratio) - 1 == pytest.approx(excess, rel=0.1)


def cloud(rng, n, covariance):
    return rng.multivariate_normal(np.zeros(2), covariance, n) @ [1.0, 1j]


ROUND = np.array([[4.0, 1.5], [1.5, 1.0]]) * 1e-8  # V^2, of a leakage


@pytest.mark.parametrize("phase", [0.0, 0.7, 2.0, -2.5])
def test_the_derivative_is_the_difference_quotient(phase):
    detected, leakage, h = 2.0 * np.exp(1j * phase) + 0.03j, 0.03j, 1e-6
    by_hand = [np.angle((detected - leakage - h * d) / (detected - leakage + h * d)) / (2 * h) for d in (1.0, 1j)]
    from_formula = phase_by_leakage(subtract_leakage(detected, 0.03, np.pi / 2))
    np.testing.assert_allclose(from_formula, by_hand, rtol=0, atol=1e-9)


def test_more_leakage_taken_out_turns_the_phase_as_written():
    # a phasor along +90 degrees, leakage along 0 degrees too small by 0.01 of it: the phase is read 0.01 rad too low
    assert phase_by_leakage(1.0j)[0] == pytest.approx(1.0)
    assert np.angle(1.0j + 0.01) - np.pi / 2 == pytest.approx(-0.01, abs=1e-6)


def test_a_leakage_common_to_target_and_reference_cancels_where_their_phasors_are_alike():
    light = 2.0 * np.exp(0.4j)
    np.testing.assert_allclose(phase_by_leakage(light, light), 0.0, atol=1e-15)
    opposite = phase_by_leakage(light, -light)
    np.testing.assert_allclose(opposite, 2 * phase_by_leakage(light), rtol=1e-14)


def test_amplitude_and_phase_have_the_covariance_of_draws():
    rng = np.random.default_rng(4)
    light, covariance = 2.0 * np.exp(2.2j), 9e-6 * np.eye(2) + 1e3 * ROUND
    drawn = light + cloud(rng, 100_000, covariance)
    got = np.cov(np.abs(drawn), np.angle(drawn))
    # four standard deviations of 100 000 draws
    claimed = polar_covariance(light, covariance)
    np.testing.assert_allclose(got, claimed, atol=4 * np.sqrt(2e-5 * np.outer(*[np.diag(claimed)] * 2)).max())
    np.testing.assert_allclose(np.diag(got), np.diag(claimed), rtol=0.02)


def test_the_circle_of_scipy_is_ours():
    from scipy.optimize import least_squares

    rng = np.random.default_rng(11)
    z = 0.1 + 1.5 * np.exp(1j * rng.uniform(0, 4, 20)) + cloud(rng, 20, 1e-4 * np.eye(2))
    theirs = least_squares(lambda p: np.hypot(z.real - p[0], z.imag - p[1]) - p[2], [0, 0, 1], xtol=1e-14)
    assert circle_leakage(z) == pytest.approx(complex(*theirs.x[:2]), abs=1e-7)


@pytest.mark.parametrize("ratio", [1e-4, 0.1, 0.7, 1.0])
def test_worst_and_rms_are_those_of_all_directions(ratio):
    direction = np.linspace(0, 2 * np.pi, 200_001)[:-1] + 1e-7
    error = np.angle(1.0 + ratio * np.exp(1j * direction)) * 0.2 / (4 * np.pi)
    # ratio 1 has a corner, met to half a step
    assert float(worst_range_error(ratio, 0.2)) == pytest.approx(np.abs(error).max(), rel=2e-5)
    assert float(rms_range_error(ratio, 0.2)) == pytest.approx(np.sqrt(np.mean(error**2)), rel=2e-5)


def test_a_small_disturbance_of_any_phase_is_its_share_over_root_two():
    assert float(rms_range_error(1e-3, 4 * np.pi)) == pytest.approx(1e-3 / np.sqrt(2), rel=1e-6)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: worst_range_error(1.01, 0.2), ValidityError, "not within 0 to 1"),
        (lambda: rms_range_error(-0.1, 0.2), ValidityError, "not within 0 to 1"),
        (lambda: circle_leakage(np.ones(3)), EstimationError, "3 phasors do not determine a circle"),
        (lambda: circle_leakage(np.arange(9) + 0j), EstimationError, "do not form a circle"),
        (lambda: circle_leakage(np.ones(5) + 0j), EstimationError, "do not form a circle"),
        (lambda: circle_leakage(np.exp(1e-4j * np.arange(9))), EstimationError, "do not form a circle"),
    ],
)
def test_bad_input_is_refused_in_one_line(call, error, message):
    with pytest.raises(error, match=message):
        call()
