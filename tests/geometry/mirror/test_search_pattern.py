"""Search patterns on the sky, against directions from `pointing` and nearest-neighbour distances of scipy."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from catseye.errors import ValidityError
from catseye.geometry.mirror.pointing import MirrorStation, beam
from catseye.geometry.mirror.search_pattern import (
    count_size,
    counts_of_offsets,
    offsets_of_counts,
    raster,
    spiral,
    spiral_offsets,
)

ZEROS = np.array([2691.0, 1434.0])
STATION = MirrorStation([0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0], ZEROS)
DIRECT, PRIME = np.array([9000.3, 11_000.7]), np.array([59_000.3, 2 * 1434 - 11_000.7])
OPEN = (-1e6, 1e6)


@pytest.mark.parametrize("centre", [DIRECT, PRIME, np.array([2691.0, 1434.0 + 300.0])])
def test_offsets_are_great_circles_from_the_centre_along_growing_counts(centre):
    rng = np.random.default_rng(2)
    xy = rng.uniform(-0.01, 0.01, (50, 2))
    n = counts_of_offsets(centre, ZEROS, xy)
    ahead, found = beam(STATION, centre), beam(STATION, n)
    angle = np.arctan2(np.linalg.norm(np.cross(ahead, found), axis=1), found @ ahead)
    np.testing.assert_allclose(angle, np.hypot(*xy.T), rtol=1e-9)
    np.testing.assert_allclose(offsets_of_counts(centre, ZEROS, n), xy, atol=1e-14)
    assert np.all(np.sign(n[:, 1] - ZEROS[1]) == np.sign(centre[1] - ZEROS[1]))  # the same pointing
    size = count_size(centre, ZEROS)
    step = offsets_of_counts(centre, ZEROS, centre + np.array([[1.0, 0.0], [0.0, 1.0]]))
    np.testing.assert_allclose(step, np.diag(size), rtol=1e-3, atol=3e-8)


def covered_to(pattern, half):
    """Largest distance, on the sky, of any place of a rectangle (or disc, if half is a number) from the pattern."""
    wide = half if np.ndim(half) else (half, half)
    x, y = (np.linspace(-w, w, 301) for w in wide)
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    if not np.ndim(half):
        places = places[np.hypot(*places.T) <= half]
    return cKDTree(pattern.offsets).query(places)[0].max()


@pytest.mark.parametrize("centre", [DIRECT, PRIME])
@pytest.mark.parametrize("reach", [8e-5, 2e-4, 1e-3])
def test_a_raster_moves_little_and_leaves_no_gap(centre, reach):
    half = np.array([2e-3, 1e-3])
    pattern = raster(centre, ZEROS, half, reach=reach, limits=OPEN)
    assert covered_to(pattern, half) <= reach * (1 + 1e-3)  # the sky is not flat over 2 mrad
    assert np.all(pattern.counts == np.rint(pattern.counts))
    assert len(np.unique(pattern.counts, axis=0)) == len(pattern)
    steps = np.abs(np.diff(pattern.counts, axis=0))
    assert np.all((steps > 0).sum(axis=1) == 1)  # one axis at a time, to a neighbour
    assert len(np.unique(steps[steps[:, 0] > 0, 0])) <= 1
    size = count_size(centre, ZEROS)
    area = np.prod(2 * half + 4 * reach)
    assert len(pattern) <= 1.1 * area / (0.7 * 2 * reach**2) + 20 or reach < 1e-4  # 2 reach^2 a place is the best
    assert size[0] < size[1]


@pytest.mark.parametrize("centre", [DIRECT, PRIME, np.array([2691.0, 1434.0 + 30.0])])
@pytest.mark.parametrize("reach", [1.2e-4, 3e-4])
def test_a_spiral_begins_in_the_middle_and_leaves_no_gap(centre, reach):
    pattern = spiral(centre, ZEROS, 3e-3, reach=reach, limits=OPEN)
    assert covered_to(pattern, 3e-3) <= reach
    r = np.hypot(*pattern.offsets.T)
    assert r[0] < 1e-4
    grown = np.maximum.accumulate(r)
    assert np.all(r >= grown - reach - 1e-4)  # outwards, but for rounding to counts
    travel = np.sum(np.hypot(*np.diff(pattern.offsets, axis=0).T))
    assert travel < 1.1 * len(pattern) * (1.35 * reach)  # no more than a step for each


def test_places_beyond_the_stops_are_left_out_and_counted():
    whole = spiral(DIRECT, ZEROS, 3e-3, reach=2e-4, limits=OPEN)
    part = spiral(DIRECT, ZEROS, 3e-3, reach=2e-4, limits=(-21_309.0, 9000.0))
    assert part.left_out + len(part) == len(whole)
    assert part.left_out > 0.3 * len(whole)
    assert part.counts[:, 0].max() <= 9000.0
    turned = spiral(np.add(DIRECT, [100_000.0, 0.0]), ZEROS, 3e-3, reach=2e-4, limits=(-21_309.0, 75_691.0))
    assert turned.left_out == 0  # a whole turn on is the same place
    np.testing.assert_allclose(np.sort(turned.counts[:, 0]), np.sort(whole.counts[:, 0]))
    assert len(spiral(DIRECT, ZEROS, 1e-3, reach=2e-4, limits=(60_000.0, 61_000.0))) == 0


def test_the_spirals_steps_along_its_arc_are_even():
    p = spiral_offsets(0.1, 1e-3)
    steps = np.hypot(*np.diff(p, axis=0).T)[20:]
    np.testing.assert_allclose(steps, 1.35e-3, rtol=0.01)
    assert spiral_offsets(0.0, 1e-3).tolist() == [[0.0, 0.0]]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: raster(DIRECT, ZEROS, (1e-3, 1e-3), reach=5e-5, limits=OPEN), "below half the diagonal of a count"),
        (lambda: raster(DIRECT, ZEROS, (1e-3, -1e-3), reach=1e-3, limits=OPEN), "is below 0"),
        (
            lambda: raster(np.add(ZEROS, [0.0, 5.0]), ZEROS, (1e-3, 1e-3), reach=1e-3, limits=OPEN),
            "reaches the azimuth axis",
        ),
        (
            lambda: raster(np.add(ZEROS, [0.0, 24_999.0]), ZEROS, (1e-3, 1e-3), reach=1e-3, limits=OPEN),
            "reaches the azimuth axis",
        ),
        (lambda: raster(DIRECT, ZEROS, (1.0, 1.0), reach=1e-4, limits=OPEN), "more than 2000000"),
        (lambda: raster(DIRECT, ZEROS, (1e-3, 1e-3), reach=1e-3, limits=(5, 5)), "not in order"),
        (lambda: spiral(DIRECT, ZEROS, 1e-3, reach=9e-5, limits=OPEN), "too little for a spiral"),
        (lambda: spiral(DIRECT, ZEROS, -1e-3, reach=1e-3, limits=OPEN), "is not 0 or more"),
        (lambda: spiral(DIRECT, ZEROS, 1.0, reach=2e-4, limits=OPEN), "more than 2000000"),
        (lambda: spiral([1.0], ZEROS, 1e-3, reach=1e-3, limits=OPEN), "not two finite numbers"),
        (lambda: spiral_offsets(1e-3, 0.0), "reach 0.0 is not above 0"),
    ],
)
def test_invalid_searches_are_refused(call, message):
    with pytest.raises(ValidityError, match=message):
        call()


@pytest.mark.parametrize("prime", [False, True])
@pytest.mark.parametrize(
    ("elevation", "half", "reach"),
    [
        (20_255.516, (1.436e-3, 0.797e-3), 8.61e-5),  # the centre's rounding decides whether one more row is needed
        (3_611.476, (0.696e-3, 1.673e-3), 9.41e-5),
        (1_500.0, (2e-2, 2e-3), 2e-4),  # rows bend towards the azimuth axis
        (6_000.0, (5e-2, 1e-3), 2e-4),
    ],
)
def test_a_raster_leaves_no_gap_at_its_edges_and_corners(elevation, half, reach, prime):
    centre = ZEROS + np.array([500.3, -elevation if prime else elevation])
    assert covered_to(raster(centre, ZEROS, half, reach=reach, limits=OPEN), half) <= reach * (1 + 1e-3)
