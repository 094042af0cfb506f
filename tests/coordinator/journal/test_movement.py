"""Differences of answers, worked by hand: in their units, in stored u, by epoch."""

import math

import numpy as np
import pytest

from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.journal.movement import Furthest, Movements, Moving
from catseye.coordinator.journal.replay import RangeMove, Replayed, ShotComparisons


def solution(number, x, covariance, **more):
    return EpochSolution(1, {"number": number, "names": ["A", "B"], "x": x, **more}, covariance)


def moved(*pairs, stations=("WX1",), moves=()):
    movements = Movements(stations)
    for stored, new in pairs:
        movements.add(Replayed(7, stored, new, ShotComparisons(moves=list(moves))))
    return movements.found


def test_point_differences_in_metres_and_in_u():
    """A by (3, 4, 0) mm where u is 1, 8 and 0 mm; B not at all, u 1 mm: 5 mm at most, 3 u, of which no u 0 is."""
    covariance = np.diag(np.array([1e-3, 8e-3, 0.0, 1e-3, 1e-3, 1e-3]) ** 2)
    stored = solution(4, [[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]], covariance)
    new = solution(4, [[1.003, 2.004, 3.0], [0.0, 0.0, 0.0]], covariance)
    found = moved((stored, new))[Moving.POINTS]
    assert found.largest == Furthest(pytest.approx(5e-3, rel=1e-12), "A", 4)
    assert found.largest_u == Furthest(pytest.approx(3.0, rel=1e-12), "A", 4)
    assert (found.count, found.normalised) == (2, 5)
    assert found.rms == pytest.approx(5e-3 / math.sqrt(2.0), rel=1e-12)
    assert found.rms_u == pytest.approx(math.sqrt((3.0**2 + 0.5**2) / 5.0), rel=1e-12)


def test_largest_difference_names_its_epoch():
    still = [[0.0] * 3] * 2
    shifts = {1: 0.5, 2: -2.0, 3: 1.0}
    pairs = [
        (solution(number, still, np.eye(6)), solution(number, [still[0], [shift, 0.0, 0.0]], None))
        for number, shift in shifts.items()
    ]
    found = moved(*pairs)[Moving.POINTS]
    assert found.largest == found.largest_u == Furthest(2.0, "B", 2)
    assert found.rms == pytest.approx(math.sqrt((0.25 + 4.0 + 1.0) / 6.0), rel=1e-12)


def test_without_a_stored_covariance_there_is_no_ratio_to_u():
    stored, new = solution(1, [[0.0] * 3] * 2, None), solution(1, [[1.0, 0.0, 0.0], [0.0] * 3], None)
    found = moved((stored, new))[Moving.POINTS]
    assert (found.largest.size, found.largest_u, found.normalised) == (1.0, None, 0)
    assert math.isnan(found.rms_u)


def test_missing_or_nonfinite_points_are_not_compared():
    stored = EpochSolution(1, {"number": 1, "names": ["A", "C"], "x": [[0.0] * 3] * 2}, np.eye(6))
    new = solution(1, [[None, 0.0, 0.0], [9.0] * 3], None)
    assert moved((stored, new)) == {}


def test_thermometers_zeros_beam_focus_and_ranges_are_compared():
    """WX1 by 0.02 of u 0.1, "bend" is no thermometer; a zero by 1e-5 of u 2e-5; the beam by 1e-6 of 2e-6 rad."""
    x, pose = [[0.0] * 3] * 2, {"covariance": np.diag([4e-12, 4e-12, 1e-8]).tolist()}
    before = {"air": {"WX1": [0.5, 0.1], "bend": [0.0, 1.0]}, "zeros": {"ZY1": [0.0, 2e-5]}}
    after = {"air": {"WX1": [0.52, 0.1], "bend": [5.0, 1.0]}, "zeros": {"ZY1": [1e-5, 2e-5]}}
    stored = solution(1, x, np.eye(6), **before, pose=pose | {"offset": [0.0, 0.0, 0.0]})
    new = solution(1, x, np.eye(6), **after, pose=pose | {"offset": [1e-6, 0.0, 3e-4]})
    found = moved((stored, new), moves=[RangeMove("ZY1", "A", -6e-5, 3e-5)])
    sizes = {moving: (each.largest.size, each.largest_u.size) for moving, each in found.items()}
    assert sizes[Moving.THERMOMETERS] == pytest.approx((0.02, 0.2), rel=1e-12)
    assert sizes[Moving.ZEROS] == pytest.approx((1e-5, 0.5), rel=1e-12)
    assert sizes[Moving.BEAM] == pytest.approx((1e-6, 0.5), rel=1e-12)
    assert sizes[Moving.FOCUS] == pytest.approx((3e-4, 3.0), rel=1e-12)
    assert sizes[Moving.RANGES] == pytest.approx((6e-5, 2.0), rel=1e-12)
    assert found[Moving.RANGES].largest.name == "ZY1 to A"
    assert found[Moving.BEAM].largest.name == "azimuth × cos E"
    assert list(found) == list(Moving)


def test_unknown_pose_is_not_compared():
    unknown = {"covariance": [[None] * 3] * 3, "offset": [None] * 3}
    stored = solution(1, [[0.0] * 3] * 2, None, pose=unknown)
    assert Moving.BEAM not in moved((stored, stored))
    assert Moving.BEAM not in moved((stored, solution(1, [[0.0] * 3] * 2, None, pose=None)))
