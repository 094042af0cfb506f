"""Leakage as a vector in the phase plane."""

import numpy as np
import pytest

from catseye.errors import EstimationError, ValidityError
from catseye.signal.detection.phase import detect
from catseye.signal.systematics.leakage import (
    blocked_leakage,
    circle_leakage,
    light_covariance,
    phase_by_leakage,
    phase_covariance,
    polar_covariance,
    quadrature_range_error,
    rail_leakage,
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


def assert_scatter_is(error, covariance, tolerance):
    """Complex errors against a claimed covariance: variances, and the correlation, which no mean square would miss."""
    parts = np.stack([error.real, error.imag])
    u = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(np.var(parts, axis=1) / u**2, 1.0, rtol=0, atol=tolerance)
    np.testing.assert_allclose(np.corrcoef(parts), covariance / np.outer(u, u), rtol=0, atol=tolerance)
    assert np.all(np.abs(parts.mean(axis=1)) < 4 * u / np.sqrt(len(error)))


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
    light, covariance = 2.0 * np.exp(2.2j), light_covariance(3e-3, 1e3 * ROUND)
    drawn = light + cloud(rng, 100_000, covariance)
    got = np.cov(np.abs(drawn), np.angle(drawn))
    # four standard deviations of 100 000 draws
    claimed = polar_covariance(light, covariance)
    np.testing.assert_allclose(got, claimed, atol=4 * np.sqrt(2e-5 * np.outer(*[np.diag(claimed)] * 2)).max())
    np.testing.assert_allclose(np.diag(got), np.diag(claimed), rtol=0.02)


@pytest.mark.parametrize("with_reference", [False, True])
def test_phases_of_many_shots_have_the_full_covariance_of_draws(with_reference):
    rng = np.random.default_rng(6)
    light = np.array([4.0, 0.9, 0.2, 2.0]) * np.exp(1j * np.array([0.3, 2.0, 4.0, 5.5]))
    reference = 6.5 * np.exp(1j * np.full(4, 1.1)) if with_reference else None
    claimed = phase_covariance(light, 3e-4, ROUND, reference=reference)
    wrong = cloud(rng, 50_000, ROUND)[:, None]
    noise = 3e-4 * (rng.standard_normal((50_000, 4)) + 1j * rng.standard_normal((50_000, 4)))
    turned = np.angle((light + noise - wrong) / light)
    if reference is not None:
        turned = turned - np.angle((reference - wrong) / reference)
    square = np.einsum("ti,ij,tj->t", turned, np.linalg.inv(claimed), turned)
    assert square.mean() / 4 == pytest.approx(1.0, abs=0.015)  # four standard deviations
    assert np.var(square) == pytest.approx(8.0, rel=0.08)  # chi-square with 4 degrees
    assert abs(claimed[2, 1]) > 0.1 * np.sqrt(claimed[2, 2] * claimed[1, 1])  # what they share counts


def test_blocked_sessions_give_their_scatter_as_uncertainty():
    rng = np.random.default_rng(7)
    leakage, sizes = 0.03 * np.exp(4j), [3, 8, 5, 20, 8, 8]
    session = np.repeat(np.arange(6), sizes)
    found, later = [], []
    for _ in range(1500):
        wander = cloud(rng, 6, ROUND)
        found.append(blocked_leakage(leakage + wander[session] + cloud(rng, len(session), 4e-8 * np.eye(2)), session))
        later.append(found[-1].phasor - leakage - cloud(rng, 1, ROUND)[0])
    error = np.array([f.phasor for f in found]) - leakage
    claimed = np.mean([f.covariance for f in found], axis=0)
    assert_scatter_is(error, claimed, 0.11)  # three standard deviations of 1500 trials
    in_use = np.mean([f.covariance_in_use for f in found], axis=0)
    # too large by the noise of the sessions' means, 4e-8 mean(1/n), as it says, and by nothing else
    assert_scatter_is(np.array(later), in_use - 4e-8 * np.mean(1 / np.array(sizes)) * np.eye(2), 0.11)
    assert found[0].degrees_of_freedom == 5
    drifts = np.array([f.drift for f in found])
    assert np.mean(drifts) == pytest.approx(0.0, abs=0.08)
    assert np.std(drifts) == pytest.approx(1.0, abs=0.08)


def test_a_leakage_that_drifts_in_its_session_shows():
    rng = np.random.default_rng(8)
    steady = cloud(rng, 40, 1e-8 * np.eye(2))
    assert abs(blocked_leakage(steady).drift) < 3
    assert blocked_leakage(steady + np.linspace(0, 5e-4, 40)).drift > 4
    assert np.isnan(blocked_leakage(steady[:3]).drift)


def test_one_session_is_the_mean_of_its_buffers():
    z = cloud(np.random.default_rng(9), 12, ROUND)
    found = blocked_leakage(z)
    assert found.phasor == pytest.approx(z.mean())
    np.testing.assert_allclose(found.covariance, np.cov(z.real, z.imag) / 12, rtol=1e-13)


@pytest.mark.parametrize("arc", [2 * np.pi, np.pi, np.pi / 2])
def test_the_centre_of_the_circle_scatters_as_claimed(arc):
    rng = np.random.default_rng(10)
    leakage, u = 0.03 - 0.02j, 4e-3
    phase = np.linspace(0.3, 0.3 + arc, 30)
    clean = leakage + 2.0 * np.exp(1j * phase)
    found = [circle_leakage(clean + cloud(rng, 30, u**2 * np.eye(2)), u) for _ in range(800)]
    error = np.array([f.phasor for f in found]) - leakage
    assert_scatter_is(error, np.mean([f.covariance for f in found], axis=0), 0.15)  # three of 800
    assert np.mean([f.variance_factor for f in found]) == pytest.approx(1.0, abs=0.03)


def test_the_circle_of_scipy_is_ours():
    from scipy.optimize import least_squares

    rng = np.random.default_rng(11)
    z = 0.1 + 1.5 * np.exp(1j * rng.uniform(0, 4, 20)) + cloud(rng, 20, 1e-4 * np.eye(2))
    u = rng.uniform(0.005, 0.02, 20)
    theirs = least_squares(lambda p: (np.hypot(z.real - p[0], z.imag - p[1]) - p[2]) / u, [0, 0, 1], xtol=1e-14)
    ours = circle_leakage(z, u)
    np.testing.assert_allclose([ours.phasor.real, ours.phasor.imag], theirs.x[:2], rtol=0, atol=1e-7)
    np.testing.assert_allclose(ours.covariance, np.linalg.inv(theirs.jac.T @ theirs.jac)[:2, :2], rtol=1e-4)


def test_a_fading_return_deceives_the_circle_and_not_the_rail():
    distance = np.linspace(0.0, 0.1, 40)
    phase = -4 * np.pi * distance / 0.199811
    z = 0.03j + (2.0 - 1.5 * distance) * np.exp(1j * (phase + 1.0))
    assert abs(circle_leakage(z, 1e-3).phasor - 0.03j) > 5e-3
    found = rail_leakage(z, phase, 1e-3, fading=distance)
    assert found.phasor == pytest.approx(0.03j, abs=1e-13)
    assert rail_leakage(z, phase, 1e-3).variance_factor > 100
    assert rail_leakage(z, -phase, 1e-3, fading=distance).variance_factor > 1000  # the phase falls with distance


def test_the_rails_leakage_scatters_as_claimed():
    rng = np.random.default_rng(12)
    distance = np.linspace(0.0, 0.06, 25)
    phase = -4 * np.pi * distance / 0.199811
    u = np.linspace(2e-3, 6e-3, 25)
    clean = 0.03j + 2.0 * np.exp(1j * (phase + 1.0))
    noise = rng.standard_normal((1500, 25)) + 1j * rng.standard_normal((1500, 25))
    found = [rail_leakage(clean + u * e, phase, u, fading=distance) for e in noise]
    error = np.array([f.phasor for f in found]) - 0.03j
    assert_scatter_is(error, found[0].covariance, 0.11)
    assert np.mean([f.variance_factor for f in found]) == pytest.approx(1.0, abs=0.02)


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
        (lambda: blocked_leakage([0.1, 0.2]), EstimationError, "2 buffers in one session do not determine the scatter"),
        (
            lambda: blocked_leakage(np.ones(9), [0] * 5 + [1] * 4),
            EstimationError,
            "2 sessions do not determine the scatter",
        ),
        (lambda: circle_leakage(np.ones(3), 1e-3), EstimationError, "3 phasors do not determine a circle"),
        (lambda: circle_leakage(np.arange(9) + 0j, 1e-3), EstimationError, "do not form a circle"),
        (lambda: circle_leakage(np.ones(5) + 0j, 1e-3), EstimationError, "do not form a circle"),
        (lambda: circle_leakage(np.ones(5), 0.0), ValidityError, "not above 0"),
        (lambda: circle_leakage([1, 2, np.nan, 1j, 2j], 1e-3), ValidityError, "phasor 2 is .*nan.* V"),
        (lambda: blocked_leakage([1, 2, np.inf, 1j]), ValidityError, "phasor 2 is .*inf.* V"),
        (
            lambda: rail_leakage(np.ones(5), np.full(5, 0.3), 1e-3),
            EstimationError,
            "do not separate leakage from light",
        ),
    ],
)
def test_bad_input_is_refused_in_one_line(call, error, message):
    with pytest.raises(error, match=message):
        call()
