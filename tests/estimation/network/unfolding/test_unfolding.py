"""Figures from ranges alone: the true shape comes out whatever is unknown, and what ranges cannot show is said."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import orthogonal_procrustes

from catseye.errors import ValidityError
from catseye.estimation.network.unfolding.factors import classical_scaling, match_means
from catseye.estimation.network.unfolding.location import locate
from catseye.estimation.network.unfolding.unfold import FigureOutcome, unfold
from draws import draws, examples

SIGMA = 1e-3  # m, on figures of 100 m
FEW = examples(25)


def scene(s, t, seed, *, height=20.0, target_height=1.0):
    """Stations over 200 m and targets over 80 m above them."""
    rng = np.random.default_rng(seed)
    stations = np.column_stack([rng.uniform(-100, 100, (s, 2)), rng.uniform(-1, 1, s) * height])
    targets = np.column_stack([rng.uniform(-40, 40, (t, 2)), rng.uniform(20, 80, t) * target_height])
    return stations, targets


def measured(stations, targets, seed, *, missing=0.0, sigma=SIGMA):
    rng = np.random.default_rng(seed + 1000)
    ranges = np.linalg.norm(stations[:, None] - targets, axis=2)
    ranges += rng.normal(size=ranges.shape) * sigma
    ranges[rng.random(ranges.shape) < missing] = np.nan
    return ranges


def apart(found, true):
    """Largest distance after the best rigid motion, mirror images allowed (scipy's, not ours)."""
    a, b = found - found.mean(axis=0), true - true.mean(axis=0)
    return np.linalg.norm(a @ orthogonal_procrustes(a, b)[0] - b, axis=1).max()


def check(stations, targets, seed, *, within, **more):
    found = unfold(measured(stations, targets, seed, **more), SIGMA)
    assert found.outcome is FigureOutcome.UNFOLDED
    assert apart(np.vstack([found.stations, found.targets]), np.vstack([stations, targets])) < within
    return found


@pytest.mark.parametrize(
    ("s", "t", "within"), [(18, 100, 0.01), (100, 18, 0.01), (6, 10, 0.1), (10, 6, 0.1), (5, 9, 0.5)]
)
@pytest.mark.parametrize("seed", range(3))
def test_stations_and_targets_come_out_of_their_ranges(s, t, within, seed):
    found = check(*scene(s, t, seed), seed, within=within)
    assert not found.side_assumed.any()
    assert 0.5 * SIGMA < found.rms < 1.6 * SIGMA


@pytest.mark.parametrize("missing", [0.2, 0.4])
@pytest.mark.parametrize("seed", range(3))
def test_missing_ranges_are_made_up_by_trilateration_from_a_complete_part(missing, seed):
    check(*scene(18, 100, seed), seed, missing=missing, within=0.02)


@FEW
@given(st.integers(0, 10**6), st.floats(-3, 3))
def test_scaling_all_ranges_scales_the_figure(seed, power):
    stations, targets = scene(8, 12, seed)
    ranges, factor = measured(stations, targets, seed), 10.0**power
    small, large = unfold(ranges, SIGMA), unfold(ranges * factor, SIGMA * factor)
    assert small.outcome == large.outcome == FigureOutcome.UNFOLDED
    np.testing.assert_allclose(large.targets / factor, small.targets, rtol=0.0, atol=1e-5)


@FEW
@given(st.integers(0, 10**6))
def test_the_order_of_the_targets_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    ranges = measured(*scene(7, 12, seed), seed)
    order = rng.permutation(12)
    first, second = unfold(ranges, SIGMA), unfold(ranges[:, order], SIGMA)
    np.testing.assert_allclose(first.targets[order], second.targets, rtol=0.0, atol=1e-5)


@FEW
@given(st.integers(0, 10**6))
def test_the_axes_are_those_that_are_stated(seed):
    found = check(*scene(12, 20, seed), seed, within=0.1)
    np.testing.assert_allclose(found.stations.mean(axis=0), 0.0, atol=1e-9)
    spread = found.stations.T @ found.stations
    np.testing.assert_allclose(spread, np.diag(np.diag(spread)), atol=1e-6 * spread[0, 0])
    assert spread[0, 0] >= spread[1, 1] >= spread[2, 2]
    assert found.targets[:, 2].mean() > 0.0
    assert found.stations[0, 0] > 0.0
    a, b, c = found.stations[:3, :2]
    assert (b - a)[0] * (c - a)[1] > (b - a)[1] * (c - a)[0]


@pytest.mark.parametrize(("s", "t", "within"), [(18, 100, 0.02), (7, 12, 0.3)])
@pytest.mark.parametrize("missing", [0.0, 0.1])
def test_stations_in_one_plane_put_all_targets_on_one_side_and_say_so(s, t, within, missing):
    found = check(*scene(s, t, 3, height=0.0), 3, missing=missing if s > 7 else 0.0, within=within)
    assert found.side_assumed[s:].all()
    assert not found.side_assumed[:s].any()
    assert np.all(found.targets[:, 2] > 0.0)


def test_targets_in_one_plane_put_all_stations_on_one_side():
    stations, targets = scene(12, 40, 5, target_height=0.0)
    stations[:, 2] = np.abs(stations[:, 2]) + 5.0
    found = check(stations, targets, 5, within=0.1)
    assert found.side_assumed[:12].all()
    assert not found.side_assumed[12:].any()


def test_stations_nearly_in_a_plane_decide_the_sides_as_soon_as_the_ranges_can():
    found = check(*scene(10, 40, 2, height=1.0), 2, within=0.1)
    assert not found.side_assumed.any()


@pytest.mark.parametrize(("s", "t", "within"), [(6, 8, 0.02), (4, 4, 0.05), (18, 60, 0.01)])
@pytest.mark.parametrize("seed", range(2))
def test_coplanar_points_give_a_planar_figure(s, t, within, seed):
    found = check(*scene(s, t, seed, height=0.0, target_height=0.0), seed, within=within)
    assert not np.any(found.targets[:, 2])
    assert not np.any(found.stations[:, 2])


@pytest.mark.parametrize(
    ("s", "t", "words"),
    [(3, 9, "too few ranges: 27 between 3 stations and 9 targets"), (4, 5, "too few ranges"), (2, 2, "too few ranges")],
)
def test_too_few_ranges_are_a_status_with_their_number(s, t, words):
    found = unfold(measured(*scene(s, t, 1), 1), SIGMA)
    assert words in found.status
    assert np.isnan(found.stations).all()


def test_figures_that_fit_least_numbers_equally_well_are_not_chosen_between():
    found = unfold(measured(*scene(5, 5, 0), 0), SIGMA)
    assert "different figures fit 5 stations and 5 targets" in found.status


def test_five_stations_in_a_plane_are_too_few_for_targets_off_it():
    found = unfold(measured(*scene(5, 8, 1, height=0.0), 1), SIGMA)
    assert found.status.startswith("not unfolded")
    assert "plane" in found.status


def test_stations_on_a_circle_in_a_plane_let_the_figure_bend():
    stations, targets = scene(12, 40, 1, height=0.0)
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    stations = 100 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    found = unfold(measured(stations, targets, 1), SIGMA)
    assert found.status.startswith("not unfolded")


def test_stations_in_a_line_leave_the_targets_turning():
    stations, targets = scene(10, 20, 1)
    stations = np.outer(stations[:, 0], [1.0, 0.5, 0.1])
    assert "on one line" in unfold(measured(stations, targets, 1), SIGMA).status


def test_a_zero_of_the_rangers_shows_as_a_misfit_that_is_named():
    found = unfold(measured(*scene(12, 30, 1), 1) + 0.5, SIGMA)
    assert "where 0.001 m is expected" in found.status


def test_a_range_that_is_negative_or_a_sigma_of_zero_is_refused():
    ranges = measured(*scene(6, 10, 1), 1)
    with pytest.raises(ValidityError, match="positive"):
        unfold(ranges, 0.0)
    ranges[2, 3] = -1.0
    with pytest.raises(ValidityError, match="-1 m"):
        unfold(ranges, SIGMA)


def test_a_point_with_too_few_ranges_is_left_out_and_the_rest_found():
    stations, targets = scene(12, 30, 4)
    ranges = measured(stations, targets, 4)
    ranges[3:, 7] = np.nan  # target 7 is seen three times only
    found = unfold(ranges, SIGMA)
    assert found.outcome is FigureOutcome.UNFOLDED
    assert np.isnan(found.targets[7]).all()
    rest = np.delete(np.arange(30), 7)
    assert apart(np.vstack([found.stations, found.targets[rest]]), np.vstack([stations, targets[rest]])) < 0.05


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 10**6), st.integers(4, 12))
def test_complete_distances_give_their_points_back(seed, n):
    true = np.random.default_rng(seed).uniform(-50, 50, (n, 3))
    xyz, values = classical_scaling(np.linalg.norm(true[:, None] - true, axis=2))
    assert apart(xyz, true) < 1e-6
    assert np.all(np.abs(values[3:]) < 1e-9 * values[0])


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 10**6), st.integers(4, 10))
def test_a_point_is_located_where_its_ranges_to_anchors_meet(seed, n):
    rng = np.random.default_rng(seed)
    anchors, point = rng.uniform(-50, 50, (n, 3)), rng.uniform(-60, 60, (6, 3))
    ranges = np.linalg.norm(point[:, None] - anchors, axis=2)
    ranges[:3, 4:] = np.nan
    xyz, rms = locate(anchors, ranges)
    np.testing.assert_allclose(np.linalg.norm(xyz[:, 0, None] - anchors, axis=2)[:, :4], ranges[:, :4], atol=1e-5)
    assert np.all(rms[:, 0] <= rms[:, 1])


def test_three_anchors_give_both_mirror_images_and_two_none():
    anchors = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0.0]])
    xyz, rms = locate(anchors, np.linalg.norm(anchors - [3.0, 4.0, 5.0], axis=1)[None])
    np.testing.assert_allclose(sorted(xyz[0].tolist()), [[3, 4, -5], [3, 4, 5]], atol=1e-9)
    assert np.all(rms < 1e-9)
    assert np.isnan(locate(anchors, np.array([[5.0, 9.0, np.nan]]))[0]).all()
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 0, 0]])
    assert np.isnan(locate(line, np.linalg.norm(line - [1.0, 2.0, 0.0], axis=1)[None])[0]).all()


@draws(60)
def test_the_residuals_of_an_unfolded_figure_are_those_of_the_noise_over_many_draws(runs):
    """rms^2 / sigma^2 is chi-square over its S T - 3 (S + T) + 6 degrees of freedom: mean within 4 standard errors."""
    stations, targets = scene(8, 14, 6)
    degrees = 8 * 14 - 3 * 22 + 6
    rms2 = [unfold(measured(stations, targets, k), SIGMA).rms ** 2 for k in range(runs)]
    assert abs(np.mean(rms2) / SIGMA**2 - 1.0) < 4 * np.sqrt(2 / degrees / runs)


def test_the_upgrade_descends_to_the_true_map_from_one_that_is_a_tenth_off():
    """Exact ranges: the least squares of all ranges that follows would hide a wrong derivative here."""
    stations, targets = scene(6, 9, 2)
    stations, targets = stations / 100, targets / 100
    stations = stations - stations.mean(axis=0)
    squares = np.sum((stations[:, None] - targets) ** 2, axis=2)
    a = np.array([[[0.9, 0.2, -0.1], [0.0, 0.7, 0.3], [0.0, 0.0, 0.4]]])
    u, b = np.linalg.solve(a[0], stations.T).T, targets.mean(axis=0)
    v = (targets - b) @ a[0]
    additive = squares + 2 * u @ v.T
    means = (u, v, additive.mean(axis=1), additive.mean(axis=0))
    found, offset, cost = match_means(a * 1.1, b[None] * 0.9, means)
    assert cost[0] < 1e-12
    np.testing.assert_allclose(np.abs(found), np.abs(a), atol=1e-5)
    np.testing.assert_allclose(np.abs(offset[0]), np.abs(b), atol=1e-5)


@pytest.mark.slow
def test_eighteen_stations_and_two_thousand_targets_come_out_with_a_third_of_the_ranges_missing():
    check(*scene(18, 2209, 9), 9, missing=0.33, within=0.03)


@pytest.mark.parametrize("seed", range(4))
def test_a_target_that_three_stations_see_joins_the_side_of_the_others(seed):
    """Stations within 0.3 m of a plane tell the side of targets that all of them see, not of one that three see."""
    stations, targets = scene(10, 40, seed, height=0.3)
    ranges = measured(stations, targets, seed)
    ranges[[0, 1, 4, 5, 6, 7, 9], 11] = np.nan
    found = unfold(ranges, SIGMA)
    assert found.outcome is FigureOutcome.UNFOLDED
    assert found.side_assumed[10 + 11]
    assert not found.side_assumed[10:21].any()
    assert np.all(found.targets[:, 2] > 0.0)
    assert apart(np.vstack([found.stations, found.targets]), np.vstack([stations, targets])) < 0.5


def test_many_points_are_located_block_by_block_as_one_by_one():
    stations, targets = scene(12, 2000, 3)
    ranges = measured(stations, targets, 3).T
    xyz, rms = locate(stations, ranges)
    assert ranges.size > 20_000
    for k in (0, 1665, 1666, 1667, 1999):  # about the seam
        one = locate(stations, ranges[k][None])
        np.testing.assert_allclose(xyz[k], one[0][0], rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(rms[k], one[1][0], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(xyz[:, 0], targets, rtol=0.0, atol=0.02)


def test_five_coplanar_stations_are_refused_with_the_number_needed():
    found = unfold(measured(*scene(5, 5, 3, height=0.0), 3), SIGMA)
    assert "5 stations or 5 targets lie in one plane, where at least 6 are needed" in found.status
