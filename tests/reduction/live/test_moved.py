"""Movements between two epochs: tested against scatter, and carried to one posture."""

import math

import numpy as np
import pytest

from catseye.reduction.live.moved import LEVEL, at_posture, significant_moves
from catseye.reduction.site.motion import frames_of, ground_from
from coordinator.ziy_scene import gbt


def triangles(matrices):
    return np.stack([matrices[:, i, j] for i in range(3) for j in range(i, 3)], axis=1)


def drawn(rng, count):
    """Covariances, and movements that scatter by them."""
    roots = 1e-4 * rng.standard_normal((count, 3, 3))
    return triangles(roots @ roots.transpose(0, 2, 1)), np.einsum("kij,kj->ki", roots, rng.standard_normal((count, 3)))


def test_points_at_rest_are_called_moved_as_often_as_the_level_says():
    """300 comparisons of 40 points: false alarms in a hundredth of them, within four of its own scatter."""
    rng, alarms, count = np.random.default_rng(5), 0, 300
    for _ in range(count):
        covariance, moved = drawn(rng, 40)
        alarms += bool(significant_moves(moved, covariance).significant.any())
    assert abs(alarms - LEVEL * count) < 4.0 * math.sqrt(LEVEL * count)


def test_moved_point_is_found_and_unknown_ones_are_not_tested():
    covariance, moved = drawn(np.random.default_rng(6), 20)
    moved[3] += [5e-3, 0.0, 0.0]
    covariance[7] = np.nan
    moves = significant_moves(moved, covariance)
    assert np.flatnonzero(moves.significant).tolist() == [3]
    assert np.isnan(moves.w[7])
    assert (moves.verdict.word, moves.verdict.why[:10]) == ("good", "1 of 19 po")
    nothing = significant_moves(moved[:2], np.full((2, 6), np.nan))
    assert nothing.verdict.word == "doubtful"


def test_rigid_telescope_does_not_move_from_posture_to_posture():
    site = gbt()
    frames = frames_of(site)
    names = [*[n for n in frames if frames[n] == "reflector"][:4], *[n for n in frames if frames[n] == "ground"][:2]]
    local = np.random.default_rng(7).uniform(-40.0, 40.0, (len(names), 3))
    before, after = (2.5, 0.5), (2.8, 0.9)

    def placed(posture):
        rows = [ground_from(site, frames[n], *posture).single.points(x) for n, x in zip(names, local, strict=True)]
        return np.array(rows)

    covariance, _ = drawn(np.random.default_rng(8), len(names))
    points, turned = at_posture(site, names, placed(before), covariance, before=before, after=after)
    assert points == pytest.approx(placed(after), abs=1e-9)
    trace = covariance[:, [0, 3, 5]].sum(axis=1)
    assert turned[:, [0, 3, 5]].sum(axis=1) == pytest.approx(trace)
    assert np.array_equal(turned[4:], covariance[4:])
    assert not np.allclose(turned[:4], covariance[:4])
