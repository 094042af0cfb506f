"""The change of range by mirror offsets, against rays traced at a rigid mirror that is turned on its two shafts.

Nothing of the formula is used in the trace (mirror_scene); a corner cube is three more planes.
"""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.errors import ValidityError
from catseye.geometry.mirror.mirror_path import beam_angles, direction_angles, path_change
from mirror_scene import START, mirror, reflected, sent, traced_change

offset = st.floats(-3e-3, 3e-3)
azimuth = st.floats(-np.pi / 2, 1.49 * np.pi)
elevation = st.floats(0.02, 3.1)


@given(azimuth, elevation, st.floats(0.15, 150.0), st.tuples(offset, offset, offset, offset), st.booleans())
def test_the_change_of_range_is_that_of_a_traced_ray_that_meets_the_target(theta, phi, r, offsets, prime):
    target = r * np.array([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)])
    traced, angles = traced_change(target, offsets, prime)
    pointed = beam_angles(target, offsets, prime=prime)
    change, _ = path_change(*pointed, r, offsets, prime=prime)
    # The mount's own angles, from the search: Theta' and Phi' = twice the shaft's; prime is then no special case.
    mounted, _ = path_change(angles[0], 2.0 * angles[1], r, offsets)
    assert change == pytest.approx(traced, abs=2e-12)  # rounding of 150 m, and the search
    assert mounted == pytest.approx(traced, abs=2e-12)
    turned = angles[0] - pointed[0] - (np.pi if prime else 0.0)
    assert np.sin(phi) * np.remainder(turned + 1.0, 2 * np.pi) == pytest.approx(np.sin(phi), abs=1e-9)
    assert 2.0 * angles[1] == pytest.approx(-pointed[1] if prime else pointed[1], abs=1e-10)


@given(azimuth, st.floats(0.02, 2.8), st.tuples(offset, offset, offset, offset), st.booleans(), st.integers(0, 2**32))
def test_half_the_way_there_and_back_through_a_corner_cube_aside_of_the_beam_is_the_range(
    theta, phi, offsets, prime, seed
):
    """Laser, mirror, three faces of a cube in a random attitude, mirror, detector: a plane wave, any ray of it."""
    rng = np.random.default_rng(seed)
    r = 60.0
    shaft, mount_azimuth = (-phi / 2, theta + np.pi) if prime else (phi / 2, theta)
    point, direction, _ = sent(mount_azimuth, shaft, offsets)
    # An apex at distance r from the scan point on the beam's middle, to which the formula belongs.
    along = -point @ direction + np.sqrt((point @ direction) ** 2 + r**2 - point @ point)
    apex = point + along * direction
    attitude = Rotation.align_vectors([-direction], [np.ones(3) / np.sqrt(3)])[0] * Rotation.from_rotvec(
        rng.normal(0, 0.1, 3)
    )
    position, heading, way = sent(mount_azimuth, shaft, offsets, aside=rng.uniform(-2e-3, 2e-3, 2))
    total = way
    for normal in attitude.as_matrix().T:
        position, heading, way = reflected(position, heading, apex, normal)
        total += way
    position, heading, way = reflected(position, heading, *mirror(mount_azimuth, shaft, *offsets[:2]))
    np.testing.assert_allclose(heading, [0.0, 0.0, 1.0], atol=1e-12)
    total += way + (START - position[2])
    change, _ = path_change(theta, phi, r, offsets, prime=prime)
    assert total / 2.0 - START - r == pytest.approx(change, abs=1e-12)


@given(azimuth, elevation, st.floats(0.15, 100.0), st.tuples(offset, offset, offset, offset), st.booleans())
def test_the_derivatives_are_finite_differences_of_the_change(theta, phi, r, offsets, prime):
    _, slopes = path_change(theta, phi, r, offsets, prime=prime)
    for k in range(4):
        step = np.zeros(4)
        step[k] = 1e-6
        up, _ = path_change(theta, phi, r, offsets + step, prime=prime)
        down, _ = path_change(theta, phi, r, offsets - step, prime=prime)
        assert slopes[k] == pytest.approx((up - down) / 2e-6, abs=1e-8)  # 1e-15 m over 1e-6 m, curvature cancels


@given(azimuth, elevation, offset, offset)
def test_far_away_the_change_is_minus_twice_s_cos_half_phi_minus_e_sin_phi(theta, phi, e, s):
    far = 1e6
    direct, _ = path_change(theta, phi, far, [e, s, 0.0, 0.0])
    prime, _ = path_change(theta, phi, far, [e, s, 0.0, 0.0], prime=True)
    near_plane = (2 * 3e-3 * 2) ** 2 / (2 * far)
    assert direct == pytest.approx(-(2 * s * np.cos(phi / 2) + e * np.sin(phi)), abs=near_plane)
    assert prime == pytest.approx(-(2 * s * np.cos(phi / 2) - e * np.sin(phi)), abs=near_plane)


@given(azimuth, elevation, st.floats(0.15, 100.0), offset, offset)
def test_a_beam_aside_shortens_every_range_by_its_square_over_twice_the_distance(theta, phi, r, x, y):
    change, _ = path_change(theta, phi, r, [0.0, 0.0, x, y])
    assert change == pytest.approx(np.sqrt(r**2 - x**2 - y**2) - r, abs=5e-14)  # the test's rounding


def test_signs_that_a_person_can_see():
    """Straight back along the axis a face 1 mm forward shortens by 2 mm; sideways an axis 1 mm that way by 1 mm."""
    forward, _ = path_change(0.0, 0.0, 50.0, [0.0, 1e-3, 0.0, 0.0])
    assert forward == pytest.approx(-2e-3, abs=1e-12)
    assert path_change(0.7, np.pi / 2, 50.0, [1e-3, 0.0, 0.0, 0.0])[0] == pytest.approx(-1e-3, abs=2e-8)
    assert path_change(0.7, np.pi / 2, 50.0, [1e-3, 0.0, 0.0, 0.0], prime=True)[0] == pytest.approx(1e-3, abs=2e-8)
    # at the reference cube, 0.18 m off, 1 mm of the beam aside is 2.8 um
    assert path_change(0.0, 1.0, 0.18, [0.0, 0.0, 1e-3, 0.0])[0] == pytest.approx(-2.778e-6, abs=1e-9)


def to_face(mount_azimuth, shaft, offsets, r, line):
    """From a laser at r along `line` to the mirror's face, along the line."""
    on_face, normal = mirror(mount_azimuth, shaft, *offsets[:2])
    return reflected(r * line, -line, on_face, normal)[2]


@given(azimuth, st.floats(0.2, 2.9), st.tuples(offset, offset, offset, offset))
def test_autocollimation_from_afar_shows_the_axis_offset_and_not_that_of_the_face(theta, phi, offsets):
    """The notes' sentence after eq. 2.24 names the mirror's offset; it is the elevation axis off the azimuth axis.

    Autocollimating, the shaft turns by all of Phi (eq. 2.23), so that the face looks along the line.
    """
    line = np.array([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)])
    direct, prime = to_face(theta, phi, offsets, 30.0, line), to_face(theta + np.pi, -phi, offsets, 30.0, line)
    assert prime - direct == pytest.approx(2.0 * offsets[0] * np.sin(phi), abs=1e-12)
    assert (direct + prime) / 2 == pytest.approx(30.0 - offsets[1], abs=1e-12)


@given(azimuth, st.floats(0.2, 2.9), st.tuples(offset, offset, offset, offset), st.floats(5e-3, 5e-2))
def test_the_back_retroreflector_shows_the_axis_offset_as_the_notes_say(theta, phi, offsets, depth):
    """Half a turn further (eq. 2.24) the back looks along the line; its apex lies behind the shaft on the normal."""
    line = np.array([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)])

    def to_apex(mount_azimuth, shaft):
        on_face, normal = mirror(mount_azimuth, shaft, *offsets[:2])
        return 30.0 - (on_face - (offsets[1] + depth) * normal) @ line

    direct, prime = to_apex(theta, phi + np.pi), to_apex(theta + np.pi, -phi - np.pi)
    assert prime - direct == pytest.approx(2.0 * offsets[0] * np.sin(phi), abs=1e-12)
    assert (direct + prime) / 2 == pytest.approx(30.0 - depth, abs=1e-12)


@given(azimuth, st.floats(0.0, np.pi), st.floats(0.01, 1e5))
def test_direction_angles_are_those_of_the_notes(theta, phi, r):
    assume(np.sin(phi) > 1e-9)
    vector = r * np.array([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)])  # eq. 2.16-2.18
    found = direction_angles(vector)
    assert np.remainder(found[0] - theta + 1.0, 2 * np.pi) == pytest.approx(1.0, abs=1e-6)
    assert -np.pi / 2 <= found[0] < 1.5 * np.pi
    assert found[1] == pytest.approx(phi, abs=1e-12)


def test_batches_broadcast_and_agree_with_their_elements():
    rng = np.random.default_rng(4)
    theta, phi = rng.uniform(-1, 4, (5, 1)), rng.uniform(0.1, 3.0, 7)
    offsets, prime = rng.uniform(-1e-3, 1e-3, (5, 1, 4)), np.arange(7) % 2 == 0
    change, slopes = path_change(theta, phi, 20.0, offsets, prime=prime)
    assert change.shape == (5, 7)
    assert slopes.shape == (5, 7, 4)
    one, slope = path_change(theta[3, 0], phi[4], 20.0, offsets[3, 0], prime=prime[4])
    assert one == change[3, 4]
    np.testing.assert_array_equal(slope, slopes[3, 4])


def test_invalid_values_are_refused_or_nan():
    with pytest.raises(ValidityError, match=r"distance 0\.1800 m is not above 0\.4000 m, by which"):
        path_change(0.0, np.pi, [1.0, 0.18], [0.0, 0.2, 0.0, 0.0])
    with pytest.raises(ValidityError, match=r"offsets has shape \(3,\), expected \(..., 4\)"):
        path_change(0.0, 1.0, 1.0, np.zeros(3))
    with pytest.raises(ValidityError, match=r"target has shape \(2,\)"):
        beam_angles(np.zeros(2), np.zeros(4))
    # the second target is nearer than the beam passes by
    angles = beam_angles([[10.0, 0.0, 0.0], [1e-3, 0.0, 0.0]], [0.0, 5e-3, 0.0, 0.0])
    assert np.isfinite(angles[1]).tolist() == [True, False]
    # straight behind an edge-on mirror whose face stands forward, the beam passes 10 mm off on one side or the other
    behind = beam_angles([0.0, 1e-4, -10.0], [0.0, 5e-3, 0.0, 0.0])
    assert np.isnan(behind).all()
    assert np.isnan(path_change(*behind, 10.0, [0.0, 5e-3, 0.0, 0.0])[0])
