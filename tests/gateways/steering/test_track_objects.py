"""Text of a track: each point's pointing and errors, reasons where it is not followed."""

import numpy as np

import catseye
from catseye.gateways.steering.track_objects import MOST_NODES, track_lines, track_passages
from catseye.geometry.sky.time_tag import TimeTag
from catseye.reduction.steering.ground_track import follow_by
from catseye.reduction.steering.mounted import ranger_of_site
from catseye.reduction.steering.tracking import AntennaPath, Drive


def test_a_point_that_is_not_followed_has_its_reason_and_no_counts():
    ranger = ranger_of_site(catseye.load("gbt"), "ZY103")
    found = follow_by(
        ranger,
        np.array([ranger.station().scan_point, [0.0, 10.0, 40.0]]),
        frame="ground",
        path=AntennaPath(Drive(2.5, 2.5, rate=0.01), Drive(0.5, 0.5, rate=0.01)),
        start=TimeTag(52889, 0),
        interval=0.128,
    )
    lines = track_lines(found)
    assert lines[1].split() == ["0", "not", "followed"]
    assert lines[2].split()[:2] == ["1", "direct"]
    assert lines[4].startswith("point 1")
    first, second = track_passages(found)
    assert "1 of 2 points followed" in first.text
    assert second.text.startswith("point 0: has no direction: it meets the scan point, or no setting of the mirror")


def test_long_tracks_show_their_first_nodes():
    found = catseye.track(site="gbt", ranger="ZY103", points=[0.0, 54.0, 12.2],
                          start_deg=(145.0, 30.0), end_deg=(150.0, 30.0)).track  # fmt: skip
    lines = track_lines(found)
    assert lines[-1] == f"... and {len(found.misses) - MOST_NODES} more: nodes.csv of --out"
    assert np.isfinite(found.worst).all()
