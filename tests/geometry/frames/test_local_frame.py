"""The ground frame against PROJ's own topocentric pipeline and Snyder's formulas by hand, there and back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.geometry.frames.local_frame import (
    PINTLE_LATITUDE,
    PINTLE_LONGITUDE,
    LocalFrame,
    elevation_factor,
    grid,
    radii,
)
from monument_scene import HEIGHT, LATITUDE, LONGITUDE, plumb_axes, topocentric

FRAME = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, HEIGHT)
LEANING = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, HEIGHT, xi=2e-5, eta=-3e-5, geoid_height=-31.0)
FOOT = 1200 / 3937  # m, US survey


def snyder(latitude, longitude):
    """Easting, northing (m), scale and convergence (rad) in the zone West Virginia South; degrees.

    Snyder, Map projections: a working manual, 1987, eqs. 14-4, 15-1 to 15-9, 14-15; zone 4702 as NOAA Manual NOS NGS 5
    prints it: parallels 37° 29' and 38° 53', origin 37° 00' N 81° 00' W, 600 000 m E, 0 m N. GRS 80.
    """
    a, f = 6_378_137.0, 1 / 298.257222101
    e = np.sqrt(f * (2 - f))
    south, north, origin = np.radians([37 + 29 / 60, 38 + 53 / 60, 37.0])
    phi, lam = np.radians(latitude), np.radians(longitude + 81.0)

    def m(p):
        return np.cos(p) / np.sqrt(1 - (e * np.sin(p)) ** 2)

    def t(p):
        return np.tan(np.pi / 4 - p / 2) / ((1 - e * np.sin(p)) / (1 + e * np.sin(p))) ** (e / 2)

    n = np.log(m(south) / m(north)) / np.log(t(south) / t(north))
    big = m(south) / (n * t(south) ** n)
    rho, rho_0 = a * big * t(phi) ** n, a * big * t(origin) ** n
    return 6e5 + rho * np.sin(n * lam), rho_0 - rho * np.cos(n * lam), rho * n / (a * m(phi)), n * lam


def test_the_frame_is_proj_s_topocentric_one():
    rng = np.random.default_rng(1)
    points = rng.uniform(-3000, 3000, (500, 3))
    longitude, latitude, height = topocentric().transform(*points.T, direction="INVERSE")
    np.testing.assert_allclose(
        FRAME.from_geodetic(np.radians(latitude), np.radians(longitude), height), points, atol=4e-8
    )  # PROJ's inverse is good to 3e-8 m
    east = FRAME.from_geodetic(PINTLE_LATITUDE, PINTLE_LONGITUDE + 1e-5, HEIGHT)
    assert east[0] == pytest.approx(1e-5 * np.cos(PINTLE_LATITUDE) * 6_386_400.0, rel=1e-3)  # x is east


@pytest.mark.parametrize("plumb", [False, True])
def test_there_and_back_over_kilometres(plumb):
    frame = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, HEIGHT, 2e-5, -3e-5, -31.0, plumb)
    points = np.random.default_rng(2).uniform(-5000, 5000, (20_000, 3)) * [1, 1, 0.2]
    off = frame.from_geodetic(*frame.geodetic(points)) - points
    # The last digit of a geocentric coordinate is 0.9 nm, that of a longitude in radians 1.1 nm on the ground.
    assert np.sqrt(np.mean(off**2)) < 1e-9
    assert np.abs(off).max() < 4e-9
    by_plane = frame.from_state_plane(frame.state_plane(points)) - points
    assert np.sqrt(np.mean(by_plane**2)) < 2e-9
    assert np.abs(by_plane).max() < 1e-8


def test_state_plane_scale_and_convergence_are_snyder_s():
    rng = np.random.default_rng(3)
    latitude, longitude = LATITUDE + rng.uniform(-0.5, 0.5, 50), LONGITUDE + rng.uniform(-2, 0.5, 50)
    easting, northing, scale, convergence = snyder(latitude, longitude)
    points = FRAME.from_geodetic(np.radians(latitude), np.radians(longitude), 400.0)
    np.testing.assert_allclose(FRAME.state_plane(points)[:, :2], np.column_stack([easting, northing]), atol=1e-6)
    found = grid(np.radians(latitude), np.radians(longitude))
    np.testing.assert_allclose(found.scale, scale, atol=1e-9)
    np.testing.assert_allclose(found.convergence, convergence, atol=1e-9)
    at_pintle = grid(PINTLE_LATITUDE, PINTLE_LONGITUDE)
    assert np.degrees(at_pintle.convergence) == pytest.approx(0.7172, abs=1e-4)  # east of 81° W: above zero
    assert at_pintle.scale == pytest.approx(0.99993507, abs=1e-8)


def test_a_short_line_agrees_with_grid_and_elevation_factors():
    ends = np.array([[-200.0, -150.0, 0.0], [200.0, 150.0, 0.0]])
    plane = FRAME.state_plane(ends)
    run = (plane[1] - plane[0])[:2]
    at = grid(PINTLE_LATITUDE, PINTLE_LONGITUDE)
    bearing = np.arctan2(200.0, 150.0)
    scale = at.scale * float(elevation_factor(PINTLE_LATITUDE, HEIGHT))
    # Between directions the radius differs by 0.4 %, the factor at 775 m by 5e-7.
    assert np.hypot(*run) / 500.0 == pytest.approx(scale, abs=6e-7)
    meridian, across = radii(PINTLE_LATITUDE)
    along = 1.0 / (np.cos(bearing) ** 2 / meridian + np.sin(bearing) ** 2 / across)  # Euler's formula
    own = at.scale * (1 / (1 + HEIGHT / along))
    assert np.hypot(*run) / 500.0 == pytest.approx(own, abs=5e-9)
    assert np.arctan2(*run) == pytest.approx(bearing - at.convergence, abs=2e-6)  # grid azimuth = azimuth - convergence


def test_the_plane_rises_over_the_level_by_d_squared_over_two_r():
    ring = 120.0 * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    above = FRAME.geodetic(ring)[2] - HEIGHT
    radius = radii(PINTLE_LATITUDE)
    expected = [120.0**2 / 2 / (r + HEIGHT) for r in (radius.prime_vertical, radius.meridian) * 2]
    np.testing.assert_allclose(above, expected, atol=2e-8)
    assert above == pytest.approx(1.13e-3, abs=1e-5)  # 1.1 mm at 120 m, and its sign: a plane leaves the level upwards


def test_elevations_follow_the_geoid_square_to_the_plumb_line():
    # The plumb line's zenith leans north by xi: the level falls to the north against the frame, so that a mark at the
    # same z is the higher above the geoid the further north it stands.
    mark = np.array([[0.0, 100.0, 0.0], [0.0, 0.0, 0.0], [100.0, 0.0, 0.0]])
    with_lean, without = LEANING.state_plane(mark)[:, 2], FRAME.state_plane(mark)[:, 2] + 31.0
    np.testing.assert_allclose(with_lean - without, [100 * 2e-5, 0.0, 100 * -3e-5], atol=3e-8)
    zenith = plumb_axes([0.0, 0.0, 0.0], 2e-5, -3e-5)[:, 2]
    level = with_lean[0] - with_lean[1] - 100.0**2 / 2 / (radii(PINTLE_LATITUDE).meridian + HEIGHT)
    assert level == pytest.approx(100 * zenith[1], abs=5e-8)  # second order of eta: 4e-10 rad


def test_the_plumb_line_as_z_makes_levels_level_and_keeps_azimuths():
    frame = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, HEIGHT, 2e-5, -3e-5, -31.0, plumb=True)
    mark = np.array([[0.0, 100.0, 0.0], [0.0, 0.0, 0.0], [100.0, 0.0, 0.0]])
    rise = frame.state_plane(mark)[:, 2]
    np.testing.assert_allclose(rise[[0, 2]] - rise[1], 100.0**2 / 2 / 6.37e6, atol=4e-6)
    north = FRAME.from_geodetic(*frame.geodetic([0.0, 100.0, 0.0]))
    assert np.arctan2(*north[:2]) == pytest.approx(0.0, abs=1e-9)
    assert north[2] == pytest.approx(-100 * 2e-5, abs=1e-8)  # y dips where the zenith leans north


@given(x=st.floats(-2000, 2000), y=st.floats(-2000, 2000), z=st.floats(-50, 200), xi=st.floats(-1e-4, 1e-4))
def test_any_point_is_recovered_through_any_system(x, y, z, xi):
    frame = LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, HEIGHT, xi=xi, eta=-0.5 * xi, geoid_height=-31.0, plumb=True)
    np.testing.assert_allclose(frame.from_state_plane(frame.state_plane([x, y, z])), [x, y, z], rtol=0, atol=1e-8)


def test_implausible_values_are_refused():
    with pytest.raises(ValidityError, match="US survey feet"):
        FRAME.from_state_plane([701_288.69 / FOOT, 159_695.25 / FOOT, 807.0])
    with pytest.raises(ValidityError, match=r"latitude 38\.43"):
        LocalFrame(LATITUDE, PINTLE_LONGITUDE, HEIGHT)
    with pytest.raises(ValidityError, match="xi"):
        LocalFrame(PINTLE_LATITUDE, PINTLE_LONGITUDE, HEIGHT, xi=4.0)
    with pytest.raises(ValidityError, match="latitude"):
        FRAME.from_geodetic(38.4, -1.39, 0.0)
    with pytest.raises(ValidityError, match="shape"):
        FRAME.geodetic([1.0, 2.0])
