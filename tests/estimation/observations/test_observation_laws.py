"""Laws of the kinds: what moving, turning, scaling and exchanging does to what is observed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from catseye.estimation.observations import kinds
from catseye.estimation.observations.bodies.pose import right_jacobian
from catseye.estimation.observations.unit_direction import direction
from catseye.geometry.frames.rotation import from_vector, skew
from draws import examples

seeds = st.integers(0, 2**32 - 1)
angles = st.floats(-20.0, 20.0)
quick = examples(60)
FROM, TO, THIRD = np.array([0, 3, 6]), np.array([3, 6, 0]), np.array([6, 0, 3])
ONE, THREE = np.ones(3), np.zeros(3)
PARAMETER = np.array([9, 9, 9])


def scene(seed):
    """Three points no two of which are near each other or above each other, and one more parameter."""
    rng = np.random.default_rng(seed)
    turn = rng.uniform() + np.array([0.0, 2.0, 4.0])
    xyz = np.stack([9.0 * np.sin(turn), 9.0 * np.cos(turn), rng.uniform(-5, 5, 3)], axis=1) + rng.normal(size=(3, 3))
    return np.append(xyz.ravel(), rng.uniform(-1, 1))


def between(make, observed=THREE):
    return make("law", observed, ONE, FROM, TO)


def directions(observed=THREE):
    return kinds.Directions("law", observed, ONE, FROM, TO, PARAMETER)


def corners(observed=THREE):
    return kinds.HorizontalAngles("law", observed, ONE, FROM, TO, THIRD)


def clockwise(x, angle, shift):
    """The points turned clockwise about z and moved; the last parameter, an orientation, turns with them."""
    c, s = np.cos(angle), np.sin(angle)
    xyz = x[:9].reshape(3, 3) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]).T + shift
    return np.append(xyz.ravel(), x[9] + angle)


@quick
@given(seeds, angles)
def test_rotation_about_the_vertical_leaves_readings_unchanged(seed, angle):
    x = scene(seed)
    moved = clockwise(x, angle, np.array([100.0, -50.0, 7.0]))
    level = (
        kinds.Distances,
        kinds.HorizontalDistances,
        kinds.ZenithAngles,
        kinds.Inclinations,
        kinds.HeightDifferences,
    )
    for group in (*map(between, level), directions(), corners()):
        values = group.predict(x)[0]
        nearest = replace(group, observed=values)
        np.testing.assert_allclose(nearest.predict(moved)[0], values, rtol=0, atol=1e-12)


@quick
@given(seeds, angles)
def test_an_azimuth_grows_by_the_turn(seed, angle):
    x = scene(seed)
    before = between(kinds.Azimuths).predict(x)[0]
    after = between(kinds.Azimuths, before + angle).predict(clockwise(x, angle, 0.0))[0]
    np.testing.assert_allclose(after - before, angle, rtol=0, atol=1e-12)


@quick
@given(seeds, st.floats(1e-3, 1e3))
def test_a_larger_scene_has_larger_lengths_and_the_same_angles(seed, factor):
    x = scene(seed)
    larger = np.append(factor * x[:9], x[9])
    for make in (kinds.Distances, kinds.HorizontalDistances, kinds.HeightDifferences):
        np.testing.assert_allclose(
            between(make).predict(larger)[0], factor * between(make).predict(x)[0], rtol=0, atol=1e-13 * 30 * factor
        )
    for group in (*map(between, (kinds.Azimuths, kinds.ZenithAngles, kinds.Inclinations)), directions(), corners()):
        np.testing.assert_allclose(group.predict(larger)[0], group.predict(x)[0], rtol=0, atol=1e-13)


@quick
@given(seeds)
def test_exchanging_the_ends_changes_signs(seed):
    x = scene(seed)

    def there_and_back(make):
        return make("law", THREE, ONE, FROM, TO).predict(x)[0], make("law", THREE, ONE, TO, FROM).predict(x)[0]

    for make in (kinds.Distances, kinds.HorizontalDistances):
        there, back = there_and_back(make)
        np.testing.assert_array_equal(there, back)
    for make in (kinds.HeightDifferences, kinds.Inclinations):
        there, back = there_and_back(make)
        np.testing.assert_array_equal(there, -back)
    there, back = there_and_back(kinds.ZenithAngles)
    np.testing.assert_allclose(there + back, np.pi, rtol=0, atol=1e-15 * 4)
    there, back = there_and_back(kinds.Azimuths)
    np.testing.assert_allclose(np.abs(there - back), np.pi, rtol=0, atol=1e-15 * 4)
    vectors = [kinds.Vectors("law", np.zeros(9), np.ones(9), *ends).predict(x)[0] for ends in ((FROM, TO), (TO, FROM))]
    np.testing.assert_array_equal(vectors[0], -vectors[1])
    ends = FROM, TO, FROM, THIRD
    first = kinds.DistanceDifferences("law", THREE, ONE, *ends).predict(x)[0]
    second = kinds.DistanceDifferences("law", THREE, ONE, *ends[2:], *ends[:2]).predict(x)[0]
    np.testing.assert_array_equal(first, -second)


@quick
@given(seeds, st.integers(3, 9))
def test_the_angles_round_the_horizon_make_a_full_circle(seed, n):
    rng = np.random.default_rng(seed)
    azimuth = np.sort(2 * np.pi * (np.arange(n) + rng.uniform(0, 0.9, n)) / n)
    targets = np.stack([np.sin(azimuth), np.cos(azimuth), rng.normal(size=n)], axis=1) * rng.uniform(5, 50, (n, 1))
    x = np.concatenate([np.zeros(3), targets.ravel()])
    sighted = 3 * np.arange(1, n + 1)
    group = kinds.HorizontalAngles(
        "law", np.full(n, np.pi), np.ones(n), np.zeros(n, int), sighted, np.roll(sighted, -1)
    )
    values = group.predict(x)[0]
    assert np.all((values > 0.0) & (values < 2.0 * np.pi))
    np.testing.assert_allclose(values.sum(), 2.0 * np.pi, rtol=1e-14)


@quick
@given(seeds, st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=3))
def test_no_residual_of_an_angle_passes_half_a_turn(seed, observed):
    x, observed = scene(seed), np.array(observed)
    for group in (*(between(m, observed) for m in (kinds.Azimuths, kinds.ZenithAngles)), directions(observed),
                  corners(observed), between(kinds.Inclinations, observed)):  # fmt: skip
        values = group.predict(x)[0]
        assert np.all(np.abs(observed - values) <= np.pi * (1 + 1e-14))
        original = replace(group, observed=THREE).predict(x)[0]
        turns = (values - original) / (2 * np.pi)
        np.testing.assert_allclose(turns, np.rint(turns), atol=1e-13)


@pytest.mark.parametrize("observed", [np.pi, -np.pi, 3 * np.pi])
def test_half_a_turn_counts_as_positive_on_either_side(observed):
    group = kinds.Azimuths("law", np.array([observed]), np.ones(1), np.array([0]), np.array([3]))
    value = group.predict(np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0]))[0]
    np.testing.assert_allclose(observed - value, np.pi, rtol=1e-15)


@quick
@given(seeds)
def test_a_sphere_gives_the_zenith_angle_that_the_curvature_term_claims(seed):
    """Exact geometry: two points at one height above a sphere see each other half the arc below their horizons."""
    rng = np.random.default_rng(seed)
    radius, far = rng.uniform(1e5, 1e7), rng.uniform(1.0, 5e3)
    arc = far / radius
    # of the target, in the origin's own level axes; cos - 1 as a square, which keeps its digits
    chord = radius * np.array([0.0, np.sin(arc), -2.0 * np.sin(0.5 * arc) ** 2])
    exact = np.arctan2(chord[1], chord[2])
    group = kinds.ZenithAngles("law", np.zeros(1), np.ones(1), np.array([0]), np.array([3]), curved=True, radius=radius)
    value = group.predict(np.array([0.0, 0.0, 0.0, 0.0, far, 0.0]))[0]
    np.testing.assert_allclose(value, exact, rtol=0, atol=1e-12)


def test_ray_with_earth_curvature_has_equal_heights_on_its_horizon():
    """k = 1: the ray follows the ground, so curvature and refraction cancel."""
    group = kinds.ZenithAngles(
        "law", np.zeros(1), np.ones(1), np.array([0]), np.array([3]), refraction=1.0, curved=True
    )
    value = group.predict(np.array([0.0, 0.0, 0.0, 0.0, 3e3, 0.0]))[0]
    np.testing.assert_allclose(value, 0.5 * np.pi, rtol=1e-15)


@quick
@given(seeds)
def test_a_body_does_not_notice_that_the_ground_moves_with_it(seed):
    rng = np.random.default_rng(seed)
    points, translation = rng.normal(size=(4, 3)) * 5, rng.normal(size=3) * 5
    w, start, own = rng.normal(size=3), Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3)
    turn, shift = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3) * 50
    at = 3 * np.arange(4), np.arange(12, 18)

    def both(points, translation, w, start):
        x = np.concatenate([points.ravel(), translation, w, own])
        body = kinds.RigidBodies("law", np.zeros(12), np.ones(12), *at, start)
        frame = kinds.FramePoints("law", np.zeros(12), np.ones(12), *at, start, np.full(4, 18))
        return np.stack([body.predict(x)[0], frame.predict(x)[0]])

    here = both(points, translation, w, start)
    there = both(points @ turn.T + shift, turn @ translation + shift, turn @ w, turn @ start)
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-12)
    by_scipy = (points - translation) @ Rotation.from_rotvec(w).as_matrix() @ start
    np.testing.assert_allclose(here[0], by_scipy.ravel(), rtol=0, atol=1e-13)
    np.testing.assert_allclose(here[1], (by_scipy - own).ravel(), rtol=0, atol=1e-13)


@quick
@given(seeds)
def test_a_tilt_is_the_inclination_of_the_axis_on_the_ground(seed):
    rng = np.random.default_rng(seed)
    axis, w = rng.normal(size=3), rng.normal(size=3)
    start = Rotation.random(random_state=rng).as_matrix()
    ground = Rotation.from_rotvec(w).as_matrix() @ start @ axis
    line = kinds.Inclinations("law", np.zeros(1), np.ones(1), np.array([0]), np.array([3]))
    tilt = kinds.ObservedTilts("law", np.zeros(1), np.ones(1), axis, np.arange(3), start)
    expected = line.predict(np.concatenate([np.zeros(3), ground]))[0]
    np.testing.assert_allclose(tilt.predict(w)[0], expected, rtol=0, atol=1e-13)


@quick
@given(seeds, st.floats(0.0, 6.0))
def test_the_right_jacobian_is_the_mean_of_the_turn_back(seed, angle):
    """J = integral of exp(-s w) for s from 0 to 1, which scipy's exponential of a block matrix gives exactly."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    w = angle * axis / np.linalg.norm(axis)
    blocks = np.zeros((6, 6))
    blocks[:3, :3], blocks[:3, 3:] = -skew(w), np.eye(3)
    np.testing.assert_allclose(right_jacobian(w), expm(blocks)[:3, 3:], rtol=0, atol=1e-13)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 0.299999999, 0.3, 0.300000001, 1.0])
def test_right_jacobian_is_accurate_at_the_series_limit(angle):
    mpmath = pytest.importorskip("mpmath")
    w = mpmath.mpf(angle)
    with mpmath.workdps(50):
        third = (w - mpmath.sin(w)) / w**3 if angle else mpmath.mpf(1) / 6
        expected = float(1 - w * w * third)  # the element across the axis
    assert right_jacobian(np.array([angle, 0.0, 0.0]))[1, 1] == pytest.approx(expected, rel=0, abs=3e-16)


@quick
@given(seeds)
def test_a_direction_turns_its_axes_by_the_shortest_way(seed):
    rng = np.random.default_rng(seed)
    start, a = rng.normal(size=(5, 3)), rng.normal(size=(5, 2)) * 2.0
    turned, begun = direction(start, a), direction(start, np.zeros((5, 2)))
    np.testing.assert_allclose(begun.u, start / np.linalg.norm(start, axis=1, keepdims=True), rtol=0, atol=1e-15 * 4)
    np.testing.assert_allclose(np.cross(turned.f[:, 0], turned.f[:, 1]), turned.u, rtol=0, atol=1e-14)
    for i in range(5):
        by = np.cross(begun.u[i], turned.u[i])
        angle = np.arctan2(np.linalg.norm(by), begun.u[i] @ turned.u[i])
        turn = from_vector(angle * by / np.linalg.norm(by))
        np.testing.assert_allclose(turn @ begun.u[i], turned.u[i], rtol=0, atol=1e-14)
        np.testing.assert_allclose(begun.f[i] @ turn.T, turned.f[i], rtol=0, atol=1e-13)
