"""Figures of scans hold the readings, the spot and its centre."""

import numpy as np
import pytest

import catseye
from catseye.gateways.scans.scan_figures import scan_figure, scan_figures
from catseye.gateways.writers.drawing import svg


@pytest.fixture(scope="module")
def fits():
    scans = ["scans/azimuth.csv", "scans/elevation.csv", "scans/raster.csv"]
    return catseye.fit_scan(scans, mirror="night-01/mirrors/ZP103.toml").fits


def test_a_profile_shows_readings_spot_width_and_centre(fits):
    above, below = scan_figure(fits[0]).axes
    labels = above.get_legend_handles_labels()[1]
    assert any(label.startswith("centre 20000.") for label in labels)
    curve = next(line for line in above.lines if line.get_label().startswith("spot"))
    assert curve.get_ydata().max() == pytest.approx(fits[0].values[3] + fits[0].values[4], rel=1e-3)
    level = next(line for line in above.lines if "wide at half" in line.get_label())
    counts = np.ptp(level.get_xdata())
    sky = np.sin((9_000 - 1_434) * 4 * np.pi / 1e5) * 2 * np.pi / 1e5
    assert counts * sky == pytest.approx(fits[0].width, rel=0.02)
    assert below.containers[0].lines[0].get_ydata() == pytest.approx(fits[0].residual)


def test_each_scan_has_its_figure_the_same_again(fits):
    figures = scan_figures(fits)
    assert list(figures) == ["azimuth", "elevation", "raster"]
    assert svg(figures["raster"]) == svg(scan_figure(fits[2]))
    assert "azimuth counts" in figures["raster"].axes[0].get_xlabel()
