"""The verdict on aimed points: the worst of them, with its place, and the reason that comes first."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.records.files.reading import read_record
from catseye.records.site.keep_out import KeepOut
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from catseye.reduction.steering.aiming import AimedPoints, BeamSurroundings, aim_ranger
from catseye.reduction.steering.mounted import ranger_of_records
from repository import ROOT

NIGHT = ROOT / "examples/night-01"
MONUMENT = read_record(NIGHT / "monuments/ZY103.toml", MonumentGeometry)
MIRROR = read_record(NIGHT / "mirrors/ZP103.toml", MirrorGeometry)
TO = np.array([[0.0, 0.0, 50.0], [10.0, 20.0, 3.0]])
RANGER = ranger_of_records(MONUMENT, MIRROR)


def test_nothing_is_checked_that_was_not_asked_for():
    aimed = aim_ranger(RANGER, TO, BeamSurroundings())
    assert (aimed.sightings, aimed.visibility) == ([], None)
    assert aimed.verdict.word == "good"
    assert aimed.verdict.why == aimed.verdict_of(0).why


def test_the_worst_point_is_named_by_its_place():
    pointings = aim_ranger(RANGER, TO, BeamSurroundings()).pointings
    beyond = replace(pointings, allowed=np.array([True, False]), prime_allowed=np.array([False, False]))
    verdict = AimedPoints(beyond).verdict
    assert verdict.word == "failed"
    assert verdict.why == "1 of 2 points, first (10, 20, 3): beyond the mirror's stops in both pointings"
    prime = replace(pointings, allowed=np.array([False, True]), prime_allowed=np.array([True, False]))
    assert AimedPoints(prime).verdict_of(0).why.startswith("allowed in the prime pointing")


def test_a_box_in_the_way_fails_and_then_what_is_not_visible():
    box = {"name": "tower", "why": "people", "centre_mm": (0.0, 0.0, 25e3), "size_mm": (4e3, 4e3, 50e3)}
    zones = KeepOut.model_validate({"format": 1, "box": [box]})
    facing = np.array([0.0, 0.0, 1.0])  # the ranger stands below
    boxed = aim_ranger(RANGER, TO[:1], BeamSurroundings(keep_out=zones, facing=facing))
    assert boxed.verdict.word == "failed"
    assert "tower" in boxed.verdict.why
    turned = aim_ranger(RANGER, TO[:1], BeamSurroundings(facing=facing))
    assert turned.verdict.word == "failed"
    assert turned.verdict.why.startswith("incidence ")


@pytest.mark.parametrize(("metres", "word"), [(500.0, "good"), (5000.0, "doubtful")])
def test_a_point_that_is_far_for_a_site_is_doubtful(metres, word):
    assert aim_ranger(RANGER, np.array([[0.0, 0.0, metres]]), BeamSurroundings()).verdict.word == word
