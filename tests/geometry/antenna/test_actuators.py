"""Lengths of actuators against scipy's rotations and differences; positions back from them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.errors import ValidityError
from catseye.geometry.antenna.actuators import actuator_lengths, position_at_lengths
from catseye.records.files.reading import read_record
from catseye.records.site.subreflector import SubreflectorMount
from repository import ROOT

MOUNT = read_record(ROOT / "examples" / "subreflector" / "hexapod.toml", SubreflectorMount)
JOINTS = MOUNT.joints
SHIFTS = st.tuples(*[st.floats(-0.15, 0.15)] * 3)  # m: as far as the example's actuators go, and beyond
ANGLES = st.tuples(*[st.floats(-0.1, 0.1)] * 3)  # rad


@given(SHIFTS, ANGLES)
def test_lengths_are_distances_of_joints_that_scipy_turns(shift, angles):
    turned = Rotation.from_euler("xyz", angles).apply(JOINTS["moving"] - JOINTS["pivot"])
    expected = np.linalg.norm(JOINTS["pivot"] + shift + turned - JOINTS["fixed"], axis=1)
    found, _ = actuator_lengths(shift, angles, **JOINTS)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)  # rounding of metres


@given(SHIFTS, ANGLES)
def test_derivatives_are_differences_of_the_lengths(shift, angles):
    six, (_, slopes) = np.array([*shift, *angles]), actuator_lengths(shift, angles, **JOINTS)
    for k in range(6):
        step = 1e-6 * np.eye(6)[k]
        ahead, behind = (actuator_lengths((six + s * step)[:3], (six + s * step)[3:], **JOINTS)[0] for s in (1, -1))
        np.testing.assert_allclose(slopes[:, k], (ahead - behind) / 2e-6, rtol=0, atol=2e-9)


@given(SHIFTS, ANGLES)
def test_the_position_comes_back_from_its_lengths(shift, angles):
    lengths, _ = actuator_lengths(shift, angles, **JOINTS)
    found = position_at_lengths(lengths, **JOINTS)
    np.testing.assert_allclose(found.shift, shift, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.angles, angles, rtol=0, atol=1e-11)


def test_lengths_that_no_position_has_are_not_a_number():
    found = position_at_lengths([0.5, 0.5, 0.5, 0.5, 0.5, 9.0], **JOINTS)
    assert np.isnan(found.shift).all()
    assert np.isnan(found.angles).all()


def test_joints_in_one_point_are_refused():
    with pytest.raises(ValidityError, match="actuator 2 has no length"):
        actuator_lengths([0, 0, 0], [0, 0, 0], fixed=[[0, 0, 1], [1, 0, 0]], moving=[[0, 0, 0], [1, 0, 0]],
                         pivot=[0, 0, 0])  # fmt: skip
