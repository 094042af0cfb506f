"""Many postures at once against one at a time, and against the site's printed checks of eq. 2.44."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.errors import FrameError, ValidityError
from catseye.geometry.antenna.frames import (
    ground_from_alidade_at,
    ground_from_reflector,
    ground_from_reflector_at,
    reflector_from_feed_arm,
    reflector_from_prime_focus,
)
from catseye.geometry.frames.frame import Transforms

# azimuth deg, elevation deg, vertex mm, focus mm: printed for eq. 2.44 by the observatory's drawing
CHECKS = [
    (0.0, 90.0, (0.0, -54839.108, 53259.990), (0.0, -54839.108, 113259.990)),
    (90.0, 45.0, (-35241.578, 0.0, 90572.632), (7184.829, 0.0, 132999.039)),
]


@pytest.mark.parametrize(("azimuth", "elevation", "vertex", "focus"), CHECKS)
def test_vertex_and_focus_are_where_the_drawing_has_them(azimuth, elevation, vertex, focus):
    here = ground_from_reflector_at(np.radians(azimuth), np.radians(elevation))
    found = here[None].points([[0.0, 0.0, 0.0], [0.0, 0.0, 60.0]])
    np.testing.assert_allclose(found * 1e3, [vertex, focus], rtol=0, atol=0.0006)  # printed to a micrometre
    at_focus = (here @ reflector_from_prime_focus()).points([0.0, 0.0, 0.0])
    np.testing.assert_allclose(at_focus * 1e3, focus, rtol=0, atol=0.0006)


@given(st.lists(st.tuples(st.floats(-7, 7), st.floats(0, 1.7)), min_size=1, max_size=6))
def test_many_postures_at_once_are_each_posture_by_itself(postures):
    a, e = np.array(postures).T
    many = ground_from_reflector_at(a, e)
    x = np.array([[3.0, 40.0, 12.0], [-1.0, 0.0, 60.0]])
    for i, points in enumerate(many[:, None].points(x)):
        np.testing.assert_allclose(points, ground_from_reflector(a[i], e[i]).points(x), rtol=0, atol=1e-13)


@given(st.floats(-7, 7), st.floats(0, 1.7))
def test_there_and_back_is_where_it_was(azimuth, elevation):
    there = ground_from_reflector_at(azimuth, elevation)
    round_trip = there.inverse() @ there
    np.testing.assert_allclose(round_trip.rotation, np.eye(3), rtol=0, atol=1e-14)
    np.testing.assert_allclose(round_trip.translation, 0.0, rtol=0, atol=1e-13)  # rounding of 100 m


def test_azimuth_turns_clockwise_and_elevation_lifts_as_another_library_has_it():
    a, e = 0.7, 0.4
    expected = Rotation.from_euler("z", -a) * Rotation.from_euler("x", e - np.pi / 2)
    np.testing.assert_allclose(ground_from_reflector_at(a, e).rotation, expected.as_matrix(), rtol=0, atol=1e-15)


def test_unknown_frames_and_wrong_shapes_are_refused():
    with pytest.raises(FrameError, match="'alidade' is not 'reflector'"):
        ground_from_alidade_at([0.0, 1.0]) @ reflector_from_feed_arm()
    with pytest.raises(ValidityError, match="expected"):
        Transforms("a", "b", np.eye(2), np.zeros(3))
    with pytest.raises(ValidityError, match="expected"):
        ground_from_alidade_at(0.0).points([1.0, 2.0])


def test_a_single_posture_of_many_is_a_transform():
    many = ground_from_reflector_at([0.1, 0.2], 0.5)
    np.testing.assert_array_equal(many[1].single.points([1.0, 2.0, 3.0]), many.points([1.0, 2.0, 3.0])[1])
    assert str(many) == "ground_from_reflector"
