"""A dense solution of a network for the tests of readers, which knows nothing of the package's own engines.

Gauss-Newton with every weight matrix inverted as it stands; what the observations leave undetermined (the null space of
the normal matrix) is held by inner constraints on the datum coordinates. Numbers stand in the file's axes.
"""

from types import SimpleNamespace

import numpy as np
import pytest


def covariance_matrix(group):
    c, m = group.covariance, len(group.observed)
    if c.ndim == 1:
        return np.diag(c)
    full = np.zeros((m, m))
    size = c.shape[-1]
    for i, block in enumerate(c.reshape(-1, size, size)):
        full[i * size : (i + 1) * size, i * size : (i + 1) * size] = block
    return full


def dense(group, x):
    values, jacobian = group.predict(x)
    full = np.zeros((len(values), len(x) + 1))
    columns = group.columns if group.columns.ndim == 2 else np.broadcast_to(group.columns, jacobian.shape)
    np.add.at(full, (np.arange(len(values))[:, None], columns), jacobian)
    return group.observed - values, full[:, :-1]


def solve(network, start=None, iterations=12):
    """Coordinates x (n, 3) and their covariances q (n, 3, 3) in the file's axes, [pvv], degrees of freedom, residuals.

    start   (n, 3) m in the package's axes where the file's coordinates are not to start from
    """
    n = len(network.points.names)
    there = ~network.points.absent.ravel()  # any value serves in the place of a coordinate that does not exist
    x = np.concatenate([np.where(there, network.points.xyz.ravel(), 0.0), [p.start for p in network.parameters]])
    if start is not None:
        x[: 3 * n] = start.ravel()
    reference = x.copy()
    held = np.concatenate(
        [network.points.fixed.ravel() | ~there, np.array([p.sigma == 0.0 for p in network.parameters], bool)]
    )
    free = np.flatnonzero(~held)
    datum = np.concatenate([network.points.datum.ravel(), np.zeros(len(network.parameters), bool)])[free]
    weights = [np.linalg.inv(covariance_matrix(group)) for group in network.groups]
    prior = np.array([0.0] * 3 * n + [p.sigma**-2 if 0.0 < p.sigma < np.inf else 0.0 for p in network.parameters])
    for _ in range(iterations):
        normal, right, pvv = np.diag(prior), prior * (reference - x), float(np.sum(prior * (reference - x) ** 2))
        for group, weight in zip(network.groups, weights, strict=True):
            v, a = dense(group, x)
            normal, right, pvv = normal + a.T @ weight @ a, right + a.T @ weight @ v, pvv + v @ weight @ v
        some = normal[np.ix_(free, free)]
        scale = 1.0 / np.sqrt(np.diag(some))
        values, vectors = np.linalg.eigh(some * np.outer(scale, scale))
        null = (scale[:, None] * vectors[:, values < 1e-11 * values[-1]]) * datum[:, None]
        border = np.linalg.qr(null)[0] if null.shape[1] else null
        k = border.shape[1]
        bordered = np.block([[some, border * 1e6], [border.T * 1e6, np.zeros((k, k))]])
        shift = border.T @ (np.where(datum, (reference - x)[free], 0.0)) * 1e6
        inverse = np.linalg.inv(bordered)
        x[free] += (inverse @ np.concatenate([right[free], shift]))[: len(free)]
    q = np.zeros((len(x), len(x)))
    q[np.ix_(free, free)] = inverse[: len(free), : len(free)]
    axes = network.axes
    blocks = np.array([q[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(n)])
    m = sum(len(g.observed) for g in network.groups) + int(np.count_nonzero(prior))
    return SimpleNamespace(
        x=x[: 3 * n].reshape(n, 3) @ axes,
        q=axes.T @ blocks @ axes,
        pvv=pvv,
        degrees=m - len(free) + k,
        parameters=x[3 * n :],
        residuals=[dense(g, x)[0] / np.sqrt(np.diag(covariance_matrix(g))) for g in network.groups],
    )


@pytest.fixture(scope="session", name="solve")
def _solve():
    return solve
