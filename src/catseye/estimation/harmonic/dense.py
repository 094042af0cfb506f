"""Harmonics of a body and its points with a full covariance per epoch, solved jointly."""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.errors import EstimationError, ValidityError
from catseye.estimation.harmonic.body import arms_of, rigid_part
from catseye.estimation.harmonic.labels import NUMBERED, HarmonicLabels

FLOATING = 1e-12  # of the normal matrix of unit diagonal: a smaller eigenvalue is an undetermined direction


@dataclass(frozen=True, eq=False)
class Solved:
    """Solution as `series.HarmonicFit`.

    `six_link` is its six_covariance, None without a rigid part.
    """

    rigid: Array
    own: Array
    own_covariance: Array
    cross: Array
    rigid_covariance: Array
    six_link: Array | None
    shared: Array
    pvv: float
    full_covariance: Array | None = None


def solved_together(
    y: Array,
    visible: Array,
    r: Array,
    *,
    body: Array,
    local: Array,
    full: Array,
    labels: HarmonicLabels = NUMBERED,
) -> Solved:
    """Joint solution: the body's unknowns function by function, then the points'.

    y             (T, n, 3) m, 0 if not seen
    visible       (T, n) bool, measured points
    r             (n, 3, 6) rigid design
    body, local   (T, K), (T, m)
    full          (T or 1, 3n, 3n) m^2
    labels        for messages

    Raises ValidityError for an invalid covariance, EstimationError for undetermined unknowns.
    """
    epochs, n = visible.shape
    k, m = body.shape[1], local.shape[1]
    if full.shape not in ((epochs, 3 * n, 3 * n), (1, 3 * n, 3 * n)):
        raise ValidityError(f"covariance has shape {full.shape} (expected ({epochs} or 1, {3 * n}, {3 * n}))")
    size = 6 * k + 3 * n * m
    normal, right, pvv = np.zeros((size, size)), np.zeros(size), 0.0
    for t in range(epochs):
        at = np.flatnonzero(np.repeat(visible[t], 3))
        if not len(at):
            continue
        design = design_of(r, body[t], local[t])[at]
        root = _root(full[t if len(full) > 1 else 0][np.ix_(at, at)], t)
        white = np.linalg.solve(root, np.column_stack([design, y[t].ravel()[at]]))
        normal += white[:, :-1].T @ white[:, :-1]
        right += white[:, :-1].T @ white[:, -1]
        pvv += float(white[:, -1] @ white[:, -1])
    inverse = inverse_of(normal, np.sqrt(np.diag(normal)), k, m=m, labels=labels)
    x = inverse @ right
    c, a = x[: 6 * k], x[6 * k :].reshape(n, m, 3)
    local_columns = 6 * k + np.arange(3 * m) + 3 * m * np.arange(n)[:, None]
    part = rigid_part(arms_of(r))
    link = None
    if part is not None:
        to_six = np.zeros((6 * (k + m), size))
        to_six[: 6 * k, : 6 * k] = np.eye(6 * k)
        to_six[6 * k :, 6 * k :] = np.einsum("jni,fg->fjngi", part, np.eye(m)).reshape(6 * m, 3 * n * m)
        link = to_six @ inverse @ to_six.T
    return Solved(
        rigid=c.reshape(k, 6).T,
        own=a.transpose(0, 2, 1),
        own_covariance=inverse[local_columns[:, :, None], local_columns[:, None, :]],
        cross=inverse[local_columns][:, :, : 6 * k],
        rigid_covariance=inverse[: 6 * k, : 6 * k],
        six_link=link,
        shared=np.zeros((epochs, 0)),
        pvv=max(pvv - float(right @ x), 0.0),
        full_covariance=inverse,
    )


def design_of(r: Array, body: Array, local: Array) -> Array:
    """Design (3n, 6 K + 3 n m) of one epoch with functions of the body (K,) and the points (m,)."""
    n = len(r)
    by_body = np.einsum("nij,k->nikj", r, body).reshape(3 * n, -1)
    by_local = np.einsum("nq,f,ij->niqfj", np.eye(n), local, np.eye(3)).reshape(3 * n, -1)
    return np.concatenate([by_body, by_local], axis=1)


def inverse_of(normal: Array, size: Array, k: int, *, m: int, labels: HarmonicLabels = NUMBERED) -> Array:
    """Inverse of a normal matrix scaled by `size`.

    EstimationError naming undetermined unknowns.
    """
    if np.any(size == 0.0):
        raise EstimationError(f"{_label(int(np.argmin(size)), k, m, labels)} floats: no measurement depends on it")
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    if values[0] < FLOATING:
        worst = ", ".join(_label(int(i), k, m, labels) for i in np.argsort(-np.abs(vectors[:, 0]))[:3])
        raise EstimationError(f"these float together: {worst}; measure more epochs or points, or take fewer functions")
    return (vectors / values) @ vectors.T / np.outer(size, size)


def _label(index: int, k: int, m: int, labels: HarmonicLabels) -> str:
    if index < 6 * k:
        axis = ("shift x", "shift y", "shift z", "turn x", "turn y", "turn z")[index % 6]
        return f"{axis} of {labels.body_function(index // 6)}"
    point, offset = divmod(index - 6 * k, 3 * m)
    return f"{'xyz'[offset % 3]} of {labels.point_function(point, offset // 3)}"


def _root(covariance: Array, epoch: int) -> Array:
    try:
        return np.asarray(np.linalg.cholesky(covariance), dtype=float)
    except np.linalg.LinAlgError as problem:
        raise ValidityError(
            f"the covariance of epoch {epoch} (counted from 0) is not positive definite: a combination "
            "of its coordinates has no uncertainty (expected every variance above 0)"
        ) from problem
