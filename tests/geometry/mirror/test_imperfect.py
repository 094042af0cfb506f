"""Real mirrors' beams: traced rays, the path formula of `mirror_path`, and there and back."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.geometry.mirror.imperfect import (
    Imperfections,
    imperfect_back_counts,
    imperfect_counts,
    imperfect_face_counts,
    imperfect_ray,
)
from catseye.geometry.mirror.mirror_path import beam_angles
from catseye.geometry.mirror.pointing import MirrorStation, counts, in_mirror_axes, ray

NONE = Imperfections(np.zeros(4), np.zeros(3), np.zeros((2, 0)), np.zeros((2, 0)))
ALL = Imperfections(
    np.array([3e-4, -2e-4, 5e-4, 1e-4]),
    np.array([4e-4, -3e-4, 6e-4]),
    np.array([[3.0, -1.0], [2.0, 0.5]]),
    np.array([[-2.0, 0.7], [1.5, 0.2]]),
)
STATION = MirrorStation([5.0, 20.0, 0.0], [1.0, 1e-4, -2e-4], [1e-4, 0.25, -3e-4], [7e-4, -2e-4], [-4195, -4935])


def points(n, seed=0):
    """All around, but not within 0.1 rad of the azimuth axis."""
    at = np.random.default_rng(seed).uniform(-80, 80, (n, 3))
    mirror = in_mirror_axes(STATION, at)
    return at[np.hypot(mirror[:, 0], mirror[:, 1]) > 0.1 * np.linalg.norm(mirror, axis=1)]


def test_a_perfect_mirror_is_the_six_transformations():
    at = points(500)
    np.testing.assert_allclose(imperfect_counts(STATION, NONE, at), counts(STATION, at), rtol=0, atol=1e-9)
    found, plain = imperfect_ray(STATION, NONE, counts(STATION, at)), ray(STATION, counts(STATION, at))
    np.testing.assert_allclose(found.direction, plain.direction, rtol=0, atol=1e-14)
    assert not NONE.matter
    assert ALL.matter


@pytest.mark.parametrize("prime", [False, True])
def test_the_beam_meets_the_target(prime):
    at = points(2000)
    n = imperfect_counts(STATION, ALL, at, prime=prime)
    assert np.isfinite(n).all()
    origin, direction = imperfect_ray(STATION, ALL, n)
    aside = np.linalg.norm(np.cross(direction, at - origin), axis=1)
    assert aside.max() < 1e-11  # m
    assert np.einsum("ij,ij->i", direction, at - origin).min() > 0


def test_offsets_alone_turn_the_beam_as_the_path_formula_says():
    """`mirror_path.beam_angles` was derived another way: the beam's displacement across, not a traced ray."""
    axes = Imperfections(np.array([3e-3, -2e-3, 5e-3, 1e-3]), np.zeros(3), np.zeros((2, 0)), np.zeros((2, 0)))
    at = points(300, seed=1)
    for prime in (False, True):
        theta, phi = beam_angles(in_mirror_axes(STATION, at), axes.axes, prime=prime)
        direction = imperfect_ray(STATION, axes, imperfect_counts(STATION, axes, at, prime=prime)).direction
        u = np.einsum("ij,nj->ni", STATION.mirror_from_ground, direction)
        expected = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], axis=1)
        np.testing.assert_allclose(u, expected, rtol=0, atol=1e-13)


def test_a_tilted_laser_beam_turns_the_beam_as_its_image_in_the_face_does():
    """Straight ahead (Phi = 0) the beam comes back: leaning in by t it leaves leaning the other way."""
    tilted = Imperfections(np.zeros(4), np.array([0.0, 2e-3, 0.0]), np.zeros((2, 0)), np.zeros((2, 0)))
    flat = MirrorStation(np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(2))
    u = flat.mirror_from_ground @ imperfect_ray(flat, tilted, [0.0, 0.0]).direction
    np.testing.assert_allclose(u, [-2e-3, 0.0, np.sqrt(1 - 4e-6)], rtol=0, atol=1e-15)


def test_a_tilted_face_sends_the_beam_aside_by_twice_its_tilt_towards_the_axis():
    tilted = Imperfections(np.zeros(4), np.array([1e-3, 0.0, 0.0]), np.zeros((2, 0)), np.zeros((2, 0)))
    flat = MirrorStation(np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(2))
    u = flat.mirror_from_ground @ imperfect_ray(flat, tilted, [0.0, 0.0]).direction
    np.testing.assert_allclose(u, [0.0, np.sin(2e-3), np.cos(2e-3)], rtol=0, atol=1e-15)
    # in the prime setting the face leans the other way: half the difference of the two tells the tilt
    prime = flat.mirror_from_ground @ imperfect_ray(flat, tilted, [50_000.0, 0.0]).direction
    np.testing.assert_allclose(prime, [0.0, -np.sin(2e-3), np.cos(2e-3)], rtol=0, atol=1e-15)


def test_encoder_errors_are_read_where_the_axis_stands():
    waves = Imperfections(np.zeros(4), np.zeros(3), np.array([[3.0], [0.0]]), np.array([[0.0], [5.0]]))
    flat = MirrorStation(np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(2))
    east = np.array([100.0, 0.0, 0.0])  # Theta = 0, Phi = 90 deg: the mirror itself has turned by 45
    assert imperfect_counts(flat, waves, east) == pytest.approx([3.0, 12_500.0 + 5.0 * np.sin(np.pi / 4)], abs=1e-9)
    assert imperfect_counts(flat, waves, east, prime=True) == pytest.approx(
        [50_000.0 - 3.0, -12_500.0 - 5.0 * np.sin(np.pi / 4)], abs=1e-9
    )


def test_the_face_looks_at_the_target_in_autocollimation():
    at = points(400, seed=2)
    n = imperfect_face_counts(STATION, ALL, at)
    assert np.isfinite(n).all()
    straight = Imperfections(np.zeros(4), np.array([ALL.tilts[0], 0.0, 0.0]), ALL.azimuth_waves, ALL.elevation_waves)
    u = imperfect_ray(STATION, straight, n).direction
    incoming = STATION.mirror_from_ground.T @ [0.0, 0.0, 1.0]
    normal = (u + incoming) / np.linalg.norm(u + incoming, axis=1, keepdims=True)  # bisects the beam, in and out
    sight = (at - STATION.scan_point) / np.linalg.norm(at - STATION.scan_point, axis=1, keepdims=True)
    side = np.sign(np.einsum("ij,ij->i", normal, sight))
    np.testing.assert_allclose(side[:, None] * normal, sight, rtol=0, atol=1e-7)


def test_a_perfect_face_looks_where_eq_2_23_says_and_its_back_where_2_24_does():
    at = points(50, seed=3)
    direct, face = counts(STATION, at), imperfect_face_counts(STATION, NONE, at)
    np.testing.assert_allclose(face[:, 0], direct[:, 0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(face[:, 1], 2 * direct[:, 1] + 4935, rtol=0, atol=1e-8)
    np.testing.assert_allclose(imperfect_back_counts(STATION, NONE, face), face[:, 1] + 50_000, rtol=0, atol=1e-8)


def test_a_target_that_the_beam_cannot_meet_has_no_counts():
    tilted = Imperfections(np.zeros(4), np.array([5e-3, 0.0, 0.0]), np.zeros((2, 0)), np.zeros((2, 0)))
    ahead = STATION.scan_point + 50.0 * (STATION.mirror_from_ground.T @ [0.0, 0.0, 1.0])
    assert np.isnan(imperfect_counts(STATION, tilted, ahead)).all()  # the face sends it to a cone of 10 mrad
    assert np.isnan(imperfect_face_counts(STATION, tilted, ahead)).all()


def test_imperfections_without_meaning_are_refused():
    with pytest.raises(ValidityError, match=r"axes of a mirror have shape \(3,\), expected \(4,\)"):
        Imperfections(np.zeros(3), np.zeros(3), np.zeros((2, 0)), np.zeros((2, 0)))
    with pytest.raises(ValidityError, match=r"rad of a mirror are not below 0\.1"):
        Imperfections(np.zeros(4), np.array([0.5, 0, 0]), np.zeros((2, 0)), np.zeros((2, 0)))
    with pytest.raises(ValidityError, match=r"counts have shape \(3,\)"):
        imperfect_ray(STATION, NONE, np.zeros(3))
