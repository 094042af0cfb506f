"""The six transformations against the notes' own program, another library's rotations, and themselves backwards."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.errors import ValidityError
from catseye.geometry.mirror.encoder import prime_counts
from catseye.geometry.mirror.mount import gamma, lambda_, mount_angles
from catseye.geometry.mirror.pointing import (
    PARAMETERS,
    MirrorStation,
    aim,
    counts,
    counts_covariance,
    counts_jacobian,
    ray,
)
from draws import draws

ZY3 = MirrorStation(
    np.array([5586.2, 20850.0, -5.8]) * 1e-3,
    [1.008848, -0.000024, 0.000145],
    np.array([-0.075, 247.459, -0.762]) * 1e-3,
    [-0.000727, 0.000121],
    [-4195, -4935],
)


def cal_eq(x, y, z):
    """The program of the notes' figure 2.5, line by line, with the data of 2.6 and 2.7; mm."""

    def times(a, b):
        return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]

    def on(a, v):
        return [sum(a[i][k] * v[k] for k in range(3)) for i in range(3)]

    sin, cos = math.sin, math.cos
    alpha1, alpha2, alpha3, ri = 1.008848, -0.000024, 0.000145, (5586.2, 20850.0, -5.8)
    dr, phi, theta, na0, ne0 = (-0.075, 247.459, -0.762), 0.000121, -0.000727, -4195, -4935
    a = [[cos(phi), 0, -sin(phi)], [0, 1, 0], [sin(phi), 0, cos(phi)]]
    b = [[1, 0, 0], [0, cos(theta), sin(theta)], [0, -sin(theta), cos(theta)]]
    c = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    d = [[cos(alpha1), 0, -sin(alpha1)], [0, 1, 0], [sin(alpha1), 0, cos(alpha1)]]
    e = [[cos(alpha2), sin(alpha2), 0], [-sin(alpha2), cos(alpha2), 0], [0, 0, 1]]
    f = [[1, 0, 0], [0, cos(alpha3), sin(alpha3)], [0, -sin(alpha3), cos(alpha3)]]
    mount = on(times(f, times(e, times(d, c))), [p - q for p, q in zip((x, y, z), ri, strict=True)])
    r = on(times(b, a), [p - q for p, q in zip(mount, dr, strict=True)])
    theta_az, phi_el = math.atan2(r[1], r[0]), math.acos(r[2] / math.hypot(*r))
    return (1e5 * theta_az / (2 * math.pi) + na0, 1e5 * phi_el / (4 * math.pi) + ne0)


@pytest.mark.parametrize("point", [(0, 100e3, 20e3), (-30e3, 5e3, 60e3), (40e3, 90e3, 3e3), (5e3, -70e3, 110e3)])
def test_counts_are_those_of_the_notes_own_program(point):
    found = counts(ZY3, np.array(point) * 1e-3)
    printed = cal_eq(*point)
    assert found[1] == pytest.approx(printed[1], abs=1e-7)  # its arccosine loses some digits
    assert math.remainder(found[0] - printed[0], 1e5) == pytest.approx(0.0, abs=1e-9)


def stations(n, rng, tilt=0.01):
    return MirrorStation(
        rng.uniform(-120, 120, (n, 3)),
        np.stack([rng.uniform(-np.pi, np.pi, n), *rng.normal(0, tilt, (2, n))], axis=1),
        np.array([0.0, 0.25, 0.0]) + rng.normal(0, 0.01, (n, 3)),
        rng.normal(0, tilt, (n, 2)),
        rng.uniform(-1e4, 1e4, (n, 2)),
    )


@draws(1_000_000, name="n")
def test_forward_and_back_agree_for_random_monuments_mirrors_and_points(n):
    rng = np.random.default_rng(20261121)
    station = stations(n, rng, tilt=0.05)
    points = rng.uniform(-150, 150, (n, 3))
    found = aim(station, points)
    at = np.stack([found.azimuth_counts, found.elevation_counts], axis=-1)
    for pointing in (at, np.stack(prime_counts(*at.T, station.zeros[:, 1]), axis=-1)):
        origin, direction = ray(station, pointing)
        sight = points - origin
        apart = np.linalg.norm(np.cross(direction, sight), axis=1) / found.range
        assert apart.max() < 1e-9
        assert np.einsum("ij,ij->i", direction, sight).min() > 0.0  # not backwards
        assert np.abs(np.linalg.norm(direction, axis=1) - 1.0).max() < 1e-14
    turn = 2 * np.pi * (at[:, 0] - station.zeros[:, 0]) / 1e5
    assert turn.min() >= -np.pi / 2 - 1e-9
    assert turn.max() <= 1.5 * np.pi + 1e-9


def test_rotations_are_those_of_another_library():
    rng = np.random.default_rng(3)
    a1, a2, a3, b1, b2 = rng.uniform(-np.pi, np.pi, (5, 1000))
    # passive turns of axes are inverse active ones: (Y Z X)^-1 turns about y first, then z, then x
    to_mount = Rotation.from_euler("YZX", np.stack([a1, a2, a3], axis=1)).inv() * Rotation.from_euler("x", -np.pi / 2)
    assert np.abs(gamma(a1, a2, a3) - to_mount.as_matrix()).max() < 1e-14
    assert (
        np.abs(lambda_(b1, b2) - Rotation.from_euler("YX", np.stack([b2, b1], axis=1)).inv().as_matrix()).max() < 1e-14
    )


def test_a_level_mount_looks_along_its_survey_azimuth():
    for azimuth in np.radians([0.0, 32.0, 122.197, 200.0, 359.0]):
        x, y, z = gamma(np.pi - azimuth, 0.0, 0.0)
        np.testing.assert_allclose(z, [np.sin(azimuth), np.cos(azimuth), 0.0], rtol=0, atol=1e-15)
        np.testing.assert_allclose(y, [0.0, 0.0, 1.0], rtol=0, atol=1e-15)
        np.testing.assert_allclose(x, np.cross(y, z), rtol=0, atol=1e-15)


def test_angles_come_back_from_a_mount_turned_anyhow():
    rng = np.random.default_rng(4)
    matrices = Rotation.random(2000, rng=rng).as_matrix()
    locked = Rotation.from_euler("YZX", [[0.4, np.pi / 2, 0.3], [0.4, -np.pi / 2, -2.0], [1.0, np.pi / 2 - 1e-12, 0.1]])
    for g in (matrices, locked.inv().as_matrix()):
        assert np.abs(gamma(*mount_angles(g)) - g).max() < 1e-14


def test_a_moving_rangers_station_stands_as_its_matrix_says():
    rng = np.random.default_rng(5)
    g, at = Rotation.random(50, rng=rng).as_matrix(), rng.uniform(-100, 100, (50, 3))
    station = MirrorStation.from_matrix(at, g, offset=[1e-3, 0.25, -2e-3], beta=[1e-3, -5e-4], zeros=[7.0, 8.0])
    np.testing.assert_allclose(station.scan_point, at, rtol=0, atol=1e-13)
    np.testing.assert_allclose(station.gamma, g, rtol=0, atol=1e-14)


def test_a_mirrors_beam_along_its_axes():
    flat = MirrorStation(
        np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(2)
    )  # z^ looks south, y^ up, x^ east
    for point, theta, phi in (((0, -9, 0), 0, 0), ((9, 0, 0), 0, 90), ((0, 0, 9), 90, 90), ((0, 0, -9), -90, 90)):
        found = aim(flat, np.array(point, float))
        assert [float(found.theta), float(found.phi)] == pytest.approx(np.radians([theta, phi]), abs=1e-15)


def test_derivatives_are_finite_differences():
    rng = np.random.default_rng(6)
    station, points = stations(40, rng, tilt=0.05), rng.uniform(-60, 60, (40, 3))
    by_point, by_station = counts_jacobian(station, points)
    for k in range(3):
        step = 1e-5 * np.eye(3)[k]
        slope = (counts(station, points + step) - counts(station, points - step)) / 2e-5
        np.testing.assert_allclose(by_point[..., k], slope, rtol=1e-5, atol=1e-4)
    for k in range(len(PARAMETERS)):
        step = 1e-5 * np.eye(13)[k]
        ahead, behind = (MirrorStation.of_parameters(station.parameters + s * step) for s in (1, -1))
        slope = (counts(ahead, points) - counts(behind, points)) / 2e-5
        np.testing.assert_allclose(by_station[..., k], slope, rtol=1e-5, atol=1e-3, err_msg=PARAMETERS[k])


def test_claimed_covariance_is_the_scatter_of_the_counts():
    rng = np.random.default_rng(7)
    u = np.array([2e-4] * 3 + [2e-5, 3e-5, 4e-5] + [1e-5] * 3 + [2e-5, 1e-5] + [0.4, 0.3])
    point, u_point = np.array([-20.0, 60.0, 50.0]), 3e-3
    claimed = counts_covariance(ZY3, point, of_station=np.diag(u**2), of_points=np.eye(3) * u_point**2)
    n = 100_000
    drawn = MirrorStation.of_parameters(ZY3.parameters + rng.normal(size=(n, 13)) * u)
    scattered = np.cov(counts(drawn, point + rng.normal(size=(n, 3)) * u_point).T)
    scale = np.sqrt(np.diag(claimed))
    # 5 sigma of a sample covariance of 10^5 draws
    np.testing.assert_allclose(scattered / np.outer(scale, scale), claimed / np.outer(scale, scale), atol=5 * 0.0045)


def test_the_compiled_form_agrees_with_the_plain_form():
    rng = np.random.default_rng(8)
    station = stations(7, rng)
    points = np.concatenate([rng.uniform(-60, 60, (999, 3)), station.scan_point[:1]])  # one in a scan point
    plain, fast = (counts(station[:, None], points, compiled=choice) for choice in (False, True))
    assert np.isnan(plain[0, -1]).all()
    assert np.isnan(fast[0, -1]).all()
    assert np.nanmax(np.abs(plain - fast)) < 1e-9
    assert np.array_equal(np.isnan(plain), np.isnan(fast))


def test_the_compiled_form_keeps_quadrants_axes_and_batch_shapes():
    flat = MirrorStation(np.zeros((2, 1, 3)), np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(2))
    axes = np.array([[s * v for v in row] for row in np.eye(3) for s in (1, -1)] + [[1, 1, 1], [-1, -2, 3], [0, 0, 0]])
    plain, fast = (counts(flat, axes, compiled=choice) for choice in (False, True))
    assert fast.shape == (2, 9, 2)
    np.testing.assert_allclose(fast, plain, rtol=0, atol=1e-9)
    with pytest.raises(ValidityError, match="are in pairs"):
        counts(stations(5, np.random.default_rng(0)), np.zeros((5, 3)), compiled=True)


@pytest.mark.parametrize("compiled", [False, True])
def test_counts_go_where_the_caller_wants_them(compiled):
    rng = np.random.default_rng(30)
    station, points, own = stations(3, rng)[:, None], rng.uniform(-60, 60, (50, 3)), np.empty((3, 50, 2))
    assert counts(station, points, compiled=compiled, out=own) is own
    np.testing.assert_array_equal(own, counts(station, points, compiled=compiled))
    for wrong in (np.empty((50, 3, 2)), np.empty((3, 50, 2), dtype=np.float32), np.empty((3, 50, 4))[..., ::2]):
        with pytest.raises(ValidityError, match=r"expected \(3, 50, 2\), float64, contiguous"):
            counts(station, points, compiled=compiled, out=wrong)


def test_stations_are_indexed_as_arrays_are():
    station = stations(4, np.random.default_rng(9))
    assert station[:, None].shape == (4, 1)
    np.testing.assert_array_equal(station[2].scan_point, station.scan_point[2])
    np.testing.assert_array_equal(MirrorStation.of_parameters(station.parameters).parameters, station.parameters)


def test_wrong_shapes_and_numbers_are_refused_in_one_line():
    with pytest.raises(ValidityError, match=r"alpha has shape \(2,\), expected \(..., 3\)"):
        MirrorStation(np.zeros(3), np.zeros(2), np.zeros(3), np.zeros(2), np.zeros(2))
    with pytest.raises(ValidityError, match="beta of a station holds a number that is not finite"):
        MirrorStation(np.zeros(3), np.zeros(3), np.zeros(3), [np.nan, 0.0], np.zeros(2))
    for call in (counts, aim, counts_jacobian):
        with pytest.raises(ValidityError, match=r"points have shape \(2,\)"):
            call(ZY3, np.zeros(2))
    with pytest.raises(ValidityError, match=r"points have shape \(4, 2\)"):
        counts(ZY3, np.zeros((4, 2)), compiled=True)
    with pytest.raises(ValidityError, match=r"counts have shape \(3,\)"):
        ray(ZY3, np.zeros(3))
    with pytest.raises(ValidityError, match=r"parameters of a station have shape \(12,\)"):
        MirrorStation.of_parameters(np.zeros(12))
