"""Linear fit for cyclic terms and amplitude coupling."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import EstimationError, ValidityError

WORST_CONDITION = 1e8  # of columns scaled to unit length: beyond it half of the digits are lost


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Coefficients, covariance and tests of a linear fit.

    coefficient          (p,) in the order of the columns
    covariance           (p, p), from the given uncertainties alone
    residual             (n,) observed minus predicted
    variance_factor      sum of squares of the standardised residuals over the degrees; NaN without redundancy
    degrees_of_freedom   n - p
    """

    coefficient: Array
    covariance: Array
    residual: Array
    variance_factor: float
    degrees_of_freedom: int

    @property
    def u(self) -> Array:
        """Standard uncertainties (p,)."""
        return np.sqrt(np.diag(self.covariance))


def fit_columns(design: ArrayLike, observed: ArrayLike, spread: ArrayLike) -> LinearFit:
    """Least squares with given uncertainties: observed = design @ coefficient.

    design     (n, p)
    observed   (n,)
    spread     standard uncertainty, one number or (n,), above 0; or the full covariance, (n, n)

    Raises ValidityError for invalid readings or uncertainties, EstimationError where the columns cannot be
    separated.

    Source: Gauss and Markov; [FOERSTNER16] chapter 4. Exact but for rounding.

    >>> fit_columns([[1.0], [1.0]], [1.0, 2.0], 0.1).coefficient.round(12).tolist()
    [1.5]
    """
    a, y, s = np.asarray(design, dtype=float), np.asarray(observed, dtype=float), np.asarray(spread, dtype=float)
    unknown = ~(np.isfinite(y) & np.all(np.isfinite(a), axis=1))
    if np.any(unknown):
        raise ValidityError(f"reading {int(np.flatnonzero(unknown)[0])} is not a finite number: leave it out")
    if s.ndim < 2:
        if not (np.all(s > 0.0) and np.all(np.isfinite(s))):
            raise ValidityError(f"standard uncertainty {np.min(s)} is not above 0 and finite")
        s = np.broadcast_to(s, y.shape)
        white, white_y = a / s[:, None], y / s
    else:
        try:
            factor = np.linalg.cholesky(s)
        except np.linalg.LinAlgError:
            raise ValidityError("the covariance of the readings is not positive definite") from None
        white, white_y = np.linalg.solve(factor, a), np.linalg.solve(factor, y)
    length = np.linalg.norm(white, axis=0)
    if a.shape[0] < a.shape[1] or np.any(length == 0.0) or np.linalg.cond(white / length) > WORST_CONDITION:
        raise EstimationError(f"{len(y)} readings do not separate {a.shape[1]} coefficients: leave one out, or spread")
    inverse = np.linalg.pinv(white / length) / length[:, None]
    coefficient = inverse @ white_y
    degrees = len(y) - a.shape[1]
    squares = float(np.sum((white_y - white @ coefficient) ** 2))
    factor_ = squares / degrees if degrees else float("nan")
    return LinearFit(coefficient, inverse @ inverse.T, y - a @ coefficient, factor_, degrees)
