"""The search for whole cycles across a network, against a grid over all space and against closed forms."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from catseye.errors import InputError, ValidityError
from catseye.estimation.ambiguity.search import AmbiguityLimits, AmbiguityStatus, locate
from catseye.estimation.ambiguity.tree import Ranged, _next_cycles, _points

HALF = 0.0999


def stations_about(rng, ranges, near=50.0, far=120.0):
    """Rangers below and around a point at the origin."""
    away = rng.normal(size=(ranges, 3))
    away[:, 2] = -np.abs(away[:, 2])
    return away / np.linalg.norm(away, axis=1)[:, None] * rng.uniform(near, far, (ranges, 1))


def ranged(stations, point, noise=0.0):
    return np.mod(np.linalg.norm(stations - point, axis=1) + noise, HALF)


def by_grid(u, stations, lengths, sigma, reach=4.5, step=0.006):
    """Best and second best place by looking everywhere: nothing linear, no integers enumerated.

    Chi-square with the nearest integers on a grid over the prior, the lowest cells refined by scipy's least squares
    with their integers held.
    """
    axis = np.arange(-reach * u, reach * u, step)
    x = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    distance = np.linalg.norm(x[:, None] - stations, axis=2)
    n = np.rint((distance - lengths) / HALF)
    cost = np.sum(((lengths + n * HALF - distance) / sigma) ** 2, axis=1) + np.sum((x / u) ** 2, axis=1)
    found = {}
    for i in np.argsort(cost)[:4000]:
        key = tuple(n[i].astype(int))
        if key in found or len(found) > 60:
            continue

        def misses(at, key=key):
            miss = lengths + np.array(key) * HALF - np.linalg.norm(stations - at, axis=1)
            return np.append(miss / sigma, at / u)

        best = least_squares(misses, x[i], xtol=1e-14, ftol=1e-14, gtol=1e-14)
        found[key] = (2.0 * best.cost, best.x)
    return sorted(((cost, key, at) for key, (cost, at) in found.items()), key=lambda v: v[0])[:2]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_search_matches_exhaustive_enumeration(seed):
    rng = np.random.default_rng(seed)
    u, sigma, ranges = 0.06, 0.004, 4 + seed % 2  # so noisy that the grid sees every basin, and the second is near
    stations = stations_about(rng, ranges)
    lengths = ranged(stations, u * rng.standard_normal(3), sigma * rng.standard_normal(ranges))
    best, second = by_grid(u, stations, lengths, sigma)
    mine = locate(
        np.zeros(3), u**2 * np.eye(3), stations, lengths=lengths, period=HALF, covariance=np.full(ranges, sigma**2)
    )
    assert tuple(mine.cycles) == best[1]
    assert mine.chi_square == pytest.approx(best[0], abs=1e-4)
    np.testing.assert_allclose(mine.x, best[2], rtol=0, atol=2e-5)
    assert mine.discrimination == pytest.approx(second[0] - best[0], abs=1e-4)
    np.testing.assert_allclose(mine.next_x, second[2], rtol=0, atol=2e-5)


def test_half_a_metre_off_the_geometry_is_no_longer_linear_and_the_search_does_not_mind():
    rng = np.random.default_rng(11)
    stations = stations_about(rng, 7, 50.0, 60.0)
    point = np.array([1.1, -0.9, 0.8])  # 1.6 m: 3.3 sigma
    found = locate(
        np.zeros(3),
        0.25 * np.eye(3),
        stations,
        lengths=ranged(stations, point),
        period=HALF,
        covariance=np.full(7, 1e-8),
    )
    assert found.status is AmbiguityStatus.FOUND
    np.testing.assert_allclose(found.x, point, rtol=0, atol=1e-7)
    e = -stations / np.linalg.norm(stations, axis=1)[:, None]
    linear = np.linalg.norm(stations, axis=1) + e @ point
    assert np.abs(linear - np.linalg.norm(stations - point, axis=1)).max() > 0.01  # some 300 standard uncertainties
    assert found.candidates > 10_000


def test_the_covariance_is_that_of_prior_and_ranges():
    rng = np.random.default_rng(12)
    stations = stations_about(rng, 6)
    c = np.diag(rng.uniform(1e-9, 4e-9, 6)) + 4e-9  # a zero that all share
    found = locate(
        np.zeros(3), 0.01 * np.eye(3), stations, lengths=ranged(stations, np.full(3, 0.05)), period=HALF, covariance=c
    )
    e = (found.x - stations) / np.linalg.norm(found.x - stations, axis=1)[:, None]
    expected = np.linalg.inv(e.T @ np.linalg.inv(c) @ e + 100 * np.eye(3))
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-5, atol=1e-14)


def test_the_stations_covariance_acts_along_the_rays():
    rng = np.random.default_rng(13)
    stations = stations_about(rng, 6)
    lengths = ranged(stations, np.full(3, 0.03), 1e-4 * rng.standard_normal(6))
    e = stations / np.linalg.norm(stations, axis=1)[:, None]
    a = rng.normal(size=(6, 3, 3)) * 1e-4
    blocks = a @ np.swapaxes(a, 1, 2)
    whole = np.zeros((18, 18))
    for i, block in enumerate(blocks):
        whole[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = block
    plain = np.full(6, 1e-8)
    by_hand = plain + np.einsum("ia,iab,ib->i", e, blocks, e)
    results = [
        locate(
            np.zeros(3), 0.01 * np.eye(3), stations, lengths=lengths, period=HALF, covariance=c, station_covariance=s
        )
        for c, s in ((plain, blocks), (plain, whole), (by_hand, None))
    ]
    for other in results[1:]:
        assert other.chi_square == pytest.approx(results[0].chi_square, rel=1e-9)
        np.testing.assert_allclose(other.x, results[0].x, rtol=0, atol=1e-12)


def test_further_range_is_predicted_with_its_joint_covariance():
    """Conditions a normal distribution (one value given others), independently of the search."""
    rng = np.random.default_rng(22)
    stations = stations_about(rng, 4)
    root = rng.normal(size=(4, 4)) * 3e-4
    c = root @ root.T + 4e-6  # much of it shared
    prior = 0.02**2 * np.eye(3)
    point = np.array([0.01, -0.02, 0.015])
    lengths = np.linalg.norm(stations - point, axis=1) + np.linalg.cholesky(c) @ rng.standard_normal(4)
    ranged_ = Ranged(np.zeros(3), np.linalg.cholesky(prior), stations, lengths, np.full(4, HALF), np.linalg.cholesky(c))
    three = np.zeros((1, 3))
    x, information, square = _points(ranged_.ordered(np.arange(3)), three, np.zeros((1, 3)))
    cycles, _, floor = _next_cycles(ranged_, 3, three, x, information, square)
    assert cycles.tolist() == [[0.0, 0.0, 0.0, 0.0]]
    away = x[0] - stations  # linear about where the three put the point
    e = away / np.linalg.norm(away, axis=1)[:, None]
    joint = e @ prior @ e.T + c
    off = lengths - (np.linalg.norm(away, axis=1) - e @ x[0])  # about the prior's centre
    gain = joint[3, :3] @ np.linalg.inv(joint[:3, :3])
    surprise = off[3] - gain @ off[:3]
    u = np.sqrt(joint[3, 3] - gain @ joint[:3, 3])
    assert floor == pytest.approx(square[0] + ((HALF - abs(surprise)) / u) ** 2, rel=1e-6)


def test_declared_common_error_causes_no_misfit():
    rng = np.random.default_rng(14)
    stations = stations_about(rng, 7)
    lengths = ranged(stations, np.array([0.1, 0.0, -0.1]), 2e-3)  # a zero 2 mm wrong
    said = 1e-8 * np.eye(7) + 4e-6
    found = locate(np.zeros(3), 0.01 * np.eye(3), stations, lengths=lengths, period=HALF, covariance=said)
    assert found.status is AmbiguityStatus.FOUND
    np.testing.assert_allclose(found.x, [0.1, 0.0, -0.1], rtol=0, atol=2e-3)
    unsaid = locate(np.zeros(3), 0.01 * np.eye(3), stations, lengths=lengths, period=HALF, covariance=np.full(7, 1e-8))
    assert unsaid.status is AmbiguityStatus.MISFIT


def test_one_wrong_range_of_seven_is_named_and_left_out_only_when_asked_for():
    rng = np.random.default_rng(15)
    stations = stations_about(rng, 7)
    point = np.array([0.2, -0.1, 0.15])
    lengths = ranged(stations, point, 5e-5 * rng.standard_normal(7))
    lengths[3] += 0.004
    ask = {"period": HALF, "covariance": np.full(7, 25e-10)}
    plain = locate(np.zeros(3), 0.04 * np.eye(3), stations, lengths=lengths, **ask)
    assert plain.status is AmbiguityStatus.MISFIT
    assert "no whole cycles fit its 7 ranges" in plain.text
    found = locate(np.zeros(3), 0.04 * np.eye(3), stations, lengths=lengths, limits=AmbiguityLimits(wrong=0.01), **ask)
    assert (found.status, found.left_out) == (AmbiguityStatus.FOUND, 3)
    np.testing.assert_allclose(found.x, point, rtol=0, atol=3e-4)
    right = np.rint((np.linalg.norm(stations - point, axis=1) - lengths) / HALF)
    np.testing.assert_array_equal(found.cycles, right)


def test_wrong_range_can_fit_wrong_cycles_unless_declared_possible():
    rng = np.random.default_rng(16)
    stations = stations_about(rng, 5)
    point = np.array([0.2, -0.1, 0.15])
    lengths = ranged(stations, point)
    lengths[0] += 0.004
    ask = {"period": HALF, "covariance": np.full(5, 25e-10)}
    trusting = locate(np.zeros(3), 0.09 * np.eye(3), stations, lengths=lengths, **ask)
    assert trusting.status is AmbiguityStatus.FOUND  # 1.6 m off: why `wrong` exists
    assert np.linalg.norm(trusting.x - point) > 1.0
    careful = locate(
        np.zeros(3), 0.09 * np.eye(3), stations, lengths=lengths, limits=AmbiguityLimits(wrong=0.01), **ask
    )
    assert careful.status is AmbiguityStatus.AMBIGUOUS
    assert careful.probability < 0.9


def test_the_price_of_leaving_a_range_out_is_the_odds_that_it_is_wrong():
    # five good ranges; the rival is another place that fits four of them: sought here without `wrong`
    rng = np.random.default_rng(21)
    stations, sigma, wrong = stations_about(rng, 5), 3e-4, 0.02
    lengths = ranged(stations, np.array([0.1, 0.05, -0.1]), sigma * rng.standard_normal(5))
    ask = {"period": HALF}
    prior = 0.01 * np.eye(3)
    all_five = locate(np.zeros(3), prior, stations, lengths=lengths, covariance=np.full(5, sigma**2), **ask)
    price = 2 * np.log((1 - wrong) / wrong * HALF / (np.sqrt(2 * np.pi) * sigma))
    rivals = [all_five.discrimination]
    for i in range(5):
        some = np.delete(np.arange(5), i)
        four = locate(np.zeros(3), prior, stations[some], lengths=lengths[some], covariance=np.full(4, sigma**2), **ask)
        square = (
            four.chi_square if np.any(four.cycles != all_five.cycles[some]) else four.chi_square + four.discrimination
        )
        rivals.append(square + price - all_five.chi_square)
    found = locate(
        np.zeros(3),
        prior,
        stations,
        lengths=lengths,
        covariance=np.full(5, sigma**2),
        limits=AmbiguityLimits(wrong=wrong),
        **ask,
    )
    assert min(rivals) < all_five.discrimination  # a rival of this kind it is
    assert found.discrimination == pytest.approx(min(rivals), abs=1e-6)
    assert found.probability < all_five.probability
    with pytest.raises(ValidityError, match=r"wrong = 0\.5"):
        locate(
            np.zeros(3),
            prior,
            stations,
            lengths=lengths,
            covariance=np.full(5, sigma**2),
            limits=AmbiguityLimits(wrong=0.5),
            **ask,
        )


@pytest.mark.parametrize("ranges", [1, 2, 3])
def test_fewer_than_four_ranges_are_too_few_unless_the_prior_itself_is_good_enough(ranges):
    rng = np.random.default_rng(17)
    stations = stations_about(rng, ranges)
    ask = {"period": HALF, "covariance": np.full(ranges, 1e-8)}
    lengths = ranged(stations, np.array([0.002, -0.001, 0.003]))
    bad = locate(np.zeros(3), 0.04 * np.eye(3), stations, lengths=lengths, **ask)
    assert bad.status is AmbiguityStatus.TOO_FEW
    assert f"ranged from {ranges} stations only: four are needed" in bad.text
    good = locate(np.zeros(3), 0.005**2 * np.eye(3), stations, lengths=lengths, **ask)
    assert good.status is AmbiguityStatus.FOUND
    np.testing.assert_array_equal(
        good.cycles, np.rint((np.linalg.norm(stations - [0.002, -0.001, 0.003], axis=1) - lengths) / HALF)
    )


def test_a_station_known_to_decimetres_is_the_same_problem():
    rng = np.random.default_rng(18)
    targets = stations_about(rng, 8)
    station = np.array([-0.25, 0.3, 0.1])
    # its own zero, 0.1 mm, is in every range
    found = locate(
        np.zeros(3),
        0.09 * np.eye(3),
        targets,
        lengths=ranged(targets, station, 1e-4),
        period=HALF,
        covariance=25e-10 * np.eye(8) + 1e-8,
    )
    assert found.status is AmbiguityStatus.FOUND
    np.testing.assert_allclose(found.x, station, rtol=0, atol=3e-4)


def test_impossible_searches_have_a_status():
    rng = np.random.default_rng(19)
    stations = stations_about(rng, 6)
    lengths = ranged(stations, np.zeros(3))
    c = np.full(6, 1e-8)
    lost = locate(np.zeros(3), 100.0 * np.eye(3), stations, lengths=lengths, period=HALF, covariance=c)
    assert lost.status is AmbiguityStatus.TOO_MANY
    for broken in (
        {"lengths": np.where(np.arange(6) == 2, np.nan, lengths)},
        {"prior": -np.eye(3)},
        {"period": 0.0},
        {"c": np.zeros(6)},
    ):
        given = {"prior": 0.01 * np.eye(3), "lengths": lengths, "period": HALF, "c": c} | broken
        answer = locate(
            np.zeros(3),
            given["prior"],
            stations,
            lengths=given["lengths"],
            period=given["period"],
            covariance=given["c"],
        )
        assert answer.status is AmbiguityStatus.REFUSED
        assert np.isnan(answer.x).all()
    with pytest.raises(InputError, match=r"start \(2,\)"):
        locate(np.zeros(2), np.eye(3), stations, lengths=lengths, period=HALF, covariance=c)
    with pytest.raises(InputError, match=r"station_covariance has shape \(6, 6\)"):
        locate(
            np.zeros(3), np.eye(3), stations, lengths=lengths, period=HALF, covariance=c, station_covariance=np.eye(6)
        )
