"""Figure of a followed vibration: what it draws is what was predicted and left, the same bytes each time."""

import numpy as np
import pytest

import catseye
from catseye.gateways.structure.following_figures import TAIL_S, following_figure
from catseye.gateways.writers.drawing import BAD, svg


def test_predictions_and_residuals_are_those_of_the_filter():
    found = catseye.follow(
        "vibration/quadrant.csv", slope_mm=10, u_signal=0.002, model="structural-model/telescope.toml"
    )
    followed = found.followed
    figure = following_figure(followed)
    left, right = figure.axes[0], figure.axes[1]
    seconds = followed.samples.seconds[followed.checked]
    last = seconds > seconds[-1] - TAIL_S
    predicted = followed.samples.values[followed.checked, 0] - followed.residual[:, 0]
    np.testing.assert_allclose(left.lines[0].get_ydata(), 1e3 * predicted[last])
    residual = next(line for line in right.lines if line.get_color() == BAD)
    np.testing.assert_allclose(residual.get_ydata(), 1e3 * followed.residual[:, 0])
    rest = followed.state.mean[-2]
    assert left.lines[2].get_ydata()[-1] == pytest.approx(1e3 * (found.predicted[-1, 0] + rest))
    assert svg(figure) == svg(following_figure(followed))
