"""The test of a sample covariance: its levels hold from few runs to many, and it sees what a ratio does not."""

import numpy as np
import pytest

from catseye.estimation.quality.sample_covariance import LEVEL, covariance_test, whitening


def samples(k, runs, times, seed, factor=None):
    rng = np.random.default_rng(seed)
    lever = np.eye(k) if factor is None else factor
    for _ in range(times):
        z = rng.standard_normal((runs, k)) @ lever
        yield covariance_test(z.T @ z, runs)


@pytest.mark.parametrize(("k", "runs"), [(1, 300), (3, 30), (9, 100), (40, 10), (40, 60), (40, 400)])
def test_levels_hold(k, runs):
    times = 1000
    found = list(samples(k, runs, times, seed=k * runs))
    for level in (0.05, 0.5):
        spread = 4.0 * np.sqrt(level * (1.0 - level) / times)  # four standard deviations, and what the series neglects:
        assert np.mean([t.p < level for t in found]) == pytest.approx(level, abs=spread + (0.06 if k == 1 else 0.015))
        assert np.mean([t.p_size < level for t in found]) == pytest.approx(level, abs=spread)
    assert np.mean([t.largest > t.by_chance for t in found]) <= 0.005  # a thousandth: five of a thousand never
    assert np.median([t.excess for t in found]) > 0.75


@pytest.mark.parametrize(("k", "runs"), [(5, 40), (30, 100)])
def test_the_limit_of_the_largest_is_not_too_wide(k, runs):
    nearly = [t.excess > 0.93 for t in samples(k, runs, 2000, seed=1)]
    assert np.mean(nearly) > 0.01


def test_one_wrong_combination_of_forty_is_seen_where_the_sum_of_squares_is_right():
    k, runs = 40, 500
    rng = np.random.default_rng(2)
    turn = np.linalg.qr(rng.standard_normal((k, k)))[0]
    variances = np.full(k, 1.0 - 1.5 / (k - 1))
    variances[0] = 2.5
    found = list(samples(k, runs, 20, 3, factor=np.sqrt(variances)[:, None] * turn))
    assert all(t.p < LEVEL for t in found)
    assert np.mean([t.p_size < 0.05 for t in found]) < 0.3
    assert all(1.4 < t.largest < 1.9 and t.excess > 1.1 and not t.agrees for t in found)


def test_a_wrong_size_is_seen_though_too_small_for_the_matrix():
    found = list(samples(60, 200, 20, 4, factor=1.05 * np.eye(60)))
    assert all(t.p_size < LEVEL and not t.agrees for t in found)
    assert np.median([t.p for t in found]) > 0.01


def test_a_mean_counts_as_disagreement():
    z = np.random.default_rng(5).standard_normal((1000, 4)) + np.array([0.5, 0.0, 0.0, 0.0])
    assert not covariance_test(z.T @ z, 1000).agrees


def test_errors_of_a_covariance_become_independent():
    rng = np.random.default_rng(6)
    lever = rng.standard_normal((9, 6)) * 10.0 ** rng.uniform(-7, 2, 9)[:, None]  # rank 6 of 9, of any units
    covariance = lever @ lever.T
    w = whitening(covariance)
    assert w.shape == (6, 9)
    np.testing.assert_allclose(w @ covariance @ w.T, np.eye(6), atol=1e-9)


def test_constants_are_no_combination():
    covariance = np.zeros((4, 4))
    covariance[1:3, 1:3] = [[4.0, 1.0], [1.0, 9.0]]
    w = whitening(covariance)
    assert w.shape == (2, 4)
    assert not w[:, [0, 3]].any()
