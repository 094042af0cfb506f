"""Figure of returns by angle: a panel for each varied angle, with the judged kind through the readings."""

import numpy as np
import pytest

import catseye
from catseye.gateways.scans.angle_figures import angle_figure
from catseye.gateways.writers.drawing import svg


@pytest.fixture(scope="module")
def found():
    return catseye.compare_scan(["scans/incidence.csv", "scans/rotation.csv"]).comparison


def test_both_angles_are_drawn_with_every_kind(found):
    figure = angle_figure(found)
    titles = [axes.get_title(loc="left") for axes in figure.axes[:2]]
    assert titles == ["By incidence, at rotation 20°", "By rotation, at incidence 30°"]
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert set(labels) == {*(fit.kind for fit in found.fits[1:]), "bare prism, fitted", "readings, u"}
    line = next(each for each in figure.axes[1].lines if each.get_label() == "bare prism, fitted")
    turn, height = line.get_xdata(), line.get_ydata()
    assert height.max() > 5.0 * height.min()
    lit = turn[height > 0.5 * height.max()]
    assert np.ptp(np.mod(lit, 120.0)) < 50.0  # three lobes, 120 degrees apart
    assert svg(figure) == svg(angle_figure(found))
