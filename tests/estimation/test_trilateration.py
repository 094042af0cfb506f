"""Positions from known stations: against mpmath, scipy, an independently adjusted network, and scatter."""

import csv
from itertools import pairwise
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.stats import chi2, kstest

from catseye.errors import EstimationError, InputError
from catseye.estimation import trilateration
from catseye.estimation.trilateration import (
    CAP,
    Status,
    positions,
    trilaterate,
    trilaterate_by_averaging,
    trilateration_covariance,
)

NETWORK = Path(__file__).parents[1] / "vectors" / "networks" / "ranging-18x500"
UP = np.array([0.0, 0.0, 1.0])
seeds = st.integers(0, 2**32 - 1)


def apart(a, b):
    return np.linalg.norm(a - b, axis=-1)


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


def triangle(rng, *batch):
    """Three stations of a healthy triangle, and a target well off its plane on either side."""
    s = np.array([[0.0, 0, 0], [80, 0, 0], [20, 70, 0]]) + rng.uniform(-10, 10, (*batch, 3, 3))
    n = np.cross(s[..., 1, :] - s[..., 0, :], s[..., 2, :] - s[..., 0, :])
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    height = rng.uniform(10, 90, batch) * rng.choice([-1.0, 1.0], batch)
    return s, s.mean(axis=-2) + rng.uniform(-30, 30, (*batch, 1)) * (s[..., 0, :] - s[..., 1, :]) / 80 + (
        height[..., None] * n
    )


def hall(seed, t=40, *, s=18, flat=0.1, sigma=5e-5):
    """Stations round a hall, targets above them, ranges with noise."""
    rng = np.random.default_rng(seed)
    stations = rng.uniform(-60, 60, (s, 3)) * [1, 1, flat]
    targets = rng.uniform(-40, 40, (t, 3)) + 60 * UP
    return stations, targets, apart(targets[:, None], stations) + sigma * rng.normal(size=(t, s))


# --- three ranges, closed form ---


@given(seeds)
def test_both_points_are_at_the_three_distances_and_the_first_is_on_the_right_hand_side(seed):
    rng = np.random.default_rng(seed)
    s, x = triangle(rng, 5)
    d = apart(x[:, None], s)
    both = trilaterate(s, d)
    assert (both.status == Status.FOUND).all()
    np.testing.assert_allclose(apart(both.x[:, :, None], s[:, None]), np.repeat(d[:, None], 2, axis=1), atol=1e-11)
    assert (np.min(apart(both.x, x[:, None]), axis=1) < 1e-11).all()
    n = np.cross(s[:, 1] - s[:, 0], s[:, 2] - s[:, 0])
    above = np.sum((both.x[:, 0] - s[:, 0]) * n, axis=1) / np.linalg.norm(n, axis=1)
    np.testing.assert_allclose(above, both.height, atol=1e-11)
    assert (above > 9).all()
    exchanged = trilaterate(s[:, [1, 0, 2]], d[:, [1, 0, 2]])
    np.testing.assert_allclose(exchanged.x, both.x[:, ::-1], atol=1e-11)


def test_the_closed_form_keeps_the_digits_that_the_geometry_leaves():
    """Against 60-digit arithmetic on the same doubles; a triangle 1e-4 thin loses four digits and no more."""
    rng = np.random.default_rng(3)
    for thin in (1.0, 1e-2, 1e-4):
        s = np.array([[0.0, 0, 0], [100, 0, 0], [50, 100 * thin, 0]]) @ rotation(rng).T + [300, -200, 50]
        x = s.mean(axis=0) + rng.normal(size=3) * 40
        d = apart(x, s)
        with mpmath.workdps(60):
            exact = [mpmath.matrix([mpmath.mpf(float(v)) for v in row]) for row in s]
            at = mpmath.findroot(
                lambda *p, e=exact, d=d: [
                    mpmath.norm(mpmath.matrix(p) - a) - mpmath.mpf(float(r)) for a, r in zip(e, d, strict=True)
                ],
                tuple(float(v) for v in x),
            )
        answer = trilaterate(s, d).x
        worst = min(max(abs(float(at[k] - mpmath.mpf(float(p[k])))) for k in range(3)) for p in answer)
        assert worst < 1e-12 / thin


def test_ranges_that_do_not_meet_say_by_how_much():
    s = np.array([[0.0, 0, 0], [60, 0, 0], [0, 80, 0]])
    short = trilaterate(s, np.array([40.0, 40, 40]))  # the centre of the circle through them is 50 m from each
    assert short.status == Status.DISJOINT
    np.testing.assert_allclose(short.misclosure, 10.0, rtol=1e-12)
    assert np.isnan(short.x).all()
    long = trilaterate(s, np.array([200.0, 30, 90]))  # one sphere holds another: no triangle inequality
    assert long.status == Status.DISJOINT
    mended = trilaterate(s, np.array([200.0, 30, 90]) + long.misclosure * (1 + 1e-9))
    assert mended.status == Status.FOUND
    assert mended.height < 0.1
    assert (trilaterate(s, np.array([50.0, 50, 50.0])).height == 0.0).all()  # touching, to rounding


def test_stations_on_a_line_and_impossible_numbers_have_their_status():
    line = np.array([[0.0, 0, 0], [1, 2, 3], [3, 6, 9]])
    x = np.array([5.0, 1, 1])
    assert trilaterate(line, apart(x, line)).status == Status.COLLINEAR
    assert trilaterate(line * 1e-9, apart(x, line) * 1e-9).status == Status.COLLINEAR
    s = np.array([[0.0, 0, 0], [60, 0, 0], [0, 80, 0]])
    wrong = trilaterate(s, np.array([[-50.0, 60, 60], [np.nan, 60, 60], [np.inf, 60, 60], [60, 60, 60]]))
    assert wrong.status.tolist() == [Status.REFUSED] * 3 + [Status.FOUND]
    assert np.isnan(wrong.x[:3]).all()
    assert np.isfinite(wrong.x[3]).all()
    with pytest.raises(InputError, match=r"\(\.\.\., 3, 3\)"):
        trilaterate(s[:2], np.array([1.0, 2, 3]))


def test_covariance_of_three_ranges_is_what_derivatives_by_differences_give():
    """All 12 inputs moved one by one through the closed form: signs and both layouts of the stations' covariance."""
    rng = np.random.default_rng(5)
    s, x = triangle(rng)
    d = apart(x, s)
    image = int(apart(trilaterate(s, d).x[1], x) < 1e-6)
    columns = []
    for k in range(12):
        step = np.zeros(12)
        step[k] = 1e-4
        ends = [trilaterate(s + sign * step[:9].reshape(3, 3), d + sign * step[9:]).x[image] for sign in (1.0, -1.0)]
        columns.append((ends[0] - ends[1]) / 2e-4)
    jacobian = np.array(columns).T
    a = rng.normal(size=(9, 9)) * 1e-4
    joint, u = a @ a.T, np.array([1e-4, 2e-4, 3e-4])
    full = np.zeros((12, 12))
    full[:9, :9], full[9:, 9:] = joint, np.diag(u**2)
    expected = jacobian @ full @ jacobian.T
    got = trilateration_covariance(s, x, u_distances=u, station_covariance=joint)
    np.testing.assert_allclose(got, expected, atol=1e-6 * np.abs(expected).max())
    blocks = np.stack([joint[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(3)])
    apart_ = np.zeros((9, 9))
    for i in range(3):
        apart_[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = blocks[i]
    np.testing.assert_allclose(
        trilateration_covariance(s, x, u_distances=u, station_covariance=blocks),
        trilateration_covariance(s, x, u_distances=u, station_covariance=apart_),
        rtol=1e-12,
    )
    in_plane = np.array([[0.0, 0, 0], [60, 0, 0], [0, 80, 0]])
    assert np.isnan(trilateration_covariance(in_plane, np.array([20.0, 20, 0]), u_distances=u)).all()
    with pytest.raises(InputError, match="station_covariance"):
        trilateration_covariance(s, x, u_distances=u, station_covariance=np.eye(3))


# --- three ranges, the notes' iteration ---


def solve_3_7(s, d, r):
    """Eq. 3.7 as printed, by a general solver."""
    return np.linalg.solve(r - s, d**2 - np.sum(s * s, axis=1) + s @ r)


@given(seeds)
def test_the_average_of_old_and_new_is_a_newton_step_and_its_error_obeys_herons_rule(seed):
    rng = np.random.default_rng(seed)
    s, x = triangle(rng)
    d = apart(x, s)
    r = x + rng.normal(size=3) * 3
    step = np.linalg.solve(2 * (r - s), d**2 - np.sum((r - s) ** 2, axis=1))  # Newton for |r - s|^2 = d^2
    once = trilaterate_by_averaging(s, d, r, iterations=1)
    np.testing.assert_allclose(once.x, r + step, atol=1e-10)
    np.testing.assert_allclose((r + solve_3_7(s, d, r)) / 2, r + step, atol=1e-10)
    n = np.cross(s[1] - s[0], s[2] - s[0])
    n /= np.linalg.norm(n)
    height, target = (r - s[0]) @ n, (x - s[0]) @ n
    np.testing.assert_allclose(once.x - x, n * np.sum((r - x) ** 2) / (2 * height), atol=1e-10)
    twice = trilaterate_by_averaging(s, d, r, iterations=2)
    h = (once.x - s[0]) @ n
    np.testing.assert_allclose((twice.x - s[0]) @ n, (h + target**2 / h) / 2, atol=1e-10)


def test_the_iteration_without_the_average_flips_its_error_and_does_not_settle():
    rng = np.random.default_rng(8)
    s, x = triangle(rng)
    d = apart(x, s)
    r = x + np.array([1e-3, -2e-3, 1e-3])
    new = solve_3_7(s, d, r)
    np.testing.assert_allclose(new - x, -(r - x), atol=1e-6)
    old = r
    for _ in range(20):
        r = solve_3_7(s, d, r)
    assert apart(r, x) > 0.5 * apart(old, x)


@given(seeds)
def test_the_iteration_ends_at_the_closed_forms_point_on_the_side_of_its_start(seed):
    rng = np.random.default_rng(seed)
    s, x = triangle(rng, 6)
    d = apart(x[:, None], s)
    both = trilaterate(s, d)
    n = np.cross(s[:, 1] - s[:, 0], s[:, 2] - s[:, 0])
    start = s.mean(axis=1) + rng.uniform(0.1, 100, (6, 1)) * n / np.linalg.norm(n, axis=1, keepdims=True)
    found = trilaterate_by_averaging(s, d, start)
    assert (found.status == Status.FOUND).all()
    np.testing.assert_allclose(found.x, both.x[:, 0], atol=1e-9)
    assert (found.iterations < 25).all()  # from 0.1 m to 100 m Heron halves ten times, then squares


def test_convergence_is_of_second_order():
    s = np.array([[0.0, 0, 0], [60, 0, 0], [0, 80, 0]])
    x = np.array([20.0, 20, 50])
    errors = [apart(trilaterate_by_averaging(s, apart(x, s), x + 20 * UP, iterations=k).x, x) for k in (1, 2, 3)]
    for before, after in pairwise(errors):
        assert after == pytest.approx(before**2 / (2 * (50 + before)), rel=1e-6)


def test_the_iteration_at_its_cap_and_from_the_plane_says_so():
    s = np.array([[0.0, 0, 0], [60, 0, 0], [0, 80, 0]])
    start = np.array([[20.0, 20, 50], [20, 20, 0]])
    got = trilaterate_by_averaging(s, np.array([[40.0, 40, 40], [60, 60, 60]]), start)
    assert got.status.tolist() == [Status.NOT_CONVERGED, Status.NOT_HELD]
    assert got.iterations.tolist() == [50, 1]
    assert got.difference[0] > 1e-9
    assert np.isnan(got.x[1]).all()


# --- many ranges ---


def by_scipy(stations, d, u, start):
    seen = ~np.isnan(d)
    fit = least_squares(
        lambda p: (apart(p, stations[seen]) - d[seen]) / u[seen],
        start,
        jac=lambda p: (p - stations[seen]) / (apart(p, stations[seen]) * u[seen])[:, None],
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    return fit.x, np.linalg.inv(fit.jac.T @ fit.jac), 2 * fit.cost


@pytest.mark.parametrize("compiled", [False, True])
def test_weighted_positions_with_missing_ranges_are_scipys(compiled):
    stations, targets, d = hall(1)
    rng = np.random.default_rng(2)
    d[rng.random(d.shape) < 0.3] = np.nan
    u = rng.uniform(3e-5, 3e-4, d.shape)
    got = positions(stations, d, u, compiled=compiled).require_found()
    for t in range(len(d)):
        x, c, pvv = by_scipy(stations, d[t], u[t], targets[t])
        np.testing.assert_allclose(got.x[t], x, atol=1e-9)
        np.testing.assert_allclose(got.covariance[t], c, atol=1e-4 * np.abs(c).max())
        assert got.pvv[t] == pytest.approx(pvv, rel=1e-5)
    assert got.degrees_of_freedom.tolist() == (np.sum(~np.isnan(d), axis=1) - 3).tolist()


@pytest.mark.parametrize("compiled", [False, True])
def test_targets_of_an_adjusted_network_are_found_again_from_its_stations(compiled):
    """At the optimum of the whole network the targets are optimal for its stations: an independent solver's answer."""

    def table(name):
        with open(NETWORK / name, encoding="utf-8") as file:
            return list(csv.DictReader(file))

    points = {row["point"]: [float(row[k]) for k in "xyz"] for row in table("expected.csv")}
    ranges = table("ranges.csv")
    from_, to = sorted({r["from"] for r in ranges}), sorted({r["to"] for r in ranges})
    d, u = np.full((2, len(to), len(from_)), np.nan)
    row, column = {n: i for i, n in enumerate(to)}, {n: i for i, n in enumerate(from_)}
    for r in ranges:
        d[row[r["to"]], column[r["from"]]], u[row[r["to"]], column[r["from"]]] = float(r["distance"]), float(r["sigma"])
    got = positions(np.array([points[n] for n in from_]), d, u, compiled=compiled).require_found()
    assert np.abs(got.x - np.array([points[n] for n in to])).max() < 3e-9
    assert got.pvv.sum() == pytest.approx(7362.7388, abs=1e-4)


def awkward():
    """One chunk with a target of every kind, whose statuses are known by construction."""
    stations, targets, d = hall(4, 12, s=8, flat=0.2)
    stations[:4] = [[-60, -60, 0], [60, -60, 0], [60, 60, 0], [-60, 60, 0]]  # a square: coplanar
    stations[4] = [0, 0, 0]  # in line with its diagonals
    d = apart(targets[:, None], stations)
    d[1, 2:] = np.nan  # two ranges
    d[2, [1, 3, 5, 6, 7]] = np.nan  # a diagonal: one line
    d[3, 4:] = np.nan  # the square alone: mirror images
    d[4, 0] += 1.0  # a blunder among eight
    d[5] = apart(np.array([10.0, 20, 0]), stations)
    d[5, 5:] = np.nan  # a target in the plane of the square
    d[6, 3:] = np.nan
    d[6, :3] = [60, 60, 60]  # three short ranges
    d[7, 0] = -1.0
    d[8, 0] = np.inf
    d[9] = np.nan
    d[10] = apart(stations[0] + [2e-5, 0, 0], stations)
    d[10, 5:] = np.nan
    expected = [
        Status.FOUND, Status.TOO_FEW, Status.COLLINEAR, Status.AMBIGUOUS, Status.CONTRADICTING, Status.NOT_HELD,
        Status.DISJOINT, Status.REFUSED, Status.REFUSED, Status.TOO_FEW, Status.AT_STATION, Status.FOUND,
    ]  # fmt: skip
    return stations, targets, d, np.full(8, 5e-5), expected


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("scale", [1.0, 2.0**-20, 2.0**20])
def test_every_kind_of_trouble_ends_in_its_status_at_any_scale(compiled, scale):
    stations, targets, d, u, expected = awkward()
    got = positions(stations * scale, d * scale, u * scale, compiled=compiled)
    assert [Status(s).name for s in got.status] == [s.name for s in expected]
    answered = got.status <= Status.CONTRADICTING
    assert np.isfinite(got.x[answered]).all()
    assert np.isfinite(got.covariance[answered]).all()
    assert np.isnan(got.x[~answered]).all()
    assert np.isnan(got.covariance[~answered]).all()
    np.testing.assert_allclose(got.x[[0, 11]] / scale, targets[[0, 11]], atol=1e-10)


def test_the_status_in_words_says_what_and_how_much():
    stations, _, d, u, _ = awkward()
    got = positions(stations, d, u)
    assert "seen by 2 ranges only" in got.text(1)
    assert "one line" in got.text(2)
    assert "`near`" in got.text(3)
    assert "its 8 ranges contradict" in got.text(4)
    assert "one plane" in got.text(5)
    assert "do not meet" in got.text(6)
    assert got.ranges.tolist() == [8, 2, 3, 4, 8, 5, 3, 8, 8, 0, 5, 8]
    with pytest.raises(EstimationError, match=r"target 1 \(10 of 12 likewise\): seen by 2 ranges only"):
        got.require_found()


@given(seeds)
def test_near_takes_the_image_on_its_side_of_coplanar_stations(seed):
    rng = np.random.default_rng(seed)
    turn, shift = rotation(rng), rng.normal(size=3) * 100
    flat = rng.uniform(-50, 50, (5, 3)) * [1, 1, 0]
    local = rng.uniform(-20, 20, (4, 3)) + 40 * UP
    stations, above, below = (a @ turn.T + shift for a in (flat, local, local * [1, 1, -1]))
    d = apart(above[:, None], stations)
    u = np.full(5, 1e-4)
    for compiled in (False, True):
        assert (positions(stations, d, u, compiled=compiled).status == Status.AMBIGUOUS).all()
        for x in (above, below):
            got = positions(stations, d, u, near=x.mean(axis=0), compiled=compiled).require_found()
            np.testing.assert_allclose(got.x, x, atol=1e-9)
        mixed = np.where(np.arange(4)[:, None] % 2 == 0, above, below)
        got = positions(stations, d, u, near=mixed, compiled=compiled).require_found()
        np.testing.assert_allclose(got.x, mixed, atol=1e-9)
        mixed[2] = np.nan
        got = positions(stations, d, u, near=mixed, compiled=compiled)
        assert got.status.tolist() == [Status.FOUND, Status.FOUND, Status.AMBIGUOUS, Status.FOUND]


@pytest.mark.parametrize("compiled", [False, True])
def test_nearly_coplanar_stations_tell_the_side_when_they_can_and_say_so_when_they_cannot(compiled):
    """A metre of relief tells it; below what noise allows some are AMBIGUOUS, but none is found on the wrong side."""
    counts = {}
    for relief in (1e-6, 3e-4, 1e-2, 1.0):
        stations, targets, _ = hall(6, 300, s=6, flat=relief / 60)
        d = apart(targets[:, None], stations) + 5e-5 * np.random.default_rng(1).normal(size=(300, 6))
        got = positions(stations, d, np.full(6, 5e-5), compiled=compiled)
        assert np.isin(got.status, [Status.FOUND, Status.AMBIGUOUS]).all()
        found = got.status == Status.FOUND
        assert (apart(got.x[found], targets[found]) < 0.01).all()
        counts[relief] = int(found.sum())
    assert counts[1e-6] == 0
    assert 0 < counts[3e-4] < 300
    assert counts[1.0] == 300


@pytest.mark.parametrize("compiled", [False, True])
def test_the_closed_form_starts_at_the_answer(compiled):
    """Without noise one step sees that nothing is left to do: flat, tilted and deep figures of stations."""
    for flat in (0.05, 0.3, 1.0):
        stations, targets, d = hall(17, 64, flat=flat, sigma=0.0)
        turn = rotation(np.random.default_rng(17))
        got = positions(stations @ turn.T, d, np.full(18, 5e-5), compiled=compiled).require_found()
        np.testing.assert_allclose(got.x, targets @ turn.T, atol=1e-10)
        assert got.iterations.tolist() == [1] * 64


@pytest.mark.parametrize("compiled", [False, True])
def test_a_negative_range_is_refused_even_where_its_sigma_would_excuse_it(compiled):
    stations, _, _ = hall(18, 1)
    x = stations[0] + [0.3, 0.0, 0.4]
    d = np.repeat(apart(x, stations)[None], 2, axis=0)
    d[1, 0] = -0.1
    u = np.where(np.arange(18) == 0, 1.0, 5e-5)
    assert positions(stations, d, u, compiled=compiled).status.tolist() == [Status.FOUND, Status.REFUSED]


def test_a_wrong_near_does_not_overrule_ranges_that_know_better():
    stations, targets, d = hall(7)
    got = positions(stations, d, np.full(18, 5e-5), near=np.array([0.0, 0, -1e3])).require_found()
    assert (apart(got.x, targets) < 1e-3).all()


def test_compiled_and_plain_forms_give_the_same():
    stations, _, d = hall(9, 500)
    d[np.random.default_rng(1).random(d.shape) < 0.02] = np.nan
    for u in (np.full(18, 5e-5), np.random.default_rng(2).uniform(3e-5, 9e-5, d.shape)):
        plain, fast = (positions(stations, d, u, compiled=c) for c in (False, True))
        assert plain.status.tolist() == fast.status.tolist()
        np.testing.assert_allclose(fast.x, plain.x, atol=2e-11)
        scale = np.sqrt(np.einsum("tii->ti", plain.covariance))
        np.testing.assert_allclose(
            fast.covariance / (scale[:, :, None] * scale[:, None]),
            plain.covariance / (scale[:, :, None] * scale[:, None]),
            atol=1e-4,
        )
        np.testing.assert_allclose(fast.pvv, plain.pvv, rtol=1e-6)


@pytest.mark.parametrize("compiled", [False, True])
def test_chunks_and_threads_do_not_show(compiled, monkeypatch):
    stations, _, d, u, _ = awkward()
    d = np.concatenate([d, d[::-1], d])
    whole = positions(stations, d, u, compiled=compiled)
    monkeypatch.setattr(trilateration, "LANES", 8 * 5)
    monkeypatch.setattr(trilateration, "LANES_COMPILED", 8 * 5)
    for threads in (1, 2):
        parts = positions(stations, d, u, compiled=compiled, threads=threads)
        assert parts.status.tolist() == whole.status.tolist()
        np.testing.assert_allclose(parts.x, whole.x, atol=1e-10)
        np.testing.assert_array_equal(np.isnan(parts.x), np.isnan(whole.x))


@given(seeds)
def test_a_range_more_never_grows_a_covariance_and_order_does_not_matter(seed):
    stations, _, d = hall(seed, 3, s=7, flat=0.5)
    u = np.random.default_rng(seed).uniform(1e-5, 1e-3, 7)
    fewer = d.copy()
    fewer[:, 6] = np.nan
    more, less = positions(stations, d, u).require_found(), positions(stations, fewer, u).require_found()
    smallest = np.linalg.eigvalsh(less.covariance - more.covariance).min(axis=1)
    assert (smallest > -1e-4 * np.trace(less.covariance, axis1=1, axis2=2)).all()  # 1e-4: linearised at two places
    order = np.random.default_rng(seed).permutation(7)
    turned = positions(stations[order], d[:, order], u[order]).require_found()
    np.testing.assert_allclose(turned.x, more.x, atol=1e-9)


@given(seeds)
def test_moving_and_turning_everything_moves_and_turns_the_answer(seed):
    rng = np.random.default_rng(seed)
    stations, _, d = hall(seed, 3, s=6, flat=0.5)
    turn, shift, u = rotation(rng), rng.normal(size=3) * 1e3, np.full(6, 1e-4)
    here, there = positions(stations, d, u), positions(stations @ turn.T + shift, d, u)
    assert here.status.tolist() == there.status.tolist()
    np.testing.assert_allclose(there.x, here.x @ turn.T + shift, atol=1e-8)
    np.testing.assert_allclose(there.covariance, turn @ here.covariance @ turn.T, atol=1e-4 * here.covariance.max())


def test_claimed_covariance_and_pvv_hold_in_scatter():
    """4000 seeded runs of one target: e' C^-1 e is chi-square of 3, pvv of the degrees of freedom."""
    stations, targets, _ = hall(10, 1, s=7, flat=0.2)
    rng = np.random.default_rng(11)
    u = rng.uniform(2e-5, 4e-4, 7)
    d = apart(targets[:, None], stations) + u * rng.normal(size=(4000, 7))
    got = positions(stations, d, u).require_found()
    e = got.x - targets
    assert kstest(np.einsum("ti,tij,tj->t", e, np.linalg.inv(got.covariance), e), chi2(3).cdf).pvalue > 1e-3
    assert kstest(got.pvv, chi2(4).cdf).pvalue > 1e-3


def test_near_the_stations_plane_an_ellipsoid_is_given_only_where_it_holds():
    """Heights from nothing to ten of their own uncertainties: what is FOUND scatters as claimed, the rest says so."""
    stations = np.array([[-60.0, -60, 0], [60, -60, 0], [60, 60, 0], [-60, 60, 0]])
    rng = np.random.default_rng(12)
    unit = np.sqrt(60.0 * 5e-5)  # about where the uncertainty of the height equals it
    share = []
    for height in (0.0, 0.5, 1.0, 3.0, 10.0):
        x = np.array([10.0, 5, height * unit])
        d = apart(x, stations) + 5e-5 * rng.normal(size=(1000, 4))
        got = positions(stations, d, np.full(4, 5e-5), near=np.array([0.0, 0, 9]))
        found = got.status == Status.FOUND
        assert np.isin(got.status[~found], [Status.NOT_HELD]).all()
        share.append(found.mean())
        if height >= 3.0:
            e = got.x[found] - x
            q = np.einsum("ti,tij,tj->t", e, np.linalg.inv(got.covariance[found]), e)
            assert q.mean() == pytest.approx(3.0, abs=0.4)
    assert share[0] < 0.2
    assert share[-1] == 1.0
    assert share == sorted(share)


def test_a_blunder_far_from_convergence_is_no_silent_answer():
    """Ranges exchanged between stations, 200 targets: each is found contradicting or refused an answer."""
    stations, _, d = hall(13, 200, s=6, flat=0.3)
    wrong = d[:, [1, 0, 2, 3, 4, 5]]
    for compiled in (False, True):
        got = positions(stations, wrong, np.full(6, 5e-5), compiled=compiled)
        assert (got.status != Status.FOUND).mean() > 0.98  # a target midway between the two is no blunder
        assert (got.iterations <= CAP).all()


def test_what_cannot_be_positions_is_refused_in_one_line():
    stations, _, d = hall(14, 3)
    u = np.full(18, 5e-5)
    with pytest.raises(InputError, match=r"stations \(18, 3\) and distances \(3, 17\)"):
        positions(stations, d[:, 1:], u)
    with pytest.raises(InputError, match=r"sigma has shape \(3,\)"):
        positions(stations, d, u[:3])
    with pytest.raises(InputError, match=r"sigma of station 4 is 0\.0 m"):
        positions(stations, d, np.where(np.arange(18) == 4, 0.0, u))
    with pytest.raises(InputError, match=r"near has shape \(2,\)"):
        positions(stations, d, u, near=np.zeros(2))
    stations[7, 1] = np.nan
    with pytest.raises(InputError, match="station 7 has no finite coordinates"):
        positions(stations, d, u)
    empty = positions(np.eye(3), np.empty((0, 3)), np.ones(3))
    assert empty.x.shape == (0, 3)


def test_a_sigma_that_is_no_sigma_refuses_its_target_alone():
    stations, _, d = hall(15, 4)
    u = np.full(d.shape, 5e-5)
    u[0, 3], u[1, 3], u[2, 3] = 0.0, np.nan, -5e-5
    d[3, 3], u[3, 3] = np.nan, np.nan  # a missing range needs none
    for compiled in (False, True):
        got = positions(stations, d, u, compiled=compiled)
        assert got.status.tolist() == [Status.REFUSED] * 3 + [Status.FOUND]


@pytest.mark.slow
def test_claimed_covariance_holds_over_a_million_targets():
    rng = np.random.default_rng(16)
    stations = rng.uniform(-60, 60, (18, 3)) * [1, 1, 0.1]
    x = rng.uniform(-40, 40, (1_000_000, 3)) + 60 * UP
    d = apart(x[:, None], stations) + 5e-5 * rng.normal(size=(len(x), 18))
    got = positions(stations, d, np.full(18, 5e-5)).require_found()
    e = got.x - x
    q = np.einsum("ti,tij,tj->t", e, np.linalg.inv(got.covariance), e)
    assert q.mean() == pytest.approx(3.0, abs=5 * np.sqrt(6 / len(x)))
    assert got.pvv.mean() == pytest.approx(15.0, abs=5 * np.sqrt(30 / len(x)))
