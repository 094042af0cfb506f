"""Laws of rotations and frames."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from catseye.geometry.frames.frame import Transform
from catseye.geometry.frames.rotation import from_vector, rx, ry, rz, skew, to_vector
from catseye.geometry.mirror.mount import gamma, lambda_, scan_point

angles = st.floats(-10.0, 10.0)
vectors = arrays(float, 3, elements=st.floats(-100.0, 100.0))
rotation_vectors = arrays(float, 3, elements=st.floats(-3.0, 3.0))
ROUNDING = 1e-12  # m, ten roundings of coordinates of 100 m


@st.composite
def transforms(draw, to="b", from_="a"):
    return Transform(to, from_, from_vector(draw(rotation_vectors)), draw(vectors))


@given(rotation_vectors, vectors)
def test_rotations_keep_length(r, v):
    assert abs(np.linalg.norm(from_vector(r) @ v) - np.linalg.norm(v)) <= ROUNDING


@given(rotation_vectors)
def test_a_rotation_keeps_its_own_axis(r):
    np.testing.assert_allclose(from_vector(r) @ r, r, rtol=0, atol=1e-14)


@given(rotation_vectors)
def test_matrix_to_vector_to_matrix_is_the_same_rotation(r):
    vector = to_vector(from_vector(r))
    assert np.linalg.norm(vector) <= np.pi + 1e-15
    np.testing.assert_allclose(from_vector(vector), from_vector(r), rtol=0, atol=1e-14)


@given(rotation_vectors)
def test_vectors_shorter_than_a_half_turn_come_back(r):
    length = np.linalg.norm(r)
    shorter = r * min(1.0, 3.1 / length) if length > 0 else r
    np.testing.assert_allclose(to_vector(from_vector(shorter)), shorter, rtol=0, atol=1e-13)


@given(angles)
def test_passive_matrices_are_transposed_active_ones(a):
    for passive, axis in ((rx, 0), (ry, 1), (rz, 2)):
        np.testing.assert_allclose(passive(a), from_vector(a * np.eye(3)[axis]).T, rtol=0, atol=1e-14)


@given(vectors, vectors)
def test_the_skew_matrix_is_the_cross_product(v, u):
    np.testing.assert_allclose(skew(v) @ u, np.cross(v, u), rtol=0, atol=1e-11)  # of products up to 1e4


@given(transforms(), vectors)
def test_transforms_round_trip(b_from_a, x):
    np.testing.assert_allclose(b_from_a.inverse().points(b_from_a.points(x)), x, rtol=0, atol=ROUNDING)


@given(transforms("c", "b"), transforms("b", "a"), vectors)
def test_a_joined_transform_is_one_after_the_other(c_from_b, b_from_a, x):
    joined = (c_from_b @ b_from_a).points(x)
    np.testing.assert_allclose(joined, c_from_b.points(b_from_a.points(x)), rtol=0, atol=ROUNDING)


@given(transforms(), vectors, vectors)
def test_transforms_keep_distances(b_from_a, x, y):
    distance = np.linalg.norm(b_from_a.points(x) - b_from_a.points(y))
    assert abs(distance - np.linalg.norm(x - y)) <= ROUNDING


@given(angles, angles, angles)
def test_gamma_equals_the_printed_closed_form(a1, a2, a3):
    (c1, c2, c3), (s1, s2, s3) = np.cos([a1, a2, a3]), np.sin([a1, a2, a3])
    printed = [  # [PARKER04] eq. 2.5
        [c1 * c2, s1 * c2, s2],
        [-c1 * s2 * c3 + s1 * s3, -s1 * s2 * c3 - c1 * s3, c2 * c3],
        [s1 * c3 + c1 * s2 * s3, -c1 * c3 + s1 * s2 * s3, -c2 * s3],
    ]
    np.testing.assert_allclose(gamma(a1, a2, a3), printed, rtol=0, atol=1e-15)


@given(angles, angles)
def test_lambda_equals_the_printed_closed_form(b1, b2):
    (c1, c2), (s1, s2) = np.cos([b1, b2]), np.sin([b1, b2])
    printed = [[c2, 0, -s2], [s1 * s2, c1, s1 * c2], [c1 * s2, -s1, c1 * c2]]  # [PARKER04] eq. 2.11
    np.testing.assert_allclose(lambda_(b1, b2), printed, rtol=0, atol=1e-15)


@given(vectors, angles, angles, vectors)
def test_the_scan_point_has_the_mirror_offset_as_mount_coordinates(fixed, a1, a3, offset):
    g = gamma(a1, 0.01, a3)
    np.testing.assert_allclose(g @ (scan_point(fixed, g, offset) - fixed), offset, rtol=0, atol=ROUNDING)
