"""Figures hold what they are given, are the same for the same input, and are well-formed SVG."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from catseye.gateways.steering import tracking_figures
from catseye.gateways.steering.tracking_figures import error_figure, miss_figure, search_figure, visibility_figure
from catseye.gateways.writers.drawing import svg
from catseye.geometry.mirror.pointing import MirrorStation
from catseye.geometry.sky.time_tag import TimeTag
from catseye.records.site.solids import Solids
from catseye.reduction.steering.spot_fit import Spot
from catseye.reduction.steering.tracking import (
    AZIMUTH_SLEW,
    AntennaPath,
    Drive,
    Following,
    count_errors,
    fixed,
    follow,
    misses,
    mounted,
)
from catseye.reduction.steering.visibility import Sight, frames_at, retroreflectors_of, visibility

STATION = MirrorStation([[112.99, 44.28, 0.0]], [[-1.2, 0, 0]], [[0.0, 0.25, 0.0]], [[0.0, 0.0]], [[0.0, 0.0]])


KEPT = []


def drawn(figure):
    """The figure as text; itself is kept for a look at what it shows."""
    KEPT.append(figure)
    text = svg(figure)
    assert ET.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
    return text


@pytest.fixture
def kept():
    """The matplotlib figures, as they are drawn."""
    KEPT.clear()
    return KEPT


def test_the_worst_pair_is_drawn_in_millimetres_over_the_time_of_the_track(kept):
    path = AntennaPath(Drive(0.0, 1.0, rate=AZIMUTH_SLEW), Drive(0.5, 0.5, rate=0.01))
    targets = fixed([[0.0, 30.0, 60.0], [20.0, 10.0, 50.0]], "reflector", path)
    track = follow(mounted(STATION), targets, TimeTag(52889, 0), intervals=20)
    shares = np.array([0.25, 0.5, 0.75])
    off = misses(track, mounted(STATION), targets, shares=shares)
    first = drawn(miss_figure(track, off, shares))
    assert first == svg(miss_figure(track, off, shares))
    worst = kept[0].axes[0].lines[0]
    assert worst.get_ydata().max() == pytest.approx(1e3 * off.max())
    assert worst.get_xdata()[-1] == pytest.approx((19 + 0.75) * 0.128)
    assert worst.get_label() == "worst of 2 pairs"
    at = float(track.lines.start[0, 0, 0, 0])
    none = follow(mounted(STATION), targets, TimeTag(52889, 0), intervals=20, limits=(at + 9000.0, at + 9010.0))
    assert np.all(none.status == Following.BEYOND_STOPS)
    drawn(miss_figure(none, off, shares))
    assert [line.get_label() for line in kept[1].axes[0].lines] == ["1 mm"]


def test_a_search_shows_its_places_and_its_centre(kept):
    n = np.array([[100.0, 50.0], [101.0, 50.0], [101.0, 51.0], [100.0, 51.0]])
    spot = Spot(
        "found",
        np.array([100.6, 50.4]),
        np.diag([0.01, 0.04]),
        5.0,
        3e-4,
        0.0,
        2.0,
        1.0,
        4,
        n,
        np.array([1.0, 4.0, np.nan, 2.0]),
    )
    drawn(search_figure(spot, (0.0, 0.0)))
    ax = kept[0].axes[0]
    assert ax.collections[0].get_offsets().tolist() == [[100.0, 50.0], [101.0, 50.0], [100.0, 51.0]]
    assert ax.collections[0].get_array().tolist() == [1.0, 4.0, 2.0]
    assert "100.60 ± 0.10, 50.40 ± 0.20" in ax.get_title(loc="left")
    ring = ax.lines[-1].get_xdata()
    assert ring.max() - 100.6 == pytest.approx(0.3, rel=1e-3)  # three standard uncertainties
    drawn(search_figure(Spot("not found: " + 200 * "x", looked_at=n, seen=np.zeros(4)), (0.0, 0.0)))
    assert kept[1].axes[0].get_title(loc="left").endswith("...")
    drawn(search_figure(Spot("not found: nowhere to look"), (0.0, 0.0)))


def test_the_matrix_has_a_cell_for_each_pair(kept, night_01):
    targets = retroreflectors_of(night_01)
    rangers = {"ZY101": np.array([-32.0, 117.0, 0.3]), "ZY113": np.array([0.0, 40.0, 110.0])}
    found = visibility(rangers, targets, Solids(), frames=frames_at(0.5, 0.6))
    drawn(visibility_figure(found))
    image = kept[0].axes[0].images[0]
    np.testing.assert_array_equal(image.get_array(), found.code)
    said = {t.get_text() for t in kept[0].legends[0].get_texts()}
    assert f"seen: {int(found.seen.sum())}" in said
    assert set(tracking_figures.SIGHTS) == set(Sight)


def test_errors_of_counts_are_zero_at_the_nodes_and_drawn_between(kept):
    path = AntennaPath(Drive(0.0, 1.0, rate=AZIMUTH_SLEW), Drive(0.5, 0.5, rate=0.01))
    targets = fixed([[0.0, 30.0, 60.0], [20.0, 10.0, 50.0]], "reflector", path)
    track = follow(mounted(STATION), targets, TimeTag(52889, 0), intervals=20)
    shares = np.array([0.25, 0.5, 0.75])
    errors = count_errors(track, mounted(STATION), targets, shares=shares)
    drawn(error_figure(track, errors, shares))
    line = kept[0].axes[0].lines[0].get_ydata()
    np.testing.assert_array_equal(line[::5], 0.0)
    np.testing.assert_array_equal(line[2::5], errors[:, 1, 0, 0, 0])
    ends = count_errors(track, mounted(STATION), targets, shares=[0.0, 1.0])
    assert np.abs(ends).max() < 1e-6 < np.abs(errors).max()
