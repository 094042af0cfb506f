"""The verdict on a track: every point followed, some, none."""

import numpy as np
import pytest

from catseye.constants import DEGREE
from catseye.geometry.sky.time_tag import TimeTag
from catseye.records.files.reading import read_record
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from catseye.reduction.site.stations import station_of
from catseye.reduction.steering.ground_track import follow_by
from catseye.reduction.steering.mounted import ranger_of_records
from catseye.reduction.steering.tracking import AZIMUTH_SLEW, ELEVATION_SLEW, AntennaPath, Drive
from repository import ROOT

NIGHT = ROOT / "examples/night-01"
MONUMENT = read_record(NIGHT / "monuments/ZY103.toml", MonumentGeometry)
MIRROR = read_record(NIGHT / "mirrors/ZP103.toml", MirrorGeometry)
STILL = AntennaPath(
    Drive(145 * DEGREE, 145 * DEGREE, rate=AZIMUTH_SLEW), Drive(30 * DEGREE, 30 * DEGREE, rate=ELEVATION_SLEW)
)
SCAN_POINT = station_of(MONUMENT, MIRROR).scan_point
FAR = np.array([0.0, 0.0, 50.0])
RANGER = ranger_of_records(MONUMENT, MIRROR)


@pytest.mark.parametrize(
    ("points", "word", "why"),
    [
        ([FAR, FAR + 1.0], "good", "every point is followed"),
        ([FAR, SCAN_POINT], "doubtful", "1 of 2 points are not followed; point 1 has no direction"),
        ([SCAN_POINT], "failed", "the mirror follows no point; point 0 has no direction"),
    ],
)
def test_the_verdict_counts_the_points_that_are_followed(points, word, why):
    found = follow_by(
        RANGER, np.array(points), frame="ground", path=STILL, start=TimeTag.parse("52889.125"), interval=0.128
    )
    assert found.verdict.word == word
    assert found.verdict.why.startswith(why)
    assert np.isnan(found.worst).tolist() == (~found.followed).tolist()
    assert len(found.status) == len(points)
    assert found.counts.shape == (2, len(points), 2)
