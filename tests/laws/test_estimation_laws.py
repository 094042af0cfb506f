"""Laws of adjustment: frames, units and order do not matter, and knowing more is never knowing less."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.observations.kinds import Distances, Linear

seeds = st.integers(0, 2**32 - 1)
SIGMA = 1e-4  # m
UNTURNED = np.eye(3)
STATIONS = 20.0 * np.array([[3, 0, 0], [0, 3, 0.3], [-3, 0, -0.2], [0, -3, 0.1], [2, 2, -1]])
quick = settings(deadline=None, max_examples=40)


def distances(observed, covariance, origin, target):
    m = len(observed)
    none = np.zeros((m, 0))
    return Distances("ranges", observed, covariance, origin, target, np.ones(m), np.zeros(m), none.astype(int), none)


def network(seed, *, rotation=UNTURNED, shift=0.0, unit=1.0):
    """Five surveyed stations, two targets above them, correlated ranges; turned, shifted or in another unit."""
    rng = np.random.default_rng(seed)
    true = np.concatenate([STATIONS, rng.uniform(-20, 20, (2, 3)) + np.array([0, 0, 40])])
    origin, target = np.repeat(np.arange(5), 2), np.tile([5, 6], 5)
    a = rng.normal(size=(10, 10)) / 3
    covariance = SIGMA**2 * (np.eye(10) + a @ a.T)
    observed = np.linalg.norm(true[target] - true[origin], axis=1) + SIGMA * rng.normal(size=10)
    survey = STATIONS + SIGMA * rng.normal(size=(5, 3))
    start = true + 0.02 * rng.normal(size=(7, 3))
    x0 = unit * (start @ rotation.T + shift).ravel()
    held = unit * (survey @ rotation.T + shift).ravel()
    return x0, [
        distances(unit * observed, unit**2 * covariance, 3 * origin, 3 * target),
        Linear("survey", held, np.full(15, (unit * SIGMA) ** 2), np.arange(15), np.eye(15)),
    ]


def straight(seed):
    """The network's slopes held where they are: what is exact only without curvature can be tested as exact."""
    x0, (ranges, survey) = network(seed)
    values, slopes = ranges.predict(x0)
    matrix = np.zeros((len(values), len(x0)))
    np.put_along_axis(matrix, ranges.columns, slopes, axis=1)
    reduced = ranges.observed - values + matrix @ x0
    return x0, [Linear("ranges", reduced, ranges.covariance, np.arange(len(x0)), matrix), survey]


def sigmas(solution):
    return np.sqrt(np.diag(solution.covariance))


@quick
@given(seeds)
def test_the_answer_turns_and_moves_with_the_frame(seed):
    r, shift = Rotation.random(random_state=seed).as_matrix(), np.array([100.0, -300.0, 50.0])
    here = adjust(*network(seed)).require_converged()
    there = adjust(*network(seed, rotation=r, shift=shift)).require_converged()
    big = np.kron(np.eye(7), r)
    # a step of 1e-4 sigma ends the iteration
    assert np.abs(there.x - (here.x.reshape(-1, 3) @ r.T + shift).ravel()).max() < 1e-3 * sigmas(here).max()
    claimed = big @ here.covariance @ big.T
    np.testing.assert_allclose(there.covariance, claimed, rtol=0, atol=1e-5 * sigmas(here).max() ** 2)
    np.testing.assert_allclose(there.fits[0].standardised, here.fits[0].standardised, atol=1e-3)


@quick
@given(seeds, st.sampled_from([1e-3, 1e3, 1e6, 1e9]))
def test_another_unit_scales_the_answer_and_nothing_else(seed, unit):
    metres, other = adjust(*network(seed)), adjust(*network(seed, unit=unit))
    assert other.status == metres.status
    np.testing.assert_allclose(other.x / unit, metres.x, rtol=0, atol=1e-3 * sigmas(metres).min())
    np.testing.assert_allclose(sigmas(other) / unit, sigmas(metres), rtol=1e-6)
    np.testing.assert_allclose(other.fits[0].standardised, metres.fits[0].standardised, atol=1e-3)
    np.testing.assert_allclose(other.fits[0].redundancy, metres.fits[0].redundancy, atol=1e-6)


@quick
@given(seeds)
def test_the_order_of_groups_and_of_observations_is_irrelevant(seed):
    x0, (ranges, survey) = network(seed)
    order = np.random.default_rng(seed).permutation(10)
    shuffled = distances(
        ranges.observed[order], ranges.covariance[np.ix_(order, order)], ranges.origin[order], ranges.target[order]
    )
    one, other = adjust(x0, [ranges, survey]), adjust(x0, [survey, shuffled])
    np.testing.assert_allclose(other.x, one.x, rtol=0, atol=1e-6 * sigmas(one).min())
    np.testing.assert_allclose(other.fits[1].standardised, one.fits[0].standardised[order], atol=1e-5)
    np.testing.assert_allclose(other.fits[1].redundancy, one.fits[0].redundancy[order], atol=1e-8)


@quick
@given(seeds, st.integers(0, 20), st.floats(-4.0, 4.0))
def test_one_more_observation_never_makes_anything_less_certain(seed, column, log_sigma):
    x0, groups = straight(seed)
    less = adjust(x0, groups)
    one = Linear("more", less.x[[column]], np.array([(SIGMA * 10**log_sigma) ** 2]), np.array([column]), np.eye(1))
    gain = less.covariance - adjust(less.x, [*groups, one]).covariance
    assert np.linalg.eigvalsh(gain).min() > -1e-8 * np.trace(less.covariance)


@quick
@given(seeds)
def test_leaving_a_correlated_observation_out_never_makes_anything_more_certain(seed):
    x0, groups = straight(seed)
    whole = adjust(x0, groups)
    for k in range(10):
        without = adjust(whole.x, groups, active=[np.arange(10) != k, np.ones(15, dtype=bool)])
        assert np.linalg.eigvalsh(without.covariance - whole.covariance).min() > -1e-6 * np.trace(whole.covariance)


@quick
@given(seeds)
def test_redundancy_numbers_sum_to_the_observations_less_the_parameters(seed):
    factor, degrees = adjust(*network(seed)).variance_factor()
    assert abs(degrees - (25 - 21)) < 1e-7
    assert factor > 0.0
