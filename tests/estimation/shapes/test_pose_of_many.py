"""A pose with one factor of the covariance: the numbers of plain dense least squares, few factors, little memory."""

import tracemalloc

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import catseye.estimation.shapes.rigid_body as module
from catseye.estimation.least_squares.covariance import Dense, JointPoints
from catseye.estimation.shapes.place_covariances import PlaceCovariances, RotatedPoints
from catseye.estimation.shapes.pose import fit_pose


def spread(size, sigma, rng, common=0.0):
    """A full covariance (size, size): rank `size` and a few errors that all share."""
    root = rng.normal(size=(size, 2 * size)) * sigma / np.sqrt(2 * size)
    shared = rng.normal(size=(size, 4)) * common
    return root @ root.T + shared @ shared.T


def dish(n, seed, *, u=5e-5, common=2e-4, turn=3e-5):
    """Prisms known 0.3 mm along a normal and 4 mm across by design, and much better with shared errors as measured."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-40.0, 40.0, (n, 3)) * [1.0, 1.0, 0.2]
    normal = rng.normal(size=(n, 3)) * 0.2 + [0.0, 0.0, 1.0]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    design = (4e-3**2) * np.eye(3) + (3e-4**2 - 4e-3**2) * normal[:, :, None] * normal[:, None, :]
    q = spread(3 * n, u, rng, common)
    first = x + np.einsum("kij,kj->ki", np.linalg.cholesky(design), rng.normal(size=(n, 3)))
    there = Rotation.from_rotvec(turn * rng.normal(size=3)).apply(x) + rng.normal(size=3) * 1e-3
    second = there + (np.linalg.cholesky(q) @ rng.normal(size=3 * n)).reshape(n, 3)
    return [f"P{k}" for k in range(n)], first, second, design, q


def full(blocks):
    n = len(blocks)
    whole = np.zeros((n, 3, n, 3))
    whole[np.arange(n), :, np.arange(n)] = blocks
    return whole.reshape(3 * n, 3 * n)


def by_hand(x, y, qx, qy, cross):
    """The likeliest motion about the origin by scipy, and what follows from dense inverses alone."""
    n = len(x)

    def misclosure(p):
        turn = Rotation.from_rotvec(p[3:] * 1e-3).as_matrix()
        big = np.kron(np.eye(n), turn)
        s = qy + big @ qx @ big.T - big @ cross - cross.T @ big.T
        return (y - p[:3] * 1e-2 - x @ turn.T).ravel(), s, turn

    def white(p):
        v, s, _ = misclosure(p)
        return np.linalg.solve(np.linalg.cholesky(s), v)

    first = Rotation.align_vectors(y - y.mean(axis=0), x - x.mean(axis=0))[0]
    start = np.concatenate([(y.mean(axis=0) - first.apply(x.mean(axis=0))) * 1e2, first.as_rotvec() * 1e3])
    p = least_squares(white, start, xtol=1e-15, ftol=1e-15, gtol=1e-15, jac="3-point").x
    v, s, turn = misclosure(p)
    weight = np.linalg.inv(s)
    pull = qx @ np.kron(np.eye(n), turn).T - cross
    arm = (x + (pull @ weight @ v).reshape(n, 3)) @ turn.T
    columns = np.zeros((n, 3, 6))
    columns[:, :, :3] = np.eye(3)
    for axis in range(3):
        columns[:, :, 3 + axis] = np.cross(np.eye(3)[axis], arm)
    columns = columns.reshape(3 * n, 6)
    covariance = np.linalg.inv(columns.T @ weight @ columns)
    gain = covariance @ columns.T @ weight
    left = weight - weight @ columns @ gain
    w = np.abs(weight @ v) / np.sqrt(np.diag(left))
    return p[:3] * 1e-2, turn, covariance, gain, float(v @ weight @ v), w.reshape(n, 3).max(axis=1)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ["design", "both", "shared", "noisy"])
def test_numbers_are_those_of_dense_least_squares(kind, seed):
    names, x, y, design, q = dish(7 + 2 * seed, seed)
    n, rng = len(names), np.random.default_rng(100 + seed)
    qx, cross = full(design), np.zeros((3 * n, 3 * n))
    known = PlaceCovariances(first=design, second=q)
    if kind == "both":  # two epochs, dense
        qx = spread(3 * n, 6e-5, rng, 1e-4)
        x = x.mean(axis=0) + (y - y.mean(axis=0)) + rng.multivariate_normal(np.zeros(3 * n), qx).reshape(n, 3)
        known = PlaceCovariances(first=qx, second=q)
    elif kind == "shared":  # what both share
        joint = spread(6 * n, 6e-5, rng, 1e-4)
        qx, cross, q = joint[: 3 * n, : 3 * n], joint[: 3 * n, 3 * n :], joint[3 * n :, 3 * n :]
        x = y + rng.normal(size=y.shape) * 1e-4
        known = PlaceCovariances(first=qx, second=q, cross=cross)
    elif kind == "noisy":  # errors of a metre on points of forty: turns of a hundredth, a factor serves one step
        qx = full(design * 300.0**2)
        x = x + (np.linalg.cholesky(qx) @ rng.normal(size=3 * n)).reshape(n, 3)
        known = PlaceCovariances(first=design * 300.0**2, second=q)
    found = fit_pose(names, x, y, frame="g", covariance=known, pivot=np.zeros(3))
    translation, turn, covariance, gain, pvv, w = by_hand(x, y, qx, q, cross)
    u = np.sqrt(np.diag(covariance))
    close = 1e-3 if kind == "noisy" else 1e-5  # of u: scipy's derivatives are differences
    np.testing.assert_allclose((found.translation - translation) / u[:3], 0.0, atol=close)
    apart = Rotation.from_matrix(found.motion.matrix @ turn.T).as_rotvec()
    np.testing.assert_allclose(apart / u[3:], 0.0, atol=close)
    assert found.motion.pvv == pytest.approx(pvv, rel=1e-6)
    np.testing.assert_allclose(found.covariance / np.outer(u, u), covariance / np.outer(u, u), atol=close)
    np.testing.assert_allclose(found.gain / u[:, None], gain / u[:, None], atol=close * np.abs(gain / u[:, None]).max())
    np.testing.assert_allclose(found.w, w, rtol=2 * module.NEAR)  # weights are of the last factor


def counted(monkeypatch):
    made, before = [], module.FactoredModel.of

    def of(*given, **options):
        made.append(1)
        return before(*given, **options)

    monkeypatch.setattr(module.FactoredModel, "of", staticmethod(of))
    return made


@pytest.mark.parametrize("seed", range(4))
def test_a_dish_against_its_design_is_factorised_once(seed, monkeypatch):
    names, x, y, design, q = dish(60, seed)
    made = counted(monkeypatch)
    found = fit_pose(names, x, y, frame="g", covariance=PlaceCovariances(first=design, second=q))
    assert found.motion.status == "converged"
    assert len(made) == 1
    assert np.all(np.isfinite(found.w))
    assert len(made) == 1


def test_errors_as_large_as_the_group_are_factorised_at_their_own_place(monkeypatch):
    names, x, y, design, q = dish(9, 3)
    made = counted(monkeypatch)
    x = x + (np.linalg.cholesky(full(design * 1e6)) @ np.random.default_rng(0).normal(size=27)).reshape(9, 3)
    fit_pose(names, x, y, frame="g", covariance=PlaceCovariances(first=design * 1e6, second=q))
    assert len(made) > 1


def test_it_needs_one_more_matrix_than_it_is_given():
    names, x, y, design, q = dish(600, 1)
    known = PlaceCovariances(first=design, second=q)
    fit_pose(names[:9], x[:9], y[:9], frame="g", covariance=known.of(np.arange(600) < 9))  # imports
    tracemalloc.start()
    try:
        found = fit_pose(names, x, y, frame="g", covariance=known)
        fit = tracemalloc.get_traced_memory()[1]
        assert np.all(np.isfinite(found.w))
        both = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert fit < 1.8 * q.nbytes  # the factor, and some hundreds of rows at a time
    assert both < 2.5 * q.nbytes  # and a panel of its inverse


def test_points_of_a_larger_covariance_in_other_axes_are_the_matrix_turned():
    names, x, y, design, _ = dish(8, 2)
    rng = np.random.default_rng(9)
    turn = Rotation.from_rotvec([0.3, -0.8, 1.1]).as_matrix()
    every = spread(60, 1e-4, rng)
    rows = rng.permutation(20)[:8]
    at = (3 * rows[:, None] + np.arange(3)).ravel()
    joint = JointPoints(Dense(every), np.arange(60).reshape(20, 3)).of_points(rows)
    big = np.kron(np.eye(8), turn)
    matrix = big @ every[np.ix_(at, at)] @ big.T
    one, other = (
        fit_pose(names, x, y, frame="g", covariance=PlaceCovariances(first=design, second=each), robust=robust)
        for robust in ("igg3",)
        for each in (RotatedPoints(joint, turn), matrix)
    )
    np.testing.assert_allclose(one.translation, other.translation, rtol=0, atol=1e-12)
    np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-9, atol=1e-20)
    np.testing.assert_allclose(one.w, other.w, rtol=1e-6)
    assert one.names == other.names
