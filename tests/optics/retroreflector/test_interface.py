"""What every kind of retroreflector answers, against geometry counted by points, traced light and printed design."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.optics.glass import group_index, phase_index
from catseye.optics.polarization import linear
from catseye.optics.ray_trace import beam, half_path, through_prism
from catseye.optics.retroreflector import dihedral, prism
from catseye.optics.retroreflector.back_mirror_cube import BackMirrorCube
from catseye.optics.retroreflector.cats_eye import BallCatsEye, focal_radius
from catseye.optics.retroreflector.corner_polarization import returned_power
from catseye.optics.retroreflector.hollow_cube import HollowCube
from catseye.optics.retroreflector.interface import fresnel
from catseye.optics.retroreflector.solid_prism import SolidPrism

GROUP, PHASE = 1.527077, 1.510811
INCH = 0.0254
PRISM = SolidPrism(height=0.0381, aperture=0.0254, group=GROUP, phase=PHASE)
HOLLOW = HollowCube(aperture=0.0254, height=0.0359, reflectance=0.96)
BALL = BallCatsEye(r1=1.969 * INCH, r2=3.799 * INCH, aperture=0.015, group=GROUP, phase=PHASE)
BACK = BackMirrorCube(PRISM, setback=(0.001, -0.002, 0.060))
KINDS = [HOLLOW, PRISM, replace(PRISM, corner_reflectance=0.95), BALL, BACK, BackMirrorCube(HOLLOW, (0, 0, 0.04))]
angles = st.floats(0.0, 1.57)
azimuths = st.floats(-7.0, 7.0)
kinds = st.sampled_from(KINDS)


@given(kinds, angles, azimuths)
def test_nothing_sends_back_more_than_its_clear_area(kind, incidence, azimuth):
    whole = float(kind.clear_area(0.0))
    share = float(kind.return_share(incidence, azimuth))
    assert 0.0 <= share <= float(kind.clear_area(incidence, azimuth)) / whole * (1 + 1e-12) <= 1 + 1e-12


@given(kinds, azimuths)
def test_straight_on_nothing_is_added_to_the_range_constant(kind, azimuth):
    assert abs(float(kind.range_change(0.0, azimuth))) <= 1e-18
    assert 0.0 < kind.acceptance <= np.pi / 2


@given(kinds, angles, angles, azimuths)
def test_turned_farther_away_it_shows_no_more(kind, one, other, azimuth):
    nearer, farther = sorted((one, other))
    least = float(kind.clear_area(nearer, azimuth))
    assert float(kind.clear_area(farther, azimuth)) <= least + 1e-12 * np.pi * 0.0254**2


@given(kinds, st.floats(1.5708, np.pi))
def test_from_behind_there_is_neither_range_nor_light(kind, incidence):
    assert np.isnan(kind.range_change(incidence))
    assert float(kind.clear_area(incidence)) == pytest.approx(0.0, abs=1e-12)


@given(st.floats(0.0, 1.5), azimuths)
def test_appendix_b_is_the_prism_that_bends_with_the_group_index(incidence, azimuth):
    memo = replace(PRISM, phase=GROUP)
    expected = float(prism.obliquity_correction(0.0381, GROUP, np.cos(incidence)))
    assert float(memo.range_change(incidence, azimuth)) == pytest.approx(expected, abs=1e-16)  # m, rounding


def test_arrays_and_nan_are_answered_one_by_one():
    for kind in KINDS:
        answer = kind.range_change([[0.1, np.nan, 2.0]], [[0.0], [1.0]])
        assert np.isnan(answer).tolist() == [[False, True, True]] * 2
        assert kind.return_share([0.1, 0.2]).shape == (2,)


def test_the_constants_are_the_memos():
    assert replace(PRISM, height=0.0384).range_constant * 1e3 == pytest.approx(-33.4937, abs=5.1e-5)
    assert replace(PRISM, height=0.0384).fiducial[2] * 1e3 == pytest.approx(-25.146, abs=5e-4)
    assert BALL.range_constant * 1e3 == pytest.approx(-173.715, abs=5.1e-4)
    assert (HOLLOW.range_constant, HOLLOW.fiducial, BALL.fiducial) == (0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


# --- light inside the cube


def least_cosine_loss(prism_, incidence, azimuth):
    """Largest cosine of incidence on the three faces of one traced direction, by vectors, none of the file's angles."""
    around = np.arange(3) * 2 * np.pi / 3
    edges = np.stack([np.cos(around), np.sin(around), np.full(3, np.sqrt(0.5))], axis=-1) * np.sqrt(2 / 3)
    across = np.sin(incidence) / prism_.phase * np.array([np.cos(azimuth), np.sin(azimuth)])
    return np.max(np.abs(edges @ np.append(across, np.sqrt(1 - across @ across))))


@pytest.mark.parametrize("azimuth", np.radians([0.0, 13.0, 30.0, -45.0, 52.0, 75.0, 120.0, 195.0, 238.0]))
def test_total_reflection_ends_where_a_face_meets_the_critical_angle(azimuth):
    limit = float(PRISM.total_reflection_limit(azimuth))
    critical = np.sqrt(1 - PRISM.phase**-2)
    for incidence in np.linspace(0.0, limit, 50)[:-1]:
        assert least_cosine_loss(PRISM, incidence, azimuth) <= critical
    if limit < np.pi / 2:
        assert least_cosine_loss(PRISM, limit, azimuth) == pytest.approx(critical, abs=1e-12)


def test_total_reflection_has_the_sizes_that_the_docstring_states():
    for n, printed in ((PHASE, 20.3), (float(phase_index(0.780, "fused-silica")) / 1.000249, 16.5)):
        glass = replace(PRISM, phase=n)
        assert np.degrees(float(glass.total_reflection_limit(0.0))) == pytest.approx(printed, abs=0.05)
    assert np.degrees(float(PRISM.total_reflection_limit(np.pi / 6))) == pytest.approx(24.6, abs=0.05)
    assert float(PRISM.total_reflection_limit(np.radians(54.5))) == np.pi / 2
    low = replace(PRISM, phase=1.1)  # holds nothing in: 54.7 deg is less than its critical angle, 65.4 deg
    assert (low.acceptance, float(low.return_share(0.0)) < 0.01) == (0.0, True)


def test_a_bare_prism_returns_all_but_two_passages_of_its_face_and_leaks_beyond_the_limit():
    lost = ((PHASE - 1) / (PHASE + 1)) ** 2
    assert float(PRISM.return_share(0.0)) == pytest.approx((1 - lost) ** 2)
    silvered = replace(PRISM, corner_reflectance=1.0)
    for azimuth, leaks in ((0.0, True), (np.pi / 3, False)):
        ratio = float(PRISM.return_share(0.5, azimuth) / silvered.return_share(0.5, azimuth))
        assert (ratio < 0.6) is leaks
        assert leaks or ratio == pytest.approx(1.0)
    coated = replace(PRISM, face_reflectance=0.005)
    assert float(coated.return_share(0.0)) == pytest.approx(0.995**2)


def test_fresnel_at_brewster_at_the_critical_angle_and_by_conservation():
    s, p = fresnel(np.cos(np.arctan(1.5)), 1.5)
    assert float(p) == pytest.approx(0.0, abs=1e-30)
    assert float(s) == pytest.approx(((1.5**2 - 1) / (1.5**2 + 1)) ** 2)  # at Brewster's angle, by hand
    assert fresnel(np.cos(np.radians(54.7)), 1 / 1.51) == (1.0, 1.0)
    inside, outside = fresnel(np.cos(0.4), 1 / 1.5), fresnel(np.cos(np.arcsin(1.5 * np.sin(0.4))), 1.5)
    np.testing.assert_allclose(inside, outside, rtol=1e-12)  # the same from both sides


# --- the cube behind a mirror


@pytest.mark.parametrize("incidence", [0.0, 0.1, 0.4])
@pytest.mark.parametrize("azimuth", [0.0, 2.0])
def test_the_back_retroreflector_gives_the_distance_to_the_face(incidence, azimuth):
    """Traced: half the path to the cube, plus constant and change, ends at the face's origin."""
    u = np.array([np.sin(incidence) * np.cos(azimuth), np.sin(incidence) * np.sin(azimuth), np.cos(incidence)])
    aside = 0.0381 * np.tan(np.arcsin(np.sin(incidence) / PHASE)) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    out = through_prism(beam(u, aside + np.array([0.001, 0.0005, 0.0])), height=0.0381, phase=PHASE, group=GROUP)
    face = -np.array(BACK.setback)  # in the prism's axes
    further = float(half_path(out, u, face)[0])  # than the face's origin the light seems to have been
    told = BACK.range_constant + float(BACK.range_change(incidence, azimuth))
    assert further + told == pytest.approx(0.0, abs=1e-12)


def test_a_plate_n_times_as_thick_as_the_prism_is_high_needs_no_constant():
    flush = BackMirrorCube(PRISM, setback=(0.0, 0.0, GROUP * PRISM.height))
    assert flush.range_constant == pytest.approx(0.0, abs=1e-16)
    assert BackMirrorCube(HOLLOW, (0.0, 0.0, 0.04)).range_constant == 0.04


# --- polarized light


def kept(kind, incidence, azimuth):
    shares, jones = kind.sectors(incidence, azimuth)
    return 0.5 * float(shares @ np.sum(np.abs(jones) ** 2, axis=(1, 2)))  # of unpolarized light on the clear area


@pytest.mark.parametrize("incidence", [0.0, 0.1, 0.25])
@pytest.mark.parametrize("azimuth", [0.0, 1.0])
def test_the_sectors_send_back_together_what_unpolarized_light_loses(incidence, azimuth):
    prism_metal = replace(PRISM, corner_reflectance=0.9, face_reflectance=0.01)
    for kind in (replace(HOLLOW, reflectance=0.95), PRISM, prism_metal, BALL, BackMirrorCube(PRISM, (0.0, 0.0, 0.02))):
        share = float(kind.return_share(incidence, azimuth) / kind.clear_area(incidence, azimuth))
        whole = float(kind.return_share(0.0) / kind.clear_area(0.0))
        # s and p part at the face by 4 % of 4 % at 0.25 rad; straight on they are alike
        assert kept(kind, incidence, azimuth) / kept(kind, 0.0, 0.0) == pytest.approx(share / whole, rel=2e-4)
        assert sum(kind.sectors(incidence, azimuth).shares) == pytest.approx(1.0)
    assert kept(PRISM, 0.0, 0.0) == pytest.approx(float(PRISM.return_share(0.0)), rel=1e-12)
    assert kept(prism_metal, 0.0, 0.0) == pytest.approx(0.9**3 * 0.99**2, rel=1e-12)
    assert kept(BALL, 0.0, 0.0) == pytest.approx(float(BALL.return_share(0.0)), rel=1e-12)
    assert kept(replace(HOLLOW, reflectance=0.95), 0.0, 0.0) == pytest.approx(0.95**3, rel=1e-12)


def test_only_a_bare_prism_turns_the_polarization():
    def crossed(kind):
        shares, jones = kind.sectors(0.2, 0.4)
        light, analyser = linear(0.3), linear(0.3 + 0.5 * np.pi)
        passed = returned_power(jones, light, analyser=analyser, shares=shares)
        return float(passed / returned_power(jones, light, shares=shares))

    assert crossed(PRISM) > 0.2
    for kind in (HOLLOW, BALL, replace(PRISM, corner_reflectance=0.9, face_reflectance=0.01)):
        assert crossed(kind) == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(ValidityError, match="no part of the ball"):
        BALL.sectors(np.pi, 0.0)


# --- the ball


def test_the_memos_large_radius_is_the_best_for_a_beam_of_10_mm():
    """The design prints 3.799"; the least blur of the exact rays is there for a Gaussian beam of 10 mm, at 780 nm."""
    glass = replace(BALL, aperture=0.03, phase=float(phase_index(0.780)), group=float(group_index(0.780)))
    assert glass.best_radius(0.010) / INCH == pytest.approx(3.799, abs=0.002)
    assert float(focal_radius(glass.r1, glass.phase)) / INCH == pytest.approx(3.852, abs=0.001)
    assert replace(glass, r2=glass.best_radius(0.010)).blur(0.010) <= glass.blur(0.010)
    # a thin beam wants the paraxial focus
    assert glass.best_radius(0.0005) == pytest.approx(float(focal_radius(glass.r1, glass.phase)), rel=1e-4)


def test_the_deviation_starts_with_the_paraxial_defocus():
    y = 1e-4
    defocus = 2 * y / PHASE * ((PHASE - 1) / BALL.r1 - 1 / BALL.r2)
    assert float(BALL.deviation(y)) == pytest.approx(defocus, rel=1e-3)
    assert defocus < 0.0  # diverging: the mirror stands before the focus
    in_focus = replace(BALL, r2=float(focal_radius(BALL.r1, PHASE)))
    assert float(in_focus.deviation(0.010)) > 0.0  # the sphere bends outer rays too much


def test_the_path_is_the_integral_of_the_deviation():
    """A wave's path and its slope belong together (Malus): counted to the foot of the centre, twice dP = -y de."""
    ball = replace(BALL, group=PHASE)  # bent and delayed by one index
    for height in (0.003, 0.009, 0.015):
        x, w = np.polynomial.legendre.leggauss(40)
        y, step = 0.5 * height * (1 + x), 1e-6
        slope = (ball.deviation(y + step) - ball.deviation(y - step)) / (2 * step)
        turned = float(np.sum(0.5 * height * w * y * slope))
        assert float(ball.path_change(height)) == pytest.approx(-0.5 * turned, abs=1e-12)  # m, of the differences


def test_the_mean_over_a_beam_is_that_of_many_random_rays():
    rng = np.random.default_rng(11)
    for offset in (0.0, 0.004):
        at = rng.normal(scale=0.008 / 2, size=(400_000, 2)) + np.array([offset, 0.0])
        height = np.hypot(at[:, 0], at[:, 1])
        change = BALL.path_change(height[height < BALL.aperture])
        found = BALL.mean_path_change(0.008, offset)
        assert found == pytest.approx(np.mean(change), abs=4 * np.std(change) / np.sqrt(len(change)))
    assert BALL.mean_path_change(0.010) * 1e6 == pytest.approx(4.61, abs=0.01)  # the memo's index, within 15 mm


def test_the_collected_share_agrees_with_random_rays():
    rng = np.random.default_rng(12)
    height = np.hypot(*rng.normal(scale=0.010 / 2, size=(2, 200_000)))
    height = height[height < BALL.aperture]
    for distance in (18.0, 100.0):
        lands = np.abs(-height + distance * np.tan(BALL.deviation(height)))
        found = BALL.collected_share(distance, beam_radius=0.010, receiver=0.05)
        assert found == pytest.approx(np.mean(lands <= 0.05), abs=0.005)  # four scatters of 2e5 rays


@pytest.mark.parametrize("degrees", [0.0, 60.0, 72.0, 74.0, 80.0, 85.0, 89.0, 90.0])
def test_the_ball_shows_what_both_ways_pass_its_small_half(degrees):
    rng = np.random.default_rng(5)
    incidence = np.radians(degrees)
    at = rng.uniform(-BALL.aperture, BALL.aperture, (400_000, 2))
    at = at[np.hypot(at[:, 0], at[:, 1]) < BALL.aperture]
    before = np.sqrt(BALL.r1**2 - np.sum(at**2, axis=-1))
    up = [sign * at[:, 0] * np.sin(incidence) + before * np.cos(incidence) for sign in (1, -1)]  # in and out again
    counted = np.mean((up[0] > 0) & (up[1] > 0))
    share = float(BALL.clear_area(incidence)) / (np.pi * BALL.aperture**2)
    assert share == pytest.approx(counted, abs=0.004)
    assert (abs(share - 1.0) < 1e-12) == (incidence <= BALL.acceptance)


# --- wrong right angles


def test_three_arcseconds_spread_the_light_and_leave_the_range():
    three = 3.0 * np.pi / 648000
    face = {"aperture": 0.0254, "beam_radius": 0.010}
    far = dihedral.on_axis_share(three, **face, wavelength=0.78e-6)
    assert far == pytest.approx(0.768, abs=1e-3)
    # by random points of the face, the field's amplitude with its phase
    rng = np.random.default_rng(2)
    p = rng.uniform(-0.0254, 0.0254, (400_000, 2))
    r = np.hypot(p[:, 0], p[:, 1])
    p, r = p[r < 0.0254], r[r < 0.0254]
    middle = np.round(np.arctan2(p[:, 1], p[:, 0]) / (np.pi / 3)) * np.pi / 3
    along = p[:, 0] * np.cos(middle) + p[:, 1] * np.sin(middle)
    weight = np.exp(-((r / 0.010) ** 2))
    field = np.sum(weight * np.exp(2j * np.pi / 0.78e-6 * three * along)) / np.sum(weight)
    assert far == pytest.approx(abs(field) ** 2, abs=3e-3)
    power = weight**2
    assert dihedral.pupil_offset(three, **face) == pytest.approx(
        0.5 * three * np.sum(power * along) / np.sum(power), rel=3e-3
    )
    assert dihedral.pupil_offset(-three, **face) < 0.0 < dihedral.pupil_offset(three, **face) < 0.05e-6
    near = dihedral.collected_share(three, 100.0, beam_radius=0.010, receiver=0.010)
    assert 0.95 < float(near) < 1.0
    assert float(dihedral.collected_share(0.0, 100.0, beam_radius=0.010, receiver=0.010)) == 1.0


# --- what is refused


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: replace(PRISM, height=0.0), "height = 0 m is not above 0"),
        (lambda: replace(PRISM, phase=0.9), "phase index ratio 0.9 is outside 1 to 4"),
        (lambda: replace(PRISM, face_reflectance=1.5), "face_reflectance = 1.5 is outside 0 to 1"),
        (lambda: replace(HOLLOW, reflectance=-0.1), "reflectance = -0.1"),
        (lambda: replace(BALL, aperture=0.06), "aperture = 0.06 m is not below"),
        (lambda: BackMirrorCube(PRISM, (0.0, np.nan, 0.0)), "not three finite numbers"),
        (lambda: PRISM.range_change(4.0), "incidence 4 rad is outside 0 to pi"),
        (lambda: BALL.deviation(-0.001), "ray height -0.001 m is below 0"),
        (lambda: BALL.blur(0.0), "beam_radius = 0 m"),
        (lambda: BALL.collected_share(-1.0, beam_radius=0.01, receiver=0.05), "distance = -1 m"),
        (lambda: prism.oblique_change(0.04, 0.1, group=1.5, phase=1.0), "phase index ratio 1.0 is not above 1"),
        (lambda: dihedral.on_axis_share(1e-5, aperture=0.0, beam_radius=1.0, wavelength=1e-6), "aperture = 0.0 m"),
    ],
)
def test_invalid_retroreflectors_are_refused(call, message):
    with pytest.raises(ValidityError, match=message):
        call()


def test_a_ray_beside_the_ball_is_nan():
    assert np.isnan(BALL.deviation([0.01, 0.06])).tolist() == [False, True]


def test_a_wrong_glass_costs_what_the_notes_and_the_memo_quote():
    wrong = prism.wrong_glass(0.0381, assumed=float(group_index(0.780)), true=float(group_index(0.780, "N-BK7")))
    assert float(wrong.about_point) * 1e6 == pytest.approx(0.63, abs=0.005)
    assert float(wrong.about_face) * 1e6 == pytest.approx(0.44, abs=0.005)
    assert float(wrong.about_point) == pytest.approx(
        float(prism.range_constant(0.0381, group_index(0.780)))
        - float(prism.range_constant(0.0381, group_index(0.780, "N-BK7"))),
        abs=1e-17,
    )
