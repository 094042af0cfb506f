"""Closed forms of the retroreflectors against rays traced through their real shapes; the tracer against others.

The tracer knows Snell's law in vectors, planes and spheres, nothing else. It is itself checked against optiland 0.6.3
(frozen numbers), a plate by hand, and a whole ball of index 2.
"""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.optics.ray_trace import Plane, Rays, SphericalSurface, beam, corner, half_path, through_prism
from catseye.optics.retroreflector import prism
from catseye.optics.retroreflector.cats_eye import BallCatsEye
from catseye.optics.retroreflector.dihedral import ORDERS, deviations

H, GROUP, PHASE = 0.0381, 1.527077, 1.510811
R1, R2 = 1.969 * 0.0254, 3.799 * 0.0254
NANOMETRE = 1e-9
UP = np.array([0.0, 0.0, 1.0])


def towards(incidence, azimuth):
    return np.array([np.sin(incidence) * np.cos(azimuth), np.sin(incidence) * np.sin(azimuth), np.cos(incidence)])


def about_the_pole_ray(incidence, azimuth, height, phase, around):
    """Points on the face about the one whose ray meets the corner: their rays meet all three faces."""
    inside = np.arcsin(np.sin(incidence) / phase)
    aside = height * np.tan(inside) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    return aside + np.pad(around, ((0, 0), (0, 1)))


def traced_prism(incidence, azimuth, point, *, phase=PHASE, group=GROUP, turn=0.3):
    u = towards(incidence, azimuth)
    around = np.random.default_rng(7).uniform(-0.004, 0.004, (12, 2))
    rays = beam(u, about_the_pole_ray(incidence, azimuth, H, phase, around))
    out = through_prism(rays, height=H, phase=phase, group=group, azimuth=turn)
    np.testing.assert_allclose(out.direction, np.broadcast_to(u, out.direction.shape), rtol=0, atol=1e-12)
    return half_path(out, u, point)


@pytest.mark.parametrize("degrees", [0.0, 1.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0])
@pytest.mark.parametrize("azimuth", np.arange(0.0, 2 * np.pi, 0.37))
def test_the_two_index_prism_is_the_traced_one_at_every_angle_and_azimuth(degrees, azimuth):
    incidence, depth = np.radians(degrees), float(prism.reference_depth(H, GROUP))
    found = traced_prism(incidence, azimuth, (0.0, 0.0, -depth))
    change = float(prism.oblique_change(H, incidence, group=GROUP, phase=PHASE))
    expected = -(float(prism.range_constant(H, GROUP)) + change)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3 * NANOMETRE)
    of_pole = traced_prism(incidence, azimuth, (0.0, 0.0, 0.0))
    sine = np.sin(incidence)
    path = H * (GROUP * PHASE - sine**2) / np.sqrt(PHASE**2 - sine**2)
    np.testing.assert_allclose(of_pole, path, rtol=0, atol=1e-3 * NANOMETRE)


def test_appendix_b_differs_by_0_43_micrometres_at_30_degrees_in_a_38_1_mm_prism():
    incidence = np.radians(30.0)
    found = traced_prism(incidence, 0.7, (0.0, 0.0, -H / GROUP))
    by_b1 = -float(prism.range_constant(H, GROUP) + prism.obliquity_correction(H, GROUP, np.cos(incidence)))
    np.testing.assert_allclose((found - by_b1) * 1e6, 0.43, rtol=0, atol=0.005)
    # and with one index for both it is exact
    again = traced_prism(incidence, 0.7, (0.0, 0.0, -H / GROUP), phase=GROUP)
    np.testing.assert_allclose(again, by_b1, rtol=0, atol=1e-3 * NANOMETRE)


def test_the_point_about_which_the_traced_range_is_flat_is_the_flat_depth():
    """The range of the pole, traced at small angles, falls as depth x sin^2 / 2: its depth by least squares."""
    angles = np.radians(np.linspace(0.2, 2.0, 10))
    of_pole = np.array([np.mean(traced_prism(i, 0.4, (0.0, 0.0, 0.0))) for i in angles])
    basis = np.stack([np.ones_like(angles), -(1 - np.cos(angles)), (1 - np.cos(angles)) ** 2], axis=-1)
    _, fitted, _ = np.linalg.lstsq(basis, of_pole, rcond=None)[0]
    depth = float(prism.flat_depth(H, group=GROUP, phase=PHASE))
    assert fitted == pytest.approx(depth, abs=2e-8)  # rounding over (1 - cos): some 1e-16 / 1e-8
    assert (H / GROUP - fitted) * 1e6 == pytest.approx(2.89, abs=0.03)  # 3.9 of the memo lies deeper
    # the wave of the light itself seems to come from another point still: the carrier's, height / n_p
    carrier = np.array([np.mean(traced_prism(i, 0.4, (0.0, 0.0, 0.0), group=PHASE)) for i in angles])
    assert np.linalg.lstsq(basis, carrier, rcond=None)[0][1] == pytest.approx(H / PHASE, abs=2e-8)


@pytest.mark.parametrize("degrees", [0.0, 15.0, 30.0])
@pytest.mark.parametrize("phase", [1.0, PHASE])
def test_light_through_the_face_twice_is_the_clear_share(degrees, phase):
    aperture, n = 0.0254, 40_000
    rng = np.random.default_rng(3)
    u = towards(np.radians(degrees), 1.1)
    points = np.pad(rng.uniform(-aperture, aperture, (n, 2)), ((0, 0), (0, 1)))
    points = points[np.hypot(points[:, 0], points[:, 1]) < aperture]
    out = through_prism(beam(u, points), height=H, phase=phase, group=phase)
    passed = np.hypot(out.position[:, 0], out.position[:, 1]) < aperture
    passed &= np.abs(np.sum(out.direction * u, axis=-1) - 1.0) < 1e-9  # NaN and all that met a face fewer drop out
    share = float(prism.clear_share(np.radians(degrees), aperture=aperture, height=H, index=phase))
    scatter = np.sqrt(share / len(points))
    assert np.mean(passed) * np.cos(np.radians(degrees)) == pytest.approx(share, abs=4 * scatter)


def through_ball(rays: Rays, *, r1: float, r2: float, phase: float, group: float) -> Rays:
    """Trace a cat's-eye about the origin: in by r1, back from r2, out by r1.

    r1, r2         m
    phase, group   index of the glass over that of the air
    """
    small, mirror = SphericalSurface((0.0, 0.0, 0.0), r1), SphericalSurface((0.0, 0.0, 0.0), r2, far=True)
    inside = rays.to(small, 1.0).refracted(small, 1.0 / phase).to(mirror, group).reflected(mirror)
    out = SphericalSurface((0.0, 0.0, 0.0), r1, far=True)
    return inside.to(out, group).refracted(out, phase)


def test_the_ball_on_its_axis_has_the_constant_of_the_memo():
    out = through_ball(beam(UP, np.zeros((1, 3))), r1=R1, r2=R2, phase=PHASE, group=GROUP)
    assert half_path(out, UP, (0, 0, 0))[0] == pytest.approx(GROUP * (R1 + R2) - R1, abs=1e-3 * NANOMETRE)
    assert -half_path(out, UP, (0, 0, 0))[0] * 1e3 == pytest.approx(-173.715, abs=5.1e-4)


@pytest.mark.parametrize("incidence", [0.0, 0.6, 1.2])
def test_ball_rays_off_the_axis_are_the_closed_form_from_everywhere(incidence):
    ball = BallCatsEye(r1=R1, r2=R2, aperture=0.02, group=GROUP, phase=PHASE)
    u = towards(incidence, 2.0)
    across = np.cross(u, [0.3, -0.5, 0.8])
    across /= np.linalg.norm(across)
    y = np.linspace(0.0, 0.02, 21)
    out = through_ball(beam(u, y[:, None] * across), r1=R1, r2=R2, phase=PHASE, group=GROUP)
    path = half_path(out, u, (0, 0, 0))
    np.testing.assert_allclose(-path - ball.range_constant, ball.path_change(y), rtol=0, atol=1e-3 * NANOMETRE)
    # the ray comes back on the other side: converging is towards +across there
    np.testing.assert_allclose(out.direction @ across, np.sin(ball.deviation(y)), rtol=0, atol=1e-12)


# optiland 0.6.3: the memo's radii in mm, one index 1.510811 for bending and path, from the plane z = -100 mm before the
# ball and back to it: height in, height out, direction cosine out, optical path
OPTILAND = [
    (0.0, 0.0, 0.0, 642.689378678400),
    (3.0, -3.081899834391, -0.000545949974, 642.690256194976),
    (7.0, -7.115123356196, -0.000767410611, 642.693196417034),
    (10.0, -10.023051656610, -0.000153664014, 642.694752598616),
    (14.0, -13.646142236751, 0.002359106744, 642.691527349429),
]


@pytest.mark.parametrize(("height_mm", "back_mm", "cosine", "path_mm"), OPTILAND)
def test_the_tracer_is_optilands(height_mm, back_mm, cosine, path_mm):
    start = R1 + 0.1
    rays = beam(UP, [[height_mm * 1e-3, 0.0, 0.0]], start)
    out = through_ball(rays, r1=R1, r2=R2, phase=PHASE, group=PHASE)
    out = out.to(Plane((0.0, 0.0, start), (0.0, 0.0, 1.0)), 1.0)
    assert out.position[0, 0] * 1e3 == pytest.approx(back_mm, abs=1e-10)
    assert out.direction[0, 0] == pytest.approx(cosine, abs=1e-12)
    assert out.path[0] * 1e3 == pytest.approx(path_mm, abs=1e-10)


def test_a_plate_delays_and_shifts_as_by_hand():
    """Plate of thickness t at incidence i: aside by t sin(i - r)/cos r, glass path t/cos r."""
    t, i = 0.01, 0.7
    front, back = Plane((0, 0, 0), (0, 0, 1)), Plane((0, 0, -t), (0, 0, 1))
    rays = beam(towards(i, 0.0), np.zeros((1, 3)))
    out = rays.to(front, 1.0).refracted(front, 1 / 1.5).to(back, 1.6).refracted(back, 1.5)
    r = np.arcsin(np.sin(i) / 1.5)
    np.testing.assert_allclose(out.direction, rays.direction, atol=1e-15)
    assert out.path[0] == pytest.approx(1.0 + 1.6 * t / np.cos(r), abs=1e-15)
    aside = np.linalg.norm(np.cross(out.position[0], towards(i, 0.0)))
    assert aside == pytest.approx(t * np.sin(i - r) / np.cos(r), abs=1e-15)


def test_a_whole_ball_of_index_2_sends_back_along_2_theta_minus_4_r():
    y = np.array([0.0, 0.1, 0.4])
    out = through_ball(beam(UP, np.pad(y[:, None], ((0, 0), (0, 2))), 2.0), r1=1.0, r2=1.0, phase=2.0, group=2.0)
    expected = 2 * np.arcsin(y) - 4 * np.arcsin(y / 2)
    np.testing.assert_allclose(np.arcsin(out.direction[:, 0]), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("errors", [(1e-5, -2e-5, 0.7e-5), (1e-5, 1e-5, 1e-5), (0.0, 0.0, -3e-5)])
@pytest.mark.parametrize("index", [1.0, PHASE])
def test_wrong_angles_send_six_beams_where_the_closed_form_says(errors, index):
    found = deviations(errors, index)
    around = np.arange(3) * 2 * np.pi / 3
    edges = np.stack([np.cos(around), np.sin(around)], axis=-1)
    for (i, _, k), deviation in zip(ORDERS, found, strict=True):
        entry = np.append(0.005 * (edges[k] - edges[i]), 0.0)  # the sector that meets face i first, face k last
        out = through_prism(beam(UP, entry), height=H, phase=index, group=index, errors=errors)
        np.testing.assert_allclose(out.direction[0, :2], deviation, rtol=0, atol=5e-9)  # errors squared, some 1e-9
        # seen from the corner's image the range is the perfect one's
        point = (0.0, 0.0, -H / index)
        assert half_path(out, UP, point)[0] == pytest.approx(H * (index - 1 / index), abs=NANOMETRE)


def test_the_faces_stand_at_the_angles_asked_for():
    normals = np.array([face.normal for face in corner((0, 0, 0), 0.2, (1e-3, -2e-3, 0.5e-3))])
    dihedral = np.pi - np.arccos(np.einsum("ij,ij->i", normals[[1, 2, 0]], normals[[2, 0, 1]]))
    np.testing.assert_allclose(dihedral - np.pi / 2, (1e-3, -2e-3, 0.5e-3), rtol=0, atol=1e-12)
    turned = np.hypot(*deviations((1e-6, 1e-6, 1e-6), 1.5).T)
    assert turned == pytest.approx([3.266 * 1.5e-6] * 6, rel=2e-4)  # Yoder's number for equal errors, in glass


def test_a_ray_that_misses_or_cannot_leave_is_nan_and_spoils_no_other():
    out = through_ball(beam(UP, [[0.0, 0, 0], [2 * R1, 0, 0]]), r1=R1, r2=R2, phase=PHASE, group=GROUP)
    assert np.isnan(out.path).tolist() == [False, True]
    face = Plane((0, 0, 0), (0, 0, 1))
    steep = Rays(np.zeros((2, 3)), np.array([[0, 0, 1.0], [np.sin(1.0), 0, np.cos(1.0)]]), np.zeros(2))
    assert np.isnan(steep.refracted(face, 1.5).direction[:, 2]).tolist() == [False, True]
    behind = SphericalSurface((0, 0, -1), 0.5).distance(np.zeros((1, 3)), np.array([[0, 0, 1.0]]))
    assert np.isnan(behind).all()


def test_invalid_directions_are_refused():
    with pytest.raises(ValidityError, match="direction to the ranger has the length 2"):
        beam([0.0, 0.0, 2.0], np.zeros(3))
    with pytest.raises(ValidityError, match="dihedral errors"):
        deviations([0.1, 0.0, 0.0])
