"""Least squares against scipy and against brute force: every statistic is recomputed by leaving observations out."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import STEP_IN_SIGMAS, SolverSettings, adjust
from catseye.estimation.least_squares.rows import full_jacobian
from catseye.estimation.least_squares.status import CONVERGED
from catseye.estimation.observations.kinds import Distances, Linear


def distances(name, observed, covariance, origin, target):
    m = len(observed)
    none = np.zeros((m, 0))
    return Distances(name, observed, covariance, origin, target, np.ones(m), np.zeros(m), none.astype(int), none)


def correlated(rng, m, sigma):
    """A dense covariance of m observations with a common part and a random one."""
    a = rng.normal(size=(m, m)) / np.sqrt(m)
    return sigma**2 * (np.eye(m) + 0.5 * np.ones((m, m)) + a @ a.T)


def network(seed=1, *, stations=5, targets=4, sigma=1e-4, unit=1.0):
    """Stations with priors range to free targets, one correlated group each; a group of independent ranges besides."""
    rng = np.random.default_rng(seed)
    points = np.concatenate(
        [rng.uniform(-60, 60, (stations, 3)), rng.uniform(-20, 20, (targets, 3)) + np.array([0, 0, 50])]
    )
    columns = np.arange(3 * stations)
    groups = []
    for s in range(stations):
        to = np.repeat(stations + np.arange(targets), 2)
        covariance = correlated(rng, len(to), sigma)
        noise = np.linalg.cholesky(covariance) @ rng.normal(size=len(to))
        observed = np.linalg.norm(points[to] - points[s], axis=1) + noise
        groups.append(
            distances(f"S{s}", observed * unit, covariance * unit**2, np.full(len(to), 3 * s), 3 * to),
        )
    a, b = np.array([0, 1, 2]), np.array([1, 2, 3])
    spans = np.linalg.norm(points[a] - points[b], axis=1) + rng.normal(size=3) * sigma
    groups.append(distances("spans", spans * unit, np.full(3, (sigma * unit) ** 2), 3 * a, 3 * b))
    prior = points[:stations].ravel() + rng.normal(size=3 * stations) * 3 * sigma
    variance = np.full(3 * stations, (3 * sigma * unit) ** 2)
    groups.append(Linear("survey", prior * unit, variance, columns, np.eye(3 * stations)))
    x0 = points.ravel() + rng.normal(size=points.size) * 0.05
    return x0 * unit, groups, points.ravel() * unit


def linear_problem(seed, *, m=9, n=4):
    """A correlated group, an independent one, and x0 = 0."""
    rng = np.random.default_rng(seed)
    first = Linear("first", rng.normal(size=m), correlated(rng, m, 1.0), np.arange(n), rng.normal(size=(m, n)))
    second = Linear(
        "second", rng.normal(size=m), rng.uniform(0.5, 2.0, m), np.arange(n)[::-1].copy(), rng.normal(size=(m, n))
    )
    return np.zeros(n), [first, second]


def dense(groups, x):
    """Residuals, Jacobian and covariance of everything, stacked; the whole thing without blocks."""
    m = sum(len(g.observed) for g in groups)
    v, a, c = np.zeros(m), np.zeros((m, len(x))), np.zeros((m, m))
    at = 0
    for g in groups:
        rows = slice(at, at + len(g.observed))
        v[rows] = g.observed - g.predict(x)[0]
        a[rows] = full_jacobian(g, x)
        c[rows, rows] = g.covariance if g.covariance.ndim == 2 else np.diag(g.covariance)
        at = rows.stop
    return v, a, c


def stacked(solution, what):
    return np.concatenate([getattr(f, what) for f in solution.fits])


@pytest.mark.parametrize("seed", range(5))
def test_a_ranging_network_agrees_with_scipy(seed):
    x0, groups, _ = network(seed)
    solution = adjust(x0, groups).require_converged()
    values, vectors = np.linalg.eigh(dense(groups, x0)[2])
    whitening = vectors / np.sqrt(values) @ vectors.T  # symmetric root: not the Cholesky factor of the solver
    # a common scale keeps scipy's absolute tolerances meaningful
    reference = least_squares(
        lambda x: whitening @ dense(groups, x)[0], x0, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale=1e-4
    )
    a = dense(groups, reference.x)[1]
    covariance = np.linalg.inv(a.T @ whitening @ whitening @ a)
    sigma = np.sqrt(np.diag(covariance))
    # the solver stops at a step of 1e-4 sigma; scipy's own Jacobian by differences is good to 1e-3 sigma
    assert np.abs((solution.x - reference.x) / sigma).max() < 2e-3
    np.testing.assert_allclose(solution.covariance, covariance, rtol=0, atol=1e-6 * sigma.max() ** 2)
    factor, degrees = solution.variance_factor()
    m, n = a.shape
    assert degrees == pytest.approx(m - n, abs=1e-7)
    assert factor == pytest.approx(2 * reference.cost / (m - n), rel=1e-6)


def test_the_gradient_vanishes_at_the_answer():
    x0, groups, _ = network(7)
    solution = adjust(x0, groups)
    v, a, c = dense(groups, solution.x)
    left = a.T @ np.linalg.solve(c, v)
    assert np.sqrt(left @ solution.covariance @ left) < STEP_IN_SIGMAS


@pytest.mark.parametrize("seed", range(4))
def test_the_tests_of_an_observation_are_its_prediction_by_all_others(seed):
    x0, groups = linear_problem(seed)
    whole = adjust(x0, groups)
    for i, group in enumerate(groups):
        for k in range(len(group.observed)):
            # brute force: condition on everything else, a dense Gaussian with a wide prior left out altogether
            v, a, c = dense(groups, x0)
            row = k + sum(len(g.observed) for g in groups[:i])
            rest = np.delete(np.arange(len(v)), row)
            p = np.linalg.inv(c[np.ix_(rest, rest)])
            q = np.linalg.inv(a[rest].T @ p @ a[rest])
            x = q @ a[rest].T @ p @ v[rest]
            gain = c[row, rest] @ p
            error = v[row] - a[row] @ x - gain @ (v[rest] - a[rest] @ x)
            unexplained = a[row] - gain @ a[rest]
            variance = c[row, row] - gain @ c[rest, row] + unexplained @ q @ unexplained
            fit = whole.fits[i]
            assert fit.estimated_error[k] == pytest.approx(error, rel=1e-9)
            assert fit.standardised[k] == pytest.approx(error / np.sqrt(variance), rel=1e-9)
            assert fit.detectable_error[k] == pytest.approx(4.132 * np.sqrt(variance), rel=1e-3)  # 3.2905 + 0.8416


@pytest.mark.parametrize("seed", range(4))
def test_left_out_or_not_an_observation_has_the_same_test(seed):
    x0, groups = linear_problem(seed)
    whole = adjust(x0, groups)
    for i, group in enumerate(groups):
        for k in range(len(group.observed)):
            active = [np.ones(len(g.observed), dtype=bool) for g in groups]
            active[i][k] = False
            without = adjust(x0, groups, active=active)
            for what in ("standardised", "estimated_error", "detectable_error"):
                assert getattr(without.fits[i], what)[k] == pytest.approx(getattr(whole.fits[i], what)[k], rel=1e-9)
            assert not without.fits[i].active[k]


def test_network_tests_agree_within_curvature():
    x0, groups, _ = network(3)
    whole = adjust(x0, groups)
    active = [np.ones(len(g.observed), dtype=bool) for g in groups]
    active[2][3] = False
    without = adjust(x0, groups, active=active)
    assert without.fits[2].standardised[3] == pytest.approx(whole.fits[2].standardised[3], rel=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_redundancy_is_the_share_of_an_error_that_shows_and_sums_to_the_degrees_of_freedom(seed):
    x0, groups = linear_problem(seed)
    whole = adjust(x0, groups)
    assert stacked(whole, "redundancy").sum() == pytest.approx(18 - 4, abs=1e-9)
    for i in range(2):
        for k in range(9):
            observed = groups[i].observed.copy()
            observed[k] += 1.0
            wrong = [*groups]
            wrong[i] = Linear("wrong", observed, groups[i].covariance, groups[i].columns, groups[i].matrix)
            shown = adjust(x0, wrong).fits[i].residual[k] - whole.fits[i].residual[k]
            assert whole.fits[i].redundancy[k] == pytest.approx(shown, abs=1e-9)


def test_the_covariance_is_how_the_answer_answers_to_the_observations():
    x0, groups = linear_problem(11)
    x = adjust(x0, groups).x
    gain = []
    for i, group in enumerate(groups):
        for k in range(len(group.observed)):
            observed = group.observed + (np.arange(len(group.observed)) == k)
            moved = [*groups]
            moved[i] = Linear("moved", observed, group.covariance, group.columns, group.matrix)
            gain.append(adjust(x0, moved).x - x)
    gain = np.array(gain).T
    np.testing.assert_allclose(adjust(x0, groups).covariance, gain @ dense(groups, x0)[2] @ gain.T, atol=1e-10)


def test_a_detectable_error_is_found_four_times_in_five():
    x0, groups = linear_problem(5)
    rng = np.random.default_rng(99)
    clean = adjust(x0, groups)
    _, a, c = dense(groups, x0)
    p = np.linalg.inv(c)
    cofactor = p - p @ a @ np.linalg.inv(a.T @ p @ a) @ a.T @ p
    size = stacked(clean, "detectable_error")
    draws = np.linalg.cholesky(c) @ rng.normal(size=(18, 20_000))
    for row in (0, 5, 12):
        shifted = draws + (np.arange(18) == row)[:, None] * size[row]
        w = (cofactor @ shifted)[row] / np.sqrt(cofactor[row, row])
        # 3.2905 is the two-sided 0.1 % point; 20 000 draws scatter by 0.3 %
        assert np.mean(np.abs(w) > 3.2905) == pytest.approx(0.80, abs=0.012)


def test_the_variance_factor_of_some_groups_takes_their_share_of_the_degrees_of_freedom():
    x0, groups, _ = network(2)
    solution = adjust(x0, groups)
    spans = solution.fits[5]
    factor, degrees = solution.variance_factor(["spans"])
    assert degrees == pytest.approx(spans.redundancy.sum())
    assert factor == pytest.approx(np.sum((spans.residual / spans.sigma) ** 2) / degrees)
    parts = [solution.variance_factor([g.name]) for g in groups]
    whole = solution.variance_factor()
    assert sum(d for _, d in parts) == pytest.approx(whole[1])
    assert sum(f * d for f, d in parts) == pytest.approx(whole[0] * whole[1])
    assert solution.variance_factor(["nobody"])[1] == 0.0
    assert np.isnan(solution.variance_factor(["nobody"])[0])


def test_held_parameters_stay_and_are_certain():
    x0, groups = linear_problem(8)
    x0 = x0 + 0.3
    free = np.array([True, False, True, True])
    solution = adjust(x0, groups, free=free)
    assert solution.x[1] == 0.3
    assert not solution.covariance[1].any()
    assert not solution.covariance[:, 1].any()
    v, a, c = dense(groups, x0)
    p, b = np.linalg.inv(c), a[:, free]
    q = np.linalg.inv(b.T @ p @ b)
    np.testing.assert_allclose(solution.x[free], x0[free] + q @ b.T @ p @ v, rtol=1e-9)
    np.testing.assert_allclose(solution.covariance[np.ix_(free, free)], q, rtol=1e-9)
    assert solution.variance_factor()[1] == pytest.approx(18 - 3)


def test_with_everything_held_only_the_observations_are_judged():
    x0, groups = linear_problem(8)
    solution = adjust(x0, groups, free=np.zeros(4, dtype=bool)).require_converged()
    np.testing.assert_allclose(solution.x, x0)
    independent = groups[1]
    np.testing.assert_allclose(
        solution.fits[1].standardised, independent.observed / np.sqrt(independent.covariance), rtol=1e-12
    )
    assert solution.variance_factor()[1] == 18


@pytest.mark.parametrize("dimension", [1, 2])
def test_extra_variance_is_a_larger_covariance_in_the_answer_and_in_every_test(dimension):
    x0, groups = linear_problem(9)
    groups = groups[2 - dimension :][:1]
    extra = np.linspace(0.0, 4.0, 9)
    g = groups[0]
    larger = g.covariance + (extra if g.covariance.ndim == 1 else np.diag(extra))
    plain = adjust(x0, [Linear(g.name, g.observed, larger, g.columns, g.matrix)])
    weighed = adjust(x0, groups, extra_variance=[extra])
    np.testing.assert_allclose(weighed.x, plain.x, rtol=1e-10)
    np.testing.assert_allclose(weighed.covariance, plain.covariance, rtol=1e-10)
    assert weighed.variance_factor() == pytest.approx(plain.variance_factor())
    for what in ("standardised", "redundancy", "estimated_error", "detectable_error"):
        np.testing.assert_allclose(stacked(weighed, what), stacked(plain, what), rtol=1e-9, atol=1e-12)


def test_without_tests_the_answer_is_the_same_and_the_fits_hold_residuals_only():
    x0, groups, _ = network(4)
    full, bare = adjust(x0, groups), adjust(x0, groups, solver=SolverSettings(tests=False))
    np.testing.assert_array_equal(full.x, bare.x)
    np.testing.assert_array_equal(stacked(full, "residual"), stacked(bare, "residual"))
    assert not stacked(bare, "standardised").any()


def test_a_group_that_is_left_out_whole_is_still_predicted():
    x0, groups = linear_problem(6)
    active = [np.zeros(9, dtype=bool), np.ones(9, dtype=bool)]
    solution = adjust(x0, groups, active=active).require_converged()
    alone = adjust(x0, groups[1:])
    np.testing.assert_allclose(solution.x, alone.x, rtol=1e-12)
    g = groups[0]
    expected = np.diag(g.covariance) + np.einsum("ki,ij,kj->k", g.matrix, alone.covariance, g.matrix)
    surprise = g.observed - g.matrix @ alone.x
    np.testing.assert_allclose(solution.fits[0].standardised, surprise / np.sqrt(expected), rtol=1e-9)
    assert solution.fits[0].pvv == 0.0


# what cannot be solved says so


def test_unobserved_parameter_is_named():
    x0, groups = linear_problem(1)
    solution = adjust(np.append(x0, 0.0), groups, names=["a", "b", "c", "d", "zero ZY101"])
    assert solution.status == ("rank deficient: zero ZY101 not determined by any observation; add one, or give a prior")
    assert np.isnan(solution.covariance).all()  # not zero, which would claim certainty
    with pytest.raises(EstimationError, match="zero ZY101 not determined"):
        solution.require_converged()


def free_network(seed, n, unit, links=12):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3)) * 50
    i, j = np.triu_indices(n, 1)
    chosen = rng.random(len(i)) < min(1.0, links / n)
    i, j = i[chosen], j[chosen]
    d = np.linalg.norm(points[i] - points[j], axis=1) * unit
    return (points * unit).ravel(), distances("ranges", d, np.full(len(d), (1e-4 * unit) ** 2), 3 * i, 3 * j)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e6], ids=["kilometres", "metres", "micrometres"])
@pytest.mark.parametrize("n", [5, 15, 60])
def test_a_floating_network_is_recognised_in_any_unit(n, unit):
    x, group = free_network(n, n, unit)
    assert adjust(x, [group]).status.startswith("rank deficient")
    # six coordinates hold it, in any unit
    free = np.ones(len(x), dtype=bool)
    free[[0, 1, 2, 3, 4, 8]] = False
    assert adjust(x, [group], free=free).status == CONVERGED


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e6])
def test_one_floating_direction_is_named_in_any_unit(unit):
    x0, groups, _ = network(5, unit=unit)
    names = [f"P{i // 3} {'xyz'[i % 3]}" for i in range(len(x0))]
    survey = groups[-1]
    keep = np.setdiff1d(survey.columns, np.arange(0, 15, 3))  # no station's x is held: the whole slides along x
    held = Linear("survey", survey.observed[keep], survey.covariance[keep], keep, np.eye(len(keep)))
    status = adjust(x0, [*groups[:-1], held], names=names).status
    assert status.startswith("rank deficient")
    named = status.removeprefix("rank deficient: ").partition(" not determined")[0].removesuffix(" ...")
    assert {name[-1] for name in named.split(", ")} == {"x"}


def test_a_floating_mode_of_very_many_parameters_is_still_named():
    n = 1050  # each has less than a thousandth of the mode
    rods = Linear("rods", np.zeros(n - 1), np.ones(n - 1), np.arange(n), np.eye(n - 1, n, 1) - np.eye(n - 1, n))
    status = adjust(np.zeros(n), [rods], solver=SolverSettings(tests=False)).status
    assert status.startswith("rank deficient: parameter ")


@pytest.mark.parametrize("weak", [1e-3, 1e-5])
def test_a_nearly_singular_problem_is_solved(weak):
    # two parameters of which only the sum is well seen: the difference is known to 1/weak
    matrix = np.array([[1.0, 1.0], [weak, -weak]])
    solution = adjust(np.zeros(2), [Linear("g", np.array([3.0, weak]), np.ones(2), np.arange(2), matrix)])
    assert solution.status == CONVERGED
    np.testing.assert_allclose(solution.x, [2.0, 1.0], rtol=1e-4)
    # condition 1e10 of the normal matrix leaves six digits
    np.testing.assert_allclose(solution.covariance, np.linalg.inv(matrix.T @ matrix), rtol=1e-5)


def test_parameters_of_very_different_size_do_not_look_deficient():
    # volts of leakage beside kilometres: columns differ by 1e12
    matrix = np.array([[1.0, 1.0], [1.0, -1.0], [1.0, 0.5]]) * [1e-6, 1e6]
    solution = adjust(np.zeros(2), [Linear("g", matrix @ [2e6, 3e-6], np.ones(3), np.arange(2), matrix)])
    np.testing.assert_allclose(solution.require_converged().x, [2e6, 3e-6], rtol=1e-9)


@pytest.mark.parametrize(
    "covariance",
    [np.array([1.0, 0.0]), np.array([1.0, -1.0]), np.ones((2, 2)), np.array([[1.0, 2.0], [2.0, 1.0]])],
    ids=["zero", "negative", "repeated", "indefinite"],
)
def test_invalid_covariance_is_refused_by_name(covariance):
    group = Linear("ZY101", np.zeros(2), covariance, np.arange(2), np.eye(2))
    with pytest.raises(EstimationError, match=r"ZY101: the covariance of its 2 observations is not positive definite"):
        adjust(np.zeros(2), [group])


def test_coinciding_points_are_reported_in_the_status():
    held = Linear("datum", np.zeros(3), np.ones(3), np.arange(3), np.eye(3))
    solution = adjust(np.zeros(6), [distances("rod", np.ones(1), np.ones(1), np.zeros(1, int), np.full(1, 3)), held])
    assert solution.status.startswith("undefined at the current values: rod has no finite value or derivative")
    assert np.isnan(solution.covariance).all()


def test_nan_observation_is_reported_with_its_group():
    x0, groups = linear_problem(1)
    bad = Linear("thermometers", np.array([np.nan]), np.ones(1), np.arange(1), np.eye(1))
    assert "thermometers" in adjust(x0, [*groups, bad]).status


class Bent:
    """x observed through arctan: full Gauss-Newton steps from afar fly off to infinity."""

    name = "bent"
    columns = np.arange(1)
    covariance = np.ones(1)

    def __init__(self, observed):
        self.observed = np.array([observed])

    def predict(self, x):
        return np.arctan(x), np.array([[1.0 / (1.0 + x[0] ** 2)]])


def test_steps_that_overshoot_are_halved():
    solution = adjust(np.array([3.0]), [Bent(0.0)])
    assert solution.status == CONVERGED
    assert abs(solution.x[0]) < STEP_IN_SIGMAS


def test_too_few_steps_have_a_status_and_no_answer():
    solution = adjust(np.array([3.0]), [Bent(0.0)], solver=SolverSettings(iterations=2))
    assert solution.status.startswith("not converged: the last step was ")
    assert "after 2 iterations; check the starting coordinates" in solution.status
    with pytest.raises(EstimationError, match="not converged"):
        solution.require_converged()


def test_the_answer_does_not_depend_on_a_start_tens_of_metres_off():
    x0, groups, true = network(6)
    near, far = adjust(true, groups), adjust(x0 + np.random.default_rng(6).normal(size=len(x0)) * 3.0, groups)
    assert far.status == CONVERGED
    sigma = np.sqrt(np.diag(near.covariance))
    assert np.abs((far.x - near.x) / sigma).max() < 2 * STEP_IN_SIGMAS


@pytest.mark.parametrize("seed", range(3))
def test_the_slopes_of_distances_are_those_of_their_values(seed):
    rng = np.random.default_rng(seed)
    m = 6
    group = Distances(
        "all terms", np.zeros(m), np.ones(m), np.array([0, 0, 3, 3, 6, 6]), np.array([3, 6, 6, 9, 9, 0]),
        1 + rng.normal(size=m) * 1e-3, rng.normal(size=m), rng.integers(12, 15, (m, 2)), rng.normal(size=(m, 2)),
    )  # fmt: skip
    x = rng.normal(size=15) * 20
    for column, slope in enumerate(full_jacobian(group, x).T):
        step = (np.arange(15) == column) * 1e-4
        by_difference = (group.predict(x + step)[0] - group.predict(x - step)[0]) / 2e-4
        np.testing.assert_allclose(slope, by_difference, atol=1e-8)
