"""A body and its points in many epochs: against the whole least squares written out, and against scatter."""

import numpy as np
import pytest
from scipy.stats import chi2

from catseye.errors import EstimationError, ValidityError
from catseye.estimation.harmonic.body import moved, rigid_design, rigid_part
from catseye.estimation.harmonic.eliminated import weights_of
from catseye.estimation.harmonic.series import Spread, fit_harmonics
from catseye.geometry.frames.rotation import from_vector
from draws import draws, same_sigmas


def scene(seed, *, epochs=12, n=5, shared=2, lost=0.15):
    """Arms, functions, covariances of points and what they share, the truth, and which were seen."""
    rng = np.random.default_rng(seed)
    arms = rng.uniform(-20.0, 20.0, (n, 3))
    elevation = rng.uniform(0.1, 1.5, epochs)
    warm = rng.normal(size=epochs)
    body = np.stack([np.sin(elevation), np.cos(elevation), warm], axis=1)
    own = np.ones((epochs, 1))
    roots = rng.normal(size=(epochs, n, 3, 3)) * 1e-4
    points = roots @ np.swapaxes(roots, -1, -2) + 1e-9 * np.eye(3)
    u = rng.normal(size=(epochs, n, 3, shared)) * 3e-4
    seen = rng.random((epochs, n)) > lost
    truth = {"rigid": rng.normal(size=(6, 3)) * np.repeat([1e-2, 1e-4], 3)[:, None]}
    truth["own"] = rng.normal(size=(n, 3, 1)) * 1e-2
    return rng, arms, body, own, points, u, seen, truth


def observed(rng, arms, body, own, points, u, seen, truth):
    """Displacements drawn, NaN where lost; noise by the factor of the whole covariance of each epoch."""
    mean = moved(body @ truth["rigid"].T, arms) + np.einsum("tm,nim->tni", own, truth["own"])
    e = np.einsum("tnij,tnj->tni", np.linalg.cholesky(points), rng.standard_normal(mean.shape))
    e += np.einsum("tniq,tq->tni", u, rng.standard_normal((len(u), u.shape[-1])))
    return np.where(seen[..., None], mean + e, np.nan)


def full_of(points, u):
    """(T, 3n, 3n)."""
    epochs, n = points.shape[:2]
    flat = u.reshape(epochs, 3 * n, -1)
    whole = flat @ np.swapaxes(flat, -1, -2)
    for p in range(n):
        whole[:, 3 * p : 3 * p + 3, 3 * p : 3 * p + 3] += points[:, p]
    return whole


def written_out(y, seen, arms, body, own, full):
    """Least squares with every row in one matrix, its numbers put in one by one: nothing shared with the code."""
    epochs, n = seen.shape
    k, m = body.shape[1], own.shape[1]
    rows, values, places = [], [], []
    for t in range(epochs):
        for p in range(n):
            if not seen[t, p]:
                continue
            for i in range(3):
                row = np.zeros(6 * k + 3 * m * n)
                for f in range(k):
                    row[6 * f + i] = body[t, f]
                    row[6 * f + 3 : 6 * f + 6] = [body[t, f] * np.cross(np.eye(3)[j], arms[p])[i] for j in range(3)]
                for f in range(m):
                    row[6 * k + 3 * m * p + 3 * f + i] = own[t, f]
                rows.append(row)
                values.append(y[t, p, i])
                places.append((t, 3 * p + i))
    a, v = np.array(rows), np.array(values)
    c = np.array([[full[t1][i1, i2] if t1 == t2 else 0.0 for t2, i2 in places] for t1, i1 in places])
    weight = np.linalg.inv(c)
    covariance = np.linalg.inv(a.T @ weight @ a)
    x = covariance @ a.T @ weight @ v
    left = v - a @ x
    return x, covariance, float(left @ weight @ left), len(v) - a.shape[1]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_both_methods_match_explicit_least_squares(seed):
    rng, arms, body, own, points, u, seen, truth = scene(seed)
    y = observed(rng, arms, body, own, points, u, seen, truth)
    full = full_of(points, u)
    x, covariance, pvv, freedom = written_out(y, seen, arms, body, own, full)
    k, n = body.shape[1], len(arms)
    together = fit_harmonics(y, arms, body=body, own=own, spread=Spread(full=full))
    apart = fit_harmonics(y, arms, body=body, own=own, spread=Spread(points=points, shared=u))
    for found in (together, apart):
        np.testing.assert_allclose(found.rigid, x[: 6 * k].reshape(k, 6).T, rtol=0, atol=1e-10)
        np.testing.assert_allclose(found.own[:, :, 0], x[6 * k :].reshape(n, 3), rtol=0, atol=1e-10)
        scale = np.sqrt(np.diag(covariance))
        np.testing.assert_allclose(found.rigid_covariance, covariance[: 6 * k, : 6 * k], rtol=1e-5, atol=1e-18)
        for p in range(n):
            at = slice(6 * k + 3 * p, 6 * k + 3 * p + 3)
            norm = np.outer(scale[at], scale[at])
            np.testing.assert_allclose(found.own_covariance[p] / norm, covariance[at, at] / norm, rtol=0, atol=1e-6)
            norm = np.outer(scale[at], scale[: 6 * k])
            np.testing.assert_allclose(found.cross[p] / norm, covariance[at, : 6 * k] / norm, rtol=0, atol=1e-6)
        assert found.pvv == pytest.approx(pvv, rel=1e-6)
        assert found.degrees_of_freedom == freedom
    np.testing.assert_allclose(together.six, apart.six, rtol=0, atol=1e-10)
    scale = np.sqrt(np.diag(together.six_covariance))
    norm = np.outer(scale, scale)
    np.testing.assert_allclose(apart.six_covariance / norm, together.six_covariance / norm, rtol=0, atol=1e-6)
    np.testing.assert_allclose(
        apart.covariance(body, own, arms), together.covariance(body, own, arms), rtol=1e-6, atol=1e-18
    )
    whole = together.whole_covariance(body[:2], own[:2], arms)
    for p in range(n):
        at = slice(3 * p, 3 * p + 3)
        np.testing.assert_allclose(together.covariance(body[:2], own[:2], arms)[:, p], whole[:, at, at], atol=1e-20)


def test_points_with_separate_functions_equal_separate_fits():
    rng, arms, body, own, points, u, seen, truth = scene(7, epochs=30, shared=0, lost=0.0)
    y = observed(rng, arms, body, own, points, u, seen, truth)
    both = np.concatenate([own, body], axis=1)
    found = fit_harmonics(y, arms, body=np.zeros((30, 0)), own=both, spread=Spread(points=points))
    for p in range(len(arms)):
        root = np.linalg.inv(np.linalg.cholesky(points[:, p]))
        design = root @ np.einsum("tf,ij->tifj", both, np.eye(3)).reshape(30, 3, -1)
        alone = np.linalg.lstsq(design.reshape(90, -1), (root @ y[:, p, :, None]).ravel(), rcond=None)[0]
        np.testing.assert_allclose(found.own[p], alone.reshape(4, 3).T, rtol=0, atol=1e-11)
    # the body's motion, which each point followed, is their rigid part
    u_six = np.sqrt(np.diag(found.six_covariance)).reshape(4, 6).T
    assert np.all(np.abs(found.six[:, 1:] - truth["rigid"]) < 5.0 * u_six[:, 1:])
    assert np.isnan(fit_harmonics(y[:, :2], arms[:2], body=body[:, :0], own=both, spread=Spread(points=points[:, :2]))
                    .six).all()  # fmt: skip


def test_small_turns_are_turns():
    rng = np.random.default_rng(3)
    arms, six = rng.uniform(-50, 50, (7, 3)), np.concatenate([rng.normal(size=3), 1e-6 * rng.normal(size=3)])
    exact = arms @ from_vector(six[3:]).T + six[:3] - arms
    np.testing.assert_allclose(moved(six[None], arms)[0], exact, rtol=0, atol=1e-9)  # half of 1e-6^2 of 50 m
    np.testing.assert_allclose(rigid_design(arms) @ six, exact, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.einsum("jni,ni->j", rigid_part(arms), rigid_design(arms) @ six), six, atol=1e-12)
    assert rigid_part(np.outer(np.arange(4.0), [1.0, 2.0, 3.0])) is None


def test_inverses_by_adjugates_are_numpys():
    rng = np.random.default_rng(5)
    root = rng.normal(size=(6, 4, 3, 3))
    q = (root @ np.swapaxes(root, -1, -2) + 0.01 * np.eye(3)) * 1e-9
    np.testing.assert_allclose(weights_of(q, np.ones((6, 4), bool)), np.linalg.inv(q), rtol=1e-8)


@draws(400)
@pytest.mark.parametrize("way", ["together", "apart"])
def test_claimed_covariance_is_the_scatter(way, runs):
    """Every unknown's and every prediction's spread over the draws, and chi-squares, against what was claimed."""
    rng, arms, body, own, points, u, seen, truth = scene(11, n=4, lost=0.1)
    spread = Spread(full=full_of(points, u)) if way == "together" else Spread(points=points, shared=u)
    new_body, new_own = np.array([[np.sin(0.7), np.cos(0.7), 2.0]]), np.ones((1, 1))
    wanted = moved(new_body @ truth["rigid"].T, arms)[0] + truth["own"][..., 0]
    squares, predicted, pvv = [], [], []
    for _ in range(runs):
        found = fit_harmonics(
            observed(rng, arms, body, own, points, u, seen, truth), arms, body=body, own=own, spread=spread
        )
        off = (found.rigid - truth["rigid"]).T.ravel()
        squares.append(off @ np.linalg.solve(found.rigid_covariance, off))
        e = found.displacement(new_body, new_own, arms)[0] - wanted
        q = found.covariance(new_body, new_own, arms)[0]
        predicted.append([e[p] @ np.linalg.solve(q[p], e[p]) for p in range(len(arms))])
        pvv.append(found.pvv)
    for values, freedom in ((squares, 18), (pvv, found.degrees_of_freedom), *((v, 3) for v in np.array(predicted).T)):
        assert abs(np.mean(values) - freedom) < 4.0 * np.sqrt(2.0 * freedom / runs)
        assert np.mean(np.array(values) > chi2.ppf(0.95, freedom)) < 0.05 + same_sigmas(0.05, 400, runs)


def test_floating_unknowns_and_invalid_covariances_are_refused():
    rng, arms, body, own, points, u, seen, truth = scene(2, shared=0, lost=0.0)
    y = observed(rng, arms, body, own, points, u, seen, truth)
    spread = Spread(points=points)
    twice = np.concatenate([body, own], axis=1)  # constant shift of the body, and of each point
    for way in (spread, Spread(full=full_of(points, u))):
        with pytest.raises(EstimationError, match="float together"):
            fit_harmonics(y, arms, body=twice, own=own, spread=way)
    with pytest.raises(EstimationError, match=r"of point 0 .* float"):
        fit_harmonics(y, arms, body=body[:, :0], own=np.ones((len(y), 2)), spread=spread)
    with pytest.raises(EstimationError, match=r"point 3 .* in no epoch"):
        fit_harmonics(np.where(np.arange(5)[:, None] == 3, np.nan, y), arms, body=body, own=own, spread=spread)
    with pytest.raises(ValidityError, match="no variance above 0"):
        fit_harmonics(y, arms, body=body, own=own, spread=Spread(points=-points))
    with pytest.raises(ValidityError, match="not positive"):
        fit_harmonics(y, arms, body=body, own=own, spread=Spread(points=np.ones((1, 1, 3, 3))))
    with pytest.raises(ValidityError, match=r"epoch 0 .* not positive"):
        fit_harmonics(y, arms, body=body, own=own, spread=Spread(full=np.ones((1, 15, 15))))
    with pytest.raises(ValidityError, match="no function"):
        fit_harmonics(y, arms, body=body[:, :0], own=own[:, :0], spread=spread)
    with pytest.raises(ValidityError, match="neither"):
        fit_harmonics(y, arms, body=body, own=own, spread=Spread())
    with pytest.raises(ValidityError, match="fewer epochs"):
        fit_harmonics(y, arms, body=body, own=own, spread=Spread(points=points, shared=np.ones((1, 5, 3, 1000))))
