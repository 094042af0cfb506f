"""The triplet's mount: both rotations, and the aim that a rifle scope gives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from catseye.errors import ValidityError
from catseye.geometry.antenna.triplet_mount import aim_angles, base_from_unit, misaim

angle = st.floats(-3.0, 3.0)
tips = st.floats(-1.4, 1.4)
small = st.floats(-0.3, 0.3)


@given(angle, angle)
def test_the_mount_turns_first_about_its_outer_axis_then_about_its_trunnions(swing, tip):
    """Rotations of scipy, active and intrinsic: about y by the swing, about the turned x by minus the tip."""
    expected = Rotation.from_euler("YX", [swing, -tip]).as_matrix()
    np.testing.assert_allclose(base_from_unit(swing, tip), expected, rtol=0, atol=1e-15 * 4)


@given(angle, tips)
def test_the_normal_and_the_prisms_line_are_those_of_the_page(swing, tip):
    turn = base_from_unit(swing, tip)
    normal = np.sin(swing) * np.cos(tip), np.sin(tip), np.cos(swing) * np.cos(tip)
    np.testing.assert_allclose(turn[:, 2], normal, rtol=0, atol=1e-15 * 4)
    np.testing.assert_allclose(turn[:, 0], (np.cos(swing), 0.0, -np.sin(swing)), rtol=0, atol=1e-15 * 4)


@given(angle, tips, small, small, st.floats(20.0, 120.0))
def test_the_aim_brings_the_sight_through_the_point(swing, tip, x, y, far):
    towards = base_from_unit(swing, tip) @ [x, y, far]  # a point on the sight at these angles
    found = aim_angles(towards, (x, y))
    np.testing.assert_allclose(np.cos(found[0] - swing), 1.0, rtol=0, atol=1e-13)  # on any turn
    np.testing.assert_allclose(found[1], tip, rtol=0, atol=1e-9)


def test_the_closed_form_is_what_a_search_finds():
    rng = np.random.default_rng(8)
    for _ in range(5):
        towards, offset = rng.normal(size=3) * 40.0 + [0.0, 0.0, 60.0], rng.normal(size=2) * 0.2

        def miss(a, towards=towards, offset=offset):
            return (Rotation.from_euler("YX", [a[0], -a[1]]).inv().apply(towards))[:2] - offset

        start = np.arctan2(towards[0], towards[2]), np.arctan2(towards[1], np.hypot(towards[0], towards[2]))
        best = least_squares(miss, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        np.testing.assert_allclose(aim_angles(towards, offset), best.x, rtol=0, atol=1e-10)


def test_a_point_to_the_right_and_above_needs_swing_and_tip_above_zero():
    swing, tip = aim_angles([1.0, 2.0, 50.0])
    assert swing > 0.0
    assert tip > 0.0


@given(angle, tips, small, small)
def test_a_scope_beside_the_ball_leaves_its_offset_over_the_distance(swing, tip, x, y):
    towards = base_from_unit(swing, tip) @ [x, y, 50.0]
    left = misaim(*aim_angles(towards, (x, y)), towards=towards)
    np.testing.assert_allclose(left, np.arctan2([x, y], 50.0), rtol=0, atol=1e-12)
    none = misaim(*aim_angles(towards, (x, y)), towards=towards, ball=(x, y, 0.03))
    np.testing.assert_allclose(none, 0.0, rtol=0, atol=1e-12)


def test_many_mounts_at_once():
    towards = np.random.default_rng(1).normal(size=(4, 3)) + np.array([0.0, 0.0, 60.0])
    swing, tip = aim_angles(towards)
    assert swing.shape == tip.shape == (4,)
    np.testing.assert_allclose(misaim(swing, tip, towards=towards), 0.0, rtol=0, atol=1e-14)


def test_aim_points_out_of_reach_are_refused():
    with pytest.raises(ValidityError, match="nearer to the outer axis than the sight's offset x"):
        aim_angles([0.0, 50.0, 0.0])
    with pytest.raises(ValidityError, match="nearer to the trunnions than the sight's offset y"):
        aim_angles([0.0, 0.0, 0.2], (0.0, 0.3))
    with pytest.raises(ValidityError, match=r"towards \(2,\)"):
        aim_angles([1.0, 2.0])
