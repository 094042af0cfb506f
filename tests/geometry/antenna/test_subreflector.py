"""Six degrees of freedom of the subreflector, against another library's rotations and against differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.errors import FrameError, ValidityError
from catseye.geometry.antenna.subreflector import (
    angles_of,
    position_jacobian,
    position_of,
    prime_focus_from_subreflector,
    turned,
)
from catseye.geometry.frames.frame import Transform

ANGLES = st.tuples(*[st.floats(-1.5, 1.5)] * 3)
SHIFTS = st.tuples(*[st.floats(-0.5, 0.5)] * 3)
HOME = Transform("prime_focus", "subreflector", Rotation.from_euler("x", 0.1).as_matrix(), np.array([0.0, -3.0, 4.5]))


@given(ANGLES)
def test_the_order_is_x_then_y_then_z_of_axes_that_stay(angles):
    expected = Rotation.from_euler("xyz", angles).as_matrix()  # lower case: extrinsic, fixed axes
    np.testing.assert_allclose(turned(angles), expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(turned(angles_of(turned(angles))), expected, rtol=0, atol=1e-13)


@given(SHIFTS, ANGLES, SHIFTS)
def test_a_position_is_recovered_about_any_pivot(shift, angles, pivot):
    there = prime_focus_from_subreflector(shift, angles, pivot=pivot, home=HOME)
    found = position_of(there, pivot=pivot, home=HOME)
    np.testing.assert_allclose(found[0], shift, rtol=0, atol=1e-13)  # rounding of metres
    np.testing.assert_allclose(found[1], angles, rtol=0, atol=1e-12)
    other = position_of(there, pivot=(0.0, 0.0, 0.0), home=HOME)
    again = prime_focus_from_subreflector(*other, pivot=(0.0, 0.0, 0.0), home=HOME)
    np.testing.assert_allclose(again.points([1.0, 2.0, 3.0]), there.points([1.0, 2.0, 3.0]), rtol=0, atol=1e-12)


def test_the_pivot_only_shifts_and_a_point_off_it_turns_by_the_right_hand():
    pivot = np.array([0.0, -3.0, 4.5])
    moved = prime_focus_from_subreflector([0.001, 0.0, 0.0], [0.0, 0.002, 0.0], pivot=pivot, home=HOME).single
    np.testing.assert_allclose(moved.points([0.0, 0.0, 0.0]), np.add(pivot, [0.001, 0.0, 0.0]), rtol=0, atol=1e-15)
    still = Transform("prime_focus", "subreflector", np.eye(3), np.zeros(3))
    turn = prime_focus_from_subreflector(np.zeros(3), [0.0, 0.002, 0.0], pivot=np.zeros(3), home=still)
    # about y by the right hand, z goes towards x
    np.testing.assert_allclose(turn.points([0.0, 0.0, 1.0]), [np.sin(0.002), 0.0, np.cos(0.002)], rtol=0, atol=1e-15)


@given(SHIFTS, ANGLES)
def test_derivatives_are_the_slopes_of_the_position(shift, angles):
    pivot, x = np.array([0.2, -1.0, 2.0]), np.array([1.0, 3.0, -0.5])
    theta = np.array([*shift, *angles])
    home = Transform("prime_focus", "subreflector", np.eye(3), np.zeros(3))

    def point(values):
        return prime_focus_from_subreflector(values[:3], values[3:], pivot=pivot, home=home).points(x)

    steps = 1e-6 * np.eye(6)
    slopes = np.stack([(point(theta + h) - point(theta - h)) / 2e-6 for h in steps], axis=-1)
    # 1e-8: the third derivative times the step squared, and rounding over the step
    np.testing.assert_allclose(position_jacobian(shift, angles, x, pivot=pivot), slopes, rtol=0, atol=1e-8)


def test_batches_broadcast_and_bad_input_is_refused():
    shifts, angles = np.zeros((7, 1, 3)), 0.01 * np.ones((5, 3))
    many = prime_focus_from_subreflector(shifts, angles, pivot=np.zeros(3))
    assert many.rotation.shape == (7, 5, 3, 3)
    assert position_jacobian(shifts, angles, np.ones(3), pivot=np.zeros(3)).shape == (7, 5, 3, 6)
    with pytest.raises(FrameError, match="prime_focus_from_subreflector"):
        prime_focus_from_subreflector(np.zeros(3), np.zeros(3), pivot=np.zeros(3), home=HOME.inverse())
    with pytest.raises(ValidityError, match="quarter turn"):
        angles_of(turned([0.0, np.pi / 2, 0.0]))
    with pytest.raises(ValidityError, match="shift has shape"):
        prime_focus_from_subreflector([0.0, 1.0], np.zeros(3), pivot=np.zeros(3))
