"""The phase-locked filter's pieces: its oscillator against scipy's matrix exponential, gains, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm, solve_continuous_lyapunov
from scipy.special import erf

from catseye.errors import EstimationError, ValidityError
from catseye.optics.detector import quadrant_position
from catseye.signal.vibration.filter import Mode, decay_of, driven, driven_within, follow, start, window_gain
from catseye.signal.vibration.modes import _innovations, find_modes

W, D = 2 * np.pi * 1.3, 0.3


def oscillator():
    """x'' + 2 d x' + (w^2 + d^2) x = force, in displacement and velocity; and the map to real and imaginary part."""
    return np.array([[0.0, 1.0], [-(W**2 + D**2), -2.0 * D]]), np.array([[1.0, 0.0], [-D / W, -1.0 / W]])


@pytest.mark.parametrize("step", [1e-3, 0.05, 0.4, 3.0])
def test_driven_covariance_solves_the_differential_equation(step):
    system, to_z = oscillator()
    # force of the strength that makes the rate 4 d S of the imaginary part, S = 1
    strength = np.outer([0.0, 1.0], [0.0, 1.0]) * 4.0 * D * W**2
    moves = expm(system * step)
    stationary = solve_continuous_lyapunov(system, -strength)
    brought = stationary - moves @ stationary @ moves.T
    np.testing.assert_allclose(driven(W, D, step), to_z @ brought @ to_z.T, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(driven(W, D, np.inf), to_z @ stationary @ to_z.T, rtol=1e-12, atol=1e-15)


def test_without_force_the_filter_moves_as_the_differential_equation():
    system, to_z = oscillator()
    zeta = D / np.hypot(W, D)
    assert decay_of(W, zeta) == pytest.approx(D, rel=1e-14)
    state = start(0.0, [Mode(W / (2 * np.pi), zeta, np.eye(1), 0.01)], u_offset=1.0)
    begun = np.array([1.0, 2.0])
    state.mean[:2] = to_z @ begun
    later = state.advanced(0.7)
    path = solve_ivp(lambda _, x: system @ x, (0, 0.7), begun, rtol=1e-11, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(later.mean[:2], to_z @ path, rtol=0, atol=1e-9)
    assert later.expected_sample()[0][0] == pytest.approx(path[0], abs=1e-9)


@given(st.floats(0.01, 2.0), st.floats(0.01, 2.0))
def test_two_steps_are_one(first, second):
    modes = [Mode(1.3, 0.02, np.array([[2.0, 0.5], [0.5, 1.0]]), 0.01, drift_hz=0.01), Mode(2.9, 0.01, np.eye(2), 0.02)]
    state = start(0.0, modes, u_offset=0.5, offset_walk=0.1)
    state.mean[:4] = [1.0, -0.5, 0.3, 2.0]
    one, two = state.advanced(first + second), state.advanced(first).advanced(first + second)
    np.testing.assert_allclose(two.mean, one.mean, rtol=0, atol=1e-12)
    # the walk of the frequency turns with the mode: the one step takes its quarter after the turn, to first order
    np.testing.assert_allclose(two.covariance, one.covariance, rtol=0, atol=0.02)
    rest = start(0.0, [modes[1]], u_offset=0.5)  # nothing walks here: exactly
    np.testing.assert_allclose(
        rest.advanced(first).advanced(first + second).covariance, rest.advanced(first + second).covariance, atol=1e-12
    )


@pytest.mark.parametrize("window", [0.0, 1e-6, 0.02, 0.128, 0.7])
def test_a_window_shows_the_mean_of_the_wave(window):
    gain, slope = window_gain(W, D, window)
    if window:
        real = quad(lambda u: np.exp(-D * u) * np.cos(W * u), -window / 2, window / 2)[0] / window
        imag = quad(lambda u: np.exp(-D * u) * np.sin(W * u), -window / 2, window / 2)[0] / window
        assert gain == pytest.approx(complex(real, imag), abs=1e-10)
    else:
        assert gain == 1.0
    step = 1e-5
    assert slope == pytest.approx(
        (window_gain(W + step, D, window)[0] - window_gain(W - step, D, window)[0]) / (2 * step), abs=1e-9
    )


@pytest.mark.parametrize("window", [0.01, 0.128, 1.0])
def test_the_forces_part_in_a_window_is_the_integral(window):
    half = quad(lambda r: ((1 - np.cos(W * r)) / (W * window)) ** 2, 0.0, window / 2)[0]
    assert driven_within(W, D, window) == pytest.approx(8.0 * D * half, rel=2e-3)  # the series for a short one


def test_jacobian_of_the_filter_is_the_slope_of_its_model():
    modes = [Mode(1.3, 0.02, np.eye(2), 0.01), Mode(2.9, 0.01, np.eye(2), 0.02)]
    state = start(0.0, modes, u_offset=0.5)
    rng = np.random.default_rng(2)
    state.mean[:8] = rng.normal(size=8)

    def shown(mean):
        return replace(state, mean=mean).advanced(0.23).expected_sample(0.128)[0]

    n = len(state.mean)
    slopes = np.stack([(shown(state.mean + h) - shown(state.mean - h)) / 2e-6 for h in 1e-6 * np.eye(n)], axis=-1)
    later = state.advanced(0.23)
    rows = later.expected_sample(0.128)[1]
    # the covariance of a unit change in each state, carried by the filter
    carried = []
    quiet = replace(state, covariance=np.zeros((n, n)))
    noise = quiet.advanced(0.23).covariance
    for unit in np.eye(n):
        moved = replace(state, covariance=np.outer(unit, unit)).advanced(0.23).covariance - noise
        carried.append(rows @ moved @ rows.T)
    expected = [np.outer(column, column) for column in slopes.T]
    np.testing.assert_allclose(carried, expected, rtol=0, atol=1e-8)


def test_lost_samples_give_no_update_and_partial_samples_update_their_axis():
    state = start(0.0, [Mode(2.0, 0.01, np.eye(2) * 1e-6, 0.05)], u_offset=1e-3)
    after, innovation, _ = state.updated(0.0, [np.nan, np.nan], np.eye(2) * 1e-8)
    np.testing.assert_array_equal(after.covariance, state.covariance)
    assert np.isnan(innovation).all()
    half = state.updated(0.0, [1e-3, np.nan], np.eye(2) * 1e-8)[0]
    assert half.covariance[0, 0] < 0.6 * state.covariance[0, 0]
    assert half.covariance[1, 1] == pytest.approx(state.covariance[1, 1], rel=1e-12)


def test_amplitude_and_phase_are_those_of_the_swing():
    t = np.arange(3000) / 200.0
    seen = np.stack([2e-3 * np.cos(2 * np.pi * 0.8 * t + 0.4), 1e-3 * np.cos(2 * np.pi * 0.8 * t - 1.0)], axis=-1)
    state = start(0.0, [Mode(0.82, 0.002, np.eye(2) * 2e-6, 0.03)], u_offset=0.01)
    found = follow(state, t, seen + np.array([0.003, -0.001]), noise=np.eye(2) * 1e-10).state
    size, u_size = found.amplitudes()
    phase, u_phase = found.phases()
    expected = 2 * np.pi * 0.8 * t[-1] + np.array([0.4, -1.0])
    off = (phase[0] - expected + np.pi) % (2 * np.pi) - np.pi
    assert np.all(np.abs(size[0] - [2e-3, 1e-3]) < 4 * u_size[0])
    assert np.all(np.abs(off) < 4 * u_phase[0])
    assert np.all(u_size[0] < 6e-5)
    np.testing.assert_allclose(found.mean[-2:], [0.003, -0.001], rtol=0, atol=2e-5)


def test_the_uncertainty_of_a_prediction_grows_to_the_size_of_the_mode():
    mode = Mode(7.0, 0.02, np.eye(1) * 4e-6, 0.01)
    t = np.arange(400) / 100.0
    state = follow(
        start(0.0, [mode], u_offset=1e-3), t, 1e-3 * np.cos(44.0 * t)[:, None], noise=np.eye(1) * 1e-10
    ).state
    _, spread = state.predicted(t[-1] + np.array([0.0, 0.1, 0.3, 1.0, 30.0]))
    u = np.sqrt(spread[:, 0, 0])
    assert np.all(np.diff(u) > 0)
    assert u[0] < 6e-5  # the force may have changed it since the last samples
    assert u[-1] == pytest.approx(2e-3, rel=0.01)


def test_the_quadrant_detector_sees_a_gaussian_spot():
    w, x, y = 1e-3, 2e-5, -1e-5
    right, up = 0.5 * (1 + erf(np.sqrt(2) * x / w)), 0.5 * (1 + erf(np.sqrt(2) * y / w))
    signals = np.array([right * up, (1 - right) * up, (1 - right) * (1 - up), right * (1 - up)])
    place, covariance = quadrant_position(signals, slope=w * np.sqrt(np.pi / 8), u_signal=1e-4)
    np.testing.assert_allclose(place, [x, y], rtol=1e-3)  # the slope at the middle, 2 % of w off it
    rng = np.random.default_rng(4)
    noisy = quadrant_position(signals + 1e-4 * rng.standard_normal((20_000, 4)), slope=w * np.sqrt(np.pi / 8))[0]
    np.testing.assert_allclose(np.cov(noisy.T), covariance, rtol=0, atol=0.04 * covariance[0, 0])
    assert np.isnan(quadrant_position(np.zeros(4), slope=1.0)[0]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frequency_hz": 0.0}, "frequency_hz = 0.0 of a mode"),
        ({"damping_ratio": 1.0}, "damping_ratio = 1.0 of a mode"),
        ({"covariance": np.zeros((2, 2))}, "a variance of 0"),
        ({"covariance": np.array([[1.0, 2.0], [2.0, 1.0]])}, "negative eigenvalue"),
        ({"u_frequency_hz": -0.1}, "u_frequency_hz = -0.1 of a mode"),
        ({"u_frequency_hz": np.nan}, "u_frequency_hz = nan of a mode"),
    ],
)
def test_a_mode_that_cannot_be_is_refused(change, message):
    with pytest.raises(ValidityError, match=message):
        Mode(**({"frequency_hz": 1.0, "damping_ratio": 0.01, "covariance": np.eye(2), "u_frequency_hz": 0.1} | change))


def test_wrong_order_shape_or_too_few_samples_are_refused():
    state = start(1.0, [Mode(1.0, 0.01, np.eye(2), 0.1)], u_offset=1.0)
    with pytest.raises(ValidityError, match="samples must come in order"):
        state.advanced(0.5)
    with pytest.raises(ValidityError, match="expected \\(3, 2\\)"):
        follow(state, [1.0, 1.1, 1.2], np.zeros((3, 1)), noise=np.eye(2))
    with pytest.raises(ValidityError, match="modes have 2 kinds of axes"):
        start(0.0, [Mode(1.0, 0.01, np.eye(2), 0.1), Mode(2.0, 0.01, np.eye(1), 0.1)], u_offset=1.0)
    with pytest.raises(EstimationError, match="do not determine 2 modes"):
        find_modes(np.arange(10.0), np.zeros((10, 1)), count=2, u_sample=1.0)


def test_non_oscillating_motion_is_not_a_mode():
    rng = np.random.default_rng(3)
    t = np.arange(400) / 20.0
    drifting = np.cumsum(rng.standard_normal((400, 1)), axis=0) * 1e-3
    with pytest.raises(EstimationError, match=r"not a vibration|did not converge"):
        find_modes(t, drifting, count=1, u_sample=1e-6, near_hz=[0.2])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"times": np.arange(40.0)[::-1]}, "times do not increase"),
        ({"times": np.zeros(40)}, "times do not increase"),
        ({"times": np.where(np.arange(40) == 5, np.nan, np.arange(40.0))}, "times do not increase"),
        ({"u_sample": 0.0}, "u_sample = 0.0 m"),
        ({"count": 2, "near_hz": [2.3]}, r"near_hz = \[2.3\] for 2 modes"),
        ({"near_hz": [-2.3]}, "expected one above 0"),
    ],
)
def test_invalid_samples_for_modes_are_refused(change, message):
    told = {"times": np.arange(40.0), "samples": np.sin(np.arange(40.0))[:, None], "count": 1, "u_sample": 0.1} | change
    with pytest.raises(ValidityError, match=message):
        find_modes(told.pop("times"), told.pop("samples"), **told)


def test_a_still_target_scatters_by_sample_noise_alone():
    """A mode without force leaves an offset that k samples before give to u / sqrt(k): variance u^2 (1 + 1/k)."""
    t, u = 0.1 * np.arange(40), 2e-3
    still = np.array([[W, np.log(0.05), -40.0]])  # sigma of the force e^-40
    _, variances = _innovations(still, t, np.zeros((40, 1)), u, 0.01, 1)
    np.testing.assert_allclose(variances[0, 1:], u**2 * (1.0 + 1.0 / np.arange(1, 40)), rtol=1e-6)
