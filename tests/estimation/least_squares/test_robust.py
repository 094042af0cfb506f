"""Wrong ranges are found where few meet, good ones stay, and where nobody can tell both are left out."""

from copy import deepcopy
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.least_squares.conflict import LocalConflict, PointObservations, contradicted, search
from catseye.estimation.least_squares.robust import OutlierSearch, adjust_robustly
from catseye.estimation.least_squares.status import CONVERGED
from catseye.estimation.observations.kinds import Distances, Linear
from draws import examples

SIGMA = 25e-6  # m
STATIONS = np.array([[90, 0, 0], [45, 78, 2], [-45, 78, -1], [-90, 0, 1], [-45, -78, 0], [45, -78, 3]], dtype=float)


def distances(name, observed, covariance, origin, target):
    m = len(observed)
    none = np.zeros((m, 0))
    return Distances(name, observed, covariance, origin, target, np.ones(m), np.zeros(m), none.astype(int), none)


class Field:
    """Six surveyed stations range to targets, one shot a pair; errors may be added to any shot."""

    def __init__(self, seed, targets=6, *, repeats=1, stations=STATIONS, prior=None, points=None):
        rng = np.random.default_rng(seed)
        k = len(stations)
        if points is None:
            points = rng.uniform(-25, 25, (targets, 3)) + np.array([0, 0, 50])
        true = np.concatenate([stations, points])
        self.x0 = (true + np.concatenate([np.zeros((k, 3)), rng.normal(size=(targets, 3)) * 0.03])).ravel()
        self.true = true.ravel()
        self.free = np.arange(self.x0.size) >= 3 * k
        self.points = [3 * (k + t) + np.arange(3) for t in range(targets)]
        self.to = np.repeat(np.arange(targets), repeats)
        self.observed = [
            np.linalg.norm(true[k + self.to] - station, axis=1) + rng.normal(size=len(self.to)) * SIGMA
            for station in stations
        ]
        self.prior = []
        if prior is not None:
            columns = np.flatnonzero(self.free)
            order = np.argsort(-columns)  # no order is promised
            self.prior = [Linear("typed", self.x0[columns][order], np.full(len(columns), prior**2), columns[order],
                                 np.eye(len(columns)))]  # fmt: skip

    def groups(self):
        k, m = len(self.observed), len(self.to)
        shots = [
            distances(f"S{s}", o, np.full(m, SIGMA**2), np.full(m, 3 * s), 3 * (k + self.to))
            for s, o in enumerate(self.observed)
        ]
        return [*shots, *self.prior]

    def adjusted(self, *, advice=(), critical=3.5, **options):
        k, m = len(self.observed), len(self.to)
        removable = [np.ones(m, dtype=bool)] * k + [np.zeros(len(p.observed), dtype=bool) for p in self.prior]
        outliers = OutlierSearch(self.points, advice, critical)
        return adjust_robustly(self.x0, self.groups(), removable, outliers=outliers, free=self.free, **options)

    def left_out(self, solution):
        return {(s, int(k)) for s, f in enumerate(solution.fits) for k in np.flatnonzero(~f.active)}


@pytest.mark.parametrize("error", [0.001, 0.02, -1.0, 30.0])
@pytest.mark.parametrize("station", range(6))
def test_one_wrong_range_of_six_is_left_out_alone(station, error):
    field = Field(17)
    field.observed[station][3] += error
    solution = field.adjusted().require_converged()
    assert field.left_out(solution) == {(station, 3)}
    # found as large as it is, to the uncertainty of its prediction
    fit = solution.fits[station]
    assert abs(fit.estimated_error[3] - error) < 4 * abs(error / fit.standardised[3])


@pytest.mark.parametrize("pair", list(combinations(range(6), 2)))
def test_two_wrong_ranges_at_one_point_are_both_left_out_alone(pair):
    field = Field(24)
    field.observed[pair[0]][2] += 0.020
    field.observed[pair[1]][2] -= 0.013
    out = field.left_out(field.adjusted().require_converged())
    assert out == {(pair[0], 2), (pair[1], 2)}


def test_wrong_ranges_at_many_points_and_from_one_station_are_all_found():
    field = Field(5, targets=10)
    planted = {(0, 0), (0, 3), (1, 1), (2, 5), (3, 7), (3, 8), (5, 9)}
    for i, (s, k) in enumerate(sorted(planted)):
        field.observed[s][k] += (-1) ** i * 10 ** (-3 + i / 2)  # 1 mm to 1 m
    assert field.left_out(field.adjusted().require_converged()) == planted


@cache
def leverage(seed):
    """Three stations side by side and three anywhere, and the ranges that pull hard: residuals hardly show an error."""
    rng = np.random.default_rng(seed)
    beside = [80, 0, 0] + rng.normal(size=(3, 3)) * [1, 4, 4]
    field = Field(seed, targets=3, stations=np.concatenate([beside, rng.uniform(-80, 80, (3, 3))]))
    plain = adjust(
        field.x0,
        [
            distances(f"S{s}", o, np.full(3, SIGMA**2), np.full(3, 3 * s), 18 + 3 * field.to)
            for s, o in enumerate(field.observed)
        ],
        free=field.free,
    )
    redundancy = np.array([f.redundancy for f in plain.fits])
    hard = np.argwhere((redundancy > 0.06) & (redundancy < 0.2))
    looks_wrong = len(hard) and field.left_out(field.adjusted())  # one good range in 2000
    return field, [] if looks_wrong else hard.tolist()


@pytest.mark.parametrize("error", [0.02, -0.2])
def test_a_wrong_range_of_six_that_pulls_hard_is_found(error):
    alone = cases = 0
    for seed in range(20):
        good, hard = leverage(seed)
        for s, k in hard:
            field = deepcopy(good)
            field.observed[s][k] += error
            out = field.left_out(field.adjusted().require_converged())
            assert (s, k) in out
            assert {other for _, other in out} == {k}
            cases, alone = cases + 1, alone + (len(out) == 1)
    assert cases > 20
    assert alone >= 0.95 * cases  # else a second one might be the wrong one just as well, and both go


def test_two_mutually_contradicting_observations_are_both_left_out():
    # three stations hold the point; the fourth shot repeats the first's line and disagrees: which of the two?
    stations = STATIONS[[0, 2, 4, 0]]
    field = Field(9, targets=3, stations=stations)
    field.observed[3][1] += 0.02
    solution = field.adjusted(names=[f"p{i}" for i in range(21)])
    # without both the point hangs on two ranges: no answer, and it says why
    assert solution.status.startswith("observations at one point contradict each other")
    assert "not held" in solution.status
    held = Field(9, targets=3, stations=stations, prior=0.1)
    held.observed[3][1] += 0.02
    solution = held.adjusted().require_converged()
    assert field.left_out(solution) >= {(0, 1), (3, 1)}
    assert all(k == 1 for _, k in field.left_out(solution))  # the other points keep everything


def test_repeated_pairs_that_disagree_are_both_left_out_where_the_rest_still_holds_the_point():
    # a shot and its repetition along one line that nothing else checks, and three others for the rest
    stations = np.array([[80.0, 0, 50], [80.0, 0, 50], [0, 80, 0], [0.0, -80, 0], [0, 75, 90]])
    field = Field(12, targets=2, stations=stations, points=np.array([[0.0, 0, 50], [0, 1, 50]]), prior=0.05)
    field.observed[1][0] += 0.003
    solution = field.adjusted().require_converged()
    assert field.left_out(solution) == {(0, 0), (1, 0)}
    error = solution.x[15:18] - field.true[15:18]
    normalised = error @ np.linalg.solve(solution.covariance[15:18, 15:18], error)
    assert normalised < 21.1  # chi-square of 3 at 1e-4: the claim still holds


def test_four_ranges_of_which_one_is_wrong_end_without_an_answer_not_with_a_wrong_one():
    field = Field(4, targets=2, stations=STATIONS[[0, 1, 3, 5]])
    field.observed[2][1] += 0.02
    status = field.adjusted(names=[f"P{i // 3} {'xyz'[i % 3]}" for i in range(18)]).status
    assert status.startswith("observations at one point contradict each other")
    assert "P5" in status


def from_agreement(field, **search):
    """The search begun where all ranges agree, as a later pass begins: nothing stands out there."""
    everything = [np.ones(len(g.observed), dtype=bool) for g in field.groups()]
    agreed = adjust(field.x0, field.groups(), free=field.free).require_converged()
    assert all(np.all(np.abs(f.residual) < 3.0 * f.sigma) for f in agreed.fits[:3])
    removable = [on & (k < 3) for k, on in enumerate(everything)]
    outliers = OutlierSearch(field.points, **search)
    return adjust_robustly(
        agreed.x, field.groups(), removable, outliers=outliers, free=field.free, active=everything
    ).require_converged()


@pytest.mark.parametrize("station", range(3))
def test_of_three_ranges_the_one_that_the_typed_place_contradicts_is_left_out(station):
    """Three ranges agree on any place; 0.6 m of one of them is twenty sigmas of a typed place."""
    field = Field(4, targets=3, stations=STATIONS[[0, 1, 3]], prior=0.03)
    field.observed[station][1] += 0.6
    solution = from_agreement(field)
    assert field.left_out(solution) == {(station, 1)}
    error = (solution.x - field.true)[12:15]
    assert np.all(np.abs(error) < 4.0 * np.sqrt(np.diag(solution.covariance))[12:15])


def test_a_typed_place_that_no_one_range_explains_leaves_all_of_them():
    field = Field(4, targets=3, stations=STATIONS[[0, 1, 3]], prior=0.03)
    columns = field.prior[0].columns
    to_points = field.true[12:15] - field.true[:9].reshape(3, 3)
    directions = np.linalg.inv(
        to_points / np.linalg.norm(to_points, axis=1)[:, None]
    )  # a column for each range's error
    away = np.sum(directions / np.linalg.norm(directions, axis=0), axis=1)  # as far from one as from another
    field.prior[0].observed[np.argsort(columns)[3:6]] += 0.5 * away / np.linalg.norm(away)
    assert field.left_out(from_agreement(field)) == set()


def test_of_two_ranges_that_explain_a_typed_place_as_well_neither_is_left_out():
    """Two stations side by side: an error of either moves the point the same way."""
    beside = np.array([STATIONS[0], STATIONS[0] + [0.0, 5.0, 0.0], STATIONS[3] + [0.0, 60.0, 0.0]])
    field = Field(4, targets=3, stations=beside, prior=0.03)
    field.observed[0][1] += 0.02
    everything = [np.ones(len(g.observed), dtype=bool) for g in field.groups()]
    agreed = adjust(field.x0, field.groups(), free=field.free).require_converged()
    meeting = PointObservations.of(field.groups(), agreed, [on & (k < 3) for k, on in enumerate(everything)], ())
    assert [p[0] for p in contradicted(field.points, meeting)] == [field.points[1][0]]
    local, wrong = search(field.points[1], meeting)
    assert wrong
    assert len(wrong) == 1
    assert not local.decisive(wrong, 9.0)
    assert field.left_out(from_agreement(field)) == set()


def typed_on_a_body(seed=5, shift=(30.0, -20.0, 10.0)):
    """Forty points whose typed places share three parameters of how their body stands, 30 m off."""
    field = Field(seed, targets=40, stations=STATIONS[[0, 1, 3]])
    body = len(field.x0) + np.arange(3)
    places = field.true[9:].reshape(-1, 3) + np.random.default_rng(6).normal(0.0, 0.03, (40, 3)) - shift
    columns = np.stack([np.arange(9, 9 + 120), np.tile(body, 40)], axis=1)
    field.prior = [Linear("typed", places.ravel(), np.full(120, 0.03**2), columns, np.tile([1.0, -1.0], (120, 1)))]
    field.x0, field.free = np.append(field.x0, np.zeros(3)), np.append(field.free, [True] * 3)
    return field, body.tolist()


def test_typed_place_on_a_well_determined_body_is_prior_of_the_point():
    field, body = typed_on_a_body()
    field.observed[1][7] += 0.6
    assert field.left_out(from_agreement(field, settled=body)) == {(1, 7)}
    assert field.left_out(from_agreement(field)) == set()  # as long as the body is a parameter like others


def test_advice_decides_between_four_ranges_and_takes_no_part_in_the_answer():
    field = Field(4, targets=2, stations=STATIONS[[0, 1, 3, 5]])
    field.observed[2][1] += 0.02
    there = field.true[15:18] + np.array([0.8e-3, -0.5e-3, 0.3e-3])  # where somebody saw the point, to a millimetre
    advice = [Linear("seen", there, np.full(3, 1e-6), np.arange(15, 18), np.eye(3))]
    solution = field.adjusted(advice=advice).require_converged()
    assert field.left_out(solution) == {(2, 1)}
    good = [np.array([True, s != 2]) for s in range(4)]
    without = adjust(field.x0, [*field.groups()], free=field.free, active=good).require_converged()
    np.testing.assert_allclose(solution.x, without.x, atol=1e-9)
    np.testing.assert_allclose(solution.covariance, without.covariance, rtol=1e-6, atol=1e-20)


@pytest.mark.parametrize("error", [0.003, -0.02])
def test_small_error_beside_a_gross_one_leaves_good_shots_decided(error):
    """One of six ranges is foreign and one is off by chance; the choice of the second does not matter."""
    field = Field(17)
    field.observed[0][3] += error
    field.observed[4][3] += 7 * SIGMA
    solution = field.adjusted().require_converged()
    assert (0, 3) in field.left_out(solution)
    assert len(field.left_out(solution)) <= 2


def test_rejections_at_other_points_are_not_readmitted():
    field = Field(31, targets=8)
    field.observed[4][2] += 0.02
    field.observed[1][2] += 0.3
    solution = field.adjusted().require_converged()
    for fit in solution.fits:
        assert np.abs(fit.standardised[fit.active]).max() < 3.5


def test_a_selection_given_is_a_start_not_a_verdict():
    field = Field(6)
    field.observed[2][4] += 0.05
    active = [np.ones(6, dtype=bool) for _ in range(6)]
    active[0][0] = active[1][1] = False  # good ones, wrongly left out
    assert field.left_out(field.adjusted(active=active).require_converged()) == {(2, 4)}


def test_non_removable_observations_stay():
    field = Field(6, prior=1e-3)
    field.prior[0].observed[0] += 1.0  # a wrong prior that may not be removed
    solution = field.adjusted()
    assert solution.fits[-1].active.all()


def test_without_errors_it_is_the_plain_adjustment():
    field = Field(2)
    solution = field.adjusted(critical=6.0).require_converged()
    assert field.left_out(solution) == set()
    plain = adjust(
        field.x0,
        [distances("S", o, np.full(6, SIGMA**2), np.full(6, 3 * s), 18 + 3 * field.to)
         for s, o in enumerate(field.observed)],
        free=field.free,
    )  # fmt: skip
    np.testing.assert_allclose(solution.x, plain.x, rtol=0, atol=1e-4 * SIGMA)


def test_correlated_observations_with_a_redundancy_of_zero_are_still_removed():
    # the second repeats the first's error and adds a little of its own: least squares gives it no weight, and the
    # first a redundancy of zero; but the two must agree to a tenth of a sigma
    c = np.array([[1.0, 1.0, 0.0], [1.0, 1.01, 0.0], [0.0, 0.0, 400.0]])
    groups = [Linear("pair", np.array([300.0, 0.1, 0.2]), c, np.arange(1), np.ones((3, 1)))]
    everything = [np.ones(3, dtype=bool)]
    whole = adjust(np.zeros(1), groups).fits[0]
    assert whole.redundancy[0] < 0.01
    assert abs(whole.standardised[0]) > 1000
    solution = adjust_robustly(np.zeros(1), groups, everything, active=everything).require_converged()
    assert solution.fits[0].active.tolist() == [False, True, True]


def test_a_floating_network_is_reported_not_searched():
    field = Field(1)
    field.free[:] = True
    assert field.adjusted().status.startswith("rank deficient")


# the search at one point


def conflict(slopes, residual, prior=(), prior_slopes=()):
    return LocalConflict(
        [(0, k) for k in range(len(residual))], np.asarray(residual, float), np.asarray(slopes, float),
        np.asarray(prior, float), np.asarray(prior_slopes, float).reshape(-1, 3),
    )  # fmt: skip


def towards(k, seed=1):
    u = np.random.default_rng(seed).normal(size=(k, 3))
    return u / np.linalg.norm(u, axis=1, keepdims=True)


def test_ranges_that_agree_have_an_empty_conflict():
    u = towards(7)
    assert conflict(u, u @ [50.0, -20, 10]).smallest_conflict() == ()


@pytest.mark.parametrize("k", range(6))
def test_a_conflict_of_one(k):
    u = towards(6)
    assert conflict(u, u @ [1.0, 2, 3] + 400.0 * (np.arange(6) == k)).smallest_conflict() == (k,)


@pytest.mark.parametrize("pair", list(combinations(range(7), 2)))
def test_a_conflict_of_two(pair):
    u = towards(7)
    wrong = 300.0 * (np.arange(7) == pair[0]) - 500.0 * (np.arange(7) == pair[1])
    assert conflict(u, u @ [1.0, 2, 3] + wrong).smallest_conflict() == pair


def test_three_wrong_of_eight_are_not_decided():
    u = towards(8)
    wrong = np.array([300.0, -500, 800, 0, 0, 0, 0, 0])
    assert conflict(u, wrong).smallest_conflict() is None


def test_three_ranges_cannot_contradict_each_other():
    assert conflict(np.eye(3), [9.0, 9, 9]).smallest_conflict() is None


def test_a_prior_lets_three_ranges_contradict():
    held = conflict(np.eye(3), [0.0, 0, 400], np.zeros(3), np.eye(3))
    assert held.smallest_conflict() == (2,)


def test_the_cost_is_the_sum_of_squares_at_the_best_place():
    rng = np.random.default_rng(8)
    u, v, q, b = towards(6), rng.normal(size=6), rng.normal(size=2), rng.normal(size=(2, 3))
    a, r = np.concatenate([u[[0, 2, 3, 5]], b]), np.concatenate([v[[0, 2, 3, 5]], q])
    project = np.eye(6) - a @ np.linalg.inv(a.T @ a) @ a.T
    assert conflict(u, v, q, b).cost((1, 4)) == pytest.approx(r @ project @ r, rel=1e-9)


# it always ends


@examples(60)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(3, 6),
    st.lists(st.tuples(st.integers(0, 5), st.integers(0, 3), st.floats(-100.0, 100.0)), max_size=14),
    st.booleans(),
)
def test_any_input_ends_with_a_status(seed, stations, wrong, typed):
    field = Field(seed, targets=4, stations=STATIONS[:stations], prior=0.1 if typed else None)
    for s, k, error in wrong:
        field.observed[s % stations][k] += error
    solution = field.adjusted()
    assert solution.status
    if solution.status == CONVERGED:
        for fit in solution.fits[:stations]:
            seen = fit.active & (fit.redundancy > 0.05)
            assert np.abs(fit.standardised[seen]).max(initial=0.0) < 3.5
    else:
        assert not typed or "undecided" in solution.status or "not converged" in solution.status


# back in: what was left out must fit better than what is left out, or the two limits would be one


def one_left_out(w, others=4):
    """One unknown seen alike by some who agree and one who is |w| from them; which were left out at the end.

    Against the mean of k others of the same sigma an observation stands off by sigma sqrt(1 + 1/k).
    """
    observed = np.array([*([0.0] * others), w * SIGMA * np.sqrt(1.0 + 1.0 / others)])
    groups = [Linear("seen", observed, np.full(others + 1, SIGMA**2), np.arange(1), np.ones((others + 1, 1)))]
    removable, active = [np.ones(others + 1, dtype=bool)], [np.arange(others + 1) < others]

    def adjusted(start):
        solution = adjust_robustly(np.zeros(1), groups, removable, active=[start]).require_converged()
        fit = solution.fits[0]
        assert abs(fit.standardised[others]) == pytest.approx(abs(w), rel=1e-6)  # in or out: Baarda's w is the same
        return np.flatnonzero(~fit.active).tolist()

    return adjusted(active[0]), adjusted(np.ones(others + 1, dtype=bool))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("share", "once_out", "once_in"),
    [
        (1.02, [4], [4]),
        (0.98, [4], []),
        (0.92, [4], []),
        (0.88, [], []),
        (0.5, [], []),
    ],
)
def test_readmission_and_rejection_limits_differ_by_a_tenth(share, once_out, once_in, sign):
    """Critical is 3.5: between 3.15 and 3.5 an observation stays where it is, so that no rounding turns it about."""
    assert one_left_out(sign * share * 3.5) == (once_out, once_in)
