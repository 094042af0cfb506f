"""Polarization: Fresnel's numbers by hand, the six ways round a corner by another derivation, published corners."""

import mpmath
import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.optics.coating import Coating, index, response
from catseye.optics.polarization import (
    ellipse,
    linear,
    reflection,
    reflection_matrix,
    retardance,
    retarder,
    surface,
    total_reflection_retardance,
)
from catseye.optics.retroreflector.corner_polarization import (
    EDGES,
    ORDERS,
    REVERSED,
    far_field_jones,
    hollow_corner,
    returned_power,
    sector_jones,
    sector_shares,
    solid_corner,
    through_plate,
)
from catseye.optics.retroreflector.interface import fresnel

GOLD = 0.15 + 4.7j  # near 780 nm; any metal serves these tests
PERFECT = complex("inf")
SQUARE = {"atol": 1e-13, "rtol": 0.0}  # some ten roundings of matrices of size 1


def printed_phases(cosine, n):
    """[BORN99] eq. 60: phases of r_s and r_p, glass of index n to air, by tan(d/2) alone."""
    root = np.sqrt(1 - cosine**2 - n**-2)
    return -2 * np.arctan(root / cosine), -2 * np.arctan(root * n**2 / cosine)


def by_rotations(n, order_sign):
    """A corner straight on as [PECK62] and [PLAYER88] build it: retarders in their own axes and turns by 60 degrees."""
    with mpmath.workdps(40):
        c, root = 1 / mpmath.sqrt(3), mpmath.sqrt(mpmath.mpf(2) / 3 - mpmath.mpf(n) ** -2)
        s, p = (mpmath.expj(-2 * mpmath.atan(root * k / c)) for k in (1, mpmath.mpf(n) ** 2))
        d = mpmath.matrix([[s, 0], [0, p]])
        a = order_sign * mpmath.pi / 3
        r = mpmath.matrix([[mpmath.cos(a), mpmath.sin(a)], [-mpmath.sin(a), mpmath.cos(a)]])
        j = d * r.T * d * r * d  # the planes of incidence turn one way, then the other
        return np.array([[complex(j[k, m]) for m in range(2)] for k in range(2)])


@pytest.mark.parametrize("degrees", [45.0, 48.617, 54.7356, 60.0, 80.0])
def test_phases_of_total_reflection_are_the_printed_ones(degrees):
    cosine = np.cos(np.radians(degrees))
    s, p = reflection(cosine, inside=1.5112, outside=1.0)
    expected = printed_phases(cosine, 1.5112)
    assert [np.angle(s), np.angle(p)] == pytest.approx(expected, abs=1e-12)
    assert [abs(s), abs(p)] == pytest.approx([1.0, 1.0], abs=1e-14)
    assert np.angle(s / p) == pytest.approx(float(total_reflection_retardance(cosine, 1.5112)), abs=1e-12)


def test_by_hand_a_corner_of_bk7():
    # sin^2 = 2/3, 1/n^2 = 0.437877: tan(d/2) = 0.577350 * sqrt(0.228790) / 0.666667 = 0.414239, d = 45.001 deg
    assert np.degrees(total_reflection_retardance(1 / np.sqrt(3), 1.5112)) == pytest.approx(45.001, abs=0.01)


def test_fresnel_s_rhomb_turns_linear_light_round():
    glass, angle = 1.51, np.radians(54.617)
    d = total_reflection_retardance(np.cos(angle), glass)
    round_light = retarder(2 * d, 0.0) @ linear(np.pi / 4)
    assert abs(ellipse(round_light)[1]) == pytest.approx(np.pi / 4, abs=1e-3)  # the angle is printed to a minute


def test_brewster_and_the_critical_angle():
    _, p = reflection(np.cos(np.arctan(1.5)), inside=1.0, outside=1.5)
    assert abs(p) < 1e-15
    s, p = reflection(np.sqrt(1 - 1.5**-2), inside=1.5, outside=1.0)
    assert [complex(s), complex(p)] == pytest.approx([1.0, 1.0], abs=1e-7)  # the root of a rounding
    assert np.isnan(total_reflection_retardance(0.99, 1.5))


def test_powers_are_those_of_the_retroreflectors_formula():
    cosine = np.linspace(0.0, 1.0, 50)
    for ratio in (1.5, 1 / 1.5):
        s, p = reflection(cosine, inside=1.0, outside=ratio)
        assert np.allclose(np.abs(s) ** 2, fresnel(cosine, ratio)[0], atol=1e-12)
        assert np.allclose(np.abs(p) ** 2, fresnel(cosine, ratio)[1], atol=1e-12)


def test_a_metal_straight_on():
    # ((n-1)^2 + k^2) / ((n+1)^2 + k^2), any textbook
    s, p = reflection(1.0, inside=1.0, outside=GOLD)
    assert abs(s) ** 2 == pytest.approx((0.85**2 + 4.7**2) / (1.15**2 + 4.7**2))
    assert complex(p) == pytest.approx(-complex(s))


def test_a_bare_metal_is_the_same_surface_by_the_thin_films_matrix():
    cosine = np.linspace(0.01, 1.0, 40)
    metal = np.conj(complex(index("aluminium", 0.78)))
    for medium in (1.0, 1.5112):
        s, p = (
            response(Coating((), "aluminium"), 0.78, np.arccos(cosine), polarization=axis, medium=medium).r
            for axis in ("s", "p")
        )
        films = np.conj(s), -np.conj(p)  # of the opposite sign of time, and p equal to s at normal incidence
        assert np.allclose(films, reflection(cosine, inside=medium, outside=metal), atol=1e-12)


def test_a_mirror_turns_the_field_by_half_a_turn_about_its_normal():
    rng = np.random.default_rng(1)
    k = rng.normal(size=(20, 3))
    k /= np.linalg.norm(k, axis=1, keepdims=True)
    n = np.array([0.6, 0.0, 0.8])
    to, p = reflection_matrix(k, n, surface(inside=1.0, outside=PERFECT))
    field = np.cross(k, rng.normal(size=(20, 3)))  # square to k
    after = np.einsum("rij,rj->ri", p, field)
    assert np.allclose(after, 2.0 * (field @ n)[:, None] * n - field, **SQUARE)
    assert np.allclose(np.sum(after * to, axis=1), 0.0, **SQUARE)


def test_six_orders_and_their_reverses():
    assert len(set(ORDERS)) == 6
    assert [ORDERS[i][::-1] for i in REVERSED] == list(ORDERS)
    assert np.allclose(EDGES @ EDGES.T, np.eye(3), **SQUARE)


def test_a_corner_is_three_retarders_and_turns_of_sixty_degrees():
    found = sector_jones(solid_corner(1.5112), 0.0)
    for j in found:
        # turns of the axes before and after are free in the other derivation: what stays are the determinant and
        # tr J^T J; its axes (s, k x s) follow the light, ours stay, so that one of them is a mirror image
        both = [by_rotations(1.5112, sign) for sign in (1, -1)]
        assert retardance(j) == pytest.approx(np.pi - float(retardance(both[0])), abs=1e-12)
        assert retardance(both[0]) == pytest.approx(float(retardance(both[1])), abs=1e-12)
        assert np.linalg.det(j) == pytest.approx(-np.linalg.det(both[0]), abs=1e-12)


def test_the_quarter_wave_corner():
    # [PLAYER88]'s abstract prints 1.76476; exactly it is 1.767476..., the printed digits but for a lost 7
    assert np.degrees(retardance(sector_jones(solid_corner(1.767476263), 0.0))) == pytest.approx(90.0, abs=1e-6)
    assert np.degrees(retardance(by_rotations(1.767476263, 1))) == pytest.approx(90.0, abs=1e-6)
    assert np.degrees(retardance(by_rotations(1.76476, 1))) == pytest.approx(89.90, abs=0.005)


def test_the_far_field_of_fused_silica_has_26_percent():
    # the laser ranging literature's 26.4 % of a perfect reflector, fused silica in the visible (1.455 to 1.461)
    for n in (1.455, 1.457, 1.461):
        light = far_field_jones(sector_jones(solid_corner(n), 0.0)) @ linear(0.3)
        assert np.sum(np.abs(light) ** 2) == pytest.approx(0.264, abs=0.003)


def test_straight_on_the_axis_of_the_far_field_keeps_every_polarization():
    m = far_field_jones(sector_jones(solid_corner(1.5112), 0.0))
    assert np.allclose(m, m[0, 0] * np.eye(2), **SQUARE)  # threefold symmetry and reciprocity leave nothing else
    assert abs(m[0, 0]) ** 2 == pytest.approx(0.298, abs=5e-4)


def test_a_corner_of_perfect_mirrors_does_nothing_at_any_angle():
    for incidence, azimuth in ((0.0, 0.0), (0.3, 1.0), (0.5, -2.0)):
        assert np.allclose(sector_jones(hollow_corner(PERFECT), incidence, azimuth), np.eye(2), **SQUARE)


def test_gold_mirrors_hardly_change_polarization_but_bare_glass_does():
    quarter = np.linspace(0.0, np.pi, 37)
    for corner, least, most in ((hollow_corner(GOLD), 0.0, 0.08), (solid_corner(1.5112), 0.3, 0.9)):
        jones = sector_jones(corner, 0.0)
        power = returned_power(jones, linear(quarter))
        crossed = returned_power(jones, linear(quarter), analyser=linear(quarter + np.pi / 2)) / power
        assert np.all((crossed >= least) & (crossed <= most))


def test_bare_glass_returns_all_light_to_its_limit_and_less_beyond():
    corner = solid_corner(1.5112)
    inside, beyond = (sector_jones(corner, np.radians(d), np.pi) for d in (19.0, 24.0))
    other = sector_jones(corner, np.radians(24.0), 0.0)
    powers = [float(returned_power(j, linear(0.4))) for j in (inside, beyond, other)]
    assert powers[0] == pytest.approx(1.0, abs=1e-12)
    assert powers[1] == pytest.approx(1.0, abs=1e-12)  # away from an edge reflection stays total
    assert powers[2] < 0.9  # towards an edge it ends at 20.3 deg


def test_a_bare_face_takes_its_share_twice():
    bare, coated = (sector_jones(solid_corner(1.5112, bare_face=b), 0.0) for b in (True, False))
    lost = (0.5112 / 2.5112) ** 2
    assert np.allclose(bare, (1 - lost) * coated, **SQUARE)
    s, p = (1 - float(r) for r in fresnel(np.cos(0.3), 1.5112))
    bare, coated = (sector_jones(solid_corner(1.5112, bare_face=b), 0.3) for b in (True, False))
    assert bare[:, 1, 1] / coated[:, 1, 1] == pytest.approx(np.full(6, s))  # tilted about v: s on the face is v
    assert bare[:, 0, 0] / coated[:, 0, 0] == pytest.approx(np.full(6, p))
    assert p > s


def test_shares_of_the_sectors_are_what_rays_count():
    corner, aperture, height, incidence, azimuth = solid_corner(1.5), 0.02, 0.028, 0.25, 0.7
    rng = np.random.default_rng(5)
    flat = np.array([np.cos(azimuth), np.sin(azimuth)]) * -np.sin(incidence) / 1.5
    k = np.array([*flat, -np.sqrt(1 - flat @ flat)])
    start = np.zeros((400_000, 3))
    start[:, :2] = aperture * (2 * rng.random((400_000, 2)) - 1)
    corner_at = np.array([0.0, 0.0, -height])
    here = start - corner_at
    middle = -height * flat / -k[2]
    exit_at = 2 * middle - start[:, :2]
    used = (np.hypot(*start[:, :2].T) < aperture) & (np.hypot(*exit_at.T) < aperture)
    times = (here @ EDGES.T) / -(k @ EDGES.T)
    order = np.argsort(times, axis=1)
    counted = np.array([np.mean(np.all(order[used] == way, axis=1)) for way in ORDERS])
    shares = sector_shares(corner, incidence, azimuth, aperture=aperture, height=height)
    u = np.sqrt(counted * (1 - counted) / used.sum())
    assert np.all(np.abs(shares - counted) < 4.5 * u)
    assert shares == pytest.approx(shares[list(REVERSED)])
    assert shares.max() - shares.min() > 0.02


def test_a_splitter_and_a_quarter_wave_plate_send_a_mirror_s_light_to_the_detector():
    plate = retarder(np.pi / 2, np.pi / 4)
    for corner, least in ((hollow_corner(PERFECT), 1 - 1e-12), (hollow_corner(GOLD), 0.85)):
        back = through_plate(sector_jones(corner, 0.0), plate)
        assert returned_power(back, linear(0.0), analyser=linear(np.pi / 2)) > least
    glass = through_plate(sector_jones(solid_corner(1.5112), 0.0), plate)
    detected = returned_power(glass, linear(0.0), analyser=linear(np.pi / 2))
    lost = returned_power(glass, linear(0.0), analyser=linear(0.0))
    assert detected + lost == pytest.approx(1.0)
    assert 0.3 < detected < 0.9


def test_ellipses():
    assert ellipse(linear(0.7))[0] == pytest.approx(0.7)
    assert ellipse(linear(0.7))[1] == pytest.approx(0.0, abs=1e-12)
    turned = retarder(np.pi, 0.2) @ linear(0.0)  # a half wave plate mirrors about its axis
    assert ellipse(turned)[0] == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: reflection(1.2, inside=1.5, outside=1.0), "cosine of incidence 1.2"),
        (lambda: reflection(0.5, inside=0.0, outside=1.0), "index inside 0"),
        (lambda: reflection(0.5, inside=1.0, outside=0.2 - 4j), "expected n + ik"),
        (lambda: solid_corner(0.9), "index 0.9"),
        (lambda: sector_jones(solid_corner(1.5), 1.6), "incidence 1.6 rad"),
        (lambda: sector_jones(hollow_corner(GOLD), 0.7, np.pi), "no longer meets all three faces"),
        (lambda: sector_shares(solid_corner(1.5), 0.0, aperture=0.0, height=0.03), "aperture = 0 m"),
        (lambda: sector_shares(solid_corner(1.5), 1.3, aperture=0.01, height=0.03), "no part of the face"),
    ],
)
def test_invalid_values_are_refused(call, said):
    with pytest.raises(ValidityError, match=said.replace("+", r"\+")):
        call()
