"""Harmonics of a body and its points with a full covariance of each epoch: all unknowns at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catseye.errors import EstimationError, ValidityError
from catseye.estimation.harmonic.body import arms_of, rigid_part

Array = NDArray[np.float64]
FLOATING = 1e-12  # of the normal matrix scaled to ones: an eigenvalue below it is a direction that nothing holds


@dataclass(frozen=True, eq=False)
class Solved:
    """As `series.HarmonicFit`; six_link is its six_covariance, None where points define no rigid part."""

    rigid: Array
    own: Array
    own_covariance: Array
    cross: Array
    rigid_covariance: Array
    six_link: Array | None
    shared: Array
    pvv: float
    whole: Array | None = None


def solved_together(y: Array, seen: Array, r: Array, *, body: Array, own: Array, full: Array) -> Solved:
    """All unknowns, the body's function by function, then the points', each function by function.

    y      (T, n, 3) m, 0 where not seen
    seen   (T, n)
    r      (n, 3, 6) rigid design
    body, own   (T, K), (T, m)
    full   (T or 1, 3n, 3n) m^2

    Raises ValidityError for a covariance that is none, EstimationError for unknowns that float.
    """
    epochs, n = seen.shape
    k, m = body.shape[1], own.shape[1]
    if full.shape not in ((epochs, 3 * n, 3 * n), (1, 3 * n, 3 * n)):
        raise ValidityError(f"covariance has shape {full.shape} (expected ({epochs} or 1, {3 * n}, {3 * n}))")
    size = 6 * k + 3 * n * m
    normal, right, pvv = np.zeros((size, size)), np.zeros(size), 0.0
    for t in range(epochs):
        at = np.flatnonzero(np.repeat(seen[t], 3))
        if not len(at):
            continue
        design = design_of(r, body[t], own[t])[at]
        root = _root(full[t if len(full) > 1 else 0][np.ix_(at, at)], t)
        white = np.linalg.solve(root, np.column_stack([design, y[t].ravel()[at]]))
        normal += white[:, :-1].T @ white[:, :-1]
        right += white[:, :-1].T @ white[:, -1]
        pvv += float(white[:, -1] @ white[:, -1])
    whole = inverse_of(normal, np.sqrt(np.diag(normal)), k, m=m)
    x = whole @ right
    c, a = x[: 6 * k], x[6 * k :].reshape(n, m, 3)
    at_own = 6 * k + np.arange(3 * m) + 3 * m * np.arange(n)[:, None]
    part = rigid_part(arms_of(r))
    link = None
    if part is not None:
        to_six = np.zeros((6 * (k + m), size))
        to_six[: 6 * k, : 6 * k] = np.eye(6 * k)
        to_six[6 * k :, 6 * k :] = np.einsum("jni,fg->fjngi", part, np.eye(m)).reshape(6 * m, 3 * n * m)
        link = to_six @ whole @ to_six.T
    return Solved(
        c.reshape(k, 6).T,
        a.transpose(0, 2, 1),
        whole[at_own[:, :, None], at_own[:, None, :]],
        whole[at_own][:, :, : 6 * k],
        whole[: 6 * k, : 6 * k],
        link,
        np.zeros((epochs, 0)),
        max(pvv - float(right @ x), 0.0),
        whole,
    )


def design_of(r: Array, body: Array, own: Array) -> Array:
    """Design (3n, 6 K + 3 n m) of one epoch with functions body (K,) and own (m,)."""
    n = len(r)
    by_body = np.einsum("nij,k->nikj", r, body).reshape(3 * n, -1)
    by_own = np.einsum("nq,f,ij->niqfj", np.eye(n), own, np.eye(3)).reshape(3 * n, -1)
    return np.concatenate([by_body, by_own], axis=1)


def inverse_of(normal: Array, size: Array, k: int, *, m: int) -> Array:
    """The inverse of a normal matrix scaled by `size`, or EstimationError with the unknowns that float."""
    if np.any(size == 0.0):
        raise EstimationError(f"{_label(int(np.argmin(size)), k, m)} floats: no measurement depends on it")
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    if values[0] < FLOATING:
        worst = ", ".join(_label(int(i), k, m) for i in np.argsort(-np.abs(vectors[:, 0]))[:3])
        raise EstimationError(f"these float together: {worst}; measure more epochs or points, or take fewer functions")
    return (vectors / values) @ vectors.T / np.outer(size, size)


def _label(index: int, k: int, m: int) -> str:
    if index < 6 * k:
        axis = ("shift x", "shift y", "shift z", "turn x", "turn y", "turn z")[index % 6]
        return f"{axis} of the body's function {index // 6 + 1}"
    point, rest = divmod(index - 6 * k, 3 * m)
    return f"{'xyz'[rest % 3]} of point {point} by its function {rest // 3 + 1}"


def _root(covariance: Array, epoch: int) -> Array:
    try:
        return np.asarray(np.linalg.cholesky(covariance), dtype=float)
    except np.linalg.LinAlgError as problem:
        raise ValidityError(
            f"the covariance of epoch {epoch} (counted from 0) is not positive: a combination of its coordinates would "
            "have no uncertainty (expected every variance above 0)"
        ) from problem
