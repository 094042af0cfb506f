"""Matrices against exact rays, the lens maker's formula and what is known of Gaussian beams in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.optics import abcd, gaussian_beam
from catseye.optics.ray_trace import Plane, Rays, SphericalSurface

LIGHT = 0.78e-6
lengths = st.floats(0.01, 10.0)
radii = st.floats(0.05, 5.0) | st.floats(-5.0, -0.05)


@given(lengths, radii, radii, st.floats(0.001, 0.05), st.floats(1.3, 2.0), st.floats(0.0, 1.2))
def test_every_element_has_determinant_one(length, r1, r2, thickness, index, angle):
    elements = [
        abcd.free_space(length, index),
        abcd.thick_lens(r1, r2, thickness=thickness, index=index),
        abcd.mirror(r1, angle),
        abcd.mirror(r1, angle, in_plane=False),
        abcd.plate(thickness, index, angle),
        abcd.plate(thickness, index, angle, in_plane=False),
    ]
    for matrix in (*elements, abcd.through(*elements)):
        assert np.linalg.det(matrix) == pytest.approx(1.0, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("r1", "r2"), [(0.1, -0.2), (0.1, np.inf), (np.inf, -0.1), (-0.1, -0.05)])
def test_a_thick_lens_sends_rays_near_the_axis_where_exact_rays_go(r1, r2):
    n, thickness, height, slope = 1.511, 0.01, 1e-5, 2e-5
    matrix = abcd.thick_lens(r1, r2, thickness=thickness, index=n)

    def surface(vertex, radius):
        if np.isinf(radius):
            return Plane((0.0, 0.0, vertex), (0.0, 0.0, 1.0))
        return SphericalSurface((0.0, 0.0, vertex + radius), abs(radius), far=radius < 0.0)

    start = np.array([[height - 0.05 * slope, 0.0, -0.05]])
    direction = np.array([[slope, 0.0, 1.0]]) / np.hypot(slope, 1.0)
    first, last = surface(0.0, r1), surface(thickness, r2)
    rays = Rays(start, direction, np.zeros(1)).to(first, 1.0).refracted(first, 1.0 / n).to(last, n).refracted(last, n)
    out = rays.direction[0, 0] / rays.direction[0, 2]
    at_vertex = rays.position[0, 0] - out * (rays.position[0, 2] - thickness)
    # third-order terms are (height/radius)^2 = 1e-8 of the ray
    assert [at_vertex, out] == pytest.approx((matrix @ [height, slope]).tolist(), rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("incidence", [0.3, 0.9])
def test_a_tilted_plate_squeezes_the_ways_of_rays_as_exact_rays_have_it(incidence):
    n, thickness, slope = 1.5, 0.01, 1e-6
    normal = np.array([np.sin(incidence), 0.0, np.cos(incidence)])
    front, back = Plane((0.0, 0.0, 0.0), tuple(normal)), Plane(tuple(thickness * normal), tuple(normal))
    for in_plane, tilt in ((True, [slope, 0.0, 1.0]), (False, [0.0, slope, 1.0])):
        start = np.array([[0.0, 0.0, -0.1], [-0.1 * t for t in tilt]])
        direction = np.array([[0.0, 0.0, 1.0], np.array(tilt) / np.linalg.norm(tilt)])
        rays = Rays(start, direction, np.zeros(2)).to(front, 1.0).refracted(front, 1.0 / n)
        rays = rays.to(back, n).refracted(back, n).to(Plane((0.0, 0.0, 0.1), (0.0, 0.0, 1.0)), 1.0)
        chief, moved = rays.position
        on_axis = np.sum((chief - rays.position[1])[:2] ** 2) ** 0.5 / slope
        in_air = 0.1 - thickness * np.cos(incidence - np.arcsin(np.sin(incidence) / n)) / np.cos(
            np.arcsin(np.sin(incidence) / n)
        )  # what the oblique way in the plate leaves of the axis to the far plane
        found = float(abcd.plate(thickness, n, incidence, in_plane=in_plane)[0, 1])
        assert found == pytest.approx(on_axis - in_air, rel=1e-4)
        assert moved[2] == chief[2]


def test_a_hollow_mirror_at_an_angle_has_two_focal_lengths():
    assert abcd.mirror(1.0, 0.5)[1, 0] == pytest.approx(-2.0 / np.cos(0.5))
    assert abcd.mirror(1.0, 0.5, in_plane=False)[1, 0] == pytest.approx(-2.0 * np.cos(0.5))
    assert abcd.mirror()[1, 0] == 0.0


@given(st.floats(1e-5, 0.05), lengths, st.floats(1.0, 3.0))
def test_a_beam_in_free_space_has_the_radius_of_the_closed_form(waist, way, quality):
    q = abcd.onward(abcd.beam_at_waist(waist, LIGHT, quality), abcd.free_space(way))
    expected = gaussian_beam.radius(way, waist=waist, wavelength=LIGHT, quality=quality)
    assert abcd.radius(q, LIGHT, quality) == pytest.approx(float(expected), rel=1e-9)
    rayleigh = np.pi * waist**2 / LIGHT / quality
    assert 1.0 / abcd.wavefront_curvature(q) == pytest.approx(way + rayleigh**2 / way, rel=1e-6)
    assert abcd.waist_ahead(q) == pytest.approx(-way, rel=1e-9)


@given(st.floats(1e-5, 5e-3), st.floats(0.05, 3.0), st.floats(0.05, 1.0), st.floats(1.0, 2.0))
def test_the_waist_behind_a_lens_is_where_the_closed_form_has_it(waist, distance, focal, quality):
    q = abcd.onward(
        abcd.beam_at_waist(waist, LIGHT, quality), abcd.through(abcd.free_space(distance), abcd.thin_lens(focal))
    )
    rayleigh, from_focus = np.pi * waist**2 / (quality * LIGHT), distance - focal
    shrunk = focal**2 / (from_focus**2 + rayleigh**2)  # the thin-lens formula for waists, Self (1983)
    place, size = focal + from_focus * shrunk, waist * np.sqrt(shrunk)
    assert abcd.waist_ahead(q) == pytest.approx(float(place), rel=1e-6, abs=1e-9)
    at_waist = abcd.onward(q, abcd.free_space(abcd.waist_ahead(q)))
    assert abcd.radius(at_waist, LIGHT, quality) == pytest.approx(float(size), rel=1e-6)


def test_invalid_beams_and_lenses_are_refused():
    with pytest.raises(ValidityError, match="below 1, the limit of an ideal beam"):
        abcd.beam_at_waist(0.01, LIGHT, 0.9)
    with pytest.raises(ValidityError, match="focal length 0"):
        abcd.thin_lens(0.0)
    with pytest.raises(ValidityError, match="not above 0"):
        abcd.beam_at_waist(-0.01, LIGHT)
