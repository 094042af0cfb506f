"""Positions from three ranges: against mpmath, derivatives by differences, and Newton's method."""

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import InputError
from catseye.estimation.network.positions.status import PositionStatus
from catseye.estimation.network.positions.trilateration import (
    trilaterate,
    trilaterate_by_averaging,
    trilateration_covariance,
)

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


# --- three ranges, closed form ---


@given(seeds)
def test_both_points_are_at_the_three_distances_and_the_first_is_on_the_right_hand_side(seed):
    rng = np.random.default_rng(seed)
    s, x = triangle(rng, 5)
    d = apart(x[:, None], s)
    both = trilaterate(s, d)
    assert (both.status == PositionStatus.FOUND).all()
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
    assert short.status == PositionStatus.DISJOINT
    np.testing.assert_allclose(short.misclosure, 10.0, rtol=1e-12)
    assert np.isnan(short.x).all()
    long = trilaterate(s, np.array([200.0, 30, 90]))  # one sphere holds another: no triangle inequality
    assert long.status == PositionStatus.DISJOINT
    mended = trilaterate(s, np.array([200.0, 30, 90]) + long.misclosure * (1 + 1e-9))
    assert mended.status == PositionStatus.FOUND
    assert mended.height < 0.1
    assert (trilaterate(s, np.array([50.0, 50, 50.0])).height == 0.0).all()  # touching, to rounding


def test_stations_on_a_line_and_impossible_numbers_have_their_status():
    line = np.array([[0.0, 0, 0], [1, 2, 3], [3, 6, 9]])
    x = np.array([5.0, 1, 1])
    assert trilaterate(line, apart(x, line)).status == PositionStatus.COLLINEAR
    assert trilaterate(line * 1e-9, apart(x, line) * 1e-9).status == PositionStatus.COLLINEAR
    s = np.array([[0.0, 0, 0], [60, 0, 0], [0, 80, 0]])
    wrong = trilaterate(s, np.array([[-50.0, 60, 60], [np.nan, 60, 60], [np.inf, 60, 60], [60, 60, 60]]))
    assert wrong.status.tolist() == [PositionStatus.REFUSED] * 3 + [PositionStatus.FOUND]
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
    assert (found.status == PositionStatus.FOUND).all()
    np.testing.assert_allclose(found.x, both.x[:, 0], atol=1e-9)
    assert (found.iterations < 25).all()  # from 0.1 m to 100 m Heron halves ten times, then squares


def test_convergence_is_of_second_order():
    s = np.array([[0.0, 0, 0], [60, 0, 0], [0, 80, 0]])
    x = np.array([20.0, 20, 50])
    errors = [apart(trilaterate_by_averaging(s, apart(x, s), x + 20 * UP, iterations=k).x, x) for k in (1, 2, 3)]
    for before, after in pairwise(errors):
        assert after == pytest.approx(before**2 / (2 * (50 + before)), rel=1e-6)


def test_iteration_limit_and_start_in_plane_are_reported():
    s = np.array([[0.0, 0, 0], [60, 0, 0], [0, 80, 0]])
    start = np.array([[20.0, 20, 50], [20, 20, 0]])
    got = trilaterate_by_averaging(s, np.array([[40.0, 40, 40], [60, 60, 60]]), start)
    assert got.status.tolist() == [PositionStatus.NOT_CONVERGED, PositionStatus.NOT_HELD]
    assert got.iterations.tolist() == [50, 1]
    assert got.difference[0] > 1e-9
    assert np.isnan(got.x[1]).all()
