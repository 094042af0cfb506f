"""Derivatives of every criterion by hand are those of a complex step."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.estimation.design.criteria import BodyPose, MeanVariance, SurfaceVariance, WorstAxis
from catseye.estimation.design.gradient import gradient
from catseye.estimation.design.network import predict
from estimation.design.design_networks import few

INTEREST = np.arange(4, 12)  # two rangers, which range to each other, and single targets
TIED = np.arange(12, 21)  # with triples
STEP = 1e-20  # m: the imaginary part is the derivative, without a difference
EXACT = 1e-9  # of the largest: rounding alone


def criteria():
    generator = np.random.default_rng(3)
    along, weights = generator.normal(size=(8, 3)), generator.uniform(0.5, 1.5, 8)
    fitted = generator.normal(size=(8, 3))
    for name, points in (("interest", INTEREST), ("tied", TIED)):
        yield pytest.param(MeanVariance(points), id=f"trace-{name}")
        yield pytest.param(WorstAxis(points), id=f"worst-{name}")
        yield pytest.param(WorstAxis(points, 2), id=f"worst-smoother-{name}")
        yield pytest.param(BodyPose(points), id=f"pose-{name}")
    yield pytest.param(SurfaceVariance(INTEREST, along, weights / weights.sum(), fitted), id="gain")


@pytest.mark.parametrize("criterion", list(criteria()))
def test_the_derivative_with_respect_to_every_place_is_exact(criterion):
    network = few(seed=4)
    prediction = predict(network)
    slopes = gradient(prediction, criterion.sensitivity(prediction))
    numeric = np.zeros_like(slopes)
    for i, k in np.ndindex(*slopes.shape):
        points = network.points.astype(complex)
        points[i, k] += 1j * STEP
        numeric[i, k] = criterion.sensitivity(predict(replace(network, points=points))).value.imag / STEP
    assert np.abs(numeric).max() > 0.0
    np.testing.assert_allclose(slopes, numeric, atol=EXACT * np.abs(numeric).max())


def test_the_smooth_worst_axis_lies_above_the_true_one_and_near_it():
    prediction = predict(few(seed=5))
    true = WorstAxis(INTEREST).true_value(prediction)
    smooth = WorstAxis(INTEREST).sensitivity(prediction).value
    assert true <= smooth <= true * (3 * len(INTEREST)) ** (1 / 32)


def test_the_pose_of_points_that_move_alone_is_the_mean_of_their_errors():
    """By hand: of one common shift with variance s^2 along x, the pose's shift has s^2 and no turn."""
    network = few(seed=6)
    prediction = predict(network)
    shift = np.zeros((1, *network.points.shape))
    shift[:, :, 0] = 2e-4
    criterion = BodyPose(INTEREST)
    assert criterion.squares(prediction, shift)[0] == pytest.approx(2e-4**2 / 3.0)
    assert np.linalg.eigvalsh(criterion.pose_covariance(prediction)).min() > 0.0
