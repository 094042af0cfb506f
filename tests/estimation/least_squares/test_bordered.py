"""Elimination by blocks against the dense form: answer, covariance in all its forms, tests, what floats."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from catseye.errors import EstimationError
from catseye.estimation.least_squares.adjustment import SolverSettings, adjust
from catseye.estimation.least_squares.bordered import Border, BorderedCovariance
from catseye.estimation.least_squares.covariance import JointPoints
from catseye.estimation.least_squares.normal import NormalEquations
from catseye.estimation.least_squares.robust import OutlierSearch, adjust_robustly
from catseye.estimation.least_squares.rows import ActiveRows
from catseye.estimation.least_squares.status import CONVERGED
from catseye.estimation.observations.kinds import Distances, Linear

STATIONS, TARGETS = 5, 40


class Problem:
    """Ranges from stations with zeros and a common scale to targets, each with a constant of its own and a prior."""

    def __init__(self, seed=1, *, prior=0.01):
        rng = np.random.default_rng(seed)
        self.n = 3 * STATIONS + 3 * TARGETS + STATIONS + 1 + TARGETS
        station = 60.0 * rng.uniform(-1, 1, (STATIONS, 3)) + [0, 0, 60.0]
        target = 40.0 * rng.uniform(-1, 1, (TARGETS, 3))
        self.true = np.concatenate([station.ravel(), target.ravel(), np.zeros(STATIONS + 1 + TARGETS)])
        zero, self.scale, constant = 3 * (STATIONS + TARGETS), self.n - TARGETS - 1, self.n - TARGETS
        s, t = (np.ravel(a) for a in np.meshgrid(np.arange(STATIONS), np.arange(TARGETS), indexing="ij"))
        seen = rng.random(len(s)) < 0.9
        s, t = s[seen], t[seen]
        length = np.linalg.norm(station[s] - target[t], axis=1)
        nuisance = np.stack([zero + s, np.where(t % 3 == 0, constant + t, -1)], axis=1)
        self.groups = []
        for k in range(STATIONS):
            m = s == k
            self.groups.append(
                Distances(
                    f"station {k}",
                    length[m] + 1e-4 * rng.standard_normal(m.sum()),
                    np.full(m.sum(), 1e-8),
                    3 * s[m],
                    3 * (STATIONS + t[m]),
                    nuisance=nuisance[m],
                    scaling=np.full((m.sum(), 1), self.scale),
                    scaling_coefficient=1e-6,
                )
            )
        points = np.arange(3 * (STATIONS + TARGETS))
        self.start = self.true + np.where(np.arange(self.n) < len(points), 3e-3 * rng.standard_normal(self.n), 0.0)
        u = np.concatenate([np.full(3 * STATIONS, 1e-3), np.full(3 * TARGETS, prior)])
        few = np.concatenate([np.arange(zero, self.scale + 1), constant + np.arange(0, TARGETS, 3)])
        u_few = np.concatenate([np.full(STATIONS, 1e-3), [1.0], np.full(len(few) - STATIONS - 1, 5e-4)])
        noise = rng.standard_normal(len(points))
        self.groups += [
            Linear("positions", self.true[points] + u * noise, u**2, points[:, None], np.ones((len(points), 1))),
            Linear("others", np.zeros(len(few)), u_few**2, few[:, None], np.ones((len(few), 1))),
        ]
        self.free = np.zeros(self.n, dtype=bool)
        self.free[points] = True
        self.free[few] = True
        self.free[1] = False  # a coordinate that is held
        self.border = np.ones(self.n, dtype=bool)
        self.border[3 * STATIONS : zero] = False
        self.border[constant:] = False

    def solve(self, *, active=None, border=None, groups=None, iterations=50):
        form = {"sparse": False} if border is None else {"border": border}
        border = SolverSettings(iterations=iterations, **form)
        return adjust(self.start, groups or self.groups, free=self.free, active=active, solver=border)

    def begun_at(self, x):
        """The same problem begun at an answer, so that slopes are taken where the dense form takes its last ones."""
        self.start = x.copy()
        return self

    def bordered(self):
        return Border(self.border, np.zeros(self.n, dtype=bool))


@pytest.fixture(scope="module")
def problem():
    problem = Problem()
    return problem.begun_at(problem.solve().x)


@pytest.fixture(scope="module")
def both(problem):
    return problem.solve(), problem.solve(border=problem.bordered())


def test_the_answer_and_every_test_are_those_of_the_dense_form(both):
    dense, bordered = both
    assert bordered.status == CONVERGED
    assert isinstance(bordered.q, BorderedCovariance)
    np.testing.assert_allclose(bordered.x, dense.x, atol=1e-10)
    for a, b in zip(dense.fits, bordered.fits, strict=True):
        for name in ("residual", "standardised", "redundancy", "estimated_error", "detectable_error"):
            np.testing.assert_allclose(getattr(b, name), getattr(a, name), rtol=1e-4, atol=1e-8, err_msg=name)


def test_the_covariance_is_the_dense_one_in_every_form(problem, both):
    q, whole = both[1].q, both[0].covariance
    u = np.sqrt(np.maximum(np.diag(whole), 1e-30))
    rng = np.random.default_rng(2)

    def close(found, rows, columns):
        np.testing.assert_allclose(
            found / np.outer(u[rows], u[columns]), (whole / np.outer(u, u))[np.ix_(rows, columns)], atol=2e-6
        )

    every = np.arange(problem.n)
    close(q.matrix(), every, every)
    np.testing.assert_allclose(q.diagonal() / u**2, np.diag(whole) / u**2, atol=2e-6)
    for size in (2, 7, 50):  # some of several blocks, of the border, and the one that is held
        chosen = rng.permutation(problem.n)[:size]
        close(q.within(chosen), chosen, chosen)
        close(q.across(chosen), every, chosen)
    first = 3 * np.arange(STATIONS + TARGETS)
    for k, block in zip(first, q.blocks(first), strict=True):
        close(block, np.arange(k, k + 3), np.arange(k, k + 3))
    b = rng.standard_normal((problem.n, 2)) / u[:, None]
    np.testing.assert_allclose(q.solve(b) / u[:, None], whole @ b / u[:, None], atol=1e-4)
    np.testing.assert_allclose(q.solve(b[:, 0]), q.solve(b)[:, 0], atol=1e-15)
    rows = csr_array(rng.standard_normal((6, problem.n)) * (rng.random((6, problem.n)) < 0.1))
    np.testing.assert_allclose(q.carried(rows), rows @ whole @ rows.T, rtol=1e-5, atol=1e-12)


def test_a_parameter_of_a_block_and_one_it_never_meets_are_as_correlated_as_densely(problem, both):
    """Station 4 does not range the last target here, yet both hang on the common scale."""
    q, whole = both[1].q, both[0].covariance
    pair = np.array([3 * 4, 3 * (STATIONS + TARGETS) - 1])
    np.testing.assert_allclose(q.within(pair), whole[np.ix_(pair, pair)], rtol=1e-4, atol=1e-13)


def test_solution_from_a_distant_start_is_the_dense_one():
    """On the way slopes change: by the limit that an earlier elimination serves up to, a row is another."""
    problem = Problem()
    dense, bordered = problem.solve(), problem.solve(border=problem.bordered())
    u = np.sqrt(np.maximum(np.diag(dense.covariance), 1e-30))
    assert np.abs((bordered.x - dense.x) / u).max() < 1e-4
    np.testing.assert_allclose(bordered.q.diagonal(), u**2, rtol=2e-3, atol=1e-25)


def test_rough_tests_are_good_to_a_hundredth():
    """An elimination that is a tenth off would be off by 0.3 here."""
    problem = Problem()
    border = Border(problem.border, np.zeros(problem.n, dtype=bool))
    rough = adjust(problem.start, problem.groups, free=problem.free, solver=SolverSettings(border=border, rough=True))
    for fit, exact in zip(rough.fits, problem.solve().fits, strict=True):
        np.testing.assert_allclose(fit.standardised, exact.standardised, atol=0.01)


def test_rows_that_go_and_come_back_update_an_elimination(problem):
    """After one step from one place: rows are as they were, but for those that went or came."""
    border = problem.bordered()
    first = problem.solve(border=border, iterations=1)
    rng = np.random.default_rng(3)
    active = [np.ones(len(g.observed), dtype=bool) for g in problem.groups]
    for turn in range(3):
        for a in active[:STATIONS]:
            a[rng.integers(len(a), size=2)] ^= True
        found, plain = (problem.solve(active=active, border=b, iterations=1) for b in (border, None))
        assert found.q.eliminated is first.q.eliminated, f"turn {turn}: it was eliminated again"
        np.testing.assert_allclose(found.x, plain.x, atol=1e-10)
        u = np.sqrt(np.maximum(np.diag(plain.covariance), 1e-30))
        np.testing.assert_allclose(found.covariance / np.outer(u, u), plain.covariance / np.outer(u, u), atol=1e-8)
        for a, b in zip(plain.fits, found.fits, strict=True):
            np.testing.assert_allclose(b.standardised, a.standardised, atol=1e-6)
            np.testing.assert_allclose(b.redundancy, a.redundancy, atol=1e-8)


def test_step_is_refined_from_a_nearby_elimination(problem):
    """A third of a millimetre beside where it was eliminated: the same step as from nothing, and nothing eliminated."""
    border = problem.bordered()
    problem.solve(border=border, iterations=1)
    rows = [ActiveRows.of(g) for g in problem.groups]
    x = problem.start + 3e-4 * np.random.default_rng(8).standard_normal(len(problem.start))
    steps, kept = [], border._last
    for b in (border, problem.bordered()):
        normal = NormalEquations.of(rows, np.flatnonzero(problem.free), len(x), False, b)
        steps.append(normal.step(x)[0])
    assert border._last is kept
    u = np.sqrt(np.where(problem.free, normal.covariance().diagonal(), 1.0))
    assert np.abs(steps[1] / u).max() > 1.0
    assert np.abs((steps[0] - steps[1]) / u).max() < 1e-6 * np.abs(steps[1] / u).max()


def test_many_rows_that_go_make_a_new_elimination(problem):
    border = problem.bordered()
    first = problem.solve(border=border)
    active = [np.ones(len(g.observed), dtype=bool) for g in problem.groups]
    active[0][:] = active[1][::2] = False
    found, plain = problem.solve(active=active, border=border), problem.solve(active=active)
    assert found.q.eliminated is not first.q.eliminated
    np.testing.assert_allclose(found.x, plain.x, atol=1e-10)


def test_wrong_ranges_are_the_same_as_densely(problem):
    groups = list(problem.groups)
    observed = groups[2].observed.copy()
    observed[[3, 8, 20]] += [0.02, -0.3, 0.001]
    groups[2] = replace(groups[2], observed=observed)
    removable = [np.full(len(g.observed), k < STATIONS) for k, g in enumerate(groups)]
    points = [np.arange(3 * (STATIONS + k), 3 * (STATIONS + k) + 3) for k in range(TARGETS)]
    dense, bordered = (
        adjust_robustly(
            problem.start, groups, removable, outliers=OutlierSearch(points=points), free=problem.free, border=border
        )
        for border in (None, problem.bordered())
    )
    assert {3, 8, 20} <= set(np.flatnonzero(~dense.fits[2].active).tolist())
    for a, b in zip(dense.fits, bordered.fits, strict=True):
        assert np.array_equal(a.active, b.active)
    u = np.sqrt(np.maximum(np.diag(dense.covariance), 1e-30))
    assert np.abs((bordered.x - dense.x) / u).max() < 1e-4


def test_undetermined_parameters_are_named_as_in_the_dense_form():
    """A target out of the typed positions and seen twice, and one in no row at all."""
    for lost in (7, 12):
        problem = Problem()
        group = problem.groups[STATIONS]
        keep = np.ones(len(group.observed), dtype=bool)
        keep[3 * (STATIONS + lost) : 3 * (STATIONS + lost) + 3] = False
        active = [np.ones(len(g.observed), dtype=bool) for g in problem.groups]
        active[STATIONS] = keep
        for g, a in zip(problem.groups[:STATIONS], active, strict=False):
            seen = g.target == 3 * (STATIONS + lost)
            if lost == 12 or g.name in ("station 0", "station 1", "station 2"):
                a[seen] = False
        dense, bordered = problem.solve(active=active), problem.solve(active=active, border=problem.bordered())
        assert bordered.status.startswith("rank deficient")
        assert (
            bordered.status.split(" not determined")[0].split()[2]
            == dense.status.split(" not determined")[0].split()[2]
        )
        assert not bordered.solved
        assert np.isnan(bordered.covariance[0, 0])


def test_joint_points_are_the_same_from_either_covariance(both):
    columns = np.arange(3 * (STATIONS + TARGETS)).reshape(-1, 3)
    dense, bordered = (JointPoints.of(s.q, columns) for s in both)
    size = dense.u.max()
    np.testing.assert_allclose(bordered.u, dense.u, rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(bordered.matrix(), dense.matrix(), atol=2e-6 * size**2)
    rows = np.array([7, 30, 2])
    np.testing.assert_allclose(bordered.block(rows), dense.block(rows), atol=2e-6 * size**2)
    every = np.arange(len(columns))
    np.testing.assert_allclose(bordered.between(every, rows), dense.between(every, rows), atol=2e-6 * size**2)
    np.testing.assert_allclose(bordered.held().matrix(), bordered.matrix(), rtol=0, atol=1e-14 * size**2)
    some = np.random.default_rng(5).standard_normal((columns.size, 2))
    np.testing.assert_allclose(bordered.times(some), bordered.matrix() @ some, rtol=0, atol=1e-12 * size**2)
    up = np.random.default_rng(4).standard_normal((3, 3))
    np.testing.assert_allclose(bordered.along(rows, up), dense.along(rows, up), atol=2e-5 * size**2)
    np.testing.assert_allclose(
        dense.along(rows, up),
        [
            [u @ dense.block([a, b])[:3, 3:] @ v for b, v in zip(rows, up, strict=True)]
            for a, u in zip(rows, up, strict=True)
        ],
    )


def test_a_matrix_that_is_too_large_is_refused_in_a_line(both, monkeypatch):
    import catseye.estimation.least_squares.bordered as module

    monkeypatch.setattr(module, "LARGEST_MATRIX", 10)
    with pytest.raises(EstimationError, match="ask for the blocks of single points"):
        both[1].q.matrix()
