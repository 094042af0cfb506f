"""A motion is recovered exactly, weighted at the optimum, whatever the datum; its covariance holds in scatter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import polar
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from catseye.errors import EstimationError
from catseye.estimation.shapes.rigid_body import CONVERGED, MIRRORED, closed_form, fit_transformation, motion_columns
from draws import draws

KINDS = ("rigid", "similarity", "affine")


def true_matrix(kind, rng):
    turn = Rotation.random(rng=rng).as_matrix()
    strained = turn @ (np.eye(3) + 0.05 * rng.normal(size=(3, 3)))
    return {"rigid": turn, "similarity": 1.3 * turn, "affine": strained}[kind]


def covariance_of(rng, m, sigma):
    root = rng.normal(size=(m, 2 * m)) * sigma / np.sqrt(2 * m)
    return root @ root.T


@settings(max_examples=40)
@given(st.integers(0, 2**31), st.sampled_from(KINDS), st.integers(4, 12))
def test_points_moved_exactly_give_the_motion_back(seed, kind, n):
    rng = np.random.default_rng(seed)
    first, matrix, shift = rng.uniform(-30, 30, (n, 3)), true_matrix(kind, rng), rng.uniform(-1e3, 1e3, 3)
    found = fit_transformation(first, first @ matrix.T + shift, kind=kind, covariance_first=np.eye(3 * n) * 1e-10)
    assert found.status == CONVERGED
    np.testing.assert_allclose(found.apply(np.zeros(3)), shift, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.matrix, matrix, rtol=0, atol=1e-9)  # 30 points' metres, ill-placed at worst
    assert np.abs(found.residual).max() < 1e-11


@pytest.mark.parametrize("seed", range(5))
def test_equal_weights_match_scipy_alignment(seed):
    rng = np.random.default_rng(seed)
    first = rng.uniform(-10, 10, (7, 3))
    second = first @ true_matrix("rigid", rng).T + 3.0 + rng.normal(size=(7, 3)) * 0.1
    found = fit_transformation(first, second)
    theirs, distance = Rotation.align_vectors(second - second.mean(axis=0), first - first.mean(axis=0))
    np.testing.assert_allclose(found.matrix, theirs.as_matrix(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.rotation, theirs.as_rotvec(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.pvv, distance**2, rtol=1e-10)
    assert found.degrees_of_freedom == 15
    np.testing.assert_allclose(found.variance_factor, found.pvv / 15)
    closed, mirrored = closed_form(first, second)
    np.testing.assert_allclose(closed, found.matrix, rtol=0, atol=1e-12)
    assert not mirrored


@pytest.mark.parametrize("kind", KINDS)
def test_the_optimum_is_that_of_all_true_points_as_unknowns(kind):
    """A least squares that knows nothing of ours: the true points are unknowns beside the parameters."""
    rng = np.random.default_rng(8)
    n = 6
    true, matrix = rng.uniform(-5, 5, (n, 3)), true_matrix(kind, rng)
    joint = covariance_of(rng, 6 * n, 0.05)  # both sets correlated, 5 cm: the curvature of the problem shows
    noise = np.linalg.cholesky(joint) @ rng.normal(size=6 * n)
    first, second = true + noise[: 3 * n].reshape(-1, 3), true @ matrix.T + 1.0 + noise[3 * n :].reshape(-1, 3)
    blocks = {"covariance_first": joint[: 3 * n, : 3 * n], "covariance_second": joint[3 * n :, 3 * n :]}
    found = fit_transformation(first, second, kind=kind, cross=joint[: 3 * n, 3 * n :], **blocks)
    white = np.linalg.inv(np.linalg.cholesky(joint))

    def residuals(p):
        if kind == "affine":
            m = p[3:12].reshape(3, 3)
        else:
            m = Rotation.from_rotvec(p[3:6]).as_matrix() @ found.matrix * (p[6] if kind == "similarity" else 1.0)
        points = p[-3 * n :].reshape(-1, 3)
        image = found.pivot + p[:3] + (points - found.pivot) @ m.T
        return white @ np.concatenate([(first - points).ravel(), (second - image).ravel()])

    tail = {"rigid": np.zeros(3), "similarity": np.array([0, 0, 0, 1.0]), "affine": found.matrix.ravel()}[kind]
    start = np.concatenate([found.translation + 0.01, tail, first.ravel()])
    theirs = least_squares(residuals, start, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
    k = 3 + len(tail)
    np.testing.assert_allclose(found.pvv, 2 * theirs.cost, rtol=1e-8)
    np.testing.assert_allclose(theirs.x[:k], np.concatenate([found.translation, tail]), rtol=0, atol=1e-5)
    covariance = np.linalg.inv(theirs.jac.T @ theirs.jac)[:k, :k].copy()
    if kind == "similarity":  # theirs is relative to our scale
        covariance[6] *= found.scale
        covariance[:, 6] *= found.scale
    size = np.sqrt(np.diag(covariance))  # curvature and residuals: the second order is all that may differ
    np.testing.assert_allclose(found.covariance / size / size[:, None], covariance / size / size[:, None], atol=0.03)


def inner_datum(points, q):
    """Covariance brought to inner constraints of all points, by plain projection."""
    g, _ = np.linalg.qr(motion_columns(points, points.mean(axis=0))[:, :6])
    project = np.eye(len(q)) - g @ g.T
    return project @ q @ project


@settings(max_examples=25)
@given(st.integers(0, 2**31))
def test_residuals_do_not_depend_on_how_either_network_was_held(seed):
    rng = np.random.default_rng(seed)
    n, sigma = 7, 1e-4
    first = rng.uniform(-20, 20, (n, 3))
    full = covariance_of(rng, 3 * n, sigma)
    matrix = true_matrix("rigid", rng)
    second = first @ matrix.T + rng.normal(size=(n, 3)) * sigma
    q2 = covariance_of(rng, 3 * n, sigma)
    free = fit_transformation(first, second, covariance_first=full, covariance_second=q2)
    g1, g2 = (motion_columns(p, np.zeros(3))[:, :6] @ rng.normal(size=(6, 4)) * 1e-4 for p in (first, second))
    for other1, other2 in (
        (inner_datum(first, full), inner_datum(second, q2)),
        (full + g1 @ g1.T, q2 + g2 @ g2.T),  # 0.1 mrad of the datum's own: 20 sigmas at a point
        (inner_datum(first, full), np.zeros_like(q2)),
    ):
        if not other2.any():
            free = fit_transformation(first, second, covariance_first=full)
        held = fit_transformation(first, second, covariance_first=other1, covariance_second=other2)
        assert held.degrees_of_freedom == free.degrees_of_freedom == 15
        np.testing.assert_allclose(held.pvv, free.pvv, rtol=1e-5)  # a linear turn of 0.1 mrad also stretches by 5e-9


def scatter(runs, seed):
    rng = np.random.default_rng(seed)
    n, sigma = 5, 2e-4
    true, matrix = rng.uniform(-5, 5, (n, 3)), true_matrix("rigid", rng)
    q1 = inner_datum(true, covariance_of(rng, 3 * n, sigma))
    q2 = covariance_of(rng, 3 * n, 2 * sigma)
    root1, root2 = (np.linalg.svd(q)[0] * np.sqrt(np.linalg.svd(q)[1]) for q in (q1, q2))
    errors, pvv = np.zeros((runs, 6)), np.zeros(runs)
    for k in range(runs):
        first = true + (root1 @ rng.normal(size=3 * n)).reshape(-1, 3)
        second = true @ matrix.T + (root2 @ rng.normal(size=3 * n)).reshape(-1, 3)
        found = fit_transformation(first, second, covariance_first=q1, covariance_second=q2, pivot=np.zeros(3))
        errors[k, :3] = found.translation
        errors[k, 3:] = Rotation.from_matrix(found.matrix @ matrix.T).as_rotvec()
        pvv[k] = found.pvv
    return errors, pvv, found


def check_scatter(runs, seed):
    errors, pvv, found = scatter(runs, seed)
    white = errors @ np.linalg.inv(np.linalg.cholesky(found.covariance)).T
    np.testing.assert_allclose(white.T @ white / runs, np.eye(6), atol=5.0 * np.sqrt(2.0 / runs))
    assert abs(pvv.mean() - 9.0) < 4.0 * np.sqrt(18.0 / runs)
    assert np.all(np.abs(white.mean(axis=0)) < 4.0 / np.sqrt(runs))


@draws(300)
def test_the_claimed_covariance_holds_in_seeded_runs(runs):
    check_scatter(runs, 21)


@pytest.mark.slow
def test_the_claimed_covariance_holds_in_2000_seeded_runs():
    check_scatter(2000, 22)


@pytest.mark.parametrize("kind", KINDS)
def test_another_pivot_changes_translation_and_covariance_and_nothing_else(kind):
    rng = np.random.default_rng(3)
    first, matrix = rng.uniform(-5, 5, (6, 3)), true_matrix(kind, rng)
    second = first @ matrix.T + rng.normal(size=(6, 3)) * 1e-3
    q = covariance_of(rng, 18, 1e-3)
    here = fit_transformation(first, second, kind=kind, covariance_second=q)
    far = np.array([100.0, -40.0, 7.0])
    there = fit_transformation(first, second, kind=kind, covariance_second=q, pivot=far)
    moved = here.about(far)
    np.testing.assert_allclose(moved.translation, there.translation, rtol=0, atol=1e-9)
    np.testing.assert_allclose(moved.covariance, there.covariance, rtol=1e-6, atol=1e-9 * there.covariance.max())
    np.testing.assert_allclose(moved.apply(first), here.apply(first), rtol=0, atol=1e-12)
    back = moved.about(here.pivot)
    np.testing.assert_allclose(back.covariance, here.covariance, atol=1e-9 * here.covariance.max())


def test_strain_is_the_stretch_and_its_covariance_the_derivative():
    rng = np.random.default_rng(4)
    first = rng.uniform(-5, 5, (8, 3))
    matrix = Rotation.from_rotvec([0.4, -0.2, 0.9]).as_matrix() @ np.diag([1.01, 0.98, 1.0])
    found = fit_transformation(first, first @ matrix.T, kind="affine", covariance_second=np.eye(24) * 1e-8)
    value, q = found.strain()
    turn, stretch = polar(found.matrix)
    np.testing.assert_allclose(value[:3], Rotation.from_matrix(turn).as_rotvec(), atol=1e-12)
    np.testing.assert_allclose(value[3:], (stretch - np.eye(3))[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]], atol=1e-12)
    slope = np.zeros((9, 9))
    for i, one in enumerate(np.eye(9) * 1e-6):
        ends = []
        for sign in (1, -1):
            r, p = polar(found.matrix + sign * one.reshape(3, 3))
            ends.append(np.concatenate([Rotation.from_matrix(r @ turn.T).as_rotvec(), (p - stretch).ravel()]))
        slope[:, i] = ((ends[0] - ends[1]) / 2e-6)[[0, 1, 2, 3, 7, 11, 8, 5, 4]]
    np.testing.assert_allclose(q, slope @ found.covariance[3:, 3:] @ slope.T, atol=1e-7 * q.max())
    rigid = fit_transformation(first, first @ turn.T, covariance_second=np.eye(24) * 1e-8)
    value, q = rigid.strain()
    np.testing.assert_allclose(value[3:], 0.0, atol=1e-12)
    np.testing.assert_allclose(q[:3, :3], rigid.covariance[3:, 3:], atol=1e-12 * q.max())
    assert np.abs(q[3:, 3:]).max() < 1e-20  # a rigid fit has no strain, and is sure of it


def test_undetermined_transformations_are_named():
    line = np.outer(np.arange(4.0), [1.0, 2.0, 2.0])
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1.5, 0]], dtype=float)
    with pytest.raises(EstimationError, match=r"needs 3 points, 2 given \(A, B\): the turn about the line"):
        fit_transformation(line[:2], line[:2], names=["A", "B"])
    with pytest.raises(EstimationError, match=r"on one line: the turn about \(0.333, 0.667, 0.667\) floats"):
        fit_transformation(line, line)
    with pytest.raises(EstimationError, match=r"in one plane: strain along its normal \(0.000, 0.000, 1.000\)"):
        fit_transformation(flat, flat, kind="affine")
    with pytest.raises(EstimationError, match="all at one place"):
        fit_transformation(np.ones((4, 3)), flat)
    with pytest.raises(EstimationError, match="zero variance"):  # two points exact in both sets, and a third
        fit_transformation(flat, flat, covariance_second=np.diag([0.0] * 9 + [1e-8] * 3), names=list("ABCD"))
    with pytest.raises(EstimationError, match="not symmetric"):
        fit_transformation(flat, flat, covariance_second=np.triu(np.ones((12, 12))))
    with pytest.raises(EstimationError, match="invalid covariance"):
        fit_transformation(flat, flat + 0.1, covariance_second=np.eye(12) - 0.5 * np.ones((12, 12)))


def test_mirror_image_and_weak_rotation_are_reported():
    rng = np.random.default_rng(6)
    points = rng.uniform(-5, 5, (6, 3))
    mirrored = fit_transformation(points, points * [1, 1, -1])
    assert mirrored.status == MIRRORED
    assert np.linalg.det(mirrored.matrix) > 0.99
    with pytest.raises(EstimationError, match="mirrored"):
        mirrored.require_converged()
    thin = points * [1, 1e-4, 1e-4]
    weak = fit_transformation(thin, thin, covariance_second=np.eye(18) * 1e-6)
    assert weak.status.replace("-", "").startswith("weak: the rotation about (1.000")
