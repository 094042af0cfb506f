"""Best linear unbiased estimates from values whose covariance may be singular, as that of free networks is.

What is estimated takes the null space in: only the part of the values that no parameter explains is weighted, by the
inverse of its own covariance. So the sum of squares and its degrees of freedom do not depend on any datum.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from catseye.errors import EstimationError

NO_COVARIANCE = "the covariance is none: scaled to unit variances its smallest eigenvalue is {value:.2g}"
FLOATING = 1e-10  # of the largest singular value of a design with unit columns
SINGULAR = 1e-11  # of the weighted part's condition: beyond it a covariance claims to know something exactly
NEGATIVE = 1e-9  # of the number of rows: an eigenvalue below minus that is no rounding (scaled to unit variances)


@dataclass(frozen=True, eq=False)
class LinearEstimate:
    """Best linear unbiased estimate of p parameters from m values whose covariance may be singular.

    estimate            (p,)
    covariance          (p, p)
    gain                (p, m): estimate = gain @ values
    weight              (m, m) P: P values is the weighted residual, (P_ii)^-1 the covariance of values i foretold by
                        all others
    weighted_residual   (m,) P values
    pvv                 values' P values
    degrees_of_freedom  m - p
    """

    estimate: np.ndarray
    covariance: np.ndarray
    gain: np.ndarray
    weight: np.ndarray
    weighted_residual: np.ndarray
    pvv: float
    degrees_of_freedom: int


def best_linear_estimate(
    design: np.ndarray,
    values: np.ndarray,
    covariance: np.ndarray,
    *,
    parameters: Sequence[str],
    rows: Sequence[str],
) -> LinearEstimate:
    """Parameters of values = design @ parameters + errors, where the covariance of the errors may be singular.

    design       (m, p), of full column rank; p may be 0
    values       (m,)
    covariance   (m, m), positive definite on what the design leaves over
    parameters   p names, and
    rows         m names, for errors

    With U an orthonormal base of the design and N one of the rest: P = N (N'QN)^-1 N', computed without N from the
    projected covariance, and estimate U'(1 - QP) values. All is first scaled to unit variances. Raises EstimationError
    if parameters float, or if the covariance leaves a combination of rows exactly known.

    Source: [RAO73] section 4i (unified least squares).

    >>> q = np.array([[1.0, -1.0], [-1.0, 1.0]])  # of two values with an exactly known sum
    >>> best_linear_estimate(np.ones((2, 1)), np.array([3.0, 5.0]), q, parameters=["mean"], rows=["a", "b"]).estimate
    array([4.])
    """
    m, p = design.shape
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    sigma = np.where(sigma > 0.0, sigma, sigma[sigma > 0.0].min(initial=np.inf)) if sigma.any() else np.ones(m)
    q = covariance / sigma[:, None] / sigma
    scaled = design / sigma[:, None]
    length = np.linalg.norm(scaled, axis=0)
    if np.any(length == 0.0):
        raise EstimationError(_floating([name for name, one in zip(parameters, length, strict=True) if one == 0.0]))
    u, s, vt = np.linalg.svd(scaled / length, full_matrices=False) if p else (scaled, length, np.eye(0))
    if p and (m < p or s[-1] < FLOATING * s[0]):
        part = np.sum(vt[s < FLOATING * s[0]] ** 2, axis=0) if m >= p else np.ones(p)
        raise EstimationError(_floating([parameters[int(i)] for i in np.flatnonzero(part > 1e-3 * part.max())]))
    qu = q @ u
    rest = q - u @ qu.T - qu @ u.T + u @ (u.T @ qu) @ u.T
    weight = _inverse_beside(rest, u, rows) if m > p else np.zeros((m, m))
    gain = u.T - qu.T @ weight
    spread = gain @ q @ gain.T
    if p and np.linalg.eigvalsh(spread)[0] < -NEGATIVE * m:
        raise EstimationError(NO_COVARIANCE.format(value=float(np.linalg.eigvalsh(q)[0])))
    back = vt.T / s / length[:, None]  # from the base U to the parameters
    gain, weight = back @ gain / sigma, weight / sigma[:, None] / sigma
    residual = weight @ values
    return LinearEstimate(
        estimate=gain @ values,
        covariance=back @ spread @ back.T,
        gain=gain,
        weight=weight,
        weighted_residual=residual,
        pvv=float(values @ residual),
        degrees_of_freedom=m - p,
    )


def _floating(names: Sequence[str]) -> str:
    return f"not held by these points: {', '.join(names)}; add points, or fit fewer parameters"


def _inverse_beside(rest: np.ndarray, u: np.ndarray, rows: Sequence[str]) -> np.ndarray:
    """Inverse of a matrix on the complement of the orthonormal columns u, which span its null space."""
    m, p = u.shape
    level = np.trace(rest) / (m - p)
    filled = rest + level * (u @ u.T)
    factor, failed = lapack.dpotrf(filled, lower=1)
    condition = 0.0 if failed else lapack.dpocon(factor, np.abs(filled).sum(axis=0).max(), uplo="L")[0]
    if condition < SINGULAR:
        values, vectors = np.linalg.eigh(filled)
        if values[0] < -NEGATIVE * m:
            raise EstimationError(NO_COVARIANCE.format(value=values[0]))
        part = np.sum(vectors[:, values < 10.0 * SINGULAR * values[-1]] ** 2, axis=1)
        named = [rows[int(i)] for i in np.argsort(-part)[:4] if part[i] > 1e-3 * part.max()]
        raise EstimationError(
            f"the covariance claims to know a combination of {', '.join(named)} exactly, and no motion that is left "
            "free explains it; free more of the datum, or give held points their covariance"
        )
    inverse = np.tril(lapack.dpotri(factor, lower=1)[0])
    return inverse + np.tril(inverse, -1).T - (u @ u.T) / level
