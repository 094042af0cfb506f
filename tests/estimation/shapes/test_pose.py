"""A pose is what was done to the points, weighted as the covariances say; one point that moved alone is found."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from catseye.errors import EstimationError, FrameError
from catseye.estimation.shapes.pose import METHODS, PlaceCovariances, fit_pose, relative_pose
from catseye.geometry.frames.frame import Transform
from draws import draws

SHIFT, TURN = np.array([4e-4, -2e-4, 3e-4]), np.array([2e-5, -1e-5, 3e-5])


def points(n=12, seed=0):
    return np.random.default_rng(seed).uniform(-30.0, 30.0, (n, 3))


def moved(x, turn=TURN, shift=SHIFT, pivot=(0.0, 0.0, 0.0)):
    pivot = np.asarray(pivot)
    return pivot + shift + Rotation.from_rotvec(turn).apply(x - pivot)


def spread(n, sigma=5e-5, seed=1):
    root = np.random.default_rng(seed).normal(size=(3 * n, 6 * n)) * sigma / np.sqrt(6 * n)
    return root @ root.T


def names(n):
    return [f"P{k:02d}" for k in range(n)]


def test_applied_motion_is_recovered_about_any_pivot():
    x, pivot = points(), np.array([3.0, -70.0, 20.0])
    found = fit_pose(
        names(12), x, moved(x, pivot=pivot), frame="ground", covariance=PlaceCovariances(second=spread(12)), pivot=pivot
    )
    np.testing.assert_allclose(found.translation, SHIFT, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.rotation, TURN, rtol=0, atol=1e-13)
    assert found.motion.degrees_of_freedom == 30
    assert found.p == pytest.approx(1.0)
    assert found.frame == "ground"


def test_the_fit_is_scipys_with_both_covariances():
    """An independent solver: rotation vector and shift, residuals whitened with the covariance of the difference."""
    rng, x = np.random.default_rng(4), points()
    q1, q2 = spread(12, seed=2), spread(12, seed=3)
    first = x + rng.multivariate_normal(np.zeros(36), q1).reshape(-1, 3)
    second = moved(x) + rng.multivariate_normal(np.zeros(36), q2).reshape(-1, 3)
    found = fit_pose(
        names(12), first, second, frame="g", covariance=PlaceCovariances(first=q1, second=q2), pivot=np.zeros(3)
    )
    white = np.linalg.inv(np.linalg.cholesky(q1 + q2))  # turns of 1e-5 do not change Q1

    def residuals(p):
        return white @ (second - moved(first, p[3:] * 1e-5, p[:3] * 1e-4)).ravel()

    theirs = least_squares(residuals, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    scale = np.array([1e-4] * 3 + [1e-5] * 3)
    wanted = np.concatenate([found.translation, found.rotation])
    np.testing.assert_allclose(theirs.x * scale / found.u, wanted / found.u, rtol=0, atol=1e-3)  # of a standard u
    assert found.motion.pvv == pytest.approx(2 * theirs.cost, rel=1e-4)
    theirs_q = np.linalg.inv(theirs.jac.T @ theirs.jac) * np.outer(scale, scale)
    np.testing.assert_allclose(theirs_q / np.outer(found.u, found.u), found.covariance / np.outer(found.u, found.u),
                               rtol=0, atol=1e-3)  # fmt: skip


def test_the_gain_is_the_derivative_of_the_fit():
    x, q = points(6), spread(6)
    y = moved(x) + np.random.default_rng(8).normal(size=x.shape) * 5e-5
    found = fit_pose(names(6), x, y, frame="g", covariance=PlaceCovariances(second=q), pivot=np.ones(3))
    for k in range(18):
        step = np.zeros(18)
        step[k] = 1e-5
        other = fit_pose(
            names(6), x, y + step.reshape(-1, 3), frame="g", covariance=PlaceCovariances(second=q), pivot=np.ones(3)
        )
        change = np.concatenate([other.translation - found.translation, other.rotation - found.rotation])
        # second order and rounding: 1e-5 of turns of 3e-5
        np.testing.assert_allclose(change / 1e-5, found.gain[:, k], rtol=0, atol=1e-4 * np.abs(found.gain).max())
    again = found.about(np.array([0.0, 5.0, 40.0]))
    direct = fit_pose(
        names(6), x, y, frame="g", covariance=PlaceCovariances(second=q), pivot=np.array([0.0, 5.0, 40.0])
    )
    np.testing.assert_allclose(again.gain, direct.gain, rtol=0, atol=1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_a_point_that_moved_alone_is_left_out_and_the_rest_is_right(method):
    rng, n = np.random.default_rng(6), 20
    x, q = points(n), np.eye(60) * 25e-10
    y = moved(x) + rng.normal(size=x.shape) * 5e-5
    y[3] += [2e-3, 0.0, -1e-3]
    y[11] += [0.0, 5e-4, 0.0]
    found = fit_pose(names(n), x, y, frame="g", covariance=PlaceCovariances(second=q), pivot=np.zeros(3), robust=method)
    assert set(found.left_out) == {"P03", "P11"}
    assert min(found.left_out.values()) > 4.0
    clean = np.setdiff1d(np.arange(n), [3, 11])
    direct = fit_pose([names(n)[k] for k in clean], x[clean], y[clean], frame="g",
                      covariance=PlaceCovariances(second=np.eye(54) * 25e-10), pivot=np.zeros(3))  # fmt: skip
    np.testing.assert_array_equal(found.translation, direct.translation)
    np.testing.assert_array_equal(found.covariance, direct.covariance)
    plain = fit_pose(names(n), x, y, frame="g", covariance=PlaceCovariances(second=q))
    assert plain.p < 1e-6
    assert int(np.argmax(plain.w)) == 3


@draws(20)
def test_good_points_stay_with_a_robust_start(runs):
    kept = []
    for seed in range(runs):
        rng = np.random.default_rng(100 + seed)
        x = points(15, seed)
        y = moved(x) + rng.normal(size=x.shape) * 5e-5
        found = fit_pose(
            names(15), x, y, frame="g", covariance=PlaceCovariances(second=np.eye(45) * 25e-10), robust="igg3"
        )
        kept.append(len(found.names))
    assert sum(15 - k for k in kept) <= 2 * runs // 20  # of 45 coordinates each beyond 4 sigma: 0.003 expected


def test_a_pose_in_other_axes_moves_the_same_points():
    x, q = points(), spread(12)
    turn = Rotation.from_rotvec([0.4, -1.0, 0.3]).as_matrix()
    to = Transform("reflector", "ground", turn, np.array([1.0, 50.0, -3.0]))
    found = fit_pose(names(12), x, moved(x), frame="ground", covariance=PlaceCovariances(second=q))
    told = found.in_frame(to)
    np.testing.assert_allclose(told.motion.apply(to.points(x)), to.points(found.motion.apply(x)), rtol=0, atol=1e-13)
    both = np.kron(np.eye(12), turn)
    direct = fit_pose(
        names(12),
        to.points(x),
        to.points(moved(x)),
        frame="reflector",
        covariance=PlaceCovariances(second=both @ q @ both.T),
        pivot=told.pivot,
    )
    np.testing.assert_allclose(told.covariance, direct.covariance, rtol=0, atol=1e-9 * np.abs(direct.covariance).max())
    np.testing.assert_allclose(told.gain, direct.gain, rtol=0, atol=1e-7)
    with pytest.raises(FrameError, match="'reflector' cannot be transformed"):
        told.in_frame(to)


def test_a_body_seen_from_another_that_moved_with_it_has_not_moved():
    x, y = points(seed=1), points(seed=2) + np.array([0.0, 0.0, 60.0])
    a = fit_pose(names(12), x, moved(x), frame="r", covariance=PlaceCovariances(second=spread(12)), pivot=np.zeros(3))
    b = fit_pose(
        names(12),
        y,
        moved(y),
        frame="r",
        covariance=PlaceCovariances(second=spread(12)),
        pivot=np.array([0.0, 0.0, 60.0]),
    )
    still, q = relative_pose(b, a, np.zeros((6, 6)))
    np.testing.assert_allclose(still, 0.0, atol=5e-8)  # 60 m times (3.7e-5)^2 / 2
    np.testing.assert_allclose(np.diag(q), b.u**2 + a.about(b.pivot).u ** 2, rtol=1e-12)
    with pytest.raises(FrameError, match="cannot be subtracted"):
        relative_pose(b.in_frame(Transform("x", "r", np.eye(3), np.zeros(3))), a, np.zeros((6, 6)))


def test_points_that_share_every_error_tell_the_relative_motion_better():
    """The covariance between two poses, propagated through their gains, against many draws."""
    rng, x, y = np.random.default_rng(9), points(6, 1), points(6, 2)
    root = rng.normal(size=(36, 40)) * 1e-5
    q = root @ root.T
    a = fit_pose(names(6), x, x, frame="r", covariance=PlaceCovariances(second=q[:18, :18]), pivot=np.zeros(3))
    b = fit_pose(names(6), y, y, frame="r", covariance=PlaceCovariances(second=q[18:, 18:]), pivot=np.ones(3))
    _, claimed = relative_pose(b, a, b.gain @ q[18:, :18] @ a.gain.T)
    draws = rng.multivariate_normal(np.zeros(36), q, 4000)
    six_a, six_b = draws[:, :18] @ a.gain.T, draws[:, 18:] @ b.gain.T
    carried = six_a[:, :3] + np.cross(six_a[:, 3:], np.ones(3))
    seen = np.cov(np.hstack([six_b[:, :3] - carried, six_b[:, 3:] - six_a[:, 3:]]).T)
    half = np.linalg.inv(np.linalg.cholesky(claimed))
    np.testing.assert_allclose(half @ seen @ half.T, np.eye(6), rtol=0, atol=0.1)  # 4 of 0.022


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"covariance": PlaceCovariances()}, "both are missing"),
        ({"robust": "median"}, "unknown robust method"),
        ({"covariance": PlaceCovariances(second=np.eye(5))}, "expected"),
    ],
)
def test_what_cannot_be_fitted_is_said_in_one_line(change, said):
    given = {"frame": "g", "covariance": PlaceCovariances(second=spread(5)), **change}
    with pytest.raises(EstimationError, match=said):
        fit_pose(names(5), points(5), points(5), **given)


def test_points_on_a_line_are_refused_by_name():
    line = np.arange(5.0)[:, None] * [1.0, 2.0, 0.0]
    with pytest.raises(EstimationError, match="on one line"):
        fit_pose(names(5), line, line, frame="g", covariance=PlaceCovariances(second=spread(5)))


def test_errors_common_to_both_epochs_cancel_in_every_row():
    """Largest normalised error by hand: all weights from the joint covariance of both epochs, (-R, 1) C (-R, 1)'."""
    n, rng = 8, np.random.default_rng(5)
    x, matrix = points(n), Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
    root = rng.normal(size=(6 * n, 9 * n)) * 5e-5
    root[3 * n :] += 0.7 * root[: 3 * n]  # the second epoch shares much of the first
    joint = root @ root.T
    noise = rng.multivariate_normal(np.zeros(6 * n), joint).reshape(2, n, 3)
    first, second = x + noise[0], x @ matrix.T + noise[1]
    found = fit_pose(
        names(n),
        first,
        second,
        frame="ground",
        covariance=PlaceCovariances(
            first=joint[: 3 * n, : 3 * n], second=joint[3 * n :, 3 * n :], cross=joint[: 3 * n, 3 * n :]
        ),
    )
    turned = np.hstack([-np.kron(np.eye(n), found.motion.matrix), np.eye(3 * n)])
    weight = np.linalg.inv(turned @ joint @ turned.T)
    arm = (first - found.pivot) @ found.motion.matrix.T
    columns = np.concatenate([np.hstack([np.eye(3), -np.cross(np.eye(3), a)]) for a in arm])
    left = (second - found.motion.apply(first)).ravel()
    cofactor = np.linalg.inv(weight) - columns @ np.linalg.inv(columns.T @ weight @ columns) @ columns.T
    w = np.abs(weight @ left) / np.sqrt(np.diag(weight @ cofactor @ weight))
    assert found.w == pytest.approx(w.reshape(n, 3).max(axis=1), rel=1e-3)


def four(seed, moved, u=1e-4):
    """Four points of a site, one or more moved by some centimetres."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-20, 20, (4, 3))
    y = x + rng.normal(0, u, (4, 3))
    for k in moved:
        y[k] += rng.normal(0, 0.03, 3)
    return [f"P{k}" for k in range(4)], x, y, PlaceCovariances(second=u**2 * np.eye(12))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(6))
def test_of_four_points_the_one_that_moved_is_left_out_by_every_robust_method(method, seed):
    called, x, y, covariance = four(seed, [seed % 4])
    found = fit_pose(called, x, y, frame="ground", covariance=covariance, robust=method)
    assert list(found.left_out) == [f"P{seed % 4}"]
    plain = fit_pose(found.names, *(np.delete(v, seed % 4, axis=0) for v in (x, y)), frame="ground",
                     covariance=PlaceCovariances(second=1e-8 * np.eye(9)))  # fmt: skip
    np.testing.assert_allclose(found.about(plain.pivot).translation, plain.translation, atol=1e-9)


def test_two_moved_of_four_points_are_refused_with_the_attempts():
    called, x, y, covariance = four(2, [0, 3])
    with pytest.raises(
        EstimationError, match=r"without any of the 4 points \(best without P\d, p .*more than one moved"
    ):
        fit_pose(called, x, y, frame="ground", covariance=covariance, robust="huber")
