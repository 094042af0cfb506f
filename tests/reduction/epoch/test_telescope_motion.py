"""How the telescope expands and moves during a campaign: derivatives by moving points, and the walk by hand."""

import numpy as np
import pytest

from catseye.constants import MILLIMETRE, PPM
from catseye.reduction.epoch.telescope_motion import PARTS, STEP, UNITS, TelescopeKnots
from catseye.reduction.site.places import RangedPoint

PLACES = {
    "ZY101": RangedPoint("ZY101", "ranger", np.array([120.0, 0.0, 1.0])),
    "ZRG": RangedPoint("ZRG", "ball", np.array([-80.0, 90.0, 2.0])),
    "ZEG": RangedPoint("ZEG", "ball", np.array([5.0, -20.0, 40.0]), body="alidade"),
    "ZY113": RangedPoint("ZY113", "ranger", np.array([-10.0, 30.0, 100.0]), body="arm"),
    "DP001": RangedPoint("DP001", "prism", np.array([-40.0, 10.0, 60.0]), body="dish"),
    "DP002": RangedPoint("DP002", "prism", np.array([30.0, -20.0, 80.0]), body="dish"),
    "DP003": RangedPoint("DP003", "prism", np.array([25.0, 40.0, 70.0]), body="dish"),
}
HOURS = 3.0
KNOTS = TelescopeKnots.of(HOURS * 3600.0, PLACES)


def moved(name, amounts):
    """(3,) m, a point moved by amounts (5,) ppm and mm: the formula of the module's docstring, word for word."""
    place, body = PLACES[name].start, PLACES[name].body
    if not body:
        return place
    scale, dish, *shift = amounts
    middle = np.mean([PLACES[n].start for n in ("DP001", "DP002", "DP003")], axis=0)
    where = place + 1e-6 * scale * place + 1e-3 * np.array(shift)
    return where + 1e-6 * dish * (place - middle) if body == "dish" else where


@pytest.mark.parametrize("ranger", ["ZY101", "ZY113"])
def test_slopes_are_the_derivatives_of_the_exact_distance(ranger):
    targets = ["ZRG", "ZEG", "ZY113" if ranger == "ZY101" else "ZY101", "DP001", "DP002", "DP003"]
    a = np.tile(PLACES[ranger].start, (len(targets), 1))
    b = np.array([PLACES[t].start for t in targets])
    apart = a - b
    towards = apart / np.linalg.norm(apart, axis=1)[:, None]
    found = KNOTS.slopes(ranger, targets, a, b, towards)
    assert found.shape == (len(targets), len(PARTS))
    for p in range(len(PARTS)):
        amounts = np.zeros(len(PARTS))
        amounts[p] = 1.0
        up, down = (
            np.array([np.linalg.norm(moved(ranger, sign * amounts) - moved(t, sign * amounts)) for t in targets])
            for sign in (1.0, -1.0)
        )
        # 1e-11: rounding of 100 m, 1.4e-14, and a square of a millimetre over 50 m that cancels to its third power
        np.testing.assert_allclose(found[:, p], 0.5 * (up - down), rtol=0, atol=1e-11, err_msg=PARTS[p])


def test_signs_by_hand():
    """A dish prism 60 m up, seen from the ground beneath: up by a millimetre it is a millimetre further."""
    a, b = np.array([[-40.0, 10.0, 0.0]]), PLACES["DP001"].start[None]
    (slopes,) = KNOTS.slopes("ZY101", ["DP001"], a, b, np.array([[0.0, 0.0, -1.0]]))
    by = dict(zip(PARTS, slopes, strict=True))
    assert by["up"] == pytest.approx(1e-3)
    assert by["east"] == by["north"] == 0.0
    assert by["scale"] == pytest.approx(60e-6)  # a ppm of 60 m
    assert by["dish scale"] == pytest.approx(-10e-6)  # it is 10 m below the dish's middle, at 70 m
    assert UNITS == (PPM, PPM, MILLIMETRE, MILLIMETRE, MILLIMETRE)


def test_between_points_of_the_ground_nothing_moves_and_on_the_telescope_no_shift_shows():
    a = PLACES["ZY113"].start[None]
    b = PLACES["ZEG"].start[None]
    towards = (a - b) / np.linalg.norm(a - b)
    (on_it,) = KNOTS.slopes("ZY113", ["ZEG"], a, b, towards)
    np.testing.assert_array_equal(on_it[2:], 0.0)
    assert on_it[0] == pytest.approx(PPM * np.linalg.norm(a - b))  # it grows with its distance
    assert on_it[1] == 0.0
    a, b = PLACES["ZY101"].start[None], PLACES["ZRG"].start[None]
    np.testing.assert_array_equal(KNOTS.slopes("ZY101", ["ZRG"], a, b, (a - b) / np.linalg.norm(a - b)), 0.0)


def test_the_walk_is_from_zero_in_the_middle_and_its_halves_know_nothing_of_each_other():
    knots = TelescopeKnots.of(2.0 * 3600.0, PLACES)
    np.testing.assert_allclose(knots.knots, [-3600.0, -1800.0, 1800.0, 3600.0])
    expected = np.array([[1.0, 0.5, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [0.0, 0.0, 0.5, 0.5], [0.0, 0.0, 0.5, 1.0]])
    np.testing.assert_allclose(knots.covariance, expected)
    np.linalg.cholesky(knots.covariance)


def test_the_covariance_is_that_of_random_walks_that_are_drawn():
    rng = np.random.default_rng(0)
    half = len(KNOTS.knots) // 2
    away = np.sqrt(0.5) * rng.standard_normal((2, 4000, half))  # in each half hour, of a unit a root hour
    before, after = np.cumsum(away, axis=2)
    drawn = np.concatenate([before[:, ::-1], after], axis=1)
    # 4000 draws: five sigmas of a covariance of 1.5 h are 5 sqrt(2) 1.5 / sqrt(4000)
    np.testing.assert_allclose(np.cov(drawn.T), KNOTS.covariance, atol=0.17)


def test_each_time_hangs_on_its_two_knots_and_the_middle_is_none():
    rng = np.random.default_rng(3)
    seconds = rng.uniform(-0.5 * HOURS * 3600.0, 0.5 * HOURS * 3600.0, 200)
    columns, share = KNOTS.columns(seconds)
    walk = rng.standard_normal(len(KNOTS.knots))
    found = np.sum(np.where(columns < 0, 0.0, walk[columns]) * share, axis=1)
    whole = np.insert(KNOTS.knots, len(KNOTS.knots) // 2, 0.0)
    values = np.insert(walk, len(KNOTS.knots) // 2, 0.0)
    np.testing.assert_allclose(found, np.interp(seconds, whole, values), atol=1e-12)
    np.testing.assert_allclose(share.sum(axis=1), 1.0)
    columns, share = KNOTS.columns(np.zeros(1))
    assert np.sum(np.where(columns < 0, 0.0, share)) == 0.0  # points are those of the middle


@pytest.mark.parametrize(("hours", "knots"), [(0.3, 2), (1.0, 2), (2.0, 4), (3.0, 6), (10.0, 20)])
def test_knots_are_half_an_hour_apart_and_reach_both_ends(hours, knots):
    made = TelescopeKnots.of(hours * 3600.0, PLACES)
    assert len(made.knots) == knots
    np.testing.assert_allclose(made.knots[[0, -1]], [-1800.0 * hours, 1800.0 * hours])
    whole = np.sort(np.append(made.knots, 0.0))
    np.testing.assert_allclose(np.diff(whole), np.diff(whole)[0])
    assert np.diff(whole)[0] <= 1.5 * STEP


def test_in_a_short_campaign_and_without_a_dish_nothing_expands():
    assert TelescopeKnots.of(899.0, PLACES) is None
    assert TelescopeKnots.of(901.0, PLACES) is not None
    assert TelescopeKnots.of(36000.0, {n: p for n, p in PLACES.items() if p.body != "dish"}) is None
