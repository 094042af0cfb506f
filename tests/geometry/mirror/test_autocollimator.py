"""The autocollimator's view against rays turned by scipy, by the notes' example, and by hand for small angles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from catseye.geometry.mirror.autocollimator import (
    autocollimator_axes,
    face_normal,
    flat_reading,
    mirror_reading,
    reflected,
)
from lab_scene import ARC, autocollimator_reads, bounced, normal_of

SMALL = st.floats(-3e-3, 3e-3)
TURN = st.floats(-7.0, 7.0)


@given(theta=TURN, shaft=st.floats(-1.6, 1.6), tilt=SMALL, axis_tilt=SMALL)
def test_the_face_stands_where_a_body_turned_on_its_shafts_has_it(theta, shaft, tilt, axis_tilt):
    np.testing.assert_allclose(
        face_normal(theta, shaft, tilt, axis_tilt=axis_tilt), normal_of(theta, shaft, tilt, axis_tilt), atol=1e-14
    )


@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6).filter(lambda v: np.linalg.norm(v[:3]) > 0.1))
def test_reflection_is_half_a_turn_about_the_normal_backwards(numbers):
    normal = np.array(numbers[:3]) / np.linalg.norm(numbers[:3])
    np.testing.assert_allclose(reflected(numbers[3:], normal), bounced(np.array(numbers[3:]), normal), atol=1e-14)


@given(
    theta=TURN,
    shaft=st.floats(-0.02, 0.02),
    tilt=SMALL,
    beta=st.tuples(SMALL, SMALL),
    lean=st.tuples(SMALL, SMALL),
    roll=SMALL,
)
def test_a_reading_off_the_mirror_is_the_traced_one(theta, shaft, tilt, beta, lean, roll):
    seen = mirror_reading(face_normal(theta, shaft, tilt), beta, [*lean, roll])
    np.testing.assert_allclose(seen, autocollimator_reads(normal_of(theta, shaft, tilt), beta, lean, roll), atol=1e-14)


@given(
    off=SMALL,
    tilt=SMALL,
    beta=st.tuples(SMALL, SMALL),
    lean=st.tuples(SMALL, SMALL),
    roll=SMALL,
    flat=st.tuples(SMALL, SMALL),
    prime=st.booleans(),
)
def test_a_reading_off_the_flat_is_the_traced_one(off, tilt, beta, lean, roll, flat, prime):
    theta, shaft = (off + np.pi, -np.pi / 4) if prime else (off, np.pi / 4)
    seen = flat_reading(face_normal(theta, shaft, tilt), beta, [*lean, roll], flat=flat)
    np.testing.assert_allclose(
        seen, autocollimator_reads(normal_of(theta, shaft, tilt), beta, lean, roll, flat), atol=1e-13
    )


def test_the_notes_example_shows_z_rotated_up_and_towards_x():
    # Section 2.5, step 4: z~ rotated up 2'30" and towards +x by 25" is beta1 = -2'30", beta2 = +25".
    seen = 0.5 * mirror_reading(face_normal(2.0, 0.0), [-150 * ARC, 25 * ARC]) / ARC
    np.testing.assert_allclose(seen, [25.0, 150.0], atol=1e-3)


def test_the_circle_has_its_centre_at_beta_and_the_shafts_angle_for_radius():
    theta = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    seen = 0.5 * mirror_reading(face_normal(theta, 3e-4, 2e-4, axis_tilt=5e-5), [-7e-4, 1e-4])
    centre = seen.mean(axis=0)
    np.testing.assert_allclose(centre, [1e-4, 7e-4], atol=1e-9)  # third order: (1e-3)^3
    np.testing.assert_allclose(np.hypot(*(seen - centre).T), np.hypot(3e-4, 2e-4 - 5e-5), rtol=1e-5)
    assert seen[0, 0] > centre[0]  # at Theta = 0 a shaft turned on leans the normal towards +x


def zero(beta, tilt=0.0, axis_tilt=0.0, *, alignment=(0.0, 0.0, 0.0), prime=False):
    """Theta' from the notes' step 6 at which y of the flat is zero."""
    base, shaft = (np.pi, -np.pi / 4) if prime else (0.0, np.pi / 4)
    return brentq(
        lambda t: flat_reading(face_normal(base + t, shaft, tilt, axis_tilt=axis_tilt), beta, alignment)[1], -0.01, 0.01
    )


def test_step_six_along_z_hat_misses_the_zero_by_beta1_and_along_the_azimuth_axis_does_not():
    beta = (-727e-6, 121e-6)
    assert zero(beta) == pytest.approx(-727e-6, abs=1e-8)
    assert zero(beta) * 1e5 / (2 * np.pi) == pytest.approx(-11.57, abs=0.01)
    assert zero(beta, alignment=(beta[1], -beta[0], 0.0)) == pytest.approx(0.0, abs=1e-6)


def test_a_tilted_face_moves_the_zero_one_way_direct_and_the_other_in_prime():
    half = np.sin(np.pi / 4)
    assert zero((0, 0), tilt=1e-4) == pytest.approx(-1e-4 / half, abs=1e-9)
    assert zero((0, 0), tilt=1e-4, prime=True) == pytest.approx(+1e-4 / half, abs=1e-9)
    assert zero((0, 0), axis_tilt=1e-4) == pytest.approx(+1e-4, abs=1e-9)


def test_the_axes_of_the_autocollimator_are_a_rotation_with_the_given_lean():
    axes = autocollimator_axes(np.array([[1e-3, 2e-3, 0.3]]))[0]
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(axes[2, :2], [1e-3, 2e-3], rtol=1e-5)
    assert axes[0, 1] == pytest.approx(np.sin(0.3), rel=1e-4)  # X towards +y for a roll to the right hand
