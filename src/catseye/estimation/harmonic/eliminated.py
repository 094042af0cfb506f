"""Harmonics of a body and thousands of points: the points' unknowns eliminated (Schur complement).

The remaining unknowns are s = (C function by function, then z epoch by epoch). For each point

    N = sum_t (o o') x W,   G = sum_t (o x 1)' W F,   H = N^-1 G,   a = N^-1 g - H s,

with W the inverse of its covariance and F = (b' x R, U) its row by s; then S = sum F'WF + prior - sum G'N^-1 G. The
covariance of s is S^-1, that of a is N^-1 + H S^-1 H', of both together -H S^-1. Exact.
"""

from typing import NamedTuple

import numpy as np

from catseye.aliases import Array
from catseye.errors import EstimationError, ValidityError
from catseye.estimation.harmonic.body import arms_of, moved, rigid_part
from catseye.estimation.harmonic.dense import FLOATING, Solved, inverse_of
from catseye.estimation.harmonic.labels import NUMBERED, HarmonicLabels

MOST_REMAINING = 8000  # remaining unknowns: their matrix takes 0.5 GB
PIECE = 128  # points per batch, with shared unknowns per epoch


class _Design(NamedTuple):
    """Design of all unknowns.

    u           (T or 1, n, 3, q) m, of the shared unknowns
    r           (n, 3, 6) rigid design
    body, own   (T, K), (T, m) functions
    """

    u: Array
    r: Array
    body: Array
    own: Array


def solved_by_elimination(
    y: Array,
    visible: Array,
    r: Array,
    *,
    body: Array,
    local: Array,
    points: Array,
    shared: Array | None,
    labels: HarmonicLabels = NUMBERED,
) -> Solved:
    """Solution of body, points and shared unknowns, by elimination of the points.

    y             (T, n, 3) m, 0 if not seen
    visible       (T, n) bool, measured points
    r             (n, 3, 6) rigid design
    body, local   (T, K), (T, m)
    points        (T or 1, n or 1, 3, 3) m^2
    shared        (T or 1, n, 3, q) m, or None
    labels        for messages

    Raises ValidityError for an invalid covariance and for too many remaining unknowns, EstimationError for undetermined
    ones.
    """
    (epochs, n), k, m = visible.shape, body.shape[1], local.shape[1]
    weights = weights_of(points, visible)
    u = _shared(shared, epochs, n)
    remaining = 6 * k + epochs * u.shape[-1]
    if remaining > MOST_REMAINING:
        raise ValidityError(
            f"{epochs} epochs with {u.shape[-1]} shared unknowns each leave {remaining} "
            f"(expected at most {MOST_REMAINING}): fit fewer epochs, or no shared unknowns"
        )
    wy = np.einsum("tpij,tpj->tpi", weights, y)
    functions = np.concatenate([local, body], axis=1)
    q = m + k
    products = np.einsum("ta,tb->tab", functions, functions).reshape(epochs, -1)
    moments = (products.T @ weights.reshape(epochs, -1)).reshape(q, q, n, 3, 3)
    sums = (functions.T @ wy.reshape(epochs, -1)).reshape(q, n, 3)

    blocks = moments[:m, :m].transpose(2, 0, 3, 1, 4).reshape(n, 3 * m, 3 * m)
    inverse = _inverses(blocks, m, labels)
    g_local = sums[:m].transpose(1, 0, 2).reshape(n, 3 * m)
    g_body = np.einsum("fknil,nlj->nfikj", moments[:m, m:], r).reshape(n, 3 * m, 6 * k)
    big = np.zeros((remaining, remaining))
    body_body = np.einsum("nij,klnih,nhg->kjlg", r, moments[m:, m:], r, optimize=True)
    big[: 6 * k, : 6 * k] = body_body.reshape(6 * k, 6 * k)
    right = np.zeros(remaining)
    right[: 6 * k] = np.einsum("nij,kni->kj", r, sums[m:]).ravel()
    if u.shape[-1]:
        _share(big, right, weights=weights, wy=wy, u=u, r=r, body=body)
    before = np.sqrt(np.diag(big))
    for at, g in _links(g_body, weights, u, local) if remaining else ():
        root = np.linalg.cholesky(inverse[at])  # N^-1 = L L'
        half = (np.swapaxes(root, -1, -2) @ g).reshape(-1, remaining)
        big -= half.T @ half
        right -= half.T @ np.einsum("pji,pj->pi", root, g_local[at]).ravel()
    core = _core(big, before, k, m, labels)
    s = core @ right
    links = _links(g_body, weights, u, local)
    return _answer(s, core, inverse, g_local, y, weights, design=_Design(u, r, body, local), links=links)


def weights_of(points: Array, measured: Array) -> Array:
    """Inverses (T, n, 3, 3) of the points' covariances by adjugates.

    0 if not seen.

    points     (T or 1, n or 1, 3, 3) m^2
    measured   (T, n)
    """
    q = np.asarray(points, dtype=float)
    if (
        q.ndim != 4
        or q.shape[2:] != (3, 3)
        or q.shape[0] not in (1, len(measured))
        or q.shape[1] not in (1, measured.shape[1])
    ):
        raise ValidityError(f"covariances of points have shape {q.shape} (expected (T or 1, n or 1, 3, 3))")
    scale = np.trace(q, axis1=-2, axis2=-1) / 3.0
    visible = np.broadcast_to(measured, measured.shape)
    if not np.all(np.broadcast_to(scale, measured.shape)[visible] > 0.0):
        raise ValidityError("a point's covariance has no variance above 0 (expected every variance above 0)")
    unit = q / np.where(scale > 0.0, scale, 1.0)[..., None, None]
    a, b, c = unit[..., 0, 0], unit[..., 0, 1], unit[..., 0, 2]
    d, e, f = unit[..., 1, 1], unit[..., 1, 2], unit[..., 2, 2]
    xx, xy, xz = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * xx + b * xy + c * xz
    good = (determinant > 1e-12) & (a > 0.0) & (a * d - b * b > 0.0)
    if not np.all(np.broadcast_to(good, measured.shape)[visible]):
        raise ValidityError("a point's covariance is not positive definite (expected every variance above 0)")
    by = 1.0 / np.where(good, determinant * scale, 1.0)
    rows = [[xx, xy, xz], [xy, a * f - c * c, b * c - a * e], [xz, b * c - a * e, a * d - b * b]]
    inverse = np.stack([np.stack([cell * by for cell in row], axis=-1) for row in rows], axis=-2)
    return np.where(measured[..., None, None], inverse, 0.0)


def _shared(shared: Array | None, epochs: int, n: int) -> Array:
    if shared is None:
        return np.zeros((1, n, 3, 0))
    if shared.ndim != 4 or shared.shape[0] not in (1, epochs) or shared.shape[1:3] != (n, 3):
        raise ValidityError(f"shared has shape {shared.shape} (expected ({epochs} or 1, {n}, 3, q))")
    return shared


def _share(big: Array, right: Array, *, weights: Array, wy: Array, u: Array, r: Array, body: Array) -> None:
    """Add rows and columns of z to the reduced matrix before elimination, with the prior."""
    epochs, q, first = len(weights), u.shape[-1], 6 * body.shape[1]
    for t in range(epochs):
        shared_design = u[t if len(u) > 1 else 0]
        wu = weights[t] @ shared_design  # (n, 3, q)
        at = slice(first + t * q, first + (t + 1) * q)
        big[at, at] = np.eye(q) + np.einsum("nia,nib->ab", shared_design, wu)
        mixed = np.einsum("nij,nia->ja", r, wu)
        big[:first, at] = np.einsum("k,ja->kja", body[t], mixed).reshape(first, q)
        big[at, :first] = big[:first, at].T
        right[at] = np.einsum("nia,ni->a", shared_design, wy[t])


def _links(g_body: Array, weights: Array, u: Array, local: Array):
    """Blocks G (points, 3 m, left), a batch of points at a time."""
    n, rows = g_body.shape[:2]
    q = u.shape[-1]
    if not rows:
        return
    step = PIECE if q else n
    for begin in range(0, n, step):
        at = slice(begin, min(begin + step, n))
        if not q:
            yield at, g_body[at]
            continue
        wu = weights[:, at] @ u[:, at]  # (T, points, 3, q)
        by_z = np.einsum("tf,tpiq->pfitq", local, wu).reshape(wu.shape[1], rows, -1)
        yield at, np.concatenate([g_body[at], by_z], axis=2)


def _inverses(blocks: Array, m: int, labels: HarmonicLabels) -> Array:
    """Inverses of the points' normal matrices.

    EstimationError with the first undetermined point.
    """
    if not blocks.shape[1]:
        return blocks
    size = np.sqrt(np.einsum("nii->ni", blocks))
    floats = ~np.all(size > 0.0, axis=1)
    scaled = blocks / np.where(size > 0.0, size, 1.0)[:, :, None] / np.where(size > 0.0, size, 1.0)[:, None, :]
    values, vectors = np.linalg.eigh(scaled)
    floats |= values[:, 0] < FLOATING
    if floats.any():
        raise EstimationError(
            f"the {m} functions of {labels.point(int(np.argmax(floats)))} float: it was measured in too few "
            f"epochs, or these are too similar ({int(floats.sum())} points of {len(blocks)}); leave it out or use fewer"
        )
    inverse = (vectors / values[:, None, :]) @ np.swapaxes(vectors, -1, -2)
    return inverse / size[:, :, None] / size[:, None, :]


def _core(big: Array, size: Array, k: int, m: int, labels: HarmonicLabels) -> Array:
    """Inverse of the reduced matrix.

    `size` is from its diagonal before elimination.
    """
    if len(big) <= 6 * k:
        return inverse_of(big, size, k, m=m, labels=labels) if len(big) else big
    from scipy.linalg import cho_factor, cho_solve

    if np.any(size == 0.0):
        raise EstimationError(f"functions of {labels.body} float: no measurement depends on one of them")
    scaled = big / size[:, None] / size
    try:
        factor = cho_factor(scaled, lower=True, overwrite_a=True, check_finite=False)
    except np.linalg.LinAlgError as problem:
        raise EstimationError(
            f"functions of {labels.body} float: measure more epochs or points, or take fewer"
        ) from problem
    if np.min(np.diag(factor[0])) ** 2 < FLOATING:
        raise EstimationError(f"functions of {labels.body} float: measure more epochs or points, or take fewer")
    return cho_solve(factor, np.eye(len(big)), overwrite_b=True, check_finite=False) / size[:, None] / size


def _answer(
    s: Array, core: Array, inverse: Array, g_local: Array, y: Array, weights: Array, *, design: _Design, links
) -> Solved:
    """Points' shifts, all covariances and the weighted squares."""
    u, r, body, local = design
    (epochs, n), k, m = y.shape[:2], body.shape[1], local.shape[1]
    arms = arms_of(r)
    a = np.einsum("pij,pj->pi", inverse, g_local)
    covariance, cross = inverse.copy(), np.zeros((n, 3 * m, 6 * k))
    part = rigid_part(arms)
    joined, inner = np.zeros((6 * m, len(s))), np.zeros((6 * m, 6 * m))
    for at, g in links:
        h = inverse[at] @ g
        a[at] -= h @ s
        spread = h @ core
        covariance[at] += spread @ np.swapaxes(h, -1, -2)
        cross[at] = -spread[:, :, : 6 * k]
        if part is not None:
            by = np.einsum("jpi,fg->pfjgi", part[:, at], np.eye(m)).reshape(len(h), 6 * m, 3 * m)
            joined += np.einsum("pab,pbs->as", by, h, optimize=True)
            inner += np.einsum("pab,pbc,pdc->ad", by, inverse[at], by, optimize=True)
    link = None
    if part is not None:
        half = joined @ core
        link = np.zeros((6 * (k + m),) * 2)
        link[: 6 * k, : 6 * k] = core[: 6 * k, : 6 * k]
        link[6 * k :, : 6 * k] = -half[:, : 6 * k]
        link[: 6 * k, 6 * k :] = -half[:, : 6 * k].T
        link[6 * k :, 6 * k :] = inner + half @ joined.T
    rigid, shifts = s[: 6 * k].reshape(k, 6).T, a.reshape(n, m, 3).transpose(0, 2, 1)
    z = s[6 * k :].reshape(epochs, -1)
    residual = y - moved(body @ rigid.T, arms) - np.einsum("tm,nim->tni", local, shifts, optimize=True)
    if u.shape[-1]:
        residual -= np.einsum("tniq,tq->tni", np.broadcast_to(u, (epochs, *u.shape[1:])), z, optimize=True)
    pvv = float(np.einsum("tni,tnij,tnj->", residual, weights, residual, optimize=True)) + float(np.sum(z**2))
    return Solved(
        rigid=rigid,
        own=shifts,
        own_covariance=covariance,
        cross=cross,
        rigid_covariance=core[: 6 * k, : 6 * k],
        six_link=link,
        shared=z,
        pvv=pvv,
    )
