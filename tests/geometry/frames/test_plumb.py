"""The plumb line's lean, the azimuth's turn and the theodolite's leaning axis, against vectors turned by scipy."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.geometry.frames.local_frame import PINTLE_LATITUDE, PINTLE_LONGITUDE, LocalFrame
from catseye.geometry.frames.plumb import axis_lean_error, azimuth, lean, mount_angles, plumb_from_ground
from catseye.geometry.mirror.mount import gamma
from monument_scene import ARCSECOND, HEIGHT, circle, mount_axes, plumb_axes

FRAME = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, HEIGHT)


def test_the_rotation_is_that_of_another_library():
    frame = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, HEIGHT, xi=2e-5, eta=-3e-5)
    for point in ([0, 0, 0], [120.0, -30.0, 5.0], [-700.0, 900.0, 40.0]):
        np.testing.assert_allclose(plumb_from_ground(frame, point), plumb_axes(point, 2e-5, -3e-5).T, atol=1e-13)


def test_the_zenith_leans_outwards_by_distance_over_radius():
    for towards in np.radians([0, 60, 135, 250]):
        outwards = np.array([np.sin(towards), np.cos(towards)])
        leaning = lean(FRAME, np.append(120.0 * outwards, 0.0))
        assert leaning @ outwards / ARCSECOND == pytest.approx(120.0 / 6.37e6 / ARCSECOND, abs=0.02)  # 3.9"
        exact = plumb_from_ground(FRAME, np.append(120.0 * outwards, 0.0))[2]
        np.testing.assert_allclose(exact[:2], leaning, atol=1e-9)


def test_north_turns_with_the_meridian_and_with_the_deflection():
    frame = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, HEIGHT, eta=5 * ARCSECOND)
    east = plumb_from_ground(FRAME, [120.0, 0.0, 0.0])
    # North at a place east of the origin points to the west of the frame's north: to the same pole.
    turned = np.arctan2(*east[1, :2])
    assert turned == pytest.approx(-120.0 * np.tan(PINTLE_LATITUDE) / 6.387e6, rel=1e-3)
    assert turned / ARCSECOND == pytest.approx(-3.07, abs=0.02)
    # Laplace: geodetic azimuth = astronomic azimuth - eta tan(phi).
    laplace = np.arctan2(*plumb_from_ground(frame, [0.0, 0.0, 0.0])[1, :2])
    assert laplace / ARCSECOND == pytest.approx(-5 * np.tan(PINTLE_LATITUDE), abs=1e-3)


def test_a_mount_levelled_by_the_plumb_line_is_turned_against_the_frame():
    # Pointing at the pintle from 120 m south, levelled there: alpha3 = -r/R by the sign worked out by hand.
    place = np.array([0.0, -120.0, 0.0])
    found = mount_angles(gamma(np.pi - 0.0, 0.0, 0.0) @ plumb_from_ground(FRAME, place))
    assert found[2] / ARCSECOND == pytest.approx(-3.89, abs=0.01)
    assert found[1] / ARCSECOND == pytest.approx(0.0, abs=1e-6)
    # And the mount so turned, built of vectors, has its normal along the local zenith.
    normal = mount_axes(0.0, found[1], found[2])[:, 1]
    np.testing.assert_allclose(normal, plumb_axes(place)[:, 2], atol=1e-12)


def test_mount_axes_by_scipy_are_the_notes_matrix_and_its_angles_come_back():
    rng = np.random.default_rng(4)
    for _ in range(20):
        a, (b, c) = rng.uniform(-3, 3), rng.uniform(-0.1, 0.1, 2)
        matrix = mount_axes(np.pi - a, b, c).T
        np.testing.assert_allclose(gamma(a, b, c), matrix, atol=1e-14)
        np.testing.assert_allclose(mount_angles(matrix), [a, b, c], atol=1e-14)
    with pytest.raises(ValidityError, match="shape"):
        mount_angles(np.eye(2))


def test_a_leaning_theodolite_reads_as_the_formula():
    level = np.eye(3)
    for bearing in np.radians([0.0, 80.0, 200.0, 310.0]):
        for zenith in np.radians([30.0, 52.0, 88.0, 100.0]):
            sight = np.array([np.sin(zenith) * np.sin(bearing), np.sin(zenith) * np.cos(bearing), np.cos(zenith)])
            to_east, to_north = 8 * ARCSECOND, -11 * ARCSECOND
            read = circle(sight, level, (to_east, to_north))[0] - circle(sight, level)[0]
            right = to_east * np.cos(bearing) - to_north * np.sin(bearing)
            error = axis_lean_error(zenith, right)
            assert np.remainder(read + np.pi, 2 * np.pi) - np.pi == pytest.approx(float(error), abs=2e-8)
    assert azimuth([1.0, 0.0, 0.3]) == pytest.approx(np.pi / 2)
