"""Motion of the telescope during a campaign: derivatives by moving points, and the walk by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.constants import MILLIMETRE, PPM
from catseye.optics.retroreflector.kinds.registry import HOLLOW
from catseye.reduction.epoch.motion.telescope_motion import PARTS, STEP, UNITS, TelescopeKnots
from catseye.reduction.site.places import RangedPoint

PLACES = {
    "ZY101": RangedPoint("ZY101", None, np.array([120.0, 0.0, 1.0])),
    "ZRG": RangedPoint("ZRG", HOLLOW, np.array([-80.0, 90.0, 2.0])),
    "ZEG": RangedPoint("ZEG", HOLLOW, np.array([5.0, -20.0, 40.0]), body="alidade"),
    "ZY113": RangedPoint("ZY113", None, np.array([-10.0, 30.0, 100.0]), body="arm"),
    "DP001": RangedPoint("DP001", HOLLOW, np.array([-40.0, 10.0, 60.0]), body="dish"),
    "DP002": RangedPoint("DP002", HOLLOW, np.array([30.0, -20.0, 80.0]), body="dish"),
    "DP003": RangedPoint("DP003", HOLLOW, np.array([25.0, 40.0, 70.0]), body="dish"),
    "DP004": RangedPoint("DP004", HOLLOW, np.array([-5.0, -30.0, 72.0]), body="dish"),
    "DP005": RangedPoint("DP005", HOLLOW, np.array([8.0, 9.0, 64.0]), body="dish"),
    "DP006": RangedPoint("DP006", HOLLOW, np.array([-20.0, 33.0, 66.0]), body="dish"),
}
DISH = [name for name in PLACES if name.startswith("DP")]
HOURS = 3.0
KNOTS = TelescopeKnots.of(HOURS * 3600.0, PLACES)


def moved(name, amounts):
    """(3,) m, a point moved by amounts of `PARTS`, ppm, µrad and mm: the module's docstring, word for word."""
    place, body = PLACES[name].start, PLACES[name].body
    if not body:
        return place
    by = dict(zip(PARTS, amounts, strict=True))
    middle = np.mean([PLACES[n].start for n in DISH], axis=0)
    reach = max(np.linalg.norm(PLACES[n].start - middle) for n in DISH)
    where = place + 1e-6 * by["scale"] * place
    where = where + Rotation.from_rotvec([0.0, 0.0, 1e-6 * by["turn"]]).apply(place) - place
    where = where + 1e-3 * np.array([by["east"], by["north"], by["up"]])
    away = place - middle
    if body in ("dish", "arm"):
        tilt = Rotation.from_rotvec([1e-6 * by["tilt east"], 1e-6 * by["tilt north"], 0.0])
        where = where + tilt.apply(away) - away + 1e-6 * by[f"{body} scale"] * away
    if body == "dish":
        first, second, normal = KNOTS.axes
        u, v = away @ first / reach, away @ second / reach
        where = where + 1e-3 * (by["bend upright"] * (u**2 - v**2) + by["bend diagonal"] * 2.0 * u * v) * normal
    return where


@pytest.mark.parametrize("ranger", ["ZY101", "ZY113"])
def test_slopes_are_the_derivatives_of_the_exact_distance(ranger):
    targets = ["ZRG", "ZEG", "ZY113" if ranger == "ZY101" else "ZY101", *DISH]
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
    middle = np.mean([PLACES[n].start for n in DISH], axis=0)
    assert by["dish scale"] == pytest.approx((60.0 - middle[2]) * 1e-6)
    assert by["arm scale"] == by["turn"] == 0.0  # it is no arm; a turn about the vertical lifts nothing
    assert by["tilt east"] == pytest.approx((10.0 - middle[1]) * 1e-6)  # about the east: the north rises
    assert by["tilt north"] == pytest.approx(-(-40.0 - middle[0]) * 1e-6)  # about the north: the east sinks
    assert (PPM, PPM, PPM, 1e-6, 1e-6, 1e-6, *(MILLIMETRE,) * 5) == UNITS
    np.testing.assert_allclose(KNOTS.axes @ KNOTS.axes.T, np.eye(3), atol=1e-12)


def test_a_turn_about_the_vertical_moves_the_east_to_the_north():
    a, b = np.array([[-10.0, 0.0, 100.0]]), np.array([[-10.0, 30.0, 100.0]])
    (slopes,) = KNOTS.slopes("ZY101", ["ZY113"], a, b, np.array([[0.0, -1.0, 0.0]]))
    assert dict(zip(PARTS, slopes, strict=True))["turn"] == pytest.approx(-10e-6)  # at x = -10 m the north comes nearer


def test_a_dish_of_few_points_does_not_bend():
    few = {n: p for n, p in PLACES.items() if n not in ("DP005", "DP006")}
    knots = TelescopeKnots.of(HOURS * 3600.0, few)
    a, b = np.array([[120.0, 0.0, 1.0]]), PLACES["DP001"].start[None]
    towards = (a - b) / np.linalg.norm(a - b)
    at = [PARTS.index("bend upright"), PARTS.index("bend diagonal")]
    np.testing.assert_array_equal(knots.slopes("ZY101", ["DP001"], a, b, towards)[0, at], 0.0)
    assert np.all(KNOTS.slopes("ZY101", ["DP001"], a, b, towards)[0, at] != 0.0)


def test_ground_lines_do_not_move_and_a_common_shift_is_invisible():
    a = PLACES["ZY113"].start[None]
    b = PLACES["ZEG"].start[None]
    towards = (a - b) / np.linalg.norm(a - b)
    (on_it,) = KNOTS.slopes("ZY113", ["ZEG"], a, b, towards)
    assert on_it[0] == pytest.approx(PPM * np.linalg.norm(a - b))  # it grows with its distance
    by = dict(zip(PARTS, on_it, strict=True))
    assert all(abs(by[part]) < 1e-20 for part in ("turn", "east", "north", "up"))  # both move alike
    assert by["dish scale"] == by["bend upright"] == by["bend diagonal"] == 0.0
    a, b = PLACES["ZY101"].start[None], PLACES["ZRG"].start[None]
    np.testing.assert_array_equal(KNOTS.slopes("ZY101", ["ZRG"], a, b, (a - b) / np.linalg.norm(a - b)), 0.0)


def test_the_walk_starts_at_zero_in_the_middle_with_independent_halves():
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


def test_each_time_depends_on_its_two_knots_and_the_middle_is_none():
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
