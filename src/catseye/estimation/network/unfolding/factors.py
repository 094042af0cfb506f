"""Figures from the factors of their squared ranges: closed algebra, or a search over small matrices.

With s_i about the stations' mean and t_j about the targets' mean, the squared ranges minus their row and column means
are -2 s_i . t_j: a matrix of rank 3 (2 if the stations or the targets lie in one plane). Its factors u, v are
the figure up to an affine map A; the row and column means then fix the map, because they contain |s_i|^2 and |t_j|^2.
Sizes here are about 1.
"""

import numpy as np

Figure = tuple[np.ndarray, np.ndarray]  # stations (s, d) and targets (t, d)
Means = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # u (s, d), v (t, d), row means (s,), column means (t,)


def classical_scaling(distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points from all mutual distances, up to a rigid motion and a mirror image, and eigenvalues.

    distances   (n, n) m, symmetric, complete, n >= 4

    Returns xyz (n, 3) m about the mean, along principal axes by decreasing extent, and the (n,) eigenvalues (m^2) in
    decreasing order: from the fourth on they are zero except for errors; an equally small third means coplanar points.

    Source: [TORGERSON52], eigenvectors of the doubly centred squares.

    >>> xyz, values = classical_scaling(np.ones((4, 4)) - np.eye(4))
    >>> values.round(6)
    array([0.5, 0.5, 0.5, 0. ])
    """
    squares = np.asarray(distances, dtype=float) ** 2
    inner = -0.5 * _without_means(squares)
    values, vectors = np.linalg.eigh((inner + inner.T) / 2)
    values, vectors = values[::-1], vectors[:, ::-1]
    return vectors[:, :3] * np.sqrt(np.maximum(values[:3], 0.0)), np.where(np.abs(values) < 1e-14, 0.0, values)


def _without_means(a: np.ndarray) -> np.ndarray:
    """Matrix minus the means of its rows and columns."""
    return a - a.mean(axis=0) - a.mean(axis=1)[:, None] + a.mean()


def in_space(points: np.ndarray) -> np.ndarray:
    """Points (n, 2) as (n, 3) with z = 0.

    (n, 3) unchanged.
    """
    return np.hstack([points, np.zeros((len(points), 3 - points.shape[1]))])


def factors(squares: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Factors u (s, k), v (t, k) of the squared ranges (s, t), and singular values (k,).

    In decreasing order, k = min(s, t).
    """
    left, values, right = np.linalg.svd(-0.5 * _without_means(squares), full_matrices=False)
    root = np.sqrt(len(left))
    return left * root, right.T * values / root, values


def upgraded(
    squares: np.ndarray, u: np.ndarray, v: np.ndarray, *, search: int, rng: np.random.Generator
) -> list[Figure]:
    """Figures A u_i and b + A^-T v_j with means nearest to those of the squares, best first.

    The quadrics through ten stations or ten targets (six in a plane) give A; without them, `search` random maps do.
    """
    d = u.shape[1]
    additive = squares + 2 * u @ v.T
    row, column = additive.mean(axis=1), additive.mean(axis=0)
    means = (u, v, row, column)
    maps = []
    if search:
        maps = list(np.exp(rng.uniform(-3.0, 0.5, (search, d, 1))) * rng.normal(size=(search, d, d)))
    elif (m := _metric(u, row)) is not None:
        maps.append(_root(m))
    if not search and (m := _metric(v, column)) is not None:
        maps.append(np.linalg.inv(_root(m)).T)
    if not maps:
        return []
    a = np.linalg.qr(np.array(maps))[1]  # the rotation of the figure is free
    a, b, cost = match_means(a, _offset(a, means), means)
    order = [k for k in np.argsort(cost) if np.isfinite(cost[k])][: 12 if search else 2]
    return [(u @ a[k].T, b[k] + v @ np.linalg.inv(a[k])) for k in order]


def in_plane(squares: np.ndarray) -> list[Figure]:
    """Figure with coplanar stations and all targets on one side.

    Empty if too few.

    The stations' quadric alone gives the map; the remainder of a target's squares is its height.
    """
    u, v = (factor[:, :2] for factor in factors(squares)[:2])
    row = (squares + 2 * u @ v.T).mean(axis=1)
    if len(u) < 6 or (m := _metric(u, row)) is None:
        return []
    a = _root(m)
    at = u @ a.T
    residual_means = row - np.sum(at**2, axis=1)
    b = np.linalg.lstsq(-2 * at, residual_means - residual_means.mean(), rcond=None)[0]
    to = b + v @ np.linalg.inv(a)
    height2 = np.mean(squares - np.sum((at[:, None] - to) ** 2, axis=2), axis=0)
    height = np.sqrt(np.maximum(height2, 1e-4))  # for size 1: off the plane, so that the ranges can move it
    return [(in_space(at), np.hstack([to, height[:, None]]))]


def _metric(points: np.ndarray, means: np.ndarray) -> np.ndarray | None:
    """Symmetric M of the quadric u' M u + linear terms = means.

    None if undetermined.
    """
    d = points.shape[1]
    i, j = np.triu_indices(d)
    squares = points[:, i] * points[:, j] * np.where(i == j, 1.0, 2.0)
    table = np.hstack([squares, points, np.ones((len(points), 1))])
    solution, _, rank, _ = np.linalg.lstsq(table, means, rcond=1e-9)
    if rank < table.shape[1]:
        return None
    m = np.zeros((d, d))
    m[i, j] = m[j, i] = solution[: len(i)]
    return m


def _root(m: np.ndarray) -> np.ndarray:
    """A with A' A = M; negative eigenvalues are raised."""
    size, axes = np.linalg.eigh(m)
    return (axes * np.sqrt(np.clip(size, 1e-3 * abs(size).max(), None))).T


def _offset(a: np.ndarray, means: Means) -> np.ndarray:
    """Best b for given maps A (k, d, d)."""
    u, v, row, column = means
    inverse = np.linalg.inv(a)
    at, to = u @ np.swapaxes(a, 1, 2), v @ inverse
    design = np.concatenate([-2 * at, 2 * to], axis=1)
    right = np.concatenate([row - np.sum(at**2, axis=2), column - np.sum(to**2, axis=2)], axis=1)
    right[:, : len(u)] -= right[:, : len(u)].mean(axis=1, keepdims=True)
    right[:, len(u) :] -= right[:, len(u) :].mean(axis=1, keepdims=True)
    return (np.linalg.pinv(design) @ right[..., None])[..., 0]


def match_means(a: np.ndarray, b: np.ndarray, means: Means) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Levenberg descent of maps A (k, d, d), upper triangular, and b (k, d) to given means.

    Returns the costs (k,) too.

    Row mean i less its part |A u_i - b|^2, column mean j less |b + A^-T v_j|^2 - |b|^2; each of these is compared
    after the other's mean is taken off.
    """
    k, d = b.shape
    i, j = np.triu_indices(d)
    residual, jacobian = _misfit_of_means(a, b, means)
    cost, damping = np.sum(residual**2, axis=1), np.full(k, 1e-3)
    for _ in range(100):
        normal = np.swapaxes(jacobian, 1, 2) @ jacobian
        scale = np.einsum("kii->ki", normal) + 1e-12 * np.einsum("kii->k", normal)[:, None]
        normal = normal + np.eye(len(i) + d) * (damping[:, None] * scale)[:, None]
        step = np.linalg.solve(normal, (np.swapaxes(jacobian, 1, 2) @ residual[..., None]))[..., 0]
        trial_a, trial_b = a.copy(), b + step[:, len(i) :]
        trial_a[:, i, j] += step[:, : len(i)]
        size = np.abs(np.einsum("kii->ki", trial_a))
        alive = size.min(axis=1) > 1e-6 * size.max(axis=1)  # a singular map has no inverse
        trial_a = np.where(alive[:, None, None], trial_a, a)
        trial_residual, trial_jacobian = _misfit_of_means(trial_a, trial_b, means)
        trial = np.sum(trial_residual**2, axis=1)
        better = alive & (trial < cost)
        a, b = np.where(better[:, None, None], trial_a, a), np.where(better[:, None], trial_b, b)
        residual = np.where(better[:, None], trial_residual, residual)
        jacobian = np.where(better[:, None, None], trial_jacobian, jacobian)
        settled = np.abs(trial - cost) <= 1e-9 * cost
        cost = np.where(better, trial, cost)
        damping = np.clip(damping * np.where(better, 0.2, 5.0), 1e-12, 1e8)
        if np.all(settled & better | (damping >= 1e6)):
            break
    return a, b, cost


def _misfit_of_means(a: np.ndarray, b: np.ndarray, means: Means) -> tuple[np.ndarray, np.ndarray]:
    """Weighted residuals of the means (k, s + t), and derivatives by A and b.

    The weight is the root of the number of squares in each.
    """
    u, v, row, column = means
    i, j = np.triu_indices(b.shape[1])
    weight = np.concatenate([np.full(len(u), len(v) ** 0.5), np.full(len(v), len(u) ** 0.5)])
    inverse = np.linalg.inv(a)
    at, to = u @ np.swapaxes(a, 1, 2) - b[:, None], v @ inverse
    f, g = np.sum(at**2, axis=2), np.sum(to * (to + 2 * b[:, None]), axis=2)
    back = (to + b[:, None]) @ np.swapaxes(inverse, 1, 2)  # rows A^-1 (b + A^-T v_j)
    df = np.concatenate([2 * at[:, :, i] * u[:, j], -2 * at], axis=2)
    dg = np.concatenate([-2 * back[:, :, j] * to[:, :, i], 2 * to], axis=2)
    residual = np.concatenate([row - f - g.mean(axis=1)[:, None], column - g - f.mean(axis=1)[:, None]], axis=1)
    jacobian = np.concatenate([df + dg.mean(axis=1)[:, None], dg + df.mean(axis=1)[:, None]], axis=1)
    return residual * weight, jacobian * weight[:, None]
