"""The eliminated covariance is that of the whole network, and an added ranger's that of the larger network."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.errors import EstimationError
from catseye.estimation.design.addition import with_ranger
from catseye.estimation.design.criteria import BodyPose, MeanVariance, SurfaceVariance, WorstAxis
from catseye.estimation.design.network import TiedPoints, predict
from estimation.design.design_networks import dense_covariance, few

ROUNDING = 1e-10  # of the largest element: condition 1e13 before, 1e6 after scaling


def test_covariances_are_those_of_one_dense_inverse():
    network = few()
    dense, prediction = dense_covariance(network), predict(network)
    for i, block in enumerate(prediction.covariance):
        expected = dense[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        np.testing.assert_allclose(block, expected, atol=ROUNDING * np.abs(expected).max())


def test_products_with_columns_are_those_of_the_whole_covariance():
    network = few(seed=2)
    dense, prediction = dense_covariance(network), predict(network)
    generator = np.random.default_rng(0)
    columns, others = generator.normal(size=(*network.points.shape, 2)), generator.normal(size=(7, 2))
    expected = dense @ np.concatenate([columns.reshape(-1, 2), others])
    points, rest = prediction.across(columns, others)
    tolerance = ROUNDING * np.abs(expected).max()
    np.testing.assert_allclose(np.concatenate([points.reshape(-1, 2), rest]), expected, atol=tolerance)


def test_a_tied_ranger_is_refused():
    network = replace(few(), units=(TiedPoints((0, 7, 8), np.eye(9)),))
    with pytest.raises(EstimationError, match="a tied point is a ranger"):
        predict(network)


def test_coinciding_ends_are_refused():
    network = few()
    points = network.points.copy()
    points[network.pairs[0, 1]] = points[network.pairs[0, 0]]
    with pytest.raises(EstimationError, match="coincide"):
        predict(replace(network, points=points))


def test_one_ranger_more_gives_what_the_larger_network_gives():
    network = few(seed=3)
    count, targets = len(network.points), np.arange(6, 20)
    place, u = np.array([-40.0, 90.0, 1.0]), np.array([1e-4, 2e-4, 3e-4])
    added = with_ranger(predict(network), place, targets, u=u, u_zero=2e-5)
    larger = replace(
        network,
        points=np.concatenate([network.points, [place]]),
        rangers=np.append(network.rangers, count),
        pairs=np.concatenate([network.pairs, [(6, t) for t in targets]]),
        information=np.concatenate([network.information, [np.diag(1 / u**2)]]),
        u_zero=np.append(network.u_zero, 2e-5),
    )
    whole = predict(larger)
    tolerance = ROUNDING * whole.covariance.max()
    np.testing.assert_allclose(added.covariance, whole.covariance[:count], atol=tolerance)
    interest = np.arange(6, 15)
    along, weights = np.random.default_rng(1).normal(size=(9, 3)), np.full(9, 1 / 9)
    for criterion in (
        MeanVariance(interest),
        WorstAxis(interest),
        BodyPose(interest),
        SurfaceVariance(interest, along, weights, np.ones((9, 1))),
    ):
        assert criterion.true_value(added) == pytest.approx(criterion.true_value(whole), rel=1e-9)


def test_a_ranger_without_a_target_changes_nothing():
    prediction = predict(few())
    assert with_ranger(prediction, np.zeros(3), np.zeros(0, dtype=int), u=np.ones(3), u_zero=1e-5) is prediction
