"""Nightly rigid motion of a body's points, and each point beside the others.

The motion of a night is robust least squares over its points. What is left of a point is measured against the motion of
the other points (leave-one-out), so that a monument that moved does not hide in the motion of a few.
"""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.estimation.harmonic.body import rigid_design, rigid_part
from catseye.estimation.series.correlated import inverse_of, measured

FEWEST = 6  # points of a body: of fewer each point is looked at by itself
FEWEST_NIGHT = 4  # points of a night
HUBER = 2.5  # standard deviations of a coordinate: beyond it a point's weight falls
SINGULAR = 1e-10  # of the product of the variances: a smaller determinant is rounding
BLOCK = 50_000  # points of nights taken at once, for memory
ROUNDS = 4  # of the weights


@dataclass(frozen=True, eq=False)
class NightlyMotion:
    """Rigid motion of each night.

    six          (T, 6) m and rad; NaN in a night with too few points
    covariance   (T, 6, 6)
    residual     (T, n, 3) m, each point less the motion of the others
    spread       (T, n, 3, 3) m^2 of the residuals, without their own excess scatter
    """

    six: Array
    covariance: Array
    residual: Array
    spread: Array


def determines_motion(arms: Array) -> bool:
    """True if points at arms (n, 3) m are enough for a rigid motion."""
    return len(arms) >= FEWEST and rigid_part(arms) is not None


def nightly_motion(displacement: Array, covariance: Array, arms: Array, *, scatter: float = 0.0) -> NightlyMotion:
    """Rigid motion of each night, with the points' residuals against the motion of the others.

    displacement   (T, n, 3) m; NaN where not measured
    covariance     (T, n, 3, 3) m^2
    arms           (n, 3) m, from the middle of the points
    scatter        m, of each coordinate beyond the covariance

    Source: [RAO73] section 4a; [HUBER09] for the weights; leave-one-out residuals by (V - A)^-1, A the motion's part.
    """
    count = max(1, BLOCK // max(1, len(arms)))
    blocks = [slice(i, i + count) for i in range(0, len(displacement), count)]
    parts = [_motion(displacement[at], covariance[at], arms, scatter) for at in blocks]
    return NightlyMotion(*(np.concatenate([vars(part)[name] for part in parts]) for name in vars(parts[0])))


def _motion(displacement: Array, covariance: Array, arms: Array, scatter: float) -> NightlyMotion:
    """Motion of some nights, all at once."""
    present = measured(displacement)
    y = np.where(present[..., None], displacement, 0.0)
    base = np.where(present[..., None, None], covariance + scatter**2 * np.eye(3), np.eye(3))
    r = rigid_design(arms)
    weight = present.astype(float)
    inverse = _inverse(base)
    for i in range(ROUNDS):
        weighted = inverse * weight[..., None, None]
        wr = weighted @ r  # (T, n, 3, 6)
        normal = np.einsum("nij,tnik->tjk", r, wr, optimize=True)
        right = np.einsum("tnik,tni->tk", wr, y, optimize=True)
        inner, good = _inverse_normals(normal, arms, present)
        six = np.einsum("tjk,tk->tj", inner, right)
        if i == ROUNDS - 1:
            break
        left = y - np.einsum("nij,tj->tni", r, six)
        size = np.sqrt(np.maximum(np.einsum("tni,tnij,tnj->tn", left, inverse, left, optimize=True) / 3.0, 0.0))
        typical = np.maximum(_typical(size, present), 1.0)[:, None]
        weight = np.where(present, np.minimum(1.0, HUBER * typical / np.maximum(size, 1e-300)), 0.0)
    left = y - np.einsum("nij,tj->tni", r, six)
    part = np.einsum("nij,tjk,nlk->tnil", r, inner, r, optimize=True)
    effective = base / np.where(weight > 0.0, weight, 1.0)[..., None, None]
    shared = (weight > 0.0) & good[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        outer = effective @ _inverse(effective - part * shared[..., None, None])
        residual = np.einsum("tnij,tnj->tni", outer, left)
        spread = outer @ effective - effective + base - scatter**2 * np.eye(3)
    usable = present & good[:, None] & positive(spread)
    return NightlyMotion(
        six=np.where(good[:, None], six, np.nan),
        covariance=np.where(good[:, None, None], inner, np.nan),
        residual=np.where(usable[..., None], residual, np.nan),
        spread=np.where(usable[..., None, None], spread, np.nan),
    )


def positive(q: Array) -> np.ndarray:
    """True (...) for symmetric matrices (..., 3, 3) that are covariances, far enough from singular."""
    a, b, c, e, f, i = q[..., 0, 0], q[..., 0, 1], q[..., 0, 2], q[..., 1, 1], q[..., 1, 2], q[..., 2, 2]
    with np.errstate(invalid="ignore", over="ignore"):
        second = a * e - b * b
        third = a * (e * i - f * f) - b * (b * i - c * f) + c * (b * f - c * e)
        return (a > 0.0) & (second > SINGULAR * a * e) & (third > SINGULAR * a * e * i)


def _inverse(q: Array) -> Array:
    with np.errstate(invalid="ignore"):  # a logarithm that is not used
        return inverse_of(q)[0]


def _inverse_normals(normal: Array, arms: Array, present: np.ndarray) -> tuple[Array, np.ndarray]:
    """Inverses (T, 6, 6), and True (T,) for nights that determine a motion."""
    length = float(np.sqrt(np.mean(np.sum(arms**2, axis=1)))) or 1.0
    scale = np.repeat([1.0, length], 3)
    unit = normal / (scale[:, None] * scale)
    trace = np.einsum("tii->t", unit)
    values, vectors = np.linalg.eigh(unit / np.where(trace > 0.0, trace, 1.0)[:, None, None])
    good = (present.sum(axis=1) >= FEWEST_NIGHT) & (values[:, 0] > 1e-6)
    inverse = (vectors / np.where(good[:, None], values, 1.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return inverse / np.where(trace > 0.0, trace, 1.0)[:, None, None] / (scale[:, None] * scale), good


def _typical(size: Array, present: np.ndarray) -> Array:
    """Median (T,) of the sizes of present points, over its expectation for three standard normal components."""
    ordered = np.sort(np.where(present, size, np.inf), axis=1)
    middle = np.maximum((present.sum(axis=1) - 1) // 2, 0)
    value = np.take_along_axis(ordered, middle[:, None], axis=1)[:, 0]
    return np.where(np.isfinite(value), value / 0.888, 1.0)  # sqrt of the median of chi-square of 3, 2.366, over 3
