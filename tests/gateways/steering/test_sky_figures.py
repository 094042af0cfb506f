import re
import xml.etree.ElementTree as ET

import numpy as np

from catseye.gateways.steering.sky_figures import _on_map, sky_figure
from catseye.geometry.mirror.pointing import counts
from catseye.reduction.steering.reroute import route
from sun_scene import MORNING, STATION, astropy_sun, boxes, guard

AT_SUN = counts(STATION, STATION.scan_point + 100 * astropy_sun(np.array([MORNING]))[0])


def test_the_map_has_north_up_and_east_right():
    assert np.allclose(
        _on_map(np.array([[0, 1.0, 0], [1.0, 0, 0], [0, 0, 1.0]])), [[0, 90], [90, 0], [0, 0]], atol=1e-9
    )
    assert np.isnan(_on_map(np.array([0, 0.5, -1.0]))).all()


def test_the_figure_is_svg_and_the_same_each_time():
    own = guard(boxes=boxes(), margin_counts=(20, 20))
    ends = AT_SUN - [3000, 500], np.add(AT_SUN, [3000, 300])
    found = route(own, MORNING, *ends, step=(600.0, 300.0))
    assert found.found
    drawn = sky_figure(own, MORNING, slew=ends, route=found)
    assert ET.fromstring(drawn).tag.endswith("svg")
    bare = sky_figure(own, MORNING)
    assert bare == sky_figure(own, MORNING)
    assert len(re.findall("<path", drawn)) > len(re.findall("<path", bare)) + 4  # the ways are drawn


def test_a_night_without_sun_is_drawn_without_a_cone():
    own = guard()
    assert "#fbe3ad" in sky_figure(own, MORNING)
    assert "#fbe3ad" not in sky_figure(own, 52_889.2)
    assert "#fbe3ad" not in sky_figure(guard(place=None), MORNING)
