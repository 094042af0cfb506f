"""Least squares: Gauss-Newton over groups of (correlated) observations, with the statistics that make it checkable.

Systematic effects are parameters with priors, and a prior is an observation like any other ([FOERSTNER16] chapter 4).
The solver is scale-free: it converges on the size of a step in its own standard deviations, and judges rank on the
normal matrix scaled to a unit diagonal.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, lapack, solve_triangular

from catseye.errors import EstimationError
from catseye.estimation.observations import Observations

CONVERGED = "converged"
NOT_CONVERGED = "not converged: the last step was {step:.2g} standard deviations after {iterations} iterations; \
check the starting coordinates"
RANK_DEFICIENT = "rank deficient: {names} not held by any observation; add one, or give a prior"
UNDEFINED = "undefined at the present values: {names} has no finite value or derivative there; \
two points may coincide, or an observation is not a number"

NONCENTRALITY = 4.13  # two-sided test at 0.1 %, power 80 %, as [BAARDA68]: normal quantiles 3.29 + 0.84
STEP_IN_SIGMAS = 1e-3  # of all parameters together: a step below this no longer moves any answer
ROUNDING = 1.0 + 1e-12  # of a sum of squares: a step of no consequence does not count as uphill
WORST_CONDITION = 1e-14  # of the scaled normal matrix: beyond it double precision holds no digit


@dataclass(frozen=True)
class Fit:
    """How one group of observations fits; arrays over its m observations.

    name              the group's
    active            took part in the solution
    residual          observed minus predicted
    sigma             standard uncertainty of the observed value, as claimed before
    redundancy        share of an error in the observation that shows in its own residual; 0 to 1 if uncorrelated
    standardised      the residual's test statistic, N(0, 1) if the claim holds: Baarda's w with correlations; of an
                      inactive observation that of its prediction by the others
    estimated_error   the error in the observation that would explain it best
    detectable_error  the smallest error that the test finds with power 80 % at the level 0.1 %
    pvv               v' C^-1 v of the active ones
    """

    name: str
    active: np.ndarray
    residual: np.ndarray
    sigma: np.ndarray
    redundancy: np.ndarray
    standardised: np.ndarray
    estimated_error: np.ndarray
    detectable_error: np.ndarray
    pvv: float


@dataclass(frozen=True)
class Solution:
    """The answer of an adjustment.

    x            (n,) parameters
    covariance   (n, n); rows and columns of held parameters are zero, those of free ones nan where there is no answer
    status       "converged", or one line that says what to do
    iterations   Gauss-Newton steps taken
    fits         one a group, in the order given
    """

    x: np.ndarray
    covariance: np.ndarray
    status: str
    iterations: int
    fits: tuple[Fit, ...]

    def require_converged(self) -> "Solution":
        """This solution, or EstimationError with its status."""
        if self.status != CONVERGED:
            raise EstimationError(self.status)
        return self

    def variance_factor(self, names: Sequence[str] | None = None) -> tuple[float, float]:
        """[pvv] / degrees of freedom, expectation 1, and the degrees of freedom, over the groups named (all if None).

        Over all groups the degrees of freedom are observations minus free parameters; over some they are the sum of
        their redundancy numbers.

        Source: [FOERSTNER16] chapter 4, estimated variance factor and redundancy numbers.
        """
        chosen = [f for f in self.fits if names is None or f.name in names]
        degrees = float(sum(np.sum(f.redundancy[f.active]) for f in chosen))
        return (sum(f.pvv for f in chosen) / degrees if degrees > 1e-9 else float("nan")), degrees


@dataclass(frozen=True)
class _Block:
    """One group, cut to its active rows, with the Cholesky factor of their covariance (its root where independent)."""

    group: Observations
    rows: np.ndarray
    factor: np.ndarray

    def whiten(self, a: np.ndarray) -> np.ndarray:
        if self.factor.ndim == 1:
            return a / (self.factor if a.ndim == 1 else self.factor[:, None])
        return solve_triangular(self.factor, a, lower=True, check_finite=False)


def _blocks(
    groups: Sequence[Observations],
    active: Sequence[np.ndarray] | None,
    extra_variance: Sequence[np.ndarray] | None,
) -> list[_Block]:
    blocks = []
    for i, group in enumerate(groups):
        rows = np.arange(len(group.observed)) if active is None else np.flatnonzero(active[i])
        extra = extra_variance[i][rows] if extra_variance is not None else 0.0
        try:
            if group.covariance.ndim == 1:
                variance = group.covariance[rows] + extra
                if not np.all(variance > 0.0):
                    raise np.linalg.LinAlgError
                factor = np.sqrt(variance)
            else:
                factor = np.linalg.cholesky(group.covariance[np.ix_(rows, rows)] + np.diag(np.zeros(len(rows)) + extra))
        except np.linalg.LinAlgError:
            raise EstimationError(
                f"{group.name}: the covariance of its {len(rows)} observations is not positive definite; "
                "a sigma is zero or two observations repeat each other"
            ) from None
        blocks.append(_Block(group, rows, factor))
    return blocks


def _cost(blocks: Sequence[_Block], x: np.ndarray) -> float:
    return sum(float(np.sum(b.whiten((b.group.observed - b.group.predict(x)[0])[b.rows]) ** 2)) for b in blocks)


def _normal_equations(blocks: Sequence[_Block], x: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    normal, right, cost = np.zeros((len(x), len(x))), np.zeros(len(x)), 0.0
    for block in blocks:
        values, jacobian = block.group.predict(x)
        a = block.whiten(jacobian[block.rows])
        v = block.whiten((block.group.observed - values)[block.rows])
        columns = block.group.columns
        normal[np.ix_(columns, columns)] += a.T @ a
        right[columns] += a.T @ v
        cost += float(v @ v)
    return normal, right, cost


def adjust(
    x0: np.ndarray,
    groups: Sequence[Observations],
    *,
    free: np.ndarray | None = None,
    active: Sequence[np.ndarray] | None = None,
    extra_variance: Sequence[np.ndarray] | None = None,
    names: Sequence[str] | None = None,
    iterations: int = 50,
    tests: bool = True,
) -> Solution:
    """The parameters that fit groups of observations best, with full covariance and a fit per observation.

    x0              (n,) start values
    groups          observations; groups are independent of each other, inside one they may be correlated
    free            (n,) bool: False holds a parameter at its start value (default: all free)
    active          one (m,) bool array a group: False leaves an observation out, but still predicts it
    extra_variance  one (m,) array a group, added to the diagonal of its covariance (robust down-weighting)
    names           (n,) what the parameters are called, for the status
    iterations      cap of Gauss-Newton steps; a step that raises the cost is halved, ten times at most
    tests           False leaves the fits at residual and sigma and the covariance at zero, on the way to an answer

    Returns a Solution whose status says what happened; raises EstimationError only for a covariance that is none.

    Source: [FOERSTNER16] chapter 4 (Gauss-Markov model), [BAARDA68] (w test, detectable errors; here correlated).
    """
    x = np.array(x0, dtype=float)
    moving = np.arange(len(x)) if free is None else np.flatnonzero(free)
    blocks = _blocks(groups, active, extra_variance)
    covariance = np.zeros((len(x), len(x)))
    status, taken, size = NOT_CONVERGED, 0, np.inf
    while taken < iterations:
        taken += 1
        normal, right, cost = _normal_equations(blocks, x)
        if not (np.isfinite(cost) and np.isfinite(normal).all()):
            covariance[np.ix_(moving, moving)] = np.nan
            status = UNDEFINED.format(names=", ".join(_undefined(blocks, x)))
            break
        factor, scale, floating = _factorise(normal[np.ix_(moving, moving)])
        if floating:
            called = [names[int(moving[i])] if names is not None else f"parameter {moving[i]}" for i in floating]
            covariance[np.ix_(moving, moving)] = np.nan  # zero would claim to know what nothing holds
            status = RANK_DEFICIENT.format(names=", ".join(called[:4]) + (" ..." if len(called) > 4 else ""))
            break
        step = np.zeros(len(x))
        step[moving] = scale * cho_solve((factor, True), scale * right[moving], check_finite=False)
        size = max(float(right @ step), 0.0) ** 0.5
        if tests and (size < STEP_IN_SIGMAS or taken == iterations):
            covariance[np.ix_(moving, moving)] = _inverse(factor, scale)
        if size < STEP_IN_SIGMAS:
            status = CONVERGED
            break
        trials = [x + step * 0.5**halving for halving in range(11)]
        x = next((trial for trial in trials if _cost(blocks, trial) <= cost * ROUNDING), x)
    if status == NOT_CONVERGED:
        status = NOT_CONVERGED.format(step=size, iterations=taken)
    return Solution(x, covariance, status, taken, tuple(_fit(block, x, covariance, tests) for block in blocks))


def _undefined(blocks: Sequence[_Block], x: np.ndarray) -> list[str]:
    """Names of the groups that have no finite value or derivative, each once."""
    bad = [b.group.name for b in blocks for v in b.group.predict(x) if not np.isfinite(v[b.rows]).all()]
    bad += [b.group.name for b in blocks if not np.isfinite(b.group.observed[b.rows]).all()]
    return list(dict.fromkeys(bad)) or ["the sum of squares"]


def _factorise(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Cholesky factor of a normal matrix scaled to a unit diagonal, the scale, and which parameters float, worst first.

    Scaled, so that metres, radians, volts and degrees weigh alike; with something floating the factor is of no use.
    """
    diagonal = np.diag(normal)
    if np.any(diagonal <= 0.0):
        return normal, diagonal, np.flatnonzero(diagonal <= 0.0).tolist()
    scale = 1.0 / np.sqrt(diagonal)
    scaled = normal * scale[:, None] * scale
    if not len(scale):  # everything held: only the tests are wanted
        return scaled, scale, []
    factor, failed = lapack.dpotrf(scaled, lower=1)
    condition = 0.0 if failed else lapack.dpocon(factor, np.abs(scaled).sum(axis=0).max(), uplo="L")[0]
    if condition < WORST_CONDITION:
        values, vectors = np.linalg.eigh(scaled)
        part = np.sum(vectors[:, values < max(len(scaled) * 1e-13, values[0] * 10)] ** 2, axis=1)
        return scaled, scale, [int(i) for i in np.argsort(-part) if part[i] > 1e-3 * part.max()]
    return factor, scale, []


def _inverse(factor: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """The inverse of the normal matrix from its factor."""
    if not len(scale):
        return factor
    inverse = np.tril(lapack.dpotri(factor, lower=1)[0])
    return (inverse + np.tril(inverse, -1).T) * scale[:, None] * scale


def _fit(block: _Block, x: np.ndarray, covariance: np.ndarray, tests: bool) -> Fit:
    """Residuals and tests of one group, exact with correlations inside the group.

    With P = C^-1 and P_v = P - P A Q A' P over the active rows: w = (P v) / sqrt(diag P_v), estimated error
    (P v) / diag P_v, redundancy diag(P_v C). An inactive row is predicted from the parameters and from the residuals
    of the rows that it is correlated with.
    """
    group, rows = block.group, block.rows
    m = len(group.observed)
    values, jacobian = group.predict(x)
    residual = group.observed - values
    active = np.zeros(m, dtype=bool)
    active[rows] = True
    correlated = group.covariance.ndim == 2
    variance = np.diag(group.covariance) if correlated else group.covariance
    redundancy, standardised, error, detectable = (np.zeros(m) for _ in range(4))
    fit = Fit(
        group.name,
        active,
        residual,
        np.sqrt(variance),
        redundancy,
        standardised,
        error,
        detectable,
        float(np.sum(block.whiten(residual[rows]) ** 2)),
    )
    if not tests:
        return fit
    q = covariance[np.ix_(group.columns, group.columns)]
    seen = jacobian[rows]
    if correlated:
        weight = block.whiten(np.eye(len(rows)))
        weight = weight.T @ weight
        weighted, pv, own = weight @ seen, weight @ residual[rows], np.diag(weight)
    else:
        own = 1.0 / block.factor**2
        weighted, pv = seen * own[:, None], residual[rows] * own
    spread = weighted @ q
    visible = np.maximum(own - np.sum(spread * weighted, axis=1), 1e-12 * own)  # without a check it stays finite
    redundancy[rows] = 1.0 - np.sum(spread * seen, axis=1)
    standardised[rows] = pv / np.sqrt(visible)
    error[rows] = pv / visible
    detectable[rows] = NONCENTRALITY / np.sqrt(visible)

    out = np.flatnonzero(~active)
    if len(out):
        cross = group.covariance[np.ix_(out, rows)] if correlated else np.zeros((len(out), len(rows)))
        gain = cross @ weight if correlated else cross
        surprise = residual[out] - gain @ residual[rows]
        rest = jacobian[out] - gain @ seen
        expected = variance[out] - np.sum(gain * cross, axis=1) + np.sum((rest @ q) * rest, axis=1)
        standardised[out] = surprise / np.sqrt(expected)
        error[out] = surprise
        detectable[out] = NONCENTRALITY * np.sqrt(expected)
        redundancy[out] = 1.0
    return fit
