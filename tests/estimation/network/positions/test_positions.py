"""Positions from many ranges: against scipy, an independently adjusted network, and scatter."""

import csv

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.stats import chi2, kstest

from catseye.errors import EstimationError, InputError
from catseye.estimation.network.positions import dispatch as module
from catseye.estimation.network.positions.descent import CAP, Ranges, descend
from catseye.estimation.network.positions.dispatch import positions
from catseye.estimation.network.positions.status import PositionStatus
from draws import draws, examples
from repository import TESTS

NETWORK = TESTS / "vectors" / "networks" / "ranging-18x500"
UP = np.array([0.0, 0.0, 1.0])
seeds = st.integers(0, 2**32 - 1)


def apart(a, b):
    return np.linalg.norm(a - b, axis=-1)


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


def hall(seed, t=40, *, s=18, flat=0.1, sigma=5e-5):
    """Stations round a hall, targets above them, ranges with noise."""
    rng = np.random.default_rng(seed)
    stations = rng.uniform(-60, 60, (s, 3)) * [1, 1, flat]
    targets = rng.uniform(-40, 40, (t, 3)) + 60 * UP
    return stations, targets, apart(targets[:, None], stations) + sigma * rng.normal(size=(t, s))


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
    """Targets of an optimal network are optimal for its stations (independent solver)."""

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
        PositionStatus.FOUND, PositionStatus.TOO_FEW, PositionStatus.COLLINEAR, PositionStatus.AMBIGUOUS,
        PositionStatus.CONTRADICTING, PositionStatus.NOT_HELD,
        PositionStatus.DISJOINT, PositionStatus.REFUSED, PositionStatus.REFUSED,
        PositionStatus.TOO_FEW, PositionStatus.AT_STATION, PositionStatus.FOUND,
    ]  # fmt: skip
    return stations, targets, d, np.full(8, 5e-5), expected


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("scale", [1.0, 2.0**-20, 2.0**20])
def test_every_kind_of_trouble_ends_in_its_status_at_any_scale(compiled, scale):
    stations, targets, d, u, expected = awkward()
    got = positions(stations * scale, d * scale, u * scale, compiled=compiled)
    assert [PositionStatus(s).name for s in got.status] == [s.name for s in expected]
    answered = got.status <= PositionStatus.CONTRADICTING
    assert np.isfinite(got.x[answered]).all()
    assert np.isfinite(got.covariance[answered]).all()
    assert np.isnan(got.x[~answered]).all()
    assert np.isnan(got.covariance[~answered]).all()
    np.testing.assert_allclose(got.x[[0, 11]] / scale, targets[[0, 11]], atol=1e-10)


def test_status_text_gives_cause_and_size():
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


@examples(100)
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
        assert (positions(stations, d, u, compiled=compiled).status == PositionStatus.AMBIGUOUS).all()
        for x in (above, below):
            got = positions(stations, d, u, near=x.mean(axis=0), compiled=compiled).require_found()
            np.testing.assert_allclose(got.x, x, atol=1e-9)
        mixed = np.where(np.arange(4)[:, None] % 2 == 0, above, below)
        got = positions(stations, d, u, near=mixed, compiled=compiled).require_found()
        np.testing.assert_allclose(got.x, mixed, atol=1e-9)
        mixed[2] = np.nan
        got = positions(stations, d, u, near=mixed, compiled=compiled)
        assert got.status.tolist() == [
            PositionStatus.FOUND,
            PositionStatus.FOUND,
            PositionStatus.AMBIGUOUS,
            PositionStatus.FOUND,
        ]


@pytest.mark.parametrize("compiled", [False, True])
def test_nearly_coplanar_stations_tell_the_side_when_they_can_and_say_so_when_they_cannot(compiled):
    """A metre of relief tells it; below what noise allows some are AMBIGUOUS, but none is found on the wrong side."""
    counts = {}
    for relief in (1e-6, 3e-4, 1e-2, 1.0):
        stations, targets, _ = hall(6, 300, s=6, flat=relief / 60)
        d = apart(targets[:, None], stations) + 5e-5 * np.random.default_rng(1).normal(size=(300, 6))
        got = positions(stations, d, np.full(6, 5e-5), compiled=compiled)
        assert np.isin(got.status, [PositionStatus.FOUND, PositionStatus.AMBIGUOUS]).all()
        found = got.status == PositionStatus.FOUND
        assert (apart(got.x[found], targets[found]) < 0.01).all()
        counts[relief] = int(found.sum())
    assert counts[1e-6] == 0
    assert 0 < counts[3e-4] < 300
    assert counts[1.0] == 300


@pytest.mark.parametrize("compiled", [False, True])
def test_the_closed_form_starts_at_the_answer(compiled):
    """Noise-free ranges need one step only: flat, tilted and deep figures of stations."""
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
    assert positions(stations, d, u, compiled=compiled).status.tolist() == [
        PositionStatus.FOUND,
        PositionStatus.REFUSED,
    ]


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


def counted(monkeypatch):
    """Number of targets that the compiled form left to the plain one, as a growing list."""
    left, plain = [], module._plain
    monkeypatch.setattr(module, "_plain", lambda s, chunk, **kept: (left.append(len(chunk.d)), plain(s, chunk, **kept)))
    return left


@pytest.mark.parametrize("missing", [0.1, 1 / 3, 0.6])
def test_the_compiled_form_itself_finds_targets_from_any_subset(missing, monkeypatch):
    """Figures flat, deep and tilted: what it leaves to the plain form is one in a hundred at most, or has no answer."""
    for flat in (0.02, 0.3, 1.0):
        stations, _, d = hall(19, 700, flat=flat)
        rng = np.random.default_rng(20)
        stations = stations @ rotation(rng).T
        d[rng.random(d.shape) < missing] = np.nan
        for u in (np.full(18, 5e-5), np.where(np.isnan(d), np.nan, rng.uniform(3e-5, 9e-5, d.shape))):
            plain = positions(stations, d, u, compiled=False)
            left = counted(monkeypatch)
            fast = positions(stations, d, u, compiled=True)
            monkeypatch.undo()
            assert sum(left) <= 7 + np.sum(plain.status != PositionStatus.FOUND)
            assert fast.status.tolist() == plain.status.tolist()
            assert fast.ranges.tolist() == plain.ranges.tolist()
            same = np.abs(fast.x - plain.x) <= 1e-5 * np.sqrt(np.einsum("tii->ti", plain.covariance)) + 1e-11
            assert same[plain.status == PositionStatus.FOUND].all()


def test_compiled_form_takes_the_near_image_per_visible_stations(monkeypatch):
    """Three ranges each: every subset has a plane of its own, and which side of it is near is its own matter."""
    stations, targets, d = hall(21, 400, s=6, flat=0.4, sigma=0.0)
    rng = np.random.default_rng(22)
    for row in d:
        row[rng.permutation(6)[3:]] = np.nan
    left = counted(monkeypatch)
    got = positions(stations, d, np.full(6, 1e-5), near=targets, compiled=True)
    found = got.status == PositionStatus.FOUND
    assert found.mean() > 0.95
    assert sum(left) <= np.sum(~found) + 8
    assert (apart(got.x[found], targets[found]) < 1e-6).all()
    mirrored = positions(stations, d, np.full(6, 1e-5), compiled=True)
    assert (mirrored.status[found] == PositionStatus.AMBIGUOUS).all()


@draws(60)
@pytest.mark.parametrize("compiled", [False, True])
def test_no_target_is_found_on_the_side_that_near_excludes(compiled, runs):
    """Coplanar stations, sigmas from 10 um to 10 m, targets a hand or a house above them: a descent may pass below."""
    rng = np.random.default_rng(5)
    for _ in range(runs):
        s = int(rng.integers(3, 7))
        stations, u = rng.uniform(-60, 60, (s, 3)) * [1, 1, 0], 10 ** rng.uniform(-5, 1, s)
        x = np.concatenate([rng.uniform(-60, 60, (400, 2)), 10 ** rng.uniform(-1.5, 2, (400, 1))], axis=1)
        d = np.abs(apart(x[:, None], stations) + u * rng.normal(size=(400, s)))
        got = positions(stations, d, u, near=x, compiled=compiled)
        assert not (got.x[got.status == PositionStatus.FOUND, 2] <= 0.0).any()


@pytest.mark.parametrize("compiled", [False, True])
def test_a_step_across_the_stations_plane_does_not_end_at_the_worse_image(compiled):
    """Three times the noise claimed, found by search: undamped steps end below with pvv 226, the best is 97 above."""
    stations = np.array(
        [
            [-29.745, 31.301, 0.061], [43.602, 44.082, 0.481], [14.473, 20.559, -0.428],
            [-3.905, 40.047, -0.38], [-33.859, -58.165, 0.434], [-12.349, -1.896, -0.013],
        ]
    )  # fmt: skip
    u = np.array([6e-05, 0.0039, 0.20887, 0.05915, 6e-05, 0.00046])
    d = np.array([[40.9651, 62.29732, 26.68963, 38.45977, 67.68974, 11.19749]])
    x = np.array([-1.76, 1.42, 1.51])  # where the ranges were drawn from
    got = positions(stations, d, u, near=x, compiled=compiled).require_found()
    best, _, pvv = by_scipy(stations, d[0], u, x)
    assert got.pvv[0] == pytest.approx(pvv, rel=1e-4)
    np.testing.assert_allclose(got.x[0], best, atol=1e-6)
    assert got.x[0, 2] > 1.4


@draws(60)
def test_compiled_and_plain_forms_agree_in_difficult_cases(runs):
    """Sigmas over six decades, noise beyond them, figures flat and thin, ranges missing: the same status and place."""
    rng = np.random.default_rng(23)
    for k in range(runs):
        s = int(rng.integers(4, 9))
        stations = rng.uniform(-60, 60, (s, 3)) * [1, 10 ** rng.uniform(-2, 0), 10 ** rng.uniform(-5, 0)]
        u = 10 ** rng.uniform(-5, 1.3, s) if k % 2 else np.full(s, 10 ** rng.uniform(-5, 1))
        x = rng.uniform(-80, 80, (100, 3))
        d = np.abs(apart(x[:, None], stations) + u * rng.normal(size=(100, s)) * 10 ** rng.uniform(-1, 1))
        d[rng.random(d.shape) < 0.1] = np.nan
        plain, fast = (positions(stations, d, u, near=x if k % 3 else None, compiled=c) for c in (False, True))
        assert fast.status.tolist() == plain.status.tolist()
        answered = plain.status <= PositionStatus.CONTRADICTING
        sigma = np.sqrt(np.trace(plain.covariance[answered], axis1=1, axis2=2))
        assert (apart(fast.x[answered], plain.x[answered]) <= 1e-3 * sigma).all()


def test_undamped_steps_pass_a_narrow_valley_faster_than_damped_ones():
    """Three good ranges, three a million times worse that spoil the start by metres: still scipy's minimum."""
    rng = np.random.default_rng(24)
    stations, targets, _ = hall(24, 200, s=6, flat=0.3)
    u = np.array([1e-5, 1e-5, 1e-5, 10.0, 10.0, 10.0])
    d = apart(targets[:, None], stations) + u * rng.normal(size=(200, 6))
    got = positions(stations, d, u, near=targets)
    assert (got.status == PositionStatus.FOUND).mean() > 0.9
    for t in np.flatnonzero(got.status == PositionStatus.FOUND)[:20]:
        x, _, pvv = by_scipy(stations, d[t], u, got.x[t])
        assert apart(x, got.x[t]) < 1e-3 * np.sqrt(np.trace(got.covariance[t]))
        assert got.pvv[t] == pytest.approx(pvv, rel=1e-4, abs=1e-4)


def test_settled_damped_descent_has_status_settled():
    stations, targets, d = hall(25, 300, s=5, flat=0.3, sigma=0.0)
    u = np.array([[1e-4, 1e-4, 0.1, 0.1, 0.1]])
    r = Ranges(stations, d, u, np.full(300, 5))
    start = targets + np.random.default_rng(26).uniform(-30, 30, (300, 3))
    got = descend(r, start)
    there = apart(got.x, targets) < 1e-6
    assert there.mean() > 0.8
    assert got.settled[there].all()
    assert (got.iterations[there] > 10).any()  # some were damped on the way


@pytest.mark.parametrize("compiled", [False, True])
def test_a_bad_range_that_hides_the_height_from_the_start_does_not_hide_it_from_the_answer(compiled):
    """Its 12 m of error put the closed start into the plane, where nothing says which way is up; its sigma is 10 m."""
    stations = np.array([[-60.0, -60, 0], [60, -60, 0], [60, 60, 0], [-60, 60, 0], [5, 10, 0]])
    x = np.array([[12.0, 7, 9.0]])
    d = apart(x[:, None], stations)
    d[0, 0] -= 12.0
    u = np.array([10.0, 1e-4, 1e-4, 1e-4, 1e-4])
    got = positions(stations, d, u, near=np.array([0.0, 0, 5]), compiled=compiled).require_found()
    np.testing.assert_allclose(got.x, x, atol=1e-6)


@pytest.mark.parametrize("compiled", [False, True])
def test_chunks_and_threads_do_not_show(compiled, monkeypatch):
    stations, _, d, u, _ = awkward()
    d = np.concatenate([d, d[::-1], d])
    whole = positions(stations, d, u, compiled=compiled)
    monkeypatch.setattr(module, "LANES", 8 * 5)
    monkeypatch.setattr(module, "LANES_COMPILED", 8 * 5)
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
        found = got.status == PositionStatus.FOUND
        assert np.isin(got.status[~found], [PositionStatus.NOT_HELD]).all()
        share.append(found.mean())
        if height >= 3.0:
            e = got.x[found] - x
            q = np.einsum("ti,tij,tj->t", e, np.linalg.inv(got.covariance[found]), e)
            assert q.mean() == pytest.approx(3.0, abs=0.4)
    assert share[0] < 0.2
    assert share[-1] == 1.0
    assert share == sorted(share)


def test_blunder_far_from_convergence_is_reported():
    """Ranges exchanged between stations, 200 targets: each is found contradicting or refused an answer."""
    stations, _, d = hall(13, 200, s=6, flat=0.3)
    wrong = d[:, [1, 0, 2, 3, 4, 5]]
    for compiled in (False, True):
        got = positions(stations, wrong, np.full(6, 5e-5), compiled=compiled)
        assert (got.status != PositionStatus.FOUND).mean() > 0.98  # a target midway between the two is no blunder
        assert (got.iterations <= CAP).all()


def test_invalid_positions_input_is_refused_in_one_line():
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
        assert got.status.tolist() == [PositionStatus.REFUSED] * 3 + [PositionStatus.FOUND]


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
