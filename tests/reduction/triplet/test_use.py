"""From two prism ranges to the ball: exact geometry, the memo's shortcuts, the claimed covariance against scatter."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catseye.constants import DEGREE, SPEED_OF_LIGHT
from catseye.errors import InputError, ValidityError
from catseye.geometry.clearance import visibility
from catseye.optics.retroreflector.prism import obliquity_correction
from catseye.reduction.site.places import nominal_frame, places_of
from catseye.reduction.triplet.memo import median_series
from catseye.reduction.triplet.use import (
    MountedTriplet,
    ball_distance,
    ball_distance_memo,
    ball_ranges,
    incidence_on_prisms,
    median,
    obliquity_by_tilt,
)

seeds = st.integers(0, 2**32 - 1)
RATIO = 1.527077


def unit(name="TR", turn=None, **others):
    """A unit at 60 m from the origin, its plate turned in space."""
    r = (Rotation.identity() if turn is None else turn).as_matrix()
    given_ = {
        "ball": np.array([60.0, 0.0, 0.0]), "normal": r[:, 2], "axis": r[:, 0], "d_12": 0.635, "h_corr": 0.2e-3,
        "heights": np.array([0.0384, 0.0382]), "ratio": RATIO, "u_d_12": 30e-6, "u_h_corr": 20e-6,
        "u_lateral": 40e-6, "u_normal": 5e-3,
    }  # fmt: skip
    return MountedTriplet(name, **(given_ | others))


def before(u, rng, k=6, far=60.0, spread=0.2):
    """Scan points before a unit's plate, up to about `spread` rad off its normal."""
    aside = rng.uniform(-spread, spread, (k, 2))
    toward = u.normal + aside[:, :1] * u.axis + aside[:, 1:] * u.across
    return u.ball + far * rng.uniform(0.8, 1.6, (k, 1)) * toward / np.linalg.norm(toward, axis=1, keepdims=True)


def ranged(u, s):
    """What rangers at s report to both prisms with Pc: exact distances less dPc at the plate's own normal."""
    d = np.linalg.norm(s[:, None] - u.prisms, axis=2)
    cosine = np.einsum("kpi,i->kp", s[:, None] - u.prisms, u.normal) / d
    return d - obliquity_correction(u.heights, u.ratio, np.minimum(cosine, 1.0))


@given(seeds)
def test_ranges_to_both_prisms_of_any_unit_give_the_distance_to_its_ball(seed):
    rng = np.random.default_rng(seed)
    u = unit(turn=Rotation.random(random_state=rng), h_corr=rng.uniform(-20e-3, 20e-3))
    s = before(u, rng, spread=0.5)
    found = ball_ranges([u], s, ranged(u, s)[None], covariance=np.zeros((12, 12)))
    np.testing.assert_allclose(
        found.d_bc[0], np.linalg.norm(s - u.ball, axis=1), rtol=0, atol=5e-14
    )  # 100 m in doubles
    np.testing.assert_allclose(found.d_mp[0], np.linalg.norm(s - u.prisms.mean(axis=0), axis=1), rtol=0, atol=5e-14)
    by_page = visibility.incidence(s, u.prisms, np.tile(u.normal, (2, 1)))
    np.testing.assert_allclose(found.incidence[0], by_page, rtol=0, atol=1e-7)  # an arc cosine near 1


@given(seeds)
def test_the_memos_subtraction_leaves_out_the_square_across_the_sight(seed):
    rng = np.random.default_rng(seed)
    sight, offset = rng.normal(size=3), rng.normal(size=3) * 1e-2
    sight /= np.linalg.norm(sight)
    far = rng.uniform(40.0, 120.0)
    d_mp = float(np.linalg.norm(far * sight + offset))
    exact, memo = ball_distance(d_mp, sight, offset), ball_distance_memo(d_mp, sight, offset)
    assert float(exact) == pytest.approx(far, abs=5e-14)
    across = np.linalg.norm(np.cross(sight, offset))
    assert float(memo - exact) == pytest.approx(across**2 / (2.0 * far), rel=1e-3, abs=5e-14)


def test_the_ball_above_the_prisms_is_nearer_to_the_feed_arm():
    u = unit(h_corr=0.5e-3)
    s = (u.ball + 50.0 * u.normal)[None]
    found = ball_ranges([u], s, ranged(u, s)[None], covariance=np.zeros((2, 2)))
    assert float(found.d_mp[0, 0] - found.d_bc[0, 0]) == pytest.approx(0.5e-3, abs=1e-12)


def test_the_series_of_figure_ten_and_its_neglected_term():
    """Delta = N half wavelengths; the rest up to a wavelength in delta_1 + delta_2. D_12^2 (1 - sin^2) s / (16 Delta^2)
    with the sine of incidence towards a prism; third-order terms are a hundredth of it."""
    half = SPEED_OF_LIGHT / (2 * 1500e6 * 1.00025)
    for distance, incidence in ((46.0, 0.0), (46.0, 0.2), (100.0, 0.2)):
        s = distance * np.array([np.sin(incidence), 0.0, np.cos(incidence)])
        d_1, d_2 = (float(np.linalg.norm(s - [p, 0.0, 0.0])) for p in (-0.3175, 0.3175))
        delta = np.floor(min(d_1, d_2) / half - 0.5) * half
        rest = d_1 + d_2 - 2 * delta
        left = float(median_series(d_1, d_2, 0.635, delta=delta)) - distance
        assert left == pytest.approx(-(0.635**2 - (d_1 - d_2) ** 2) * rest / (16 * delta**2), rel=0.02, abs=1e-9)
        assert float(median(d_1, d_2, 0.635)) == pytest.approx(distance, abs=3e-14)
    worst = 0.635**2 * 0.2 / (16 * 46.0**2)
    assert 2.3e-6 < worst < 2.5e-6


def test_three_lengths_that_make_no_triangle_have_no_median():
    assert np.isnan(median([10.0, 0.2, np.nan], [10.7, 0.2, 5.0], 0.635)).all()
    assert float(median(10.0, 10.635, 0.635)) == pytest.approx(10.3175, abs=1e-14)  # in line


def test_angles_at_the_prisms_to_the_aim_differ_by_opposite_leans_and_hardly_move_the_ball():
    """The memo's A-T-S against the plate's normal, with A on it: 46 m, 10 and 30 deg towards a prism."""
    u = unit()
    aim = u.ball + 46.0 * u.normal
    for incidence, most, kept in ((10.0 * DEGREE, 0.3e-6, 0.02e-6), (30.0 * DEGREE, 7.5e-6, 0.15e-6)):
        s = u.ball + 46.0 * np.array([[np.sin(incidence), 0.0, np.cos(incidence)]])
        memo = visibility.incidence(s, u.prisms, aim - u.prisms)
        ours = np.arccos(incidence_on_prisms(u, s)[0])
        wrong = obliquity_correction(u.heights, RATIO, np.cos(memo)) - obliquity_correction(
            u.heights, RATIO, np.cos(ours)
        )
        assert wrong[0, 0] * wrong[0, 1] < 0.0
        assert 0.5 * most < np.abs(wrong).max() < most
        assert abs(wrong.mean()) < kept


@given(seeds)
def test_the_obliquity_moves_with_the_normal_by_its_derivative(seed):
    rng = np.random.default_rng(seed)
    u = unit(turn=Rotation.random(random_state=rng))
    s = before(u, rng, spread=0.5)
    tilts = np.stack([u.axis, u.across])
    _, slopes = obliquity_by_tilt(u, s, tilts)
    towards = s[:, None] - u.prisms
    for j, tilt in enumerate(tilts):
        moved = []
        for step in (-1e-4, 1e-4):
            normal = u.normal + step * tilt
            cosine = towards @ normal / np.linalg.norm(towards, axis=2) / np.linalg.norm(normal)
            moved.append(obliquity_correction(u.heights, RATIO, cosine))
        np.testing.assert_allclose(slopes[:, :, j], (moved[1] - moved[0]) / 2e-4, rtol=0, atol=1e-10)


def test_straight_ahead_the_obliquity_is_flat():
    u = unit(d_12=1e-9)
    value, slopes = obliquity_by_tilt(u, (u.ball + 50.0 * u.normal)[None], np.eye(3)[:2])
    np.testing.assert_allclose(value, 0.0, atol=1e-18)
    np.testing.assert_allclose(slopes, 0.0, atol=1e-15)


def drawn(u, rng):
    """A unit as it may really be, its sheet being as uncertain as it says."""
    normal = u.normal + u.u_normal * (rng.normal() * u.axis + rng.normal() * u.across)
    normal /= np.linalg.norm(normal)
    axis = u.axis - (u.axis @ normal) * normal
    return replace(
        u,
        normal=normal,
        axis=axis / np.linalg.norm(axis),
        d_12=u.d_12 + u.u_d_12 * rng.normal(),
        h_corr=u.h_corr + u.u_h_corr * rng.normal(),
    )


def test_the_claimed_covariance_of_ball_distances_is_their_scatter():
    """Two units, four rangers; zeros common to a ranger, everything of the unit drawn, the reduction told the sheet.
    The whole 8 by 8 matrix: 2000 draws settle its whitened elements to 2.2 %, on the diagonal 3.2 %."""
    rng = np.random.default_rng(77)
    sheets = [unit("A", Rotation.from_rotvec([0.2, 0.1, 0.3])), unit("B", Rotation.from_rotvec([-0.1, 0.2, 2.0]))]
    sheets = [replace(u, u_lateral=60e-6, u_h_corr=30e-6, u_d_12=400e-6, u_normal=20e-3) for u in sheets]
    # both units look at the same rangers, some 15 deg off
    centre = sheets[0].ball + 60.0 * sheets[0].normal
    sheets[1] = replace(sheets[1], ball=centre - 60.0 * sheets[1].normal)
    s = centre + rng.uniform(-15.0, 15.0, (4, 3))
    zero, noise = 25e-6, 15e-6
    ranger = np.tile(np.repeat(np.arange(4), 2), 2)
    covariance = zero**2 * (ranger[:, None] == ranger) + noise**2 * np.eye(16)
    claimed = ball_ranges(sheets, s, np.stack([ranged(u, s) for u in sheets]), covariance=covariance)
    draws, batch = 2000, 50
    zeros = zero * rng.normal(size=(draws, 4))
    errors = []
    for u in sheets:
        ranges, true = np.empty((draws, 4, 2)), np.empty((draws, 4))
        for i in range(draws):
            real = drawn(u, rng)
            ranges[i] = ranged(real, s)
            lateral = u.u_lateral * (rng.normal() * real.axis + rng.normal() * real.across)
            true[i] = np.linalg.norm(s - (u.ball + lateral), axis=1)
        ranges += zeros[:, :, None] + noise * rng.normal(size=ranges.shape)
        found = [  # many draws as if they were many rangers
            ball_ranges(
                [u], np.tile(s, (batch, 1)), part.reshape(1, 4 * batch, 2), covariance=np.zeros((8 * batch,) * 2)
            ).d_bc
            for part in np.split(ranges, draws // batch)
        ]
        errors.append(np.concatenate(found).reshape(draws, 4) - true)
    whitened = np.linalg.solve(np.linalg.cholesky(claimed.covariance), np.concatenate(errors, axis=1).T)
    np.testing.assert_allclose(whitened @ whitened.T / draws, np.eye(8), rtol=0, atol=0.12)
    shared = claimed.covariance[0, 1] / np.sqrt(claimed.covariance[0, 0] * claimed.covariance[1, 1])
    assert shared > 0.3  # one unit's distances are far from independent


def test_each_share_of_the_covariance_is_the_answers_own_change():
    """One uncertainty at a time, no noise: the covariance is the outer product of differences of the answer."""
    rng = np.random.default_rng(31)
    none = {"u_d_12": 0.0, "u_h_corr": 0.0, "u_lateral": 0.0, "u_normal": 0.0}
    u = unit(turn=Rotation.random(random_state=rng), h_corr=2e-3, **none)
    s = before(u, rng, k=3, spread=0.4)
    d, nothing = ranged(u, s)[None], np.zeros((6, 6))

    def leaning(step, tilt):
        normal = (u.normal + step * tilt) / np.linalg.norm(u.normal + step * tilt)
        axis = u.axis - (u.axis @ normal) * normal
        return replace(u, normal=normal, axis=axis / np.linalg.norm(axis))

    moves = {
        "u_d_12": [lambda h: replace(u, d_12=u.d_12 + h)],
        "u_h_corr": [lambda h: replace(u, h_corr=u.h_corr + h)],
        "u_normal": [lambda h: leaning(h, u.axis), lambda h: leaning(h, u.across)],
    }
    for name, ways in moves.items():
        slopes = [
            (
                ball_ranges([way(1e-4)], s, d, covariance=nothing).d_bc
                - ball_ranges([way(-1e-4)], s, d, covariance=nothing).d_bc
            )[0]
            / 2e-4
            for way in ways
        ]
        found = ball_ranges([replace(u, **{name: 1.0})], s, d, covariance=nothing).covariance
        # prisms that follow a leaning plate turn the sights a little: 1e-4 of the slope, and 1e-7 for differences
        np.testing.assert_allclose(found, sum(np.outer(j, j) for j in slopes), rtol=3e-3, atol=1e-9)
    sight = (s - u.ball) / np.linalg.norm(s - u.ball, axis=1, keepdims=True)
    aside = sight - (sight @ u.normal)[:, None] * u.normal
    found = ball_ranges([replace(u, u_lateral=1.0)], s, d, covariance=nothing).covariance
    np.testing.assert_allclose(found, aside @ aside.T, rtol=0, atol=1e-14)


def test_a_prism_that_was_not_ranged_leaves_the_others():
    rng = np.random.default_rng(2)
    units = [unit("A"), unit("B", ball=np.array([61.0, 0.0, 0.0]))]
    s = before(units[0], rng, k=3)
    d = np.stack([ranged(u, s) for u in units])
    whole = ball_ranges(units, s, d, covariance=1e-10 * np.eye(12))
    d[0, 1, 1] = np.nan
    part = ball_ranges(units, s, d, covariance=1e-10 * np.eye(12))
    gone = np.arange(6) == 1
    assert np.isnan(part.d_bc.ravel()[gone]).all()
    assert np.isnan(part.covariance[gone]).all()
    np.testing.assert_array_equal(part.d_bc.ravel()[~gone], whole.d_bc.ravel()[~gone])
    np.testing.assert_array_equal(part.covariance[np.ix_(~gone, ~gone)], whole.covariance[np.ix_(~gone, ~gone)])


def test_a_units_sheet_places_it_as_the_campaign_does(night_01):
    frame = nominal_frame(night_01)
    places = places_of(night_01)
    ratio = night_01.site.ranging.bk7_to_air_group_index_ratio
    for record in night_01.triplets.values():
        u = MountedTriplet.of(record, frame, ratio=ratio, u_normal=5e-3)
        left, right, ball = (places[name].start for name in record.targets)
        np.testing.assert_allclose(u.ball, ball, rtol=0, atol=1e-12)
        np.testing.assert_allclose(u.prisms, [left, right], rtol=0, atol=3e-6)  # the sheet's axis has five digits
        assert np.cross(u.normal, u.axis) @ u.across == pytest.approx(1.0, abs=1e-12)


def test_what_does_not_fit_is_refused():
    u = unit()
    with pytest.raises(ValidityError, match="triplet TR: normal and axis are not square unit vectors"):
        replace(u, axis=u.normal)
    with pytest.raises(InputError, match=r"expected \(1, 3, 2\) and \(6, 6\) for 1 triplets and 3 scan points"):
        ball_ranges([u], np.zeros((3, 3)), np.zeros((3, 2)), covariance=np.eye(6))
