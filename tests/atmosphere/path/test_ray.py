"""Rays in air against exact solutions: parabola, catenary, circle, the sphere's invariant, and a second integrator."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from catseye.atmosphere.path import bending
from catseye.atmosphere.path.ray import FOUND, OVER, RayAir, bent_ray, layered
from catseye.atmosphere.sound.velocity import (
    EARTH_RADIUS,
    arc_to_chord_correction,
    first_velocity_correction,
    second_velocity_correction,
)
from catseye.errors import ValidityError
from draws import examples

N0 = 1.00025
FROM_CENTRE = np.array([0.0, 0.0, EARTH_RADIUS])  # of the origin, from the Earth's centre


def along_x(air, d, z=0.0):
    return bent_ray(air, (0.0, 0.0, z), (d, 0.0, z))


@pytest.mark.parametrize("g", [8e-7, -8e-7, 1e-4])
def test_air_whose_squared_index_is_a_line_bends_the_ray_to_a_parabola(g):
    """r'' = grad n²/2 in the time t with ds = n dt: z = g t (t - T)/2, exact; optical path n0² T - g² T³/6."""
    d = 120.0
    air = layered(lambda z: (np.sqrt(N0**2 + 2 * g * z) - 1.0, g / np.sqrt(N0**2 + 2 * g * z)))
    found = along_x(air, d)
    with mp.workdps(40):
        n0, gm, dm = mpf(N0), mpf(g), mpf(d)
        v2 = (n0**2 + mp.sqrt(n0**4 - gm**2 * dm**2)) / 2  # vx², from vx² + (g T/2)² = n0², T = d/vx
        t, rise = dm / mp.sqrt(v2), gm * dm / (2 * mp.sqrt(v2))
        length = mp.quad(lambda s: mp.sqrt(v2 + (gm * s - rise) ** 2), [0, t])
        # on the chord n is n0; the ray starts downwards where n grows upwards
        assert found.length_excess[0] == pytest.approx(float(length - dm), abs=1e-12)
        assert found.optical_excess[0] == pytest.approx(float(n0**2 * t - gm**2 * t**3 / 6 - n0 * dm), abs=1e-12)
        assert found.leaving[0, 2] == pytest.approx(float(-mp.atan(rise / mp.sqrt(v2))), abs=1e-13)
        assert found.arriving[0, 2] == pytest.approx(float(mp.atan(rise / mp.sqrt(v2))), abs=1e-13)
        assert found.sag[0, 2] == pytest.approx(float(-gm * t**2 / 8), abs=1e-12)


def test_a_slanted_parabola_is_exact_too():
    """The index changes along this chord as well: r = a + v t + g t²/2 with |v| = n at a, T from a quadratic in T²."""
    g, d = 1e-4, np.array([100.0, 0.0, 60.0])
    air = layered(lambda z: (np.sqrt(N0**2 + 2 * g * z) - 1.0, g / np.sqrt(N0**2 + 2 * g * z)))
    found = bent_ray(air, np.zeros(3), d)
    with mp.workdps(40):
        square, gm = sum(mpf(c) ** 2 for c in d), mpf(g)
        b = mpf(N0) ** 2 + gm * mpf(d[2])
        t2 = 2 * square / (b + mp.sqrt(b**2 - gm**2 * square))
        t = mp.sqrt(t2)
        vx, vz = mpf(d[0]) / t, mpf(d[2]) / t - gm * t / 2
        length = mp.quad(lambda s: mp.sqrt(vx**2 + (vz + gm * s) ** 2), [0, t])
        turned = [float(mp.atan2(z, vx) - mp.atan2(mpf(d[2]), mpf(d[0]))) for z in (vz, vz + gm * t)]
        optical = mp.quad(lambda s: vx**2 + (vz + gm * s) ** 2, [0, t])
        along = mp.sqrt(square) * mp.quad(lambda s: mp.sqrt(mpf(N0) ** 2 + 2 * gm * s * mpf(d[2])), [0, 1])
        assert found.length_excess[0] == pytest.approx(float(length - mp.sqrt(square)), abs=1e-11)
        assert found.optical_excess[0] == pytest.approx(float(optical - along), abs=1e-11)
    up = np.array([-60.0, 0.0, 100.0]) / np.hypot(60.0, 100.0)
    assert found.leaving[0] @ up == pytest.approx(turned[0], abs=1e-12)
    assert found.arriving[0] @ up == pytest.approx(turned[1], abs=1e-12)


def test_air_whose_index_is_a_line_bends_the_ray_to_a_catenary():
    """z + n0/g = (c/g) cosh(g (x - d/2)/c) with c = n cos(elevation): the invariant of level layers."""
    g, d = 2e-5, 300.0
    c = brentq(lambda q: q * np.cosh(g * d / 2 / q) - N0, 0.9 * N0, N0, xtol=1e-15)
    found = along_x(layered(lambda z: (N0 - 1.0 + g * z, g + 0.0 * z)), d)
    assert found.leaving[0, 2] == pytest.approx(-np.arcsin(np.tanh(g * d / 2 / c)), abs=1e-11)
    assert found.sag[0, 2] == pytest.approx((c - N0) / g, abs=1e-9)  # the rounding of 1/g times n


def test_air_whose_index_falls_as_one_over_height_bends_the_ray_to_a_circle():
    z0, d = 1e5, 500.0
    found = along_x(layered(lambda z: (N0 * z0 / z - 1.0, -N0 * z0 / z**2)), d, z0)
    radius = np.hypot(z0, d / 2)
    with mp.workdps(30):
        arc = 2 * mpf(radius) * mp.asin(mpf(d) / 2 / mpf(radius))
        assert found.length_excess[0] == pytest.approx(float(arc - mpf(d)), rel=1e-8)
    assert found.sag[0, 2] == pytest.approx(radius - z0, rel=1e-9)
    assert found.leaving[0, 2] == pytest.approx(np.arctan2(d / 2, z0), rel=1e-10)


def sphere(k):
    """Air in shells about the Earth's centre at z = -R, with the coefficient of refraction k at z = 0."""
    centre, slope = np.array([0.0, 0.0, -EARTH_RADIUS]), -N0 * k / EARTH_RADIUS

    def air(points):
        from_centre = points - centre
        r = np.linalg.norm(from_centre, axis=-1)
        return RayAir(N0 - 1.0 + slope * (r - EARTH_RADIUS), slope * from_centre / r[..., None])

    return air


def test_in_shells_n_r_cos_elevation_is_the_same_at_both_ends():
    a, b = np.array([0.0, 0.0, 0.0]), np.array([3000.0, 400.0, 900.0])
    k = 0.25
    found = bent_ray(sphere(k), a, b)
    assert found.status[0] == FOUND
    chord = (b - a) / np.linalg.norm(b - a)
    invariants = []
    for end, bend in ((a, found.leaving[0]), (b, found.arriving[0])):
        size = np.linalg.norm(bend)
        direction = np.cos(size) * chord + np.sin(size) * bend / size
        r = end + FROM_CENTRE
        n = N0 - N0 * k / EARTH_RADIUS * (np.linalg.norm(r) - EARTH_RADIUS)
        invariants.append(n * np.linalg.norm(np.cross(r, direction)))
    straight = [
        (N0 - N0 * k / EARTH_RADIUS * (np.linalg.norm(r) - EARTH_RADIUS)) * np.linalg.norm(np.cross(r, chord))
        for r in (a + FROM_CENTRE, b + FROM_CENTRE)
    ]
    assert abs(straight[1] - straight[0]) > 50.0  # of 6 370 000: unbent it is not the same
    assert invariants[1] == pytest.approx(invariants[0], abs=1e-5)


@pytest.mark.parametrize("k", [0.13, 0.5, -1.0])
def test_the_velocity_corrections_turn_the_ray_length_into_the_chord(k):
    """`atmosphere.sound.velocity`, index of the ends: its second correction and its arc to chord, against this ray."""
    d = 20_000.0
    drop = EARTH_RADIUS - np.sqrt(EARTH_RADIUS**2 - d**2 / 4)  # ends on one level surface, the chord's middle below it
    ends = np.array([[-d / 2, 0.0, -drop], [d / 2, 0.0, -drop]])
    found = bent_ray(sphere(k), *ends)
    x = np.linspace(-d / 2, d / 2, 20_001)
    line = np.stack([x, 0 * x, np.full(x.shape, -drop)], axis=1)
    on_chord = np.trapezoid(sphere(k)(line).refractivity, x)
    optical = d + on_chord + float(found.optical_excess[0])
    shown = optical / 1.0003
    length = shown + first_velocity_correction(shown, 1.0003, N0) + second_velocity_correction(d, refraction=k)
    # the trapezoid is good to 1e-11 of 20 km; 1 % is the next term of the series
    second = abs(float(second_velocity_correction(d, refraction=k)))
    assert length - d == pytest.approx(float(found.length_excess[0]), abs=0.01 * second)
    assert arc_to_chord_correction(d, refraction=k) == pytest.approx(-float(found.length_excess[0]), rel=1e-3)
    assert arc_to_chord_correction(d, refraction=k) == pytest.approx(-((k / EARTH_RADIUS) ** 2) * d**3 / 24)


def hot_ground(z):
    """1/z gradient of 0.8 K a factor e: a summer noon; index slope and index less one."""
    return 250e-6 + 0.7e-6 * np.log(z), 0.7e-6 / z


def test_over_hot_ground_a_second_integrator_finds_the_same_ray():
    d, a, b = 120.0, np.array([0.0, 0.0, 1.5]), np.array([120.0, 0.0, 4.0])
    found = bent_ray(layered(hot_ground), a, b)

    def rates(s, state):
        _, z, px, pz, _ = state
        refractivity, slope = hot_ground(z)
        n = 1.0 + refractivity
        return [px / n, pz / n, 0.0, slope, n]

    def shot(angle):
        n = 1.0 + hot_ground(a[2])[0]
        event = lambda s, y: y[0] - d  # noqa: E731
        event.terminal = True
        start = [0.0, a[2], n * np.cos(angle), n * np.sin(angle), 0.0]
        end = solve_ivp(rates, (0, 130), start, events=event, rtol=1e-13, atol=1e-13)
        return end.y[1, -1] - b[2], end.t[-1], end.y[4, -1]

    straight = np.arctan2(2.5, d)
    angle = brentq(lambda q: shot(q)[0], straight - 1e-3, straight + 1e-3, xtol=1e-15)
    _, length, optical = shot(angle)
    chord = np.hypot(d, 2.5)
    bend = found.leaving[0] @ np.array([-2.5, 0, d]) / chord
    assert bend == pytest.approx(angle - straight, abs=1e-11)
    assert found.length_excess[0] == pytest.approx(length - chord, abs=1e-11)  # its rounding over 120 m
    nodes, weight = np.polynomial.legendre.leggauss(60)
    on_chord = chord * (1.0 + 0.5 * weight @ hot_ground(2.75 + 1.25 * nodes)[0])
    assert found.optical_excess[0] == pytest.approx(optical - on_chord, abs=1e-11)
    assert found.optical_excess[0] < 0.0 < found.length_excess[0]


def waves(seed):
    """Smooth random air: ten waves, and the largest gradient that they can have."""
    rng = np.random.default_rng(seed)
    k = rng.normal(0, 1, (10, 3)) * rng.choice([0.01, 0.05, 0.2], (10, 1))
    amplitude, phase = rng.normal(0, 3e-6, 10), rng.uniform(0, 2 * np.pi, 10)
    amplitude /= np.maximum(1.0, np.linalg.norm(k, axis=1) / 0.02) ** 2
    largest = float(np.sum(np.abs(amplitude) * np.linalg.norm(k, axis=1)))

    def air(points):
        angle = points @ k.T + phase
        return RayAir(2.6e-4 + np.sin(angle) @ amplitude, (np.cos(angle) * amplitude) @ k)

    return air, largest


@examples(12)
@given(st.integers(0, 10_000), st.floats(20.0, 200.0))
def test_no_air_bends_the_optical_path_beyond_the_bound_nor_above_the_chords(seed, d):
    air, largest = waves(seed)
    rng = np.random.default_rng(seed)
    ways = rng.normal(0, 1, (4, 3))
    found = bent_ray(air, np.zeros((4, 3)), d * ways / np.linalg.norm(ways, axis=1, keepdims=True))
    assert np.all(found.status == FOUND)
    assert np.all(found.optical_excess <= 1e-13)
    assert np.all(found.optical_excess >= -bending.excess_bound(largest, d) - 1e-13)
    most = largest**2 * d**3 / 24  # where the curvature is nowhere larger
    assert np.all((found.length_excess >= 0) & (found.length_excess <= most * (1 + 1e-6)))
    assert np.all(np.linalg.norm(found.leaving, axis=1) <= bending.pointing_offset(largest, d) * (1 + 1e-6))


@examples(6)
@given(st.integers(0, 10_000))
def test_a_ray_is_reversible_and_independent_of_azimuth(seed):
    air, _ = waves(seed)
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-50, 50, (2, 3, 3))
    there, back = bent_ray(air, a, b), bent_ray(air, b, a)
    np.testing.assert_allclose(there.length_excess, back.length_excess, atol=2e-12)
    np.testing.assert_allclose(there.optical_excess, back.optical_excess, atol=2e-12)
    np.testing.assert_allclose(there.leaving, -back.arriving, atol=1e-12)
    np.testing.assert_allclose(there.sag, back.sag, atol=1e-11)
    turn = np.linalg.qr(rng.normal(0, 1, (3, 3)))[0]

    def turned(points):
        value, gradient, _ = air(points @ turn)
        return RayAir(value, gradient @ turn.T)

    other = bent_ray(turned, a @ turn.T, b @ turn.T)
    np.testing.assert_allclose(other.optical_excess, there.optical_excess, atol=2e-12)
    np.testing.assert_allclose(other.leaving, there.leaving @ turn.T, atol=1e-12)


def test_the_modulation_counts_the_lights_ray_in_its_own_index():
    g, d, share = -1e-6, 120.0, 1.02
    found = along_x(layered(lambda z: (2.5e-4 + g * z, g + 0 * z), lambda z: 2.6e-4 + share * g * z), d)
    expected = bending.curvature(g, index=1.00025) ** 2 * d**3 / 24 * (1.0 - 2.0 * share)
    assert found.optical_excess[0] == pytest.approx(float(expected), rel=4e-4)  # n and n_g beside 1
    assert abs(found.optical_excess[0]) < float(bending.excess_bound(g, d)) * 1.04


def test_a_path_over_a_mirage_is_a_status_and_spoils_no_other():
    air = layered(lambda z: (2.6e-4 - 2e-5 * np.exp(-z / 0.05), 4e-4 * np.exp(-z / 0.05)))
    a = np.array([[0.0, 0.0, 0.05], [0.0, 0.0, 40.0]])
    found = bent_ray(air, a, a + np.array([2000.0, 0.0, 0.0]))
    assert found.status[0] == OVER
    assert np.isnan(found.optical_excess[0])
    assert found.status[1] == FOUND
    assert found.optical_excess[1] == pytest.approx(0.0, abs=1e-15)


def test_a_path_of_no_length_is_refused():
    with pytest.raises(ValidityError, match=r"path 1 from .* has zero length"):
        bent_ray(layered(hot_ground), np.ones((2, 3)), np.array([[2.0, 1, 1], [1, 1, 1]]))
