"""Kinds in the hands of scipy's least squares, against answers that others give: a textbook, SVD, Kabsch."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from catseye.estimation.observations import kinds

GON = np.pi / 200.0


def fit(groups, x, free):
    """Free parameters by scipy, with the Jacobians of the kinds; returns x, cofactors, [pvv], redundancy."""
    x = np.array(x, dtype=float)

    def rows(values):
        x[free] = values
        v, a = [], []
        for group in groups:
            predicted, jacobian = group.predict(x)
            m, c = len(predicted), group.covariance
            whole = np.zeros((m, len(x) + 1))
            np.add.at(whole, (np.arange(m)[:, None], np.broadcast_to(group.columns, jacobian.shape)), jacobian)
            weight = np.linalg.inv(np.linalg.cholesky(c if c.ndim == 2 else np.diag(c)))
            v.append(weight @ (predicted - group.observed))
            a.append(weight @ whole[:, :-1][:, free])
        return np.concatenate(v), np.concatenate(a)

    found = least_squares(lambda p: rows(p)[0], x[free], jac=lambda p: rows(p)[1], xtol=1e-15, ftol=1e-15, gtol=1e-15,
                          x_scale="jac")  # fmt: skip
    v, a = rows(found.x)
    return x, np.linalg.inv(a.T @ a), float(v @ v), len(v) - len(found.x)


def test_a_textbook_point_from_directions_zenith_angles_and_distances():
    """Baumann, Vermessungskunde 2 (1995), p. 230, after F. Krumm, Geodetic Network Adjustment Examples, rev. 3.5, 2020.

    Instrument 1.600 m high; standard deviations 20 cc, 25 cc, 5 mm; the printed ones are a posteriori.
    """
    xyz = [
        1000.0,
        1201.171,
        108.680,
        1371.217,
        1072.895,
        111.974,
        1016.437,
        952.352,
        117.312,
        1181.766,
        1071.674,
        94.258,
    ]
    origin, target = np.full(3, 9), np.array([0, 3, 6])
    shift = np.array([[0, 0, 1.572], [0, 0, 1.650], [0, 0, 1.588]]) - np.array([0, 0, 1.600])
    directions = np.array([0.0, 160.1838, 320.7884]) * GON
    zeniths = np.array([95.9015, 94.0450, 92.8390]) * GON
    distances = np.array([223.6428, 190.2878, 205.1894])
    groups = (
        kinds.Directions("directions", directions, np.full(3, (20e-4 * GON) ** 2), origin, target, np.full(3, 12)),
        kinds.ZenithAngles("zenith angles", zeniths, np.full(3, (25e-4 * GON) ** 2), origin, target, shift),
        kinds.Distances("distances", distances, np.full(3, 0.005**2), origin, target, shift=shift),
    )
    start = [*xyz, np.arctan2(1000.0 - 1181.766, 1201.171 - 1071.674)]
    x, cofactors, pvv, redundancy = fit(groups, start, np.arange(9, 13))
    assert redundancy == 5
    np.testing.assert_allclose(x[9:12], [1181.7645205437304, 1071.6795225921867, 94.25982892665828], rtol=0, atol=1e-6)
    sigma = np.sqrt(np.diag(cofactors)[:3] * pvv / redundancy)
    np.testing.assert_allclose(1e3 * sigma, [3.476442, 3.958498, 5.264109], rtol=3e-4)


def cloud(rng, n, spread):
    return rng.normal(size=(n, 3)) * spread @ Rotation.random(random_state=rng).as_matrix().T + rng.normal(size=3) * 5


@pytest.mark.parametrize("seed", range(3))
def test_a_plane_through_points_is_the_one_of_the_least_singular_value(seed):
    rng = np.random.default_rng(seed)
    points = cloud(rng, 12, [5.0, 4.0, 0.05])
    mean = points.mean(axis=0)
    least = np.linalg.svd(points - mean)[2][2]
    start = least + 0.3 * rng.normal(size=3)
    group = kinds.PointsOnPlane(
        "plane", np.zeros(12), np.ones(12), 3 * np.arange(12), mean + 0.2, start, np.arange(36, 39)
    )
    x, _, pvv, _ = fit([group], [*points.ravel(), 0, 0, 0], np.arange(36, 39))
    values, jacobian = group.predict(x)
    normal = jacobian[0, :3]
    assert np.linalg.norm(np.cross(normal, least)) < 1e-7
    np.testing.assert_allclose(pvv, np.sum(((points - mean) @ least) ** 2), rtol=1e-10)
    np.testing.assert_allclose(np.abs(values), np.abs((points - mean) @ least), rtol=0, atol=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_a_line_through_points_is_the_one_of_the_greatest_singular_value(seed):
    rng = np.random.default_rng(10 + seed)
    points = cloud(rng, 12, [5.0, 0.05, 0.04])
    mean = points.mean(axis=0)
    along = np.linalg.svd(points - mean)[2][0]
    group = kinds.PointsOnLine(
        "line", np.zeros(24), np.ones(24), 3 * np.arange(12), mean + 0.2, along + 0.3 * rng.normal(size=3),
        np.arange(36, 40),
    )  # fmt: skip
    x, _, pvv, redundancy = fit([group], [*points.ravel(), 0, 0, 0, 0], np.arange(36, 40))
    assert redundancy == 20
    square = np.sum(group.predict(x)[0].reshape(-1, 2) ** 2, axis=1)
    exact = np.sum(np.cross(points - mean, along) ** 2, axis=1)
    np.testing.assert_allclose(pvv, exact.sum(), rtol=1e-10)
    np.testing.assert_allclose(square, exact, rtol=0, atol=1e-8)


def test_a_sphere_is_found_from_its_points_with_radius_and_uncertainty():
    """Six points along the axes: centre 1/2 and radius 1/6 of the variance, by the normal equations in one's head."""
    directions = np.concatenate([np.eye(3), -np.eye(3)])
    centre, radius, sigma = np.array([1.0, -2.0, 3.0]), 4.0, 1e-3
    points = centre + radius * directions
    group = kinds.PointsOnSphere(
        "sphere", np.zeros(6), np.full(6, sigma**2), 3 * np.arange(6), np.full(6, 18), 3.0, np.full(6, 21)
    )
    x, cofactors, _, _ = fit([group], [*points.ravel(), *(centre + 0.3), 0.5], np.arange(18, 22))
    np.testing.assert_allclose(x[18:], [*centre, 1.0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(cofactors, sigma**2 * np.diag([1 / 2, 1 / 2, 1 / 2, 1 / 6]), rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_the_pose_of_a_body_is_the_best_alignment_of_its_points(seed):
    rng = np.random.default_rng(20 + seed)
    body = rng.normal(size=(5, 3)) * 2
    turn = Rotation.random(random_state=rng)
    ground = turn.apply(body) + np.array([10.0, 20.0, 30.0]) + 0.01 * rng.normal(size=(5, 3))
    offset, middle = ground.mean(axis=0), body.mean(axis=0)
    best = Rotation.align_vectors(ground - offset, body - middle)[0]
    start = (Rotation.from_rotvec(0.4 * rng.normal(size=3)) * turn).as_matrix()
    group = kinds.RigidBodies("body", body.ravel(), np.eye(15), 3 * np.arange(5), np.arange(15, 21), start)
    x, _, _, redundancy = fit([group], [*ground.ravel(), *offset, 0, 0, 0], np.arange(15, 21))
    assert redundancy == 9
    found = Rotation.from_rotvec(x[18:21]).as_matrix() @ start
    np.testing.assert_allclose(found, best.as_matrix(), rtol=0, atol=1e-8)
    np.testing.assert_allclose(x[15:18], offset - best.apply(middle), rtol=0, atol=1e-7)


def test_points_of_a_moving_frame_are_found_from_two_postures():
    """The frame's points are unknown; known poses and ground points of both postures give their mean."""
    rng = np.random.default_rng(5)
    own = rng.normal(size=(3, 3))
    turns = Rotation.random(2, random_state=rng).as_matrix()
    shifts = rng.normal(size=(2, 3)) * 10
    noise = 0.01 * rng.normal(size=(2, 3, 3))
    ground = np.concatenate([(own + e) @ r.T + t for r, t, e in zip(turns, shifts, noise, strict=True)])
    pose = np.concatenate([np.tile(p, (3, 1)) for p in ([18, 19, 20, -1, -1, -1], [21, 22, 23, -1, -1, -1])])
    group = kinds.FramePoints(
        "frame", np.zeros(18), np.ones(18), 3 * np.arange(6), pose, np.repeat(turns, 3, axis=0),
        np.tile(24 + 3 * np.arange(3), 2),
    )  # fmt: skip
    x, cofactors, _, _ = fit([group], [*ground.ravel(), *shifts.ravel(), *np.zeros(9)], np.arange(24, 33))
    np.testing.assert_allclose(x[24:].reshape(3, 3), own + noise.mean(axis=0), rtol=0, atol=1e-9)
    np.testing.assert_allclose(cofactors, 0.5 * np.eye(9), rtol=0, atol=1e-12)


def test_a_level_set_up_twice_finds_heights_and_lines_of_sight():
    """Staff readings from two set-ups; heights follow as by hand: 100, 100 + 1.5 - 0.9, that + 1.2 - 0.7."""
    reading = np.array([1.5, 0.9, 1.2, 0.7])
    group = kinds.LevelPlanes(
        "levels", np.zeros(4), np.ones(4), np.array([0, 3, 3, 6]), np.array([9, 9, 10, 10]), reading
    )
    start = np.zeros(11)
    start[2] = 100.0
    x, _, _, redundancy = fit([group], start, np.array([5, 8, 9, 10]))
    assert redundancy == 0
    np.testing.assert_allclose(x[[5, 8, 9, 10]], [100.6, 101.1, 101.5, 101.8], rtol=0, atol=1e-10)


def test_a_two_axis_inclinometer_levels_a_frame_but_does_not_turn_it():
    """Readings of zero on both axes bring the frame's z upright; the turn about it stays where it began."""
    start = (Rotation.from_euler("z", 0.7) * Rotation.from_rotvec([0.2, -0.1, 0.0])).as_matrix()
    group = kinds.ObservedTilts("tilts", np.zeros(2), np.ones(2), np.eye(3)[:2], np.array([0, 1, -1]), start)
    x, _, _, _ = fit([group], np.zeros(3), np.array([0, 1]))
    np.testing.assert_allclose((Rotation.from_rotvec(x).as_matrix() @ start)[:, 2], [0, 0, 1], rtol=0, atol=1e-10)


def test_a_fixed_distance_holds_and_shows_a_contradiction():
    """Two bars of 2 m and 2.000002 m between the same points: neither is hidden, each misses by 1 um = 10 sigma."""
    ends = np.array([0, 0]), np.array([3, 3])
    bars = kinds.FixedDistances.constrained("bars", np.array([2.0, 2.000002]), *ends)
    x, _, pvv, _ = fit([bars], [0, 0, 0, 1.9, 0, 0], np.array([3]))
    assert x[3] == pytest.approx(2.000001, abs=1e-10)
    assert pvv == pytest.approx(200.0, rel=1e-3)


def test_errors_common_to_two_kinds_are_taken_once():
    """A height and a height difference with one common error: their difference is known better than either."""
    height = kinds.ObservedCoordinates("height", np.array([10.0]), np.ones(1), np.array([0]), np.array([2]))
    rise = kinds.HeightDifferences("rise", np.array([1.0]), np.ones(1), np.array([0]), np.array([3]))
    covariance = np.array([[1.0, -0.9], [-0.9, 1.0]])
    joint = kinds.Joint.of("joint", (height, rise), covariance)
    x, cofactors, _, _ = fit([joint], np.zeros(6), np.array([2, 5]))
    np.testing.assert_allclose(x[[2, 5]], [10.0, 11.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(cofactors, [[1.0, 0.1], [0.1, 0.2]], rtol=0, atol=1e-12)
