"""Best linear unbiased estimates from values of singular covariance, such as free networks have.

The parameters absorb the null space: only the part of the values that no parameter explains is weighted, by the
inverse of its own covariance. So the sum of squares and its degrees of freedom do not depend on any datum.

A covariance is factorised once; later requests are triangular solves.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import blas, lapack

from catseye.errors import EstimationError

NO_COVARIANCE = "invalid covariance: scaled to unit variances its smallest eigenvalue is {value:.2g}"
FLOATING = 1e-10  # of the largest singular value of a design with unit columns
SINGULAR = 1e-11  # limit of the weighted part's condition: beyond it a combination has zero variance
NEGATIVE = 1e-9  # of the number of rows: an eigenvalue below minus this is not rounding (scaled to unit variances)
REFINED = 1e-10  # of the product of two standard uncertainties: refinement stops at smaller changes,
REFINEMENTS = 10  # or after so many, if rounding prevents it
PANEL = 512  # columns of an inverse solved for together: some MB, at full speed


@dataclass(frozen=True, eq=False)
class FactoredModel:
    """Values = design @ parameters + errors of covariance Q, factorised once.

    Q may be singular.

    With U an orthonormal base of the design and N one of its complement: P = N (N'QN)^-1 N', computed without N from
    the projected covariance, and gain U'(1 - QP). All is scaled to unit variances.

    sigma    (m,) units of the rows
    base     (m, p) U
    back     (p, p) from that base to the parameters
    level    regularisation of the base in F = (1 - UU')Q(1 - UU') + level UU'
    factor   (m, m) lower Cholesky factor of F, in Fortran order, undefined above the diagonal; None if m = p
    gain     (p, m) of scaled values in terms of U
    spread   (p, p) covariance of the base's parameters
    """

    sigma: np.ndarray
    base: np.ndarray
    back: np.ndarray
    level: float
    factor: np.ndarray | None
    gain: np.ndarray
    spread: np.ndarray

    @staticmethod
    def of(
        design: np.ndarray,
        covariance: np.ndarray,
        *,
        parameters: Sequence[str],
        rows: Sequence[str],
        overwrite: bool = False,
    ) -> "FactoredModel":
        """Factorise a model; arguments and errors as of `best_linear_estimate`.

        overwrite   store the factor in the covariance's memory (if it is in C order); else in a copy
        """
        m, p = design.shape
        sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        if sigma.any():
            sigma = np.where(sigma > 0.0, sigma, sigma[sigma > 0.0].min(initial=np.inf))
        else:
            sigma = np.ones(m)
        scaled = design / sigma[:, None]
        length = np.linalg.norm(scaled, axis=0)
        if np.any(length == 0.0):
            raise EstimationError(_floating([name for name, one in zip(parameters, length, strict=True) if one == 0.0]))
        u, s, vt = np.linalg.svd(scaled / length, full_matrices=False) if p else (scaled, length, np.eye(0))
        if p and (m < p or s[-1] < FLOATING * s[0]):
            part = np.sum(vt[s < FLOATING * s[0]] ** 2, axis=0) if m >= p else np.ones(p)
            raise EstimationError(_floating([parameters[int(i)] for i in np.flatnonzero(part > 1e-3 * part.max())]))
        qu = (covariance @ (u / sigma[:, None])) / sigma[:, None]
        level, factor, gain = 1.0, None, u.T
        if m > p:
            level, factor = _projected_factor(covariance, sigma, u, qu, rows=rows, overwrite=overwrite)
            gain = gain - (_solved(factor, qu) - u @ (u.T @ qu) / level).T
        spread = gain @ qu  # gain Q gain', as gain Q = gain Q U U'
        if p and (least := float(np.linalg.eigvalsh(0.5 * (spread + spread.T))[0])) < -NEGATIVE * m:
            raise EstimationError(NO_COVARIANCE.format(value=least))
        return FactoredModel(
            sigma=sigma, base=u, back=vt.T / s / length[:, None], level=level, factor=factor, gain=gain, spread=spread
        )

    def solve(self, values: np.ndarray, closure: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Weighted residuals l and parameters x: Q l + design x = values, design' l = c.

        values    (m,) or (m, k)
        closure   c, (p,) or (p, k); zero if None, which is least squares

        Returns l (m,) or (m, k) and x (p,) or (p, k).
        """
        unit = self.sigma if values.ndim == 1 else self.sigma[:, None]
        scaled = values / unit
        weighted = np.zeros_like(scaled)
        if self.factor is not None:
            weighted = _solved(self.factor, scaled) - self.base @ (self.base.T @ scaled) / self.level
        along = self.gain @ scaled
        if closure is not None:
            bend = self.back.T @ closure
            weighted, along = weighted + self.gain.T @ bend, along - self.spread @ bend
        return weighted / unit, self.back @ along

    def refined(self, design: np.ndarray, times: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Gain (p, m) and covariance (p, p) of a model close to the factorised one.

        design   (m, p) of that model
        times    product of its covariance with an (m, p) array
        """
        unit = np.eye(design.shape[1])
        weighted, along = self.solve(np.zeros(design.shape), unit)
        for _ in range(REFINEMENTS):
            more, change = self.solve(-times(weighted) - design @ along, unit - design.T @ weighted)
            weighted, along = weighted + more, along + change
            u = np.sqrt(np.abs(np.diag(along)))
            if np.all(np.abs(change) <= REFINED * np.outer(u, u)):
                break
        return weighted.T, -0.5 * (along + along.T)

    @property
    def parameter_gain(self) -> np.ndarray:
        """Gain (p, m): parameters = gain @ values."""
        return np.asarray(self.back @ self.gain / self.sigma)

    @cached_property
    def weight(self) -> np.ndarray:
        """Weight matrix P, (m, m)."""
        if self.factor is None:
            return np.zeros((len(self.sigma),) * 2)
        inverse = np.tril(lapack.dpotri(self.factor, lower=1)[0])
        full = inverse + np.tril(inverse, -1).T - (self.base @ self.base.T) / self.level
        return np.asarray(full / self.sigma[:, None] / self.sigma)

    @cached_property
    def weight_diagonal(self) -> np.ndarray:
        """Diagonal (m,) of P, at half the cost of `weight` and without its memory."""
        if self.factor is None:
            return np.zeros(len(self.sigma))
        diagonal = _inverse_diagonal(self.factor) - np.sum(self.base**2, axis=1) / self.level
        return np.asarray(diagonal / self.sigma**2)


@dataclass(frozen=True, eq=False)
class LinearEstimate:
    """Best linear unbiased estimate of p parameters from m values whose covariance may be singular.

    estimate            (p,)
    covariance          (p, p)
    gain                (p, m): estimate = gain @ values
    weighted_residual   (m,) P values
    pvv                 values' P values
    degrees_of_freedom  m - p
    design              (m, p)
    model               factorised model it was solved with
    """

    estimate: np.ndarray
    covariance: np.ndarray
    gain: np.ndarray
    weighted_residual: np.ndarray
    pvv: float
    degrees_of_freedom: int
    design: np.ndarray
    model: FactoredModel

    @property
    def redundancy(self) -> np.ndarray:
        """Redundancy numbers (m,): (QP)_ii = (1 - design gain)_ii."""
        return np.asarray(1.0 - np.sum(self.design * self.gain.T, axis=1))

    @property
    def weight(self) -> np.ndarray:
        """Weight matrix P (m, m): weighted residual = P values.

        (P_ii)^-1 is the covariance of values i given all others.
        """
        return self.model.weight

    @property
    def weight_diagonal(self) -> np.ndarray:
        """Diagonal (m,) of the weight matrix P."""
        return self.model.weight_diagonal


def best_linear_estimate(
    design: np.ndarray,
    values: np.ndarray,
    covariance: np.ndarray,
    *,
    parameters: Sequence[str],
    rows: Sequence[str],
) -> LinearEstimate:
    """Parameters of values = design @ parameters + errors of (possibly singular) covariance.

    design       (m, p), of full column rank; p may be 0
    values       (m,)
    covariance   (m, m), positive definite on the complement of the design
    parameters   p names, and
    rows         m names, for errors

    Raises EstimationError for undetermined parameters, or a covariance that makes a combination of rows exactly known.

    Source: [RAO73] section 4i (unified least squares).

    >>> q = np.array([[1.0, -1.0], [-1.0, 1.0]])  # of two values with an exactly known sum
    >>> best_linear_estimate(np.ones((2, 1)), np.array([3.0, 5.0]), q, parameters=["mean"], rows=["a", "b"]).estimate
    array([4.])
    """
    model = FactoredModel.of(design, covariance, parameters=parameters, rows=rows)
    residual, estimate = model.solve(values)
    gain = model.parameter_gain
    return LinearEstimate(
        estimate=estimate,
        covariance=gain @ covariance @ gain.T,
        gain=gain,
        weighted_residual=residual,
        pvv=float(values @ residual),
        degrees_of_freedom=design.shape[0] - design.shape[1],
        design=design,
        model=model,
    )


def _floating(names: Sequence[str]) -> str:
    return f"not determined by these points: {', '.join(names)}; add points, or fit fewer parameters"


def _projected_factor(
    covariance: np.ndarray, sigma: np.ndarray, u: np.ndarray, qu: np.ndarray, *, rows: Sequence[str], overwrite: bool
) -> tuple[float, np.ndarray]:
    """Level and Cholesky factor of (1 - UU')Q(1 - UU') + level UU'.

    Q is scaled, the columns of U are orthonormal.
    """
    m, p = u.shape
    q = np.divide(covariance, sigma[:, None], out=covariance if overwrite else np.empty((m, m)))
    q /= sigma
    uqu = u.T @ qu
    level = float(np.trace(q) - np.trace(uqu)) / (m - p)
    half = np.asfortranarray(qu - 0.5 * u @ (uqu + level * np.eye(p)))
    base, filled = np.asfortranarray(u), q.T
    for a, b in ((half, base), (base, half)):
        filled = blas.dgemm(-1.0, a, b, beta=1.0, c=filled, trans_b=1, overwrite_c=1)
    norm = max(float(np.abs(filled[:, k : k + PANEL]).sum(axis=0).max()) for k in range(0, m, PANEL))
    variances = np.diag(filled).copy()
    factor, failed = lapack.dpotrf(filled, lower=1, clean=0, overwrite_a=1)
    condition = 0.0 if failed else lapack.dpocon(factor, norm, uplo="L")[0]
    if condition < SINGULAR:
        above = np.triu(factor, 1)  # still holds the matrix
        values, vectors = np.linalg.eigh(above + above.T + np.diag(variances))
        if values[0] < -NEGATIVE * m:
            raise EstimationError(NO_COVARIANCE.format(value=values[0]))
        part = np.sum(vectors[:, values < 10.0 * SINGULAR * values[-1]] ** 2, axis=1)
        named = [rows[int(i)] for i in np.argsort(-part)[:4] if part[i] > 1e-3 * part.max()]
        raise EstimationError(
            f"singular covariance: a combination of {', '.join(named)} has zero variance, and no free motion explains "
            "it; free more of the datum, or give fixed points their covariance"
        )
    return level, factor


def _solved(factor: np.ndarray, right: np.ndarray) -> np.ndarray:
    return np.asarray(lapack.dpotrs(factor, right, lower=1)[0].reshape(right.shape))


def _inverse_diagonal(factor: np.ndarray) -> np.ndarray:
    """Diagonal of (L L')^-1: squared norms of the columns of L^-1, a panel at a time."""
    m = len(factor)
    result = np.empty(m)
    for first in range(0, m, PANEL):
        wide = min(PANEL, m - first)
        columns = np.zeros((m - first, wide))
        columns[:wide] = np.eye(wide)
        for low in range(first, m, PANEL):
            high, at = min(low + PANEL, m), low - first
            part = columns[at : high - first]
            part -= factor[low:high, first:low] @ columns[:at]
            part[:] = lapack.dtrtrs(factor[low:high, low:high], part, lower=1)[0]
        result[first : first + wide] = np.sum(columns**2, axis=0)
    return result
