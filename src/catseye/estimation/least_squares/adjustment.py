"""Gauss-Newton least squares over groups of (correlated) observations, with test statistics.

Systematic effects are parameters with priors, and a prior is an observation like any other ([FOERSTNER16] chapter 4).
The solver is scale-free: it converges on the size of a step in its own standard deviations, and determines rank from
columns scaled to unit length. Small systems are solved dense, large ones sparse, with the same result.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import sparray

from catseye.errors import ArgumentError, EstimationError
from catseye.estimation.least_squares.bordered import Border
from catseye.estimation.least_squares.covariance import Covariance, Dense
from catseye.estimation.least_squares.normal import NormalEquations
from catseye.estimation.least_squares.rows import ActiveRows, variances
from catseye.estimation.least_squares.status import (
    CONVERGED,
    AdjustmentOutcome,
    Status,
    not_converged,
    rank_deficient,
    undefined,
)
from catseye.estimation.observations.kinds import ObservationGroup

NONCENTRALITY = 4.13  # two-sided test at 0.1 %, power 80 %, as [BAARDA68]: normal quantiles 3.29 + 0.84
STEP_IN_SIGMAS = 1e-3  # norm over all parameters: a further step changes no result
ROUNDING = 1.0 + 1e-12  # of a sum of squares: an increase within rounding is accepted


@dataclass(frozen=True)
class GroupFit:
    """Fit of one group of m observations.

    name              of the group
    active            True for observations used in the solution
    residual          observed minus predicted
    sigma             a-priori standard uncertainty of the observed value
    redundancy        redundancy number: share of an error that shows in its own residual; 0 to 1 if uncorrelated
    standardised      standardised residual, N(0, 1) if the a-priori covariance holds: Baarda's w with correlations;
                      for an inactive observation that of its prediction from the others
    estimated_error   estimate of a gross error in this observation alone
    detectable_error  smallest gross error that the test detects with power 80 % at the level 0.1 %
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
class LeastSquaresSolution:
    """Result of an adjustment.

    x            (n,) parameters
    q            their covariance; zero rows and columns for fixed parameters, all nan without a solution
    status       "converged", or one line that says what to do
    iterations   Gauss-Newton steps taken
    fits         one per group, in input order
    floating     (f, n) orthonormal null-space directions, in parameters scaled to unit columns; f = 0 unless the
                 rank is deficient
    """

    x: np.ndarray
    q: Covariance
    status: Status
    iterations: int
    fits: tuple[GroupFit, ...]
    floating: np.ndarray

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance (n, n); EstimationError for a system too large for it."""
        return self.q.matrix()

    def require_converged(self) -> "LeastSquaresSolution":
        """Return this solution, or raise EstimationError with its status."""
        if self.status != CONVERGED:
            raise EstimationError(self.status)
        return self

    @property
    def solved(self) -> bool:
        """True if every parameter is determined, converged or not."""
        return not len(self.floating) and self.status.outcome is not AdjustmentOutcome.UNDEFINED

    def variance_factor(self, names: Sequence[str] | None = None) -> tuple[float, float]:
        """Variance factor [pvv] / degrees of freedom (expectation 1), and the degrees of freedom.

        names   of groups; all if None

        Over all groups the degrees of freedom are observations minus free parameters; over some they are the sum of
        their redundancy numbers.

        Source: [FOERSTNER16] chapter 4, estimated variance factor and redundancy numbers.
        """
        chosen = [f for f in self.fits if names is None or f.name in names]
        degrees = float(sum(np.sum(f.redundancy[f.active]) for f in chosen))
        return (sum(f.pvv for f in chosen) / degrees if degrees > 1e-9 else float("nan")), degrees


@dataclass(frozen=True)
class SolverSettings:
    """Settings of a least-squares estimate, from the option of a command down to the solver.

    iterations   cap of Gauss-Newton steps; a step that raises the cost is halved, at most ten times
    tests        False: only residuals and sigmas in the fits, zero covariance (for intermediate solutions)
    sparse       solve sparse or dense; chosen by size if None
    border       eliminate the parameters outside a border by blocks, see `bordered`; None: as `sparse` says
    rough        with a border: tests accurate to a thousandth are enough (while selecting observations)

    In all of `estimation`, `iterations` caps the steps of one estimate and `rounds` a search that solves anew in each,
    such as the rejection of one observation after the other.

    Raises ArgumentError for a cap below 1.
    """

    iterations: int = 50
    tests: bool = True
    sparse: bool | None = None
    border: Border | None = None
    rough: bool = False

    def __post_init__(self) -> None:
        if self.iterations < 1:
            raise ArgumentError(f"iterations = {self.iterations} is invalid (expected 1 or more)", "iterations")


COMPLETE = SolverSettings()


def adjust(
    x0: np.ndarray,
    groups: Sequence[ObservationGroup],
    *,
    free: np.ndarray | None = None,
    active: Sequence[np.ndarray] | None = None,
    extra_variance: Sequence[np.ndarray] | None = None,
    inflation: Sequence[np.ndarray] | None = None,
    names: Sequence[str] | None = None,
    solver: SolverSettings = COMPLETE,
) -> LeastSquaresSolution:
    """Least-squares parameters of groups of observations, with full covariance and fits.

    x0              (n,) start values
    groups          observations; groups are independent of each other, inside one they may be correlated
    free            (n,) bool: False fixes a parameter at its start value (default: all free)
    active          one (m,) bool array a group: False leaves an observation out, but still predicts it
    extra_variance  one (m,) array a group, added to the diagonal of its covariance (robust down-weighting)
    inflation       one (m,) array a group, a factor on its standard uncertainties; correlations stay
    names           (n,) parameter names, for the status
    solver          step limit, tests or not, sparse or dense

    The status of the solution describes any failure; raises EstimationError only for a covariance that is not
    positive definite.

    Source: [FOERSTNER16] chapter 4 (Gauss-Markov model), [BAARDA68] (w test, detectable errors; here correlated).
    """
    x = np.array(x0, dtype=float)
    n = len(x)
    free_columns = np.arange(n) if free is None else np.flatnonzero(free)
    options = [[None] * len(groups) if part is None else list(part) for part in (active, extra_variance, inflation)]
    rows = [ActiveRows.of(g, *parts) for g, *parts in zip(groups, *options, strict=True)]
    tests, iterations = solver.tests, solver.iterations
    normal = NormalEquations.of(rows, free_columns, n, solver.sparse, solver.border)
    small_dense = not normal.sparse and normal.border is None and len(free_columns) > 0
    q: Covariance = Dense(np.zeros((n, n))) if small_dense else _NoCovariance(n)
    floating = np.zeros((0, n))
    status, steps, size = None, 0, np.inf
    while steps < iterations:
        steps += 1
        step, size, cost = normal.step(x)
        if not np.isfinite(cost):
            q = _NoCovariance(n, np.nan, free_columns)
            status = undefined(", ".join(_undefined(rows, x)))
            break
        floating = normal.floating()
        if len(floating):
            part = np.sum(floating**2, axis=0)
            worst = [int(i) for i in np.argsort(-part) if part[i] > 1e-3 * part.max()]
            called = [names[i] if names is not None else f"parameter {i}" for i in worst[:4]]
            q = _NoCovariance(n, np.nan, free_columns)  # zero would claim certainty of an undetermined parameter
            status = rank_deficient(", ".join(called) + (" ..." if len(worst) > 4 else ""))
            break
        if tests and (size < STEP_IN_SIGMAS or steps == iterations):
            q = normal.covariance(rough=solver.rough)
        x, moved = _lower(rows, x, step, cost)
        if size < STEP_IN_SIGMAS:
            status = CONVERGED
            break
        if not moved:
            break
    fits = tuple(_fit(r, x, q, tests) for r in rows)
    return LeastSquaresSolution(
        x=x, q=q, status=status or not_converged(size, steps), iterations=steps, fits=fits, floating=floating
    )


def _lower(rows: Sequence[ActiveRows], x: np.ndarray, step: np.ndarray, cost: float) -> tuple[np.ndarray, bool]:
    """First of x + step, x + step/2, ... that does not raise the cost.

    Returns x itself if none does.
    """
    for halving in range(11):
        trial = x + step * 0.5**halving
        if sum(r.cost(trial) for r in rows) <= cost * ROUNDING:
            return trial, True
    return x, False


@dataclass(frozen=True, eq=False)
class _NoCovariance:
    """Placeholder covariance: zero if not computed, nan without a solution."""

    size: int
    value: float = 0.0
    moving: np.ndarray | None = None

    def matrix(self) -> np.ndarray:
        full = np.zeros((self.size, self.size))
        if self.moving is not None:
            full[np.ix_(self.moving, self.moving)] = self.value
        return full

    def across(self, columns: np.ndarray) -> np.ndarray:
        return np.full((self.size, len(columns)), self.value)

    def products(self, columns: np.ndarray, a: np.ndarray) -> np.ndarray:
        return np.full(columns.shape, self.value)

    def within(self, columns: np.ndarray) -> np.ndarray:
        return np.full((len(columns), len(columns)), self.value)

    def blocks(self, first: np.ndarray) -> np.ndarray:
        return np.full((len(first), 3, 3), self.value)

    def solve(self, b: np.ndarray) -> np.ndarray:
        return np.full(b.shape, self.value)

    def carried(self, matrix: sparray, other_matrix: sparray | None = None) -> np.ndarray:
        return np.full((matrix.shape[0], (matrix if other_matrix is None else other_matrix).shape[0]), self.value)

    def diagonal(self) -> np.ndarray:
        return np.full(self.size, self.value)


def _undefined(rows: Sequence[ActiveRows], x: np.ndarray) -> list[str]:
    """Names of the groups without finite values or derivatives, each once."""
    bad = [r.group.name for r in rows for v in r.group.predict(x) if not np.isfinite(v[r.active]).all()]
    bad += [r.group.name for r in rows if not np.isfinite(r.group.observed[r.active]).all()]
    return list(dict.fromkeys(bad)) or ["the sum of squares"]


def _fit(rows: ActiveRows, x: np.ndarray, q: Covariance, tests: bool) -> GroupFit:
    """Residuals and tests of one group, exact with correlations inside the group.

    With P = C^-1 and P_v = P - P A Q A' P over the active rows: w = (P v) / sqrt(diag P_v), estimated error
    (P v) / diag P_v, redundancy diag(P_v C). An inactive row is predicted from the parameters and from the
    residuals of the rows it is correlated with.
    """
    group, on = rows.group, rows.active
    m = len(group.observed)
    values, jacobian = group.predict(x)
    residual = group.observed - values
    variance = variances(group)
    v = np.where(on, residual, 0.0)
    redundancy, standardised, error, detectable = (np.zeros(m) for _ in range(4))
    pvv = float(np.sum(rows.whiten(v) ** 2))
    fit = GroupFit(
        name=group.name,
        active=on,
        residual=residual,
        sigma=np.sqrt(variance),
        redundancy=redundancy,
        standardised=standardised,
        estimated_error=error,
        detectable_error=detectable,
        pvv=pvv,
    )
    if not tests:
        return fit
    wide = rows.spread(jacobian)
    design = np.where(on[:, None], wide, 0.0)
    weighted, pv, weight_diagonal = rows.weigh(design), rows.weigh(v), rows.own_weight()
    spread = rows.products(q, weighted)
    # the lower limit keeps unchecked observations finite
    visible = np.maximum(weight_diagonal - np.sum(spread * weighted, axis=1), 1e-12 * weight_diagonal)
    redundancy[:] = 1.0 - np.sum(spread * design, axis=1)
    standardised[:] = pv / np.sqrt(visible)
    error[:] = pv / visible
    detectable[:] = NONCENTRALITY / np.sqrt(visible)
    out = np.flatnonzero(~on)
    if len(out):
        gain, expected = rows.prediction(out)
        remaining_design = wide[out] - gain @ design if gain is not None else wide[out]
        prediction_error = residual[out] - gain @ v if gain is not None else residual[out]
        expected = expected + np.sum(rows.products(q, remaining_design, out) * remaining_design, axis=1)
        redundancy[out] = 1.0
        standardised[out] = prediction_error / np.sqrt(expected)
        error[out] = prediction_error
        detectable[out] = NONCENTRALITY * np.sqrt(expected)
    return fit
