"""Foretelling a field: against a library-free textbook form, leave-one-out scatter, refusals."""

import numpy as np
import pytest

from catseye.errors import EstimationError
from catseye.estimation.shapes.surface_field import MeasuredField, Roughness, estimate_roughness, foretell
from draws import draws, same_sigmas

ROUGH = Roughness(smooth=2e-4, length=25.0, own=7e-5)


def scene(seed, k, m):
    rng = np.random.default_rng(seed)
    places = rng.uniform(-50, 50, (k + m, 2))
    smooth = ROUGH.covariance(places, places) + 1e-16 * np.eye(k + m)
    field = np.linalg.cholesky(smooth) @ rng.normal(size=k + m) + ROUGH.own * rng.normal(size=k + m)
    trend = np.column_stack([np.ones(k + m), places / 50])
    field = field + trend @ rng.normal(size=3) * 1e-3
    return rng, places, field, trend


def test_it_is_the_solution_of_the_textbooks_saddle_system():
    """Weights and multipliers of universal kriging solved as one bordered system, point by point."""
    rng, places, field, trend = scene(1, 30, 4)
    seen, wanted = slice(0, 30), slice(30, 34)
    noise = np.diag(rng.uniform(1, 4, 30) * 1e-9)
    found = foretell(MeasuredField(places[seen], field[seen], noise, trend[seen]), places[wanted], trend[wanted],
                     roughness=ROUGH, same=np.full(4, -1))  # fmt: skip
    v = ROUGH.covariance(places[seen], places[seen]) + ROUGH.own**2 * np.eye(30) + noise
    for k in range(4):
        c = ROUGH.covariance(places[30 + k : 31 + k], places[seen])[0]
        border = np.block([[v * 1e6, trend[seen]], [trend[seen].T, np.zeros((3, 3))]])
        weights = np.linalg.solve(border, np.concatenate([c * 1e6, trend[30 + k]]))[:30]
        np.testing.assert_allclose(found.weights[k], weights, atol=1e-6)
        variance = ROUGH.smooth**2 + ROUGH.own**2 - 2 * weights @ c + weights @ v @ weights
        assert found.covariance[k, k] == pytest.approx(variance, rel=1e-6)


@draws(24)
def test_prediction_error_scatters_as_claimed(runs):
    """Roughness is estimated from the same few points; predictions are at other points."""
    ratios = []
    for seed in range(runs):
        rng, places, field, trend = scene(seed, 80, 60)
        noise = 9e-10 * np.eye(80)
        measured = field[:80] + 3e-5 * rng.normal(size=80)
        rough = estimate_roughness(places[:80], measured, noise, trend=trend[:80])
        found = foretell(MeasuredField(places[:80], measured, noise, trend[:80]), places[80:], trend[80:],
                         roughness=rough, same=np.full(60, -1))  # fmt: skip
        ratios.append(np.mean((found.value - field[80:]) ** 2 / np.diag(found.covariance)))
    assert np.mean(ratios) == pytest.approx(1.0, abs=same_sigmas(0.15, 24, runs))
    assert np.std(ratios) < 0.5


@draws(8)
def test_the_roughness_that_was_planted_is_found(runs):
    found = []
    for seed in range(runs):
        rng, places, field, trend = scene(100 + seed, 250, 0)
        measured = field + 3e-5 * rng.normal(size=250)
        found.append(estimate_roughness(places, measured, 9e-10 * np.eye(250), trend=trend))
    assert np.median([f.own for f in found]) == pytest.approx(ROUGH.own, rel=same_sigmas(0.15, 8, runs))
    assert np.median([f.length for f in found]) == pytest.approx(ROUGH.length, rel=same_sigmas(0.4, 8, runs))
    assert np.median([f.smooth for f in found]) == pytest.approx(ROUGH.smooth, rel=same_sigmas(0.3, 8, runs))


def test_noise_free_measured_point_is_predicted_exactly():
    _, places, field, trend = scene(3, 40, 0)
    found = foretell(MeasuredField(places, field, np.zeros((40, 40)), trend), places[:5], trend[:5],
                     roughness=ROUGH, same=np.arange(5))  # fmt: skip
    np.testing.assert_allclose(found.value, field[:5], atol=1e-11)
    assert np.diag(found.covariance).max() < 1e-14


def test_what_cannot_be_is_refused():
    _, places, field, trend = scene(3, 8, 0)
    with pytest.raises(EstimationError, match="8 points for 3 coefficients"):
        estimate_roughness(places, field, np.zeros((8, 8)), trend=trend)
    same = np.column_stack([np.ones(8), np.ones(8)])
    with pytest.raises(EstimationError, match="do not determine the 2 coefficients"):
        foretell(
            MeasuredField(places, field, np.zeros((8, 8)), same),
            places[:1],
            same[:1],
            roughness=ROUGH,
            same=np.array([-1]),
        )
