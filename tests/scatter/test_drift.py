"""The electronics' interpolated phase: claimed covariance against scatter, as whole vectors of shots.

The squared Mahalanobis distance of an error vector is chi-square with as many degrees as there are shots, if and only
if every variance and every correlation is right: its mean, its variance and its distribution are tested.
"""

import numpy as np
import pytest
from scipy.stats import kstest

from catseye.signal.drift.reference import drift_along, drift_at

WALK = 0.01 / 60  # rad per root second: 10 mrad per root hour, as the example night's site has it
NOISE = 5e-4  # rad, of a reference shot


def walked(rng, time, trials, walk=WALK):
    """Random walks (trials, n) at any times, from a level that nobody knows."""
    order = np.argsort(time)
    steps = np.sqrt(np.diff(time[order], prepend=time[order][0])) * walk * rng.standard_normal((trials, len(time)))
    found = np.empty((trials, len(time)))
    found[:, order] = np.cumsum(steps, axis=1)
    return found + rng.normal(0, 10, (trials, 1))


def distances(rng, reference, time, trials, *, true_walk=WALK, variance=None):
    """Squared Mahalanobis distances of the errors at `time`, and the errors over the claimed u."""
    variance = np.full(len(reference), NOISE**2) if variance is None else variance
    drift = walked(rng, np.concatenate([reference, time]), trials, true_walk)
    r = len(reference)
    seen = drift[:, :r] + np.sqrt(variance) * rng.standard_normal((trials, r))
    covariance = drift_at(reference, seen[0], variance, time=time, random_walk=WALK)[1]
    # the mean is linear in the references' phases: its matrix from unit phases, then all trials at once
    gain = np.stack([drift_at(reference, row, variance, time=time, random_walk=WALK)[0] for row in np.eye(r)], axis=1)
    error = seen @ gain.T - drift[:, r:]
    squares = np.einsum("ti,ij,tj->t", error, np.linalg.inv(covariance), error)
    return squares, error / np.sqrt(np.diag(covariance))


def schedule(rng, kind):
    """Times of reference shots and of target shots between, before and after them."""
    if kind == "irregular":
        reference = np.cumsum(rng.exponential(100.0, 9))
    else:
        reference = 60.0 * np.arange(12)
        if kind == "one missing":
            reference = np.delete(reference, 5)
        if kind == "the last missing":
            reference = reference[:-4]
    return reference, np.sort(rng.uniform(reference[0] - 60, 60.0 * 12, 25))


KINDS = ("irregular", "regular", "one missing", "the last missing")


@pytest.mark.parametrize("kind", KINDS)
def test_the_claimed_covariance_is_the_scatter(kind):
    rng = np.random.default_rng(KINDS.index(kind) + 31)
    reference, time = schedule(rng, kind)
    squares, normalised = distances(rng, reference, time, 4000)
    m = len(time)
    assert squares.mean() / m == pytest.approx(1.0, abs=4 * np.sqrt(2 / m / 4000))
    assert np.var(squares) == pytest.approx(2 * m, rel=0.15)  # six standard deviations of 4000
    assert kstest(squares, "chi2", args=(m,)).pvalue > 1e-3
    np.testing.assert_allclose(np.std(normalised, axis=0), 1.0, atol=0.045)  # four of 4000


@pytest.mark.parametrize("kind", KINDS)
def test_the_short_way_claims_the_same_scatter(kind):
    rng = np.random.default_rng(KINDS.index(kind) + 41)
    reference, time = schedule(rng, kind)
    variance = NOISE**2 * rng.uniform(0.2, 3.0, len(reference))
    trials = 400
    drift = walked(rng, np.concatenate([reference, time]), trials)
    seen = drift[:, : len(reference)] + np.sqrt(variance) * rng.standard_normal((trials, len(reference)))
    errors = []
    for row, truth in zip(seen, drift[:, len(reference) :], strict=True):
        mean, u = drift_along(reference, row, variance, time=time, random_walk=WALK)
        errors.append((mean - truth) / u)
    # neighbours are correlated: 25 shots count as some 10; four standard deviations
    assert np.mean(np.square(errors)) == pytest.approx(1.0, abs=4 * np.sqrt(2 / (10 * trials)))


def test_a_walk_half_again_as_large_does_not_pass_for_the_claimed_one():
    rng = np.random.default_rng(51)
    reference, time = schedule(rng, "irregular")
    squares, _ = distances(rng, reference, time, 2000, true_walk=1.5 * WALK)
    assert squares.mean() / len(time) > 1.8


def test_a_gap_left_by_a_missing_reference_shows_in_the_claim():
    rng = np.random.default_rng(52)
    whole, _ = schedule(rng, "regular")
    holed, _ = schedule(rng, "one missing")
    middle = np.array([300.0])
    u = [np.sqrt(drift_at(t, np.zeros(len(t)), np.full(len(t), NOISE**2), time=middle, random_walk=WALK)[1][0, 0])
         for t in (whole, holed)]  # fmt: skip
    assert u[1] > 2 * u[0]  # from a reference's own noise to the middle of 120 s


@pytest.mark.slow
def test_the_claimed_covariance_is_the_scatter_of_many_schedules():
    rng = np.random.default_rng(61)
    squares = []
    for trial in range(400):
        reference, time = schedule(rng, KINDS[trial % 4])
        variance = NOISE**2 * rng.uniform(0.0, 3.0, len(reference))
        found, _ = distances(rng, reference, time, 200, variance=variance)
        squares.append(found / len(time))
    assert np.mean(squares) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 25 / 80_000))
