"""The nominal antenna against eq. 2.44 written out, and the mount against the night-01 convention."""

import numpy as np
import pytest

from catseye.geometry.antenna.frames import alidade_from_elevation, ground_from_reflector
from catseye.geometry.mirror.mount import gamma, scan_point


@pytest.mark.parametrize("azimuth_deg", [0.0, 145.3, 270.0])
@pytest.mark.parametrize("elevation_deg", [5.0, 30.0, 77.7, 94.0])
def test_reflector_to_ground_is_equation_2_44(azimuth_deg, elevation_deg):
    a, e = np.radians(azimuth_deg), np.radians(elevation_deg)
    rag = np.array([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]])
    rea = np.array([[1, 0, 0], [0, np.sin(e), np.cos(e)], [0, -np.cos(e), np.sin(e)]])
    offset = np.array([0, -54.839108, 4.999990])
    x = np.random.default_rng(1).uniform(-60, 110, size=(20, 3))
    expected = [rag @ (rea @ (p + offset) + [0, 0, 48.260]) for p in x]
    # 1e-13 m: rounding of coordinates of 100 m
    np.testing.assert_allclose(ground_from_reflector(a, e).points(x), expected, rtol=0, atol=1e-13)


def test_the_names_say_where_it_leads():
    assert str(ground_from_reflector(0.0, 1.0)) == "ground_from_reflector"
    assert str(alidade_from_elevation(1.0, elevation_axis_height=48.26)) == "alidade_from_elevation"


def test_a_dish_at_the_horizon_looks_along_its_azimuth():
    boresight = ground_from_reflector(np.radians(30.0), 0.0).directions([0.0, 0.0, 1.0])
    np.testing.assert_allclose(boresight, [0.5, np.sqrt(0.75), 0.0], rtol=0, atol=1e-15)


def test_a_level_mount_looks_along_its_survey_azimuth_with_y_up():
    azimuth = np.radians([0.0, 90.0, 248.6])
    g = gamma(np.pi - azimuth, 0.0, 0.0)
    ahead = np.stack([np.sin(azimuth), np.cos(azimuth), np.zeros(3)], axis=-1)
    np.testing.assert_allclose(g[:, 2], ahead, rtol=0, atol=1e-15)
    np.testing.assert_allclose(g[:, 1], np.broadcast_to([0.0, 0.0, 1.0], (3, 3)), rtol=0, atol=1e-15)


def test_scan_points_broadcast():
    fixed = np.zeros((12, 3))
    points = scan_point(fixed, gamma(np.linspace(0, 6, 12), 0.0, 0.0), [0.0, 0.25, 0.0])
    np.testing.assert_allclose(points, np.broadcast_to([0.0, 0.0, 0.25], (12, 3)), rtol=0, atol=1e-16)
