"""The predicted covariance of a design against the scatter of simulated measurements, matrix by matrix."""

import numpy as np
import pytest
from scipy.stats import chi2

import catseye
from catseye.estimation.design.criteria import BodyPose, MeanVariance, SurfaceVariance, WorstAxis
from catseye.estimation.design.network import predict
from catseye.estimation.design.scatter import drawn_errors
from estimation.design.design_networks import few

RUNS = 3000
SURE = 4.5  # of its own u: one run in 150 000 by chance


def test_every_criterion_and_covariance_agrees_with_the_scatter():
    prediction = predict(few(seed=7))
    errors = drawn_errors(prediction, RUNS, seed=5)
    interest = np.arange(6, 15)
    along, weights = np.random.default_rng(1).normal(size=(9, 3)), np.full(9, 1 / 9)
    for criterion in (
        MeanVariance(interest),
        WorstAxis(interest),
        BodyPose(interest),
        SurfaceVariance(interest, along, weights, np.ones((9, 1))),
    ):
        squares = criterion.squares(prediction, errors)
        departure = (squares.mean() - criterion.true_value(prediction)) / (squares.std() / RUNS**0.5)
        assert abs(departure) < SURE, type(criterion).__name__
    for k in interest:  # likelihood ratio of the empirical covariance to the predicted: chi-squared of 6
        own = errors[:, k]
        ratio = np.linalg.solve(prediction.covariance[k], own.T @ own / RUNS)
        statistic = RUNS * (np.trace(ratio) - np.log(np.linalg.det(ratio)) - 3.0)
        assert chi2.sf(statistic, 6) > 1e-5, k


@pytest.mark.slow
def test_the_gain_at_green_bank_is_confirmed_by_the_network_adjustment():
    """Worst axis of the feed arm before and after, from 600 simulated networks that `catseye.plan` adjusts."""
    found = catseye.design("gbt", vary="rangers within 20 m", map_side=0, runs=0)
    u = {}
    for before, predicted in ((True, found.u_before), (False, found.u_after)):
        planned = catseye.plan(found.network(before=before), interest=found.names, runs=600, seed=3)
        scatter = planned.planned.scatter
        rows = [planned.names.index(name) for name in found.names]
        u[before] = np.sqrt(np.mean(scatter.rms[rows] ** 2))
        assert u[before] == pytest.approx(np.sqrt(np.mean(planned.u[rows] ** 2)), rel=4.0 / np.sqrt(600))
        assert planned.planned.plan.weakest[rows].max() == pytest.approx(predicted, rel=1e-5)
    assert u[False] < 0.97 * u[True]


def test_the_same_seed_gives_the_same_errors():
    prediction = predict(few(seed=7))
    first, second = (drawn_errors(prediction, 5, seed=2) for _ in range(2))
    np.testing.assert_array_equal(first, second)
