"""Lines of counts between two instants, against exact rays, finite differences and mpmath."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.constants import ARCSECOND
from catseye.errors import ValidityError
from catseye.geometry.mirror.pointing import MirrorStation, counts, in_mirror_axes
from catseye.geometry.mirror.track import (
    BEAM_PER_COUNT,
    CountLine,
    apparent_motion,
    line_bound,
    longest_interval,
    miss,
)

STATION = MirrorStation([112.99, 44.28, 0.0], [-1.1973, 1.6e-5, -4e-6], [0.0, 0.2475, 0.0], [-5e-4, 9e-5], [2691, 1434])


def test_a_count_has_the_size_in_the_manual():
    np.testing.assert_allclose(BEAM_PER_COUNT / ARCSECOND, [12.96, 25.92], rtol=1e-12)
    np.testing.assert_allclose(BEAM_PER_COUNT * 120e3, [7.5, 15.1], atol=0.05)  # mm at 120 m


def test_a_line_passes_through_both_ends_and_its_middle():
    line = CountLine(np.array([[10.0, 5.0], [0.0, 0.0]]), np.array([[12.0, -5.0], [4.0, 8.0]]), np.array([0.128, 2.0]))
    np.testing.assert_allclose(line.at(0.0), line.start)
    np.testing.assert_allclose(line.at(line.interval), line.end)
    np.testing.assert_allclose(line.rate, [[15.625, -78.125], [2.0, 4.0]])
    np.testing.assert_allclose(line.at(0.064)[0], [11.0, 0.0])


def test_the_miss_is_the_distance_of_a_point_from_the_beam():
    points = np.array([[0.0, 60.0, 90.0], [10.0, -20.0, 40.0]])
    n = counts(STATION, points)
    assert np.all(miss(STATION, n, points) < 1e-11)  # rounding of 120 m
    aside = miss(STATION, np.add(n, [1.0, 0.0]), points)
    phi = np.arccos(in_mirror_axes(STATION, points)[:, 2] / np.linalg.norm(in_mirror_axes(STATION, points), axis=1))
    r = np.linalg.norm(points - STATION.scan_point, axis=1)
    np.testing.assert_allclose(aside, r * np.sin(phi) * BEAM_PER_COUNT[0], rtol=1e-6)
    prime = np.stack([n[:, 0] + 50_000, 2 * 1434 - n[:, 1]], axis=-1)
    assert np.all(miss(STATION, prime, points) < 1e-11)
    away = 2.0 * STATION.scan_point - points  # behind the beam: on its line, not on its ray
    np.testing.assert_allclose(miss(STATION, n, away), r, rtol=1e-12)


def test_motion_seen_from_a_turning_ranger_is_that_of_scipys_rotations():
    """Finite differences of R(t)^T (P - S), R from scipy; the formula's w is in ground axes."""
    start = Rotation.from_rotvec([0.3, -0.5, 0.2])
    spin, p, s = np.array([0.004, 0.003, -0.01]), np.array([120.0, 30.0, 50.0]), np.array([3.0, 60.0, 100.0])
    v, a, vs = np.array([0.5, -0.2, 0.1]), np.array([0.01, 0.02, -0.01]), np.array([0.9, 0.1, -0.3])

    def seen(t):
        body = Rotation.from_rotvec(spin * t) * start
        return body.inv().apply(p + v * t + 0.5 * a * t**2 - s - vs * t)

    mirror_from_ground = start.inv().as_matrix()
    place, speed, bend = apparent_motion(mirror_from_ground, p - s, v - vs, acceleration=a, spin=spin)
    h = 0.5
    np.testing.assert_allclose(place, seen(0.0), atol=1e-12)
    np.testing.assert_allclose(speed, (seen(h) - seen(-h)) / (2 * h), atol=3e-5)  # w^3 r h^2/6
    np.testing.assert_allclose(bend, (seen(h) - 2 * seen(0.0) + seen(-h)) / h**2, atol=1e-6)
    turning = apparent_motion(
        mirror_from_ground, p - s, 0 * v, acceleration=0 * a, spin=0 * spin, spin_rate=[0, 0, 1e-3]
    )[2]
    np.testing.assert_allclose(turning, mirror_from_ground @ -np.cross([0, 0, 1e-3], p - s), atol=1e-15)


@given(st.integers(0, 2**32))
def test_the_bound_holds_over_a_short_interval(seed):
    rng = np.random.default_rng(seed)
    p = rng.normal(size=3)
    p = 100.0 * p / np.linalg.norm(p)
    if np.hypot(*p[:2]) < 30.0:
        p[:2] = 40.0
    v, a, h = rng.uniform(-1, 1, 3), rng.uniform(-0.05, 0.05, 3), 0.128
    flat = MirrorStation([0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0], [0.0, 0.0])
    points = (p + v * np.array([[0.0], [h / 2], [h]]) + 0.5 * a * np.array([[0.0], [h / 2], [h]]) ** 2) @ (
        flat.mirror_from_ground
    )
    n = counts(flat, points)
    n[:, 0] = np.unwrap(n[:, 0], period=1e5)
    line = CountLine(n[0], n[2], np.array(h))
    off = line.at(h / 2) - n[1]
    bound, angle, way = line_bound(p, np.linalg.norm(v), np.linalg.norm(a), interval=h)
    assert np.all(np.abs(off) <= bound + 1e-9)
    assert miss(flat, line.at(h / 2), points[1]) <= way + 1e-11
    assert angle <= way / 90.0


def test_the_bound_is_that_of_the_worst_place_and_speed_within_reach():
    """By hand: from rest at 20 m, 0.5 m/s^2 for 4 s reach 4 m and 2 m/s; (0.5/16 + (2/16)^2) 16/8 rad = 0.09375 rad."""
    counted, angle, way = line_bound([0.0, 20.0, 0.0], 0.0, 0.5, interval=4.0)
    assert counted[0] == pytest.approx(0.09375 * 1e5 / (2 * np.pi), rel=1e-12)
    assert counted[1] == pytest.approx(0.09375 * 1e5 / (4 * np.pi), rel=1e-12)  # cot Phi at most 4/16
    assert angle == pytest.approx(np.sqrt(2.0) * 0.09375, rel=1e-12)
    assert way == pytest.approx(24.0 * angle, rel=1e-12)
    assert np.isinf(line_bound([0.0, 4.0, 100.0], 0.0, 0.5, interval=4.0)[0]).all()


def test_the_longest_interval_shrinks_towards_the_azimuth_axis_and_is_zero_on_it():
    z = np.array([[60.0, 0.0, 100.0], [6.0, 0.0, 115.0], [0.6, 0.0, 115.0], [0.0, 0.0, 115.0]])
    found = longest_interval(z, 1.0, 0.02)
    assert np.all(np.diff(found) < 0.0)
    assert found[-1] == 0.0
    assert longest_interval([0.0, 1000.0, 0.0], 0.0, 0.0) == 3600.0
    by_angle = longest_interval([0.0, 120.0, 0.0], 1.0, 0.02, limit_angle=1e-3 / 120.0)
    assert line_bound([0.0, 120.0, 0.0], 1.0, 0.02, interval=by_angle)[1] == pytest.approx(1e-3 / 120.0, rel=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: longest_interval([1.0, 0, 0], 1.0, 1.0, limit_counts=0.0), "limit = 0.0 is not above 0"),
        (lambda: longest_interval([1.0, 0, 0], 1.0, 1.0, longest=np.inf), "longest = inf"),
        (lambda: longest_interval([0, 120.0, 0], -1.0, 0.02), r"speed -1\.0 is not 0 or more"),
        (lambda: longest_interval([0, 120.0, 0], 1.0, [-0.02, 0.1]), r"acceleration -0\.02 is not 0 or more"),
        (lambda: line_bound([0, 120.0, 0], np.nan, 0.02, interval=0.128), "speed nan is not"),
        (lambda: line_bound([0, 120.0, 0], 1.0, 0.02, interval=-0.128), r"interval -0\.128"),
    ],
)
def test_invalid_values_are_refused(call, message):
    with pytest.raises(ValidityError, match=message):
        call()
