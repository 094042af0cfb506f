"""The walk between references as states, against the full covariance of `drift_at`."""

import numpy as np
import pytest

from catseye.signal.drift.reference import drift_along, drift_at
from catseye.signal.drift.states import drift_states

WALK = 1.7e-4


def case(seed, *, references=6, shots=40):
    rng = np.random.default_rng(seed)
    times = rng.uniform(0.0, 1000.0, references)  # in no order
    variance = 1e-6 * rng.uniform(0.1, 3.0, references)
    return times, variance, rng.uniform(-150.0, 1150.0, shots), 1e-6 * rng.uniform(0.5, 2.0, shots)


@pytest.mark.parametrize("seed", range(5))
def test_the_errors_are_those_of_the_full_covariance(seed):
    times, variance, t, noise = case(seed)
    _, covariance = drift_at(times, np.zeros(6), variance, time=t, random_walk=WALK)
    states = drift_states(times, variance, time=t, random_walk=WALK, noise=noise)
    np.testing.assert_allclose(states.covariance, covariance, rtol=1e-9, atol=1e-16)
    np.testing.assert_allclose(
        np.sqrt(np.diag(states.covariance)),
        drift_along(times, np.zeros(6), variance, time=t, random_walk=WALK)[1],
        rtol=1e-9,
    )


def test_weak_modes_left_to_the_shots_keep_every_variance_and_all_but_their_correlation():
    times, variance, t, noise = case(7)
    whole = drift_states(times, variance, time=t, random_walk=WALK, noise=noise)
    limit = float(np.median(whole.strength))
    fewer = whole.without(limit)
    assert fewer.count == whole.count - np.count_nonzero(whole.strength <= limit)
    assert fewer.neglected == pytest.approx(whole.strength[whole.strength <= limit].max())
    np.testing.assert_allclose(np.diag(fewer.covariance), np.diag(whole.covariance), rtol=1e-9)
    scaled = (fewer.covariance - whole.covariance) / np.sqrt(np.outer(noise, noise))
    assert np.linalg.eigvalsh(scaled).min() > -fewer.neglected * 1.0001  # no combination is said to be surer by more
    assert np.abs(scaled).max() > 0.01 * fewer.neglected
    assert whole.without(0.0) is whole


def test_the_strongest_modes_agree_with_the_series_of_a_bridge():
    """Of a bridge the first sine has 6/pi^2 = 61 % of the mean variance, three 83 %."""
    t = np.linspace(0.0, 100.0, 402)[1:-1]
    states = drift_states(np.array([0.0, 100.0]), np.full(2, 1e-12), time=t, random_walk=WALK, noise=np.ones(400))
    share = np.cumsum(states.strength) / states.strength.sum()
    assert share[0] == pytest.approx(6 / np.pi**2, abs=2e-3)
    assert share[2] == pytest.approx(6 / np.pi**2 * (1 + 1 / 4 + 1 / 9), abs=2e-3)


def test_references_at_one_time_and_a_walk_of_nothing():
    t, noise = np.array([10.0, 20.0, 70.0]), np.ones(3)
    twice = drift_states(np.array([0.0, 0.0, 50.0]), np.full(3, 2e-6), time=t, random_walk=WALK, noise=noise)
    _, covariance = drift_at(np.array([0.0, 0.0, 50.0]), np.zeros(3), np.full(3, 2e-6), time=t, random_walk=WALK)
    np.testing.assert_allclose(twice.covariance, covariance, rtol=1e-6)
    still = drift_states(np.array([0.0, 50.0]), np.full(2, 2e-6), time=t, random_walk=0.0, noise=noise)
    np.testing.assert_allclose(still.covariance, np.full((3, 3), 1e-6), rtol=1e-4)
